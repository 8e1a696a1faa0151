"""Systems without Ecos, in the master of rparm and in libcosim, are what the references say; SSPs
of loop files run by engines as exact steps have it."""

import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

import rparm
from rparm import project
from rparm.errors import UserError
from rparm.systems import comparison, ecos, master, opened, ssp, ssp_writer
from tests.closed_loop.test_loop_file import TABLES
from tests.importers.osp import libcosim, only_variant
from tests.importers.test_importers import CHECKER, folder_of
from tests.support.programs import python
from tests.support.rparm_project import Console
from tests.support.ssp_files import SSP, edited, replace
from tests.support.systems import BOUND, CASES, System, difference

ABSENT = "ecospy is not installed"


def compared(name: str) -> list[comparison.Outcome]:
    """All variants of a system, stepped in this process."""
    folder = project.systems()[name]
    with ssp.unpacked(project.built(folder, ".ssp")) as opened:
        experiment = comparison.load_study(folder).EXPERIMENT
        return [
            comparison.simulate(
                opened,
                variant,
                comparison.load_reference(opened, variant, folder, experiment),
                master.run_in_master,
            )
            for variant in opened.system.parameters
        ]


@pytest.mark.parametrize("name", ["closed_loop", "machine"])
def test_all_variants_are_within_the_bound(name: str) -> None:
    outcomes = compared(name)
    assert len(outcomes) == 5
    assert [outcome.variant for outcome in outcomes if not outcome.passed] == []


def test_the_command_says_who_steps(
    tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ecos, "absent", lambda: ABSENT)
    monkeypatch.setattr(ecos, "run", None)  # nobody may call it
    code, out, _ = console("system", "nominal", "--report", tmp_path)
    assert code == 0
    assert f"{ABSENT}: the master of rparm steps closed_loop" in out
    assert "passed: 1 variant" in out


@pytest.mark.parametrize(
    ("system", "machine", "words"),
    [
        ("linux", "x86_64", ""),
        ("win32", "AMD64", ""),
        ("linux", "aarch64", "x86-64 only"),
        ("darwin", "x86_64", "x86-64 only"),
    ],
)
def test_where_ecos_has_no_library(
    monkeypatch: pytest.MonkeyPatch, system: str, machine: str, words: str
) -> None:
    monkeypatch.setattr("sys.platform", system)
    monkeypatch.setattr("platform.machine", lambda: machine)
    assert words in ecos.absent() and bool(words) == bool(ecos.absent())


SSP3 = SSP.parent / "fmi3" / SSP.name


