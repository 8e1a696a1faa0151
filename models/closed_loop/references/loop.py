"""Compiled equations of the closed loop, for heyoka's Taylor method.

An effort follows the law or stays at its limit. Where it reaches or leaves the limit is an event,
located to rounding: on both sides of it the equations are smooth.
"""

from collections.abc import Iterable, Mapping

import heyoka as hy
import numpy as np
import sympy as sp
from rparm.models.closed_loop.references import equations
from rparm.models.closed_loop.references.equations import PROGRESS_TERMS, REFERENCES
from rparm.models.rp_manipulator.references.make_references import INPUTS, STATES

from rparm.errors import UserError

SIGNALS = (*REFERENCES, *STATES)  # what the controller reads
INTEGRALS = ("integral1", "integral2")
LIMITS = ("tau1_max", "f2_max")
COEFFICIENTS = ("segment.begin", *(f"segment.c{i}" for i in range(PROGRESS_TERMS)))


class Switch:
    """Puts an effort at its limit or takes it off, by the direction of the crossing."""

    def __init__(self, place: dict[str, int], joint: int, side: float) -> None:
        self.at_limit, self.level = place[f"at_limit{joint}"], place[f"level{joint}"]
        self.bound, self.side = place[f"controller.{LIMITS[joint]}"], side

    def __call__(self, integrator: hy.taylor_adaptive, direction: int) -> bool:
        integrator.pars[self.at_limit] = 1 if direction * self.side > 0 else 0
        integrator.pars[self.level] = self.side * integrator.pars[self.bound]
        return True  # continue


