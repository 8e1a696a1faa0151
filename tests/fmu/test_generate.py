"""The generator: what it writes, that a variable is declared in one place, what it refuses."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tests.support.paths import ROOT

MODEL = ROOT / "models" / "rp_manipulator"
VARIABLES = MODEL / "variables.toml"

# the table of variables that users rely on: name -> (value reference, causality, unit)
PUBLISHED = """
time 0 independent s; m1 1 parameter kg; m2 2 parameter kg; I1z 3 parameter kg.m2;
I2z 4 parameter kg.m2; l1 5 parameter m; lc1 6 parameter m; a 7 parameter m; g 8 parameter m/s2;
q1 10 output rad; q2 11 output m; dq1 12 output rad/s; dq2 13 output m/s; ddq1 14 output rad/s2;
ddq2 15 output m/s2; tau1 20 input N.m; f2 21 input N; ee_x 30 output m; ee_y 31 output m;
ee_vx 32 output m/s; ee_vy 33 output m/s; kinetic_energy 40 output J; potential_energy 41 output J;
total_energy 42 output J; actuator_power 43 output W; D11 50 local kg.m2; D12 51 local kg.m;
D22 52 local kg; coriolis1 53 local N.m; coriolis2 54 local N; gravity1 55 local N.m;
gravity2 56 local N; f1_x 60 local N; f1_z 61 local N; tau1_y 62 local N.m; f2_x 63 local N;
f2_z 64 local N; tau2_y 65 local N.m; solver_steps 80 local -; solver_rhs_evaluations 81 local -;
relative_tolerance 82 parameter 1; max_internal_steps 83 parameter -;
effective_relative_tolerance 84 local 1; solver_restarts 85 local -; solver_last_step 86 local s;
solver_last_order 87 local -; solver_failed_steps 88 local -; solver_method 90 parameter -;
max_step 91 parameter s
"""


def generate(variables: Path, output: Path) -> subprocess.CompletedProcess[str]:
    """Run the generator as the build does."""
    command = [sys.executable, ROOT / "fmu" / "generate.py", variables, "--output", output]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def generated(variables: Path, output: Path) -> ET.Element:
    """Run the generator and parse the model description."""
    result = generate(variables, output)
    assert result.returncode == 0, result.stderr
    return ET.parse(output / "modelDescription.xml").getroot()


@pytest.fixture(scope="module")
def description(tmp_path_factory: pytest.TempPathFactory) -> ET.Element:
    """Model description of the manipulator."""
    return generated(VARIABLES, tmp_path_factory.mktemp("generated"))


@pytest.fixture
def model_copy(tmp_path: Path) -> Path:
    """A copy of what the generator reads, to be changed; the path of its variables.toml."""
    (tmp_path / "src" / "instance").mkdir(parents=True)
    for shared in (ROOT / "src" / "instance").glob("*.toml"):
        shutil.copy(shared, tmp_path / "src" / "instance")
    folder = tmp_path / "models" / "rp_manipulator"
    folder.mkdir(parents=True)
    return Path(shutil.copy(VARIABLES, folder))


def scalars(root: ET.Element) -> dict[str, ET.Element]:
    """Map the name of each variable to its element."""
    return {v.get("name", ""): v for v in root.iterfind("ModelVariables/ScalarVariable")}


def test_the_published_interface_stays(description: ET.Element) -> None:
    published = {}
    for entry in PUBLISHED.split(";"):
        name, reference, causality, unit = entry.split()
        published[name] = (reference, causality, unit)
    found = {
        name: (v.get("valueReference"), v.get("causality"), v[0].get("unit", "-"))
        for name, v in scalars(description).items()
    }
    assert published.items() <= found.items()


def test_start_values_and_bounds(description: ET.Element) -> None:
    variables = scalars(description)
    starts = {name: v[0].get("start") for name, v in variables.items()}
    defaults = {"m1": 2, "m2": 1, "I1z": 0.1, "I2z": 0.05, "l1": 0.5, "lc1": 0.25, "a": 0.1}
    defaults |= {"g": 9.81, "q1": 0, "q2": 0, "dq1": 0, "dq2": 0, "tau1": 0, "f2": 0}
    defaults |= {"relative_tolerance": 0, "max_internal_steps": 100000}
    defaults |= {"solver_method": 1, "max_step": 0}
    assert {name: float(s) for name, s in starts.items() if s is not None} == defaults
    minima = {n: float(v[0].get("min")) for n, v in variables.items() if v[0].get("min")}
    assert minima == {"m1": 0, "m2": 1e-9, "I1z": 0, "I2z": 0, "l1": 0, "lc1": 0} | {
        "relative_tolerance": 0,
        "max_internal_steps": 1,
        "solver_method": 1,
        "max_step": 0,
    }


def test_flags_are_those_that_work(description: ET.Element) -> None:
    shared = {
        "modelIdentifier": "RPManipulator",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    assert description.find("ModelExchange").attrib == shared
    assert description.find("CoSimulation").attrib == shared | {
        "canHandleVariableCommunicationStepSize": "true",
        "canInterpolateInputs": "true",
        "maxOutputDerivativeOrder": "2",
    }


def test_derivatives_point_at_their_states(description: ET.Element) -> None:
    variables = list(scalars(description))
    derivatives = {
        name: variables[int(v[0].get("derivative")) - 1]
        for name, v in scalars(description).items()
        if v[0].get("derivative")
    }
    assert derivatives == {"dq1": "q1", "dq2": "q2", "ddq1": "dq1", "ddq2": "dq2"}
    listed = [u.get("index") for u in description.iterfind("ModelStructure/Derivatives/Unknown")]
    assert [variables[int(index) - 1] for index in listed] == list(derivatives)


def test_outputs_are_listed_in_order(description: ET.Element) -> None:
    variables = scalars(description)
    names = list(variables)
    expected = [n for n, v in variables.items() if v.get("causality") == "output"]
    unknowns = description.findall("ModelStructure/Outputs/Unknown")
    assert [names[int(u.get("index")) - 1] for u in unknowns] == expected
    initial = description.findall("ModelStructure/InitialUnknowns/Unknown")
    assert [names[int(u.get("index")) - 1] for u in initial] == expected[4:]


def test_units_are_defined_and_angles_have_degrees(description: ET.Element) -> None:
    units = {u.get("name"): u for u in description.iterfind("UnitDefinitions/Unit")}
    for variable in scalars(description).values():
        unit = variable[0].get("unit")
        assert unit is None or units[unit].find("BaseUnit") is not None
    assert units["W"].find("BaseUnit").attrib == {"kg": "1", "m": "2", "s": "-3"}
    degree = units["rad"].find("DisplayUnit")
    assert degree.get("name") == "deg"
    assert float(degree.get("factor")) * 3.141592653589793 == pytest.approx(180, rel=1e-15)
    assert scalars(description)["q1"][0].get("displayUnit") == "deg"


def test_the_same_bytes_every_time(tmp_path: Path) -> None:
    generated(VARIABLES, tmp_path / "first")
    generated(VARIABLES, tmp_path / "second")
    for file in (tmp_path / "first").iterdir():
        assert file.read_bytes() == (tmp_path / "second" / file.name).read_bytes()


def test_generated_files_in_the_build_are_fresh(fmu: Path, tmp_path: Path) -> None:
    built = fmu.parent / "fmu" / "RPManipulator"
    version = ET.parse(built / "modelDescription.xml").getroot().get("version", "")
    generated(VARIABLES, tmp_path)
    for name in ("modelDescription.xml", "variables.c", "value_references.h"):
        fresh = (tmp_path / name).read_text().replace("0.0.0", version)
        assert (built / name).read_text() == fresh


def test_a_variable_added_to_the_toml_alone_is_built_in(model_copy: Path, tmp_path: Path) -> None:
    model_copy.write_text(
        model_copy.read_text()
        + '[variables.lever]\nreference = 70\nfield = "loads.f1[1]"\ncausality = "local"\n'
        'variability = "continuous"\nunit = "N"\ndescription = "Force out of the plane"\n'
    )
    root = generated(model_copy, tmp_path / "out")
    assert scalars(root)["lever"].get("valueReference") == "70"
    table = (tmp_path / "out" / "variables.c").read_text()
    assert '{70, "lever", VARIABLE_REAL, VARIABLE_OF_MODEL' in table
    compile_table(tmp_path / "out")


def compile_table(folder: Path, model: str = "rp_manipulator") -> None:
    """Compile the generated variables.c; raise with the compiler's words where that fails."""
    includes = [
        f"-I{ROOT / name}"
        for name in (
            "src/model",
            "src/integrator",
            "src/instance",
            "fmu",
            "models",
            f"models/{model}",
        )
    ]
    command = ["cc", "-std=c17", "-fsyntax-only", *includes, folder / "variables.c"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise ValueError(result.stderr)


@pytest.mark.parametrize("field", ["no_such_field", "loads", "q", "parameters"])
def test_a_wrong_field_does_not_compile(model_copy: Path, tmp_path: Path, field: str) -> None:
    text = model_copy.read_text().replace('field = "D[0][0]"', f'field = "{field}"')
    model_copy.write_text(text)
    generated(model_copy, tmp_path / "out")
    with pytest.raises(ValueError, match=field):
        compile_table(tmp_path / "out")


def test_the_guid_follows_the_interface_and_not_the_texts(model_copy: Path, tmp_path: Path) -> None:
    original = model_copy.read_text()
    guids = {}
    for name, old, new in (
        ("same", "", ""),
        ("text", "Mass of link 1", "The mass of link 1"),
        ("start", "start = 2.0", "start = 2.5"),
        ("unit", 'unit = "kg"', 'unit = "m"'),
        ("reference", "reference = 65", "reference = 66"),
    ):
        model_copy.write_text(original.replace(old, new, 1))
        guids[name] = generated(model_copy, tmp_path / name).get("guid")
    assert guids["text"] == guids["same"]
    assert len(set(guids.values())) == 4
    assert re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", guids["same"])


# what is replaced, by what, and what the message must say beside the file
REFUSED = {
    "reference_twice": ("reference = 2\n", "reference = 1\n", ["m2", "value reference 1 is m1's"]),
    "reference_too_large": ("reference = 65", "reference = 70000", ["tau2_y", "from 0 to 9999"]),
    "reference_text": ("reference = 65", 'reference = "65"', ["tau2_y", "reference = '65'"]),
    "reference_true": ("reference = 65", "reference = true", ["tau2_y", "reference = True"]),
    "misspelt_key": ("causality", "causalty", ["m1", "unknown key 'causalty'"]),
    "missing_field": ('field = "parameters.m1"\n', "", ["m1", "lacks field"]),
    "unknown_causality": ('causality = "local"', 'causality = "lokal"', ["D11", "'lokal'"]),
    "wrong_combination": ('variability = "tunable"', 'variability = "continuous"', ["m1"]),
    "start_missing": ("start = 2.0\n", "", ["m1", "start is missing"]),
    "start_not_allowed": ("dependencies = []", "", None),
    "start_below_min": ("start = 2.0", "start = -1.0", ["m1", "outside [min, max]"]),
    "start_nan": ("start = 2.0", "start = nan", ["m1", "not a finite number"]),
    "unknown_unit": ('unit = "kg"', 'unit = "stone"', ["m1", "'stone'"]),
    "unit_missing": ('unit = "kg"\n', "", ["m1", "lacks unit"]),
    "unknown_dependency": ('dependencies = ["q1"]', 'dependencies = ["q9"]', ["q1", "'q9'"]),
    "dependency_on_output": ('dependencies = ["q1"]', 'dependencies = ["ee_x"]', ["q1", "'ee_x'"]),
    "no_dependencies": ('dependencies = ["q1"]\n', "", ["q1", "lacks dependencies"]),
    "no_such_state": ('derivative_of = "q1"', 'derivative_of = "q0"', ["dq1", "'q0'"]),
    "no_parameter": ('parameters = ["l1", "a"]', 'parameters = ["q1"]', ["ee_x", "'q1'"]),
    "wrong_type": ('unit = "kg"', 'unit = "kg"\ntype = "Boolean"', ["m1", "'Boolean'"]),
    "model_missing": ("[model]", "[modell]", ["unknown key 'modell'"]),
    "model_lacks": ('header = "rp_model.h"\n', "", ["[model] lacks header"]),
    "not_an_identifier": ('name = "RPManipulator"', 'name = "RP arm"', ["C identifier"]),
    "not_toml": ("[model]", "[model", ["is not valid TOML"]),
    "no_such_include": ("time_variable.toml", "thyme.toml", ["thyme.toml", "cannot be read"]),
    "wrong_base_unit": ('"N" = { kg = 1', '"N" = { pound = 1', ["unit N", "'pound'"]),
    "include_number": ("include = [", "include = [1, ", ["include", "[1, "]),
    "dependencies_nested": ('dependencies = ["q1"]', 'dependencies = [["q1"]]', ["q1"]),
    "start_huge": ("start = 2.0", "start = 1" + "0" * 400, ["m1", "not a finite number"]),
    "name_with_space": ("[variables.m1]", '[variables."m 1"]', ["m 1", "C identifier"]),
    "name_with_dot": ("[variables.m1]", '[variables."arm.m1"]', ["arm.m1", "C identifier"]),
    "name_of_a_macro": ("[variables.m1]", "[variables.GUID]", ["GUID", "reserved"]),
    "tolerance_negative": ("tolerance = 1e-8", "tolerance = -1.0", ["[experiment]", "tolerance"]),
    "stop_before_start": ("stop = 2.0", "stop = -2.0", ["[experiment]", "stop"]),
    "step_zero": ("step = 0.001", "step = 0.0", ["[experiment]", "step"]),
    "section_missing": ("[experiment]\n", "[units.x]\n", ["section [experiment] is missing"]),
    "variable_no_table": ("[variables.m1]", "[variables]\nx = 1\n[variables.m1]", ["x", "table"]),
    "unit_no_table": ("[units]", "[units]\nx = 1", ["unit x", "not a table of exponents"]),
    "wrong_initial": ("start = 2.0", 'start = 2.0\ninitial = "approx"', ["m1", "not approx"]),
    "nominal_zero": (
        "start = 2.0",
        "start = 2.0\nnominal = 0.0",
        ["m1", "nominal must be above 0"],
    ),
    "integer_too_large": (
        "[variables.m1]",
        '[variables.n]\nreference = 99\nfield = "n"\ncausality = "parameter"\ntype = "Integer"\n'
        'variability = "fixed"\nstart = 2147483648\ndescription = "N"\n[variables.m1]',
        ["variable n", "not an integer of 32 bits"],
    ),
    "two_times": (
        "[variables.m1]",
        '[variables.t]\nreference = 99\nfield = "t"\ncausality = "independent"\n'
        'variability = "continuous"\nunit = "s"\ndescription = "Time"\n[variables.m1]',
        ["variable t", "independent variable already"],
    ),
    "declared_twice": ("[variables.m1]", "[variables.time]", ["time", "declared twice"]),
}
REFUSED["start_not_allowed"] = (
    'field = "D[0][0]"',
    'field = "D[0][0]"\nstart = 1.0',
    ["D11", "start is not allowed"],
)


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_file_is_refused_with_a_reason(model_copy: Path, tmp_path: Path, case: str) -> None:
    old, new, words = REFUSED[case]
    original = model_copy.read_text()
    assert old in original
    model_copy.write_text(original.replace(old, new, 1))
    result = generate(model_copy, tmp_path / "out")
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    for word in [".toml", *words]:
        assert word in result.stderr
    assert not (tmp_path / "out").exists()


# Enumerations: the reference motions have two


@pytest.fixture
def trajectory(tmp_path: Path) -> Path:
    """A copy of what the generator reads for RPTrajectory, as model_copy."""
    (tmp_path / "src" / "instance").mkdir(parents=True)
    for shared in (ROOT / "src" / "instance").glob("*.toml"):
        shutil.copy(shared, tmp_path / "src" / "instance")
    folder = tmp_path / "models" / "rp_trajectory"
    folder.mkdir(parents=True)
    return Path(shutil.copy(ROOT / "models" / "rp_trajectory" / "variables.toml", folder))


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_an_enumeration_in_the_model_description(trajectory: Path, tmp_path: Path) -> None:
    root = generated(trajectory, tmp_path / "out")
    types = {t.get("name"): t for t in root.iterfind("TypeDefinitions/SimpleType")}
    assert list(types) == ["MotionType", "BranchType"]
    items = types["MotionType"].findall("Enumeration/Item")
    names = [(item.get("name"), item.get("value")) for item in items]
    assert names == [("point_to_point", "1"), ("line", "2"), ("circle", "3")]
    assert all(item.get("description") for item in items)
    # the order that the schema asks for
    tags = [child.tag for child in root]
    assert tags.index("TypeDefinitions") == tags.index("UnitDefinitions") + 1
    assert tags.index("TypeDefinitions") < tags.index("LogCategories")

    motion, branch = (scalars(root)[name] for name in ("motion", "branch"))
    assert [(v[0].tag, v[0].attrib) for v in (motion, branch)] == [
        ("Enumeration", {"declaredType": "MotionType", "start": "3", "min": "1", "max": "3"}),
        ("Enumeration", {"declaredType": "BranchType", "start": "1", "min": "1", "max": "2"}),
    ]


def test_an_enumeration_is_an_integer_in_the_table(trajectory: Path, tmp_path: Path) -> None:
    generated(trajectory, tmp_path / "out")
    table = (tmp_path / "out" / "variables.c").read_text()
    row = table.partition('{1, "motion", ')[2].partition("}")[0]
    assert row.startswith("VARIABLE_INTEGER, VARIABLE_OF_MODEL, ")
    assert "3.0, 1.0, 3.0, 1.0" in row  # start, min, max, nominal
    compile_table(tmp_path / "out", "rp_trajectory")


def test_types_are_those_of_the_enumerations(description: ET.Element) -> None:
    types = [t.get("name") for t in description.iterfind("TypeDefinitions/SimpleType")]
    assert types == ["SolverMethodType"]


def test_items_belong_to_the_guid_and_their_texts_do_not(trajectory: Path, tmp_path: Path) -> None:
    guids = [generated(trajectory, tmp_path / "same").get("guid")]
    change(trajectory, "The end effector moves along a circle", "Round and round")
    guids.append(generated(trajectory, tmp_path / "text").get("guid"))
    change(trajectory, "line = {", "straight = {")
    guids.append(generated(trajectory, tmp_path / "item").get("guid"))
    assert guids[0] == guids[1] != guids[2]


# what is replaced, by what, and what the message must say beside the file
WRONG_ENUMERATIONS = {
    "no_items": (
        "[variables.branch.items]",
        "[variables.other.items]",
        ["branch", "an Enumeration needs [items.NAME]"],
    ),
    "empty_items": (
        'field = "parameters.l1"',
        'field = "parameters.l1"\ntype = "Enumeration"\nitems = {}',
        ["l1", "an Enumeration needs [items.NAME]"],
    ),
    "items_of_a_real": (
        'field = "parameters.l1"',
        'field = "parameters.l1"\nitems.one = { constant = "ONE", description = "One" }',
        ["l1", "items belong to an Enumeration"],
    ),
    "start_no_item": ('start = "circle"', 'start = "ellipse"', ["motion", "'ellipse'", "circle"]),
    "start_number": ('start = "circle"', "start = 3", ["motion", "start = 3", "circle"]),
    "start_missing": ('start = "circle"\n', "", ["motion", "start is missing"]),
    "start_of_a_real": ("start = 0.1\n", 'start = "circle"\n', ["variable a", "finite number"]),
    "constant_missing": (
        '{ constant = "RP_TRAJECTORY_LINE", ',
        "{ ",
        ["motion", "item line", "lacks constant"],
    ),
    "constant_no_identifier": (
        "RP_TRAJECTORY_LINE",
        "RP TRAJECTORY LINE",
        ["item line", "C identifier"],
    ),
    "description_missing": (
        ', description = "The end effector moves along a circle"',
        "",
        ["item circle", "lacks description"],
    ),
    "item_no_table": ("line = {", "arc = 1\nline = {", ["motion", "item arc", "not a table"]),
    "item_key_unknown": ("line = {", "line = { value = 2,", ["item line", "unknown key 'value'"]),
    "own_minimum": ('start = "circle"', 'start = "circle"\nmin = 1', ["motion", "min and max"]),
    "with_unit": ('start = "circle"', 'start = "circle"\nunit = "m"', ["motion", "no unit"]),
}


@pytest.mark.parametrize("case", WRONG_ENUMERATIONS)
def test_a_wrong_enumeration_is_refused(trajectory: Path, tmp_path: Path, case: str) -> None:
    old, new, words = WRONG_ENUMERATIONS[case]
    change(trajectory, old, new)
    result = generate(trajectory, tmp_path / "out")
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    for word in [".toml", *words]:
        assert word in result.stderr


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("RP_TRAJECTORY_LINE", "RP_TRAJECTORY_CIRCLE", "RP_TRAJECTORY_CIRCLE must be 2"),
        ("RP_TRAJECTORY_LINE", "RP_TRAJECTORY_SPIRAL", "RP_TRAJECTORY_SPIRAL"),
        ("parameters.motion", "parameters.radius", "motion: parameters.radius must be of type int"),
    ],
)
def test_a_constant_of_another_value_does_not_compile(
    trajectory: Path, tmp_path: Path, old: str, new: str, word: str
) -> None:
    change(trajectory, old, new)
    generated(trajectory, tmp_path / "out")
    with pytest.raises(ValueError, match=word):
        compile_table(tmp_path / "out", "rp_trajectory")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    result = generate(tmp_path / "none.toml", tmp_path / "out")
    assert result.returncode == 2
    assert "none.toml: cannot be read" in result.stderr


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    result = generate(VARIABLES, tmp_path / "out")
    assert result.returncode == 2
    assert str(tmp_path) in result.stderr


def test_the_declarations_are_readable_by_others() -> None:
    """Other programs read the file with nothing but a TOML reader."""
    content = tomllib.loads(VARIABLES.read_text())
    assert content["variables"]["q1"]["reference"] == 10
