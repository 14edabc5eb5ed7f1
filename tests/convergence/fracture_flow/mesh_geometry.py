"""Meshes a Gmsh geometry of the benchmarks with other values of the numbers set in it; runs in the .venv of scripts/mesh_network."""

import argparse
import re
import tempfile
from pathlib import Path

import gmsh


def with_numbers(text, numbers):
    for name, value in (entry.split("=") for entry in numbers):
        text, found = re.subn(rf"^{name} = .*?;", f"{name} = {value};", text, flags=re.M)
        if found != 1:
            raise SystemExit(f"mesh_geometry: the geometry sets {name} {found} times.")
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("geometry", type=Path, metavar="GEOMETRY.geo")
    parser.add_argument("-o", dest="output", required=True, metavar="MESH.msh")
    parser.add_argument("--number", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--largest", type=float, default=1e22, metavar="H", help="largest cell size")
    arguments = parser.parse_args()
    gmsh.initialize(interruptible=False)
    for option, value in {"General.Verbosity": 2, "Mesh.MshFileVersion": 4.1, "Mesh.MeshSizeMax": arguments.largest,
                          "Mesh.Algorithm": 5}.items():  # Delaunay: as many fracture faces as HFV_Disc had
        gmsh.option.setNumber(option, value)
    with tempfile.NamedTemporaryFile("w", suffix=".geo") as geometry:
        geometry.write(with_numbers(arguments.geometry.read_text(encoding="utf-8"), arguments.number))
        geometry.flush()
        gmsh.open(geometry.name)
        gmsh.model.mesh.generate(3)
    gmsh.write(arguments.output)
    gmsh.finalize()


if __name__ == "__main__":
    main()
