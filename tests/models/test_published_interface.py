"""Every FMU keeps its published interface, on which users' systems and scenarios rely: names, value
references, starts, dependencies, units, types, flags, terminals and their order."""

from pathlib import Path

import pytest

from tests.equations.compiled import building, declaration, lock, read
from tests.models.published_interface import PLACES, differences, of_fmu, of_texts, published
from tests.support.paths import EVERY, OF_FILES, ROOT

# What may differ, and why: FMU, variable or path of another part, column; "*" is any
EVENTS = "where a limit begins and ends is an event now"
HOOK = "C by hand decides it, and may read everything"
STATICS = "what holds a joint does not follow from its inertia"
HELD = ("friction", "stop_force")
SET_IN_C = ("mode", "stop_impulse")
CHANGED: dict[tuple[str, str, str], str] = {
    ("RPActuator", "/", "attributes"): EVENTS,
    ("RPActuator", "/ModelExchange", "attributes"): EVENTS,
    ("RPActuator", "/CoSimulation", "attributes"): EVENTS,
    ("RPActuator", "/order/event indicator", "*"): EVENTS,
    **{("RPActuator", f"indicator_{i}", "*"): EVENTS for i in range(1, 9)},
    **{("RPActuator", n, "*"): EVENTS for n in ("event_count", "last_event_time", "max_events")},
    **{
        ("RPSensor", f"{name}{joint}{kind}", column): "the latency decides which sample is shown"
        for name, kind in (("q", "_measured"), ("dq", "_measured"), ("counts", ""))
        for joint in (1, 2)
        for column in ("output", "initial unknown")
    },
    **{
        ("RPController", name, column): "a sample depends on the rates of the sample before"
        for name, what in (
            ("tau1", "output"),
            ("f2", "output"),
            ("dintegral1", "state derivative"),
            ("dintegral2", "state derivative"),
        )
        for column in (what, "initial unknown")
    },
    **{
        (fmu, name, ""): "models of files with equations have it"
        for fmu in ("RPSensor", "RPTrajectory", "RPController")
        for name in ("event_count", "last_event_time", "max_events")
    },
    ("RPPlant", "*", "initial unknown"): HOOK,
    **{("RPPlant", f"{name}{i}", "output"): HOOK for name in SET_IN_C for i in (1, 2)},
    **{("RPPlant", f"{name}{i}", "output"): STATICS for name in HELD for i in (1, 2)},
    **{
        ("RPPlant", f"slip{i}_{side}", "event indicator"): STATICS
        for i in (1, 2)
        for side in ("forward", "backward")
    },
    **{
        ("RPPlant", f"stop{i}_{kind}", "event indicator"): "without friction no joint is held"
        for i in (1, 2)
        for kind in ("lower", "upper", "push")
    },
    ("RPPlant", "impact_loss", "output"): HOOK,
    ("RPPlant", "grasp_loss", "output"): HOOK,
    **{
        ("RPPlant", f"mode{i}", column): "it says which there are"
        for i in (1, 2)
        for column in ("min", "max")
    },
}

each_version = pytest.mark.parametrize("version", PLACES)


def allows(entry: tuple[str, str, str], difference: tuple[str, str, str]) -> bool:
    """True if an entry of CHANGED is about a difference."""
    return all(own in ("*", text) for own, text in zip(entry, difference, strict=True))


@pytest.mark.parametrize("name", EVERY)
def test_the_published_interface_stays(fmu: Path, name: str) -> None:
    """A change is a line of CHANGED, and each line there is a change of some version."""
    found = [
        ((name, part, column), f"FMI {version}.0, {part}, {column}: {before!r} became {now!r}")
        for version, place in PLACES.items()
        for part, column, before, now in differences(
            published(name, version), of_fmu(fmu.parent / place / f"{name}.fmu")
        )
    ]
    wrong = [text for key, text in found if not any(allows(entry, key) for entry in CHANGED)]
    assert not wrong, "\n".join(wrong)
    own = [entry for entry in CHANGED if entry[0] == name]
    assert [entry for entry in own if not any(allows(entry, key) for key, _ in found)] == []


