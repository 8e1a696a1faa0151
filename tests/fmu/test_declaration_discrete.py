"""Booleans and event indicators in a variables.toml: what is written, and mistakes in one line."""

import re
from pathlib import Path

import pytest

from tests.support.generator import VARIABLES, change, copied, generate, generated
from tests.support.paths import ROOT

INDICATORS = 'event_indicators = ["to_stop", "push"]'
COUNTING = 'type = "boolean"\ncausality = "input"\nvariability = "discrete"\nstart = true\n'
TURNING = "[variables.is_turning]"
TO_STOP = 'unit = "rad"\ndependencies = ["angle"]\nparameters = ["stop"]\ndescription = "Event'

# what is replaced in the wheel, by what, and what the message must say beside the file
MISTAKES = {
    "start_number": (
        "start = true\n",
        "start = 1\n",
        ["variable is_counting", "start = 1 ", "should be a valid boolean"],
    ),
    "start_text": ("start = true\n", 'start = "on"\n', ["is_counting", "start = 'on'", "boolean"]),
    "start_missing": ("start = true\n", "", ["is_counting", "start is missing"]),
    "start_not_allowed": (
        TURNING,
        f"{TURNING}\nstart = false",
        ["is_turning", "start is not allowed"],
    ),
    "with_unit": (
        "start = true\n",
        'start = true\nunit = "rad"\n',
        ["is_counting", "boolean variables have no unit"],
    ),
    "with_limit": (
        "start = true\n",
        "start = true\nmax = 1\n",
        ["is_counting", "boolean variables have no max"],
    ),
    "with_items": (
        "start = true\n",
        'start = true\nitems.on = { constant = "ON", description = "On" }\n',
        ["is_counting", "boolean variables have no items"],
    ),
    "continuous": (
        COUNTING,
        COUNTING.replace("discrete", "continuous"),
        ["is_counting", "a boolean is not continuous"],
    ),
    "exact": (
        TURNING,
        f'{TURNING}\ninitial = "exact"\nstart = true',
        ["is_turning", "a boolean is no state: initial must be calculated"],
    ),
    "unknown_indicator": (
        INDICATORS,
        'event_indicators = ["to_stop", "pusch"]',
        ["[model]: event_indicators[1]: 'pusch' is not declared"],
    ),
    "indicator_twice": (
        INDICATORS,
        'event_indicators = ["push", "to_stop", "push"]',
        ["[model]: event_indicators[2]: 'push' is there twice"],
    ),
    "indicator_is_an_output": (
        INDICATORS,
        'event_indicators = ["rate"]',
        ["event_indicators[0]: 'rate' is not local, continuous and calculated"],
    ),
    "indicator_is_discrete": (
        INDICATORS,
        'event_indicators = ["catches"]',
        ["event_indicators[0]: 'catches' is not local, continuous and calculated"],
    ),
    "indicator_without_dependencies": (
        TO_STOP,
        TO_STOP.replace('dependencies = ["angle"]\n', ""),
        ["event_indicators[0]: dependencies of 'to_stop' is missing"],
    ),
    "indicators_no_list": (INDICATORS, "event_indicators = 2", ["[model]: event_indicators = 2"]),
    "indicator_number": (
        INDICATORS,
        "event_indicators = [2]",
        ["[model]: event_indicators[0] = 2"],
    ),
    "reinit_of_no_state": (
        "[variables.rate]",
        "[variables.rate]\nreinit = true",
        ["variable rate: reinit is for states only"],
    ),
    "reinit_number": ("reinit = true", "reinit = 1", ["variable angle: reinit = 1 "]),
}


@pytest.fixture
def wheel(tmp_path: Path) -> Path:
    """variables.toml of a copy of the wheel."""
    return copied("wheel", tmp_path, below="tests")


@pytest.mark.parametrize(("old", "new", "words"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_named(
    wheel: Path, tmp_path: Path, old: str, new: str, words: list[str]
) -> None:
    change(wheel, old, new)
    result = generate(wheel, tmp_path / "out")
    assert result.returncode == 2
    assert re.fullmatch(rf"generate\.py: {re.escape(str(wheel))}: [^\n]+\n", result.stderr)
    assert [word for word in words if word not in result.stderr] == []


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
