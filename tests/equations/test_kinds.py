"""Outputs and [where] that are no real numbers; random numbers, which whole numbers choose."""

import math
from collections.abc import Iterator

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

import rparm
from rparm import api
from rparm.errors import UserError
from tests.equations.compiled import declared, read
from tests.equations.examples import METHODS, MODELS, initializing, loaded, made, simulated
from tests.support.instances import Instance

TEXTS = MODELS["kinds"]
CALLS, DELAY, EITHER, GEAR, NOISE, TIMES = (
    TEXTS[name] for name in ("CALLS", "DELAY", "EITHER", "GEAR", "NOISE", "TIMES")
)
STATE = """name = "Checked"
[parameters]
p = { start = 1.0 }
n = { type = "Integer", start = 2 }
[states]
x = { derivative = "-x" }
"""


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("version", ["", "fmi3"])
@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
def test_they_follow_the_motion(version: str, method: int, fmi_type: str) -> None:
    fmu = made(GEAR)
    run = simulated(
        fmu.parent / version / fmu.name, 10.0, 0.01, {"solver_method": method, "large": 0.5},
        fmi_type=fmi_type, relative_tolerance=1e-10, also=["hot", "warm", "level"],
    )  # fmt: skip
    # by the exact motion, except within a tolerance of the switches
    w = np.sqrt(0.1)
    x, v = 1.5 / w * np.sin(w * run["time"]), 1.5 * np.cos(w * run["time"])
    sure = np.min(np.abs([x - 3, x - 3.25, x - 1.5, v]), axis=0) > 1e-5
    hot, warm = x > 3, (x > 1.5) & (x <= 3)
    level = np.where(hot, 3, np.where(warm, 2, 1))
    expected = {
        "hot": hot, "warm": warm, "is_warm": warm, "level": level, "state": np.minimum(level, 2),
        "gear": np.where(hot, np.where(v > 0, 1, -1), 2),
        "rising": np.where(v > 0, hot, ~warm), "near": hot & (x < 3.25),
    }  # fmt: skip
    assert np.sum(sure) > 900
    for name, values in expected.items():
        assert np.array_equal(run[name][sure], values[sure]), name
    assert {*run["count"]} == {5 * 10**8} and {*run["more"]} == {10**9}


def test_what_they_follow_from_is_declared() -> None:
    fmu = made(GEAR)
    variables = declared(read(fmu.with_suffix(".toml"))).variables
    kinds = {name: (v.type, v.causality) for name, v in variables.items()}
    assert kinds["gear"] == ("int32", "output") and kinds["hot"] == ("boolean", "local")
    assert kinds["level"] == ("enumeration", "local") and kinds["height"] == ("float64", "output")
    assert variables["gear"].dependencies == ("x", "v")
    assert variables["gear"].parameters == ("limit",)
    assert variables["more"].parameters == ("large",) and not variables["more"].dependencies
    assert [*variables["state"].items] == ["low", "high"]
    own = {v.name: v for v in fmpy.read_model_description(fmu).modelVariables}
    assert (own["gear"].min, own["gear"].max, own["gear"].variability) == ("-1", "2", "discrete")
    assert own["warm"].description == "Between half and all of the limit"


def test_a_whole_number_of_more_than_32_bits_is_named() -> None:
    with Instance(loaded(made(GEAR)), logging_on=True) as unit:
        unit.initialize()
        more = [unit.loaded.references["more"]]
        with pytest.raises(FMICallException, match="discard"):
            unit.fmi.getInteger(more)
        said = (
            "more: count + floor(1e9 * large) [floor: up to 2^30] is no number of 32 bits at t = 0"
        )
        assert unit.messages[-1].text == f"{said} with count = 1500000000, large = 1.5"
        unit.set(large=1.0)
        assert unit.fmi.getInteger(more) == [2 * 10**9]


