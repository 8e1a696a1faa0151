"""RPController against a sympy model of its laws, whose arm comes from positions (rp_symbolic).

Values must agree within 1e-12 and derivatives within 1e-10 of the exact ones, relative to the sum
of the absolute values of the terms that they are made of.
"""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mpmath
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model

from rparm.fmi.fmu_file import Fmu
from rparm.runs import comparison
from rparm.runs.comparison import Runs
from tests.rp_controller.controller_symbolic import (
    ARM,
    CASES,
    EFFORTS,
    ERRORS,
    FREE,
    INPUTS,
    KNOWNS,
    LIMITS,
    MODES,
    PARAMETERS,
    RATES,
    UNKNOWNS,
    Case,
    Values,
    along_time,
    assert_close,
    generic_point,
    jacobian,
    law,
    numbers,
    terms_of_values,
)
from tests.support.instances import ERROR, OK, Instance, LoadedFmu, status_of
from tests.support.paths import ROOT
from tests.support.rparm_project import declared, load, names_of

UNIT = "RPController"

FOLDER = ROOT / "models" / "rp_controller"
SCENARIOS = names_of(FOLDER.name)
SAMPLED = ("sample_time", "delay", "payload_attached")


@contextmanager
def in_initialization_mode(loaded: LoadedFmu, case: Case, point: Values) -> Iterator[Instance]:
    with Instance(loaded) as instance:
        instance.fmi.setupExperiment()
        instance.set(**point)
        instance.fmi.setInteger([loaded.references["mode"]], [MODES[case.mode]])
        instance.fmi.setBoolean([loaded.references["payload_attached"]], [case.is_attached])
        instance.fmi.enterInitializationMode()
        yield instance


# ---- Values and derivatives ----------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_values_are_those_of_the_law(loaded: LoadedFmu, case: Case) -> None:
    for seed in range(5):
        point = generic_point(case, seed)
        with in_initialization_mode(loaded, case, point) as instance:
            rows = terms_of_values(case)(*numbers(point, KNOWNS))
            for name, actual, row in zip(UNKNOWNS, instance.get(*UNKNOWNS), rows, strict=True):
                assert_close(actual, row, 1e-12, (name, seed))


@pytest.mark.parametrize("case", CASES)
def test_directional_derivatives(loaded: LoadedFmu, case: Case) -> None:
    for seed in range(3):
        point = generic_point(case, seed)
        rows = jacobian(case)(*numbers(point, KNOWNS))
        with in_initialization_mode(loaded, case, point) as instance:
            unknowns = [loaded.references[name] for name in UNKNOWNS]
            for k, known in enumerate(KNOWNS):
                column = instance.fmi.getDirectionalDerivative(
                    unknowns, [loaded.references[known]], [1.0]
                )
                for name, actual, row in zip(UNKNOWNS, column, rows, strict=True):
                    scale = max(abs(entry) for entry in row)
                    bound = max(1e-10 * abs(row[k]), 1e-13 * scale)
                    assert abs(actual - row[k]) <= bound, (name, known, actual, row[k])


@pytest.mark.parametrize("case", CASES)
def test_output_derivatives(loaded: LoadedFmu, case: Case) -> None:
    outputs = (*EFFORTS, *ERRORS)
    references = [loaded.references[name] for name in outputs]
    for seed in range(3):
        point = generic_point(case, seed)
        source = random.Random(seed)
        rates = {name: (source.uniform(-3, 3), source.uniform(-9, 9)) for name in INPUTS}
        moving = [mpmath.mpf(rates[name][order]) for order in (0, 1) for name in INPUTS]
        rows = iter(along_time(case)(*numbers(point, KNOWNS), *moving))
        with in_initialization_mode(loaded, case, point) as instance:
            instance.fmi.exitInitializationMode()
            instance.set_input_derivatives(**rates)
            for name, reference in zip(outputs, references, strict=True):
                for order in (1, 2):
                    actual = instance.fmi.getRealOutputDerivatives([reference], [order])[0]
                    assert_close(actual, next(rows), 1e-10, (name, order, seed))


def test_dependencies_are_those_of_the_laws(loaded: LoadedFmu) -> None:
    depends: dict[str, set[str]] = {name: set() for name in UNKNOWNS}
    for case in CASES:
        rows = jacobian(case)(*numbers(generic_point(case, 0), KNOWNS))
        for name, row in zip(UNKNOWNS, rows, strict=True):
            depends[name] |= {k for k, entry in zip(KNOWNS, row, strict=True) if entry != 0}
    # of mode and payload_attached depends what differs between two cases
    for name in UNKNOWNS:
        if len({law(Case(mode))[name] for mode in MODES}) > 1 or name in RATES:
            depends[name].add("mode")
        if any(law(Case(m))[name] != law(Case(m, FREE, True))[name] for m in MODES) or (
            name in RATES
        ):
            depends[name].add("payload_attached")

    structure = loaded.description
    listed = {u.variable.name: u for u in (*structure.outputs, *structure.derivatives)}
    assert set(listed) == {*EFFORTS, *ERRORS, *RATES}
    for name, unknown in listed.items():
        expected = depends[name] - {*PARAMETERS, "mode"}
        assert {v.name for v in unknown.dependencies} == expected, name
    initial = {u.variable.name: u for u in structure.initialUnknowns}
    for name in listed:
        # the integrals of a sampled law move at samples only
        expected = depends[name] | ({"sample_time"} if name in RATES else set())
        assert {v.name for v in initial[name].dependencies} == expected, name


# ---- With the arm --------------------------------------------------------------------------------


