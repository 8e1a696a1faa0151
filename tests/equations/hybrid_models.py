"""Models with impacts, made at random: a seed gives a model that the event loop can follow.

Each limit is a distance that may depend on states and time. An impact reflects the velocity along
the distance's gradient, relative to the limit's motion, so that no limit may ever be passed.
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from tests.equations.event_loop import EventLoop, Motion

STOP = 3.0  # s
STEPS = ((0.003, 0.01), (0.003, 0.06), (0.01, 0.06), (0.01, 0.2), (0.0125, 0.1))  # s
SHORTEST = 0.4  # s: horizon of a model that is worth a test
FORMS = {  # how a file may say that the left side is below the right one
    "plain": "{l} {less} {r}",
    "swapped": "{r} {more} {l}",
    "difference": "{l} - ({r}) {less} 0",
    "zero first": "0 {more} {l} - ({r})",
    "offset": "{l} - ({r}) + {big} {less} {big}",
    "scaled": "-3 * ({l} - ({r})) {more} 0",
}


@dataclass(frozen=True)
class Polynomial:
    """An input: value, first and second derivative at time 0."""

    value: float
    first: float
    second: float

    def at(self, t: float) -> tuple[float, float, float]:
        """Value and derivatives at a time (s)."""
        value = self.value + self.first * t + self.second * t**2 / 2
        return value, self.first + self.second * t, self.second

    @property
    def text(self) -> str:
        return f"{self.value!r} + {self.first!r} * time + {self.second!r} * time**2 / 2"


@dataclass
class Limit:
    """The left side must not fall below the right one; both are expressions."""

    left: str
    right: str
    gradient: dict[str, str]  # of left - right, by positions
    rate: str = "0"  # derivative of left - right by the time, at fixed positions
    back: dict[str, str] = field(default_factory=dict)  # what puts positions on the limit
    power: int = 1  # of lengths in the distance


@dataclass
class Hybrid:
    """A model in parts, and the motion that it has."""

    kind: str
    seed: int
    unit: float  # of all lengths
    states: dict[str, tuple[float, str]]  # start, derivative
    velocities: dict[str, str]  # by positions
    limits: list[Limit]
    restitution: float = 1.0
    puts_back: bool = True
    form: str = "plain"
    includes_zero: bool = False
    has_nominal: bool = False
    inputs: dict[str, Polynomial] = field(default_factory=dict)
    steps: tuple[float, float] = STEPS[0]
    motion: Motion | None = None

    def text(self, form: str | None = None) -> str:
        """The file."""
        lines = [f'name = "Hybrid{self.seed}"', "[inputs]"]
        lines += [f"{name} = {{}}" for name in self.inputs]
        lines += ["[states]"]
        nominal = f", nominal = {self.unit!r}" if self.has_nominal else ""
        for name, (start, derivative) in self.states.items():
            lines.append(f'{name} = {{ start = {start!r}, derivative = "{derivative}"{nominal} }}')
        for k, limit in enumerate(self.limits):
            lines += [f"[events.limit{k}]", f'when = "{self._when(limit, form or self.form)}"']
            pairs = ", ".join(f'{n} = "{e}"' for n, e in self._reinit(limit).items())
            lines.append(f"reinit = {{ {pairs} }}")
        return "\n".join(lines) + "\n"

    def _when(self, limit: Limit, form: str) -> str:
        equal = "=" * self.includes_zero
        return FORMS[form].format(
            l=limit.left, r=limit.right, less=f"<{equal}", more=f">{equal}",
            big=repr(1e6 * self.unit**limit.power),
        )  # fmt: skip

    def _reinit(self, limit: Limit) -> dict[str, str]:
        parts = [f"({n}) * {self.velocities[q]}" for q, n in limit.gradient.items()]
        approach = " + ".join([*parts, f"({limit.rate})"])
        square = " + ".join(f"({n})**2" for n in limit.gradient.values())
        found = dict(limit.back) if self.puts_back else {}
        for position, n in limit.gradient.items():
            v, factor = self.velocities[position], repr(1.0 + self.restitution)
            found[v] = f"{v} - {factor} * ({approach}) / ({square}) * ({n})"
        return found

    def loop(self) -> EventLoop:
        """The event loop of the model."""
        units = {f"limit{k}": self.unit**limit.power for k, limit in enumerate(self.limits)}
        inputs = {name: polynomial.text for name, polynomial in self.inputs.items()}
        return EventLoop(self.text("plain"), self.unit, inputs, units)


class Maker:
    """Makes parts of a model by chance."""

    def __init__(self, chance: random.Random, unit: float) -> None:
        self.chance, self.unit = chance, unit

    def number(self, low: float, high: float, unit: float = 1.0) -> str:
        """A number of four digits; negative ones in brackets."""
        value = float(f"{self.chance.uniform(low, high):.4g}") * unit
        return f"({value!r})" if value < 0 else repr(value)

    def length(self, low: float, high: float) -> str:
        return self.number(low, high, self.unit)

    def start(self, low: float, high: float) -> float:
        return float(f"{self.chance.uniform(low, high):.3g}") * self.unit

    def acceleration(self, q: str, v: str, weight: float, least: int = 0) -> str:
        """Constant, linear, damped, by a sine, forced in time; the first is left out if asked."""
        g = f"-{self.length(0.6 * weight, 1.4 * weight)}" if weight else "0"
        kind = self.chance.randrange(least, 5)
        if kind == 1:
            return f"{g} - {self.number(1, 30)} * {q}"
        if kind == 2:
            return f"{g} - {self.number(0.05, 0.8)} * {v}"
        if kind == 3:
            return f"{g} - {self.length(1, 15)} * sin({q} / {self.unit!r})"
        if kind == 4:
            return f"{g} + {self.length(0.5, 4)} * sin({self.number(1, 12)} * time)"
        return g

    def fall(self) -> dict[str, tuple[float, str]]:
        """A ball above a floor."""
        weight = self.chance.choice((4.0, 9.81))
        return {
            "h": (self.start(0.3, 1.2), "v"),
            "v": (self.start(-1.0, 1.0), self.acceleration("h", "v", weight)),
        }

    def plane(self, x: tuple[float, float], weight: float) -> dict[str, tuple[float, str]]:
        """A particle in the plane, above."""
        least = 0 if weight else 1
        ax = self.acceleration("x", "vx", 0.0, self.chance.choice((0, 1)))
        ay = self.acceleration("y", "vy", weight, least)
        if self.chance.random() < 0.2:  # a magnetic field
            b = self.number(-2, 2)
            ax, ay = f"{ax} + {b} * vy", f"{ay} - {b} * vx"
        return {
            "x": (self.start(*x), "vx"),
            "y": (self.start(0.3, 1.0), "vy"),
            "vx": (self.start(-1.0, 1.0), ax),
            "vy": (self.start(-1.0, 1.0), ay),
        }


Parts = tuple[dict, list[Limit], dict[str, str]]  # states, limits, inputs
PLANE = {"x": "vx", "y": "vy"}


def plain(m: Maker) -> Parts:
    floor = m.length(-0.2, 0.1) if m.chance.random() < 0.5 else "0"
    return m.fall(), [Limit("h", floor, {"h": "1"}, back={"h": floor})], {}


def moving_floor(m: Maker, floor: str, rate: str) -> Limit:
    return Limit("h", floor, {"h": "1"}, f"-({rate})", {"h": floor})


def ramp_of_time(m: Maker) -> Parts:
    rate = m.length(-0.5, 0.5)
    return m.fall(), [moving_floor(m, f"{m.length(-0.2, 0.1)} + {rate} * time", rate)], {}


def ramp_of_state(m: Maker) -> Parts:
    rate = m.length(-0.5, 0.5)
    states = m.fall() | {"f": (m.start(-0.2, 0.1), rate)}
    return states, [moving_floor(m, "f", rate)], {}


def ramp_of_input(m: Maker) -> Parts:
    floor = Polynomial(m.start(-0.2, 0.1), m.start(-0.4, 0.4), m.start(-0.3, 0.3))
    rate = f"{floor.first!r} + {floor.second!r} * time"
    return m.fall(), [moving_floor(m, "f", rate)], {"f": floor}


def sine(m: Maker) -> tuple[str, str, str]:
    """Size, frequency and phase of a floor that swings."""
    w = m.number(3.0, 40.0)
    return m.length(0.1 / float(w), 2.0 / float(w)), w, m.number(0.0, 6.0)


def sine_of_time(m: Maker) -> Parts:
    a, w, p = sine(m)
    floor, rate = f"{a} * sin({w} * time + {p})", f"{a} * {w} * cos({w} * time + {p})"
    return m.fall(), [moving_floor(m, floor, rate)], {}


def sine_of_states(m: Maker) -> Parts:
    a, w, p = sine(m)
    sin, cos = (float(a) * f(float(p)) for f in (math.sin, math.cos))
    states = m.fall() | {"s": (sin, f"{w} * c"), "c": (cos, f"-{w} * s")}
    return states, [moving_floor(m, "s", f"{w} * c")], {}


def slope(m: Maker) -> Parts:
    a, b = m.number(-0.7, 0.7), m.length(-0.4, -0.1)
    floor = f"{a} * x + {b}"
    limit = Limit("y", floor, {"x": f"-{a}", "y": "1"}, back={"y": floor})
    return m.plane((-0.3, 0.3), 9.81), [limit], {}


def moving_slope(m: Maker) -> Parts:
    a, b, w = m.number(-0.6, 0.6), m.length(0.02, 0.1), m.number(3, 12)
    floor = f"{a} * x + {b} * sin({w} * time) - {m.length(0.1, 0.4)}"
    rate = f"-{b} * {w} * cos({w} * time)"
    limit = Limit("y", floor, {"x": f"-{a}", "y": "1"}, rate, {"y": floor})
    return m.plane((-0.3, 0.3), 9.81), [limit], {}


def inside_a_circle(m: Maker) -> Parts:
    r, radius = m.length(1.0, 1.6), ""
    rate = "0"
    if m.chance.random() < 0.4:
        b, w = m.length(0.02, 0.1), m.number(3, 10)
        radius, rate = f"({r} + {b} * sin({w} * time))", f"{b} * {w} * cos({w} * time)"
    radius = radius or r
    back = {q: f"{q} * {radius} / sqrt(x**2 + y**2)" for q in PLANE}
    limit = Limit(
        f"{radius}**2", "x**2 + y**2", {q: f"-2 * {q}" for q in PLANE},
        f"2 * {radius} * {rate}", back, 2,
    )  # fmt: skip
    return m.plane((-0.4, 0.4), m.chance.choice((0.0, 9.81))), [limit], {}


def outside_a_circle(m: Maker) -> Parts:
    r = m.length(0.2, 0.4)
    back = {q: f"{q} * {r} / sqrt(x**2 + y**2)" for q in PLANE}
    limit = Limit("x**2 + y**2", f"{r}**2", {q: f"2 * {q}" for q in PLANE}, "0", back, 2)
    states = m.plane((-0.4, 0.4), 0.0)
    for v, q in (("vx", "x"), ("vy", "y")):
        states[v] = (states[v][0], f"-{m.number(5, 30)} * {q}")
    return states, [limit], {}


def parabola(m: Maker) -> Parts:
    a, b = m.number(0.2, 1.5, 1 / m.unit), m.length(0.1, 0.5)
    floor = f"{a} * x**2 - {b}"
    limit = Limit("y", floor, {"x": f"-2 * {a} * x", "y": "1"}, back={"y": floor})
    return m.plane((-0.3, 0.3), 9.81), [limit], {}


def wave(m: Maker) -> Parts:
    a, k = m.length(0.02, 0.2), m.number(1.0, 6.0, 1 / m.unit)
    floor = f"{a} * sin({k} * x)"
    limit = Limit("y", floor, {"x": f"-{a} * {k} * cos({k} * x)", "y": "1"}, back={"y": floor})
    return m.plane((-0.3, 0.3), 9.81), [limit], {}


def two_balls(m: Maker) -> Parts:
    """One above another that hangs on a spring, or that bounces on the floor."""
    limits = [Limit("a", "b", {"a": "1", "b": "-1"}, back={"a": "b"})]
    weight = m.length(4, 9.81)
    on_spring = m.chance.random() < 0.5
    lower = f"-{m.number(20, 100)} * b" if on_spring else f"-{weight}"
    if not on_spring:
        limits.append(Limit("b", "0", {"b": "1"}, back={"b": "0"}))
    states = {
        "a": (m.start(1.0, 1.5), "va"),
        "b": (m.start(0.2, 0.6), "vb"),
        "va": (m.start(-0.5, 0.5), f"-{weight}"),
        "vb": (m.start(-0.5, 0.5), lower),
    }
    return states, limits, {}


def pendulum(m: Maker) -> Parts:
    """It hits a wall: a limit of the sine of its angle."""
    wall = m.number(-0.6, 0.1)
    scaled = f"sin(h / {m.unit!r})"
    limit = Limit(
        f"{m.unit!r} * {scaled}", f"{wall} * {m.unit!r}", {"h": f"cos(h / {m.unit!r})"},
        back={"h": f"{m.unit!r} * asin({wall})"},
    )  # fmt: skip
    states = {
        "h": (m.start(0.5, 1.2), "v"),
        "v": (m.start(-1.0, 1.0), f"-{m.length(5, 20)} * {scaled} - {m.number(0, 0.3)} * v"),
    }
    return states, [limit], {}


def box(m: Maker) -> Parts:
    """Four walls."""
    wide, high = m.length(0.8, 1.5), m.length(1.2, 2)
    limits = [
        Limit("x", f"-{wide}", {"x": "1"}, back={"x": f"-{wide}"}),
        Limit(wide, "x", {"x": "-1"}, back={"x": wide}),
        Limit("y", f"-{high}", {"y": "1"}, back={"y": f"-{high}"}),
        Limit(high, "y", {"y": "-1"}, back={"y": high}),
    ]
    states = m.plane((-0.4, 0.4), m.chance.choice((0.0, 4.0)))
    for v in ("vx", "vy"):
        states[v] = (m.chance.choice((-1, 1)) * m.start(1.0, 3.0), states[v][1])
    return states, limits, {}


KINDS: list[Callable[[Maker], Parts]] = [
    plain, ramp_of_time, ramp_of_state, ramp_of_input, sine_of_time, sine_of_states, slope,
    moving_slope, inside_a_circle, outside_a_circle, parabola, wave, two_balls, pendulum, box,
]  # fmt: skip


@cache
def hybrid(seed: int) -> Hybrid:
    """The model of a seed, with its motion."""
    chance = random.Random(seed)
    while True:
        make = KINDS[seed % len(KINDS)]
        unit = 10.0 ** chance.randint(-6, 6) if chance.random() < 0.3 else 1.0
        states, limits, inputs = make(Maker(chance, unit))
        model = Hybrid(
            make.__name__, seed, unit, states,
            {q: d for q, (_, d) in states.items() if d in states and q not in "sc"},
            limits,
            restitution=chance.choice((1.0, 1.0, 0.9, 0.8)),
            puts_back=chance.random() < 0.5,
            form=chance.choice(list(FORMS)),
            includes_zero=chance.random() < 0.3,
            has_nominal=unit != 1.0 or chance.random() < 0.2,
            inputs=inputs,
            steps=chance.choice(STEPS),
        )  # fmt: skip
        model.motion = model.loop().judged(communication_points(model.steps), chance)
        if model.motion.impacts and model.motion.horizon > SHORTEST:
            return model


def communication_points(steps: tuple[float, float]) -> np.ndarray:
    """All times (s) at which one of the steps ends."""
    ends = [k * h for h in steps for k in range(round(STOP / h) + 1)]
    return np.unique(ends)
