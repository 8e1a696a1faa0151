"""The plant's equations compiled by heyoka in long double, with terminal events.

Which joints are held and which are in a compliant stop is constant between two events; each
combination has its integrator. What else is constant there is a number at its place in `NUMBERS`.
"""

from collections.abc import Sequence

import heyoka as hy
import numpy as np
import sympy as sp
from rparm.models.rp_plant.references import contacts, equations
from rparm.models.rp_plant.references.automaton import real
from rparm.models.rp_plant.references.equations import INPUTS, PARAMETERS, STATES, SWITCHES

from rparm.errors import UserError

LIMITS = ("lower1", "lower2", "upper1", "upper2")
RATES = tuple(f"rate_{name}" for name in INPUTS)
# 1: the indicator counts, 0: it is 1
WATCHED = tuple(
    f"watch_{what}{i}" for what in ("forward", "backward", "lower", "upper") for i in (1, 2)
)
NUMBERS = (
    *(*PARAMETERS, *INPUTS, *RATES, *SWITCHES, *LIMITS, *WATCHED),
    *(*contacts.PARAMETERS, "watch_push1", "watch_push2"),
)
PLACE = {name: i for i, name in enumerate(NUMBERS)}
LAST = hy.par[len(NUMBERS) - 1]  # evaluated too, so that all functions take all numbers
# s, from an event to the next of its kind: heyoka's own may be seconds. Cooldowns are never reset:
# after an impact the indicator of the stop is 0, and heyoka would find the same event again.
COOLDOWN = real(1e-10)


class Solver:
    """Compiled equations, for any number of motions."""

    def __init__(self) -> None:
        if np.finfo(real).eps > 2e-19:
            raise UserError("long double is no wider than double here: run this elsewhere")
        self._equations = equations.derive()
        self._states = hy.make_vars(*STATES)
        e = self._equations
        D = e.inertia
        self._blocks = self._compiled(
            [D[0, 0], D[0, 1], D[1, 1], *e.forces, *e.friction, *e.breakaway], self._states
        )
        self._outputs = self._compiled(
            list(e.outputs.values()), (*self._states, *hy.make_vars(*equations.ACCELERATIONS))
        )
        self.output_names = list(e.outputs)
        self._integrators: dict[tuple, tuple[hy.taylor_adaptive_ldbl, list]] = {}

    def _numbers(self, with_time: bool) -> dict[sp.Symbol, hy.expression]:
        """Parameters at their places; inputs are linear in time."""
        found = {sp.Symbol(name): hy.par[i] for name, i in PLACE.items()}
        if with_time:
            for name, rate in zip(INPUTS, RATES, strict=True):
                found[sp.Symbol(name)] = hy.par[PLACE[name]] + hy.par[PLACE[rate]] * hy.time
        return found

    def _compiled(self, expressions: Sequence[sp.Expr], variables: Sequence) -> hy.cfunc_ldbl:
        numbers = self._numbers(False)
        converted = [hy.from_sympy(sp.sympify(x), numbers) for x in expressions]
        return hy.cfunc([*converted, LAST], vars=list(variables), fp_type=real)

    def integrator(
        self, held: tuple[bool, bool], contact: tuple[int, int]
    ) -> tuple[hy.taylor_adaptive_ldbl, list]:
        """Integrator of held joints and contacts, and (what, joint) of each event."""
        if (held, contact) not in self._integrators:
            self._integrators[held, contact] = self._make(held, contact)
        return self._integrators[held, contact]

    def _make(
        self, held: tuple[bool, bool], contact: tuple[int, int]
    ) -> tuple[hy.taylor_adaptive_ldbl, list]:
        e = self._equations
        forces = e.forces + sp.Matrix([contacts.force(i + 1, contact[i]) for i in (0, 1)])
        D, b = e.inertia, forces - e.friction
        if held == (False, False):
            determinant = D[0, 0] * D[1, 1] - D[0, 1] ** 2
            ddq = [
                (D[1, 1] * b[0] - D[0, 1] * b[1]) / determinant,
                (D[0, 0] * b[1] - D[0, 1] * b[0]) / determinant,
            ]
        else:
            ddq = [sp.Integer(0) if held[i] else b[i] / D[i, i] for i in (0, 1)]
        q, dq = sp.symbols(STATES[:2]), sp.symbols(STATES[2:])
        indicators, names = [], []

        def add(what: str, joint: int, expression: sp.Expr) -> None:
            watch = sp.Symbol(f"watch_{what}{joint + 1}")
            indicators.append(watch * expression + (1 - watch))
            names.append((what, joint))

        for i in (0, 1):
            if held[i]:
                reaction = forces[i] - D[i, 1 - i] * ddq[1 - i]
                add("forward", i, e.breakaway[i] - reaction)
                add("backward", i, e.breakaway[i] + reaction)
            else:
                add("forward", i, sp.Symbol(f"direction{i + 1}") * dq[i])
                inside = contacts.penetration(i + 1, contact[i])
                lower = q[i] - sp.Symbol(f"lower{i + 1}")
                upper = sp.Symbol(f"upper{i + 1}") - q[i]
                add("lower", i, inside if contact[i] > 0 else lower)
                add("upper", i, inside if contact[i] < 0 else upper)
                if contact[i] != 0:
                    sign = 1 if abs(contact[i]) == contacts.PUSHES else -1
                    add("push", i, sign * contacts.push(i + 1, contact[i]))
        numbers = self._numbers(True)
        rates = [*(sp.Integer(0) if held[i] else dq[i] for i in (0, 1)), *ddq]
        right = [hy.from_sympy(sp.sympify(x), numbers) for x in rates]
        converted = [hy.from_sympy(x, numbers) for x in indicators]
        events = [
            hy.t_event(x, direction=hy.event_direction.negative, cooldown=COOLDOWN, fp_type=real)
            for x in converted
        ]
        taylor = hy.taylor_adaptive(
            list(zip(self._states, right, strict=True)),
            np.zeros(4, real),
            t_events=events,
            compact_mode=True,
            fp_type=real,
        )
        evaluate = hy.cfunc([*converted, LAST], vars=list(self._states), fp_type=real)
        return taylor, [names, evaluate]

    def blocks(self, state: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, ...]:
        """D (2, 2), b, friction of sliding joints and breakaway friction (2,) each."""
        found = self._blocks(state, pars=numbers)
        inertia = np.array([[found[0], found[1]], [found[1], found[2]]])
        return inertia, found[3:5], found[5:7], found[7:9]

    def outputs(self, state: np.ndarray, ddq: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """`output_names` at a state."""
        return self._outputs(np.concatenate((state, ddq)), pars=numbers)[:-1]
