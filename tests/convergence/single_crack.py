"""A frictional crack in an infinite body (examples/single_crack): errors over its middle and robustness in beta."""

import math
import unittest

from scene_runs import Run, rate

REFERENCE = {20: (0.1125, 0.1826), 40: (5.17e-2, 8.17e-2)}  # slip, lam_n of an independent implementation
ALIKE = {"mechanics.stabilisation": "2mu+lambda"}  # that of the reference


def errors_of(run):
    return run.errors["jump_tangential_l2"], run.errors["multiplier_normal_l2"]


class SingleCrack(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.runs = {n: Run("single_crack", {"study.n": n}) for n in REFERENCE}
        cls.alike = {n: Run("single_crack", {"study.n": n, **ALIKE}) for n in REFERENCE}

    def test_errors_agree_with_an_independent_implementation_in_three_digits(self):
        for found, value in zip(errors_of(self.alike[40]), REFERENCE[40]):
            self.assertAlmostEqual(found / value, 1, delta=2e-3)

    def test_coarse_errors_agree_with_those_of_the_middle_of_the_crack(self):
        # With N = 20 two faces are centred on the ends of the middle 95 %: the scene leaves them out, the reference takes their inner
        # halves. Errors of the constant lam_n are means over faces: halves can be put together from 18 and 20 faces.
        wider = Run("single_crack", {"study.n": 20, "exact.faces": "abs(x) < 0.951", **ALIKE})
        inner, outer = errors_of(self.alike[20]), errors_of(wider)
        halves = math.sqrt((18 * inner[1] ** 2 + (20 * outer[1] ** 2 - 18 * inner[1] ** 2) / 2) / 19)
        self.assertAlmostEqual(halves / REFERENCE[20][1], 1, delta=1e-3)
        self.assertLess(inner[0], REFERENCE[20][0])
        self.assertAlmostEqual(outer[0] / REFERENCE[20][0], 1, delta=5e-3)

    def test_errors_with_our_stabilisation_are_smaller_still(self):
        for n, expected in REFERENCE.items():
            for found, value in zip(errors_of(self.runs[n]), expected):
                self.assertLess(found, 0.9 * value)

    def test_slip_converges_with_order_one(self):
        order = rate(*(errors_of(self.alike[n])[0] for n in (20, 40)))
        self.assertGreater(order, 0.7)
        self.assertLess(order, 1.3)

    def test_slip_at_the_centre_approaches_the_exact_one(self):
        self.assertAlmostEqual(self.runs[40].summary["extremes"]["max_slip"] / 3.80785e-3, 1, delta=0.03)

    def test_newton_needs_at_most_five_iterations_for_beta_over_seven_decades(self):
        first = self.runs[20]
        for beta in (1e-3, 1, 1e4):
            run = Run("single_crack", {"study.n": 20, "contact.beta_scale": beta})
            with self.subTest(beta=beta):
                self.assertLessEqual(run.summary["newton"]["total"], 5)
                for found, value in zip(errors_of(run), errors_of(first)):
                    self.assertAlmostEqual(found, value, delta=1e-6 * value)


if __name__ == "__main__":
    unittest.main()
