"""A serialized state with impossible modes is refused, and the instance continues as before."""

import struct
from collections.abc import Iterator

import pytest

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_runs import COMPLIANT, RIGID, last_event, modes, started
from tests.rp_plant.fmu.test_plant_rollback import Run
from tests.support.instances import ERROR, hashed, restore, serialized, status_of

STUCK, FREE, RELEASED = 0, 2, 2
Modes = tuple[int, ...]  # of joint 1, joint 2, payload; contacts of both joints

# sliding forward and backward with friction in both joints, far from stops
SLIDING = {"coulomb_friction1": 1.0, "coulomb_friction2": 1.0, "dq1": 2.0, "dq2": -0.5, "g": 0.0}
SLIDING_MODES = (1, -1, RELEASED)


def field(mode: int) -> bytes:
    """Of 8 bytes, as src/instance/serialization.h writes an int."""
    return struct.pack("<q", mode)


def fields(modes: Modes) -> bytes:
    return b"".join(map(field, modes))


def forged(content: bytes, before: Modes, *after: Modes) -> bytes:
    """Other modes, and the hash that fits; after: now, and at the integrator's restart."""
    parts = content.split(fields(before))
    assert len(parts) == 3
    now, since_restart = (*after, after[-1])[:2]
    return hashed(parts[0] + fields(now) + parts[1] + fields(since_restart) + parts[2])


@pytest.fixture
def moving(plant: Fmu) -> Iterator[Run]:
    """Joints that slide, within the integrator's history."""
    with started(plant, "cvode_adams", **SLIDING) as instance:
        instance.do_step(0.0, 0.01, goes_back=True)
        instance.do_step(0.01, 0.01, goes_back=True)
        assert modes(instance) == SLIDING_MODES[:2] and last_event(instance).count == 0
        yield Run(instance)


def shown(instance: Instance) -> bytes:
    reals = instance.reals(
        [v.name for v in instance.fmu.model.variables.values() if v.type == "Real"]
    )
    reals.get()
    return reals.view.tobytes()


def assert_refused(instance: Instance, content: bytes, text: str) -> None:
    before = shown(instance)
    good = serialized(instance)
    assert status_of(restore, instance, content) == ERROR
    assert text in instance.messages[-1]
    assert shown(instance) == before
    restore(instance, good)  # an error ends with a state that is restored


def test_the_modes_are_where_the_test_looks_for_them(moving: Run) -> None:
    content = serialized(moving.instance)
    assert forged(content, SLIDING_MODES, SLIDING_MODES) == content


@pytest.mark.parametrize(
    "impossible",
    [(3, -1, RELEASED), (1, -2, RELEASED), (-2, 3, RELEASED), (2**31 - 1, -1, RELEASED)]
    + [(1, -1, 0), (1, -1, 3), (1, -1, -1), (-(2**31), -(2**31), -(2**31))],
)
def test_modes_that_do_not_exist_are_refused(moving: Run, impossible: Modes) -> None:
    content = serialized(moving.instance)
    assert_refused(
        moving.instance, forged(content, SLIDING_MODES, impossible), "the modes are impossible"
    )


@pytest.mark.parametrize(
    "impossible", [(FREE, -1, RELEASED), (1, FREE, RELEASED), (STUCK, -1, RELEASED)]
)
def test_modes_that_parameters_or_states_exclude_are_refused(
    moving: Run, impossible: Modes
) -> None:
    """With friction no joint is free, and none is held while it moves."""
    content = serialized(moving.instance)
    text = "the modes since the restart are impossible"
    assert_refused(moving.instance, forged(content, SLIDING_MODES, impossible), text)
    # those of now are not those of the restart
    contradiction = forged(content, SLIDING_MODES, impossible, SLIDING_MODES)
    assert_refused(moving.instance, contradiction, text)


def test_nothing_is_held_without_friction_or_a_closed_stop(plant: Fmu) -> None:
    free, held = (FREE, FREE, RELEASED), (FREE, STUCK, RELEASED)
    stops = {"stops2": RIGID, "lower2": -0.3, "upper2": 0.3}
    with started(plant, "cvode_adams", dq1=1.0, q2=0.1, f2=9.0, **stops) as instance:
        instance.do_step(0.0, 1e-3)
        instance.do_step(1e-3, 1e-3)
        assert modes(instance) == (FREE, FREE)
        content = forged(serialized(instance), free, held)
        assert_refused(instance, content, "the modes since the restart are impossible")


def test_contacts_follow_from_the_state(plant: Fmu) -> None:
    """A joint between its compliant stops is in none of them, and one within is not pulled."""
    stop = {"stops2": COMPLIANT, "upper2": 0.3, "stop_stiffness2": 100.0, "stop_damping2": 1.0}
    for q2, contact, impossible in ((0.1, 0, (1, -1, 3)), (0.4, -1, (0, 1, -2, -3))):
        with started(plant, "cvode_adams", dq1=1.0, q2=q2, g=0.0, **stop) as instance:
            instance.do_step(0.0, 1e-3)
            instance.do_step(1e-3, 1e-3)
            assert modes(instance) == (FREE, FREE)
            content = serialized(instance)
            free = (FREE, FREE, RELEASED, 0)
            assert forged(content, (*free, contact), (*free, contact)) == content
            for other in impossible:
                damaged = forged(content, (*free, contact), (*free, other))
                assert_refused(instance, damaged, " are impossible")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_sums_that_are_not_finite_are_refused(moving: Run, value: float) -> None:
    """The four sums follow the modes and contacts."""
    content = serialized(moving.instance)
    place = content.index(fields(SLIDING_MODES)) + 5 * len(field(0))
    for i in range(4):
        at = place + 8 * i
        damaged = content[:at] + struct.pack("<d", value) + content[at + 8 :]
        assert_refused(moving.instance, hashed(damaged), " is impossible")


def test_the_next_step_is_as_if_nothing_had_been_refused(plant: Fmu) -> None:
    ends = []
    for tries in (True, False):
        with started(plant, "cvode_adams", **SLIDING) as instance:
            instance.do_step(0.0, 0.01, goes_back=True)
            instance.do_step(0.01, 0.01, goes_back=True)
            if tries:
                content = forged(serialized(instance), SLIDING_MODES, (7, 7, 7))
                assert_refused(instance, content, "the modes are impossible")
            instance.do_step(0.02, 0.5, goes_back=True)
            ends.append(shown(instance))
    assert ends[0] == ends[1]
