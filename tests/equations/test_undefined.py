"""Conditions that have no value end the run where they decide, and are named."""

import ctypes

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model

from rparm.fmi.fmu_file import Fmu
from tests.equations.examples import METHODS, initializing, made, simulated
from tests.support.instances import DISCARD, OK, status_of

COUNTER = """name = "Counter"
[discrete]
t = { type = "Integer", start = 1 }
got = { type = "Boolean" }
num = { type = "Integer" }
kept = { type = ["a", "b"] }
hits = { type = "Integer" }
"c[i]" = { for = "i = 1..3", type = "Boolean", start = [true, true, true] }
"n[i]" = { for = "i = 1..3", type = "Integer", start = [3, 3, 3] }
"k[i]" = { for = "i = 1..3", type = ["a", "b"], start = ["a", "a", "a"] }
"x[i]" = { for = "i = 1..3", start = [4, 4, 4] }
"d[i,j]" = { for = "i = 1..3, j = 1..2", type = "Boolean", start = true }
[where]
held = "c[t]"
[states]
"y[i]" = { for = "i = 1..3", start = 4, derivative = "1" }
[tables.T]
x = [0, 1, 3]
y = [1, 2, 3]
outside = "error"
[sampled.s]
every = "0.1"
@
"""
SET = 'set = { t = "t + 1" }\n'
FALLING = """name = "Falling"
[parameters]
v = { start = 1.0 }
[states]
x = { start = 1.05, derivative = "-v" }
[discrete]
hits = { type = "Integer" }
@
"""
VERSIONS = pytest.mark.parametrize("version", ["", "fmi3"])
TYPES = ["CoSimulation", "ModelExchange"]


def output(value: str) -> str:
    return f"[outputs]\no = {{ type = 'Boolean', value = '{value}' }}\n"


def event(when: str, during: str = "true") -> str:
    return f"[events.e]\nwhen = '{when}'\nwhile = '{during}'\nset = {{ hits = 'hits + 1' }}\n"


def run(text: str, version: str, fmi_type: str, method: int = 1, **start: float) -> np.ndarray:
    """Run an FMU for two seconds."""
    fmu = made(text)
    return simulated(
        fmu.parent / version / fmu.name, 2.0, 0.1, {"solver_method": method, **start},
        fmi_type=fmi_type, debug_logging=True, fmi_call_logger=None,
    )  # fmt: skip


@VERSIONS
@pytest.mark.parametrize(
    ("more", "said"),
    [
        (SET + output("c[t]"), "o: c[t] [index of c: 1..3] has no value at t = "),
        (SET + output("not c[t]"), "o: not c[t] [index of c: 1..3] has no value at t = "),
        (SET + output("x[t] > 3"), "o: x[t] > 3 [index of x: 1..3] has no value at t = "),
        (SET + output("y[t] > 3"), "o: y[t] > 3 [index of y: 1..3] has no value at t = "),
        (SET + output("n[t] == 3"), "o: n[t] == 3 [index of n: 1..3] has no value at t = "),
        (SET + output('k[t] == "a"'), "o: k[t] == 1 [index of k: 1..3] has no value at t = "),
        (SET + output("d[t,1]"), "o: d[t,1] [index of d: 1,1..3,1] has no value at t = "),
        (SET + output("T(t) > 0"), "o: T(t) > 0 [table T: 0..3] has no value at t = "),
        (SET + output("c[t] or t > 3"), "o: c[t] or t > 3 [index of c: 1..3] has no value at t"),
        (SET + output("not held"), "o: not held has no value at t = 0.2, since held = c[t]"),
        (SET + event("t > 2 and not c[t]"),
         "event e: when = t > 2 and not c[t] [index of c: 1..3] has no value"),
        (SET + event("t > 9", "x[t] > 3"), "event e: while = x[t] > 3 [index of x: 1..3] has no"),
        (SET + 'while = "c[t]"', "sampler s: while = c[t] [index of c: 1..3] has no value"),
        ('set = { t = "t + 1", got = "c[t]" }',
         "sampler s: got = c[t] [index of c: 1..3] has no value"),
        ('set = { t = "t + 1", num = "2 * n[t]" }',
         "sampler s: num = 2 * n[t] [index of n: 1..3] has no value"),
        ('set = { t = "t + 1", kept = "k[t]" }',
         "sampler s: kept = k[t] [index of k: 1..3] has no value"),
        ('where = { e = "c[t]" }\nset = { t = "t + 1", got = "e and t > 0" }',
         "sampler s: got = e and t > 0 [index of c: 1..3] has no value"),
    ],
)  # fmt: skip
def test_an_index_out_of_range_ends_the_run(
    more: str, said: str, version: str, capfd: pytest.CaptureFixture[str]
) -> None:
    for fmi_type in TYPES:
        with pytest.raises(FMICallException):
            run(COUNTER.replace("@", more), version, fmi_type)
        lines = [line for line in capfd.readouterr().out.splitlines() if said in line]
        assert len(lines) == 1 and lines[0].endswith(" with t = 4")


