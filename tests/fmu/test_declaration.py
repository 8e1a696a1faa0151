"""A mistake in a variables.toml is named in one line: file, place and reason."""

import re
import sys
from pathlib import Path

import pytest

from tests.support.generator import VARIABLES, change, copied, generate, generated
from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fmu"))
from declaration.load import DeclarationError, load  # noqa: E402
from fmi2.model_description import model_description  # noqa: E402
from program import Provenance  # noqa: E402

EXPERIMENT = "[experiment]\nstart = 0.0\nstop = 2.0\ntolerance = 1e-8\nstep = 0.001\n"

# what is replaced, by what, and what the message must say beside the file
MISTAKES = {
    "reference_twice": ("reference = 2\n", "reference = 1\n", ["m2", "value reference 1 is m1's"]),
    "reference_too_large": (
        "reference = 65",
        "reference = 70000",
        ["tau2_y", "reference = 70000", "9999"],
    ),
    "reference_text": ("reference = 65", 'reference = "65"', ["tau2_y", "reference = '65'"]),
    "reference_true": ("reference = 65", "reference = true", ["tau2_y", "reference = True"]),
    "misspelt_key": ("causality", "causalty", ["m1", "key 'causalty'", "causality"]),
    "missing_field": ('field = "parameters.m1"\n', "", ["m1", "field is missing"]),
    "unknown_causality": ('causality = "local"', 'causality = "lokal"', ["D11", "'lokal'"]),
    "wrong_combination": ('variability = "tunable"', 'variability = "continuous"', ["m1"]),
    "start_missing": ("start = 2.0\n", "", ["m1", "start is missing"]),
    "start_not_allowed": (
        'field = "D[0][0]"',
        'field = "D[0][0]"\nstart = 1.0',
        ["D11", "start is not allowed"],
    ),
    "start_below_min": ("start = 2.0", "start = -1.0", ["m1", "outside [min, max]"]),
    "start_nan": ("start = 2.0", "start = nan", ["m1", "start = nan", "finite number"]),
    "unknown_unit": ('unit = "kg"', 'unit = "stone"', ["m1", "'stone'"]),
    "unit_missing": ('unit = "kg"\n', "", ["m1", "unit is missing"]),
    "unknown_dependency": ('dependencies = ["q1"]', 'dependencies = ["q9"]', ["q1", "'q9'"]),
    "dependency_on_output": ('dependencies = ["q1"]', 'dependencies = ["ee_x"]', ["q1", "'ee_x'"]),
    "no_dependencies": ('dependencies = ["q1"]\n', "", ["q1", "dependencies is missing"]),
    "no_such_state": ('derivative_of = "q1"', 'derivative_of = "q0"', ["dq1", "'q0'"]),
    "no_parameter": ('parameters = ["l1", "a"]', 'parameters = ["q1"]', ["ee_x", "'q1'"]),
    "wrong_type": (
        'unit = "kg"',
        'unit = "kg"\ntype = "bool"',
        ["m1", "type = 'bool'", "float64", "boolean"],
    ),
    "model_missing": ("[model]", "[modell]", ["unknown key 'modell'"]),
    "model_lacks": ('header = "rp_model.h"\n', "", ["[model]: header is missing"]),
    "not_an_identifier": ('name = "RPManipulator"', 'name = "RP arm"', ["C identifier"]),
    "not_toml": ("[model]", "[model", ["is not valid TOML"]),
    "no_such_include": ("time_variable.toml", "thyme.toml", ["thyme.toml", "cannot be read"]),
    "wrong_base_unit": (
        "[model]",
        '[units]\n"lbf" = { pound = 1 }\n[model]',
        ["unit lbf", "'pound'"],
    ),
    "include_number": ("include = [", "include = [1, ", ["include[0]", "not a table"]),
    "dependencies_nested": ('dependencies = ["q1"]', 'dependencies = [["q1"]]', ["q1"]),
    "start_huge": ("start = 2.0", "start = 1" + "0" * 400, ["m1", "start = 1000", "number"]),
    "name_with_space": ("[variables.m1]", '[variables."m 1"]', ["m 1", "C identifier"]),
    "name_with_dot": ("[variables.m1]", '[variables."arm.m1"]', ["arm.m1", "C identifier"]),
    "name_of_a_macro": ("[variables.m1]", "[variables.GUID]", ["GUID", "reserved"]),
    "tolerance_negative": ("tolerance = 1e-8", "tolerance = -1.0", ["[experiment]", "tolerance"]),
    "stop_before_start": ("stop = 2.0", "stop = -2.0", ["[experiment]", "stop"]),
    "step_zero": ("step = 0.001", "step = 0.0", ["[experiment]", "step"]),
    "section_missing": (EXPERIMENT, "", ["section [experiment] is missing"]),
    "variable_no_table": ("[variables.m1]", "[variables]\nx = 1\n[variables.m1]", ["x", "table"]),
    "unit_no_table": ("[model]", "[units]\nx = 1\n[model]", ["unit x", "not a table"]),
    "wrong_initial": (
        "start = 2.0",
        'start = 2.0\ninitial = "approx"',
        ["m1", "initial = 'approx'"],
    ),
    "nominal_zero": (
        "start = 2.0",
        "start = 2.0\nnominal = 0.0",
        ["m1", "nominal = 0.0", "greater than 0"],
    ),
    "integer_too_large": (
        "[variables.m1]",
        '[variables.n]\nreference = 99\nfield = "n"\ncausality = "parameter"\ntype = "int32"\n'
        'variability = "fixed"\nstart = 2147483648\ndescription = "N"\n[variables.m1]',
        ["variable n", "start = 2147483648", "2147483647"],
    ),
    "two_times": (
        "[variables.m1]",
        '[variables.t]\nreference = 99\nfield = "t"\ncausality = "independent"\n'
        'variability = "continuous"\nunit = "s"\ndescription = "Time"\n[variables.m1]',
        ["variable t", "independent variable already"],
    ),
    "step_too_long": ("step = 0.001", "step = 3.0", ["[experiment]", "longer than the experiment"]),
    "unit_otherwise": (
        "[model]",
        '[units]\n"s" = { s = 2 }\n[model]',
        ["unit s", "declared otherwise"],
    ),
    "includes_itself": (
        "time_variable.toml",
        "../../models/rp_manipulator/variables.toml",
        ["itself"],
    ),
    "discrete_derivative": (
        "[variables.m1]",
        '[variables.n]\nreference = 99\nfield = "n"\ncausality = "local"\ntype = "int32"\n'
        'variability = "discrete"\nderivative_of = "q1"\ndependencies = []\ndescription = "N"\n'
        "[variables.m1]",
        ["variable n", "an int32 is not continuous"],
    ),
    "name_of_an_alias": ("[variables.D11]", "[variables.der_q1]", ["der_q1", "FMI 2.0", "dq1"]),
    "include_unknown_key": ("include = [", 'include = [{ path = "a" }, ', ["include[0]", "'path'"]),
    "change_of_nothing": ("[model]", "[changes.m1]\n[model]", ["change m1", "not included"]),
    "change_unknown_key": ("[model]", "[changes.time]\nunit = 's'\n[model]", ["time", "'unit'"]),
    "change_impossible": (
        "[model]",
        '[changes.time]\nmore_dependencies = ["q9"]\n[model]',
        ["variable time", "'q9'"],
    ),
    "declared_twice": ("[variables.m1]", "[variables.time]", ["time", "declared twice"]),
}

