"""Model Exchange: fmpy's CVode integrates the FMU; its modes and functions do what they should."""

import ctypes
from collections.abc import Callable
from ctypes import byref, c_double

import fmpy
import numpy as np
import pytest
from fmpy import fmi2

from cosim.runs import reference
from cosim.runs.reference import Reference
from cosim.runs.simulation import Result
from cosim.scenarios.scenario import Scenario
from tests.support.cosim_project import declared, load, names_of
from tests.support.instances import ERROR, INPUTS, STATES, Instance, LoadedFmu, status_of

NAMES = names_of("rp_manipulator")
SECOND = [
    ("q1", "der_q1"),
    ("q2", "der_q2"),
    ("dq1", "ddq1"),
    ("dq2", "ddq2"),
]  # states and their derivatives
START = {"q1": -1.43, "q2": 0.58, "dq1": 1.97, "dq2": 0.12}


@pytest.fixture
def model(loaded: LoadedFmu):
    """An instance in event mode, right after initialization."""
    with Instance(loaded, fmi2.FMU2Model) as instance:
        yield instance.initialize(**START)


def continuous(model: Instance) -> Instance:
    """From event mode to continuous time."""
    model.fmi.newDiscreteStates()
    model.fmi.enterContinuousTimeMode()
    return model


def read(function: Callable, count: int = 4) -> list[float]:
    """What a function of fmpy writes to an array."""
    values = (c_double * count)(*[np.nan] * count)
    function(values, count)
    return list(values)


def write(model: Instance, x: list[float]) -> None:
    model.fmi.setContinuousStates((c_double * len(x))(*x), len(x))


# ---- fmpy's solver against the references ------------------------------------------------------


def staircase(scenario: Scenario) -> np.ndarray | None:
    """Inputs held over each step, with an event for fmpy wherever one of them changes."""
    if not scenario.inputs:
        return None
    values = np.column_stack([scenario.input(name) for name in INPUTS])
    rows = [(scenario.times[0], *values[0])]
    for i in range(1, len(values) - 1):
        if np.any(values[i] != values[i - 1]):
            rows += [(scenario.times[i], *values[i - 1]), (scenario.times[i], *values[i])]
    rows.append((scenario.times[-1], *values[-2]))
    return np.array(rows, dtype=[("time", float), *((name, float) for name in INPUTS)])


def simulate(loaded: LoadedFmu, scenario: Scenario, expected: Reference, tolerance: float) -> float:
    """Largest relative error of all outputs, as for co-simulation.

    fmpy restarts CVode where two rows of the input have the same time, in event mode, and records
    there, before the event: the outputs with the input of the step that ends.
    """
    # fmpy gives up after 500 steps of CVode on the way to an output
    interval = min(max(scenario.steps), (scenario.stop - scenario.start) / 50)
    recorded = fmpy.simulate_fmu(
        str(loaded.folder),
        model_description=loaded.description,
        fmi_type="ModelExchange",
        solver="CVode",
        start_time=scenario.start,
        stop_time=scenario.stop,
        output_interval=interval,
        relative_tolerance=tolerance,
        start_values=scenario.parameters | scenario.initial,
        input=staircase(scenario),
        output=expected.names,
        record_events=True,
    )
    times = scenario.times[scenario.reference_rows]
    near = 1e-9 * np.maximum(np.abs(times), 1e-3)  # fmpy adds up its times
    rows = np.searchsorted(recorded["time"], times - near)
    assert np.all(np.abs(recorded["time"][rows] - times) <= near)
    values = np.column_stack([recorded[name][rows] for name in expected.names])
    result = Result(tolerance, times, expected.names, values, 0, 0.0, None, None, ())
    return max(reference.errors(result, expected).values())


@pytest.mark.parametrize("name", NAMES)
def test_fmpy_follows_the_reference(loaded: LoadedFmu, name: str) -> None:
    """Within 1e-5 at tolerance 1e-8, or at 1e-11 where fmpy's solver needs it.

    fmpy integrates with BDF formulas, whose errors add up. It restarts them at every change of an
    input, up to 5000 times, each with an error of the order of the tolerance. The error follows the
    tolerance, so it is the solver's.
    """
    scenario = load(name)
    expected = reference.load(scenario, declared(scenario.model))
    error = simulate(loaded, scenario, expected, 1e-8)
    if error > 1e-5:
        assert error <= 2e-3
        fine = simulate(loaded, scenario, expected, 1e-11)
        assert fine <= 1e-5 and fine <= error / 100


def test_inputs_at_rest_need_no_finer_tolerance(loaded: LoadedFmu) -> None:
    for name in ("coasting", "constant_effort", "constant_effort_single_step"):
        scenario = load(name)
        expected = reference.load(scenario, declared(scenario.model))
        assert simulate(loaded, scenario, expected, 1e-8) <= 1e-5


# ---- States and derivatives --------------------------------------------------------------------


