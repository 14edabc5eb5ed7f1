#!/usr/bin/env python3
"""usage: run_hard_cases.py PROGRAM [SCENE.yaml]...

Runs the scenes in hard_cases/ (random networks of scripts/stress on which Newton once cycled, crept or failed) and demands that each one
finishes within MOST_NEWTON iterations, all remedies counted, with a state on every fracture face.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MOST_NEWTON = 600  # a quarter more than the worst of them takes


def complaint(program, scene, folder):
    """(what is wrong with the run, or an empty text; Newton iterations)"""
    done = subprocess.run([program, scene, "-o", folder], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False)
    if done.returncode:
        return f"exit code {done.returncode}: " + " ".join((done.stdout + done.stderr).strip().splitlines()[-1:]), 0
    summary = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    newton, faces = summary["newton"]["total"], summary["mesh"]["fracture_faces"]
    states = sum(summary["active_set"][state] for state in ("open", "stick", "slip"))
    if states != faces:
        return f"{states} faces have a state, {faces} are on fractures", newton
    return (f"{newton} Newton iterations are more than {MOST_NEWTON}" if newton > MOST_NEWTON else ""), newton


def main():
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        sys.exit(__doc__)
    program = str(Path(sys.argv[1]).resolve())
    chosen = sys.argv[2:] or sorted((Path(__file__).parent / "hard_cases").glob("*.yaml"))
    failures = 0 if chosen else 1
    for scene in chosen:
        with tempfile.TemporaryDirectory() as folder:
            begin = time.monotonic()
            wrong, newton = complaint(program, str(scene), folder)
        failures += bool(wrong)
        print(f"{Path(scene).stem:24} {newton:4} Newton iterations  {time.monotonic() - begin:5.1f} s  {wrong or 'finished'}", flush=True)
    sys.exit(f"{failures} of {len(chosen)} hard cases failed." if failures else 0)


main()
