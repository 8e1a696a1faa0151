"""Plants with dry friction and stops, made at random: matrices for the event loop, and a file.

A seed gives a plant of up to four masses. Its directions are linearly independent, so that forces
are unique; a friction and a stop may share one.
"""

import random
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

Numbers = np.ndarray


@dataclass
class Coulomb:
    """Friction that slides fast: constant, or more by the time, a position or a velocity."""

    base: float
    more: float = 0.0
    kind: str = "constant"
    mass: int = 0  # that it depends on

    def at(self, t: float, q: Numbers, v: Numbers) -> float:
        of = {
            "constant": 0.0,
            "time": np.sin(3 * t) ** 2,
            "position": q[self.mass] ** 2,
            "velocity": v[self.mass] ** 2,
        }
        return self.base + self.more * of[self.kind]

    def text(self, base: str, more: str) -> str:
        of = {"time": "sin(3 * time)", "position": "x", "velocity": "v"}
        if not self.more:
            return base
        number = "" if self.kind == "time" else f"{self.mass + 1}"
        return f"{base} + {more} * {of[self.kind]}{number}**2"


@dataclass
class Friction:
    """Dry friction along a direction."""

    coulomb: Coulomb
    ratio: float = 1.0  # of breakaway to it
    speed: float = 0.0  # of Stribeck

    @property
    def is_off(self) -> bool:
        """Whether its limit is always 0."""
        return self.coulomb.base == 0 and self.coulomb.more == 0

    def at(self, speed: float, t: float, q: Numbers, v: Numbers) -> float:
        """What it is at a relative speed."""
        coulomb = self.coulomb.at(t, q, v)
        if self.ratio == 1.0:
            return coulomb
        return coulomb * (1 + (self.ratio - 1) * np.exp(-((speed / self.speed) ** 2)))


@dataclass
class Stop:
    """Limits along a direction; one of them may be infinite."""

    lower: float
    upper: float
    restitution: float


@dataclass
class Row:
    """A direction, as factors of one or two masses, and what acts along it."""

    factors: dict[int, float]
    named: int = -1  # the mass whose factor is a parameter
    friction: Friction | None = None
    stop: Stop | None = None


@dataclass
class Plant:
    """M v' = load - J' F + J' P; the drive of a mass is two sines, a ramp and a constant."""

    seed: int
    M: Numbers
    K: Numbers
    D: Numbers
    sines: Numbers  # masses, (amplitude, frequency, phase) twice
    ramps: Numbers  # masses, (constant, slope)
    q: Numbers
    v: Numbers
    rows: list[Row] = field(default_factory=list)
    is_round: bool = False
    form: str = "inverse"  # of the accelerations

    @cached_property
    def W(self) -> Numbers:
        W = np.linalg.inv(self.M)
        return (W + W.T) / 2

    @cached_property
    def J(self) -> Numbers:
        J = np.zeros((len(self.rows), len(self.q)))
        for k, row in enumerate(self.rows):
            J[k, list(row.factors)] = list(row.factors.values())
        return J

    def drive(self, t: float) -> Numbers:
        a, w, p, b, u, r = self.sines.T
        return a * np.sin(w * t + p) + b * np.sin(u * t + r) + self.ramps @ [1.0, t]

    def load(self, t: float, q: Numbers, v: Numbers) -> Numbers:
        """All forces but those of friction and stops."""
        return self.drive(t) - self.K @ q - self.D @ v

    def energy(self, q: Numbers, v: Numbers) -> float:
        return float(v @ self.M @ v + q @ self.K @ q) / 2

    def disturbed(self, size: float) -> "Plant":
        """With other drives, springs, frictions and restitutions, by this part of them."""
        chance = np.random.default_rng(self.seed)

        def by(numbers: Any) -> Any:
            return numbers * (1 + size * chance.choice((-1, 1), np.shape(numbers)))

        rows = []
        for row in self.rows:
            friction, stop = row.friction, row.stop
            if friction:
                c = friction.coulomb
                friction = replace(friction, coulomb=replace(c, base=by(c.base), more=by(c.more)))
            if stop and stop.restitution < 1:
                stop = replace(stop, restitution=by(stop.restitution))
            rows.append(replace(row, friction=friction, stop=stop))
        sines = self.sines * (
            1 + size * np.outer(chance.choice((-1, 1), len(self.q)), [1, 0, 0] * 2)
        )
        return replace(self, sines=sines, ramps=by(self.ramps), K=self.K * by(1.0), rows=rows)

    def text(self) -> str:
        """The file; `work` is that of the drives, `heat` that of dampers and frictions."""
        return _Writer(self).text()


