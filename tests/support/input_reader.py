"""Many inputs through one process of read_inputs (POLYSLIP_READ_INPUTS), and what an answer must be like.

An input is either accepted or refused with one sentence that says where, what and what to do about it. A crash, a hang, another exception
or a word on standard error is a fault of the program; the job that caused it is named, and the rest goes on in a new process.
"""

import json
import os
import re
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

MEMORY_KB = 8_000_000  # of one reader, where addresses may be limited (not under the address sanitizer)


class Reader:
    """A process that answers jobs one by one; started again where a job ends it."""

    def __init__(self, folder):
        self.errors = folder / f"errors_{id(self)}.txt"
        self.process = None

    def start(self):
        limit = "" if os.environ.get("ASAN_OPTIONS") else f"ulimit -v {MEMORY_KB}; "
        self.process = subprocess.Popen(["bash", "-c", limit + 'exec "$0"', os.environ["POLYSLIP_READ_INPUTS"]], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=self.errors.open("w"),
                                        env=dict(os.environ, OPENBLAS_NUM_THREADS="1"), encoding="utf-8")

    def end(self):
        self.process.stdin.close()
        self.process.stdout.close()
        code, self.process = self.process.wait(), None
        return code

    def answer(self, job):
        """(end, message); an end of "crashed" has the exit code and the last words on standard error as its message."""
        if self.process is None:
            self.start()
        self.process.stdin.write(job + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if line.startswith("{"):
            answer = json.loads(line)
            said = self.errors.read_text(errors="replace")
            if said:  # PETSc's traces, HDF5's stacks
                self.end()
                return "noisy", said[:600]
            return answer["end"], answer["message"]
        code = self.end()
        return "crashed", f"exit code {code} {line} {self.errors.read_text(errors='replace')[-2000:]}"


def fault_of(end, message, place):
    """What is wrong with an answer, or an empty text. `place` is a pattern that a refusal must begin with."""
    if end == "accepted":
        return ""
    if end != "refused":
        return end
    if not re.match(place, message):
        return "no place"
    if "\n" in message.strip() or len(message) > 2000:
        return "not one sentence"
    what = re.sub(place, "", message, count=1)
    if not re.search(r"[.?] [A-Z]", what):  # a sentence behind the first
        return "no remedy"
    return ""


def judge(jobs, place, folder, workers=2):
    """Reads all `jobs`, a list of (name, line). Returns the number of faults, each of which is printed, and counts of the answers."""
    def share(first):
        reader, answers = Reader(folder), []
        for name, line in jobs[first::workers]:
            answers.append((name, line, *reader.answer(line)))
        if reader.process is not None:
            code = reader.end()
            if code:
                answers.append(("the end of a reader", "", "crashed", f"exit code {code} {reader.errors.read_text(errors='replace')[-2000:]}"))
        return answers

    with ThreadPoolExecutor(workers) as pool:
        answers = [answer for part in pool.map(share, range(workers)) for answer in part]
    faults, ends = 0, Counter()
    for name, line, end, message in answers:
        ends[end] += 1
        fault = fault_of(end, message, place)
        if fault:
            faults += 1
            print(f"{name}: {fault}\n  {line}\n  {message}", file=sys.stderr)
    return faults, ends
