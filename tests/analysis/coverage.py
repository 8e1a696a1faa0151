"""What the tests run of src/, fmu/ and models/: at least 95 % of the lines, 90 % of the branches.

coverage.py c SOURCE BUILD makes BUILD again with the preset coverage and runs the C tests there;
coverage.py python SOURCE BUILD runs the Python tests of the generator with the FMU in BUILD. Both
print what is not run and fail where the figures are lower. `# pragma: no cover` is not used;
README.md names what is not run and why.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

LINES, BRANCHES = 0.95, 0.90
PYTHON_TESTS = (
    "bill_of_materials", "declaration", "document", "generate", "package", "references",
    "source_folder", "terminals",
)  # fmt: skip


def run(*command: object, **options: object) -> None:
    """Run a command that must succeed; print its output if it does not."""
    arguments = [str(argument) for argument in command]
    result = subprocess.run(arguments, capture_output=True, text=True, check=False, **options)
    if result.returncode != 0:
        print(" ".join(arguments), result.stdout, result.stderr, sep="\n", file=sys.stderr)
        sys.exit(2)


def of_c(source: Path, build: Path, folder: Path) -> tuple[float, float]:
    """Run the C tests but the campaigns, which run the same code for longer; the shares."""
    shutil.rmtree(build, ignore_errors=True)  # counts of earlier runs, of files that are no more
    run("cmake", "--preset", "coverage", "-B", build, cwd=source)
    run("cmake", "--build", build, "--parallel", "2", "--target", "c_tests")
    tests = ("-L", "^c$", "-LE", "^campaign$", "-j", "2", "--output-on-failure")
    run("ctest", "--test-dir", build, *tests)

    gcovr = [sys.executable, "-m", "gcovr", "-r", source]
    counted, summary = folder / "counted.json", folder / "summary.json"
    filters = [option for part in ("src", "fmu", "models") for option in ("-f", source / part)]
    run(*gcovr, *filters, "--json", counted, "--json-summary", summary, build)
    for metric in ("line", "branch"):
        run(*gcovr, "-a", counted, "--txt", folder / metric, "--txt-metric", metric)
        print((folder / metric).read_text())
    totals = json.loads(summary.read_text())
    return (
        totals["line_covered"] / totals["line_total"],
        totals["branch_covered"] / totals["branch_total"],
    )


def of_python(source: Path, build: Path, folder: Path) -> tuple[float, float]:
    """Run the Python tests, which start the generator as a program; the shares."""
    data, settings, report = (folder / name for name in ("data", "settings", "python.json"))
    settings.write_text(
        f"[run]\nbranch = true\nparallel = true\ndata_file = {data}\nsource = {source / 'fmu'}\n"
    )
    # every Python that is started loads this module
    (folder / "sitecustomize.py").write_text("import coverage\n\ncoverage.process_startup()\n")
    environment = os.environ | {"COVERAGE_PROCESS_START": str(settings), "PYTHONPATH": str(folder)}
    environment["RP_FMU"] = str(build / "RPManipulator.fmu")
    tests = [source / "tests" / "fmu" / f"test_{name}.py" for name in PYTHON_TESTS]
    run(sys.executable, "-m", "pytest", *tests, env=environment, cwd=source)

    coverage = [sys.executable, "-m", "coverage"]
    run(*coverage, "combine", "-q", f"--rcfile={settings}", folder)
    run(*coverage, "json", "-q", f"--rcfile={settings}", "-o", report)
    subprocess.run([*coverage, "report", "-m", f"--rcfile={settings}"], check=True)
    totals = json.loads(report.read_text())["totals"]
    return (
        totals["covered_lines"] / totals["num_statements"],
        totals["covered_branches"] / totals["num_branches"],
    )


def main() -> int:
    """1 where too little is run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("language", choices=("c", "python"))
    parser.add_argument("source", type=Path)
    parser.add_argument("build", type=Path)
    arguments = parser.parse_args()
    measure = of_c if arguments.language == "c" else of_python
    with tempfile.TemporaryDirectory() as folder:
        lines, branches = measure(
            arguments.source.resolve(), arguments.build.resolve(), Path(folder)
        )
    print(f"{100 * lines:.1f} % of the lines, {100 * branches:.1f} % of the branches")
    if lines >= LINES and branches >= BRANCHES:
        return 0
    print(f"required: {100 * LINES:.0f} % and {100 * BRANCHES:.0f} %")
    return 1


if __name__ == "__main__":
    sys.exit(main())