class _Writer:
    """Writes the file of a plant: each number is a parameter."""

    def __init__(self, plant: Plant) -> None:
        self.plant, self.n, self.parameters = plant, len(plant.q), {}

    def of(self, name: str, value: float) -> str:
        self.parameters[name] = float(value)
        return name

    def text(self) -> str:
        plant, each, name = self.plant, range(1, self.n + 1), f"Plant{self.plant.seed}"
        states = [_state(f"x{i}", plant.q[i - 1], f"v{i}") for i in each]
        states += [_state(f"v{i}", plant.v[i - 1], self.acceleration(i)) for i in each]
        states += [_state("work", 0.0, " + ".join(f"d{i} * v{i}" for i in each))]
        states += [_state("heat", 0.0, self.heat())]
        where = [f'd{i} = "{self.drive(i)}"' for i in each]
        where += [f'r{i} = "{self.load(i)}"' for i in each]
        elements = [line for k, row in enumerate(plant.rows) for line in self.element(k, row)]
        parameters = [f"{n} = {{ start = {value!r} }}" for n, value in self.parameters.items()]
        return "\n".join([
            f'name = "{name}"', "[parameters]", *parameters, "[states]", *states, "[where]",
            *where, *elements, "",
        ])  # fmt: skip

    def drive(self, i: int) -> str:
        terms, numbers = [], self.plant.sines[i - 1]
        for letter, (size, frequency, phase) in zip("ab", (numbers[:3], numbers[3:]), strict=True):
            if size:
                w, p = self.of(f"w{letter}{i}", frequency), self.of(f"p{letter}{i}", phase)
                terms.append(f"{self.of(f'{letter}{i}', size)} * sin({w} * time + {p})")
        constant, slope = self.plant.ramps[i - 1]
        terms += [self.of(f"s{i}", constant)] if constant else []
        terms += [f"{self.of(f't{i}', slope)} * time"] if slope else []
        return " + ".join(terms) or "0 * time"

    def pairs(self, letter: str, matrix: Numbers) -> list[tuple[int, int, str]]:
        """Where a matrix is not 0, and the name of that number."""
        return [
            (i + 1, j + 1, self.of(f"{letter}{i + 1}{j + 1}", matrix[i, j]))
            for i, j in zip(*np.nonzero(matrix), strict=True)
        ]

    def heat(self) -> str:
        terms = [f"{c} * v{i} * v{j}" for i, j, c in self.pairs("c", self.plant.D)]
        for k, row in enumerate(self.plant.rows):
            terms += [f"F{k} * ({self.along(row, 'v')})"] if row.friction else []
        return " + ".join(terms) or "0 * v1"

    def load(self, i: int) -> str:
        plant, text = self.plant, f"d{i}"
        text += "".join(f" - {k} * x{j}" for me, j, k in self.pairs("k", plant.K) if me == i)
        text += "".join(f" - {c} * v{j}" for me, j, c in self.pairs("c", plant.D) if me == i)
        for k, row in enumerate(plant.rows):
            if i - 1 in row.factors:
                sign, factor = self.factor(row, i - 1)
                text += f" {'+-'[sign > 0]} {factor}F{k}" if row.friction else ""
                text += f" {'-+'[sign > 0]} {factor}P{k}" if row.stop else ""
        return text

    def factor(self, row: Row, i: int) -> tuple[int, str]:
        """The sign of a factor, and its text in front of a name."""
        if i == row.named:
            return -1, f"{self.of(f'n{self.plant.rows.index(row)}', -row.factors[i])} * "
        size = abs(row.factors[i])
        return (1 if row.factors[i] > 0 else -1), ("" if size == 1 else f"{size!r} * ")

    def acceleration(self, i: int) -> str:
        plant = self.plant
        if plant.form == "mass":
            return f"r{i} / {self.of(f'm{i}', plant.M[i - 1, i - 1])}"
        if plant.form == "determinant" and self.n == 2:
            (a, b), (_, c) = plant.M
            a, b, c = self.of("m11", a), self.of("m12", b), self.of("m22", c)
            above = f"{c} * r1 - {b} * r2" if i == 1 else f"{a} * r2 - {b} * r1"
            return f"({above}) / ({a} * {c} - {b}**2)"
        return " + ".join(f"{w} * r{j}" for me, j, w in self.pairs("w", plant.W) if me == i)

    def along(self, row: Row, letter: str) -> str:
        """The sum of positions or velocities along a direction."""
        parts = [(*self.factor(row, i), f"{letter}{i + 1}") for i in row.factors]
        text = " ".join(f"{'-+'[sign > 0]} {factor}{name}" for sign, factor, name in parts)
        return text.removeprefix("+ ")

    def element(self, k: int, row: Row) -> list[str]:
        lines, velocity = [], f'velocity = "{self.along(row, "v")}"'
        if row.friction:
            friction, c = row.friction, row.friction.coulomb
            coulomb = c.text(self.of(f"mu{k}", c.base), f"more{k}")
            if c.more:
                self.of(f"more{k}", c.more)
            lines += [f"[friction.e{k}]", f'force = "F{k}"', velocity, f'coulomb = "{coulomb}"']
            if friction.ratio != 1.0:
                ratio, speed = (
                    self.of(f"ratio{k}", friction.ratio),
                    self.of(f"u{k}", friction.speed),
                )
                lines += [f'breakaway = "{ratio} * ({coulomb})"', f'stribeck = "{speed}"']
        if row.stop:
            lines += [f"[stops.e{k}]", f'force = "P{k}"', f'position = "{self.along(row, "x")}"']
            sides = {"lower": row.stop.lower, "upper": row.stop.upper}
            lines += [velocity] + [
                f'{side} = "{self.of(f"{side}{k}", limit)}"'
                for side, limit in sides.items() if np.isfinite(limit)
            ]  # fmt: skip
            lines += [f'restitution = "{self.of(f"e{k}", row.stop.restitution)}"']
        return lines


