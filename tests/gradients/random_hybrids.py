"""Hybrid models made at random, run from event to event in 80 bits, and their gradients.

A step is Gragg's extrapolation of order 10. A kink, relation or event has an indicator, at whose
roots steps end; between them what it chooses stays. Gradients are central differences of whole
runs, extrapolated from three sizes: their error is about the last correction.

build/venv/bin/python -m tests.gradients.random_hybrids 7      # the file, its changes, errors
"""

import random
import sys
from dataclasses import dataclass, field
from types import CodeType
from typing import NamedTuple

import numpy as np

Real, Reals = np.longdouble, np.ndarray
STOP, POINTS = 2.0, 20  # s, communication points
STEP = Real(1) / 40
SUBSTEPS = (2, 4, 6, 8, 10)
DIFFERENCE = 2e-4  # of parameters
CLEAR = 0.02  # s, around a change: what is not compared
LEAST_SLOPE, LEAST_GAP, MOST = 0.05, 1e-3, 100.0  # what is known of crossings, touches, growth
MOST_STEPS = 1000
NAMES = {name: getattr(np, name) for name in ("sin", "exp", "tanh", "sqrt")}


class Event(NamedTuple):
    """Happens when an indicator gets above 0, in its mode; `to` is the mode after it."""

    indicator: int
    reset: dict[str, str]
    mode: bool | None
    to: bool | None


