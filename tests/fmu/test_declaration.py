"""A declaration of C by hand: a mistake is named in one line; what C and importers get of it."""

import re
from pathlib import Path

import pytest

from tests.support.generator import ARM, WHEEL, change, generate, generated, scalars, wheel_in
from tests.support.paths import ROOT
from tests.support.programs import run
from tests.support.tables import tables

INDICATORS = 'indicators = ["to_stop", "push"]'
MISTAKES = tables(str(Path(__file__).with_name("mistakes")))["declaration"]["rows"]


@pytest.fixture
def wheel(tmp_path: Path) -> Path:
    """The file of a copy of the wheel."""
    return wheel_in(tmp_path / "wheel")


@pytest.mark.parametrize("case", MISTAKES, ids=lambda case: " ".join(case[2:])[:60])
def test_a_mistake_is_named(wheel: Path, tmp_path: Path, case: list[str]) -> None:
    old, new, *words = case
    change(wheel, old, new)
    result = generate(wheel, tmp_path / "out")
    assert result.returncode == 2
    assert re.match(r"generate.py: [^\n]+\.toml: [^\n]+\n$", result.stderr)
    assert [word for word in words if word not in result.stderr] == []
    assert not (tmp_path / "out").exists()


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    result = generate(tmp_path / "wheel.toml", tmp_path / "out")
    assert result.stderr.endswith("wheel.toml: cannot be read: No such file or directory\n")


# ---- What C gets ---------------------------------------------------------------------------------


def test_a_variable_needs_only_its_declaration(wheel: Path, tmp_path: Path) -> None:
    change(wheel, "[where]\n", '[where]\nlost = { unit = "N", description = "Of the speed" }\n')
    change(wheel.with_suffix(".lock.toml"), "[local]\n", "[local]\nlost = 70\n")
    change(wheel.with_suffix(".h"), "double push;", "double push, lost;")
    root = generated(wheel, tmp_path)
    assert scalars(root)["lost"].get("valueReference") == "70"
    table = (tmp_path / "variables.c").read_text()
    assert '{70, "lost", VARIABLE_FLOAT64, VARIABLE_OF_MODEL' in table
    assert compiled(wheel, tmp_path) == ""


def compiled(wheel: Path, folder: Path) -> str:
    """What the compiler says of the generated variables.c."""
    sources = [ROOT / "src" / part for part in ("model", "integrator", "instance")]
    includes = [f"-I{path}" for path in (wheel.parent, *sources, ROOT / "fmu" / "fmi")]
    return run("cc", "-std=c17", "-fsyntax-only", *includes, folder / "variables.c").stderr


@pytest.mark.parametrize(
    ("field", "words"),
    [("double loss", "lost_speed"), ("int lost_speed", "lost_speed must be of type double")],
)
def test_a_wrong_field_does_not_compile(
    wheel: Path, tmp_path: Path, field: str, words: str
) -> None:
    change(wheel.with_suffix(".h"), "double lost_speed", field)
    generated(wheel, tmp_path)
    assert words in compiled(wheel, tmp_path)


def test_the_table_binds_booleans_indicators_and_methods(tmp_path: Path) -> None:
    generated(WHEEL, tmp_path)
    table = (tmp_path / "variables.c").read_text()
    row = re.search(r'\{21, "is_counting", VARIABLE_BOOLEAN, [^}]+\}', table)
    assert row is not None and row[0].split("\n")[-1] == "     1.0, 0.0, 1.0, 1.0}"
    assert "is_counting must be of type int" in table
    assert "static const unsigned indicators[] = {50, 51};" in table
    assert "_Static_assert(INTEGRATOR_ERK == 3" in table


# ---- What importers get --------------------------------------------------------------------------


def guid(file: Path, output: Path) -> str:
    return str(generated(file, output).get("guid"))


def test_the_guid_follows_the_interface_and_not_the_texts(wheel: Path, tmp_path: Path) -> None:
    original, guids = wheel.read_text(), {}
    for name, old, new in (
        ("same", "", ""),
        ("text", "Whole turns", "Turns"),
        ("terminals", "[parameters]", TERMINALS),
        ("start", "start = 0.0", "start = 0.5"),
        ("unit", 'unit = "rad"', 'unit = "m"'),
        ("order of indicators", INDICATORS, 'indicators = ["push", "to_stop"]'),
        ("what it follows from", '["angle", "stop"]', '["angle"]'),
        ("type", 'is_turning = { type = "Boolean"', 'is_turning = { type = "Integer"'),
        ("items", 'is_turning = { type = "Boolean"', 'is_turning = { type = ["no", "yes"]'),
        ("other items", 'is_turning = { type = "Boolean"', 'is_turning = { type = ["n", "y"]'),
    ):
        wheel.write_text(original.replace(old, new, 1))
        guids[name] = guid(wheel, tmp_path / name)
    assert guids["text"] == guids["terminals"] == guids["same"]
    assert len(set(guids.values())) == len(guids) - 2
    assert re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", guids["same"])


TERMINALS = """[terminals.axle]
rule = "plug"
description = ""
signals = { angle = "angle" }
[parameters]"""


def test_a_value_reference_belongs_to_the_guid(wheel: Path, tmp_path: Path) -> None:
    before = guid(wheel, tmp_path)
    change(wheel.with_suffix(".lock.toml"), "push = 51", "push = 52")
    assert guid(wheel, tmp_path) != before


def test_items_belong_to_the_guid_and_their_texts_do_not(wheel: Path, tmp_path: Path) -> None:
    change(
        wheel, 'is_turning = { type = "Boolean"', 'is_turning = { type = { n = "No", y = "Yes" }'
    )
    before = guid(wheel, tmp_path)
    change(wheel, '"Yes"', '"Turning"')
    assert guid(wheel, tmp_path) == before


def test_a_model_without_events_has_no_trace_of_them(tmp_path: Path) -> None:
    assert generated(ARM, tmp_path).get("numberOfEventIndicators") == "0"
    files = [path for path in tmp_path.rglob("*") if path.suffix in (".xml", ".h", ".c")]
    for path in files:
        if path.name.startswith("equations"):
            continue
        text = path.read_text()
        assert "reinit" not in text and "indicator" not in text.lower().replace(
            "numberofeventindicators", ""
        )