def test_parameters_that_follow_may_be_no_real_numbers() -> None:
    """Each from parameters, in the expressions of others, of events, starts and checks."""
    text = """name = "Encoder"
[parameters]
lines = { type = "Integer", start = 5 }
m = { start = 4 }
Ts = { start = 0.1 }
edges = { type = "Integer", value = "4 * lines", max = 1000 }
half = { value = "edges / 2 if big else 0" }
big = { type = "Boolean", value = "m > 3" }
fast = { type = "Boolean", value = "Ts < 1" }
kind = { type = ["small", "large"], value = '"large" if big and edges > 10 else "small"' }
"part[i]" = { for = "i = 1..2", type = "Integer", value = "i * edges" }
[discrete]
count = { type = "Integer", start = "edges" }
[sampled.s]
every = "Ts"
while = 'fast and kind == "large"'
set = { count = "count + part[2]" }
[states]
x = { derivative = "half if big else -1" }
[check]
"{edges} edges" = "edges < 900"
"""
    fmu, names = made(text), ["edges", "half", "big", "fast", "kind", "part[2]", "count", "x"]
    expected = {(5, 4): [20, 10, 1, 1, 2, 40, 460, 10], (5, 1): [20, 0, 0, 1, 1, 40, 20, -1],
                (2, 4): [8, 4, 1, 1, 1, 16, 8, 4]}  # fmt: skip
    for version in ("", "fmi3"):
        own = fmu.parent / version / fmu.name
        found = {v.name: v for v in fmpy.read_model_description(own).modelVariables}
        for name in ("edges", "big", "fast", "kind", "part[1]"):
            kept = (found[name].causality, found[name].initial, found[name].variability)
            assert kept == ("calculatedParameter", "calculated",
                            "fixed" if name == "fast" else "tunable")  # fmt: skip
        for fmi_type in ("CoSimulation", "ModelExchange"):
            for (lines, m), last in expected.items():
                run = simulated(
                    own, 1.0, 0.1, {"lines": lines, "m": m}, fmi_type=fmi_type, also=names[:6]
                )[-1]  # fmt: skip
                assert [run[name] for name in names] == pytest.approx(last)
    variables = declared(read(fmu.with_suffix(".toml"))).variables
    assert variables["kind"].parameters == ("lines", "m") and variables["edges"].max == 1000
    with Instance(loaded(fmu), logging_on=True) as unit:
        unit.begin()
        unit.fmi.setInteger([unit.loaded.references["lines"]], [250])
        with pytest.raises(FMICallException, match="error"):
            unit.fmi.exitInitializationMode()
        assert unit.messages[-1].text == "1000 edges"


# ---- Random numbers ------------------------------------------------------------------------------


def words(seed: int, stream: int, times: int) -> Iterator[int]:
    """Words of 53 bits of SplitMix64, whose start is finalized so often."""

    def finalized(z: int) -> int:
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
        return z ^ (z >> 31)

    state = (seed % 2**32 << 32) + stream
    for _ in range(times):
        state = finalized(state)
    while True:
        state = (state + 0x9E3779B97F4A7C15) % 2**64
        yield finalized(state) >> 11


def normal(seed: int, stream: int, count: int) -> list[float]:
    found = words(seed, stream, 1)
    pairs = [((next(found) + 1) / 2**53, next(found) / 2**53) for _ in range(count)]
    return [math.sqrt(-2 * math.log(a)) * math.cos(2 * math.pi * b) for a, b in pairs]


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_random_numbers_follow_from_seed_and_number(method: int) -> None:
    """They push a state, piece by piece, and disturb its samples; names may be like functions."""
    run = simulated(made(NOISE), 4.0, 0.05, {"seed": -3, "solver_method": method}, also=["gust"])
    t, gusts = run["time"], np.array([2.0 * z for z in normal(-3, 2, 40)])
    x = np.concatenate([[0.0], np.cumsum(gusts) / 8])
    piece = np.minimum(np.floor(t * 8 + 1e-9), 31).astype(int)
    assert np.max(np.abs(run["x"] - x[piece] - gusts[piece] * (t - piece / 8))) < 1e-7
    tick = np.floor(t * 10 + 1e-6).astype(int)
    assert np.array_equal(run["k"], tick + 1)
    uniform = words(-3, 0, 2)
    assert np.array_equal(run["u"], np.array([next(uniform) / 2**53 for _ in range(50)])[tick])
    at_tick = np.abs(t * 10 - tick) < 1e-6
    added = 2.0 * np.array(normal(-3, 0, 50))[tick]
    assert np.sum(at_tick) > 40
    assert np.max(np.abs(run["y"] - run["x"] - added)[at_tick]) < 1e-12