def test_gravity_compensation_holds_the_arm_in_place(
    fmu: Path, loaded: LoadedFmu, tmp_path: Path
) -> None:
    arm_unit = LoadedFmu(fmu, tmp_path)
    measured = ("q1", "q2", "dq1", "dq2")
    with Instance(arm_unit) as arm, Instance(loaded) as controller:
        controller.fmi.setInteger([loaded.references["mode"]], [MODES["pd_gravity"]])
        controller.initialize(q1=0.7, q2=0.2, q1_ref=0.7, q2_ref=0.2, Ki1=50.0, Ki2=50.0)
        arm.initialize(q1=0.7, q2=0.2, **dict(zip(EFFORTS, controller.get(*EFFORTS), strict=True)))
        for i in range(500):
            arm.step(0.002 * i, 0.002)
            controller.set(**dict(zip(measured, arm.get(*measured), strict=True)))
            controller.step(0.002 * i, 0.002)
            arm.set(**dict(zip(EFFORTS, controller.get(*EFFORTS), strict=True)))
        assert arm.get(*measured) == pytest.approx([0.7, 0.2, 0.0, 0.0], abs=1e-12)


# ---- As a unit -----------------------------------------------------------------------------------


def test_the_taylor_method_is_refused_where_the_fmu_integrates(loaded: LoadedFmu) -> None:
    references = [loaded.references["solver_method"]]
    with Instance(loaded) as instance:
        instance.fmi.setInteger(references, [4])
        instance.fmi.setupExperiment()
        instance.fmi.enterInitializationMode()
        assert status_of(instance.fmi.exitInitializationMode) == ERROR
        text = instance.messages[-1].text
        assert "solver_method = 4 (taylor) is refused: RPController has no Taylor series" in text
        assert all(name in text for name in ("1 (cvode_adams)", "2 (cvode_bdf)", "3 (erk)"))
    with Instance(loaded, kind=FMU2Model) as instance:
        instance.fmi.setInteger(references, [4])
        instance.fmi.setupExperiment()
        instance.fmi.enterInitializationMode()
        assert status_of(instance.fmi.exitInitializationMode) == OK
        saved = instance.fmi.getFMUstate()
        read = instance.fmi.deSerializeFMUstate(instance.fmi.serializeFMUstate(saved))
        instance.fmi.setFMUstate(read)
        instance.fmi.freeFMUstate(read)
        instance.fmi.freeFMUstate(saved)


def test_mode_changes_between_steps(loaded: LoadedFmu) -> None:
    point = generic_point(Case("pd"), 1) | dict.fromkeys(LIMITS, 1e9) | {"Ki1": 0.0, "Ki2": 0.0}
    with in_initialization_mode(loaded, Case("pd"), point) as instance:
        instance.fmi.exitInitializationMode()
        for i, (mode, number) in enumerate(MODES.items()):
            instance.fmi.setInteger([loaded.references["mode"]], [number])
            rows = terms_of_values(Case(mode))(*numbers(point, KNOWNS))
            for name, actual in zip(EFFORTS, instance.get(*EFFORTS), strict=True):
                assert_close(actual, rows[UNKNOWNS.index(name)], 1e-12, (mode, name))
            instance.step(0.1 * i, 0.1)


def test_rollback_in_saturation_is_exact(loaded: LoadedFmu) -> None:
    # only what acts on the integral parts, so that the limit is met, held and left again
    values = dict(
        q1_ref=0.3, q2_ref=-0.2, Kp1=20.0, Ki1=900.0, Ki2=900.0, tau1_max=12.0, f2_max=9.0
    )

    def run(instance: Instance, first: int, last: int) -> list[bytes]:
        seen = []
        for i in range(first, last):
            if i % 7 == 0:
                instance.set(q1=0.5 if i > 40 else 0.05 * (i % 2))
            instance.step(0.01 * i, 0.01)
            seen.append(instance.everything())
        return seen

    with Instance(loaded) as instance:
        instance.initialize(tolerance=1e-11, **values)
        run(instance, 0, 30)
        assert instance.get("tau1") == [12.0]
        state = instance.fmi.getFMUState()
        once = run(instance, 30, 80)
        assert instance.get("tau1") < [12.0]
        instance.fmi.setFMUState(state)
        assert run(instance, 30, 80) == once
        assert status_of(instance.fmi.freeFMUState, state) == OK


def test_references_and_units_of_the_arm_are_the_arms(
    fmu: Path, loaded: LoadedFmu, tmp_path: Path
) -> None:
    arm = {v.name: v for v in LoadedFmu(fmu, tmp_path).description.modelVariables}
    own = {v.name: v for v in loaded.description.modelVariables}
    for name in ARM:
        for key in ("valueReference", "unit", "start", "min"):
            assert getattr(own[name], key) == getattr(arm[name], key), (name, key)
    for name in (*EFFORTS, "q1", "q2", "dq1", "dq2"):
        assert own[name].unit == arm[name].unit, name


# ---- References ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "effort", "limit"),
    [("limited_integral", "tau1", 14), ("limited_integral", "f2", 9), ("pd_gravity", "f2", 12)],
)
def test_scenarios_meet_limits_and_leave_them(name: str, effort: str, limit: float) -> None:
    scenario = load(f"controller_{name}")
    column = comparison.load_reference(scenario, declared(FOLDER.name)).column(effort)
    assert {max(-1, min(1, int(u / limit))) for u in column} == {-1, 0, 1}
    assert abs(column).max() == limit


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenarios_meet_their_references(path: Path, name: str) -> None:
    with Fmu(path) as opened:
        runs = Runs({"rp_controller": opened})
        scenario = load(name)
        errors = [runs.run(scenario, tolerance).error for tolerance in (1e-5, 1e-8, 1e-11)]
    assert all(np.array(errors) <= [1e-6, 1e-8, 1e-10]), errors
