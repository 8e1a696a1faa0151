"""What commands print, and what all of them have: --json, --quiet, --output, --open, completion."""

import json
import math
import random
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rparm import command_line, project, result_tables
from rparm import project as project_folders
from rparm.__main__ import main
from rparm.command_line import COMMANDS
from rparm.commands import run as run_command
from rparm.commands.completion import SCRIPT, SHELLS
from rparm.console import json_line, results_stream, stage, verdict_line
from rparm.errors import shortened
from rparm.fmi.fmu_file import Fmu
from rparm.result_tables import RunTable, SweepTable
from rparm.runs.comparison import TOLERANCES, Run, Runs, Sweep
from rparm.units import seconds, short
from tests.support.paths import ROOT
from tests.support.programs import python, run
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

RANDOM = random.Random(5)
ERRORS = (0.0, 1e-300, 9.96e-10, 0.99999, 1e22, math.inf, math.nan)


def names() -> list[str]:
    """Names of scenarios of all lengths."""
    lengths = [RANDOM.choice((1, 8, 27, 28, 60, 81, 255)) for _ in range(RANDOM.randint(1, 5))]
    return [f"{i}{'äx_'[i % 3] * length}" for i, length in enumerate(lengths)]


def widest(capsys: pytest.CaptureFixture[str]) -> int:
    return max(map(len, capsys.readouterr().out.splitlines()))


@pytest.fixture(scope="module")
def done() -> Run:
    with Fmu(FMUS["rp_manipulator"]) as fmu:
        return Runs({"rp_manipulator": fmu}).run(load(SHORT), 1e-8)


