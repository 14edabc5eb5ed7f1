"""Runs that are killed, stopped or cut short go on from their checkpoint as if nothing had happened."""

import json
import os
import random
import signal
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from process_runs import fields, run, start, state, steps_done

MECHANICS = ("displacement", "bubble", "multiplier", "previous_jump", "initial_jump")
FLOW = ("pressure_cell", "pressure_trace", "pressure_fracture", "pressure_ridge")
BEFORE = tuple("before_" + name for name in (*MECHANICS[:3], "normal_bubble", *FLOW))
WET = (*MECHANICS, "normal_bubble", *FLOW, *BEFORE)
# name, scene and options, tables of its checkpoint, where a first run may end
CASES = (
    ("rock", ("load_history.yaml",), MECHANICS, 0.4),
    ("rock by multigrid", ("load_history.yaml", "-displacement_pc_type", "gamg"), MECHANICS, 0.4),
    ("fluid", ("injection.yaml",), FLOW, 1.234),
    ("wet rock, whose steps share a factorisation", ("../../../examples/mandel/scene.yaml", "-set", "time.step=1", "-set", "time.end=8"),
     ("displacement", "pressure_cell", "pressure_trace"), 4),
    ("both", ("wet_crack.yaml",), WET, 800),
    ("both by multigrid", ("wet_crack.yaml", "-coupled_pc_type", "fieldsplit", "-set", "mechanics.bubbles=fracture"),
     tuple(table for table in WET if "normal_bubble" not in table), 800),
    ("both by multigrid, bubbles on all faces", ("wet_crack.yaml", "-coupled_pc_type", "fieldsplit"), WET, 800),
)


