"""Solutions of the closed loop: in continuous time, and sampled as a co-simulation steps it.

Both are exact but for rounding in long double. Parameters are named like the system's variables,
``arm.m2``; one that is not given has the start value that the model's FMU declares.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from rparm.models.closed_loop.references import equations
from rparm.models.closed_loop.references.loop import COEFFICIENTS, INTEGRALS, SIGNALS, Loop
from rparm.models.rp_manipulator.references.make_references import INPUTS, STATES

from rparm import project
from rparm.errors import UserError
from rparm.fmi.fmu_file import read_model
from rparm.fmi.model import Value, Variable

MODELS = Path(__file__).resolve().parents[2]
COMPONENTS = {"trajectory": "rp_trajectory", "controller": "rp_controller", "arm": "rp_manipulator"}
ORDERS = ("jacobi", "gauss_seidel", "gauss_seidel_arm_first")
READ = ("before", "after")
ERRORS = ("q1_error", "q2_error", "dq1_error", "dq2_error")
COLUMNS = (
    *(f"trajectory.{name}" for name in (*equations.REFERENCES, *equations.PATH)),
    *(f"controller.{name}" for name in (*INPUTS, *ERRORS)),
    *(f"arm.{name}" for name in equations.ARM.outputs),
    *(f"controller.{name}" for name in INTEGRALS),
)
STATE = (*(f"arm.{name}" for name in STATES), *(f"controller.{name}" for name in INTEGRALS))

Parameters = Mapping[str, Value]
Columns = dict[str, np.ndarray]


def monolithic(
    parameters: Parameters,
    times: Sequence[float],
    state: Sequence[float] | None = None,
    real: type = np.longdouble,
) -> Columns:
    """Return `COLUMNS` (times,) of the closed loop in continuous time, in `real`.

    The motion begins at the first of `times` (s) with the start values or `state`: q1, q2, dq1,
    dq2, integral1, integral2.
    """
    loop, segments, start = prepare(parameters, real)
    times = _ascending(times, real)
    now, present = times[0], np.array(start if state is None else state, real)
    states = np.empty((len(STATE), len(times)), real)
    states[:, 0] = present
    row = 1
    for segment, end in zip(segments, [*segments[1:, 0], real(np.inf)], strict=True):
        if end <= now or row == len(times):
            continue
        loop.set(dict(zip(COEFFICIENTS, segment, strict=True)))
        reference = loop.references(now[None], segment[None])[:6, 0]
        loop.switch(loop.unlimited(np.concatenate((reference, present[:4])), present[4:]))
        loop.begin(loop.continuous, now, present)
        while row < len(times) and times[row] <= end:
            states[:, row] = loop.advance(loop.continuous, times[row])
            row += 1
        if row < len(times):
            now, present = end, loop.advance(loop.continuous, end)

    references = loop.references(times, _at(times, segments))
    signals = np.concatenate((references[:6], states[:4]))
    efforts = loop.limited(loop.unlimited(signals, states[4:]))
    return _columns(loop, references, signals, efforts, states, efforts)


def sampled(
    parameters: Parameters,
    times: Sequence[float],
    state: Sequence[float] | None = None,
    order: str = "jacobi",
    read: str = "before",
    real: type = np.longdouble,
) -> Columns:
    """Step the closed loop with held inputs, each component solved exactly; as `monolithic`.

    At the first point everything is consistent. Every step leads to the next of `times` with the
    inputs that were given; then inputs are set from that point's outputs. Order ``jacobi``: all
    components step with the outputs of the point before; ``gauss_seidel``: trajectory, controller
    and arm, each with the newest outputs; ``gauss_seidel_arm_first``: trajectory, arm, controller.
    Values are read ``before`` the inputs are set, with the inputs of the step, or ``after``.
    """
    for what, value, items in (("order", order, ORDERS), ("read", read, READ)):
        if value not in items:
            raise UserError(f"{what}: no {value!r} (known: {', '.join(items)})")
    loop, segments, start = prepare(parameters, real)
    times = _ascending(times, real)
    references = loop.references(times, _at(times, segments))
    states = np.empty((len(STATE), len(times)), real)
    states[:, 0] = start if state is None else state
    signals = np.empty((len(SIGNALS), len(times)), real)  # inputs that the controller last read
    signals[:, 0] = np.concatenate((references[:6, 0], states[:4, 0]))
    commands = np.empty((2, len(times)), real)  # efforts that the controller last gave
    commands[:, 0] = loop.limited(loop.unlimited(signals[:, 0], states[4:, 0]))
    efforts = commands.copy()  # efforts that moved the arm to this point
    arm_last, arm_first = order == "gauss_seidel", order == "gauss_seidel_arm_first"
    for i in range(len(times) - 1):
        step = times[i : i + 2]
        if not arm_last:
            efforts[:, i + 1] = commands[:, i]
            states[:4, i + 1] = _held_arm(loop, efforts[:, i + 1], states[:4, i], step)
        reference = references[:6, i if order == "jacobi" else i + 1]
        measured = states[:4, i + 1 if arm_first else i]
        signals[:, i + 1] = np.concatenate((reference, measured))
        states[4:, i + 1] = _held_controller(loop, signals[:, i + 1], states[4:, i], step)
        commands[:, i + 1] = loop.limited(loop.unlimited(signals[:, i + 1], states[4:, i + 1]))
        if arm_last:
            efforts[:, i + 1] = commands[:, i + 1]
            states[:4, i + 1] = _held_arm(loop, efforts[:, i + 1], states[:4, i], step)
    if read == "after":
        signals, efforts = np.concatenate((references[:6], states[:4])), commands
        commands = loop.limited(loop.unlimited(signals, states[4:]))
    return _columns(loop, references, signals, commands, states, efforts)


def reference_motion(
    parameters: Parameters, times: Sequence[float], real: type = np.longdouble
) -> Columns:
    """Outputs of the trajectory by name, (times,), with parameters by the names of its FMU."""
    known = _declared()
    own = {f"trajectory.{name}": value for name, value in parameters.items()}
    loop, segments, _ = prepare({n: v for n, v in own.items() if n in known}, real)
    times = _ascending(times, real)
    names = (*equations.REFERENCES, *equations.PATH)
    return dict(zip(names, loop.references(times, _at(times, segments)), strict=True))


def prepare(parameters: Parameters, real: type) -> tuple[Loop, np.ndarray, np.ndarray]:
    """Return equations, segments (segments, 8: begin, the progress' coefficients) and start."""
    values = _complete(parameters)
    number = {name: real(v) for name, v in values.items() if not isinstance(v, str)}
    motion, mode = values["trajectory.motion"], values["controller.mode"]
    path = motion
    if motion == "circle":
        center = np.hypot(number["trajectory.x_center"], number["trajectory.y_center"])
        path = "circle_around" if center < number["trajectory.radius"] else "circle_aside"
    loop = _loop(path, mode, tuple(number), real)
    loop.values[:] = 0
    loop.set(number)
    for joint in (0, 1):
        inertia = number[f"controller.inertia{joint + 1}"]
        back = 1 / (inertia * number["controller.tracking_time"])
        loop.set({f"back{joint}": back if number[f"controller.Ki{joint + 1}"] > 0 else 0})

    segments = _segments(motion, number, real)
    loop.set({"segment.sign": -1 if values["trajectory.branch"] == "backward" else 1})
    if motion != "point_to_point":  # whose first angle is a parameter
        first = loop.references(segments[:1, 0], segments[:1])[0, 0]
        turn = 8 * np.arctan(real(1))
        loop.set({"segment.whole_turns": -np.ceil((first - turn / 2) / turn)})
    return loop, segments, np.array([number[name] for name in STATE])


_loop = cache(Loop)


@cache
def _declared() -> dict[str, Variable]:
    """Return parameters of the components, and the states, as the FMUs declare them."""
    return {
        f"{component}.{name}": variable
        for component, folder in COMPONENTS.items()
        for name, variable in read_model(project.built(MODELS / folder, ".fmu")).variables.items()
        if variable.causality == "parameter" or f"{component}.{name}" in STATE
    }


def _complete(parameters: Parameters) -> dict[str, Value]:
    """Return all parameters; items of enumerations, which may be given as numbers too, by name."""
    declared = _declared()
    unknown = [name for name in parameters if name not in declared]
    if unknown:
        raise UserError(f"the closed loop has no parameter {unknown[0]!r}")
    values = {}
    for name, variable in declared.items():
        value = parameters.get(name, variable.start)
        if variable.type == "Enumeration":
            items = {number: item for item, number in variable.items.items()}
            value = items.get(value, value)
            if value not in items.values():
                raise UserError(f"{name}: no {value!r} (known: {', '.join(items.values())})")
        elif isinstance(value, str) or not np.isfinite(value):
            raise UserError(f"{name}: {value!r} is no finite number")
        values[name] = value
    return values


def _segments(motion: str, number: Mapping[str, np.floating], real: type) -> np.ndarray:
    """Return segments of the trajectory: hold, move, hold; a circle is blended in and out."""
    begin = number["trajectory.start_time"]
    if motion != "circle":
        whole = number["trajectory.duration"]
        blend = [0, 0, 0, 10 / whole**3, -15 / whole**4, 6 / whole**5, 0]
        rows = [[begin, *blend], [begin + whole, 1, *[0] * 6]]
    else:
        ramp = number["trajectory.ramp_time"]
        moved = number["trajectory.turns"] / abs(number["trajectory.frequency"])
        # integral of s over the ramp; the integral of 1 - s begins and ends like it
        blend = np.array([0, 0, 0, 0, 2.5, -3, 1], real) / ramp ** np.arange(-1, 6)
        line = np.array([0, 1, 0, 0, 0, 0, 0], real)
        offset = np.array([1, 0, 0, 0, 0, 0, 0], real)
        rows = [
            [begin, *blend],
            [begin + ramp, *(line + offset * ramp / 2)],
            [begin + moved, *(line - blend + offset * (moved - ramp / 2))],
            [begin + moved + ramp, *(offset * moved)],
        ]
    return np.array([[begin, *[0] * 7], *rows], real)


def _at(times: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Return coefficients of the segment that every time is in, (times, 8)."""
    return segments[np.searchsorted(segments[1:, 0], times, side="right")]


def _ascending(times: Sequence[float], real: type) -> np.ndarray:
    times = np.asarray(times, real)
    if times.ndim != 1 or len(times) == 0 or np.any(np.diff(times) <= 0):
        raise UserError("times must ascend")
    return times


def _held_controller(
    loop: Loop, signals: np.ndarray, integrals: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """Return the integral parts at the end of a step with held inputs."""
    if not loop.get("controller.Ki1", "controller.Ki2").any():
        return integrals
    loop.set({f"held.{n}": value for n, value in zip(SIGNALS, signals, strict=True)})
    loop.switch(loop.unlimited(signals, integrals))
    loop.begin(loop.held_controller, step[0], integrals)
    return loop.advance(loop.held_controller, step[1])


def _held_arm(loop: Loop, efforts: np.ndarray, state: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return the state of the arm at the end of a step with held efforts."""
    loop.set({f"held.{n}": value for n, value in zip(INPUTS, efforts, strict=True)})
    loop.begin(loop.held_arm, step[0], state)
    return loop.advance(loop.held_arm, step[1])


def _columns(
    loop: Loop,
    references: np.ndarray,
    signals: np.ndarray,
    commands: np.ndarray,
    states: np.ndarray,
    efforts: np.ndarray,
) -> Columns:
    errors = signals[:4] - signals[6:]
    rows = (*references, *commands, *errors, *loop.outputs(states[:4], efforts), *states[4:])
    return dict(zip(COLUMNS, rows, strict=True))
