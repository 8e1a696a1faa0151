"""Good references are read, bad files are refused."""

from pathlib import Path

import numpy as np
import pytest

from cosim.errors import UserError
from cosim.runs import reference
from tests.support.cosim_project import LONG, NAMES, declared, edit, load, reference_file

MAKE_REFERENCES = "build/venv/bin/python models/rp_manipulator/references/make_references.py"


def refused(project: Path, name: str = LONG) -> str:
    with pytest.raises(UserError) as caught:
        reference.load(load(name, project), declared("rp_manipulator"))
    text = str(caught.value)
    assert str(reference_file(project, name)) in text
    assert f"{MAKE_REFERENCES} {name}" in text
    assert "\n" not in text
    return text


def test_reads_references() -> None:
    for name in NAMES:
        loaded = load(name)
        model = declared(loaded.model)
        read = reference.load(loaded, model)
        assert list(read.names) == model.real_outputs
        assert read.values.shape == (len(loaded.reference_rows), len(read.names))
        assert np.array_equal(read.times, loaded.times[loaded.reference_rows])


def test_missing_reference(project: Path) -> None:
    reference_file(project, LONG).unlink()
    assert "no such file" in refused(project)


def test_empty_reference(project: Path) -> None:
    reference_file(project, LONG).write_text("")
    assert "empty" in refused(project)


def test_reference_with_a_header_only(project: Path) -> None:
    file = reference_file(project, LONG)
    file.write_text(file.read_text().splitlines()[0] + "\n")
    assert "has no values" in refused(project)


def test_binary_reference(project: Path) -> None:
    reference_file(project, LONG).write_bytes(b"\xff\xfe\x00\n")
    assert "not a text file" in refused(project)


def test_reference_cut_in_a_line(project: Path) -> None:
    file = reference_file(project, LONG)
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:20]) + lines[20][:-5])  # all columns, the last number too short
    assert "line 21: is cut off" in refused(project)


def test_reference_cut_after_a_line(project: Path) -> None:
    file = reference_file(project, LONG)
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:20]))
    assert "line 20: does not match" in refused(project)


def test_reference_with_a_short_line(project: Path) -> None:
    file = reference_file(project, LONG)
    lines = file.read_text().splitlines(keepends=True)
    lines[7] = lines[7].partition(",")[2]
    file.write_text("".join(lines))
    assert "line 8: expected 15 values, found 14" in refused(project)


@pytest.mark.parametrize(("value", "reason"), [("nan", "finite"), ("-inf", "finite"), ("x", "'x'")])
def test_reference_with_a_value_that_is_no_number(project: Path, value: str, reason: str) -> None:
    file = reference_file(project, LONG)
    lines = file.read_text().splitlines(keepends=True)
    lines[4] = ",".join([*lines[4].split(",")[:-1], value]) + "\n"
    file.write_text("".join(lines))
    text = refused(project)
    assert "line 5: " in text and reason in text


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('"time"', '"t"', "'time'"),
        ('"ddq1"', '"ddq3"', "'ddq3'"),
        ('"ddq1"', '"D11"', "has no column 'ddq1'"),
        ('"ddq1"', '"q1"', "twice"),
        ('"ddq1"', '"solver_steps"', "no Real variable 'solver_steps'"),
    ],
)
def test_reference_with_wrong_columns(project: Path, old: str, new: str, reason: str) -> None:
    edit(reference_file(project, LONG), old, new)
    text = refused(project)
    assert "line 1: " in text and reason in text


def test_reference_with_a_column_that_is_not_compared(project: Path) -> None:
    file = reference_file(project, LONG)
    head, *rows = file.read_text().splitlines()
    file.write_text("\n".join([f'{head},"D11"', *(f"{row},1.0" for row in rows)]) + "\n")
    assert "line 1: 'D11' is not an output of the model" in refused(project)


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
        reference.load(load(LONG, project), declared("rp_manipulator"))
    path.unlink()
    assert reference.load(load(LONG, project), declared("rp_manipulator")).summed == {}
