"""Faults of disk, memory, processes and checkpoints: nothing accepted is lost, outputs stay readable, and a sentence says what happened.

Kills at random moments, stops by a signal and changed scenes are those of regression/restart.py.
"""

import json
import os
import random
import resource
import signal
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from hdf5_tables import Tables
from process_runs import run, start, state, steps_done

SCENE, TABLES = "load_history.yaml", ("displacement", "bubble", "multiplier", "previous_jump", "initial_jump")
EACH_STEP = ("-set", "output.every=1")
SERIES = ("matrix", "fractures")


# One step, with limits [MB] that the run meets while it reads, orders, factorises, sets up multigrid or writes.
FINE, FINE_WET = ("-set", "time.end=0.05", "-set", "mesh.box.cells=[200,200]"), ("-set", "time.end=20", "-set", "mesh.box.cells=[100,100]")
LIMITED = ((SCENE, FINE, range(400, 690, 20)),
           ("wet_crack.yaml", FINE_WET, range(560, 720, 30)),
           ("wet_crack.yaml", (*FINE_WET, "-coupled_pc_type", "lu"), range(560, 720, 30)),
           (SCENE, (*FINE, "-displacement_pc_type", "gamg"), range(560, 650, 30)),
           (SCENE, (*FINE, "-displacement_pc_type", "hypre"), range(560, 650, 30)))


def limited_to(megabytes):
    """What makes a process one of so much memory."""
    return lambda: resource.setrlimit(resource.RLIMIT_AS, (megabytes * 1_000_000, resource.RLIM_INFINITY))


def mounted(folder, kilobytes):
    """Whether a small file system could be mounted on the folder."""
    return subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", folder], capture_output=True, check=False).returncode == 0


