"""A, B, C and D of FMUs against exact ones, at random points: all versions and kinds of FMI.

tests/models/test_every_model.c has those of the arm.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from rparm.fmi.fmu_file import CO_SIMULATION, MODEL_EXCHANGE, Fmu
from rparm.linearization.linear import FmuSubject, Linear
from tests.support import symbolic
from tests.support.symbolic import ExactModel

BOUND = 1e-12  # of the largest entry of a matrix
POINTS = 25
CASES = {
    "drives": ("RPActuator", symbolic.drives_point),
    "controller": ("RPController", symbolic.controller_point),
} | {
    f"plant, {mode}": ("RPPlant", partial(symbolic.plant_point, mode))
    for mode in symbolic.PLANT_MODES
}


@pytest.fixture(scope="module")
def points() -> Callable[[str], list[ExactModel]]:
    """The exact models of a case, made once."""
    made: dict[str, list[ExactModel]] = {}

    def of(case: str) -> list[ExactModel]:
        if case not in made:
            made[case] = [CASES[case][1](seed) for seed in range(POINTS)]
        return made[case]

    return of


@pytest.fixture(scope="module")
def subjects(fmu: Path) -> Iterator[Callable[[str, str, str], FmuSubject]]:
    """FMUs to linearize by name, version and kind."""
    with ExitStack() as stack:
        made: dict[tuple[str, str, str], FmuSubject] = {}

        def of(name: str, version: str, kind: str) -> FmuSubject:
            key = name, version, kind
            if key not in made:
                folder = fmu.parent if version == "2.0" else fmu.parent / "fmi3"
                opened = stack.enter_context(Fmu(folder / f"{name}.fmu", kind=kind))
                made[key] = stack.enter_context(FmuSubject(opened))
            return made[key]

        yield of


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("case", CASES)
def test_matrices_are_exact(
    subjects: Callable, points: Callable, case: str, version: str, kind: str
) -> None:
    subject = subjects(CASES[case][0], version, kind)
    for exact in points(case):
        found = subject.at(exact.values)
        n, m = len(found.states), len(exact.knowns) - len(found.states)
        assert exact.knowns[:n] == found.states and exact.knowns[n:] == found.inputs[:m]
        rows = [found.outputs.index(name) for name in exact.outputs]
        for matrix, expected in (
            (found.A, exact.entries[:n, :n]),
            (found.B, exact.entries[:n, n:]),
            (found.C[rows], exact.entries[n:, :n]),
            (found.D[rows], exact.entries[n:, n:]),
        ):
            largest = np.abs(expected).max(initial=0.0)
            assert np.abs(matrix - expected).max(initial=0.0) <= BOUND * largest


HELD = {
    "sliding": (), "held 1": ("q1", "dq1"), "held 2": ("q2", "dq2"), "rigid stop": ("q2", "dq2"),
    "both held": ("q1", "q2", "dq1", "dq2"), "compliant stops": (),
}  # fmt: skip


@pytest.mark.parametrize("mode", HELD)
def test_held_states_are_named_and_dropped(subjects: Callable, points: Callable, mode: str) -> None:
    subject = subjects("RPPlant", "2.0", CO_SIMULATION)
    for exact in points(f"plant, {mode}"):
        found = subject.at(exact.values)
        held = subject.held(found)
        assert set(held) == set(HELD[mode])
        kept: Linear = found.without(held)
        assert kept.states == tuple(name for name in found.states if name not in held)
        assert set(kept.held) == set(HELD[mode])
        # of a joint whose partner is held: no false poles at 0 but those of free fall
        assert len(kept.poles) == 4 - len(held)


def test_a_moving_joint_at_the_moment_of_no_motion_is_not_held(subjects: Callable) -> None:
    """Without friction a joint in equilibrium stands still, but efforts move it."""
    subject = subjects("RPPlant", "2.0", MODEL_EXCHANGE)
    assert subject.held(subject.at({"g": 0.0})) == []
