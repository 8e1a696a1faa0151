"""Rollback through fmpy: saved, serialized and restored states give the same results, bit for bit.

Other processes, phases and failed steps: test_fmi2_serialization.c, test_fmi2_snapshots.c.
"""

import random
from ctypes import byref

import pytest

from rparm.runs import convergence
from tests.fmi2.rollback_sequences import KINDS, START, WHIRL, do, other, run, sequence, times
from tests.support.instances import STATES, Instance, LoadedFmu, restore, serialized
from tests.support.paths import ROOT
from tests.support.rparm_project import declared

SEQUENCES = 100


# ---- Same bytes


@pytest.mark.parametrize("number", range(SEQUENCES))
def test_random_rollback(loaded: LoadedFmu, number: int) -> None:
    """Snapshots and jumps back at random, within an instance and from one to another."""
    chance = random.Random(number)
    kind = KINDS[number % len(KINDS)]
    # now and then the integrator needs more steps than it keeps as its history
    is_long = number % 20 == 0
    moves = sequence(kind, 400 if is_long else chance.randint(5, 40), chance)
    at = times(moves)
    stop = {"stop": at[-1]} if chance.random() < 0.5 else {}
    start = (WHIRL if is_long else START) | stop
    expected = run(loaded, moves, start)
    instance = Instance(loaded)
    saved: list[tuple[int, object]] = []
    packed: list[tuple[int, bytes]] = []
    try:
        instance.initialize(**start)
        position, left = 0, 3 * len(moves) + 20
        while position < len(moves):
            left -= 1
            action = chance.random() if left > 0 else 1.0
            if action < 0.2:
                saved.append((position, instance.fmi.getFMUstate()))
            elif action < 0.3:
                packed.append((position, serialized(instance)))
            elif action < 0.4 and saved:
                position, state = chance.choice(saved)
                instance.fmi.setFMUstate(state)
            elif action < 0.45 and packed:
                position, content = chance.choice(packed)
                if chance.random() < 0.5:
                    instance.fmi.freeInstance()  # with all its snapshots
                    saved.clear()
                    instance = other(loaded, chance)
                restore(instance, content)
            elif action < 0.5 and saved:
                state = saved.pop(chance.randrange(len(saved)))[1]
                instance.fmi.freeFMUstate(state)
            else:
                assert do(instance, at[position], moves[position]) == expected[position]
                position += 1
        assert not instance.messages
        assert not is_long or instance.count("solver_restarts") > 2
    finally:
        instance.fmi.freeInstance()


@pytest.mark.parametrize("kind", KINDS)
def test_rollback_at_every_step_leaves_no_trace(loaded: LoadedFmu, kind: str) -> None:
    """Each step is tried in another way, undone and made: the same bytes as without."""
    chance = random.Random(kind)
    moves, tried = sequence(kind, 300, chance), sequence("mixed", 300, chance)
    with Instance(loaded) as instance:
        instance.initialize(**START)
        state = instance.fmi.getFMUstate()
        for t, move, trial, expected in zip(
            times(moves), moves, tried, run(loaded, moves), strict=False
        ):
            instance.fmi.fmi2GetFMUstate(instance.fmi.component, byref(state))  # same memory
            do(instance, t, trial)
            instance.fmi.setFMUstate(state)
            assert do(instance, t, move) == expected


# ---- A master that needs it


def test_master_with_step_doubling(loaded: LoadedFmu) -> None:
    """A step, undone, and two halves: their difference controls the step, errors go back."""
    problem = convergence.load(
        ROOT / "models/rp_manipulator/convergence/smooth_inputs.toml", declared("rp_manipulator")
    )
    stop, bound = problem.scenario.stop, 1e-5

    def set_inputs(instance: Instance, t: float) -> None:
        values = {name: sines.derivative(t, 0).item() for name, sines in problem.inputs.items()}
        instance.set(**values)
        slopes = {name: [s.derivative(t, 1).item()] for name, s in problem.inputs.items()}
        instance.set_input_derivatives(**slopes)

    accepted: list[tuple[float, float]] = []
    refused = 0
    with Instance(loaded) as instance:
        instance.initialize(0.0, stop, 1e-10, **problem.scenario.initial)
        begin = instance.fmi.getFMUstate()
        t, h = 0.0, 0.5
        while t < stop:
            h = min(h, stop - t)
            instance.fmi.fmi2GetFMUstate(instance.fmi.component, byref(begin))
            set_inputs(instance, t)
            instance.step(t, h)
            coarse = instance.get(*STATES)
            instance.fmi.setFMUstate(begin)
            set_inputs(instance, t)
            middle = instance.step(t, h / 2)
            set_inputs(instance, middle)
            instance.step(middle, t + h - middle)
            fine = instance.get(*STATES)
            error = max(abs(a - b) for a, b in zip(coarse, fine, strict=True))
            if error > bound:
                instance.fmi.setFMUstate(begin)
                refused += 1
                h /= 2
                continue
            accepted += [(t, h / 2), (middle, t + h - middle)]
            t += h
            if error < bound / 10:
                h *= 2
        final, everything = dict(zip(STATES, fine, strict=True)), instance.everything()
    assert refused > 5 and len({h for _, h in accepted}) > 3
    assert problem.final_error(final) < 1e-2  # inputs are linear in a step

    with Instance(loaded) as instance:  # the same steps, none of them undone
        instance.initialize(0.0, stop, 1e-10, **problem.scenario.initial)
        for t, h in accepted:
            set_inputs(instance, t)
            instance.step(t, h)
        assert instance.everything() == everything