class Loop:
    """Equations of one of `equations.PATHS` and one of `equations.MODES`.

    Runtime values, named like variables, are the components' parameters that are `numbers`; of the
    trajectory between corners ``segment.*``; inputs of a step ``held.*``; ``at_limit*``, 1 where an
    effort is at ``level*``, else 0; and ``back*`` in 1/(kg.m2.s) and 1/(kg.s), how fast the
    integral part gives way there.
    """

    def __init__(self, path: str, mode: str, numbers: Iterable[str], real: type) -> None:
        if real is np.longdouble and np.finfo(real).eps > 2e-19:
            raise UserError("long double is no wider than double here: use another machine")
        self.real = real
        held = [f"held.{name}" for name in (*INPUTS, *SIGNALS)]
        switches = [f"{kind}{joint}" for joint in (0, 1) for kind in ("at_limit", "level", "back")]
        geometry = ("segment.whole_turns", "segment.sign")
        names = [*numbers, *COEFFICIENTS, *geometry, *switches, *held]
        self.place = {name: i for i, name in enumerate(names)}
        self.values = np.zeros(len(names), real)

        known = {sp.Symbol(name): hy.par[i] for name, i in self.place.items()}
        for name in INTEGRALS:  # a variable, though it has a start value
            del known[sp.Symbol(f"controller.{name}")]
        known[equations.time] = hy.time
        arm = {sp.Symbol(name): self._value(f"arm.{name}") for name in equations.PARAMETERS}
        accelerations = [hy.from_sympy(e, arm) for e in equations.ARM.accelerations]
        efforts = [hy.from_sympy(e, known) for e in equations.law(mode)]
        reference = {n: hy.from_sympy(e, known) for n, e in equations.reference(path).items()}
        outputs = [hy.from_sympy(e, arm) for e in equations.ARM.outputs.values()]

        read = [f"controller.{name}" for name in (*SIGNALS, *INTEGRALS)]
        self._reference = hy.cfunc(list(reference.values()), vars=[], fp_type=real)
        self._law = hy.cfunc(efforts, vars=hy.make_vars(*read), fp_type=real)
        self._outputs = hy.cfunc(outputs, vars=hy.make_vars(*STATES, *INPUTS), fp_type=real)

        push = {name: self._value(f"held.{name}") for name in INPUTS}
        self.held_arm = self._integrator(_motion(accelerations, push), [])
        held_signals = {name: self._value(f"held.{name}") for name in SIGNALS}
        action, _, events = self._control(efforts, held_signals)
        self.held_controller = self._integrator(action, events)
        moving = {name: reference[name] for name in REFERENCES}
        moving |= {name: hy.expression(name) for name in STATES}
        action, limited, events = self._control(efforts, moving)
        self.continuous = self._integrator([*_motion(accelerations, limited), *action], events)

    def _value(self, name: str) -> hy.expression:
        return hy.par[self.place[name]]

    def _integrator(self, system: list, events: list) -> hy.taylor_adaptive:
        return hy.taylor_adaptive(
            system,
            np.zeros(len(system), self.real),
            t_events=events,
            compact_mode=True,  # compiles in a second, not in twenty
            fp_type=self.real,
        )

    def _control(
        self, efforts: list[hy.expression], signals: dict[str, hy.expression]
    ) -> tuple[list, dict[str, hy.expression], list]:
        """Return the integral parts with their rates, limited efforts, events at the limits."""
        efforts = hy.subs(efforts, {f"controller.{n}": e for n, e in signals.items()})
        action, limited, events = [], {}, []
        for joint, effort in enumerate(efforts):
            at_limit, level = self._value(f"at_limit{joint}"), self._value(f"level{joint}")
            limited[INPUTS[joint]] = (1.0 - at_limit) * effort + at_limit * level

            error = signals[REFERENCES[joint]] - signals[STATES[joint]]
            excess = at_limit * (level - effort)
            gain, back = self._value(f"controller.Ki{joint + 1}"), self._value(f"back{joint}")
            name = f"controller.{INTEGRALS[joint]}"
            action.append((hy.expression(name), gain * error + back * excess))

            for side in (1.0, -1.0):
                beyond = effort - side * self._value(f"controller.{LIMITS[joint]}")
                switch = Switch(self.place, joint, side)
                events.append(hy.t_event(beyond, callback=switch, fp_type=self.real))
        return action, limited, events

    def set(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.values[self.place[name]] = value

    def get(self, *names: str) -> np.ndarray:
        return np.array([self.values[self.place[name]] for name in names])

    def references(self, times: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
        """Outputs of the trajectory (outputs, n), of the coefficients at every time (n, ...)."""
        values = np.repeat(self.values[:, None], len(times), axis=1)
        values[[self.place[name] for name in COEFFICIENTS]] = coefficients.T
        nothing = np.empty((0, len(times)), self.real)
        return self._reference(
            nothing, pars=values[: self._reference.nparams], time=np.ascontiguousarray(times)
        )

    def unlimited(self, signals: np.ndarray, integrals: np.ndarray) -> np.ndarray:
        """Efforts before the limits, (2,) or (2, n), of signals (10, ...), integrals (2, ...)."""
        return self._evaluate(self._law, np.concatenate((signals, integrals)))

    def limited(self, unlimited: np.ndarray) -> np.ndarray:
        """Return efforts after the limits, in the shape of those before."""
        limits = self.get(*(f"controller.{name}" for name in LIMITS))
        limits = limits.reshape(2, *[1] * (unlimited.ndim - 1))
        return np.clip(unlimited, -limits, limits)

    def outputs(self, states: np.ndarray, efforts: np.ndarray) -> np.ndarray:
        """Return outputs of the arm, (outputs, n)."""
        return self._evaluate(self._outputs, np.concatenate((states, efforts)))

    def _evaluate(self, function, inputs: np.ndarray) -> np.ndarray:
        values = self.values[: function.nparams]
        if inputs.ndim > 1:
            values = np.repeat(values[:, None], inputs.shape[1], axis=1)
        return function(np.ascontiguousarray(inputs), pars=values)

    def switch(self, unlimited: np.ndarray) -> None:
        """Say which efforts are at their limits."""
        for joint, (effort, level) in enumerate(
            zip(unlimited, self.limited(unlimited), strict=True)
        ):
            beyond = abs(effort) > abs(level)
            self.set({f"at_limit{joint}": float(beyond), f"level{joint}": level})

    def begin(
        self, integrator: hy.taylor_adaptive, at: np.floating, state: Iterable[np.floating]
    ) -> None:
        """Start an integrator again, with the present runtime values."""
        integrator.time = at
        integrator.state[:] = state
        integrator.pars[:] = self.values[: len(integrator.pars)]
        if integrator.with_events:
            integrator.reset_cooldowns()

    @staticmethod
    def advance(integrator: hy.taylor_adaptive, until: np.floating) -> np.ndarray:
        """Return the state at the time `until`, with the efforts switched on the way."""
        outcome = integrator.propagate_until(until)[0]
        if outcome != hy.taylor_outcome.time_limit:
            raise UserError(f"the motion blows up near {float(integrator.time)!r} s")
        return integrator.state.copy()


def _motion(
    accelerations: list[hy.expression], efforts: dict[str, hy.expression]
) -> list[tuple[hy.expression, hy.expression]]:
    q1, q2, dq1, dq2 = hy.make_vars(*STATES)
    ddq1, ddq2 = hy.subs(accelerations, efforts)
    return [(q1, dq1), (q2, dq2), (dq1, ddq1), (dq2, ddq2)]
