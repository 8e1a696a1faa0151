"""A mistake in a variables.toml is named in one line: file, place and reason."""

import re
import sys
from pathlib import Path

import pytest

from tests.support.generator import VARIABLES, change, copied, generate, generated
from tests.support.paths import ROOT
from tests.support.tables import tables

sys.path.insert(0, str(ROOT / "fmu"))
from declaration.load import DeclarationError, load  # noqa: E402
from fmi2.model_description import model_description  # noqa: E402
from program import Provenance  # noqa: E402

INDICATORS = 'event_indicators = ["to_stop", "push"]'
MODELS = {  # by table of mistakes
    "variables": "rp_manipulator",
    "terminals": "rp_manipulator",
    "enumerations": "rp_trajectory",
    "discrete_variables": "wheel",
}
MISTAKES = tables(str(Path(__file__).with_name("mistakes")))
CASES = [(part, *row) for part in MODELS for row in MISTAKES[part]["rows"]]
CASES.append(("variables", "start = 2.0", "start = 1" + "0" * 400, "m1", "start = 1000", "number"))


def complaint(path: Path) -> str:
    """What is said of a wrong file: one line that begins with a file."""
    with pytest.raises(DeclarationError) as caught:
        model_description(load(path), Provenance())
    text = str(caught.value)
    assert re.match(r"[^\n]+\.toml: [^\n]+$", text)
    return text


@pytest.mark.parametrize("case", CASES, ids=lambda case: " ".join(case[3:])[:60])
def test_a_mistake_is_named(tmp_path: Path, case: tuple[str, ...]) -> None:
    part, old, new, *words = case
    model = MODELS[part]
    below = {"wheel": "tests", "rp_trajectory": "tests/fmu"}.get(model, "models")
    variables = copied(model, tmp_path, below=below)
    change(variables, old, new)
    text = complaint(variables)
    assert [word for word in words if word not in text] == []


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    assert complaint(tmp_path / "none.toml").endswith(
        "none.toml: cannot be read: No such file or directory"
    )


def test_a_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "variables.toml").write_bytes(b"\xff\xfe")
    assert "is not valid TOML" in complaint(tmp_path / "variables.toml")


def test_the_command_line_writes_nothing_for_a_wrong_file(tmp_path: Path) -> None:
    variables = copied("rp_manipulator", tmp_path)
    change(variables, 'field = "parameters.m1"\n', "")
    result = generate(variables, tmp_path / "out")
    assert result.returncode == 2
    assert result.stderr == f"generate.py: {variables}: variable m1: field is missing\n"
    assert not (tmp_path / "out").exists()


# ---- Booleans and event indicators ---------------------------------------------------------------


@pytest.fixture
def wheel(tmp_path: Path) -> Path:
    """variables.toml of a copy of the wheel."""
    return copied("wheel", tmp_path, below="tests")


def guid(variables: Path, output: Path) -> str:
    return str(generated(variables, output).get("guid"))


def test_indicators_and_reinit_belong_to_the_guid(wheel: Path, tmp_path: Path) -> None:
    guids = [guid(wheel, tmp_path / "as_it_is")]
    change(wheel, INDICATORS, 'event_indicators = ["push", "to_stop"]')
    guids.append(guid(wheel, tmp_path / "other_order"))
    change(wheel, "reinit = true\n", "")
    guids.append(guid(wheel, tmp_path / "no_reinit"))
    assert len(set(guids)) == 3
    change(wheel, 'parameters = ["stop"]', 'reinit = false\nparameters = ["stop"]')
    assert guid(wheel, tmp_path / "default") == guids[-1]
    change(wheel, 'event_indicators = ["push", "to_stop"]', "event_indicators = []")
    none = guid(wheel, tmp_path / "none")
    change(wheel, "event_indicators = []\n", "")
    assert guid(wheel, tmp_path / "default") == none != guids[-1]


def test_a_model_without_events_has_no_trace_of_them(tmp_path: Path) -> None:
    assert generated(VARIABLES, tmp_path).get("numberOfEventIndicators") == "0"
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(files) == 5
    for path in files:
        text = path.read_text()
        assert "reinit" not in text and "indicator" not in text.lower().replace(
            "numberofeventindicators", ""
        )


def test_the_table_binds_booleans_and_indicators(tmp_path: Path) -> None:
    generated(ROOT / "tests" / "wheel" / "variables.toml", tmp_path)
    table = (tmp_path / "variables.c").read_text()
    row = re.search(r'\{21, "is_counting", VARIABLE_BOOLEAN, [^}]+\}', table)
    assert row is not None and row[0].split("\n")[-1] == "     1.0, 0.0, 1.0, 1.0}"
    assert "is_counting must be of type int" in table
    assert "static const unsigned indicators[] = {50, 51};" in table
