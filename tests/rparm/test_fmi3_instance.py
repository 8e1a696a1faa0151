"""FMUs of FMI 3.0 in rparm: the same models and bits as those of FMI 2.0, and what differs."""

import math
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError, WrongValueError
from rparm.fmi.fmu_file import Fmu, read_model
from rparm.fmi.model import Variable
from rparm.runs import simulation
from tests.support.rparm_project import FMUS, SHORT, declared, fmi3_fmu, load, repacked


@pytest.fixture(scope="module")
def opened3(fmu: Path) -> Iterator[Fmu]:
    with Fmu(fmi3_fmu(fmu)) as opened:
        yield opened


# ---- the same as in FMI 2.0 ----------------------------------------------------------------------


@pytest.mark.parametrize("path", FMUS.values(), ids=lambda path: path.stem)
def test_the_models_are_the_same(path: Path) -> None:
    first, second = read_model(path), read_model(fmi3_fmu(path))
    assert (first.fmi_version, second.fmi_version) == ("2.0", "3.0")
    own = first.variables.keys() ^ second.variables.keys()
    assert own <= {"der_q1", "der_q2"}  # other names of dq1 and dq2, which FMI 3.0 does not need
    for name in first.variables.keys() & second.variables.keys():
        assert first.variables[name] == second.variables[name]
    empty = {"variables": {}, "fmi_version": ""}
    assert replace(first, **empty) == replace(second, **empty)
    assert first.real_outputs == second.real_outputs


# ---- failures ------------------------------------------------------------------------------------


def test_fmu_with_another_token(fmu: Path, tmp_path: Path) -> None:
    def change(xml: str) -> str:
        return xml.replace('instantiationToken="', 'instantiationToken="x', 1)

    reason = r"token\.fmu: fmi3InstantiateCoSimulation failed: .*(?i:token)"
    with (
        Fmu(repacked(fmi3_fmu(fmu), tmp_path / "token.fmu", change)) as other,
        pytest.raises(UserError, match=reason),
    ):
        simulation.simulate(other, load(SHORT))


def test_the_folder_of_binaries_of_fmi_2_is_not_looked_at(fmu: Path, tmp_path: Path) -> None:
    """fmpy loads an FMU of FMI 3.0 from the folder of FMI 3.0 only."""
    with zipfile.ZipFile(fmi3_fmu(fmu)) as old, zipfile.ZipFile(tmp_path / "x.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name.replace("binaries/x86_64-linux", "binaries/linux64"), old.read(name))
    with pytest.raises(UserError, match=r"has no binary for .* \(has: linux64\)"):
        Fmu(tmp_path / "x.fmu")


def test_an_fmu_may_end_the_simulation(opened3: Fmu, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = load(SHORT)
    with opened3.instance("one") as instance:
        simulation.initialize(instance, loaded, 1e-8)
        do_step = instance.fmi.fmi3DoStep

        def end(*arguments: object) -> int:
            status = do_step(*arguments)
            arguments[5]._obj.value = True
            return status

        monkeypatch.setattr(instance.fmi, "fmi3DoStep", end)
        with pytest.raises(UserError, match=r"^one: the FMU ends the simulation at t = 0\.25 s$"):
            instance.do_step(loaded.start, 0.25)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), FMICallException("fmi3SetFloat64", 3)])
def test_what_is_raised_within_a_step_is_not_lost(opened3: Fmu, error: BaseException) -> None:
    """ctypes would print it and continue."""
    loaded = load(SHORT)
    times: list[float] = []

    def fail(time: float) -> list[float]:
        times.append(time - loaded.start)
        raise error

    with opened3.instance("one", ["tau1"]) as instance:
        simulation.initialize(instance, loaded, 1e-8)
        instance.input_functions(["tau1"], fail)
        with pytest.raises(type(error)):
            instance.do_step(loaded.start, 0.3)
        assert times == pytest.approx([0.0, 0.1, 0.2, 0.3])
        instance.input_functions(["tau1"], lambda _: [1.0])
        instance.do_step(loaded.start + 0.3, 0.3)  # nothing is left of it


def test_an_input_that_does_not_exist_within_steps_is_refused(opened3: Fmu) -> None:
    with (
        pytest.raises(UserError, match="fmi3InstantiateCoSimulation failed: "),
        opened3.instance("one", ["m2"]),
    ):
        pass


# ---- descriptions of other FMUs ------------------------------------------------------------------


def test_other_types_are_neither_read_nor_set(fmu: Path, tmp_path: Path) -> None:
    """Arrays and Float32 in the place of a parameter and an output."""

    def change(xml: str) -> str:
        array = r'<Float64\1start="1 2"\2><Dimension start="2"/></Float64>'
        xml, arrays = re.subn(r'<Float64( name="m1".*?)start=".*?"(.*?)/>', array, xml)
        short = r'<Float32 name="kinetic_energy"'
        xml, shorts = re.subn(r'<Float64 name="kinetic_energy"', short, xml)
        assert (arrays, shorts) == (1, 1)
        return xml

    other = read_model(repacked(fmi3_fmu(fmu), tmp_path / "types.fmu", change))
    m1: Variable = other.variables["m1"]
    assert (m1.type, m1.start) == ("array of Float64", None)
    assert (m1.least, m1.greatest) == (-math.inf, math.inf)
    with pytest.raises(WrongValueError, match="is of type array of Float64, which cannot be set"):
        m1.checked(1.0)
    missing = set(declared("rp_manipulator").real_outputs) - set(other.real_outputs)
    assert missing == {"kinetic_energy"}
