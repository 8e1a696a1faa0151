"""Events of files with equations: the ball, relations that switch, samplers and their ticks.

SAMPLERS in the environment: how many random models with samplers.
"""

import ctypes
import os
import random
from fractions import Fraction
from itertools import product
from math import ceil, floor
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave

from tests.equations.compiled import Model
from tests.equations.examples import (
    METHODS,
    MODELS,
    axis,
    example,
    initializing,
    loaded,
    made,
    simulated,
)
from tests.support.instances import OK, Instance

TEXTS = MODELS["events"]
EACH_METHOD = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
G, E, V_MIN = 9.81, 0.7, 0.1


def flights(height: float) -> list[tuple[float, float, float]]:
    """Time, height and speed at which each flight begins; then those at rest."""
    found, t, h, v = [], 0.0, height, 0.0
    while h > 0 or v > V_MIN:
        found.append((t, h, v))
        speed = np.sqrt(v * v + 2 * G * h)
        t, h, v = t + (v + speed) / G, 0.0, E * speed
    return [*found, (t, 0.0, 0.0)]


def ball(times: np.ndarray) -> np.ndarray:
    """Height of the ball (times,)."""
    parts = flights(1.0)
    last = parts[-1][0]
    begun = [next(part for part in reversed(parts) if part[0] <= t) for t in times]
    return np.array(
        [
            0.0 if t >= last else h + v * (t - begin) - G * (t - begin) ** 2 / 2
            for t, (begin, h, v) in zip(times, begun, strict=True)
        ]
    )


@EACH_METHOD
def test_the_ball_bounces_eleven_times_and_rests(method: int) -> None:
    run = simulated(
        example("bouncing_ball"), 3.0, 0.013, {"solver_method": method},
        relative_tolerance=1e-10, also=["resting", "event_count", "last_event_time"],
    )  # fmt: skip
    assert run["event_count"][-1] == 11 == len(flights(1.0)) - 1
    assert run["resting"][-1] and not run["resting"][0] and run["v"][-1] == 0.0
    bound = 1e-14 if method in (METHODS["erk"], METHODS["taylor"]) else 1e-11
    assert np.max(np.abs(run["h"] - ball(run["time"]))) <= bound
    assert run["last_event_time"][-1] == pytest.approx(flights(1.0)[-1][0], abs=1e-11)


def named(text: str) -> Path:
    """The FMU of a text without a name."""
    return made('name = "Made"\n' + text)


@pytest.mark.parametrize("pump", [0.0, 0.05])
@EACH_METHOD
def test_tanks_run_empty(method: int, pump: float) -> None:
    """By Torricelli's law, whose root ends where the guard does; s is the root of the height."""
    run = simulated(
        named(TEXTS["TANKS"]), 24.0, 0.7, {"solver_method": method, "pump": pump},
        relative_tolerance=1e-9, also=["event_count", "last_event_time"],
    )  # fmt: skip
    s = np.linspace(1, 0, 100001)
    times = 20 * (1 - s)
    if pump:
        times -= 200 * pump * np.log((0.1 + pump) / (0.1 * s + pump))
    height = np.interp(run["time"], times, s) ** 2
    for tank in "abc":
        assert np.max(np.abs(run[tank] - height)) < 1e-8  # with no pump it only touches 0
    np.testing.assert_allclose(run["speed"], np.sqrt(height), rtol=0, atol=1e-4)
    if pump:
        assert run["last_event_time"][-1] == pytest.approx(times[-1], abs=1e-7)


@pytest.mark.parametrize(
    ("x", "defined"),
    [(1.5, {"guarded": 2, "either": 1}), (2.5, {"large": 3, "both": 1, "guarded": 1, "either": 2})],
)
def test_what_follows_from_an_undefined_relation_is_not_finite(
    x: float, defined: dict[str, float]
) -> None:
    """A relation that is not looked at need not be defined."""
    with initializing(named(TEXTS["UNDEFINED"])) as unit:
        unit.set(x=x)
        unit.fmi.exitInitializationMode()
        for name in ("small", "sign", "large", "both", "guarded", "either"):
            if name in defined:
                assert unit.get(name) == [defined[name]]
            else:
                with pytest.raises(fmpy.fmi1.FMICallException, match="discard"):
                    unit.get(name)


def test_a_check_that_is_not_defined_is_broken() -> None:
    with initializing(named(TEXTS["UNDEFINED"])) as unit:
        unit.set(p=-1.0)
        with pytest.raises(fmpy.fmi1.FMICallException, match="error"):
            unit.fmi.exitInitializationMode()