# what is replaced, by what, and what the message must say beside the file
MISTAKES_IN_TERMINALS = {
    "unknown_variable": ('q1 = "q1", dq1', 'q1 = "q9", dq1', ["arm.joint1", "signal q1", "'q9'"]),
    "no_input_or_output": (
        'q1 = "q1", dq1',
        'q1 = "D11", dq1',
        ["arm.joint1", "'D11' is no input"],
    ),
    "parameter": (
        '{ f2 = "f2" }',
        '{ f2 = "m1" }',
        ["arm.joint2", "inflow f2", "'m1' is no input"],
    ),
    "member_twice": (
        '{ tau1 = "tau1" }',
        '{ q1 = "tau1" }',
        ["terminal arm.joint1", "member 'q1' is declared twice"],
    ),
    "key_twice": ('{ tau1 = "tau1" }', '{ x = "tau1", x = "f2" }', ["is not valid TOML"]),
    "unknown_kind": ("inflows =", "flows =", ["arm.joint1", "unknown key 'flows'", "inflows"]),
    "unknown_rule": ('rule = "plug"', 'rule = "socket"', ["arm.joint1", "'socket'", "'plug'"]),
    "rule_missing": ('rule = "bus"\n', "", ["terminal arm", "rule is missing"]),
    "description_missing": (
        'description = "Joint 1, about z0"\n',
        "",
        ["terminal arm.joint1", "description is missing"],
    ),
    "no_members": (
        "[terminals.end_effector]",
        '[terminals.x]\nrule = "none"\ndescription = "X"\n[terminals.end_effector]',
        ["terminal x", "no members"],
    ),
    "no_table": ("[terminals.arm]", "[terminals]\nx = 1\n[terminals.arm]", ["x", "not a table"]),
    "nested_no_table": (
        "[terminals.arm.terminals.joint1]",
        "[terminals.arm.terminals]\nx = 1\n[terminals.arm.terminals.joint1]",
        ["terminal arm.x", "not a table"],
    ),
    "name_with_space": ("[terminals.arm]", '[terminals."an arm"]', ["an arm", "C identifier"]),
    "member_with_space": ('{ f2 = "f2" }', '{ "f 2" = "f2" }', ["arm.joint2", "C identifier"]),
    "variable_number": ('{ f2 = "f2" }', "{ f2 = 21 }", ["arm.joint2", "inflows.f2 = 21"]),
    "discrete_flow": (
        "[terminals.arm]",
        '[variables.n]\nreference = 99\nfield = "n"\ncausality = "output"\ntype = "int32"\n'
        'variability = "discrete"\ndependencies = []\ndescription = "N"\n'
        '[terminals.x]\nrule = "none"\ndescription = "X"\noutflows = { n = "n" }\n'
        "[terminals.arm]",
        ["terminal x", "outflow n", "'n' is not continuous"],
    ),
}