def test_the_command_takes_the_fmus_of_fmi_3(tmp_path: Path, console: Console) -> None:
    code, out, err = console("system", "nominal", "--fmi", "3", "--report", tmp_path)
    assert (code, err) == (0, "") and "passed: 1 variant; " in out
    assert "ClosedLoop (FMI 3.0)" in (tmp_path / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("source", [SSP, SSP3], ids=["2.0", "3.0"])
def test_what_ecos_would_not_set_is_refused(tmp_path: Path, console: Console, source: Path) -> None:
    """Enumerations of any version of FMI."""
    law = '<ssv:Parameter name="mode"><ssv:Integer value="1"/></ssv:Parameter>'
    added = replace("<ssv:Parameters>", f"<ssv:Parameters>{law}")
    path = edited(source, tmp_path / "law.ssp", {"resources/controller_nominal.ssv": added})
    error = console.failed("system", "nominal", "--ssp", path, "--report", tmp_path / "report")
    assert "component 'controller': 'mode' is an Enumeration, which Ecos does not set" in error


@pytest.mark.parametrize(
    ("system", "variant"),
    [CASES[0], CASES[4], CASES[5], CASES[8]],
    ids=lambda x: getattr(x, "folder", x),
)
def test_libcosim_is_at_the_reference_of_its_order(
    system: System, variant: str, tmp_path: Path
) -> None:
    """All Real variables are those of the sampled system."""
    path = system.path  # libcosim takes the first variant
    if variant != system.variants[0]:
        change = {"SystemStructure.ssd": only_variant(variant)}
        path = edited(system.path, tmp_path / "one.ssp", change)
    with ssp.unpacked(path) as opened:
        left_out = {"time", *comparison.discrete(opened)}
    expected = system.reference(variant, "sampled.csv")
    rows = system.rows(expected)[1:]
    names = [name for name in expected if name not in left_out]
    result = libcosim(path, names, system.steps, tmp_path)
    for name in names:
        assert difference(result[name][rows - 1], expected[name][1:]) <= BOUND, name


# ---- SSPs of loop files --------------------------------------------------------------------------


STEP, STEPS, KP, KD, REFERENCE = 0.01, 100, 9.0, 4.0, 0.2
LOOP = TABLES["slide"]["loop.toml"]
MOVING = ("constant = 0.2", "sines = [{ amplitude = 0.2, frequency = 1.0 }]")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("slide")
    for name, text in TABLES["slide"].items():
        (made / name).write_text(text)
    (made / "moving.toml").write_text(LOOP.replace(*MOVING))
    return made


@pytest.fixture(scope="module")
def slide(folder: Path) -> Path:
    with opened.opened(folder / "loop.toml") as system:
        needed = ssp_writer.write(folder / "Slide.ssp", system)
    assert list(needed) == ["class"] and needed["class"].startswith("Python 3.")
    return folder / "Slide.ssp"


def exact(mass: float) -> np.ndarray:
    """Positions at the points, (STEPS + 1,): each step has the force of the one before it."""
    q, v, force = 0.0, 0.0, 0.5
    found = [q]
    for _ in range(STEPS):
        after = KP * (REFERENCE - q) - KD * v
        q, v = q + v * STEP + force / mass * STEP**2 / 2, v + force / mass * STEP
        found.append(q)
        force = after
    return np.array(found)


def test_it_says_what_the_file_says(slide: Path) -> None:
    with ssp.unpacked(slide) as found:
        system = found.system
        assert (system.name, system.stop, system.step) == ("Slide", 1.0, STEP)
        assert system.descriptions == {"light": 'Half of it, "light"'}
        law = {"kd": KD, "reference": REFERENCE}
        assert system.parameter_sets == {
            "default": {"arm": {"a": 0.0, "g": 0.0, "m2": 2.0}, "class": law},
            "light": {"arm": {"a": 0.0, "g": 0.0, "m2": 1.0}, "class": law},
        }
        description = fmpy.read_model_description(found.fmu("class"))
    assert description.fmiVersion == "2.0" and "needs Python 3." in description.description


@pytest.mark.parametrize(("variant", "mass"), [("default", 2.0), ("light", 1.0)])
def test_engines_step_as_the_equations_do(
    slide: Path, folder: Path, variant: str, mass: float
) -> None:
    """The mass moves exactly under the forces that a step of delay gives."""
    for path, engine in ((folder / "loop.toml", "master"), (slide, "master"), (slide, "ecos")):
        table = rparm.System(path).run(variant, engine=engine)
        assert np.abs(table["arm.q2"] - exact(mass)).max() < 1e-8, (path, engine)


def test_libcosim_runs_its_first_variant(slide: Path, tmp_path: Path) -> None:
    found = libcosim(slide, ["arm.q2"], STEPS, tmp_path)
    assert np.abs(found["arm.q2"] - exact(2.0)[1:]).max() < 1e-8


def test_what_moves_is_an_input_of_the_system(folder: Path, console: Console) -> None:
    """Other tools see it; here it keeps its start value, and Ecos gets a system without it."""
    path = folder / "Moving.ssp"
    code, out, err = console("ssp", folder / "moving.toml", "-o", path)
    assert code == 0 and out.endswith(f", which class needs; run it by ./run.sh system {path}\n")
    assert f"{path}: written without how class.reference moves, and without Python 3." in out
    assert "inputs of the system, which Ecos and libcosim do not load: class.reference" in err
    system = rparm.System(path)
    assert system.notes == (
        "not connected, constant: arm.tau1",
        "inputs of the whole system, which nothing moves here, constant: class.reference",
    )
    with opened.opened(path) as found:
        run = ecos.run(found, "light", ["arm.q2"])
    held = system.run("light")["arm.q2"]
    assert np.abs(run.values[:, 0] - held).max() < 1e-10 and np.abs(held).max() > 1e-4
    program = folder_of(CHECKER) / "bin" / "fmucontainer"
    command = [program, "-fmi", "2", "-fmu-directory", folder, "-container", f"{path.name}:{STEP}"]
    process = subprocess.run(command, check=False, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    container = fmpy.read_model_description(folder / "Moving.fmu")
    inputs = [v.name for v in container.modelVariables if v.causality == "input"]
    assert inputs == ["class.reference"]


def test_strangers_write_what_ecos_does_not_read(slide: Path, tmp_path: Path) -> None:
    """No prefix, and sets within the structure, all of which apply; Ecos gets another copy."""
    with zipfile.ZipFile(slide) as archive:
        sets = {name: archive.read(name) for name in archive.namelist() if name.endswith(".ssv")}

    def other(content: bytes) -> bytes:
        for name, text in sets.items():
            old = f'<ssd:ParameterBinding source="{name}"/>'.encode()
            assert old in content
            inside = text[text.index(b"<ssv:") :]
            new = b"<ssd:ParameterBinding><ssd:ParameterValues>" + inside
            new += b"</ssd:ParameterValues></ssd:ParameterBinding>"
            content = content.replace(old, new, 1).replace(old, b"")
        return content.replace(b"xmlns:ssd=", b"xmlns=").replace(b"ssd:", b"")

    with ssp.unpacked(edited(slide, tmp_path / "x.ssp", {ssp.STRUCTURE: other})) as found:
        values = ecos.run(found, ssp.ALONE, ["arm.q2"]).values[:, 0]
    assert np.abs(values - exact(1.0)).max() < 1e-8


def test_python_that_raises_is_named(tmp_path: Path) -> None:
    """Packed here, with its line, by either engine; FMUs of PythonFMU itself end Ecos."""
    for name, text in TABLES["raising"].items():
        (tmp_path / name).write_text(text)
    python("-m", "pythonfmu", "build", "-f", tmp_path / "raw.py", "-d", tmp_path, check=True)
    with opened.opened(tmp_path / "loop.toml") as system:
        ssp_writer.write(tmp_path / "Loop.ssp", system)
    (tmp_path / "raw.toml").write_text(TABLES["raising"]["loop.toml"].replace("law.py", "raw.fmu"))
    why = "law.py, line 6: ValueError: too hot"
    for file, engine, said in (
        ("Loop.ssp", "master", f"law: fmi2DoStep in the step from t = 0.3.* failed .*: {why}"),
        ("Loop.ssp", "ecos", f"component 'law': 'y' is nan at t = 0.4 s: {why}"),
        ("raw.toml", "master", "law: fmi2DoStep in the step from t = 0.3"),
        ("raw.toml", "ecos", "perhaps Python has raised an error in 'law'; run"),
    ):
        with pytest.raises(UserError, match=said):
            rparm.System(tmp_path / file).run(engine=engine)


def test_variants_cannot_differ_in_what_no_fmu_has(folder: Path, tmp_path: Path) -> None:
    loop = folder / "arrays.toml"
    loop.write_text(f"{LOOP}'class.gains' = [3.0]\n")
    with opened.opened(loop) as system, pytest.raises(UserError) as caught:
        ssp_writer.write(tmp_path / "x.ssp", system)
    assert "component 'class': variants give arrays or tables different" in str(caught.value)
