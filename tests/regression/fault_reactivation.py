"""examples/fault_reactivation: initial tractions and onset of slip against theory, patch and moment against stored ones, two ranks."""

import math
import unittest
from pathlib import Path

from scene_runs import Run
from stored_tables import StoredTables

STORED = Path(__file__).parent / "fault_reactivation"
LU = ("-coupled_pc_type", "lu")
STEPS = {"time.step": "15*day", "time.largest_step": "15*day", "time.outputs": "[0]"}
DAY, DIP, FRICTION, RATIO = 86400, math.radians(65), 0.6, 0.62
DEPTHS = {"caprock": 1375, "reservoir": 1500, "base": 1625}  # [m], middle of each window

# column: (relative, absolute) tolerance
HISTORY = {
    "step": (0, 0), "time": (1e-12, 0), "open": (0, 0), "stick": (0, 1), "slip": (0, 1), "max_slip": (1e-5, 1e-12),
    "slip_integral": (1e-5, 1e-6), "slipped_area": (1e-5, 1e-6), "seismic_moment": (1e-5, 1e4), "opening_integral": (0, 1e-6),
    "stored_volume": (1e-6, 1e-6), "outflow_volume": (1e-6, 1e-6), "elastic_energy": (1e-6, 0), "max_pressure": (1e-6, 0),
}
for name in DEPTHS:
    HISTORY |= {f"{name}_{column}": (1e-6, 0) for column in ("normal", "tangential", "pressure", "aperture", "ratio")}


def resolved(depth):
    """Effective normal and shear traction of the initial stress on the fault [Pa]."""
    vertical, pressure = 23.5e3 * depth, 1e5 + 9.81e3 * depth
    horizontal = RATIO * vertical
    normal = vertical * math.cos(DIP) ** 2 + horizontal * math.sin(DIP) ** 2 - pressure
    return normal, (vertical - horizontal) * math.sin(DIP) * math.cos(DIP)


class FaultReactivation(StoredTables):
    @classmethod
    def setUpClass(cls):
        cls.run_ = Run("fault_reactivation", {**STEPS, "time.end": "120*day"}, options=LU)
        # Rock that does not feel its pressure: then theory has the tractions of the fault in closed form.
        cls.uncoupled = Run("fault_reactivation", {**STEPS, "time.end": "90*day", "study.biot": 0}, options=LU)

    def test_history_has_not_moved(self):
        self.assert_like_stored(STORED / "history.csv", self.run_.history, HISTORY)

    def test_the_fault_bears_the_initial_stress_and_sticks(self):
        history = self.run_.history
        self.assertEqual((history["slip"][0], history["open"][0], history["slipped_area"][0]), (0, 0, 0))
        for name, depth in DEPTHS.items():
            normal, shear = resolved(depth)
            with self.subTest(name=name):
                self.assertAlmostEqual(history[f"{name}_normal"][0] / normal, 1, delta=1e-3)
                self.assertAlmostEqual(history[f"{name}_tangential"][0] / shear, 1, delta=1e-3)
                self.assertAlmostEqual(history[f"{name}_ratio"][0] / (shear / (FRICTION * normal)), 1, delta=1e-2)

    def test_without_biot_coupling_pressure_moves_the_mohr_circle_and_nothing_else(self):
        history = self.uncoupled.history
        stuck = history["slip"].index(next(slip for slip in history["slip"] if slip > 0))
        self.assertGreater(stuck, 3)
        for name in DEPTHS:
            for row in range(stuck):
                with self.subTest(name=name, row=row):
                    risen = history[f"{name}_pressure"][row] - history[f"{name}_pressure"][0]
                    self.assertAlmostEqual(history[f"{name}_normal"][row], history[f"{name}_normal"][0] - risen, delta=1)
                    self.assertAlmostEqual(history[f"{name}_tangential"][row], history[f"{name}_tangential"][0], delta=1)

    def test_the_fault_slips_when_the_circle_meets_the_coulomb_line(self):
        for history in (self.run_.history, self.uncoupled.history):
            for slip, *ratios in zip(history["slip"], *(history[f"{name}_ratio"] for name in DEPTHS)):
                self.assertLessEqual(max(ratios), 1 + 1e-9)
                self.assertEqual(slip > 0, max(ratios) > 1 - 1e-6)

    def test_no_step_fails_and_newton_takes_few_iterations(self):
        for run in (self.run_, self.uncoupled):
            steps, newton = run.summary["steps"], run.summary["newton"]
            self.assertEqual(steps["rejected"], 0)
            self.assertLessEqual(newton["total"], 4 * steps["accepted"])
            self.assertLessEqual(newton["max_per_step"], 10)

    def test_fluid_is_conserved_and_energy_not_made(self):
        for run in (self.run_, self.uncoupled):
            self.assertLess(run.summary["balance"]["mass_error_max"], 1e-9)
            self.assertLess(run.summary["balance"]["energy_violation_max"], 1e-9)

    def test_two_ranks_compute_the_same(self):
        two = Run("fault_reactivation", {**STEPS, "time.end": "120*day"}, ranks=2, options=LU)
        self.assert_like(two.history, self.run_.history, HISTORY)

    def test_two_ranks_take_the_same_iterations(self):
        whole = (*LU, "-elimination_share", "0")  # whose windows end at the borders of ranks
        one, two = (Run("fault_reactivation", {**STEPS, "time.end": "120*day"}, ranks, whole) for ranks in (1, 2))
        self.assertEqual(two.history["newton"], one.history["newton"])


if __name__ == "__main__":
    unittest.main()
