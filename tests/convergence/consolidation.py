"""Consolidation with exact solutions (examples/terzaghi and examples/mandel): pressures against an independent implementation, and orders."""

import tempfile
import unittest
from pathlib import Path

from scene_runs import Run, rate

# n: relative L2 error of the pressure at the end, by an independent implementation
REFERENCE = {
    "terzaghi": {16: 1.272e-2, 32: 3.211e-3, 64: 8.048e-4},
    "mandel": {8: 9.619e-3, 16: 2.368e-3},
}

SQUEEZED = """
name: squeezed
mesh: {box: {min: [0, 0, 0], max: [1, 1, 1], cells: [6, 6, 6], shape: hexahedra}}
materials: [{young: 1e10, poisson: 0.25, biot: 1, biot_modulus: 1e10, permeability: 1e-15}]
mechanics:
  boundary:
    - {"on": bottom, displacement: [0, 0, 0]}
    - {"on": top, displacement: ["1e-3*x", "5e-4*y", -1e-3]}
fluid: {viscosity: 1e-3}
flow: {initial_pressure: 0, boundary: [{"on": left, pressure: 0}]}
time: {end: 1, step: 1}
"""


class Consolidation(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.errors = {example: {n: Run(example, {"study.n": n}).errors for n in rows} for example, rows in REFERENCE.items()}

    def test_pressures_agree_with_an_independent_implementation_in_three_digits(self):
        for example, rows in REFERENCE.items():
            for n, value in rows.items():
                with self.subTest(example=example, n=n):
                    self.assertAlmostEqual(self.errors[example][n]["pressure_l2"] / value, 1, delta=5e-4)

    def test_pressure_and_displacement_converge_with_order_two(self):
        for example, rows in REFERENCE.items():
            for coarse, fine in zip(list(rows), list(rows)[1:]):
                for name in ("pressure_l2", "displacement_l2"):
                    with self.subTest(example=example, n=fine, name=name):
                        order = rate(self.errors[example][coarse][name], self.errors[example][fine][name])
                        self.assertGreater(order, 1.95)
                        self.assertLess(order, 2.05)

    def test_steps_of_equal_length_share_a_factorisation(self):
        for example in REFERENCE:
            with self.subTest(example=example):
                summary = Run(example).summary
                self.assertGreater(summary["steps"]["accepted"], 2)
                self.assertEqual(summary["setups"]["factorisation"], 1)

    def test_the_load_at_once_is_undrained_at_first(self):
        # Far from the drained top the first short step shows the undrained pressure, load b/K_v/(1/M + b^2/K_v).
        run = Run("terzaghi", {"study.n": 16, "time.end": 1e-3, "time.step": 1e-3})
        undrained = 1e6 * 0.9 / 1.2e9 / (1e-10 + 0.81 / 1.2e9)
        self.assertAlmostEqual(run.summary["extremes"]["max_pressure"] / undrained, 1, delta=1e-6)

    def test_fluid_is_neither_made_nor_lost(self):
        for example in REFERENCE:
            self.assertLess(Run(example).summary["balance"]["mass_error_max"], 1e-10)

    def test_triangles_consolidate_with_order_two_as_well(self):
        coarse, fine = (Run("mandel", {"study.n": n, "mesh.box.shape": "triangles"}).errors["pressure_l2"] for n in (8, 16))
        self.assertLess(fine, 2 * REFERENCE["mandel"][16])
        self.assertGreater(rate(coarse, fine), 1.8)

    def test_without_fractures_one_solve_is_all_by_multigrid_too(self):
        with tempfile.TemporaryDirectory() as directory:
            scene = Path(directory) / "scene.yaml"
            scene.write_text(SQUEEZED, encoding="utf-8")
            self.assertEqual(Run(scene, options=("-coupled_pc_type", "fieldsplit")).summary["newton"]["total"], 1)


if __name__ == "__main__":
    unittest.main()