@EACH_METHOD
def test_relations_in_branches_that_are_not_taken_make_no_events(method: int) -> None:
    fmu = named(TEXTS["BRANCHES"])
    run = simulated(
        fmu, 12.0, 0.5, {"solver_method": method}, relative_tolerance=1e-10, also=["event_count"]
    )
    assert run["event_count"][-1] == 0
    np.testing.assert_allclose(run["x"], np.cos(run["time"]), rtol=0, atol=1e-8)
    np.testing.assert_allclose(run["y"], run["time"], rtol=0, atol=1e-12)


@EACH_METHOD
def test_a_relation_of_time_switches_at_its_time(method: int) -> None:
    fmu = named(TEXTS["PULSE"])
    run = simulated(fmu, 2.0, 0.2, {"solver_method": method}, relative_tolerance=1e-8)
    expected = np.clip(run["time"] - 0.73, 0.0, 0.73)
    np.testing.assert_allclose(run["x"], expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(run["y"], 1.0 - np.cos(run["time"]), rtol=0, atol=1e-7)


def test_a_relation_of_inputs_switches_where_they_are_set() -> None:
    with initializing(named(TEXTS["PULSE"])) as unit:
        unit.fmi.exitInitializationMode()
        for value, expected in ((0.5, 0.0), (0.5 + 1e-15, 1.0), (0.5, 0.0), (3.0, 1.0)):
            unit.set(u=value)
            assert unit.get("above") == [expected]
        unit.step(0.0, 0.25)
        assert unit.get("y") == pytest.approx([0.5], abs=1e-14)


def test_relations_that_decide_each_other_switch_in_one_event() -> None:
    """An input decides the first one, each the next."""
    text = '[inputs]\nu = {}\n[where]\na0 = "u"\n'
    text += "".join(f'a{i} = "u if a{i - 1} > 0 else -1"\n' for i in range(1, 9))
    text += '[states]\nx = { derivative = "a8" }\n[outputs]\ny = { value = "a8" }\n'
    with initializing(named(text), FMU2Model) as unit:
        unit.fmi.exitInitializationMode()
        for value in (-1.0, 1.0):
            unit.fmi.enterEventMode()
            unit.set(u=value)
            unit.fmi.newDiscreteStates()
            assert unit.get("y") == [value]


@EACH_METHOD
def test_events_at_one_instant_run_in_order_and_see_what_the_others_left(method: int) -> None:
    fmu = named(TEXTS["CHAIN"])
    run = simulated(fmu, 2.4, 0.3, {"solver_method": method}, also=["a", "b"])
    # at 1 both; at 2 the first clears a, so that the second does not run
    np.testing.assert_array_equal(run["n"], [0, 0, 0, 0, 12, 12, 12, 121, 121])
    np.testing.assert_array_equal(run["a"], [0, 0, 0, 0, 1, 1, 1, 0, 0])
    expected = [1, 0.7, 0.4, 0.1, 0.8, 0.5, 0.2, -0.1, -0.4]
    np.testing.assert_allclose(run["x"], expected, rtol=0, atol=1e-12)
    at_once = simulated(fmu, 0.5, 0.5, {"limit": 1.0, "solver_method": method})
    assert at_once["n"][0] == 12


def test_right_sides_of_an_event_see_the_values_before_it() -> None:
    run = simulated(named(TEXTS["SWAP"]), 0.5, 0.5, {}, also=["a", "b"])
    assert [run[name][-1] for name in ("x", "y", "a", "b")] == [2.0, 1.0, True, False]


@pytest.mark.parametrize("most", [3, 4])
def test_events_follow_each_other_max_events_times(most: int) -> None:
    """Four of them do, each because of the one before."""
    text = '[states]\nx = { start = 0, derivative = "0" }\n'
    for i in range(4, 0, -1):
        text += f'[events.e{i}]\nwhen = "x > {i}.5"\nreinit = {{ x = "{i + 1}.75" }}\n'
    fmu = named(text)
    if most < 4:
        with pytest.raises(fmpy.fmi1.FMICallException):
            simulated(fmu, 1.0, 0.5, {"x": 1.75, "max_events": most})
    else:
        assert simulated(fmu, 1.0, 0.5, {"x": 1.75, "max_events": most})["x"][-1] == 5.75


def test_a_model_without_states_has_modes() -> None:
    found = []
    with initializing(named(TEXTS["LATCH"])) as unit:
        unit.fmi.exitInitializationMode()
        for step, value in enumerate((0.0, 2.0, 3.0, 1.0, 2.0, 0.5)):
            unit.set(u=value)
            unit.step(step * 0.1, 0.1)
            found += unit.get("y")
    assert found == [0.0, 4.0, 6.0, 2.0, 0.0, 0.0]


@pytest.mark.parametrize("version", ["", "fmi3"])
@pytest.mark.parametrize("steps", [1, 18, 40])
def test_events_of_a_model_without_states_are_located(version: str, steps: int) -> None:
    fmu = named(TEXTS["SAW"])
    run = simulated(fmu.parent / version / fmu.name, 1.26, 1.26 / steps, {})
    t = run["time"][1:]
    np.testing.assert_array_equal(run["n"][1:], np.floor(10 * t) + 1)
    np.testing.assert_allclose(run["saw"], np.mod(run["time"], 0.5), rtol=0, atol=1e-14)


def test_an_input_that_moves_is_located_without_states() -> None:
    with initializing(named(TEXTS["SAW"])) as unit:
        unit.fmi.exitInitializationMode()
        reference = [unit.loaded.references["u"]]
        unit.fmi.setRealInputDerivatives(reference, [1], [3.0])
        unit.step(0.0, 1.0)
        assert unit.get("stamp") == pytest.approx([1 / 3], abs=1e-12)


def test_events_that_contradict_each_other_are_named() -> None:
    fmu = named(TEXTS["CONTRADICTION"])
    with Instance(loaded(fmu), logging_on=True) as unit:
        unit.initialize(0.0, None, 1e-9).step(0.0, 0.9)
        with pytest.raises(fmpy.fmi1.FMICallException):
            unit.step(0.9, 0.2)
        last = unit.messages[-1].text
        assert "the step ended at t = 1.0" in last and "event up (b > 0), the same" in last


def test_a_step_that_is_tried_again_and_succeeds_sends_no_message() -> None:
    """Long steps of `erk` go where the tank is emptier than empty."""
    with Instance(loaded(named(TEXTS["SIPHON"])), logging_on=True) as unit:
        unit.fmi.setInteger([unit.loaded.references["solver_method"]], [METHODS["erk"]])
        unit.initialize(0.0, None, 1e-9).step(0.0, 200.0)
        assert unit.count("event_count") == 3
        assert [m.text for m in unit.messages if m.status != OK] == []


# ---- Samplers ------------------------------------------------------------------------------------


OF_SAMPLERS = MODELS["sampled"]
SEEDS = range(int(os.environ.get("SAMPLERS", "2")))


@pytest.mark.parametrize("begin", [0.0, -0.3, -0.6, 1e6])
def test_samplers_of_one_instant_run_in_the_order_of_the_file(begin: float) -> None:
    """3 * 0.1 and 1 * 0.3 are two doubles and one instant, at 0 too; the first is at the start."""
    run = simulated(made(OF_SAMPLERS["COUNTERS"]), begin + 30.0, 0.1, {}, start_time=begin)
    k = np.arange(len(run))
    assert np.array_equal(run["a"], k + 1)
    assert np.array_equal(run["b"], k // 3 * 3 + 1)
    assert np.array_equal(run["c"], 5 + np.maximum(0, k - 2))


def test_ticks_do_not_drift_in_a_thousand_million(tmp_path: Path) -> None:
    """Time of the next tick: start + (offset + k every), rounded three times."""
    model = Model(tmp_path, OF_SAMPLERS["COUNTERS"])
    for start, every, k in ((0.0, 0.1, 10**9), (3.7, 1 / 3, 123456789), (1.7e9, 0.01, 10**6)):
        given = {"T": every, "start": start, "ticks_fast": k, "ticks_slow": 1e12}
        values = model.values(**given, ticks_late=1e12)
        values.view(np.int32)[2 * len(model.names)] = 1  # is_begun
        assert model.next_time(values) == start + (0.0 + k * every)


def on_axis(stop: float) -> np.ndarray:
    """x, v, y, w, u at the ticks until a time, just after each."""
    tick, motion = axis(0.002, 1.3, 2.5, 9e3, 25.0, 900.0, 60.0, 3000.0)
    rows = [tick @ [0, 0, 0, 0, 0, 0, 0, 0.1, 0]]
    for _ in range(round(stop / 0.002)):
        rows.append(tick @ motion @ rows[-1])
    return np.array(rows)[:, :5]


@EACH_METHOD
@pytest.mark.parametrize("step", [0.002, 0.02, 0.005])
def test_a_sampled_pid_controller_moves_an_axis(method: int, step: float) -> None:
    options = {"solver_method": method}
    run = simulated(example("axis"), 1.0, step, options, relative_tolerance=1e-11)
    rows = np.round(run["time"] / 0.002, 6)
    at_ticks = rows == np.round(rows)
    found = np.stack([run[name] for name in "xvywu"], axis=1)[at_ticks]
    differences = np.abs(found - on_axis(1.0)[rows[at_ticks].astype(int)]).max(axis=0)
    assert np.all(differences < [1e-9, 1e-9, 1e-9, 1e-9, 1e-6])


PERIODS = (  # s; doubles have the first ones exactly
    [Fraction(n, 16) for n in (1, 4, 5, 6, 12)],
    [Fraction(*ratio) for ratio in ((1, 10), (3, 10), (7, 10), (1, 3), (11, 100))],
)
# what jumps by the time, and its value at s = {t} / {T}
JUMPS = {
    "floor({t} / {T})": floor,
    "floor(-{t} / {T})": lambda s: floor(-s),
    "ceil({t} / {T})": ceil,
    "round({t} / {T})": lambda s: floor(s + Fraction(1, 2)),
    "(1 if mod({t}, {T}) > 0.9 * {T} else 0)": lambda s: s % 1 > Fraction(9, 10),
    "(1 if mod({t}, {T}) >= {T} / 2 else 0)": lambda s: s % 1 >= Fraction(1, 2),
    "(1 if {t} > 4 * {T} else 0)": lambda s: s > 4,
    "(1 if sin(2 * pi * {t} / {T}) > 0 else 0)": lambda s: s % 1 < Fraction(1, 2),
    "(floor({t} / {T}) if mod({t}, 2 * {T}) < {T} else 0)": lambda s: floor(s) * (s % 2 < 1),
    "quarters(mod({t}, {T}) / {T})": lambda s: floor(4 * (s % 1)),
}
QUARTERS = """[tables.quarters]
x = [-0.25, 0, 0.25, 0.5, 0.75, 1]
y = [-1, 0, 1, 2, 3, 4]
interpolation = "previous"
"""


def written(number: Fraction) -> str:
    """As files have it, with as many digits as a double."""
    is_short = Fraction(repr(float(number))) == number
    return repr(float(number)) if is_short else f"({number.numerator} / {number.denominator})"


@pytest.mark.parametrize("has_state", [True, False])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_tick_sees_what_switches_at_its_time_switched(seed: int, has_state: bool) -> None:
    """Directly and through [where], with each method, in one step or many."""
    chance, periods = random.Random(seed), PERIODS[seed % 2]
    every = chance.choice(periods) / chance.choice([1, 2])
    offset, start = chance.choice([0, every / 2, every]), chance.choice([0, 0, -3 * every, 10])
    multiples = [every * n for n in (1, 2, 3, 4, 5, Fraction(1, 2), Fraction(3, 2))]
    expressions = []
    for text, value in JUMPS.items():
        T, since = chance.choice([*periods, *multiples]), chance.choice([0, offset, every, 10])
        t = f"(time - {written(since)})" if since else "time"
        expressions.append((text.format(t=t, T=written(T)), value, T, since))
    numbers = range(len(expressions))
    where = "".join(f'w{i} = "{expressions[i][0]}"\n' for i in numbers)
    new = [f'd{i} = "d{i} + (n + 1) * {expressions[i][0]}"' for i in numbers]
    new += [f'v{i} = "v{i} + (n + 1) * w{i}"' for i in numbers]
    held = "".join(f"{kind}{i} = {{}}\n" for kind in "dv" for i in numbers)
    state = '[states]\ny = { derivative = "w4 - y" }\n' if has_state else ""
    fmu = made(
        f'name = "Jumps"\n{state}{QUARTERS}[where]\n{where}[discrete]\nn = {{}}\n{held}'
        f'[sampled.s]\nevery = "{written(every)}"\noffset = "{written(Fraction(offset))}"\n'
        f'set = {{ n = "n + 1", {", ".join(new)} }}\n',
    )
    later = Fraction(1, 10**9)
    ticks = [start + offset + k * every for k in range(25)]
    stops = (ticks[-1], 24), (ticks[-1] + every * Fraction(3, 10), 1), (ticks[-1] + every / 3, 61)
    for (stop, steps), method in product(stops, METHODS.values() if has_state else [None]):
        options = {"solver_method": method} if method else {}
        last = simulated(
            fmu, float(stop), float((stop - start) / steps), options, start_time=float(start)
        )[-1]
        assert last["n"] == len(ticks)
        for i, (text, value, T, since) in enumerate(expressions):
            expected = sum((k + 1) * value((t + later - since) / T) for k, t in enumerate(ticks))
            assert (last[f"d{i}"], last[f"v{i}"]) == (expected, expected), (text, every, method)


@EACH_METHOD
def test_events_set_discrete_variables_and_their_own_next_time(method: int) -> None:
    run = simulated(made(OF_SAMPLERS["TIMER"]), 2.0, 0.01, {"solver_method": method})
    t = run["time"]
    times = 0.25 * np.cumsum([1, 1, 2, 3, 4, 5, 6])  # the alarm sets the time of the next one
    assert np.array_equal(run["alarms"], np.sum(t[:, None] >= times, axis=1))
    speed, falls = np.sqrt(20.0), [np.sqrt(0.2)]
    while falls[-1] < 2.0:
        speed *= 0.8
        falls.append(falls[-1] + speed / 5)
    assert np.array_equal(run["bounces"], np.sum(t[:, None] >= np.array(falls), axis=1))
    assert run["fastest"][-1] == pytest.approx(np.sqrt(20.0), abs=1e-9)


def test_a_digital_filter_has_no_states() -> None:
    """A tick at the end of a step sees the input of the step."""
    fmu = made(OF_SAMPLERS["FILTER"])
    signal = np.array(
        [(0.0, 1.0), (0.45, 1.0), (0.45, 3.0), (2.0, 3.0)], [("time", "f8"), ("u", "f8")]
    )
    run = simulated(fmu, 2.0, 0.1, {}, input=signal, also=["event_count"])
    assert run["event_count"][-1] == 20  # ticks after the one at the start
    y, before = 1.0, 0.0
    for k, row in enumerate(run):
        y, before = y + 0.2 * ((1.0 if k <= 5 else 3.0) - y), y
        assert (row["y"], row["z"]) == (
            pytest.approx(y, abs=1e-15),
            pytest.approx(before, abs=1e-15),
        )


def test_an_importer_that_moves_the_axis_itself_gets_all_ticks() -> None:
    """Model Exchange: tick k is due at k Ts, and the force, a sum of terms of 3 kN, follows."""
    begun, rows = initializing(example("axis"), FMU2Model), on_axis(0.2)
    instance, reference = begun.fmi, begun.loaded.references["u"]
    instance.exitInitializationMode()
    for k, (*_, force) in enumerate(rows[:-1]):
        needed, terminates, _, changed, is_defined, time = instance.newDiscreteStates()
        assert (needed, terminates, changed, is_defined) == (False, False, False, True)
        assert time == 0.002 * (k + 1)
        assert instance.getReal([reference])[0] == pytest.approx(force, abs=1e-11)
        instance.enterContinuousTimeMode()
        instance.setTime(time)
        instance.setContinuousStates((ctypes.c_double * 4)(*rows[k + 1, :4]), 4)
        assert instance.getReal([reference])[0] == pytest.approx(force, abs=1e-11)
        instance.enterEventMode()
    instance.terminate()
    instance.freeInstance()


def test_ticks_survive_a_rollback_and_a_move_to_another_instance() -> None:
    fmu = example("axis")
    begun = initializing(fmu), initializing(fmu)
    first, second = (instance.fmi for instance in begun)
    names = begun[0].loaded.references
    references = [names[name] for name in ("x", "v", "y", "w", "u", "sum", "last")]
    for instance in (first, second):
        instance.exitInitializationMode()
    at = [0.0]

    def advance(instance: FMU2Slave, steps: int) -> list[float]:
        for _ in range(steps):
            instance.doStep(at[0], 0.0037)
            at[0] += 0.0037
        return instance.getReal(references)

    advance(first, 31)
    then, saved = at[0], first.getFMUstate()
    ahead = advance(first, 23)
    content = first.serializeFMUstate(saved)
    second.setFMUstate(second.deSerializeFMUstate(content))
    first.setFMUstate(saved)
    for instance in (first, second):
        at[0] = then
        assert advance(instance, 23) == ahead


def test_start_values_of_discrete_variables_and_periods_can_be_set() -> None:
    run = simulated(made(OF_SAMPLERS["COUNTERS"]), 1.0, 0.1, {"a": 10.0, "T": 0.2})
    assert run["a"][-1] == 16.0 and run["c"][0] == 5.0 and run["c"][-1] == 10.0


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"Ts": 1e-6, "time": 1e9}, "sampler control: every = Ts = 1e-06 s is refused"),
        ({"Kp": 1e308, "target": 1e308}, "sampler control: u = Kp * (target - x) + sum - Kd"),
    ],
)
def test_a_sampler_that_fails_is_named(
    start: dict[str, float], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    fmu = example("axis")
    options = {"start_time": start.pop("time", 0.0)}
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(
            str(fmu), start_values=start, stop_time=options["start_time"] + 1, **options
        )
    assert message in capsys.readouterr().out