@pytest.mark.parametrize("columns", [200, 80, 60])
def test_no_table_is_wider_than_the_terminal(
    done: Run, columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever the names, the numbers and what has failed."""
    monkeypatch.setenv("COLUMNS", str(columns))
    limit = min(columns, 80)
    for _ in range(20):
        known = names()
        tolerances = [RANDOM.choice((1e-8, 2.5e-9, 0.123456789)) for _ in known]
        for with_tight in (False, True) if limit == 80 else (False,):
            table = RunTable(known, tolerances, with_tight)
            for name, tolerance in zip(known, tolerances, strict=True):
                error, time = RANDOM.choice(ERRORS), 10 ** RANDOM.uniform(-4, 5)
                steps = RANDOM.choice((1, 999_999, 10_000_000))
                result = replace(done.result, tolerance=tolerance, steps=steps, wall_time=time)
                wrong = replace(done, result=result, errors={"a_long_name_of_a_variable": error})
                table.row(name, tolerance, [wrong], ["tolerance 1e-11: did not run to its end"])
                table.row(name, tolerance, [], ["did not run"])
        assert widest(capsys) <= limit
        if limit == 80:
            sweeps = SweepTable(known, TOLERANCES)
            for name in known:
                errors = tuple(RANDOM.choice(ERRORS) for _ in TOLERANCES)
                scenario = replace(done.scenario, name=name)
                sweeps.row(Sweep(scenario, TOLERANCES, errors, ["error " * 30, "x" * 100]))
            times = [10 ** RANDOM.uniform(0, 6) for _ in range(3)]
            table = result_tables.FederationTable(known, 1e-12)
            table.row(known[0], 6000, RANDOM.choice(ERRORS), times, passed=False)
            assert widest(capsys) <= limit
        assert len(verdict_line(known, known, "scenario")) <= limit or len(known[0]) > 40


def test_the_verdict_is_first_on_the_last_line() -> None:
    assert verdict_line([], ["a", "b"], "scenario") == "passed: 2 scenarios"
    assert verdict_line(["b", "b"], ["a", "b"], "scenario") == "failed: 1 scenario: b"
    line = verdict_line([f"scenario_{i}" for i in range(35)], range(35), "scenario")
    assert line.startswith("failed: 35 scenarios: scenario_0, ") and len(line) <= 80


def test_numbers_and_names_in_few_characters() -> None:
    for value in (*ERRORS, *(10 ** RANDOM.uniform(-90, 5) for _ in range(100))):
        text = short(value, 1)
        assert len(text) <= 7
        if value != 1e-300:
            assert float(text) == pytest.approx(value, rel=0.05, nan_ok=True)
        assert len(short(value, 0)) <= 5
    assert all(len(seconds(10 ** RANDOM.uniform(-6, 5))) <= 7 for _ in range(100))
    for width in range(4, 30):
        cut = shortened("constant_effort_single_step", width)
        assert len(cut) == min(width, 27) and cut[0] == "c" and cut[-1] == "p"


# ---- --json and --quiet --------------------------------------------------------------------------


def document(out: str) -> dict:
    """The one document there is, in one line."""
    assert out.count("\n") == 1 and out.endswith("}\n")
    return json.loads(out, parse_constant=lambda text: pytest.fail(f"{text} is no JSON"))


@pytest.mark.parametrize(("arguments", "key"), MISTAKES["document"]["rows"])
def test_every_command_prints_a_document(console: Console, arguments: list[str], key: str) -> None:
    """Also of a mistake, which is said on standard error as ever."""
    code, out, err = console(*arguments, "--json")
    found = document(out)
    assert code == found["exit_code"] == (2 if key == "error" else 0) and found[key]
    if key == "error":
        assert err == f"error: {found['error']}\n"


def test_numbers_that_json_does_not_know_are_null() -> None:
    content = {"a": [math.nan, np.float64(1.5), np.inf], "b": {"c": (Path("x"), np.int64(3), True)}}
    assert json_line(content) == '{"a": [null, 1.5, null], "b": {"c": ["x", 3, true]}}'


NOISE = """
import os, subprocess, sys
from rparm import __main__ as cli
from rparm.command_line import Ended
from rparm.commands import files
def run(_):
    print("by Python")
    os.write(1, b"by compiled code\\n")
    subprocess.run([sys.executable, "-c", "print('by a child')"])
    return Ended(0, "verdict", {"x": 1})
files.do_list = run
sys.exit(cli.main())
"""


@pytest.mark.parametrize("option", ["--json", "--quiet", "neither"])
def test_what_libraries_and_children_print_is_no_result(option: str) -> None:
    options = [] if option == "neither" else [option]
    done = python("-c", NOISE, "list", *options, check=True)
    noise = ["by Python", "by a child", "by compiled code"]
    if option == "--json":
        assert document(done.stdout) == {"exit_code": 0, "x": 1}
        assert sorted(done.stderr.splitlines()) == [*noise, "verdict"]
    elif option == "--quiet":
        assert (done.stdout, done.stderr) == ("verdict\n", "")
    else:
        assert sorted(done.stdout.splitlines()) == [*noise, "verdict"] and done.stderr == ""


# ---- Words that miss -----------------------------------------------------------------------------


def test_help_fits_and_names_every_command(console: Console) -> None:
    for arguments in (["help"], ["--help"], ["-h"], ["--quiet", "help"]):
        assert console(*arguments) == (0, f"{command_line.overview()}\n", "")
    text = command_line.overview()
    assert all(f"  {command} " in text for command in COMMANDS)
    assert max(map(len, text.splitlines())) <= 80
    modules = {path.stem for path in (ROOT / "rparm/commands").glob("[a-z]*.py")}
    assert modules == {command.module for command in COMMANDS.values()}
    for command in COMMANDS:
        for arguments in (["help", command], [command, "--help"]):
            code, text, _ = console(*arguments)
            assert code == 0 and text.startswith(f"usage: ./run.sh {command} ")
            for told in ("--json", "--quiet", "--output DIR", "--open", "130 Ctrl-C"):
                assert told in text, (command, told)
            assert ("--tolerance" in text) == (command in ("run", "prove"))


def test_the_version_is_that_of_the_build(console: Console) -> None:
    code, out, _ = console("--version")
    built = (ROOT / "CMakeLists.txt").read_text()
    assert code == 0 and f"project(RPManipulator VERSION {out.strip()} " in built


def test_the_playground_is_where_it_is_said_to_be(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rparm.project.ROOT", tmp_path)
    page = tmp_path / "build" / "playground" / "index.html"
    assert str(page) in console.refused("playground")
    page.parent.mkdir(parents=True)
    page.touch()
    assert console("playground")[:2] == (0, f"{page}; open it: ./run.sh playground --open\n")


def test_the_folder_for_results_has_two_names(capsys: pytest.CaptureFixture[str]) -> None:
    """--report is what --output was called: it works, and no help shows it."""
    for name in ("run", "system"):
        parser = command_line.parser(name)
        for option in ("--output", "--report"):
            assert parser.parse_args([option, "here"]).report == Path("here")
        assert parser.parse_args([]).report == project_folders.report_folder()
        assert "--output DIR" in parser.format_help() and "--report" not in parser.format_help()


def test_without_a_command_all_scenarios_run(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the usage says: `run` is the default."""
    wanted = []
    ended = command_line.Ended(0, "ran")
    monkeypatch.setattr(run_command, "do_run", lambda options: wanted.append(options) or ended)
    assert console()[0] == 0 and wanted[0].names == [] and wanted[0].command == "run"


@pytest.mark.parametrize(("arguments", "guess"), MISTAKES["word"]["rows"])
def test_guesses(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    console: Console,
    arguments: list[str],
    guess: str,
) -> None:
    """One line, without the names of all scenarios."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "below").mkdir()
    for name in ("my_scenario", "below/other"):
        (tmp_path / f"{name}.toml").touch()
    error = console.refused(*arguments)
    assert guess in error and "stick_slip" not in error


def test_stages_are_for_terminals(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for is_terminal in (False, True):
        monkeypatch.setattr(sys.stderr, "isatty", lambda known=is_terminal: known, raising=False)
        stage("building")
        assert capsys.readouterr().err == ("building ...\n" if is_terminal else "")
        with results_stream(as_json=False, quiet=True):
            stage("building")
        assert capsys.readouterr().err == ""


# ---- What all commands have ----------------------------------------------------------------------


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
    folder = tmp_path_factory.mktemp("completion")
    assert main(["completion", "bash", "--output", str(folder)]) == 0
    return folder / SHELLS["bash"]


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


def test_a_run_passes(project: Path, fmu: Path, console: Console) -> None:
    """And says so in a table, in a document and in one line."""
    folder = project / "report"
    arguments = ("run", "--fmu", fmu, "--report", folder)
    code, out, err = console(*arguments)
    assert code == 0 and err == ""
    rows = [line.split() for line in out.splitlines() if line.endswith("passed")]
    assert [[*row[:2], row[4]] for row in rows] == [[LONG, "500", "1e-8"], [SHORT, "1", "1e-8"]]
    for row in rows:  # an error at each tolerance, in rows of one length
        assert len(row) == len(rows[0]) and float(row[2]) < 1e-6 and float(row[5]) < 1e-8
    assert "errors follow the tolerance, 1e-4 to 1e-11: 2 scenarios" in out
    verdict = f"passed: 2 scenarios; {folder / 'index.html'}; open it: "
    assert verdict in out.splitlines()[-1] and out.endswith(" --open\n")
    for page in (f"scenarios/{SHORT}", "studies/accuracy"):
        assert (folder / f"{page}.html").is_file()
    code, out, err = console(*arguments, "--json")
    found = document(out)
    assert code == found["exit_code"] == 0 and found["passed"] and Path(found["report"]).is_file()
    assert [s["name"] for s in found["scenarios"]] == [LONG, SHORT]
    for scenario in found["scenarios"]:
        assert [run["tolerance"] for run in scenario["runs"]] == [1e-8, 1e-11]
        assert all(0 < run["error"] <= run["bound"] and run["passed"] for run in scenario["runs"])
        assert len(scenario["sweep"]["errors"]) == len(TOLERANCES)
    assert verdict in err and f"{LONG}  " in err
    code, out, err = console(*arguments, "--quiet")
    assert (code, err, out.count("\n")) == (0, "", 1) and out.startswith("passed: 2 scenarios; ")


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


def test_fmus_with_another_token(project: Path, console: Console) -> None:
    for path, token, said in (
        (ARM, "guid", "fmi2Instantiate failed: the GUID 'x"),
        (fmi3_fmu(ARM), "instantiationToken", "fmi3InstantiateCoSimulation failed: "),
    ):
        wrong = {"old": f'{token}="', "new": f'{token}="x'}
        other = repacked(path, project / "x.fmu", lambda xml, w=wrong: xml.replace(*w.values(), 1))
        error = console.failed("run", SHORT, "--fmu", other, "--report", project / "report")
        assert f"x.fmu: {said}" in error and "token" in error.lower() + "token" * (path == ARM)


@pytest.mark.parametrize("command", [("run", SHORT), ("system", "nominal"), ("coupling",)])
def test_reports_where_no_files_can_be(
    tmp_path: Path, console: Console, command: tuple[str, ...]
) -> None:
    """Root may write everywhere but to /proc; systems without it have folders without rights."""
    closed = Path("/proc")
    if not closed.is_dir():
        closed = tmp_path / "closed"
        closed.mkdir(mode=0o500)
    (tmp_path / "taken").touch()
    for folder in (closed, closed / "new", tmp_path / "taken", tmp_path / "taken" / "new"):
        assert "cannot be written" in console.refused(*command, "--report", folder)


def test_runs_from_anywhere(tmp_path: Path) -> None:
    lines = python("-m", "rparm", "list", folder=tmp_path, check=True).stdout.splitlines()
    assert [line.split()[0] for line in lines] == NAMES
    assert all(load(name).title in line for name, line in zip(NAMES, lines, strict=True))
