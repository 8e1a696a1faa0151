"""Checks that tests run at least 95 % of the lines and 90 % of the branches of src/, fmu/, models/.

coverage.py SOURCE BUILD builds with the preset coverage into BUILD, runs the C tests there and the
Python tests of the generator, prints what is not run and fails where the figures are lower, for C
and for Python each. `# pragma: no cover` is not used; README.md names what is not run and why.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

LINES, BRANCHES = 0.95, 0.90
PYTHON_TESTS = ("generate", "document", "package")


def run(*command: object, **options: object) -> None:
    """Run a command that must succeed; print its output if it fails."""
    arguments = [str(argument) for argument in command]
    result = subprocess.run(arguments, capture_output=True, text=True, check=False, **options)
    if result.returncode != 0:
        print(" ".join(arguments), result.stdout, result.stderr, sep="\n", file=sys.stderr)
        sys.exit(2)


def of_c(source: Path, build: Path, folder: Path) -> dict:
    """Run the C tests; gcovr's summary, after its list of files with the lines not run."""
    run("cmake", "--preset", "coverage", "-B", build, cwd=source)
    run("cmake", "--build", build, "--parallel", "2")
    for counts in build.rglob("*.gcda"):
        counts.unlink()
    run("ctest", "--test-dir", build, "-L", "^c$", "-j", "2", "--output-on-failure")
    summary = folder / "c.json"
    filters = [option for part in ("src", "fmu", "models") for option in ("-f", source / part)]
    for metric in ("line", "branch"):
        report = ["--txt", folder / metric, "--txt-metric", metric, "--json-summary", summary]
        run(sys.executable, "-m", "gcovr", "-r", source, *filters, *report, build)
        print((folder / metric).read_text())
    return json.loads(summary.read_text())


def of_python(source: Path, build: Path, folder: Path) -> dict:
    """Run the Python tests, which start the generator as a program; the totals of coverage.py."""
    data, settings, report = (folder / name for name in ("data", "settings", "python.json"))
    settings.write_text(
        f"[run]\nbranch = true\nparallel = true\ndata_file = {data}\nsource = {source / 'fmu'}\n"
    )
    # every Python that is started loads this module
    (folder / "sitecustomize.py").write_text("import coverage\n\ncoverage.process_startup()\n")
    environment = os.environ | {"COVERAGE_PROCESS_START": str(settings), "PYTHONPATH": str(folder)}
    environment["RP_FMU"] = str(build / "RPManipulator.fmu")
    tests = [source / "tests" / "fmu" / f"test_{name}.py" for name in PYTHON_TESTS]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests]
    run(*command, env=environment)
    coverage = [sys.executable, "-m", "coverage"]
    run(*coverage, "combine", "-q", f"--rcfile={settings}", folder)
    run(*coverage, "json", "-q", f"--rcfile={settings}", "-o", report)
    subprocess.run([*coverage, "report", "-m", f"--rcfile={settings}"], check=True)
    return json.loads(report.read_text())["totals"]


def is_enough(what: str, lines: float, branches: float) -> bool:
    """Print the shares and whether they are large enough."""
    enough = lines >= LINES and branches >= BRANCHES
    print(
        f"{what}: {100 * lines:.1f} % of the lines, {100 * branches:.1f} % of the branches"
        f"{'' if enough else f', less than {100 * LINES:.0f} % and {100 * BRANCHES:.0f} %'}"
    )
    return enough


def main() -> int:
    """1 where too little is run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path)
    parser.add_argument("build", type=Path)
    arguments = parser.parse_args()
    source, build = arguments.source.resolve(), arguments.build.resolve()
    with tempfile.TemporaryDirectory() as folder:
        c = of_c(source, build, Path(folder))
        python = of_python(source, build, Path(folder))
    shares = [
        is_enough(
            "C",
            c["line_covered"] / c["line_total"],
            c["branch_covered"] / c["branch_total"],
        ),
        is_enough(
            "Python",
            python["covered_lines"] / python["num_statements"],
            python["covered_branches"] / python["num_branches"],
        ),
    ]
    return 0 if all(shares) else 1


if __name__ == "__main__":
    sys.exit(main())