def test_a_function_of_the_file_is_meant_instead() -> None:
    run = simulated(made(TEXTS["OWN_NOISE"]), 1.0, 0.5, {}, relative_tolerance=1e-10)
    assert run["x"][-1] == pytest.approx(math.exp(2.0), rel=1e-8)


def test_a_parameter_is_fixed_if_the_file_says_so() -> None:
    variables = declared(read(made(NOISE).with_suffix(".toml"))).variables
    fixed = {n for n, v in variables.items() if v.variability == "fixed" and v.owner == "model"}
    assert fixed == {"seed", "sigma", "noise", "tau"}  # the last two by the sampler


# ---- A law that is continuous or sampled ---------------------------------------------------------


@pytest.mark.parametrize("Ts", [0.0, 0.1])
@pytest.mark.parametrize("version", ["", "fmi3"])
@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
def test_a_sampler_of_period_0_never_ticks(fmi_type: str, version: str, Ts: float) -> None:
    fmu = made(EITHER)
    run = simulated(
        fmu.parent / version / fmu.name, 2.0, 0.05, {"Ts": Ts}, fmi_type=fmi_type,
        relative_tolerance=1e-10,
    )  # fmt: skip
    t, tick = run["time"], np.floor(run["time"] * 10 + 0.5 + 1e-9)
    is_clear = np.abs(t * 10 + 0.5 - np.round(t * 10 + 0.5)) > 1e-6  # importers see both sides
    assert np.array_equal(run["ticks"][is_clear], (tick if Ts else 0 * t)[is_clear])
    at_tick = np.append(1.0, 0.6 ** np.arange(21.0))  # before the first one, x rests at 1
    sampled = at_tick[tick.astype(int)] - 0.4 * (tick > 0) * at_tick[tick.astype(int)] * (
        t * 10 + 0.5 - tick
    )
    assert np.max(np.abs(run["x"] - (sampled if Ts else np.exp(-4.0 * t)))) < 1e-8


def test_a_linear_model_has_only_samplers_that_tick() -> None:
    fmu = made(EITHER)
    continuous, sampled = (api.linearize(fmu, at={"Ts": Ts}) for Ts in (0.0, 0.1))
    assert continuous.states == ("x",) and sampled.states == ("x", "held")


# ---- Arrays --------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0, 3, 4])
def test_an_index_may_follow_from_variables(delay: int) -> None:
    """A register that starts with an input's value, and the element that a parameter names."""
    with initializing(made(DELAY)) as unit:
        integers = [unit.loaded.references[name] for name in ("delay", "at")]
        unit.fmi.setInteger(integers[:1], [delay])
        unit.set(u=1.5)
        assert unit.get("late", "twice") == [3.0, 6.0]
        unit.fmi.exitInitializationMode()
        is_open = [unit.loaded.references["is_open"]]
        given = [1.5 - k for k in range(12)]
        x = 0.0
        for k, u in enumerate(given):
            unit.set(u=u)
            t, late = k * 0.1, unit.get("late")[0]
            unit.step(t, 0.1)
            shown = given[k - delay] if k >= delay else 3.0
            place = (k + 1) % 3
            assert unit.get("late", "twice") == [shown, 2 * shown]
            assert unit.fmi.getInteger(integers[1:]) == [place + 1]
            assert unit.fmi.getBoolean(is_open) == [place != 1]
            assert unit.get("column") == [[0.0, 21.0, 22.0][place]]
            x -= 0.5 * (late + shown)
            assert unit.get("x")[0] == pytest.approx(x, abs=1e-8)