def test_states_and_derivatives_are_those_of_the_variables(model: Instance) -> None:
    continuous(model)
    chance = np.random.default_rng(3)
    for _ in range(100):
        x, u = chance.normal(size=4).tolist(), chance.normal(size=2).tolist()
        model.fmi.setTime(float(chance.uniform(0, 10)))
        write(model, x)
        model.set(tau1=u[0], f2=u[1])
        assert read(model.fmi.getContinuousStates) == x == model.get(*STATES)
        assert read(model.fmi.getDerivatives) == model.get("dq1", "dq2", "ddq1", "ddq2")


def test_order_of_the_states_is_that_of_the_model_description(loaded: LoadedFmu) -> None:
    derivatives = [unknown.variable for unknown in loaded.description.derivatives]
    assert [(v.derivative.name, v.name) for v in derivatives] == SECOND
    assert loaded.description.numberOfContinuousStates == 4
    assert loaded.description.numberOfEventIndicators == 0


def test_derivatives_are_those_of_co_simulation(loaded: LoadedFmu, model: Instance) -> None:
    values = {**START, "tau1": 0.7, "f2": -3.0, "m2": 1.7, "a": -0.2}
    outputs = [v.name for v in loaded.description.modelVariables if v.causality == "output"]
    with Instance(loaded) as co_simulation, Instance(loaded, fmi2.FMU2Model) as other:
        co_simulation.initialize(**values)
        other.initialize(**values)
        assert co_simulation.get(*outputs) == other.get(*outputs)
        continuous(other)
        assert co_simulation.get(*outputs) == other.get(*outputs)
        assert co_simulation.get("dq1", "dq2", "ddq1", "ddq2") == read(other.fmi.getDerivatives)


def test_time_is_the_one_set(model: Instance) -> None:
    model.fmi.setTime(0.25)
    assert model.get("time") == [0.25]
    continuous(model)
    before = read(model.fmi.getDerivatives)
    for t in (1e6, 0.25, 0.0):  # solvers go back too
        model.fmi.setTime(t)
        assert model.get("time") == [t]
        assert read(model.fmi.getDerivatives) == before  # nothing depends on it


def test_nominal_values_are_one(model: Instance) -> None:
    assert read(model.fmi.getNominalsOfContinuousStates) == [1.0] * 4
    continuous(model)
    assert read(model.fmi.getNominalsOfContinuousStates) == [1.0] * 4


def test_states_start_where_they_were_set(model: Instance) -> None:
    assert read(model.fmi.getContinuousStates) == list(START.values())


@pytest.mark.parametrize("count", [0, 1, 3, 5, 1000])
@pytest.mark.parametrize(
    "function",
    [
        "getContinuousStates",
        "setContinuousStates",
        "getDerivatives",
        "getNominalsOfContinuousStates",
    ],
)
def test_wrong_sizes_are_refused(model: Instance, function: str, count: int) -> None:
    """With fmi2Error and both sizes, nothing read or written; Reset leads back."""
    continuous(model)
    before = read(model.fmi.getContinuousStates)
    values = (c_double * max(count, 1))(*[np.pi] * count)
    assert status_of(getattr(model.fmi, function), values, count) == ERROR
    assert list(values)[:count] == [np.pi] * count
    assert str(count) in model.messages[-1].text and "4" in model.messages[-1].text
    assert read(model.fmi.getContinuousStates) == before
    model.fmi.reset()
    continuous(model.initialize(**START))
    assert read(model.fmi.getContinuousStates) == list(START.values())


def test_event_indicators_there_are_none(model: Instance) -> None:
    values = (c_double * 1)(np.pi)
    model.fmi.getEventIndicators(values, 0)
    assert status_of(model.fmi.getEventIndicators, values, 1) == ERROR
    assert list(values) == [np.pi]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_states_that_are_not_finite_are_refused(model: Instance, value: float) -> None:
    """fmi2Discard: the solver tries a shorter step; nothing is set, the instance goes on."""
    continuous(model)
    x = list(START.values())
    assert status_of(write, model, [1.0, 2.0, value, 3.0]) == 2
    assert read(model.fmi.getContinuousStates) == x
    write(model, x)


def test_derivatives_that_overflow_are_refused(model: Instance) -> None:
    continuous(model)
    write(model, [0.0, 1.0, 1e200, 1.0])
    values = (c_double * 4)(*[np.pi] * 4)
    assert status_of(model.fmi.getDerivatives, values, 4) == 2
    assert list(values) == [np.pi] * 4
    write(model, list(START.values()))
    assert np.all(np.isfinite(read(model.fmi.getDerivatives)))


# ---- Modes -------------------------------------------------------------------------------------


def test_no_events(model: Instance) -> None:
    assert model.fmi.newDiscreteStates()[:5] == (False,) * 5
    model.fmi.enterContinuousTimeMode()
    for no_set_state in (fmi2.fmi2True, fmi2.fmi2False):
        assert model.fmi.completedIntegratorStep(no_set_state) == (False, False)


def test_flags_of_model_exchange(loaded: LoadedFmu) -> None:
    element = loaded.description.modelExchange
    assert element.modelIdentifier == loaded.description.coSimulation.modelIdentifier
    assert element.providesDirectionalDerivative
    assert element.canGetAndSetFMUstate and element.canSerializeFMUstate