@VERSIONS
@pytest.mark.parametrize("fmi_type", TYPES)
@pytest.mark.parametrize(
    ("more", "last"),
    [
        (SET + output("t <= 3 and c[t]"), {"o": False}),
        (SET + output("t > 3 or not c[t]"), {"o": True}),
        (SET + output("c[t] if t <= 3 else false"), {"o": False}),
        (SET + output("not c[t] if t <= 3 else x[2] > 3"), {"o": True}),
        (SET + event("t > 3 or not c[t]"), {"hits": 1}),
        (SET + event("not c[t]", "t <= 3"), {"hits": 0}),
        ('set = { t = "t + 1", num = "n[t] if t <= 3 else 7", got = "t <= 3 and c[t]" }',
         {"num": 7, "got": False}),
        ('while = "c[t] if t <= 3 else t < 7"\nset = { t = "t + 1" }', {"t": 7}),
    ],
)  # fmt: skip
def test_what_does_not_decide_need_not_have_a_value(
    more: str, last: dict[str, float], version: str, fmi_type: str
) -> None:
    text = COUNTER.replace("@", more).replace('held = "c[t]"', 'held = "c[1]"')
    found = run(text, version, fmi_type)
    assert {name: found[name][-1] for name in last} == last
    assert found["t"][-1] == last.get("t", 22)


@VERSIONS
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize(
    ("more", "said"),
    [
        (output("sqrt(x) > -1"), "o: sqrt(x) > -1 has no value at t = 1.1 with x = -0.05"),
        (event("sqrt(x) < 0.1"),
         "at t = 1.1: event e: when = sqrt(x) < 0.1 has no value with x = -0.0"),
    ],
)  # fmt: skip
def test_a_state_leaves_what_a_condition_is_defined_for(
    more: str, said: str, method: int, version: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(FMICallException):
        run(FALLING.replace("@", more), version, "CoSimulation", method)
    assert said in capfd.readouterr().out.replace("-0.04999", "-0.05")


@VERSIONS
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("fmi_type", TYPES)
def test_trial_values_beyond_an_event_end_nothing(fmi_type: str, method: int, version: str) -> None:
    more = output("sqrt(x) > 0.5 if x > 0 else false")
    more += event("x > 0 and sqrt(x) < 0.1") + event("sqrt(x) < 0.2", "x > 0").replace(".e", ".f")
    found = run(FALLING.replace("@", more), version, fmi_type, method)
    t = found["time"]
    assert found["hits"][-1] == 2 and found["hits"][10] == 0
    assert found["x"][-1] == pytest.approx(-0.95, abs=1e-3)
    sure = np.abs(t - 0.8) > 0.01
    assert np.array_equal(found["o"][sure], t[sure] < 0.8)


def test_an_integrator_outside_that_passes_it_is_refused() -> None:
    """The state jumps there, so that no indicator says it before."""
    with initializing(made(FALLING.replace("@", event("sqrt(x) < 0.1"))), FMU2Model) as unit:
        unit.fmi.exitInitializationMode()
        unit.fmi.newDiscreteStates()
        unit.fmi.enterContinuousTimeMode()
        unit.fmi.setTime(1.1)
        x = (ctypes.c_double * 1)(0.5)
        unit.fmi.setContinuousStates(x, 1)
        unit.fmi.completedIntegratorStep()
        x[0] = -0.5
        unit.fmi.setContinuousStates(x, 1)
        with pytest.raises(FMICallException, match="discard"):
            unit.fmi.completedIntegratorStep()


@VERSIONS
def test_a_step_that_is_discarded_leaves_no_trace(version: str) -> None:
    """In FMI 3.0 a shorter one may follow."""
    fmu = made(FALLING.replace("@", event("sqrt(x) < 0.1", "v > 0.5")))
    with Fmu(fmu.parent / version / fmu.name) as opened, opened.instance("one") as one:
        one.set_up(0.0, None, 1e-9)
        one.enter_initialization()
        one.exit_initialization()
        assert status_of(one.fmi.doStep, 0.0, 1.1) == DISCARD
        assert "event e: when = sqrt(x) < 0.1 has no value" in one.messages[-1]
        if version:
            one.set("v", 0.1)
            assert status_of(one.fmi.doStep, 0.0, 1.1) == OK
