"""Stability of a mass against the wall when a master steps both: limits of the damping.

A mass m moves along the normal of a wall with stiffness k and damping d and stays in contact. The
master steps mass and wall with the communication step h. The force on the mass changes only at
communication points ("held"), or is a straight line between them ("extrapolated"). So it is late,
which acts as a negative damping; from a damping of the wall on, the motion dies out.
models/rp_environment/stability.md derives what is calculated here.

`order` and `inputs` are those of rparm/systems/master.py. In Gauss-Seidel order with extrapolated
inputs the mass steps first; with held inputs either may.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

State = tuple[float, ...]
Step = Callable[["Contact", float, State], State]

# Held inputs: mean age of the force in steps. Ecos steps in Jacobi order.
AGE = {"jacobi": 3 / 2, "gauss_seidel": 1 / 2}
# Extrapolated inputs: the limit of the damping, in k^2 h^3 / m.
EXTRAPOLATED = {"jacobi": 5 / 4, "gauss_seidel": 1 / 12}

GRID = 400  # dampings that are tried for one that is stable
BISECTIONS = 60


@dataclass(frozen=True)
class Contact:
    """A mass (kg) in contact with the wall: stiffness (N/m) and damping (N.s/m)."""

    mass: float
    stiffness: float
    damping: float = 0.0

    @property
    def period(self) -> float:
        """Period of the undamped vibration, s. The theory holds for steps far below it."""
        return 2 * math.pi * math.sqrt(self.mass / self.stiffness)


def effective_mass(inertia: np.ndarray, direction: np.ndarray) -> float:
    """Mass that an arm opposes to a force at its tip, its joints being free, kg.

    From the mass matrix (n, n) and the velocity of the tip along the normal by each joint velocity,
    the row n^T J (n,).
    """
    return float(1 / (direction @ np.linalg.solve(inertia, direction)))


# ---- Theory --------------------------------------------------------------------------------------


def least_damping(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> float:
    """Damping above which the contact is stable, to leading order in the step, N.s/m.

    The step (s) is small against the period of the contact, whose damping is not used; with held
    inputs neither is its mass.
    """
    if inputs == "held":
        return AGE[order] * step * contact.stiffness
    return EXTRAPOLATED[order] * contact.stiffness**2 * step**3 / contact.mass


def rate_of_growth(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> float:
    """Rate at which a vibration grows, negative if it dies out, to leading order, 1/s."""
    return (least_damping(contact, step, order, inputs) - contact.damping) / (2 * contact.mass)


# ---- The discrete loop, exactly ------------------------------------------------------------------


def _moved(contact: Contact, h: float, x: float, v: float, f: float, df: float) -> State:
    """Position, velocity and acceleration after a step with the force f + df t against x."""
    m = contact.mass
    return (
        x + h * v - (f / 2 + df * h / 6) * h**2 / m,
        v - (f + df * h / 2) * h / m,
        -(f + df * h) / m,
    )


def _force(contact: Contact, x: float, v: float) -> float:
    return contact.stiffness * x + contact.damping * v


def _jacobi_held(contact: Contact, h: float, state: State) -> State:
    # the wall answers with the motion at the beginning of its step
    x, v, f = state
    return *_moved(contact, h, x, v, f, 0.0)[:2], _force(contact, x, v)


def _gauss_seidel_held(contact: Contact, h: float, state: State) -> State:
    x, v = state
    return _moved(contact, h, x, v, _force(contact, x, v), 0.0)[:2]


def _jacobi_extrapolated(contact: Contact, h: float, state: State) -> State:
    # the wall follows lines with the slopes of position and velocity at the beginning of its step
    x, v, a, f, df = state
    answer = _force(contact, x + h * v, v + h * a), _force(contact, v, a)
    return *_moved(contact, h, x, v, f, df), *answer


def _gauss_seidel_extrapolated(contact: Contact, h: float, state: State) -> State:
    x, v, f, df = state
    x, v, a = _moved(contact, h, x, v, f, df)
    return x, v, _force(contact, x, v), _force(contact, v, a)


_STEPS: dict[tuple[str, str], tuple[Step, int]] = {
    ("jacobi", "held"): (_jacobi_held, 3),
    ("gauss_seidel", "held"): (_gauss_seidel_held, 2),
    ("jacobi", "extrapolated"): (_jacobi_extrapolated, 5),
    ("gauss_seidel", "extrapolated"): (_gauss_seidel_extrapolated, 4),
}


def transition(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> np.ndarray:
    """Matrix that leads from one communication point to the next, shape (n, n).

    The state is the deviation from the equilibrium: depth (m) and velocity into the wall (m/s),
    then what the next step still needs of the past. That is the force (N) on the mass in Jacobi
    order, nothing in Gauss-Seidel order; with extrapolated inputs force and slope (N/s), in Jacobi
    order after the acceleration (m/s2).
    """
    function, size = _STEPS[order, inputs]
    return np.array([function(contact, step, tuple(unit)) for unit in np.eye(size).tolist()]).T


def eigenvalues(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> np.ndarray:
    """Eigenvalues of `transition`, the largest first, shape (n,)."""
    found = np.linalg.eigvals(transition(contact, step, order, inputs))
    return found[np.argsort(-np.abs(found))]


def growth(contact: Contact, step: float, order: str = "jacobi", inputs: str = "held") -> float:
    """Factor by which the motion grows in a step in the long run; the contact is stable below 1."""
    return float(abs(eigenvalues(contact, step, order, inputs)[0]))


def exact_least_damping(
    contact: Contact, step: float, order: str = "jacobi", inputs: str = "held"
) -> float:
    """Least damping (N.s/m) from the eigenvalues; ValueError if the step is too long for any."""

    def is_stable(damping: float) -> bool:
        return growth(replace(contact, damping=damping), step, order, inputs) < 1.0

    # in one step, a larger damping reverses the velocity of the free mass and more
    most = 2 * contact.mass / step
    tried = np.linspace(0.0, most, GRID + 1)[1:].tolist()
    high = next((damping for damping in tried if is_stable(damping)), None)
    if high is None:
        raise ValueError(
            f"step = {step!r} s: no damping makes the contact stable, whose period is "
            f"{contact.period!r} s"
        )
    low = high - most / GRID
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (low, middle) if is_stable(middle) else (middle, high)
    return high