class Faults(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.whole, self.parts = self.folder / "whole", self.folder / "parts"

    def times_written(self):
        """Of each series: the times that its XDMF text names, all of which its HDF5 file must hold."""
        counts = []
        for series in SERIES:
            text = self.parts / f"{series}.xdmf"
            counts.append(text.read_text().count("<Time ") if text.exists() else 0)
            with Tables(self.parts / f"{series}.h5") as file:
                for i in range(counts[-1]):
                    self.assertTrue(file.has(f"/fields/{i}"), f"{series} at its time {i}")
        return counts

    def assert_goes_on_as_if_nothing_had_happened(self, *words, ranks=1):
        if not self.whole.exists():
            run(SCENE, self.whole, *EACH_STEP)
        run(SCENE, self.parts, *EACH_STEP, *words, ranks=ranks)
        whole, parts = state(self.whole, TABLES), state(self.parts, TABLES)
        for table in TABLES:
            for one, other in zip(parts[table], whole[table], strict=True):
                self.assertAlmostEqual(one, other, delta=(1e-8 if ranks > 1 else 0) * (1 + abs(other)), msg=table)
        if ranks == 1:
            self.assertEqual((self.parts / "history.csv").read_text(), (self.whole / "history.csv").read_text())
            self.assertEqual(self.times_written(), [20, 20])

    # Disk

    def test_a_full_disk_ends_a_run_that_can_go_on(self):
        sizes = random.Random(3).sample(range(180, 600), 3)
        for kilobytes in sizes:
            with self.subTest(kilobytes=kilobytes):
                disk = self.folder / "disk"
                disk.mkdir(exist_ok=True)
                if not mounted(disk, kilobytes):
                    self.skipTest("no file system can be mounted here")
                try:
                    self.parts = disk / "parts"
                    log = run(SCENE, self.parts, *EACH_STEP, expect=4)
                    self.assertRegex(log, r"polyslip: \S+: .*(cannot|No space).*")
                    self.assertIn("-restart goes on from step", log)
                    written = self.times_written()
                    self.assertGreaterEqual(min(written), 1)
                    subprocess.run(["mount", "-o", "remount,size=10m", disk], check=True)
                    self.assert_goes_on_as_if_nothing_had_happened("-restart")
                finally:
                    subprocess.run(["umount", disk], check=True)

    def test_a_limit_on_file_sizes_is_like_a_full_disk(self):
        for size in random.Random(5).sample(range(100_000, 600_000), 2):
            with self.subTest(size=size):
                self.parts = self.folder / f"parts_{size}"
                process = start(SCENE, self.parts, *EACH_STEP)
                while process.poll() is None and steps_done(self.parts) < 1:  # MPI itself needs larger files at its start
                    time.sleep(0.001)
                resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
                log, _ = process.communicate(timeout=60)
                self.assertEqual(process.returncode, 4, log)
                self.assertIn("has room", log)
                self.times_written()
                self.assert_goes_on_as_if_nothing_had_happened("-restart")

    def test_a_folder_that_cannot_be_written_is_refused(self):
        (self.folder / "file").write_text("no folder")
        for folder in (Path("/proc/self"), Path("/proc/nothing"), self.folder / "file", self.folder / "file" / "below"):
            log = run(SCENE, folder, expect=2)
            self.assertRegex(log, rf"polyslip: {folder}: the output directory cannot be .*-o DIR")

    # Processes

    def test_a_killed_rank_ends_the_others_and_leaves_its_steps(self):
        process = start(SCENE, self.parts, *EACH_STEP, ranks=2)
        while process.poll() is None and steps_done(self.parts) < 4:
            time.sleep(0.001)
        ranks = [int(pid) for pid in subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True, check=True).stdout.split()]
        os.kill(ranks[-1], signal.SIGKILL)
        process.communicate(timeout=60)
        self.assertNotEqual(process.returncode, 0)
        self.assertFalse((self.parts / "summary.json").exists())
        self.assertGreaterEqual(min(self.times_written()), 2)
        self.assert_goes_on_as_if_nothing_had_happened("-restart", ranks=2)

    def test_lack_of_memory_is_told(self):
        for cells in ("[1500,1500]", "[3000,3000]"):
            log = run(SCENE, self.parts, "-set", f"mesh.box.cells={cells}", expect=4, preexec_fn=limited_to(1500))
            self.assertRegex(log, r"polyslip: out of memory: this rank has used \d+ MB and gets no more\. Use fewer cells")
        log = run(SCENE, self.parts, "-set", "mesh.box.cells=[45000,45000]", expect=2)
        self.assertRegex(log, r"load_history.yaml:\d+, mesh.box.cells: 2.02e\+09 cells do not fit into|"
                              r"do not fit into the \S+ GB of this machine's memory")

    def test_lack_of_memory_in_a_library_is_told(self):
        logs = []
        for scene, words, limits in LIMITED:
            for megabytes in limits:
                with self.subTest(scene=scene, words=words[-1], megabytes=megabytes):
                    process = start(scene, self.parts, *words, preexec_fn=limited_to(megabytes))
                    try:
                        logs.append(process.communicate(timeout=60)[0])
                    finally:
                        process.kill()
                    self.assertIn(process.returncode, (0, 4), logs[-1])
                    self.assertNotRegex(logs[-1], "rejected|PETSC ERROR")
                    if process.returncode == 4:
                        self.assertRegex(logs[-1], r"polyslip: .*out of memory: .*\d+ MB .*(Use|use|needs) .*")
        for words in ("MUMPS asks for", "more to factorise", "-displacement_pc_type gamg needs less", "-coupled_pc_type fieldsplit needs less"):
            self.assertIn(words, "".join(logs))

    # Checkpoints

    def test_a_damaged_checkpoint_is_refused_and_the_one_before_it_offered(self):
        dice = random.Random(11)
        run(SCENE, self.parts, *EACH_STEP, "-set", "time.end=0.5")
        whole = (self.parts / "checkpoint.h5").read_bytes()
        damages = [whole[:dice.randrange(len(whole))] for _ in range(2)] + [b""]
        for _ in range(3):
            flipped = bytearray(whole)
            flipped[dice.randrange(len(flipped))] ^= 1 << dice.randrange(8)
            damages.append(bytes(flipped))
        previous = self.parts / "checkpoint.previous.h5"
        for damaged in damages:
            (self.parts / "checkpoint.h5").write_bytes(damaged)
            before = sorted(file.name for file in self.parts.iterdir())
            log = run(SCENE, self.parts, "-restart", expect=2)
            self.assertRegex(log, rf"polyslip: {self.parts}/checkpoint.h5: .*Go on from the one before it: -restart {previous}")
            self.assertEqual(sorted(file.name for file in self.parts.iterdir()), before)
        self.assert_goes_on_as_if_nothing_had_happened("-restart", str(previous))

    def test_a_new_run_puts_an_earlier_one_aside(self):
        run(SCENE, self.parts, "-set", "time.end=0.2")
        process = start(SCENE, self.parts, "-set", "output.checkpoint_every=0")
        begun, put_away = self.parts / "scene.resolved.yaml", self.parts / "checkpoint.previous.h5"
        while process.poll() is None and not begun.stat().st_mtime_ns > put_away.stat().st_mtime_ns:
            time.sleep(0.001)
        while process.poll() is None and steps_done(self.parts) < 1:
            time.sleep(0.001)
        process.kill()
        process.communicate()
        self.assertFalse((self.parts / "summary.json").exists())
        self.assertIn("Go on from the one before it", run(SCENE, self.parts, "-restart", expect=2))

    # Input that turns out to be bad on one rank or late

    def test_what_one_rank_alone_refuses_ends_all(self):
        for words in (["materials[0].young=x > 0.5 ? -1 : 1e9"], ["contact.friction=sqrt(x - 0.5)"], ["contact.friction=0.4 - x"],
                      ["mechanics.boundary[1].displacement=[\"sqrt(x - 0.5)\", 0]"]):
            for ranks in (1, 2):
                log = run(SCENE, self.parts, "-set", *words, ranks=ranks, expect=2)
                self.assertEqual(log.count("polyslip: "), 1, log)
                self.assertFalse(self.parts.exists())

    def test_what_is_refused_late_keeps_what_was_accepted(self):
        for ranks in (1, 2):
            load = 'mechanics.boundary[1].displacement=["t > 0.32 ? sqrt(x - 0.5) : 0", "-1e-4*t"]'
            log = run(SCENE, self.parts, "-set", load, ranks=ranks, expect=3)
            self.assertIn("gives -nan at x = 0, y = 1", log)
            summary = json.loads((self.parts / "summary.json").read_text())
            self.assertEqual((summary["status"], summary["steps"]["accepted"]), ("diverged", 6))
            self.assertIn("-restart_changed_scene", summary["message"])
        run(SCENE, self.parts, "-restart_changed_scene")

    def test_a_slip_of_the_unit_is_warned_of(self):
        for setting, value in (("young", "10 Pa"), ("young=1e20", "1e+20 Pa")):
            setting = setting if "=" in setting else setting + "=10"
            log = run(SCENE, self.parts, "-validate", "-set", f"materials[0].{setting}")
            self.assertIn(f"(materials[0].young): {value} is unusual: check the unit, which is SI", log)
        self.assertNotIn("warning", run(SCENE, self.parts, "-validate"))

    def test_validate_warns_as_a_run(self):
        stiff = ("-set", "materials[0].poisson=0.4999")
        checked, ran = ([line for line in run(SCENE, self.parts, *stiff, *words).splitlines() if line.startswith("warning: ")]
                        for words in (["-validate"], ["-set", "time.end=0.05"]))
        self.assertIn("nearly incompressible", "".join(ran))
        self.assertEqual(checked, ran)


if __name__ == "__main__":
    unittest.main()
