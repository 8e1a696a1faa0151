"""RPController against a sympy model of its laws, whose arm comes from positions.

Values must agree within 1e-12 of the exact ones, relative to the sum of the absolute values of
their terms.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from fmpy.fmi2 import FMU2Model

from tests.support.instances import ERROR, OK, Instance, LoadedFmu, status_of
from tests.support.symbolic import (
    CASES,
    CONTROLLER_KNOWNS,
    EFFORTS,
    LAWS,
    LIMITS,
    PARAMETERS,
    UNKNOWNS,
    Case,
    Values,
    assert_close,
    case_point,
    numbers,
    terms_of_values,
)

UNIT = "RPController"


@contextmanager
def in_initialization_mode(loaded: LoadedFmu, case: Case, point: Values) -> Iterator[Instance]:
    with Instance(loaded) as instance:
        instance.fmi.setInteger([loaded.references["mode"]], [LAWS[case.mode]])
        instance.fmi.setBoolean([loaded.references["payload_attached"]], [case.is_attached])
        yield instance.begin(**point)


# ---- Values and derivatives ----------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_values_are_those_of_the_law(loaded: LoadedFmu, case: Case) -> None:
    for seed in range(5):
        point = case_point(case, seed)
        with in_initialization_mode(loaded, case, point) as instance:
            rows = terms_of_values(case)(*numbers(point, CONTROLLER_KNOWNS))
            for name, actual, row in zip(UNKNOWNS, instance.get(*UNKNOWNS), rows, strict=True):
                assert_close(actual, row, 1e-12, (name, seed))


# ---- With the arm --------------------------------------------------------------------------------


def test_gravity_compensation_holds_the_arm_in_place(
    fmu: Path, loaded: LoadedFmu, tmp_path: Path
) -> None:
    arm_unit = LoadedFmu(fmu, tmp_path)
    measured = ("q1", "q2", "dq1", "dq2")
    with Instance(arm_unit) as arm, Instance(loaded) as controller:
        controller.fmi.setInteger([loaded.references["mode"]], [LAWS["pd_gravity"]])
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
        instance.begin()
        assert status_of(instance.fmi.exitInitializationMode) == ERROR
        text = instance.messages[-1].text
        assert "solver_method = 4 (taylor) is refused: RPController has no Taylor series" in text
        assert all(name in text for name in ("1 (cvode_adams)", "2 (cvode_bdf)", "3 (erk)"))
    with Instance(loaded, kind=FMU2Model) as instance:
        instance.fmi.setInteger(references, [4])
        instance.begin()
        assert status_of(instance.fmi.exitInitializationMode) == OK
        saved = instance.fmi.getFMUstate()
        read = instance.fmi.deSerializeFMUstate(instance.fmi.serializeFMUstate(saved))
        instance.fmi.setFMUstate(read)
        instance.fmi.freeFMUstate(read)
        instance.fmi.freeFMUstate(saved)


def test_mode_changes_between_steps(loaded: LoadedFmu) -> None:
    point = case_point(Case("pd"), 1) | dict.fromkeys(LIMITS, 1e9) | {"Ki1": 0.0, "Ki2": 0.0}
    with in_initialization_mode(loaded, Case("pd"), point) as instance:
        instance.fmi.exitInitializationMode()
        for i, (mode, number) in enumerate(LAWS.items()):
            instance.fmi.setInteger([loaded.references["mode"]], [number])
            rows = terms_of_values(Case(mode))(*numbers(point, CONTROLLER_KNOWNS))
            for name, actual in zip(EFFORTS, instance.get(*EFFORTS), strict=True):
                assert_close(actual, rows[UNKNOWNS.index(name)], 1e-12, (mode, name))
            instance.step(0.1 * i, 0.1)


def test_parameters_of_the_arm_are_the_arms(fmu: Path, loaded: LoadedFmu, tmp_path: Path) -> None:
    arm = {v.name: v for v in LoadedFmu(fmu, tmp_path).description.modelVariables}
    own = {v.name: v for v in loaded.description.modelVariables}
    for name in PARAMETERS:
        for key in ("valueReference", "start", "min"):
            assert getattr(own[name], key) == getattr(arm[name], key), (name, key)