class Hybrid:
    """A model by its seed: texts of the file, and the same with choices made by flags K."""

    def __init__(self, seed: int) -> None:
        self.seed, self.chance = seed, random.Random(seed)
        n = self.chance.randint(1, 3)
        self.states = [f"x{i + 1}" for i in range(n)]
        self.start = {x: self.number(-1, 1) for x in self.states}
        self.parameters: dict[str, float] = {}
        self.indicators: list[str] = []
        self.events: list[Event] = []
        self.lines: list[str] = []  # of them in the file
        self.table = ""
        self.is_sampled = self.chance.random() < 0.4
        rows = [self.smooth(i) for i in range(n)]
        kinks = [self.of_abs, self.of_max, self.of_min, self.of_time, self.of_mod, self.of_table]
        for kink in self.chance.sample(kinks, self.chance.choice((0, 1, 1, 2))):
            self.add(rows, *kink(self.any_state()))
        kinds = [self.fires, self.switches, self.meets, self.happens_once]
        for kind in self.chance.sample(kinds, self.chance.choice((1, 1, 2))):
            kind(rows)
        if self.is_sampled:
            self.p("Ts", 0.13, 0.4), self.p("gain", 0.5, 2)
            self.offset = self.chance.choice(("0", f"{self.p('late', 0.1, 0.9)} * Ts"))
            self.law = f"0.4 * u - gain * {self.any_state()} + {self.p('aim', -1, 1)} * time"
            self.add(rows, "u", "u")
        self.files, self.frozen = zip(*rows, strict=True)
        known = [*self.parameters, *(f"start({x})" for x in self.states)]
        self.by = self.chance.sample(known, min(4, len(known)))
        if self.is_sampled and "Ts" not in self.by:
            self.by[0] = "Ts"

    def number(self, low: float, high: float) -> float:
        return round(self.chance.uniform(low, high), 4)

    def p(self, name: str, low: float, high: float) -> str:
        """A new parameter, its name."""
        self.parameters[name] = self.number(low, high)
        return name

    def any_state(self) -> str:
        return self.chance.choice(self.states)

    def add(self, rows: list, file: str, frozen: str) -> None:
        """Add a term to one of the right sides."""
        i = self.chance.randrange(len(rows))
        rows[i] = (f"{rows[i][0]} + {file}", f"{rows[i][1]} + {frozen}")

    def flag(self, indicator: str) -> str:
        self.indicators.append(indicator)
        return f"K[{len(self.indicators) - 1}]"

    def smooth(self, i: int) -> tuple[str, str]:
        x, y, n = self.states[i], self.any_state(), i + 1
        text = f"{self.p(f'd{n}', 0.5, 3)} - {self.p(f'c{n}', 0.2, 1.5)} * {x}"
        text += f" + {self.p(f'k{n}', -1, 1)} * " + self.chance.choice(
            (
                y,
                f"sin({y})",
                f"tanh({x} - {y})",
                f"exp(-{y}**2)",
                f"{x} / (1 + {y}**2)",
                f"sin(3 * time + {y})",
            )
        )
        return text, text

    def of_abs(self, x: str) -> tuple[str, str]:
        a, b = self.p("absa", -1, 1), self.p("absb", -1, 1)
        sign = f"(1 if {self.flag(f'{x} - {b}')} else -1)"
        return f"{a} * abs({x} - {b})", f"{a} * {sign} * ({x} - {b})"

    def of_max(self, x: str) -> tuple[str, str]:
        b = self.p("most", -1, 1)
        return f"max({x}, {b})", f"({x} if {self.flag(f'{x} - {b}')} else {b})"

    def of_min(self, x: str) -> tuple[str, str]:
        b = f"{self.p('size', 0.2, 1)} * sin({self.p('w', 2, 5)} * time)"
        return f"min({x}, {b})", f"({b} if {self.flag(f'{x} - {b}')} else {x})"

    def of_time(self, _: str) -> tuple[str, str]:
        a, t = self.p("push", -2, 2), self.p("until", 0.3, 1.5)
        return f"({a} if time < {t} else 0)", f"(0 if {self.flag(f'time - {t}')} else {a})"

    def of_mod(self, _: str) -> tuple[str, str]:
        a, period = self.p("rises", -2, 2), self.p("period", 0.55, 0.9)
        passed = " + ".join(self.flag(f"time - {k} * {period}") for k in (1, 2, 3))
        return f"{a} * mod(time, {period})", f"{a} * (time - ({passed}) * {period})"

    def of_table(self, x: str) -> tuple[str, str]:
        at = [-0.9137, -0.2113, 0.4371, 1.1219]
        y = [self.number(-1, 1) for _ in at]
        self.table = f'[tables.T]\nx = {at}\ny = {y}\ninterpolation = "linear"\noutside = "extend"'
        slopes = np.diff(y) / np.diff(at)
        text = f"{y[0]} + {slopes[0]!r} * ({x} - {at[0]})".replace("np.float64", "")
        for knot, change in zip(at[1:-1], np.diff(slopes), strict=True):
            text += (
                f" + (({x} - {knot}) * {float(change)!r} if {self.flag(f'{x} - {knot}')} else 0)"
            )
        return f"T({x})", f"({text})"

    def event(
        self, left: str, right: str, reset: dict[str, str], sign: int = 1,
        mode: bool | None = None,
    ) -> None:  # fmt: skip
        """Add an event: left passes right, upwards or downwards; one in a mode leaves it."""
        self.flag(f"{left} - ({right})" if sign > 0 else f"{right} - ({left})")
        name, to = f"[events.e{len(self.events)}]", None if mode is None else not mode
        self.events.append(Event(len(self.indicators) - 1, reset, mode, to))
        self.lines += [name, f'when = "{left} {"<>"[sign > 0]} {right}"']
        if mode is not None:
            self.lines += [
                f'while = "{"m" if mode else "not m"}"',
                f'set = {{ m = "{str(not mode).lower()}" }}',
            ]
        if reset:
            pairs = ", ".join(f'{x} = "{value}"' for x, value in reset.items())
            self.lines += [f"reinit = {{ {pairs} }}"]

    def jump(self, x: str) -> dict[str, str]:
        """A reset of another state than x, if there is one and chance wants it."""
        others = [other for other in self.states if other != x]
        if not others or self.chance.random() < 0.4:
            return {}
        y, part = self.chance.choice(others), self.p(f"part{len(self.events)}", -0.9, 0.9)
        return {
            y: self.chance.choice((f"{part} * {y}", f"{y} + {part} * {x}", f"{y} + {part} * time"))
        }

    def fires(self, _: list) -> None:
        x, top = self.any_state(), self.p("top", 0.4, 1.4)
        back = self.chance.choice((self.p("low", -1, 0.2), f"-{self.p('e', 0.2, 0.9)} * {x}"))
        self.event(x, top, reset={x: back} | self.jump(x))

    def switches(self, rows: list) -> None:
        x, i = self.any_state(), self.chance.randrange(len(rows))
        high, low = self.p("high", 0.3, 1.2), self.p("down", -0.8, 0.1)
        self.event(x, high, self.jump(x), mode=False)
        self.event(x, low, self.jump(x), -1, mode=True)
        term = f"(-{self.p('pull', 2, 5)} if m else 0.5)"
        rows[i] = (f"{rows[i][0]} + {term}", f"{rows[i][1]} + {term}")

    def meets(self, _: list) -> None:
        x = self.any_state()
        moving = f"{self.p('limit', 0.5, 1.2)} + 0.2 * sin({self.p('v', 2, 6)} * time)"
        self.event(x, moving, reset={x: f"{x} - {self.p('drop', 0.8, 1.6)}"} | self.jump(x))

    def text(self) -> str:
        """The file."""
        lines = [f'name = "Hybrid{self.seed}"', 'modes = ["m"]', "[parameters]"]
        lines += [f"{name} = {{ start = {value!r} }}" for name, value in self.parameters.items()]
        lines += ["[states]"]
        for x, rate in zip(self.states, self.files, strict=True):
            lines.append(f'{x} = {{ start = {self.start[x]!r}, derivative = "{rate}" }}')
        lines += [self.table] if self.table else []
        if self.is_sampled:
            lines += ["[discrete]", "u = {}", "[sampled.law]", 'every = "Ts"']
            lines += [f'offset = "{self.offset}"', f'set = {{ u = "{self.law}" }}']
        return "\n".join(
            [*lines, *self.lines, "[gradients]", f"by = {self.by}".replace("'", '"'), ""]
        )

    def happens_once(self, _: list) -> None:
        """At a time, or where a state passes what a sampler left."""
        x = self.any_state()
        reset = {x: f"{x} - {self.p('drop', 0.8, 1.6)}"} | self.jump(x)
        if self.is_sampled:
            self.event(x, f"{self.p('over', 0.2, 1)} + 0.5 * u", reset=reset)
        else:
            self.event("time", f"2 * {self.p('half', 0.1, 0.8)}", reset=reset)


