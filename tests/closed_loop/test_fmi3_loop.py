"""The closed loop of FMUs of FMI 3.0, under the master and in Ecos: as of those of FMI 2.0."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rparm.models.closed_loop.coupling import loop as closed_loop
from rparm.models.closed_loop.coupling.loop import METHODS, REFERENCE_AHEAD, ClosedLoop, Method

from rparm.errors import UserError
from rparm.systems import ssp
from tests.support.rparm_project import Console
from tests.support.ssp_files import SSP, edited, edited_fmu, replace

SSP3 = SSP.parent / "fmi3" / SSP.name
HELD = [method for method in (*METHODS, REFERENCE_AHEAD) if method.inputs == "held"]
SLOPED = [method for method in METHODS if method.inputs == "extrapolated"]


@pytest.fixture(scope="module")
def loops() -> Iterator[tuple[ClosedLoop, ClosedLoop]]:
    """The built systems, of FMI 2.0 and of FMI 3.0."""
    with closed_loop.opened(SSP) as first, closed_loop.opened(SSP3) as second:
        versions = [{f.model.fmi_version for f in x.fmus.values()} for x in (first, second)]
        assert versions == [{"2.0"}, {"3.0"}]
        yield first, second


# ---- the master ----------------------------------------------------------------------------------


@pytest.mark.parametrize("variant", ["nominal", "limited_effort"])
@pytest.mark.parametrize("method", HELD, ids=lambda method: method.name)
def test_held_inputs_give_the_same_bits(
    loops: tuple[ClosedLoop, ClosedLoop], method: Method, variant: str
) -> None:
    (first, calls), (second, others) = (loop.run(method, 2e-3, variant, 2.0) for loop in loops)
    assert calls == others
    assert list(first) == list(second)
    for name, values in first.items():
        assert values.tobytes() == second[name].tobytes(), name


@pytest.mark.parametrize("method", SLOPED, ids=lambda method: method.name)
def test_straight_lines_give_the_same_numbers(
    loops: tuple[ClosedLoop, ClosedLoop], method: Method
) -> None:
    """By intermediate update; the first step does not know the slopes of all outputs."""
    first, second = (loop.run(method, 2e-3, stop=2.0)[0] for loop in loops)
    held, _ = loops[1].run(HELD[0], 2e-3, stop=2.0)
    for name in closed_loop.STATES:
        largest = np.abs(first[name]).max()
        assert np.abs(second[name] - first[name]).max() <= 1e-11 * largest
        assert np.abs(held[name] - first[name]).max() > 1e-5 * largest


# ---- Ecos ----------------------------------------------------------------------------------------


def test_the_command_takes_the_fmus_of_fmi_3(tmp_path: Path, console: Console) -> None:
    code, out, err = console("system", "nominal", "--fmi", "3", "--report", tmp_path)
    assert (code, err) == (0, "") and "passed: 1 variant\n" in out
    assert "ClosedLoop (FMI 3.0)" in (tmp_path / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("source", [SSP, SSP3], ids=["2.0", "3.0"])
def test_what_ecos_would_not_set_is_refused(tmp_path: Path, console: Console, source: Path) -> None:
    """Enumerations of any version of FMI."""
    law = '<ssv:Parameter name="mode"><ssv:Integer value="1"/></ssv:Parameter>'
    added = replace("<ssv:Parameters>", f"<ssv:Parameters>{law}")
    path = edited(source, tmp_path / "law.ssp", {"resources/controller_nominal.ssv": added})
    error = console.failed("system", "nominal", "--ssp", path, "--report", tmp_path / "report")
    assert "component 'controller': 'mode' is an Enumeration, which Ecos does not set" in error


def test_another_version_of_fmi_is_refused(tmp_path: Path) -> None:
    change = edited_fmu({"modelDescription.xml": replace('fmiVersion="3.0"', 'fmiVersion="3.1"')})
    path = edited(SSP3, tmp_path / "later.ssp", {"resources/RPController.fmu": change})
    refused = r"component 'controller': .* an FMU of FMI 2\.0 or 3\.0 .*, found FMI 3\.1"
    with pytest.raises(UserError, match=refused), ssp.unpacked(path):
        pass
