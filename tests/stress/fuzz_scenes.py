#!/usr/bin/env python3
"""Valid scenes, damaged: each is accepted or refused in one sentence with place and remedy, and never crashes or holds up the program.

usage: fuzz_scenes.py [--cases 2000] [--seed 1] [--runs 12] [--keep FOLDER]
--runs of them also go through the whole program, which must leave nothing behind that could be taken for a result when it refuses them.
"""

import argparse
import os
import random
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from input_reader import judge
from line_edits import repeat_line, swap_lines

TESTS = Path(__file__).resolve().parent.parent
EXAMPLES = TESTS.parent / "examples"
# scene, replacements that make it small
BASES = [(TESTS / "regression/restart/load_history.yaml", {"[12, 12]": "[4, 4]"}),
         (TESTS / "regression/restart/injection.yaml", {"[12, 12]": "[4, 4]"}),
         (TESTS / "regression/restart/wet_crack.yaml", {"[8, 8]": "[4, 4]"}),
         (TESTS / "convergence/incompressible/solid.yaml", {"[4, 4, 4]": "[2, 2, 2]"}),
         (TESTS / "convergence/darcy/solid.yaml", {"[8, 8, 8]": "[2, 2, 2]"}),
         (TESTS / "stress/fuzz/full.yaml", {}),
         (TESTS / "stress/fuzz/solid.yaml", {}),
         (EXAMPLES / "single_crack/scene.yaml", {"n: 20": "n: 2", "growth: 1.15": "growth: 4"}),
         (EXAMPLES / "mandel/scene.yaml", {"n: 8 ": "n: 2 "}),
         (EXAMPLES / "manufactured_contact_3d/scene.yaml", {"[8, 8, 8]": "[2, 2, 2]"})]

NUMBER = re.compile(r"(?<![\w.\"])-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?(?![\w.])")
KEY = re.compile(r"\b[A-Za-z_]\w*(?=:(?:\s|$))", re.M)
VALUE = re.compile(r"(?<=: )[^,\[\]{}\n#]+")
LIST = re.compile(r"\[[^\[\]]*\]|\{[^{}]*\}")
TEXT = re.compile(r"\"[^\"\n]*\"")
NUMBERS = ["nan", ".nan", "inf", ".inf", "-.inf", "infinity", "1e308", "-1e308", "1e-320", "0", "-0", "-1", "0.5", "10", "2147483648", "1e30", "1/0",
           "0/0", "9" * 400, "0x1p3", "1_000", "1e", "--1", "true", "~", "''", "1e-300"]
WRONG = ["[]", "{}", "~", "''", "[[]]", "[1, 2, 3, 4]", "{a: 1}", "text", "!!binary aGk=", "!!float x", "&a [*a]", "*nowhere", "- 1", "|", ">-",
         "[~, ~]", "\"\\0\"", "\"\\x07\"", "é", "2001-01-01", "<<: *a", "1 2", "0o17", "#", "'", "\"", "[", "}", "yes"]
EXPRESSIONS = ["1/(x-x)", "sqrt(-1)", "x+", "t*1e308*1e308", "log(0)", "(" * 400 + "x" + ")" * 400, "x ? 1", "sin()", "sin(1,2)", "a=1", "x=1",
               "rand()", "pi(1)", "1e400", "x^y^z^t^1e9", "tip_distance/0", "-" * 500 + "1", "1;2", "min()", "\"x\"", "x/*1", "_", "e", "i", "nan",
               "inf", "1,2", "if(x,1,2)", "0/0", "x>0.3?nan:1", "x > 0.6 ? -1 : 1", "1 + (y > 0.5)/0"]
SLIPS = [1e-12, 1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9, 1e12, -1]


def replaced(text, match, new):
    return text[:match.start()] + new + text[match.end():]


def at_any(pattern, change):
    """A mutation that changes one match of a pattern, chosen by chance; the text as it is where there is none."""
    def mutate(dice, text):
        found = list(pattern.finditer(text))
        if not found:
            return text
        match = dice.choice(found)
        return replaced(text, match, change(dice, match.group(), text))
    return mutate


def slip(dice, number, _):
    return f"{float(number) * dice.choice(SLIPS):g}"


def misspelt(dice, word, _):
    i = dice.randrange(len(word))
    return dice.choice([word[:i] + word[i + 1:], word[:i] + dice.choice("xyz_") + word[i:], word.upper(), word + "s", word[::-1]])


def any_key(dice, _, text):
    return dice.choice(KEY.findall(text))


def line_edit(edit):
    def mutate(dice, text):
        lines = text.splitlines(keepends=True)
        edit(dice, lines)
        return "".join(lines)
    return mutate


def drop_line(dice, lines):
    first = dice.randrange(len(lines))
    del lines[first:first + dice.choice((1, 1, 1, 2, 4))]


def shift_line(dice, lines):
    i = dice.randrange(len(lines))
    lines[i] = dice.choice([" " + lines[i], "\t" + lines[i], lines[i].lstrip(), "- " + lines[i], "  - " + lines[i].lstrip(), "---\n" + lines[i]])


def cut(dice, text):
    return text[:dice.randrange(len(text))]


def nest(dice, text):
    depth = dice.choice((5, 40, 500, 20000))
    opening, closing = dice.choice(("[]", "{}", ("{a: ", "}"), ("- ", "")))
    if dice.random() < 0.5:
        return VALUE.sub(lambda m: opening * depth + m.group() + closing * depth, text, count=1)
    return text + "\nstudy: " + opening * depth


