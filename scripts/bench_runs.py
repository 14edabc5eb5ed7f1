"""Runs of scripts/bench: one point of a study becomes one row of runs.csv, whatever happens."""

import csv
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import time
from pathlib import Path

import yaml

from bench_roofline import measured
from bench_studies import KEY

ROOT = Path(__file__).resolve().parent.parent
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
LAUNCHER = ["mpirun", "--oversubscribe", "--bind-to", "none", "-n"]
STATUS = {0: "finished", 2: "refused", 3: "diverged"}
LEADING = [*KEY, "repeat", "status", "reason", "load", "wall", "cpu"]  # the other columns are those of the summaries


class NoMesh(Exception):
    """A mesh could not be made."""


def file_name(*parts):
    return re.sub(r"[^\w.=+-]+", "_", "_".join(str(part) for part in parts if str(part))).strip("_")


class Runner:
    """Runs points with a program, in folders below an output folder."""

    def __init__(self, program, output, options=""):
        self.program, self.output, self.options = program, output, options

    def run(self, study, point, repeat):
        """The row of one run."""
        row = {**dict(zip(KEY, point.key)), "repeat": repeat, "load": round(os.getloadavg()[0], 2)}
        folder = self.output / "runs" / file_name(*point.key)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        try:
            command = self._command(point, folder)
        except NoMesh as error:
            return {**row, "status": "no mesh", "reason": str(error)}
        row |= measured() if study.kernels else {}
        begin, cpu = time.monotonic(), cpu_seconds()
        status, reason = execute(command, folder / "log", point.time_limit)
        row |= {"wall": round(time.monotonic() - begin, 3), "cpu": round(cpu_seconds() - cpu, 3), "status": status, "reason": reason}
        row |= results(folder, study.columns_of_history())
        if status == "too long":
            row["reason"] = reason  # not that the program was asked to stop
        for large in [*folder.glob("*.h5"), *folder.glob("*.xdmf")]:
            large.unlink()
        return row

    def _command(self, point, folder):
        scene = self._scene(point)
        settings = dict(point.settings)
        if point.mesh:
            settings["mesh.file"] = self._mesh(scene, point)
        launcher = [*LAUNCHER, str(point.ranks)] if point.ranks > 1 else []
        command = [*launcher, str(self.program), str(scene), "-o", str(folder)]
        for key, value in settings.items():
            command += ["-set", f"{key}={value}"]
        return [*command, *point.options.split(), *self.options.split()]

    def _scene(self, point):
        if isinstance(point.scene, str):
            return ROOT / point.scene
        file = self.output / "scenes" / f"{file_name(point.study, point.case)}.yaml"
        file.parent.mkdir(exist_ok=True)
        file.write_text(yaml.safe_dump(point.scene, sort_keys=False), encoding="utf-8")
        return file

    def _mesh(self, scene, point):
        """Made once, as other studies and repeats may take it too."""
        file = self.output / "meshes" / f"{file_name(scene.parent.name, scene.stem, point.mesh)}.msh"
        if not file.exists():
            file.parent.mkdir(exist_ok=True)
            command = [str(ROOT / "scripts" / "mesh_network"), str(scene), *point.mesh.split(), "-o", str(file)]
            status, reason = execute(command, file.with_suffix(".log"), point.time_limit)
            if not file.exists():
                raise NoMesh(f"{' '.join(command[:1] + command[2:])}: {status}, {reason}")
        return file


def cpu_seconds():
    """Of all that has been run so far, on all ranks [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def execute(command, log, limit):
    """(status, reason) of a command that writes to a log; it and all that it started are stopped after the limit [s]."""
    with log.open("w", encoding="utf-8") as out:
        try:
            process = subprocess.Popen(command, cwd=ROOT, env={**os.environ, **ENVIRONMENT}, stdin=subprocess.DEVNULL, stdout=out,
                                       stderr=subprocess.STDOUT, start_new_session=True)
        except OSError as error:
            return "not started", str(error)
        try:
            code = process.wait(limit)
        except BaseException as error:  # Ctrl-C too: no run outlives the bench
            stop(process)
            if not isinstance(error, subprocess.TimeoutExpired):
                raise
            return "too long", f"stopped after {limit:g} s"
    return STATUS.get(code, f"exit code {code}"), "" if code == 0 else last_line(log)


def stop(process):
    """Ends a process and all that it started: gently at first, as mpirun then ends its ranks, which are not in its group."""
    process.terminate()
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def last_line(log):
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1].strip() if lines else ""


def results(folder, columns_of_history):
    """Columns of a row out of summary.json, and of the last step of history.csv."""
    columns = {}
    if (folder / "summary.json").exists():
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        message = summary.pop("message")
        columns = {name: value for name, value in flat(summary).items() if name not in ("status", "ranks")}
        columns |= {"reason": message} if message else {}
        columns["memory_mb"] = sum(summary["peak_memory_mb_per_rank"])
    if columns_of_history and (folder / "history.csv").exists():
        with (folder / "history.csv").open(newline="", encoding="utf-8") as file:
            last = ([{}] + list(csv.DictReader(file)))[-1]
        columns |= {f"history.{name}": float(last[name]) for name in columns_of_history if name in last}
    return columns


def flat(sections, prefix=""):
    """Nested maps as one, by names with dots; lists and what is absent are left out."""
    columns = {}
    for name, value in sections.items():
        if isinstance(value, dict):
            columns |= flat(value, f"{prefix}{name}.")
        elif value is not None and not isinstance(value, list):
            columns[prefix + name] = value
    return columns


def write_rows(rows, file):
    names = LEADING + sorted({name for row in rows for name in row} - set(LEADING))
    temporary = file.with_suffix(".new")
    with temporary.open("w", newline="", encoding="utf-8") as out:
        table = csv.DictWriter(out, names, restval="")
        table.writeheader()
        table.writerows(rows)
    temporary.replace(file)  # a kill leaves the former rows


def read_rows(file):
    """Rows of a runs.csv, numbers as such but in the columns that name the run."""
    texts = {*KEY, "status", "reason", "version", "build.petsc", "build.type", "scene"}
    with file.open(newline="", encoding="utf-8") as source:
        return [{name: value if name in texts else float(value) for name, value in row.items() if value != "" or name in texts}
                for row in csv.DictReader(source)]