def test_parameters_change_in_event_mode_alone(model: Instance) -> None:
    continuous(model)
    before = read(model.fmi.getDerivatives)
    assert status_of(lambda: model.set(m2=2.0)) == ERROR
    model.fmi.reset()
    continuous(model.initialize(**START))
    model.fmi.enterEventMode()
    model.set(m2=2.0, tau1=1.0)
    model.fmi.newDiscreteStates()
    model.fmi.enterContinuousTimeMode()
    assert read(model.fmi.getContinuousStates) == list(START.values())
    assert read(model.fmi.getDerivatives)[2:] != before[2:]
    with_it = model.get("ddq1", "ddq2")
    model.fmi.reset()
    assert model.initialize(**START, m2=2.0, tau1=1.0).get("ddq1", "ddq2") == with_it


def test_modes_are_entered_in_their_order(model: Instance) -> None:
    x = (c_double * 4)(*START.values())
    assert status_of(model.fmi.setContinuousStates, x, 4) == ERROR  # in event mode

    model.fmi.reset()
    continuous(model.initialize(**START))
    assert status_of(model.fmi.enterContinuousTimeMode) == ERROR
    assert "continuous" in model.messages[-1].text.lower()

    model.fmi.reset()
    continuous(model.initialize(**START))
    assert status_of(model.fmi.newDiscreteStates) == ERROR

    model.fmi.reset()
    assert status_of(model.fmi.completedIntegratorStep) == ERROR  # instantiated


def test_functions_of_the_other_kind_are_refused(loaded: LoadedFmu) -> None:
    """The binary has both; an instance is of one kind."""
    library = ctypes.CDLL(str(loaded.folder / "binaries" / "linux64" / "RPManipulator.so"))
    with Instance(loaded, fmi2.FMU2Model) as model, Instance(loaded) as co_simulation:
        continuous(model.initialize(**START))
        co_simulation.initialize(**START)
        t = ctypes.c_double
        step = library.fmi2DoStep
        assert step(ctypes.c_void_p(model.fmi.component), t(0.0), t(0.1), 1) == ERROR
        set_time = library.fmi2SetTime
        assert set_time(ctypes.c_void_p(co_simulation.fmi.component), t(0.1)) == ERROR
        for instance in (model, co_simulation):
            assert instance.messages[-1].status == ERROR
            instance.fmi.reset()
            instance.initialize(**START)


def test_rollback(model: Instance) -> None:
    """A saved state brings back time, states, inputs and mode."""
    continuous(model)
    model.fmi.setTime(1.0)
    model.set(tau1=2.0)
    state, everything = model.fmi.getFMUstate(), model.everything()
    content = model.fmi.serializeFMUstate(state)
    model.fmi.setTime(2.0)
    model.set(tau1=3.0)
    write(model, [1.0, 2.0, 3.0, 4.0])
    assert model.everything() != everything
    model.fmi.setFMUstate(state)
    assert model.everything() == everything
    with Instance(model.loaded, fmi2.FMU2Model) as other:
        other.fmi.setFMUstate(other.fmi.deSerializeFMUstate(content))
        assert other.everything() == everything
        write(other, list(START.values()))  # in continuous time
    model.fmi.terminate()
    model.fmi.setFMUstate(state)
    assert model.fmi.completedIntegratorStep() == (False, False)


def test_null_event_info_is_refused(model: Instance) -> None:
    assert status_of(model.fmi.fmi2NewDiscreteStates, model.fmi.component, None) == ERROR
    assert "fmi2NewDiscreteStates" in model.messages[-1].text


def test_completed_integrator_step_without_answers_is_refused(model: Instance) -> None:
    continuous(model)
    flag = ctypes.c_int(7)
    arguments = (model.fmi.component, fmi2.fmi2True, byref(flag), None)
    assert status_of(model.fmi.fmi2CompletedIntegratorStep, *arguments) == ERROR
    assert flag.value == 7


def test_another_solver_gives_the_same(loaded: LoadedFmu) -> None:
    """Classical Runge-Kutta in Python, fixed steps, against a co-simulation of the same motion."""
    values = {**START, "tau1": -0.5, "f2": -8.0}
    steps, h = 400, 1.0 / 400
    with Instance(loaded) as co_simulation:
        co_simulation.initialize(tolerance=1e-10, **values)
        co_simulation.step(0.0, 1.0)
        expected = np.array(co_simulation.get(*STATES))
    with Instance(loaded, fmi2.FMU2Model) as model:
        continuous(model.initialize(**values))

        def slope(t: float, x: np.ndarray) -> np.ndarray:
            model.fmi.setTime(t)
            write(model, x.tolist())
            return np.array(read(model.fmi.getDerivatives))

        x = np.array(read(model.fmi.getContinuousStates))
        for i in range(steps):
            t = i * h
            k1 = slope(t, x)
            k2 = slope(t + h / 2, x + h / 2 * k1)
            k3 = slope(t + h / 2, x + h / 2 * k2)
            k4 = slope(t + h, x + h * k3)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            write(model, x.tolist())
            assert model.fmi.completedIntegratorStep() == (False, False)
        assert np.max(np.abs(x - expected)) < 1e-8