def _state(name: str, start: float, derivative: str) -> str:
    return f'{name} = {{ start = {float(start)!r}, derivative = "{derivative}" }}'


class Maker:
    """Chooses the numbers of a plant."""

    def __init__(self, seed: int, turn: int) -> None:
        self.chance = random.Random(1000 * seed + turn)
        self.is_round = self.likely(0.3)

    def number(self, low: float, high: float) -> float:
        """Of three digits, or a multiple of a half if numbers are round."""
        value = self.chance.uniform(low, high)
        return round(2 * value) / 2 if self.is_round else float(f"{value:.3g}")

    def size(self, low: float, high: float, least: float = 0.5) -> float:
        return max(least if self.is_round else low, self.number(low, high))

    def likely(self, probability: float) -> bool:
        return self.chance.random() < probability

    def mass(self, n: int) -> Numbers:
        if self.is_round and self.likely(0.6):
            return np.eye(n)
        M = np.diag([self.size(0.5, 3) for _ in range(n)])
        if self.likely(0.6):
            for i in range(n - 1):
                part = self.chance.choice((-0.5, 0.25, 0.5))
                M[i, i + 1] = M[i + 1, i] = part * min(M[i, i], M[i + 1, i + 1])
        return M if np.linalg.eigvalsh(M)[0] > 0.1 else np.diag(np.diag(M))

    def matrix(self, n: int, high: float, probability: float) -> Numbers:
        """Of springs or dampers: to the ground, and between neighbours."""
        K = np.diag([self.size(0, high) if self.likely(probability) else 0.0 for _ in range(n)])
        for i in range(n - 1):
            if self.likely(probability):
                k = self.size(0, high)
                K[i : i + 2, i : i + 2] += [[k, -k], [-k, k]]
        return K

    def sine(self) -> list[float]:
        size = self.size(1, 8) if self.likely(0.6) else 0.0
        return [size, self.size(1, 9), 0.0 if self.is_round else self.number(0, 6)]

    def ramp(self) -> list[float]:
        return [self.number(-3, 3) * self.likely(0.4), self.number(-3, 3) * self.likely(0.4)]

    def speeds(self, n: int) -> Numbers:
        """At rest, all alike, or by chance."""
        if self.likely(0.5 if self.is_round else 0.2):
            return np.zeros(n)
        if self.likely(0.2):
            return np.full(n, self.number(-2, 2))
        return np.array([self.number(-2, 2) * self.likely(0.7) for _ in range(n)])

    def row(self, n: int) -> Row:
        """A direction."""
        if n == 1 or self.likely(0.5):
            i = self.chance.randrange(n)
            return Row({i: self.chance.choice((1.0, 1.0, 1.0, 1.0, -1.0, 2.0))})
        i, j = self.chance.sample(range(n), 2)
        if self.likely(0.5):
            return Row({i: 1.0, j: -1.0})
        factor = self.chance.choice((0.5, 2.0, -1.0, -0.5, self.size(0.5, 3)))
        return Row({i: 1.0, j: -factor}, named=j)

    def rows(self, n: int) -> list[Row]:
        """Up to n directions, with up to five elements."""
        rows = [
            self.row(n) for _ in range(max(self.chance.randint(1, n), self.chance.randint(1, n)))
        ]
        for row in rows:
            kind = self.chance.choice(("friction", "friction", "stop", "stop", "both", "both"))
            row.friction = self.friction(n) if kind != "stop" else None
            row.stop = Stop(0.0, 0.0, self.restitution()) if kind != "friction" else None
        return rows

    def friction(self, n: int) -> Friction:
        kind = self.chance.choice(("constant",) * 5 + ("time", "position", "velocity"))
        base = 0.0 if self.likely(0.05) else self.size(0.3, 3)
        more = 0.0 if kind == "constant" else self.size(0.3, 2)
        coulomb = Coulomb(base, more, kind, self.chance.randrange(n))
        if self.likely(0.35):
            return Friction(coulomb, self.chance.choice((1.2, 1.5, 2.0)), self.size(0.5, 1.5))
        return Friction(coulomb)

    def restitution(self) -> float:
        e = self.chance.choice((0.0, 0.0, 1.0, 0.5, 0.8, self.chance.random()))
        return float(f"{e:.3g}")

    def around(self, stop: Stop, at: float) -> None:
        """Put limits around a position; where numbers are round, perhaps one right at it."""
        near = 0.0 if self.is_round and self.likely(0.3) else self.size(0.02, 0.6)
        far = self.size(0.1, 1)
        stop.lower, stop.upper = at - far, at + near
        if self.likely(0.5):
            stop.lower, stop.upper = at - near, at + far
        if self.likely(0.2):
            stop.lower = -np.inf
        elif self.likely(0.25):
            stop.upper = np.inf

    def equal(self, plant: Plant) -> None:
        """Let a friction just bear the load: at the start, or for as long as nothing moves."""
        for row in plant.rows:
            (i, factor), *others = row.factors.items()
            if row.friction and not others and self.likely(0.6):
                if self.likely(0.5):
                    plant.sines[i, [0, 3]], plant.ramps[i] = 0.0, (self.size(1, 3), 0.0)
                load = abs(plant.load(0.0, plant.q, plant.v)[i])
                row.friction.coulomb.base = load / abs(factor) or 1.0

    def plant(self, seed: int) -> Plant | None:
        """A plant, or none if its directions depend on each other."""
        n = self.chance.choice((1, 2, 2, 3, 3, 4, 4))
        M, rows = self.mass(n), self.rows(n)
        is_diagonal = np.count_nonzero(M) == n
        form = self.chance.choice(
            ("mass", "inverse") if is_diagonal else ("determinant", "inverse")
        )
        plant = Plant(
            seed, M, self.matrix(n, 40, 0.4), self.matrix(n, 1, 0.3),
            np.array([self.sine() + self.sine() for _ in range(n)]),
            np.array([self.ramp() for _ in range(n)]),
            np.array([self.number(-0.3, 0.3) for _ in range(n)]), self.speeds(n),
            rows, self.is_round, form,
        )  # fmt: skip
        J = plant.J
        elements = sum((row.friction is not None) + (row.stop is not None) for row in rows)
        if elements > 5 or np.linalg.svd(J, compute_uv=False)[len(rows) - 1] < 0.2:
            return None
        for k, row in enumerate(rows):
            if row.stop:
                self.around(row.stop, float(J[k] @ plant.q))
        if self.is_round:
            self.equal(plant)
        return plant


def plant(seed: int) -> Plant:
    """The plant of a seed."""
    return next(made for turn in range(1000) if (made := Maker(seed, turn).plant(seed)))