def test_an_index_out_of_range_is_named() -> None:
    with Instance(loaded(made(DELAY)), logging_on=True) as unit:
        unit.fmi.setInteger([unit.loaded.references["delay"]], [5])
        unit.initialize()
        with pytest.raises(FMICallException, match="discard"):
            unit.get("late")
        said = "late: d[delay] [index of d: 0..4] is not finite at t = 0 with delay = 5"
        assert unit.messages[-1].text == said


@pytest.mark.parametrize("version", ["", "fmi3"])
@pytest.mark.parametrize(
    ("derivative", "new", "value", "said"),
    [
        ("0", "0", "call[target]", "y: call[target] [index of call: 1..3]"),
        ("0", "0", "x[4 - target]", "y: x[4 - target] [index of x: 1..3]"),
        ("0", "0", "m[2, target]", "y: m[2,target] [index of m: 2,1..2,3]"),
        ("call[target]", "0", "0", "derivative of x[1]: call[target] [index of call: 1..3]"),
        ("0", "call[target]", "0", "sampler s: held = call[target] [index of call: 1..3]"),
    ],
)  # fmt: skip
def test_a_target_out_of_range_is_named(
    derivative: str, new: str, value: str, said: str, version: str
) -> None:
    """With its value when it is read, although the sampler sets it."""
    text = CALLS.replace("DERIVATIVE", derivative).replace("NEW", new).replace("VALUE", value)
    fmu = made(text)
    with pytest.raises(UserError) as error:
        rparm.simulate(fmu.parent / version / fmu.name, stop_time=1.0, step=0.05, outputs=["y"])
    message = str(error.value)
    assert f"{said} is not finite" in message and message.endswith("with target = 4")
    assert "\n" not in message


def test_what_is_not_shown_is_no_variable() -> None:
    fmu = made(DELAY)
    variables = {v.name: v for v in fmpy.read_model_description(fmu).modelVariables}
    assert not [name for name in variables if name.startswith(("d[", "hidden", "sampled_"))]
    kinds = {name: variables[name].variability for name in ("late", "twice", "e[1,2]")}
    assert kinds == {"late": "discrete", "twice": "continuous", "e[1,2]": "discrete"}


def test_a_check_shows_values() -> None:
    text = STATE + '[check]\n"100 % of {p} and {n}, not {q}" = "p < n"\n'
    with Instance(loaded(made(text)), logging_on=True) as unit:
        unit.begin(p=2.5)
        with pytest.raises(FMICallException, match="error"):
            unit.fmi.exitInitializationMode()
        # to loggers a message is a format
        assert unit.messages[-1].text == "100 %% of 2.5 and 2, not {q}"


# ---- Without states ------------------------------------------------------------------------------


@pytest.mark.parametrize("version", ["", "fmi3"])
def test_a_condition_on_the_time_has_time_events(version: str) -> None:
    """In Model Exchange importers see both sides of them; other outputs have none."""
    fmu = made(TIMES)
    path = fmu.parent / version / fmu.name
    run = simulated(path, 2.0, 0.1, {}, fmi_type="ModelExchange")
    held = run["held"].astype(int).tolist()
    assert {*run["most"]} == {2**16 - 1}
    assert [run["time"][i] for i in range(1, len(held)) if held[i] != held[i - 1]] == [0.25, 1.0]
    assert run["phase"] == pytest.approx(np.maximum(run["time"] - 0.25, 0.0), abs=1e-15)
    kind = declared(read(fmu.with_suffix(".toml"))).variables["kind"]
    assert [*kind.items.values()] == ["A short one", "A long one"]


def test_a_check_reads_what_follows_from_parameters() -> None:
    with Instance(loaded(made(TIMES)), logging_on=True) as unit:
        unit.begin(release=0.125)
        with pytest.raises(FMICallException, match="error"):
            unit.fmi.exitInitializationMode()
        assert unit.messages[-1].text == "a span of -0.125 s"
