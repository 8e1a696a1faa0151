"""Events of files with equations: the ball, the thermostat, relations that switch."""

from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model

from tests.equations.examples import METHODS, MODELS, example, initializing, loaded, made, simulated
from tests.support.instances import OK, Instance

TEXTS = MODELS["events"]
EACH_METHOD = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
G, E, V_MIN = 9.81, 0.7, 0.1


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("events")


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
def test_the_ball_bounces_eleven_times_and_rests(folder: Path, method: int) -> None:
    run = simulated(
        example("bouncing_ball", folder), 3.0, 0.013, {"solver_method": method},
        relative_tolerance=1e-10, also=["resting", "event_count", "last_event_time"],
    )  # fmt: skip
    assert run["event_count"][-1] == 11 == len(flights(1.0)) - 1
    assert run["resting"][-1] and not run["resting"][0] and run["v"][-1] == 0.0
    bound = 1e-14 if method in (METHODS["erk"], METHODS["taylor"]) else 1e-11
    assert np.max(np.abs(run["h"] - ball(run["time"]))) <= bound
    assert run["last_event_time"][-1] == pytest.approx(flights(1.0)[-1][0], abs=1e-11)


def named(folder: Path, text: str) -> Path:
    """The FMU of a text without a name."""
    return made(folder, 'name = "Made"\n' + text)


@pytest.mark.parametrize("pump", [0.0, 0.05])
@EACH_METHOD
def test_tanks_run_empty(folder: Path, method: int, pump: float) -> None:
    """By Torricelli's law, whose root ends where the guard does; s is the root of the height."""
    run = simulated(
        named(folder, TEXTS["TANKS"]), 24.0, 0.7, {"solver_method": method, "pump": pump},
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
    folder: Path, x: float, defined: dict[str, float]
) -> None:
    """A relation that is not looked at need not be defined."""
    with initializing(named(folder, TEXTS["UNDEFINED"])) as unit:
        unit.set(x=x)
        unit.fmi.exitInitializationMode()
        for name in ("small", "sign", "large", "both", "guarded", "either"):
            if name in defined:
                assert unit.get(name) == [defined[name]]
            else:
                with pytest.raises(fmpy.fmi1.FMICallException, match="discard"):
                    unit.get(name)


def test_a_check_that_is_not_defined_is_broken(folder: Path) -> None:
    with initializing(named(folder, TEXTS["UNDEFINED"])) as unit:
        unit.set(p=-1.0)
        with pytest.raises(fmpy.fmi1.FMICallException, match="error"):
            unit.fmi.exitInitializationMode()


@EACH_METHOD
def test_relations_in_branches_that_are_not_taken_make_no_events(folder: Path, method: int) -> None:
    fmu = named(folder, TEXTS["BRANCHES"])
    run = simulated(
        fmu, 12.0, 0.5, {"solver_method": method}, relative_tolerance=1e-10, also=["event_count"]
    )
    assert run["event_count"][-1] == 0
    np.testing.assert_allclose(run["x"], np.cos(run["time"]), rtol=0, atol=1e-8)
    np.testing.assert_allclose(run["y"], run["time"], rtol=0, atol=1e-12)


