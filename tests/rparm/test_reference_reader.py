"""Good references are read, bad files are refused."""

import lzma
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rparm.errors import UserError
from rparm.runs import comparison
from tests.support.rparm_project import LONG, MISTAKES, NAMES, declared, edit, load, reference_file

Change = Callable[[list[str]], list[str]]  # of the lines of a file

MAKE_REFERENCES = "build/venv/bin/python models/make_references.py rp_manipulator"


def refused(project: Path, name: str = LONG) -> str:
    with pytest.raises(UserError) as caught:
        comparison.load_reference(load(name, project), declared("rp_manipulator"))
    text = str(caught.value)
    assert str(reference_file(project, name)) in text
    assert f"{MAKE_REFERENCES} {name}" in text
    assert "\n" not in text
    return text


def test_reads_references() -> None:
    for name in NAMES:
        loaded = load(name)
        model = declared(loaded.model)
        read = comparison.load_reference(loaded, model)
        assert list(read.names) == model.real_outputs
        assert read.values.shape == (len(loaded.reference_rows), len(read.names))
        assert np.array_equal(read.times, loaded.times[loaded.reference_rows])


def with_value(value: str) -> Change:
    """The last value of line 5 replaced."""
    return lambda lines: [*lines[:4], ",".join([*lines[4].split(",")[:-1], value]), *lines[5:]]


DAMAGE = {
    "empty": (lambda _: [], "empty"),
    "a header only": (lambda lines: [lines[0], ""], "has no values"),
    # all columns, the last number too short
    "cut in a line": (lambda lines: [*lines[:20], lines[20][:-5]], "line 21: is cut off"),
    "cut after a line": (lambda lines: [*lines[:20], ""], "line 20: does not match"),
    "a short line": (
        lambda lines: [*lines[:7], lines[7].partition(",")[2], *lines[8:]],
        "line 8: expected 15 values, found 14",
    ),
    "nan": (with_value("nan"), r"line 5: .*finite"),
    "inf": (with_value("-inf"), r"line 5: .*finite"),
    "no number": (with_value("x"), r"line 5: .*'x'"),
    "a column that is not compared": (
        lambda lines: [f'{lines[0]},"D11"', *(f"{line},1.0" for line in lines[1:-1]), ""],
        "line 1: 'D11' is not an output of the model",
    ),
    "columns exchanged": (
        lambda lines: [",".join(reversed(line.split(","))) for line in lines],
        "line 1: expected a header whose first column is 'time'",
    ),
    "empty lines": (lambda _: ["", "", ""], "expected a header"),
    "an endless header": (lambda _: ['"' + "a" * 200_000, ""], "line 1: not a header"),
    "quotes": (lambda _: ['"time"', *3 * ['"1'], ""], "line 2: expected numbers"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_reference(project: Path, damage: str) -> None:
    change, reason = DAMAGE[damage]
    file = reference_file(project, LONG)
    file.write_text("\n".join(change(file.read_text().split("\n"))))
    assert re.search(reason, refused(project))


def test_missing_or_binary_reference(project: Path) -> None:
    reference_file(project, LONG).write_bytes(b"\xff\xfe\x00\n")
    assert "not a text file" in refused(project)
    reference_file(project, LONG).unlink()
    assert "no such file" in refused(project)


def test_a_reference_of_an_installed_package_is_compressed(project: Path) -> None:
    scenario, model = load(LONG, project), declared("rp_manipulator")
    expected = comparison.load_reference(scenario, model)
    file = reference_file(project, LONG)
    packed = file.with_name(f"{file.name}.xz")
    packed.write_bytes(lzma.compress(file.read_bytes()))
    file.unlink()
    assert comparison.load_reference(scenario, model).values.tobytes() == expected.values.tobytes()
    packed.write_bytes(packed.read_bytes()[:-9])
    assert "is damaged" in refused(project)


@pytest.mark.parametrize(("old", "new", "reason"), MISTAKES["columns"]["rows"])
def test_reference_with_wrong_columns(project: Path, old: str, new: str, reason: str) -> None:
    edit(reference_file(project, LONG), old, new)
    text = refused(project)
    assert "line 1: " in text and reason in text


def test_reference_of_another_scenario(project: Path) -> None:
    edit(project / f"models/rp_manipulator/scenarios/{LONG}.toml", "step = 0.01", "step = 0.0125")
    text = refused(project)
    assert "line 3: does not match" in text and "0.0125" in text


@pytest.mark.parametrize("content", ["total_energy = 1", "total_energy = []", "total_energy = [1]"])
def test_wrong_scales(project: Path, content: str) -> None:
    path = project / "models/rp_manipulator/references/scales.toml"
    path.write_text(content)
    with pytest.raises(
        UserError, match=r"scales\.toml: total_energy: expected a list of variables"
    ):
        comparison.load_reference(load(LONG, project), declared("rp_manipulator"))
    path.unlink()
    assert comparison.load_reference(load(LONG, project), declared("rp_manipulator")).summed == {}
