"""The command line: runs, mistakes of the user, interruptions."""

import re
from pathlib import Path

import pytest

from rparm.commands import run as run_command
from tests.support.programs import python
from tests.support.rparm_project import (
    FMUS,
    LONG,
    MISTAKES,
    NAMES,
    SHORT,
    Console,
    fmi3_fmu,
    load,
    reference_file,
    repacked,
)

ARM = FMUS["rp_manipulator"]


def test_run_passes(project: Path, fmu: Path, console: Console) -> None:
    folder = project / "report"
    code, out, err = console("run", "--fmu", fmu, "--report", folder)
    assert code == 0 and err == ""
    rows = [line.split() for line in out.splitlines() if line.endswith("passed")]
    assert [[*row[:2], row[4]] for row in rows] == [[LONG, "500", "1e-8"], [SHORT, "1", "1e-8"]]
    for row in rows:  # an error at each tolerance, in rows of one length
        assert len(row) == len(rows[0]) and float(row[2]) < 1e-6 and float(row[5]) < 1e-8
    assert "errors follow the tolerance, 1e-4 to 1e-11: 2 scenarios" in out
    last = out.splitlines()[-1]
    assert last.startswith(f"passed: 2 scenarios; {folder / 'index.html'}; open it: ./run.sh run ")
    assert last.endswith(" --open")
    for page in (f"scenarios/{SHORT}", "studies/accuracy"):
        assert (folder / f"{page}.html").is_file()


def test_run_of_one_scenario_at_one_tolerance(project: Path, fmu: Path, console: Console) -> None:
    folder = project / "report"
    arguments = ("run", SHORT, SHORT, "--tolerance", "1e-6", "--fmu", fmu, "--report", folder)
    code, out, _ = console(*arguments)
    assert code == 0 and "passed: 1 scenario; " in out
    assert out.count("1e-6") == 1 and "1e-11" not in out
    assert not (folder / "studies/accuracy.html").exists()


def test_slow_scenarios_called_by_name_are_not_swept(
    project: Path, fmu: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_command, "QUICK", 0.0)
    code, out, _ = console("run", SHORT, "--fmu", fmu, "--report", project / "report")
    assert code == 0 and f"{SHORT}: no sweep" in out and "error at tolerance" not in out


def test_run_with_a_worse_reference_fails(project: Path, fmu: Path, console: Console) -> None:
    file = reference_file(project, LONG)
    lines = file.read_text().splitlines()
    header, row = lines[0].split(","), lines[250].split(",")
    column = header.index('"ee_vy"')
    row[column] = repr(float(row[column]) + 1e-3)
    lines[250] = ",".join(row)
    file.write_text("\n".join(lines) + "\n")
    code, out, err = console("run", "--fmu", fmu, "--report", project / "report")
    assert code == 1 and err == ""
    assert len(re.findall("(?m)^  tolerance 1e-(8|11): error .* of ee_vy, above its", out)) == 2
    assert "  FAILED: error" in out and out.endswith(f"\nfailed: 1 scenario: {LONG}\n")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        *((mistake["arguments"], mistake["message"]) for mistake in MISTAKES["command"]),
        (["run", "--fmi", "2", "--fmu", fmi3_fmu(ARM)], "is an FMU of FMI 3.0, --fmi wants 2.0"),
        (["run", "--fmi", "3", "--fmu", ARM], "is an FMU of FMI 2.0, --fmi wants 3.0"),
    ],
)
def test_mistakes_of_the_user(
    project: Path, console: Console, arguments: list[object], reason: str
) -> None:
    assert reason in console.refused(*arguments)


def test_file_that_is_no_fmu_or_cut_off(project: Path, fmu: Path, console: Console) -> None:
    content, file = fmu.read_bytes(), project / "cut.fmu"
    cuts = (content[:length] for length in (0, 100, len(content) // 2, len(content) - 10))
    for wrong in (b"not a zip archive", *cuts):
        file.write_bytes(wrong)
        assert "cut.fmu: not an FMU" in console.refused("run", "--fmu", file)


def test_fmu_with_another_guid(project: Path, fmu: Path, console: Console) -> None:
    other = repacked(fmu, project / "guid.fmu", lambda xml: xml.replace('guid="', 'guid="x', 1))
    error = console.failed("run", SHORT, "--fmu", other, "--report", project / "report")
    assert "guid.fmu: fmi2Instantiate failed: the GUID 'x" in error


def test_report_in_the_place_of_a_file(project: Path, fmu: Path, console: Console) -> None:
    (project / "taken").touch()
    for report in (project / "taken", project / "taken/out"):
        error = console.refused("run", SHORT, "--fmu", fmu, "--report", report)
        assert "cannot be written" in error


@pytest.mark.parametrize("command", [("run", SHORT), ("system", "nominal"), ("coupling",)])
@pytest.mark.parametrize("folder", ["{}/new", "{}"], ids=["in it", "itself"])
def test_report_in_a_folder_that_takes_no_files(
    tmp_path: Path, console: Console, command: tuple[str, ...], folder: str
) -> None:
    """Root may write everywhere but to /proc; systems without it have folders without rights."""
    closed = Path("/proc")
    if not closed.is_dir():
        closed = tmp_path / "closed"
        closed.mkdir(mode=0o500)
    error = console.refused(*command, "--report", folder.format(closed))
    assert "cannot be written" in error


def test_runs_from_anywhere(tmp_path: Path) -> None:
    lines = python("-m", "rparm", "list", folder=tmp_path, check=True).stdout.splitlines()
    assert [line.split()[0] for line in lines] == NAMES
    assert all(load(name).title in line for name, line in zip(NAMES, lines, strict=True))
