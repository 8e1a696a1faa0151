"""What a linear model cannot see by itself: states that are held, and components that are sampled.

Both are recognized by what an FMU declares and does, not by names: it declares that something
depends on states or inputs, and none of them moves it at the point.
"""

from collections.abc import Callable, Sequence

import numpy as np

from rparm.fmi.model import Model
from rparm.linearization.linear import Linear


def held_states(found: Linear, model: Model) -> list[str]:
    """States that stand still whatever inputs and states do: velocities, and what they move.

    A velocity is held if it and its derivative are 0, and no state or input changes its derivative,
    though the FMU declares that some do. A position is held if only held velocities move it.
    """
    responses = np.hstack([found.A, found.B]) != 0
    is_still = (found.rates == 0) & (found.x == 0) & ~responses.any(axis=1)
    causes = [model.dependencies.get(name, ("anything",)) for name in model.derivatives]
    held = is_still & np.array([bool(some) for some in causes], bool)
    moved_by_held = np.zeros(len(held), bool)
    n = len(found.states)
    if held.any():
        by_others = responses[:, :n][:, ~held].any(axis=1) | responses[:, n:].any(axis=1)
        moved_by_held = responses.any(axis=1) & ~by_others & (found.rates == 0)
    return [name for name, out in zip(found.states, held | moved_by_held, strict=True) if out]


def is_sampled(
    found: Linear,
    model: Model,
    outputs: Sequence[str],
    next_event: Callable[[], float | None],
) -> bool:
    """Whether `outputs` follow inputs only at ticks.

    That is so if all that depend on inputs are discrete, and if no state or input changes one of
    the others now and the FMU announces a time event.
    """
    following = [name for name in outputs if _depends_on_inputs(model, name)]
    rows = [found.outputs.index(name) for name in following if name in found.outputs]
    if not following or not rows:
        return bool(following)
    responds = np.hstack([found.C, found.D])[rows].any(axis=1)
    return not responds.all() and next_event() is not None


def _depends_on_inputs(model: Model, name: str) -> bool:
    causes = model.dependencies.get(name, tuple(model.variables))
    return any(model.variables[cause].causality == "input" for cause in causes)
