"""usage: .venv/bin/python examples/poromechanics_2d/convergence.py COARSE.out [FINER.out]... FINEST.out

Errors of runs on nested meshes (scripts/mesh_network --refine) against the finest, at each output time: relative L2 norms of the difference
to the means of the finest over cells (pressure, less the initial one) and over fracture faces (jumps), and of the mean aperture; orders
from mesh to mesh. Needs what the first call of scripts/plot puts into .venv.
"""

import math
import sys
from pathlib import Path

import h5py
import numpy as np
from matplotlib.tri import Triangulation

INITIAL_PRESSURE = 1e5  # [Pa]
NAMES = ("pressure", "tangential jump", "normal jump", "mean aperture")


class Result:
    """Triangles and fracture faces of a run with their fields at one output step."""

    def __init__(self, directory, step):
        with h5py.File(Path(directory) / "matrix.h5") as file:
            points, corners = file["points"][:, :2], file["topology"][()].reshape(-1, 5)[:, 2:]
            self.time = file["fields"][step].attrs["time"]
            self.pressure = file["fields"][step]["pressure"][()] - INITIAL_PRESSURE
        # Nodes on fractures are there once for each side.
        unique, merged = np.unique(np.round(points, 9), axis=0, return_inverse=True)
        self.mesh = Triangulation(*unique.T, merged.reshape(-1)[corners])
        a, b, c = (points[corners[:, i]] for i in range(3))
        self.centres = (a + b + c) / 3
        self.areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
        with h5py.File(Path(directory) / "fractures.h5") as file:
            self.ends = file["points"][:, :2][file["topology"][()].reshape(-1, 4)[:, 2:]]
            fields = file["fields"][step]
            self.aperture = fields["aperture"][()]
            self.jumps = [np.atleast_2d(fields[name][()].T) for name in ("jump_tangential", "jump_normal")]  # components x faces
        self.lengths = np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)

    def mean_aperture(self):
        return np.average(self.aperture, weights=self.lengths)

    def cells_of(self, fine):
        """The cell that holds each cell of a finer mesh."""
        return self.mesh.get_trifinder()(*fine.centres.T)

    def faces_of(self, fine):
        """The fracture face that holds each fracture face of a finer mesh."""
        along = (self.ends[:, 1] - self.ends[:, 0]) / self.lengths[:, None]
        owners = []
        for middle in fine.ends.mean(axis=1):
            offset = middle - self.ends[:, 0]
            s = np.sum(offset * along, axis=1)
            distance = np.abs(offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0])
            owners.append(np.flatnonzero((distance < 1e-8) & (s > 0) & (s < self.lengths))[0])
        return np.array(owners)


def means(values, sizes, owners, owner_sizes):
    sums = np.bincount(owners, sizes * values, len(owner_sizes))
    if not np.allclose(np.bincount(owners, sizes, len(owner_sizes)), owner_sizes):
        raise SystemExit("convergence: the meshes are not nested. Make them with scripts/mesh_network --refine.")
    return sums / owner_sizes


def relative(difference, exact, sizes):
    """L2 norms of components x entities."""
    return math.sqrt(np.sum(sizes * difference**2) / np.sum(sizes * exact**2))


def errors(coarse, fine):
    pressure = means(fine.pressure, fine.areas, coarse.cells_of(fine), coarse.areas)
    found = [relative(coarse.pressure - pressure, pressure, coarse.areas)]
    faces = coarse.faces_of(fine)
    for ours, theirs in zip(coarse.jumps, fine.jumps):
        exact = np.array([means(component, fine.lengths, faces, coarse.lengths) for component in theirs])
        found.append(relative(ours - exact, exact, coarse.lengths))
    return [*found, abs(coarse.mean_aperture() / fine.mean_aperture() - 1)]


def main():
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    *directories, finest = sys.argv[1:]
    with h5py.File(Path(finest) / "matrix.h5") as file:
        steps = sorted(file["fields"], key=int)
    for step in steps:
        fine, previous = Result(finest, step), None
        print(f"t = {fine.time:g} s\n{'':20}" + "".join(f"{name:>22}" for name in NAMES))
        for directory in directories:
            found = errors(Result(directory, step), fine)
            orders = [f"({math.log2(before / now):.2f})" for before, now in zip(previous, found)] if previous else [""] * len(found)
            print(f"{Path(directory).name:20}" + "".join(f"{value:15.2e} {order:>6}" for value, order in zip(found, orders)))
            previous = found
        print(f"{Path(finest).name:20} mean aperture {fine.mean_aperture():.5e} m")


if __name__ == "__main__":
    main()