@EACH_METHOD
def test_a_relation_of_time_switches_at_its_time(folder: Path, method: int) -> None:
    fmu = named(folder, TEXTS["PULSE"])
    run = simulated(fmu, 2.0, 0.2, {"solver_method": method}, relative_tolerance=1e-8)
    expected = np.clip(run["time"] - 0.73, 0.0, 0.73)
    np.testing.assert_allclose(run["x"], expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(run["y"], 1.0 - np.cos(run["time"]), rtol=0, atol=1e-7)


def test_a_relation_of_inputs_switches_where_they_are_set(folder: Path) -> None:
    with initializing(named(folder, TEXTS["PULSE"])) as unit:
        unit.fmi.exitInitializationMode()
        for value, expected in ((0.5, 0.0), (0.5 + 1e-15, 1.0), (0.5, 0.0), (3.0, 1.0)):
            unit.set(u=value)
            assert unit.get("above") == [expected]
        unit.step(0.0, 0.25)
        assert unit.get("y") == pytest.approx([0.5], abs=1e-14)


def test_relations_that_decide_each_other_switch_in_one_event(folder: Path) -> None:
    """An input decides the first one, each the next."""
    text = '[inputs]\nu = {}\n[where]\na0 = "u"\n'
    text += "".join(f'a{i} = "u if a{i - 1} > 0 else -1"\n' for i in range(1, 9))
    text += '[states]\nx = { derivative = "a8" }\n[outputs]\ny = { value = "a8" }\n'
    with initializing(named(folder, text), FMU2Model) as unit:
        unit.fmi.exitInitializationMode()
        for value in (-1.0, 1.0):
            unit.fmi.enterEventMode()
            unit.set(u=value)
            unit.fmi.newDiscreteStates()
            assert unit.get("y") == [value]


@EACH_METHOD
def test_events_at_one_instant_run_in_order_and_see_what_the_others_left(
    folder: Path, method: int
) -> None:
    fmu = named(folder, TEXTS["CHAIN"])
    run = simulated(fmu, 2.4, 0.3, {"solver_method": method}, also=["a", "b"])
    # at 1 both; at 2 the first clears a, so that the second does not run
    np.testing.assert_array_equal(run["n"], [0, 0, 0, 0, 12, 12, 12, 121, 121])
    np.testing.assert_array_equal(run["a"], [0, 0, 0, 0, 1, 1, 1, 0, 0])
    expected = [1, 0.7, 0.4, 0.1, 0.8, 0.5, 0.2, -0.1, -0.4]
    np.testing.assert_allclose(run["x"], expected, rtol=0, atol=1e-12)
    at_once = simulated(fmu, 0.5, 0.5, {"limit": 1.0, "solver_method": method})
    assert at_once["n"][0] == 12


def test_right_sides_of_an_event_see_the_values_before_it(folder: Path) -> None:
    run = simulated(named(folder, TEXTS["SWAP"]), 0.5, 0.5, {}, also=["a", "b"])
    assert [run[name][-1] for name in ("x", "y", "a", "b")] == [2.0, 1.0, True, False]


@pytest.mark.parametrize("most", [3, 4])
def test_events_follow_each_other_max_events_times(folder: Path, most: int) -> None:
    """Four of them do, each because of the one before."""
    text = '[states]\nx = { start = 0, derivative = "0" }\n'
    for i in range(4, 0, -1):
        text += f'[events.e{i}]\nwhen = "x > {i}.5"\nreinit = {{ x = "{i + 1}.75" }}\n'
    fmu = named(folder, text)
    if most < 4:
        with pytest.raises(fmpy.fmi1.FMICallException):
            simulated(fmu, 1.0, 0.5, {"x": 1.75, "max_events": most})
    else:
        assert simulated(fmu, 1.0, 0.5, {"x": 1.75, "max_events": most})["x"][-1] == 5.75


def test_a_model_without_states_has_modes(folder: Path) -> None:
    found = []
    with initializing(named(folder, TEXTS["LATCH"])) as unit:
        unit.fmi.exitInitializationMode()
        for step, value in enumerate((0.0, 2.0, 3.0, 1.0, 2.0, 0.5)):
            unit.set(u=value)
            unit.step(step * 0.1, 0.1)
            found += unit.get("y")
    assert found == [0.0, 4.0, 6.0, 2.0, 0.0, 0.0]


@pytest.mark.parametrize("version", ["", "fmi3"])
@pytest.mark.parametrize("steps", [1, 18, 40])
def test_events_of_a_model_without_states_are_located(
    folder: Path, version: str, steps: int
) -> None:
    fmu = named(folder, TEXTS["SAW"])
    run = simulated(fmu.parent / version / fmu.name, 1.26, 1.26 / steps, {})
    t = run["time"][1:]
    np.testing.assert_array_equal(run["n"][1:], np.floor(10 * t) + 1)
    np.testing.assert_allclose(run["saw"], np.mod(run["time"], 0.5), rtol=0, atol=1e-14)


def test_an_input_that_moves_is_located_without_states(folder: Path) -> None:
    with initializing(named(folder, TEXTS["SAW"])) as unit:
        unit.fmi.exitInitializationMode()
        reference = [unit.loaded.references["u"]]
        unit.fmi.setRealInputDerivatives(reference, [1], [3.0])
        unit.step(0.0, 1.0)
        assert unit.get("stamp") == pytest.approx([1 / 3], abs=1e-12)


def test_events_that_contradict_each_other_are_named(folder: Path) -> None:
    fmu = named(folder, TEXTS["CONTRADICTION"])
    with Instance(loaded(fmu), logging_on=True) as unit:
        unit.initialize(0.0, None, 1e-9).step(0.0, 0.9)
        with pytest.raises(fmpy.fmi1.FMICallException):
            unit.step(0.9, 0.2)
        last = unit.messages[-1].text
        assert "the step ended at t = 1.0" in last and "event up (b > 0), the same" in last


def test_a_step_that_is_tried_again_and_succeeds_sends_no_message(folder: Path) -> None:
    """Long steps of `erk` go where the tank is emptier than empty."""
    with Instance(loaded(named(folder, TEXTS["SIPHON"])), logging_on=True) as unit:
        unit.fmi.setInteger([unit.loaded.references["solver_method"]], [METHODS["erk"]])
        unit.initialize(0.0, None, 1e-9).step(0.0, 200.0)
        assert unit.count("event_count") == 3
        assert [m.text for m in unit.messages if m.status != OK] == []
