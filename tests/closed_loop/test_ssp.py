"""SSPs: what one may leave out, what is refused, and what holds for the SSPs of all systems."""

import re
import sys
import zipfile
from dataclasses import replace as replaced
from pathlib import Path

import fmpy
import numpy as np
import pytest
from lxml import etree

import rparm
from rparm import project
from rparm.errors import UserError
from rparm.project import VERSIONS
from rparm.systems import ecos, ssp
from rparm.systems.ssp import NAMESPACES
from tests.support.paths import ROOT
from tests.support.rparm_project import MISTAKES, Console
from tests.support.ssp_files import (
    ALGORITHM,
    EXPERIMENT,
    FROM_TRAJECTORY,
    SETS,
    SSP,
    TYPES,
    Edit,
    edited,
    edited_fmu,
    replace,
    without,
)

STRUCTURE = "SystemStructure.ssd"
FMUS = {"trajectory": "RPTrajectory", "controller": "RPController", "arm": "RPManipulator"}
DOTTED = {"trajectory": "wanted.a.b", "controller": "plant", "arm": "plant.1"}


def refused(path: Path) -> str:
    """Text with which an SSP is refused: one line that names the archive."""
    with pytest.raises(UserError) as caught, ssp.unpacked(path):
        pass
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"{path}: ")
    return text


# ---- what is in it -------------------------------------------------------------------------------


def test_the_usual_variant_is_the_first_or_default() -> None:
    with ssp.unpacked(SSP) as opened:
        other = replaced(opened.system, parameters={"last": {}, "default": {}})
        assert opened.variant(None) == "nominal"
        assert replaced(opened, system=other).variant(None) == "default"


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with ssp.unpacked(SSP) as opened:
        folder = opened.folder
        assert opened.fmu("arm").is_file()
    assert not folder.exists()
    assert list(tmp_path.iterdir()) == []


# ---- what an SSP may leave out -------------------------------------------------------------------


def test_what_an_ssp_leaves_out_is_taken_from_its_fmus(tmp_path: Path) -> None:
    """Units, types, parameter sets, times: the nominal variant has the FMUs' own values."""
    bare = rparm.System(without(tmp_path / "bare.ssp", SETS, EXPERIMENT, TYPES))
    assert bare.variants == ("default",) and bare.notes == (
        "stop time 6 s: the largest of its FMUs (trajectory)",
        "communication step 0.001 s: the smallest of its FMUs (trajectory)",
    )
    whole = rparm.System(SSP)
    assert whole.notes == ()
    ours, theirs = bare.run(), whole.run("nominal")  # whose tolerances are 1e-8 and 1e-11
    assert ours["time"].tolist() == theirs["time"].tolist()
    for name in ("arm.q1", "arm.q2", "controller.tau1"):
        assert ours[name] == pytest.approx(theirs[name], abs=1e-6 * np.abs(theirs[name]).max())


def test_sets_of_one_component_each_are_one_variant(tmp_path: Path) -> None:
    others = r'<ssd:ParameterBinding source="\w+/[a-z]+_(?!nominal)\w+\.ssv"/>'
    own = {NOMINAL_ARM: replace('name="nominal"', 'name="arm"')}
    path = without(tmp_path / "own.ssp", others, more=own)
    with ssp.unpacked(path) as found, ssp.unpacked(SSP) as whole:
        sets = found.system.parameter_sets
        assert sets == {"default": whole.system.parameter_sets["nominal"]}
        assert ecos.run(found, "default", ["arm.q1"]).values[-1] != 0.0


def test_all_sets_of_a_component_apply_and_the_last_wins(tmp_path: Path) -> None:
    """By the standard, in the SSPs of others, which bind none first and last."""
    others = r'<ssd:ParameterBinding source="\w+/(?!arm_h\w+(oad|plane)\.)\w+\.ssv"/>'
    none = r"<ssd:ParameterBindings>\s*</ssd:ParameterBindings>"
    more = {"resources/arm_horizontal_plane.ssv": replace('name="m2"', 'name="m1"')}
    with ssp.unpacked(without(tmp_path / "two.ssp", others, none, more=more)) as found:
        (only,) = found.system.parameter_sets.values()
    assert only["arm"] == {"relative_tolerance": 1e-11, "m2": 1.2, "g": 0.0, "m1": 1.0}