@dataclass
class Motion:
    """Values (points, states and u) of a run, its changes, and why it is not compared."""

    rows: list[Reals] = field(default_factory=list)
    changes: list[tuple[Real, str]] = field(default_factory=list)
    doubt: str = ""


def compiled(texts: list[str] | tuple[str, ...]) -> CodeType:
    return compile(f"[{', '.join(texts)}]", "model", "eval")


class Loop:
    """Runs a model from event to event."""

    def __init__(self, model: Hybrid, start: dict[str, Real]) -> None:
        self.model, self.motion = model, Motion()
        self.names = NAMES | start | {"m": False, "u": Real(0), "K": []}
        self.x = np.array([start[f"start({x})"] for x in model.states])
        self.t, self.ticks, self.steps = Real(0), 0, 0
        self.rates, self.signs = compiled(model.frozen), compiled(model.indicators)
        self.history: list[Reals] = []
        self.of_events = {event.indicator for event in model.events}

    def of(self, code: CodeType, t: Real, x: Reals) -> Reals:
        self.names.update(zip(self.model.states, x, strict=True), time=t)
        return np.array(eval(code, {"__builtins__": {}}, self.names), Real)

    def moved(self, h: Real) -> Reals:
        """The states after a step of this length, by the modified midpoint rule."""
        f0, table = self.of(self.rates, self.t, self.x), []
        for n in SUBSTEPS:
            s = h / n
            before, now = self.x, self.x + s * f0
            for k in range(1, n):
                before, now = now, before + 2 * s * self.of(self.rates, self.t + k * s, now)
            end = (before + now + s * self.of(self.rates, self.t + h, now)) / 2
            row = [end]
            for k, old in enumerate(table, 1):
                ratio = (Real(n) / SUBSTEPS[len(table) - k]) ** 2 - 1
                row.append(row[-1] + (row[-1] - old) / ratio)
            table = row
        return table[-1]

    def holding(self, keep: int) -> list[bool]:
        """Which conditions hold; an indicator at its root, `keep`, is past it."""
        for k, sign in enumerate(self.of(self.signs, self.t, self.x)):
            if k != keep or abs(sign) > 1e-12:
                self.K[k] = bool(sign > 0)
        m = self.names["m"]
        return [self.K[event.indicator] and event.mode in (None, m) for event in self.model.events]

    def settle(self, keep: int = -1) -> None:
        """Look at all conditions until no event happens; one may end that of the next."""
        for _ in range(20):
            before, self.held = self.held, self.holding(keep)
            new = [k for k, holds in enumerate(self.held) if holds and not before[k]]
            if not new:
                return
            for k in new:
                if self.holding(keep)[k]:
                    self.happen(self.model.events[k])
        self.doubt("events without end")

    def happen(self, event: Event) -> None:
        values = {x: self.of(code, self.t, self.x) for x, code in self.resets[id(event)].items()}
        for x, value in values.items():
            self.x[self.model.states.index(x)] = value[0]
        self.names["m"] = self.names["m"] if event.to is None else event.to
        self.history.clear()

    def watch(self, signs: Reals, last: Reals) -> None:
        """Doubt what nearly touches: an extremum near 0 in the middle of three equal steps."""
        self.history = [*(self.history or [last]), signs][-3:]
        if len(self.history) == 3:
            a, b, c = self.history
            turns = ((b - a) * (c - b) <= 0) & (abs(b) < 20 * LEAST_GAP)
            if np.any(turns):
                self.doubt("a touch")

    def doubt(self, text: str) -> None:
        self.motion.doubt = self.motion.doubt or f"{text} at {float(self.t):.4f}"

    def advance(self, end: Real) -> None:
        """Up to a time, over all changes before it."""
        while self.t < end and not self.motion.doubt:
            self.steps += 1
            if self.steps > MOST_STEPS:
                self.doubt("changes without end")
            left = end - self.t
            h = left if left < 1.01 * STEP else STEP
            before, x, hit = self.of(self.signs, self.t, self.x), self.moved(h), -1
            signs = self.of(self.signs, self.t + h, x)
            for k in np.flatnonzero((signs > 0) != self.K):
                root = self.root(k, h, before[k], signs[k])
                if hit < 0 or root < h:
                    h, hit = root, k
            if hit < 0:
                self.watch(signs, before)
                self.t, self.x = (end if h == left else self.t + h), x
                continue
            if self.K[hit] and hit in self.of_events:  # it may happen again: no change yet
                self.K[hit] = False
                self.t, self.x = self.t + h, self.moved(h)
                self.settle(hit)
                continue
            small = Real(1e-5)
            ends = [
                self.of(self.signs, self.t + h + s, self.moved(h + s))[hit] for s in (-small, small)
            ]
            if abs(ends[1] - ends[0]) < 2 * small * LEAST_SLOPE:
                self.doubt("a small slope")
            self.t, self.x = self.t + h, self.moved(h)
            self.K[hit] = not self.K[hit]
            self.change(f"indicator {hit}")
            self.settle(hit)

    def root(self, k: int, high: Real, below: Real, above: Real) -> Real:
        """The length of the step to an indicator's root, by the Illinois method."""
        low, left, right, side = Real(0), below, above, 0
        if (left > 0) == (right > 0):  # it has just been passed
            return high
        for _ in range(60):
            middle = (low * right - high * left) / (right - left)
            value = self.of(self.signs, self.t + middle, self.moved(middle))[k]
            if abs(value) < 1e-18 or high - low < 1e-18:
                return middle
            if (value > 0) == (right > 0):
                high, right = middle, value
                left = left / 2 if side > 0 else left
                side = 1
            else:
                low, left = middle, value
                right = right / 2 if side < 0 else right
                side = -1
        return middle

    def change(self, name: str) -> None:
        if self.motion.changes and self.t - self.motion.changes[-1][0] < LEAST_GAP:
            self.doubt("changes almost at once")
        self.motion.changes.append((self.t, name))
        self.history.clear()
        if len(self.motion.changes) > 60:
            self.doubt("too many changes")

    def tick(self) -> Real:
        """The time of the next one."""
        offset = self.names.get("late", Real(0)) if self.model.offset != "0" else Real(0)
        return (offset + self.ticks) * self.names["Ts"]

    def run(self) -> Motion:
        self.names["K"] = self.K = [False] * len(self.model.indicators)
        self.held = [False] * len(self.model.events)
        codes = {id(e): {x: compiled([v]) for x, v in e.reset.items()} for e in self.model.events}
        self.resets, law = codes, compiled([self.model.law] if self.model.is_sampled else [])
        for point in range(POINTS + 1):
            end = Real(point) * STOP / POINTS
            while self.model.is_sampled and self.tick() <= end:
                self.advance(self.tick())
                self.names["u"] = self.of(law, self.t, self.x)[0]
                self.ticks += 1
                self.change("tick")
                self.settle()
            self.advance(end)
            if point == 0:
                self.settle()
            self.motion.rows.append(np.array([*self.x, self.names["u"]]))
            if self.motion.doubt:
                break
        return self.motion


