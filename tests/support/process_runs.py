"""Runs of the executable as processes that a test may stop, and what they leave on disk.

CTest sets POLYSLIP (the executable) and POLYSLIP_MPIRUN (launcher with its options).
"""

import os
import shlex
import subprocess
from pathlib import Path

from hdf5_tables import Tables

SCENES = Path(__file__).resolve().parent.parent / "regression/restart"


def command(scene, directory, ranks, words):
    """`scene` is a file of its own or one of SCENES."""
    launcher = [*shlex.split(os.environ["POLYSLIP_MPIRUN"]), "-n", str(ranks)] if ranks > 1 else []
    return [*launcher, os.environ["POLYSLIP"], str(SCENES / scene), "-o", str(directory), *words]


def start(scene, directory, *words, ranks=1, **more):
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1")
    return subprocess.Popen(command(scene, directory, ranks, words), env=environment, text=True, stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **more)


def run(scene, directory, *words, ranks=1, expect=0, **more):
    process = start(scene, directory, *words, ranks=ranks, **more)
    try:
        log, _ = process.communicate(timeout=100)
    finally:
        process.kill()
    if process.returncode != expect:
        raise AssertionError(f"{' '.join(process.args)} ended with {process.returncode}:\n{log}")
    return log


def state(directory, tables):
    """All tables of the checkpoint, row by row of the serial mesh."""
    rows = {}
    with Tables(directory / "checkpoint.h5") as file:
        for table in tables:
            numbers, values = file[f"/tables/{table}/numbers"], file[f"/tables/{table}/values"]
            columns = len(values) // len(numbers)
            rows[table] = [values[columns * i + c] for i in sorted(range(len(numbers)), key=numbers.__getitem__) for c in range(columns)]
    return rows


def fields(directory, name, series="matrix"):
    """A field at all times that have been written."""
    with Tables(directory / f"{series}.h5") as file:
        values = []
        while file.has(f"/fields/{len(values)}"):
            values.append(file[f"/fields/{len(values)}/{name}"])
        return values


def steps_done(directory):
    history = directory / "history.csv"
    return max(0, len(history.read_text().splitlines()) - 1) if history.exists() else 0
