"""What all commands have: --json, --quiet, --output and --open; and completion by a shell."""

import json
from pathlib import Path

import pytest

from rparm import command_line, files, project
from rparm.command_line import COMMANDS
from rparm.commands.completion import SCRIPT, SHELLS
from rparm.systems import comparison
from tests.support.paths import ROOT
from tests.support.programs import RPARM, python, run
from tests.support.rparm_project import MISTAKES, Console
from tests.support.ssp_files import SSP, edited, replace

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


def test_the_picture_of_the_coupling_is_shown(
    tmp_path: Path, shown: list[str], monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    _, module = comparison.coupling_study()

    def draw(_: Path, report: Path) -> dict[str, dict[str, object]]:
        (report / module.COUPLING_PICTURE).touch()
        return {"part": {"passed": True}}

    monkeypatch.setattr(module, "study_coupling", draw)
    code, out, _ = console("coupling", "--output", tmp_path, "--open", "--json")
    picture = Path(json.loads(out)["picture"])
    assert code == 0 and picture.is_file() and picture.parent == tmp_path
    page = tmp_path / "coupling" / "closed_loop.html"
    assert shown == [page.as_uri()] and 'src="../coupling.png"' in page.read_text("utf-8")


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


def test_a_federation_writes_what_it_recorded(
    tmp_path: Path, shown: list[str], console: Console
) -> None:
    short = {"SystemStructure.ssd": replace('stopTime="6"', 'stopTime="0.5"')}
    system = edited(SSP, tmp_path / "Short.ssp", short)
    arguments = ("nominal", "--ssp", system, "--output", tmp_path, "--json", "--quiet", "--open")
    code, out, err = console("federation", *arguments)
    assert code == 0 and err == "--open: federation has written no page\n" and shown == []
    (row,) = json.loads(out)["variants"]
    names, values = files.read_trajectory(
        tmp_path / "nominal.csv", lambda text, _: ValueError(text)
    )
    assert names[0] == "time" and "arm.q1" in names and len(values) == row["steps"] + 1


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
    ("words", "wanted"),
    [*MISTAKES["completes"]["rows"], (["completion", ""], list(SHELLS))],
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