def test_an_input_that_is_not_connected_keeps_its_start(tmp_path: Path) -> None:
    """The references of computed torque with poles at -20: a step, also from a parameter set.

    Jacobi order feeds back what is one to two steps old, which at 0.3 * 20 / e rad/s is 4.4e-3 rad.
    """
    stays = rparm.System(without(tmp_path / "zero.ssp", SETS, FROM_TRAJECTORY, ALGORITHM))
    step, alone = stays.notes
    assert step == "communication step 0.001 s: the smallest of its FMUs (trajectory)"
    assert alone.startswith("not connected, constant: controller.q1_ref, controller.q2_ref, ")
    assert np.abs(stays.run()["arm.q1"]).max() < 1e-9
    values = TOLERANCE + '</ssv:Parameter><ssv:Parameter name="q1_ref"><ssv:Real value="0.3"/>'
    more = {"resources/controller_nominal.ssv": replace(TOLERANCE, values)}
    others = r'<ssd:ParameterBinding source="[^"]*_(?!nominal)\w+\.ssv"/>'
    path = without(tmp_path / "step.ssp", others, FROM_TRAJECTORY, more=more)
    table = rparm.System(path).run()
    time, exact = table["time"], 0.3 * (1 - (1 + 20 * table["time"]) * np.exp(-20 * table["time"]))
    assert np.abs(table["arm.q1"] - exact)[time < 2].max() < 2e-3 * 0.3 * 20 / np.e
    found = rparm.linearize(path, at={"controller.q1_ref": 0.2})
    assert found.poles == pytest.approx([-20.0] * 4, abs=1e-4)
    with pytest.raises(UserError, match="arm.tau1: is connected"):
        rparm.linearize(path, at={"arm.tau1": 0.2})


@pytest.mark.parametrize(
    ("experiments", "span", "step", "said"),
    [
        ({"RPController": "0.004", "RPTrajectory": "0.01"}, 6.0, 0.001, "(arm)"),
        ({"RPManipulator": "0.007"}, 0.7, 0.001, "(trajectory)"),
        (dict.fromkeys(FMUS.values(), "0.004"), 0.01, 0.01 / 3, "(trajectory)"),
        (dict.fromkeys(FMUS.values(), "3.0"), 0.5, 0.5, "(trajectory)"),
        (dict.fromkeys(FMUS.values(), ""), 0.5, 0.0005, "1/1000 of the run"),
    ],
)
def test_the_step_is_the_smallest_of_the_fmus(
    experiments: dict[str, str], span: float, step: float, said: str, tmp_path: Path
) -> None:
    more = {}
    for fmu, size in experiments.items():
        new = f'stepSize="{size}"' if size else ""
        described = {"modelDescription.xml": replace('stepSize="0.001"', new)}
        more[f"resources/{fmu}.fmu"] = edited_fmu(described)
    path = without(tmp_path / "times.ssp", EXPERIMENT, more=more)
    given = f'<ssd:DefaultExperiment stopTime="{span}"/></ssd:SystemStructureDescription>'
    end = {STRUCTURE: replace("</ssd:SystemStructureDescription>", given)}
    with ssp.unpacked(edited(path, tmp_path / "timed.ssp", end)) as opened:
        system = opened.system
        assert system.step == pytest.approx(step, rel=1e-12) and said in opened.notes[0]
        assert system.times[-1] == pytest.approx(span, rel=1e-12)


def dotted(path: Path, more: dict[str, Edit] | None = None) -> Path:
    """The closed loop with dots in the names of its components."""

    def edit(content: bytes) -> bytes:
        for old, new in DOTTED.items():
            for attribute in ("startElement", "endElement", "Component name"):
                known = f'{attribute}="{old}"', f'{attribute}="{new}"'
                content = content.replace(*(text.encode() for text in known))
        return content

    return edited(SSP, path, {STRUCTURE: edit} | (more or {}))


def test_names_of_components_may_have_dots(tmp_path: Path) -> None:
    """Names change no number, in no engine; of two that fit, the longest has the variable."""
    path = dotted(tmp_path / "dotted.ssp")
    plain, named = rparm.System(SSP), rparm.System(path)
    values = ({"step": "10 ms", "parameters": {f"{arm}.m2": 2.0}} for arm in ("arm", "plant.1"))
    results = [(plain.run(**next(values)), named.run(**next(values)))]
    results.append((plain.run(engine="ecos"), named.run(engine="ecos")))
    for ours, theirs in results:
        for name in ours.keys() - {"time"}:
            component, variable = name.split(".")
            assert ours[name].tobytes() == theirs[f"{DOTTED[component]}.{variable}"].tobytes()
    poles = [
        rparm.linearize(file, at={f"{arm}.q1": 0.2}, break_at=f"{arm}.tau1").poles
        for file, arm in ((SSP, "arm"), (path, "plant.1"))
    ]
    assert poles[0].tobytes() == poles[1].tobytes()
    for name, said in (
        ("plant.1.m3", "'plant.1' has no variable 'm3'"),
        ("plant.2.m2", "'plant' has no variable '2.m2', did you mean 'm2'?"),
        ("plants.m2", "no component 'plants', did you mean 'plant'?"),
    ):
        with pytest.raises(UserError, match=re.escape(said)):
            named.run(parameters={name: 1.0})


