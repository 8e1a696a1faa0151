"""Messages at run time name what the user's file names: events, expressions and their values."""

import re
from ctypes import c_double
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model

import rparm
from rparm.errors import UserError
from tests.equations.examples import METHODS, MISTAKES, MODELS, initializing, loaded, made
from tests.support.instances import OK, Instance

START, STEP = 10.0, 0.3  # s
NUMBER = r"(-?[0-9.]+(?:e-?[0-9]+)?)"
CASES = MISTAKES["messages"]["rows"]


@pytest.fixture(scope="module")
def fmu() -> Path:
    return made(MODELS["messages"]["FAILING"])


def refusal(fmu: Path, stop: float, **start: float) -> str:
    """The message of a run that fails, with the last one of the FMU."""
    with pytest.raises(UserError) as error:
        rparm.simulate(
            fmu, start_time=START, stop_time=stop, step=STEP, start_values=start, outputs=["v"]
        )
    return str(error.value)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("version", ["", "fmi3"])
@pytest.mark.parametrize(("given", "said", "numbers"), CASES)
def test_a_message_names_what_the_file_names(
    fmu: Path, version: str, method: str, given: dict, said: str, numbers: list[float]
) -> None:
    """It names the time of the simulation, which begins at 10 s."""
    expected = re.escape(said).replace("<number>", NUMBER)
    start = {"solver_method": method} | given
    message = refusal(fmu.parent / version / fmu.name, START + 10 * STEP, **start)
    found = re.search(expected, message)
    assert found, message
    # taylor ends in front of impacts that follow each other in no time
    assert [*map(float, found.groups())] == pytest.approx(numbers, abs=1e-5)
    assert "\n" not in message


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_what_is_not_finite_is_the_only_message(fmu: Path, method: int) -> None:
    """The integrator's own text would blame the number of its steps."""
    with Instance(loaded(fmu), logging_on=True) as unit:
        unit.fmi.setInteger([unit.loaded.references["solver_method"]], [method])
        unit.set(sway=2.0)
        unit.initialize(START, None, 1e-8)
        with pytest.raises(FMICallException):
            unit.step(START, STEP)
        (message,) = [m.text for m in unit.messages if m.status != OK]
        assert "derivative of m: sqrt(1 - sway) - 1 + 0 * m is not finite" in message


@pytest.mark.parametrize("method", METHODS)
def test_too_many_steps_of_a_stiff_problem_suggest_a_method(fmu: Path, method: str) -> None:
    """A fast motion is no stiff one, however many steps it takes."""
    hint = "the equations seem to be stiff, for which solver_method = cvode_bdf is made"
    limits = {"solver_method": method, "max_internal_steps": 20 if method == "cvode_bdf" else 200}
    stiff = {"stiffness": 1e9} if method == "cvode_bdf" else {"stiffness": 1e7}
    message = refusal(fmu, START + 10 * STEP, **limits, **stiff)
    assert "all internal steps allowed" in message
    assert (hint in message) == (method != "cvode_bdf")


def test_values_that_are_read_are_explained(fmu: Path) -> None:
    """Of variables, and of derivatives in Model Exchange."""
    with initializing(fmu, FMU2Model) as instance:
        instance.set(gain=0.0, divisor=0.0, p=2.0)
        instance.fmi.exitInitializationMode()
        since = (
            "is not finite at t = 0, since gap = (1 if x > 0 else log(x)) + half * p / divisor is "
            "not with x = 1, half = 0.5, p = 2, divisor = 0"
        )
        for name, text in (
            ("ratio", "ratio: u / gain is not finite at t = 0 with u = 2, gain = 0"),
            ("rate", f"rate: der(v) / divisor {since}"),
        ):
            with pytest.raises(FMICallException):
                instance.get(name)
            assert instance.messages[-1].text == text
        instance.fmi.enterContinuousTimeMode()
        with pytest.raises(FMICallException):
            instance.fmi.getDerivatives((c_double * 10)(), 10)
        assert instance.messages[-1].text == f"derivative of v: half + gap {since}"