class Restart(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.whole, self.parts = Path(folder.name) / "whole", Path(folder.name) / "parts"

    def assert_same_to_the_bit(self, tables):
        for table in ("history.csv", "newton.csv"):
            self.assertEqual((self.parts / table).read_text(), (self.whole / table).read_text(), table)
        whole, parts = state(self.whole, tables), state(self.parts, tables)
        for table in tables:
            self.assertEqual(parts[table], whole[table], table)

    def assert_close(self, tables, tolerance):
        whole, parts = state(self.whole, tables), state(self.parts, tables)
        for table in tables:
            like = "displacement" if "jump" in table else table  # jumps may be nothing but round-off
            size = max(map(abs, whole[like]))
            for one, other in zip(parts[table], whole[table], strict=True):
                self.assertAlmostEqual(one, other, delta=tolerance * size, msg=table)

    def test_load_history_survives_being_killed_at_any_step(self):
        run("load_history.yaml", self.whole)
        chance = random.Random(7)
        kills = 0
        for words in [()] + 20 * [("-restart",)]:
            if words and not (self.parts / "checkpoint.h5").exists():
                words = ()  # killed before its first checkpoint
            before = steps_done(self.parts)
            process = start("load_history.yaml", self.parts, *words)
            until = before + chance.randint(1, 5)
            while process.poll() is None and steps_done(self.parts) < until:
                time.sleep(0.001)
            process.send_signal(signal.SIGKILL)
            process.communicate()
            kills += process.returncode == -signal.SIGKILL
            if process.returncode == 0:
                break
        run("load_history.yaml", self.parts, "-restart")
        self.assertGreaterEqual(kills, 3)
        self.assert_same_to_the_bit(MECHANICS)
        for name, series in (("displacement", "matrix"), ("stress", "matrix"), ("friction_state", "fractures")):
            self.assertEqual(fields(self.parts, name, series)[-1], fields(self.whole, name, series)[-1], name)

    def test_the_end_may_be_put_off(self):
        for name, (scene, *options), tables, first_end in CASES:
            with self.subTest(name):
                whole, parts = self.whole, self.parts
                self.whole, self.parts = whole / name, parts / name
                run(scene, self.whole, *options)
                run(scene, self.parts, *options, "-set", f"time.end={first_end}", "-set", "output.every=1")
                log = run(scene, self.parts, *options, "-restart")
                self.assertIn("going on from step", log)
                self.assert_same_to_the_bit(tables)
                summaries = [json.loads((folder / "summary.json").read_text()) for folder in (self.whole, self.parts)]
                for part in ("steps", "newton", "krylov", "active_set", "balance", "extremes"):
                    self.assertEqual(summaries[1][part], summaries[0][part], part)
                self.whole, self.parts = whole, parts

    def test_fields_after_the_checkpoint_are_dropped_and_written_again(self):
        run("injection.yaml", self.whole, "-set", "output.checkpoint_every=0")
        run("injection.yaml", self.parts, "-set", "time.end=1.234", "-set", "output.checkpoint_every=0")
        kept = (self.parts / "checkpoint.h5").read_bytes()
        run("injection.yaml", self.parts, "-restart")
        (self.parts / "checkpoint.h5").write_bytes(kept)
        run("injection.yaml", self.parts, "-restart")
        self.assert_same_to_the_bit(FLOW)
        self.assertEqual(fields(self.parts, "pressure"), fields(self.whole, "pressure"))
        self.assertEqual((self.parts / "matrix.xdmf").read_text(), (self.whole / "matrix.xdmf").read_text())

    def test_another_number_of_ranks_may_go_on(self):
        for name, (scene, *options), tables, first_end in CASES:
            with self.subTest(name):
                whole, parts = self.whole, self.parts
                self.whole, self.parts = whole / name, parts / name
                run(scene, self.whole, *options)
                run(scene, self.parts, *options, "-set", f"time.end={first_end}", ranks=2)
                run(scene, self.parts, *options, "-restart", ranks=3)
                self.assert_close(tables, 1e-8)
                self.whole, self.parts = whole, parts

    def test_a_signal_ends_a_run_with_a_checkpoint(self):
        run("injection.yaml", self.whole)
        process = start("injection.yaml", self.parts, "-set", "output.checkpoint_every=0")
        while process.poll() is None and steps_done(self.parts) < 3:
            time.sleep(0.001)
        process.send_signal(signal.SIGTERM)
        log, _ = process.communicate()
        self.assertEqual(process.returncode, 143)
        self.assertIn("-restart goes on", log)
        self.assertEqual(json.loads((self.parts / "summary.json").read_text())["status"], "stopped")
        run("injection.yaml", self.parts, "-restart", "-set", "output.checkpoint_every=0")
        self.assert_same_to_the_bit(FLOW)

    def test_a_checkpoint_may_start_another_folder(self):
        run("injection.yaml", self.whole)
        run("injection.yaml", self.parts, "-set", "time.end=1.234")
        other = self.parts.parent / "other"
        run("injection.yaml", other, "-restart", str(self.parts / "checkpoint.h5"))
        self.assertEqual(state(other, FLOW), state(self.whole, FLOW))
        rows = (self.whole / "history.csv").read_text().splitlines()
        self.assertEqual((other / "history.csv").read_text().splitlines(), [rows[0], *rows[1 + steps_done(self.parts):]])

    def test_what_does_not_fit_is_refused_with_a_sentence(self):
        run("injection.yaml", self.parts, "-set", "time.end=1.234")
        for words, sentence in (
            (["-restart", "-set", "materials[0].storage=2e-9"], "materials[0].storage was \"1e-9\" and is \"2e-9\""),
            (["-restart", "-set", "time.step=0.05"], "time.step was"),
            (["-restart_changed_scene", "-set", "mesh.box.cells=[8,8]"], "is of another mesh"),
            (["-restart", str(self.parts / "history.csv")], "this is not a checkpoint"),
            (["-restart", str(self.parts / "nothing.h5")], "there is no checkpoint"),
        ):
            log = run("injection.yaml", self.parts, *words, expect=2)
            self.assertIn(sentence, log)
        run("injection.yaml", self.parts, "-restart_changed_scene", "-set", "materials[0].storage=2e-9")

    def test_a_semaphore_that_a_killed_run_left_holds_up_no_other(self):
        left = Path("/dev/shm/sem.OMPIO_checkpoint.h5.part")  # as Open MPI's own file layer leaves it, taken
        if left.exists() or not os.access(left.parent, os.W_OK):
            self.skipTest(f"{left} cannot be made here")
        with tempfile.TemporaryDirectory() as directory:
            left.write_bytes(bytes(32))
            try:
                process = start("load_history.yaml", Path(directory))
                process.communicate(timeout=30)
                self.assertEqual(process.returncode, 0)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
            finally:
                left.unlink(missing_ok=True)


if __name__ == "__main__":
    unittest.main()
