"""The same scene on 1, 2, 3 and 4 ranks: the same mesh, unknowns, Newton iterations, contact states and errors."""

import unittest

from scene_runs import Run


class RankCounts(unittest.TestCase):
    def assert_same(self, example, settings, rank_counts):
        tight = ("-snes_rtol", "1e-13")  # 1e-10 of the forces leave 1e-8 of multipliers near tips undetermined
        one = Run(example, settings, 1, tight)
        for ranks in rank_counts:
            with self.subTest(example=example, ranks=ranks):
                run = Run(example, settings, ranks, tight)
                self.assertEqual(run.summary["ranks"], ranks)
                for part in ("mesh", "dofs", "steps", "newton", "active_set"):
                    for key, value in one.summary[part].items():
                        self.assertEqual(run.summary[part][key], value, f"{part}.{key}")
                self.assertGreater(len(one.errors), 0)
                for name, value in one.errors.items():
                    self.assertAlmostEqual(run.errors[name], value, delta=1e-9 * value + 1e-15, msg=name)
                for column in ("open", "stick", "slip", "changed", "step_length"):
                    self.assertEqual(run.newton[column], one.newton[column], column)

    def test_a_frictional_crack_does_not_depend_on_the_rank_count(self):
        self.assert_same("single_crack", {"study.n": 20}, (2, 3, 4))

    def test_contact_in_three_dimensions_does_not_depend_on_the_rank_count(self):
        self.assert_same("manufactured_contact_3d", {"mesh.box.cells": "[6,6,6]"}, (2, 3))

    def test_contact_between_tetrahedra_does_not_depend_on_the_rank_count(self):
        self.assert_same("manufactured_contact_3d", {"mesh.box.cells": "[4,4,4]", "mesh.box.shape": "tets"}, (3,))

    def test_ranks_share_cells_and_unknowns_within_a_tenth(self):
        settings = {"mesh.box.cells": "[8,8,8]"}
        one, two = (Run("manufactured_contact_3d", settings, ranks).summary for ranks in (1, 2))
        self.assertEqual(one["imbalance"], {"cells": 1, "unknowns": 1, "assembly": 1})
        for share in ("cells", "unknowns"):
            self.assertLess(two["imbalance"][share], 1.1, share)
            self.assertGreaterEqual(two["imbalance"][share], 1, share)
        self.assertGreaterEqual(two["imbalance"]["assembly"], 1)
        kernels = one["kernels"]["rock"]
        self.assertEqual(kernels["insertion"]["flops"], one["mesh"]["cells"] * (8 * 9 / 2) * 3**2)  # lower blocks
        for name, work in two["kernels"]["rock"].items():  # cells across the cut are computed by both
            self.assertGreater(work["flops"], kernels[name]["flops"], name)
            self.assertLess(work["flops"], 1.5 * kernels[name]["flops"], name)


if __name__ == "__main__":
    unittest.main()