def bytes_edit(dice, text):
    raw = bytearray(text.encode())
    for _ in range(dice.choice((1, 1, 3, 20))):
        raw[dice.randrange(len(raw))] = dice.choice((0, 7, 27, 127, 128, 192, 237, 255, dice.randrange(256)))
    return bytes(raw)


def alias(dice, text):
    return dice.choice(["a: &a [*a]\n" + text, text.replace(": ", ": &a ", 1) + "\nstudy: *a\n", text + "\ndefine: &d {q: *d}\n",
                        text.replace("[", "&p [", 1).replace("[", "*p #", 1), text + "\n<<: *x\n"])


MUTATIONS = [at_any(NUMBER, lambda dice, _, text: dice.choice(NUMBERS))] * 5 + [at_any(NUMBER, slip)] * 4 + [
    at_any(NUMBER, lambda dice, _, text: f'"{dice.choice(EXPRESSIONS)}"'), at_any(TEXT, lambda dice, _, text: f'"{dice.choice(EXPRESSIONS)}"'),
    at_any(TEXT, lambda dice, *_: '"' + dice.choice(EXPRESSIONS) + '"'), at_any(VALUE, lambda dice, *_: dice.choice(WRONG)),
    at_any(VALUE, lambda dice, *_: dice.choice(WRONG)), at_any(LIST, lambda dice, *_: dice.choice(WRONG)), at_any(KEY, misspelt),
    at_any(KEY, any_key), at_any(KEY, lambda *_: ""), at_any(LIST, lambda dice, old, _: f"[{old}, {old}]"),
    at_any(LIST, lambda dice, old, _: old[:1] + old[-1:]),
    at_any(VALUE, lambda dice, _, text: dice.choice(VALUE.findall(text))), line_edit(drop_line), line_edit(drop_line),
    line_edit(repeat_line), line_edit(swap_lines), line_edit(shift_line), cut, nest, bytes_edit, alias]


def mutant(seed, number, bases):
    """Bytes of the damaged scene; always the same for a seed and a number."""
    dice = random.Random(f"{seed}/{number}")
    text = bases[number % len(bases)]
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        text = dice.choice(MUTATIONS)(dice, text)
        if isinstance(text, bytes):
            return text
    return text.encode()


def base_texts():
    texts = []
    for file, changes in BASES:
        text = file.read_text()
        for old, new in changes.items():
            if old not in text:
                raise AssertionError(f"{file} has no {old}")
            text = text.replace(old, new)
        texts.append(text)
    return texts


def fault_of_run(scene, folder):
    """What is wrong with a run of the program, ended by SIGTERM where it takes long; an empty text if nothing is."""
    command = [*shlex.split(os.environ.get("POLYSLIP_WRAPPER", "")), os.environ["POLYSLIP"], scene, "-o", folder]
    process = subprocess.Popen(command, text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, errors="replace")
    try:
        out, err = process.communicate(timeout=5)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGTERM)
        try:
            out, err = process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            return "it neither ends nor heeds SIGTERM"
    if process.returncode not in (0, 2, 3, 143):
        return f"exit code {process.returncode}: {(out + err)[-500:]}"
    if process.returncode == 2 and (len(err.strip().splitlines()) != 1 or not err.startswith("polyslip: ")):
        return f"not one sentence: {err[:500]}"
    if process.returncode == 2 and folder.exists() and any(folder.iterdir()):
        return f"it refuses the scene ({err.strip()[:300]}) and leaves {sorted(file.name for file in folder.iterdir())}"
    if process.returncode != 2 and not (folder / "summary.json").exists():
        return f"exit code {process.returncode} without a summary: {(out + err)[-500:]}"
    return ""


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--cases", type=int, default=2000)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--runs", type=int, default=12)
    arguments.add_argument("--keep", type=Path)
    chosen = arguments.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = chosen.keep or Path(temporary)
        folder.mkdir(exist_ok=True)
        bases, jobs = base_texts(), []
        for i in range(len(bases)):
            scene = folder / f"base_{i}.yaml"
            scene.write_text(bases[i])
            jobs.append((f"base {i}", f"+{scene}"))
        faults, ends = judge(jobs, "(?!)", folder)
        if faults or set(ends) != {"accepted"}:
            sys.exit("the scenes to be damaged are not valid")
        jobs = []
        for i in range(chosen.cases):
            scene = folder / f"scene_{i}.yaml"
            scene.write_bytes(mutant(chosen.seed, i, bases))
            jobs.append((f"scene {i}", f"{'+' if i % 5 == 0 else ''}{scene}"))
        place = re.escape(str(folder)) + r"/scene_\d+\.yaml(:\d+|, default)?( \([^\n]{1,300}?\)|, mesh\.box[\w.]*)?: "
        faults, ends = judge(jobs, place, folder)
        for i in range(chosen.runs):
            number = i * chosen.cases // chosen.runs
            fault = fault_of_run(folder / f"scene_{number}.yaml", folder / f"out_{number}")
            faults += bool(fault)
            if fault:
                print(f"scene {number} as a run: {fault}", file=sys.stderr)
    counts = ", ".join(f"{count} {end}" for end, count in ends.most_common())
    print(f"{chosen.cases} damaged scenes: {counts}; {chosen.runs} runs; {faults} faults")
    sys.exit(faults > 0)


main()
