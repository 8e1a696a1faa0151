"""Tolerances that a method of integration cannot reach are refused, wherever they are given."""

import math
import re
from pathlib import Path

import pytest

from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import METHOD, SMALLEST_TOLERANCES, TOLERANCE
from rparm.runs import scenario as scenarios
from rparm.runs.comparison import Runs
from rparm.runs.scenario import Scenario
from tests.support.rparm_project import FMUS, MISTAKES, SHORT, Console, declared, fmi3_fmu
from tests.support.ssp_files import SSP, edited, replace

SCENARIO = MISTAKES["tolerances"]["SCENARIO"]


def loaded(folder: Path, method: str, tolerance: float, parameter: float = 0.0) -> Scenario:
    text = SCENARIO.format(tolerance=tolerance, method=method, parameter=parameter)
    path = folder / "x.toml"
    path.write_text(text, encoding="utf-8")
    return scenarios.load(path, declared("rp_manipulator"))


def effective(fmu: Fmu, method: str, tolerance: float) -> float:
    """What the FMU integrates at."""
    with fmu.instance("x") as instance:
        instance.set_up(0.0, 1.0)
        instance.set(METHOD, fmu.model.variables[METHOD].items[method])
        instance.set(TOLERANCE, tolerance)
        instance.enter_initialization()
        instance.exit_initialization()
        value = instance.reals(["effective_relative_tolerance"])
        value.get()
        return float(value.view[0])


def test_the_smallest_tolerances_are_those_of_the_fmus() -> None:
    """Above it a tolerance makes a difference, below it none, in both versions of FMI."""
    for folder in FMUS:
        methods = declared(folder).variables.get(METHOD)
        assert methods is None or set(methods.items) == set(SMALLEST_TOLERANCES)
    for path in (FMUS["rp_manipulator"], fmi3_fmu(FMUS["rp_manipulator"])):
        with Fmu(path) as fmu:
            for method, smallest in SMALLEST_TOLERANCES.items():
                least = effective(fmu, method, smallest)
                assert effective(fmu, method, 2 * smallest) == pytest.approx(2 * least, rel=1e-9)
                for factor in (0.5, 1e-3, 1e-18):
                    assert effective(fmu, method, factor * smallest) == pytest.approx(
                        least, rel=1e-9
                    )


@pytest.mark.parametrize("method", SMALLEST_TOLERANCES)
def test_what_a_method_cannot_reach_is_refused(tmp_path: Path, method: str) -> None:
    smallest = SMALLEST_TOLERANCES[method]
    for good in (smallest, math.nextafter(smallest, 1), 1e-4):
        assert loaded(tmp_path, method, good).smallest_tolerance == smallest
        loaded(tmp_path, method, 1e-8, good)
    for bad in (math.nextafter(smallest, 0), smallest / 2, 1e-30, 5e-324):
        for arguments, key in (((bad,), "tolerance"), ((1e-8, bad), "[parameters] relative_")):
            with pytest.raises(UserError, match=re.escape(f"x.toml: {key}")) as caught:
                loaded(tmp_path, method, *arguments)
            assert f"the smallest of {method}, got {bad!r}" in str(caught.value)


def test_errors_are_estimated_down_to_the_smallest_tolerance(tmp_path: Path) -> None:
    """From a run that is another one."""
    with Fmu(FMUS["rp_manipulator"]) as fmu:
        runs = Runs({"rp_manipulator": fmu})
        for method, smallest in SMALLEST_TOLERANCES.items():
            scenario = loaded(tmp_path, method, smallest)
            assert 0 < runs.estimated(scenario, smallest).error < 1e-8


@pytest.mark.parametrize(
    ("tolerance", "code"), [("1e-30", 2), ("4.9999e-12", 2), ("5e-12", 0), ("1e-4", 0)]
)
def test_the_option_of_run(tmp_path: Path, console: Console, tolerance: str, code: int) -> None:
    arguments = ("run", SHORT, "--fmi", "2", "--tolerance", tolerance, "--report", tmp_path / "r")
    if code == 0:
        assert console(*arguments)[0] == 0
        return
    words = f"--tolerance: {SHORT}: expected at least 5e-12, the smallest of cvode_adams"
    assert words in console.refused(*arguments) and not (tmp_path / "r").exists()


def test_systems_and_campaigns(tmp_path: Path, console: Console) -> None:
    place = "resources/arm_nominal.ssv"
    fine = edited(SSP, tmp_path / "fine.ssp", {place: replace('"1e-11"', '"5e-12"')})
    assert console("system", "--list", "--ssp", fine)[0] == 0
    path = edited(SSP, tmp_path / "bad.ssp", {place: replace('"1e-11"', '"4.9e-12"')})
    error = console.refused("system", "--list", "--ssp", path)
    assert "component 'arm': 'relative_tolerance': expected at" in error


CAMPAIGN = MISTAKES["tolerances"]["CAMPAIGN"]


@pytest.mark.parametrize(("section", "expected"), MISTAKES["tolerances"]["rows"])
def test_of_campaigns(tmp_path: Path, section: str, expected: str) -> None:
    planning = pytest.importorskip("rparm.campaign.planning")
    from rparm.campaign import bases, campaign_file

    path = tmp_path / "test.toml"
    path.write_text(f"{CAMPAIGN}{section}\n", encoding="utf-8")
    given = campaign_file.read(path)
    with bases.opened(given, None, path) as base:
        if not expected:
            planning.plan(given, base, path)
            return
        with pytest.raises(UserError, match=re.escape(f"test.toml: {expected}")) as caught:
            planning.plan(given, base, path)
    assert "expected at least 5e-12, the smallest of cvode_adams, got 1e-1" in str(caught.value)