# what is replaced, by what, and what the message must say beside the file
MISTAKES_IN_ENUMERATIONS = {
    "no_items": (
        "[variables.branch.items]",
        "[variables.other.items]",
        ["other", "float64 variables have no items"],
    ),
    "empty_items": (
        "[variables.l1]",
        '[variables.choice]\nreference = 99\nfield = "c"\ntype = "enumeration"\nitems = {}\n'
        'causality = "parameter"\nvariability = "fixed"\ndescription = "C"\n[variables.l1]',
        ["choice", "items = {} must have one item at least"],
    ),
    "items_of_a_number": (
        'field = "parameters.l1"',
        'field = "parameters.l1"\nitems.one = { constant = "ONE", description = "One" }',
        ["l1", "float64 variables have no items"],
    ),
    "start_no_item": ('start = "circle"', 'start = "ellipse"', ["motion", "'ellipse'", "circle"]),
    "start_number": ('start = "circle"', "start = 3", ["motion", "start = 3", "circle"]),
    "start_missing": ('start = "circle"\n', "", ["motion", "start is missing"]),
    "start_of_a_number": ("start = 0.1\n", 'start = "circle"\n', ["variable a", "valid number"]),
    "constant_missing": (
        '{ constant = "RP_TRAJECTORY_LINE", ',
        "{ ",
        ["motion", "item line", "constant is missing"],
    ),
    "constant_no_identifier": (
        "RP_TRAJECTORY_LINE",
        "RP TRAJECTORY LINE",
        ["item line", "C identifier"],
    ),
    "description_missing": (
        ', description = "The end effector moves along a circle"',
        "",
        ["item circle", "description is missing"],
    ),
    "item_no_table": ("line = {", "arc = 1\nline = {", ["motion", "item arc", "not a table"]),
    "item_key_unknown": ("line = {", "line = { value = 2,", ["item line", "unknown key 'value'"]),
    "own_minimum": (
        'start = "circle"',
        'start = "circle"\nmin = 1',
        ["motion", "enumeration variables have no min"],
    ),
    "with_unit": (
        'start = "circle"',
        'start = "circle"\nunit = "m"',
        ["motion", "enumeration variables have no unit"],
    ),
}


INDICATORS = 'event_indicators = ["to_stop", "push"]'
COUNTING = 'type = "boolean"\ncausality = "input"\nvariability = "discrete"\nstart = true\n'
TURNING = "[variables.is_turning]"
TO_STOP = 'unit = "rad"\ndependencies = ["angle"]\nparameters = ["stop"]\ndescription = "Event'

# the same in the wheel
MISTAKES_IN_DISCRETE_VARIABLES = {
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


def complaint(path: Path) -> str:
    """What is said of a wrong file: one line that begins with a file."""
    with pytest.raises(DeclarationError) as caught:
        model_description(load(path), Provenance())
    text = str(caught.value)
    assert re.match(r"[^\n]+\.toml: [^\n]+$", text)
    return text


CASES = [
    pytest.param(model, *mistake, id=name)
    for model, mistakes in (
        ("rp_manipulator", MISTAKES),
        ("rp_manipulator", MISTAKES_IN_TERMINALS),
        ("rp_trajectory", MISTAKES_IN_ENUMERATIONS),
        ("wheel", MISTAKES_IN_DISCRETE_VARIABLES),
    )
    for name, mistake in mistakes.items()
]


@pytest.mark.parametrize(("model", "old", "new", "words"), CASES)
def test_a_mistake_is_named(
    tmp_path: Path, model: str, old: str, new: str, words: list[str]
) -> None:
    variables = copied(model, tmp_path, below="tests" if model == "wheel" else "models")
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
