"""usage: .venv/bin/python examples/sneddon/convergence.py POLYSLIP [-set KEY=VALUE]...

Runs polyslip on the meshes crack_*.msh of this folder and prints how the opening converges: relative L2 error of the values of faces
against the exact opening at their centres, on the whole crack and on its middle 80 %, with orders from mesh to mesh.
Needs h5py, which the first call of scripts/plot puts into .venv.
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

FOLDER = Path(__file__).resolve().parent
CENTRE, HALF_LENGTH = np.array([0.5, 0.5]), 0.3


def run(mesh, options, out):
    command = [sys.argv[1], FOLDER / "scene.yaml", "-o", out, "-set", f"mesh.file={mesh}", *options]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise SystemExit(result.stdout + result.stderr)


def errors(file):
    """Number of faces and relative errors of the opening on the whole crack and on its middle 80 %."""
    with h5py.File(file) as data:
        points, lines = data["points"][:, :2], data["topology"][()].reshape(-1, 4)[:, 2:]
        fields = data["fields"][max(data["fields"], key=int)]
        jump, exact = fields["jump_normal"][()], fields["jump_normal_exact"][()]
    ends = points[lines]
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    along = np.linalg.norm(ends.mean(axis=1) - CENTRE, axis=1) / HALF_LENGTH
    norm = lambda values, faces: math.sqrt(np.sum((length * values**2)[faces]))  # noqa: E731
    return len(length), [norm(jump - exact, faces) / norm(exact, faces) for faces in (along < 1, along < 0.8)]


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        raise SystemExit(__doc__)
    print("mesh              faces   all    order   middle  order")
    previous = None
    for mesh in sorted(FOLDER.glob("crack_*.msh"), reverse=True):
        with tempfile.TemporaryDirectory() as out:
            run(mesh, sys.argv[2:], out)
            faces, values = errors(Path(out) / "fractures.h5")
        orders = [f"{math.log2(before / now):.2f}" for before, now in zip(previous, values)] if previous else ["-", "-"]
        print(f"{mesh.name:16} {faces:6d}  " + "  ".join(f"{value:.3e}  {order:>4}" for value, order in zip(values, orders)))
        previous = values


if __name__ == "__main__":
    main()
