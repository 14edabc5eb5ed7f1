"""Runs studies of time, memory and error of polyslip and writes a report. A study is a row of scripts/bench_studies.yaml: a scene by mesh
family, refinement, solver and ranks. Repeats are interleaved: each point runs once before any runs again.

Writes to -o DIR: runs.csv (a row a run, out of its summary.json), report.md and plots. runs.csv and report.md are written after each run, so
that a stopped bench leaves what it has; --continue goes on from there. A run that fails is a row with its status and reason. Exit code 1
if there are such rows.
"""

import argparse
import sys
from pathlib import Path

from bench_plots import draw_studies
from bench_report import write_report
from bench_runs import ROOT, Runner, read_rows, write_rows
from bench_studies import KEY, TableError, read_table


def parse():
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", metavar="STUDY", help="names of studies (default: all)")
    parser.add_argument("--list", action="store_true", help="list the studies and end")
    parser.add_argument("--quick", action="store_true", help="the quick set, within 5 minutes; the full one takes up to an hour")
    parser.add_argument("--coarsest", type=int, metavar="N", help="only the N coarsest levels of each study")
    parser.add_argument("--case", action="append", metavar="CASE", help="only this case of the studies; may be repeated")
    parser.add_argument("--repeats", type=int, metavar="N", help="repeats of each run (default: those of the table)")
    parser.add_argument("--options", default="", metavar="TEXT",
                        help='more options for all runs, to compare with a report without them; given as --options="-name value"')
    parser.add_argument("--against", type=Path, metavar="RUNS.csv", help="an earlier runs.csv; the report then gives ratios, now over then")
    parser.add_argument("--continue", dest="goes_on", action="store_true", help="keep the rows in DIR/runs.csv and run what is missing of the studies")
    parser.add_argument("--program", type=Path, default=ROOT / "build/release/polyslip", metavar="PATH", help="(build/release/polyslip)")
    parser.add_argument("--table", type=Path, default=ROOT / "scripts/bench_studies.yaml", metavar="YAML",
                        help="table of studies (scripts/bench_studies.yaml)")
    parser.add_argument("-o", dest="output", type=Path, default=Path("bench.out"), metavar="DIR", help="(bench.out)")
    arguments = parser.parse_args()
    if arguments.against and not arguments.against.is_file():
        parser.error(f"{arguments.against} does not exist.")
    if not arguments.list and not arguments.program.is_file():
        parser.error(f"{arguments.program} does not exist; build it by scripts/build or name another by --program.")
    arguments.program, arguments.output = arguments.program.resolve(), arguments.output.resolve()
    return arguments


def chosen_studies(arguments):
    """The studies named on the command line, with the points that it leaves."""
    studies = read_table(arguments.table, arguments.quick)
    if unknown := sorted(set(arguments.studies) - set(studies)):
        raise TableError(f'there is no study "{unknown[0]}"{" in the quick set" if arguments.quick else ""}; there are {", ".join(studies)}.')
    studies = {name: study for name, study in studies.items() if not arguments.studies or name in arguments.studies}
    for study in studies.values():
        if arguments.case:
            study.points = [point for point in study.points if point.case in arguments.case]
        if arguments.coarsest:
            study.points = [point for case in dict.fromkeys(p.case for p in study.points) for point in coarsest(study, case, arguments.coarsest)]
    if not any(study.points for study in studies.values()):
        raise TableError("this leaves no runs.")
    return studies


def coarsest(study, case, number):
    points = [point for point in study.points if point.case == case]
    levels = list(dict.fromkeys(point.level for point in points))[:number]
    return [point for point in points if point.level in levels]


def show_list(arguments, studies):
    quick = read_table(arguments.table, quick=True)
    for name, study in studies.items():
        runs = sum(point.repeats for point in study.points)
        print(f"{name:20} {runs:3} runs{', also quick' if name in quick else '':12}  {study.title}")


def in_turn(studies, repeats):
    """(study, point, repeat) of all runs, repeats outermost."""
    numbers = {point.key: repeats or point.repeats for study in studies.values() for point in study.points}
    for repeat in range(max(numbers.values(), default=0)):
        for study in studies.values():
            yield from ((study, point, repeat) for point in study.points if repeat < numbers[point.key])


def identity(row):
    return (*(row[name] for name in KEY), int(row["repeat"]))


def show(point, row):
    columns = {"s": "seconds.total", "unknowns": "dofs.total", "Newton": "newton.total", "Krylov": "krylov.total"}
    figures = "".join(f"  {text} {row[column]:.6g}" for text, column in columns.items() if column in row)
    print(f"{point.name}: {row['status']}{figures}{'  ' + str(row['reason']) if row['reason'] else ''}", flush=True)


def run_all(arguments, studies, rows, earlier):
    """Runs what is missing in rows, and keeps runs.csv and report.md up to date."""
    runner, done = Runner(arguments.program, arguments.output, arguments.options), {identity(row) for row in rows}
    for study, point, repeat in in_turn(studies, arguments.repeats):
        if (*point.key, repeat) in done:
            continue
        rows.append(runner.run(study, point, repeat))
        write_rows(rows, arguments.output / "runs.csv")
        write_report(studies, rows, arguments.output, earlier)
        show(point, rows[-1])


def main():
    arguments = parse()
    try:
        studies = chosen_studies(arguments)
    except TableError as error:
        sys.exit(f"bench: {error}")
    if arguments.list:
        return show_list(arguments, studies)
    earlier = read_rows(arguments.against) if arguments.against else None
    arguments.output.mkdir(parents=True, exist_ok=True)
    stored = arguments.output / "runs.csv"
    rows = read_rows(stored) if arguments.goes_on and stored.exists() else []
    try:
        run_all(arguments, studies, rows, earlier)
        interrupted = False
    except KeyboardInterrupt:
        interrupted = True
    write_report(studies, rows, arguments.output, earlier, draw_studies(studies, rows, arguments.output))
    failures = sum(row["status"] != "finished" for row in rows)
    print(f"{failures} failures in {len(rows)} runs; see {arguments.output / 'report.md'}")
    if interrupted:
        print("bench: interrupted; --continue goes on from here")
    return 130 if interrupted else int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