@dataclass
class Reference:
    """What is known of a model: values and gradients at points, or the doubt."""

    motion: Motion
    values: Reals = field(default_factory=lambda: np.zeros(0))  # points, names
    gradients: Reals = field(default_factory=lambda: np.zeros(0))  # parameters, points, names
    error: float = 0.0
    clear: Reals = field(default_factory=lambda: np.zeros(0))  # points that are compared
    doubt: str = ""


def reference(model: Hybrid) -> Reference:
    """A run and its gradients, by six runs for each parameter."""
    start = model.parameters | {f"start({x})": value for x, value in model.start.items()}
    exact = {name: Real(value) for name, value in start.items()}
    plain = Loop(model, exact).run()
    if plain.doubt:
        return Reference(plain, doubt=plain.doubt)
    columns, error = [], 0.0
    for name in model.by:
        quotients = []
        for size in (DIFFERENCE, 2 * DIFFERENCE, 4 * DIFFERENCE):
            ends = [
                Loop(model, exact | {name: exact[name] + sign * Real(size)}).run()
                for sign in (1, -1)
            ]
            for end in ends:
                if end.doubt or [n for _, n in end.changes] != [n for _, n in plain.changes]:
                    return Reference(plain, doubt=end.doubt or f"another sequence by {name}")
            quotients.append((np.array(ends[0].rows) - np.array(ends[1].rows)) / (2 * Real(size)))
        one, two, four = quotients
        first, second = (4 * one - two) / 3, (4 * two - four) / 3
        columns.append((16 * first - second) / 15)
        times = np.array([float(t) for t, _ in plain.changes])
        points = STOP / POINTS * np.arange(POINTS + 1)
        clear = np.array([np.all(abs(times - t) > CLEAR) for t in points])
        error = max(error, float(np.max(abs(columns[-1] - first)[clear], initial=0.0)))
    gradients = np.array(columns, float)
    doubt = "grows" if np.max(abs(gradients[:, clear]), initial=0.0) > MOST else ""
    return Reference(plain, np.array(plain.rows, float), gradients, error, clear, doubt)


def main() -> None:
    model = Hybrid(int(sys.argv[1]))
    found = reference(model)
    print(model.text(), *found.motion.changes, sep="\n")
    print(f"error {found.error:.2g} {found.doubt}")


if __name__ == "__main__":
    main()