def test_two_variables_of_one_name_are_refused(tmp_path: Path) -> None:
    """Component "plant" has a variable "1.m2", and "plant.1" has "m2"."""
    gain = edited_fmu({"modelDescription.xml": replace('name="Kp1"', 'name="1.m2"')})
    text = refused(dotted(tmp_path / "same.ssp", {CONTROLLER: gain}))
    both = "components 'plant' and 'plant.1'"
    assert text.endswith(f"'plant.1.m2' is a variable of {both}: rename one of them")


# ---- what is refused -----------------------------------------------------------------------------

TAU1 = '<ssd:Connector name="tau1" kind="input"><ssc:Real unit="N.m"/>'
NOMINAL_ARM = "resources/arm_nominal.ssv"
TOLERANCE = '<ssv:Parameter name="relative_tolerance"><ssv:Real value="1e-11" unit="1"/>'
CONTROLLER, GAINS = "resources/RPController.fmu", "resources/controller_nominal.ssv"
IN_CONTROLLER = "component 'controller'"
OLD_FMU = edited_fmu({"modelDescription.xml": replace('fmiVersion="2.0"', 'fmiVersion="1.0"')})
ITEM = '<ssv:Parameter name="mode"><ssv:Enumeration value="pd"/>'
# edits of files in the SSP; parts of the message, with | between them
FILES: list[tuple[str, Edit, str]] = [
    (CONTROLLER, lambda _: None, f"{IN_CONTROLLER}|{CONTROLLER} is missing"),
    (CONTROLLER, lambda content: content[: len(content) // 2], f"{IN_CONTROLLER}|not an FMU"),
    (CONTROLLER, OLD_FMU, f"{IN_CONTROLLER}|{CONTROLLER}"),
    (GAINS, replace(TOLERANCE, ITEM), f"{IN_CONTROLLER}|'mode'|Integer"),
    (NOMINAL_ARM, replace('name="nominal"', 'name="nominl"'), "has no parameter set 'nominl'"),
    (NOMINAL_ARM, lambda _: None, f"{NOMINAL_ARM}: is missing in the SSP"),
    (NOMINAL_ARM, lambda content: content[:-20], f"{NOMINAL_ARM}|not valid XML"),
    (STRUCTURE, lambda _: None, f"{STRUCTURE}: is missing in the SSP"),
    (STRUCTURE, lambda content: content[:-200], f"{STRUCTURE}|not valid XML"),
    (STRUCTURE, replace("ssd:Elements>", "ssd:Elemente>", -1), f"{STRUCTURE}|line |Elemente"),
]
WRONG = [
    *FILES,
    *((STRUCTURE, replace(old, new), said) for old, new, said in MISTAKES["structure"]["rows"]),
    *(
        (NOMINAL_ARM, replace(TOLERANCE, f'<ssv:Parameter name="{new}'), said)
        for new, said in MISTAKES["parameter_set"]["rows"]
    ),
]


@pytest.mark.parametrize(("file", "edit", "said"), WRONG)
def test_a_wrong_ssp_is_refused(file: str, edit: Edit, said: str, tmp_path: Path) -> None:
    text = refused(edited(SSP, tmp_path / "wrong.ssp", {file: edit}))
    for part in said.split("|"):
        assert part in text


def test_the_command_line_explains_in_one_line(tmp_path: Path, console: Console) -> None:
    path = edited(SSP, tmp_path / "wrong.ssp", {STRUCTURE: replace(TAU1, TAU1.replace("N.m", "N"))})
    error = console.refused("system", "--ssp", path, "--report", tmp_path / "report")
    wrong = "component 'arm': connector 'tau1' is in 'N', in its FMU 'N.m'"
    assert error == f"error: {path}: {wrong}\n"
    assert not (tmp_path / "report").exists()


# ---- The archive of every system, of either version of FMI ---------------------------------------


sys.path.insert(0, str(ROOT / "fmu"))
import package  # noqa: E402

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"
KINDS = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}


@pytest.fixture(scope="module", params=VERSIONS)
def version(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module", params=project.systems())
def archive(request: pytest.FixtureRequest, version: str) -> Path:
    return project.built(project.systems()[request.param], ".ssp", version=version)


def test_files_are_valid_against_the_schemas(archive: Path) -> None:
    found = []
    with zipfile.ZipFile(archive) as files:
        for name in files.namelist():
            if Path(name).suffix in KINDS:
                schema = etree.XMLSchema(etree.parse(SCHEMAS / KINDS[Path(name).suffix]))
                schema.assertValid(etree.fromstring(files.read(name)).getroottree())
                found.append(name)
    with ssp.unpacked(archive) as opened:
        sets = opened.system.parameters
        assert len(sets) > 1
        assert len(found) == 1 + sum(map(len, sets.values()))


def test_the_archive_depends_on_its_contents_alone(archive: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(archive) as files:
        files.extractall(tmp_path / "files")
        names = files.namelist()
    again = tmp_path / "again.ssp"
    package.pack(again, [(name, tmp_path / "files" / name) for name in reversed(names)])
    assert again.read_bytes() == archive.read_bytes()


def test_it_has_the_fmus_beside_it(archive: Path, version: str) -> None:
    with ssp.unpacked(archive) as opened:
        for component in opened.system.components:
            built = archive.parent / Path(component.source).name
            assert opened.fmu(component.name).read_bytes() == built.read_bytes()
            assert opened.models[component.name].fmi_version == version
            # the model, and not only the file, has that name
            assert component.source == f"resources/{opened.models[component.name].name}.fmu"


def test_units_that_are_used_are_defined(archive: Path) -> None:
    with zipfile.ZipFile(archive) as files:
        for name in files.namelist():
            if name.endswith((".ssd", ".ssv")):
                root = etree.fromstring(files.read(name))
                used = set(root.xpath("//@unit"))
                defined = root.xpath("//ssc:Unit/@name", namespaces=NAMESPACES)
                assert set(defined) == used, name
                assert len(defined) == len(used)


def test_units_are_those_of_the_fmus(archive: Path) -> None:
    """Exponents of the SI base units, as the model descriptions define them."""
    bases = ("kg", "m", "s", "A", "rad")
    with ssp.unpacked(archive) as opened:
        for component in opened.models:
            description = fmpy.read_model_description(opened.fmu(component))
            units = {u.name: u.baseUnit for u in description.unitDefinitions}
            files = [opened.folder / STRUCTURE]
            files += sorted((opened.folder / "resources").glob(f"{component}_*.ssv"))
            assert len(files) > 1
            for path in files:
                for unit in etree.parse(path).iterfind(".//ssc:Unit", NAMESPACES):
                    if unit.get("name") in units:
                        wanted = [getattr(units[unit.get("name")], b) or 0 for b in bases]
                        given = [int(unit[0].get(b, 0)) for b in bases]
                        assert given == [int(x) for x in wanted], (path.name, unit.get("name"))


def test_omsimulator_finds_what_it_needs(archive: Path) -> None:
    """The type of each component, and its own annotation with the step that the others take too."""
    with ssp.unpacked(archive) as opened:
        step, count = opened.system.step, len(opened.system.components)
        root = etree.parse(opened.folder / STRUCTURE).getroot()
    types = [node.get("type") for node in root.iterfind(".//ssd:Component", NAMESPACES)]
    assert types == ["application/x-fmu-sharedlibrary"] * count
    system = root.find("ssd:System", NAMESPACES)
    assert system is not None
    assert system[-1].tag.endswith("}Annotations")
    masters = root.xpath(
        "//ssc:Annotation[@type='org.openmodelica']//*[local-name()='FixedStepMaster']",
        namespaces=NAMESPACES,
    )
    assert [float(master.get("stepSize")) for master in masters] == [step]


def test_every_importer_gets_a_whole_variant(archive: Path) -> None:
    """The first set, which libcosim reads, gives the values of the first variant; so do all sets
    applied in turn, as the standard has it; in any order the last one gives all values."""
    with ssp.unpacked(archive) as opened:
        first, components = next(iter(opened.system.parameters)), list(opened.models)
        folder = opened.folder
        root = etree.parse(folder / STRUCTURE).getroot()
        for component in components:
            path = f".//ssd:Component[@name='{component}']//ssd:ParameterBinding"
            sources = [node.get("source") for node in root.iterfind(path, NAMESPACES)]
            assert sources[0] == sources[-1] == f"resources/{component}_{first}.ssv"
            names = [
                etree.parse(folder / source).xpath("//ssv:Parameter/@name", namespaces=NAMESPACES)
                for source in sources
            ]
            assert all(x == names[0] for x in names)
