"""The bounds of the machine, and the kernels of assembly against them (roofline): a kernel that takes F operations and moves B bytes takes at
least max(F/peak, B/bandwidth) seconds. Run as a program it prints the peak of one core [1/s] and its bandwidth [byte/s] as JSON.
"""

import json
import os
import subprocess
import sys
import time
from functools import cache

import numpy as np

KERNELS = ("geometry", "local_matrices", "insertion")
PEAK, BANDWIDTH = "machine.flops", "machine.bandwidth"  # columns of runs.csv


def fastest(work, repeats=5):
    """Seconds of the quickest of some calls, after one that does not count."""
    seconds = []
    for _ in range(repeats + 1):
        begin = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - begin)
    return min(seconds[1:])


def peak(size=1000):
    """Operations a second of a product of matrices."""
    a = np.random.default_rng(1).random((size, size))
    product = np.empty_like(a)
    return 2 * size**3 / fastest(lambda: np.matmul(a, a, out=product))


def bandwidth(size=2**24):
    """Bytes a second of a triad a = b + s c on arrays of 128 MB, beyond any cache: three arrays are read and two written, as numpy takes two turns."""
    a, b, c = (np.full(size, value) for value in (0.0, 1.0, 2.0))

    def triad():
        np.multiply(c, 3.0, out=a)
        np.add(a, b, out=a)

    return 5 * a.nbytes / fastest(triad)


@cache
def measured():
    """Columns of the machine's bounds, by a process of its own: the number of threads is settled when numpy is loaded. Once a bench."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, __file__], env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def kernel_lines(row, fields):
    """(field, kernel, seconds, ns a cell, Gflop/s, GB/s, share of the bound in %) of a row, for the kernels that it has."""
    lines = []
    for field in fields:
        for kernel in KERNELS:
            seconds, flops, moved = (row.get(f"kernels.{field}.{kernel}.{name}") for name in ("seconds", "flops", "bytes"))
            if seconds:
                ranks = float(row["ranks"])
                bound = max(flops / row[PEAK], moved / row[BANDWIDTH]) / ranks
                lines.append((field, kernel.replace("_", " "), seconds, 1e9 * seconds * ranks / row["mesh.cells"], 1e-9 * flops / seconds,
                              1e-9 * moved / seconds, 100 * bound / seconds))
    return lines


if __name__ == "__main__":
    json.dump({PEAK: peak(), BANDWIDTH: bandwidth()}, sys.stdout)
