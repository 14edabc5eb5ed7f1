#!/usr/bin/env python3
"""A long run holds no more memory and no more PETSc objects than a short one.

usage: leaks.py [--steps 1000]
Rock, fluid and a crack that opens, sticks and slips to and fro; the peak of the resident memory and, by class, the objects that were created and
not destroyed are compared between a tenth of the steps and all of them.
"""

import argparse
import json
import re
import sys
import tempfile
from pathlib import Path

from process_runs import run

SCENE, LARGEST_GROWTH = "wet_crack.yaml", 1.0  # MB: what a kilobyte a step would make of 1000 steps


def figures(folder, steps):
    """(peak memory [MB], {class: objects left})"""
    log = folder / f"log_{steps}.txt"
    out = folder / f"out_{steps}"
    run(SCENE, out, "-set", "mesh.box.cells=[4,4]", "-set", f"time.step={20 / 1}", "-set", f"time.end={20 * steps}", "-set", "output.every=100000",
        "-set", "output.checkpoint_every=50", "-log_view", f":{log}")
    left = {}
    table = log.read_text().split("Object Type")[1].split("\n=====")[0]
    for name, created, destroyed in re.findall(r"^ *(\w[\w ]*?) +(\d+) +(\d+)(?: .*)?$", table, re.M):
        left[name] = left.get(name, 0) + int(created) - int(destroyed)
    summary = json.loads((out / "summary.json").read_text())
    if summary["steps"]["accepted"] < steps:
        raise AssertionError(f"{summary['steps']['accepted']} steps instead of {steps}")
    return max(summary["peak_memory_mb_per_rank"]), left


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--steps", type=int, default=1000)
    steps = arguments.parse_args().steps
    with tempfile.TemporaryDirectory() as folder:
        (short_memory, short_left), (memory, left) = (figures(Path(folder), n) for n in (steps // 10, steps))
    print(f"peak memory after {steps // 10} and {steps} steps: {short_memory:.2f} and {memory:.2f} MB; "
          f"objects left: {sum(short_left.values())} and {sum(left.values())}")
    if len(left) < 5 or left != short_left:
        sys.exit(f"objects left after {steps // 10} steps: {short_left}, after {steps}: {left}")
    if memory - short_memory > LARGEST_GROWTH * steps / 1000:
        sys.exit(f"the memory has grown by {memory - short_memory:.2f} MB")


main()
