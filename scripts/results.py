"""What a run leaves in its folder, for the pictures of plot.py and plot_time.py."""

import h5py
import numpy as np

STATES = {0: ("open", "tab:blue"), 1: ("stick", "black"), 2: ("slip", "tab:red")}
LABELS = {
    "jump_tangential": "slip |[u]_t| [m]",
    "jump_normal": "normal jump [u]_n [m]",
    "traction_normal": "normal traction [Pa]",
    "traction_tangential": "tangential traction [Pa]",
    "aperture": "aperture [m]",
    "pressure": "pressure [Pa]",
}
POLYLINE, POLYGON, POLYHEDRON = 2, 3, 16  # cell types of an XDMF "Mixed" topology


class Series:
    """One HDF5 file of a run at one output step: points, cells and fields."""

    def __init__(self, file, step):
        with h5py.File(file) as data:
            self.points = data["points"][()]
            self.stream = data["topology"][()]
            steps = sorted(data["fields"], key=int)
            if not steps:
                raise SystemExit(f"{file}: no output step has been written.")
            if step not in range(-1, len(steps)):
                raise SystemExit(f"{file}: there is no step {step}; the last is {len(steps) - 1}.")
            group = data["fields"][steps[step]]
            self.time = group.attrs["time"]
            self.fields = {name: table[()] for name, table in group.items()}

    def is_planar(self):
        return self.stream[0] in (POLYLINE, POLYGON)

    def is_line(self):
        return self.stream[0] == POLYLINE

    def corners(self):
        """Point numbers of each polygon or line."""
        cells, at = [], 0
        while at < len(self.stream):
            count = self.stream[at + 1]
            cells.append(self.stream[at + 2 : at + 2 + count])
            at += 2 + count
        return cells


def count_steps(file):
    """Output steps in a file."""
    with h5py.File(file) as data:
        return len(data["fields"])


def magnitude(vectors):
    return np.linalg.norm(vectors, axis=1)
