"""Gradients as importers use them: rollback, repeated runs, Model Exchange; names and units."""

from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description

from tests.equations import hybrid_runs
from tests.equations.examples import METHODS, loaded
from tests.equations.hybrid_runs import Exchange, Unit, early_return, model_exchange
from tests.gradients.models import EXACT, TEXTS, fmus, run
from tests.gradients.test_references import CASES, Case
from tests.support.instances import Instance, restore, serialized

PLANTS = [case for case in CASES if case.model != "Lorenz"]
EACH_CASE = pytest.mark.parametrize("case", PLANTS, ids=[case.model for case in PLANTS])
EACH_METHOD = pytest.mark.parametrize("method", METHODS)
NO_TIME_EVENTS = pytest.mark.parametrize("name", ["Ball", "Floor", "Belt", "Thermostat"])


@EACH_CASE
@EACH_METHOD
def test_rollback_and_repetition_give_the_same_bits(case: Case, method: str) -> None:
    """After steps into the future and back, by a copy in memory or by bytes, also elsewhere."""
    model, step = loaded(fmus()[case.model]), case.stop / case.steps
    flag = [model.references[EXACT]]

    def begun() -> Instance:
        instance = Instance(model)
        instance.begin(tolerance=1e-9)
        instance.fmi.setInteger([model.references["solver_method"]], [METHODS[method]])
        instance.fmi.exitInitializationMode()
        return instance

    def seen(instance: Instance) -> tuple:
        return instance.everything(), instance.fmi.getBoolean(flag)

    with begun() as plain, begun() as restless, Instance(model) as other:
        other.initialize()
        for k in range(case.steps):
            content = serialized(restless)
            state = restless.fmi.getFMUState()
            for ahead in range(3):
                restless.step((k + ahead) * step, step)
            if k % 2:
                restless.fmi.setFMUState(state)
            else:
                restore(restless, content)
            restless.fmi.freeFMUState(state)
            for instance in (plain, restless):
                instance.step(k * step, step)
            assert seen(plain) == seen(restless)
            if k % 5 == 0:
                restore(other, content)
                other.step(k * step, step)
                assert seen(plain) == seen(other)


@EACH_CASE
def test_model_exchange_has_the_same_gradients(case: Case) -> None:
    """By fmpy, which integrates them as states of their own."""
    step = case.stop / case.steps
    inside = run(fmus()[case.model], "taylor", case.stop, step)
    for version in ("2.0", "3.0"):
        outside = run(
            fmus()[case.model], "-", case.stop, step, version, 1e-8, "ModelExchange"
        )[[0, -1]]  # fmt: skip
        for name in inside.dtype.names:
            size = max(1.0, float(np.abs(inside[name]).max()))
            near = 1e-4 * size
            assert outside[name] == pytest.approx(inside[name][[0, -1]], abs=near), name


def unit_of(name: str, folder: Path) -> Unit:
    """With all continuous states, also those that are derivatives of others."""
    unit = Unit(folder, TEXTS[name])
    variables = loaded(fmus()[name]).description.modelVariables
    unit.states = [v.derivative.name for v in variables if v.derivative]
    return unit


class Restless(Exchange):
    """Makes each step twice: first one that is too long, which it rejects."""

    def moved(self, t: float, x: np.ndarray, h: float, k1: np.ndarray) -> np.ndarray:
        far = super().moved(t, x, 40 * h, k1)
        self.signs(t + 40 * h, far)
        return super().moved(t, x, h, k1)


@NO_TIME_EVENTS
def test_rejected_steps_change_no_bit(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unit = unit_of(name, tmp_path)
    plain = model_exchange(unit, 1e-9, 0.05, 20, {})
    monkeypatch.setattr(hybrid_runs, "Exchange", Restless)
    restless = model_exchange(unit, 1e-9, 0.05, 20, {})
    assert plain == restless and plain.events
    assert plain.failure == "" and plain.differences == []
    inside = run(fmus()[name], "taylor", 1.0, 0.05)
    for k, state in enumerate(unit.states):
        near = 1e-5 * max(1.0, float(np.abs(inside[state]).max()))
        assert plain.x[-1][k] == pytest.approx(inside[state][-1], abs=near), state


@EACH_CASE
@pytest.mark.parametrize("method", ["cvode_bdf", "taylor"])
def test_steps_that_end_at_events(case: Case, method: str, tmp_path: Path) -> None:
    """In FMI 3.0, with snapshots in event mode: the gradients of steps that pass events."""
    unit = unit_of(case.model, tmp_path)
    step = case.stop / case.steps
    ending = early_return(unit, method, 1e-10, step, case.steps, snapshots=True)
    assert ending.failure == "" and ending.differences == []
    inside = run(fmus()[case.model], method, case.stop, step)
    for k, state in enumerate(unit.states):
        near = 1e-7 * max(1.0, float(np.abs(inside[state]).max()))
        assert ending.x[-1][k] == pytest.approx(inside[state][-1], abs=near), state


@pytest.mark.parametrize("folder", ["", "fmi3"])
def test_names_and_units(folder: str) -> None:
    fmu = fmus()["Chain"]
    description = read_model_description(fmu.parent / folder / fmu.name)
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    found = {
        v.name: tuple(
            getattr(units.get(v.unit or v.declaredType.unit), base, 0) for base in ("kg", "m", "s")
        )
        for v in description.modelVariables
        if v.causality == "output" and "_by_" in v.name
    }
    assert found == {
        "x[2]_by_k[3]": (-1, 1, 2), "x[2]_by_m": (-1, 1, 0), "x[2]_by_start_x[1]": (0, 0, 0),
        "energy_by_k[3]": (0, 2, 0), "energy_by_m": (0, 2, -2),
        "energy_by_start_x[1]": (1, 1, -2),
    }  # fmt: skip
    (flag,) = (v for v in description.modelVariables if v.name == EXACT)
    assert (flag.type, flag.causality) == ("Boolean", "output")


def test_of_is_all_states_and_real_outputs_if_it_is_missing() -> None:
    """With those of [discrete], and a derivative each."""
    for name, expected in {
        "Ball": [f"{x}_by_{p}" for x in ("h", "v", "energy") for p in ("g", "e", "start_h")],
        "Pid": [f"{x}_by_{p}" for x in ("y", "v", "u", "sum", "last")
                for p in ("Ts", "Kp", "Ki", "Kd")],
    }.items():  # fmt: skip
        variables = loaded(fmus()[name]).description.modelVariables
        found = [v.name for v in variables if v.causality == "output" and "_by_" in v.name]
        assert sorted(found) == sorted(expected)
