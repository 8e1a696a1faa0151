"""Reading of scenarios: every mistake gets its message."""

import re
from pathlib import Path

import pytest

from rparm.errors import UserError
from rparm.runs import scenario
from tests.support.rparm_project import MISTAKES
from tests.support.toy_model import HEAD, TIME, TOY, timed

# parts of the table: what stands above their texts
ABOVE = {"whole": "", "below_head": HEAD, "below_time": f"{HEAD}{TIME}"} | {
    part: f"{HEAD}{TIME}[{part}]\n" for part in ("parameters", "initial", "inputs.force")
}
WRONG = [
    (ABOVE[part] + mistake["text"], mistake["message"])
    for part, mistakes in MISTAKES["scenario"].items()
    for mistake in mistakes
]
WRONG.append((timed(0, "1" + "0" * 400, 0.1), "[time] stop: expected a finite number"))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("text", "message"), WRONG)
def test_mistake_is_explained_in_one_line(write, text: str, message: str) -> None:
    path = write(text)
    with pytest.raises(UserError) as caught:
        scenario.load(path, TOY)
    said = str(caught.value)
    assert said.startswith(f"{path}: ") and message in said and "\n" not in said


def test_missing_file(write) -> None:
    path = write("").with_name("none.toml")
    with pytest.raises(UserError, match=rf"^{re.escape(str(path))}: no such file$"):
        scenario.load(path, TOY)


def test_folder_instead_of_a_file(write) -> None:
    with pytest.raises(UserError, match="cannot be read: Is a directory"):
        scenario.load(write("").parent, TOY)


def test_bytes_that_are_not_text(write) -> None:
    path = write("")
    path.write_bytes(b"title = '\xff'")
    with pytest.raises(UserError, match="not UTF-8 text, at byte 9"):
        scenario.load(path, TOY)


@pytest.mark.parametrize(("keys", "message"), MISTAKES["elsewhere"]["rows"])
def test_what_a_scenario_elsewhere_is_of(tmp_path: Path, keys: str, message: str) -> None:
    path = tmp_path / "run.toml"
    path.write_text(f"{keys}\n{HEAD}{TIME}")
    (tmp_path / "Toy.fmu").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(UserError, match=f"^{re.escape(str(path))}: {message}") as error:
        scenario.load(path, TOY)
    assert "\n" not in str(error.value)