@pytest.mark.parametrize("name", OF_FILES)
def test_rparm_build_gives_what_the_project_ships(fmu: Path, name: str, tmp_path: Path) -> None:
    """The same C and the same model description, up to the author and the license."""
    file = read(ROOT / OF_FILES[name])
    references = lock.references(lock.path_of(file.path), declaration.keys(file))
    declared = building.write_c(file, references, tmp_path)
    description = building.fmi2_description(declared, building.Provenance())
    assert list(differences(of_fmu(fmu.with_name(f"{name}.fmu")), of_texts(description))) == []
    shipped = fmu.parent / "fmu" / name
    for path in ("equations.c", "equations.h", "variables.c"):
        assert (tmp_path / path).read_bytes() == (shipped / path).read_bytes(), path


DESCRIPTION = """<fmiModelDescription fmiVersion="{version}.0" modelName="M" guid="{{1}}">
  <CoSimulation modelIdentifier="M" canBeInstantiatedOnlyOncePerProcess="false" />
  <UnitDefinitions><Unit name="kg"><BaseUnit kg="1" /></Unit></UnitDefinitions>
  {types}
  <ModelVariables>{variables}</ModelVariables>
  <ModelStructure>{structure}</ModelStructure>
</fmiModelDescription>"""
TEXTS = {
    "2": DESCRIPTION.format(
        version=2,
        types="",
        variables="""
        <ScalarVariable name="m" valueReference="7" causality="parameter" description="Mass">
          <Real unit="kg" start="2.0" min="0.0" /></ScalarVariable>
        <ScalarVariable name="x" valueReference="9" causality="output"><Real /></ScalarVariable>
        <ScalarVariable name="v" valueReference="8" causality="output"><Real derivative="2" />
        </ScalarVariable>""",
        structure="""
        <Outputs><Unknown index="2" dependencies="" /><Unknown index="3" /></Outputs>
        <InitialUnknowns><Unknown index="3" dependencies="1 2" dependenciesKind="fixed dependent" />
        </InitialUnknowns>""",
    ),
    "3": DESCRIPTION.format(
        version=3,
        types="""
        <TypeDefinitions><Float64Type name="Float64 in kg" unit="kg" /></TypeDefinitions>""",
        variables="""
        <Float64 name="m" valueReference="7" causality="parameter" description="Mass" start="2.0"
         declaredType="Float64 in kg" min="0.0" />
        <Float64 name="x" valueReference="9" causality="output" />
        <Float64 name="v" valueReference="8" causality="output" derivative="9" />""",
        structure="""
        <Output valueReference="9" dependencies="" /><Output valueReference="8" />
        <InitialUnknown valueReference="8" dependencies="7 9" dependenciesKind="fixed dependent" />
        """,
    ),
}
EXPECTED = {
    "m": {
        "valueReference": "7", "causality": "parameter", "description": "Mass", "start": "2.0",
        "type": "Float64", "unit": "kg", "min": "0.0",
    },
    "x": {"valueReference": "9", "causality": "output", "type": "Float64", "output": "none"},
    "v": {
        "valueReference": "8", "causality": "output", "type": "Float64", "derivative": "x",
        "output": "all", "initial unknown": "7 9 fixed dependent",
    },
    "/": {"attributes": "modelName='M'"},
    "/CoSimulation": {
        "attributes": "canBeInstantiatedOnlyOncePerProcess='false' modelIdentifier='M'"
    },
    "/Unit kg/BaseUnit": {"attributes": "kg='1'"},
    "/order/output": {"attributes": "x v"},
    "/order/initial unknown": {"attributes": "v"},
}  # fmt: skip


@each_version
def test_both_versions_are_read_alike(version: str) -> None:
    assert of_texts(TEXTS[version]) == EXPECTED


CHANGES = [
    ('"m"', '"mass"', "mass"), ('"m"', '"mass"', "m"), ('"7"', '"6"', "m"),
    ('start="2.0"', 'start="2.5"', "m"), ('"Mass"', '"mass"', "m"), ("parameter", "input", "m"),
    ("kg", "g", "m"), (' min="0.0"', "", "m"), ('"1 2"', '"1"', "v"), ('"7 9"', '"7"', "v"),
    ("fixed dependent", "dependent fixed", "v"), ("false", "true", "/CoSimulation"),
    ('"M" guid', '"N" guid', "/"), (' dependencies=""', "", "x"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("version", "change"),
    [(v, change) for v in PLACES for change in CHANGES if change[0] in TEXTS[v]],
)
def test_no_change_is_missed(version: str, change: tuple[str, str, str]) -> None:
    before, now, part = change
    found = of_texts(TEXTS[version].replace(before, now))
    assert part in {name for name, *_ in differences(EXPECTED, found)}
