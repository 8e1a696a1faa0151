"""What all commands have: --json, --quiet, --output and --open; and completion by a shell."""

import json
import re
from pathlib import Path

import pytest

from rparm import command_line, project
from rparm.command_line import COMMANDS
from rparm.commands import run as run_command
from rparm.commands.completion import SCRIPT, SHELLS
from tests.support.paths import ROOT
from tests.support.programs import RPARM, python, run
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

# what each command cannot do without
NEEDED = MISTAKES["needed"]
COMMON = ["--json", "--quiet", "--output", "here", "--open"]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_them(command: str) -> None:
    arguments = [command, *NEEDED.get(command, []), *COMMON]
    options = command_line.parsed(arguments)
    assert options.json and options.quiet and options.open
    assert Path("here") in vars(options).values()
    for option in (["--json"], ["--quiet"], ["--open"], ["--output", "here"]):
        alone = vars(command_line.parsed([command, *NEEDED.get(command, []), *option]))
        without = vars(command_line.parsed([command, *NEEDED.get(command, [])]))
        assert sum(alone[name] != without[name] for name in alone) == 1


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What a browser is given."""
    addresses: list[str] = []
    monkeypatch.setattr("webbrowser.open_new_tab", lambda url: bool(addresses.append(url)) or True)
    return addresses


def test_a_new_scenario_goes_into_a_folder_and_is_shown(
    tmp_path: Path, shown: list[str], console: Console
) -> None:
    folder = tmp_path / "below" / "here"
    assert console("new", "mine", "--output", folder, "--open")[0] == 0
    assert (folder / "mine.toml").is_file() and shown == [(folder / "mine.toml").as_uri()]
    (tmp_path / "taken").touch()
    assert "taken" in console.refused("new", "mine", "--output", tmp_path / "taken")


def test_the_playground_is_copied_and_shown(
    tmp_path: Path, shown: list[str], monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    page = tmp_path / "index.html"
    page.write_text("the page", encoding="utf-8")
    monkeypatch.setattr(project, "playground_page", lambda: page)
    code, out, _ = console("playground", "--output", tmp_path / "mine", "--open", "--json")
    copy = tmp_path / "mine" / "playground.html"
    assert (code, copy.read_text(encoding="utf-8")) == (0, "the page")
    assert json.loads(out) == {"exit_code": 0, "page": str(copy)} and shown == [copy.as_uri()]


def test_a_command_without_a_page_writes_its_document_and_says_that_there_is_none(
    tmp_path: Path, shown: list[str], console: Console
) -> None:
    code, out, err = console("list", "--json", "--quiet", "--output", tmp_path, "--open")
    assert code == 0 and err == "--open: list has written no page\n" and shown == []
    assert (tmp_path / "list.json").read_text(encoding="utf-8") == out
    (tmp_path / "taken").touch()
    error = console.refused("list", "--output", tmp_path / "taken")
    assert "taken/list.json: cannot be written" in error


def test_an_fmu_is_copied(tmp_path: Path, console: Console) -> None:
    for arguments, built in ((["RPPlant"], "build"), (["rp_plant", "--fmi", "3"], "build/fmi3")):
        folder = tmp_path / built
        code, out, _ = console("fmu", *arguments, "--output", folder)
        file = folder / "RPPlant.fmu"
        assert code == 0 and out.startswith(f"{file}: FMI ")
        assert file.read_bytes() == (ROOT / built / "RPPlant.fmu").read_bytes()
    assert "no model 'RPPlants'" in console.refused("fmu", "RPPlants")


# ---- completion ----------------------------------------------------------------------------------

BASH = """
source "$1"; shift
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
function=$(complete -p "$1" | sed 's/.* -F \\([^ ]*\\) .*/\\1/')
$function
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("completion") / "script"
    file.write_text(python(*RPARM, "completion", "bash", check=True).stdout, encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("words", "wanted"), [*MISTAKES["completes"]["rows"], (["completion", ""], list(SHELLS))]
)
def test_bash_completes(script: Path, tmp_path: Path, words: list[str], wanted: list[str]) -> None:
    (tmp_path / "my_scenario.toml").touch()
    (tmp_path / "my_notes.txt").touch()
    (tmp_path / "my folder").mkdir()
    done = run("bash", "-c", BASH, "bash", script, SCRIPT, *words, cwd=tmp_path, check=True)
    assert done.stdout.split("\n")[:-1] == wanted


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shell_has_a_script(shell: str, tmp_path: Path, console: Console) -> None:
    code, out, err = console("completion", shell)
    assert (code, err) == (0, "") and SCRIPT in out and "hanging_swing" in out
    assert console("completion", shell, "--output", tmp_path)[0] == 0
    assert (tmp_path / SHELLS[shell]).read_text(encoding="utf-8") == out


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
    assert f"passed: 2 scenarios; {folder / 'index.html'}; open it: " in out.splitlines()[-1]
    assert out.endswith(" --open\n")
    for page in (f"scenarios/{SHORT}", "studies/accuracy"):
        assert (folder / f"{page}.html").is_file()


def test_run_of_one_scenario_at_one_tolerance(project: Path, fmu: Path, console: Console) -> None:
    folder = project / "report"
    arguments = ("run", SHORT, SHORT, "--tolerance", "1e-6", "--fmu", fmu, "--report", folder)
    code, out, _ = console(*arguments)
    assert code == 0 and "passed: 1 scenario; " in out
    assert out.partition("passed: ")[0].count("1e-6") == 1 and "1e-11" not in out
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
    assert "  FAILED: error" in out and f"\nfailed: 1 scenario: {LONG}; " in out


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        *MISTAKES["command"]["rows"],
        (["run", "--fmi", "2", "--fmu", fmi3_fmu(ARM)], "is an FMU of FMI 3.0, --fmi wants 2.0"),
        (["run", "--fmi", "3", "--fmu", ARM], "is an FMU of FMI 2.0, --fmi wants 3.0"),
    ],
)
def test_mistakes_of_the_user(
    project: Path, console: Console, arguments: list[object], reason: str
) -> None:
    assert reason in console.refused(*arguments)


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
