"""Random expressions whose branches nest: outputs, derivatives and runs against Python's values.

EXPRESSIONS in the environment: how many models.
"""

import math
import operator
import os
import random
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
import pytest
from rparm.fmu_tools.compiler.expressions.expression import Node
from rparm.fmu_tools.compiler.expressions.parser import parse

from tests.equations.compiled import Model
from tests.equations.examples import METHODS, made, simulated

SEEDS = range(int(os.environ.get("EXPRESSIONS", "2")))
NAMES = ("x", "y", "u", "p", "time")
GRID = (-1.0, -0.5, 0.0, 0.5, 1.0)  # where values tie
SMOOTH = ("sin({})", "atan({})", "exp(-abs({}))", "-{}", "{0} / (2 + {0} * {0})", "{}**2")
# defined for a part of all numbers, with infinite slopes at its end
PARTIAL = ("sqrt({})", "asin({})", "{}**1.5", "log({} + 0.03)", "cbrt({})")
# the same with guards: defined for all numbers
GUARDED = (
    "sqrt(abs({}))", "asin(max(-1, min({}, 1)))", "sqrt(max({}, 0))", "abs({})**1.5",
    "(sqrt({0}) if {0} > 0 else 0)", "(0 if {0} <= 0 else log(1 + {0}) + 1)",
    "(sqrt({0}) * {0} if not {0} < 0 else 0.25)", "max(0, {})**0.75",
    "(1 / {0} if {0} > 1 else 1)", "(asin({0}) if abs({0}) <= 1 else 2)",
)  # fmt: skip
FUNCTIONS: dict[str, Callable[..., float]] = {
    name: getattr(math, name) for name in ("sin", "atan", "exp", "sqrt", "asin", "log", "cbrt")
} | {
    "**": math.pow,
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "negative": operator.neg,
}
RELATIONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


class Texts:
    """Random texts; only_total: defined everywhere, and no roots of roots.

    Where both begin at one point, the relation of the outer one is not defined in front of it.
    """

    def __init__(self, seed: int, names: tuple[str, ...], only_total: bool) -> None:
        self.chance, self.names, self.only_total = random.Random(seed), names, only_total
        self.forms = (*SMOOTH, *GUARDED, *(() if only_total else PARTIAL))

    def number(self, depth: int) -> str:
        """Text of a number, in brackets or a call where that matters."""
        chance = self.chance
        if depth == 0:
            return chance.choice([*self.names, *self.names, "0", "0.5", "1"])
        inner, other = self.number(depth - 1), self.number(chance.randrange(depth))
        match chance.randrange(7):
            case 0 | 1:
                has_root = self.only_total and any(word in inner for word in ("sqrt", "**", "log"))
                return f"({chance.choice(SMOOTH if has_root else self.forms)})".format(inner)
            case 2 | 3:
                return f"({inner} {chance.choice('+-*')} {other})"
            case 4:
                return f"{chance.choice(['min', 'max'])}({inner}, {other})"
            case 5:
                return f"abs({inner})"
        return f"({inner} if {self.condition(depth - 1)} else {other})"

    def condition(self, depth: int) -> str:
        """Text of a condition in brackets."""
        chance, kind = self.chance, self.chance.randrange(5)
        if depth == 0 or kind < 3:
            sides = self.number(min(depth, 2)), self.number(min(depth, 1))
            return f"({sides[0]} {chance.choice(list(RELATIONS))} {sides[1]})"
        if kind == 3:
            return f"(not {self.condition(depth - 1)})"
        parts = self.condition(depth - 1), self.condition(depth - 1)
        return f"({parts[0]} {chance.choice(['and', 'or'])} {parts[1]})"


class Undefined(Exception):
    """An operation has no value, or a relation compares what has none."""


def value_of(node: Node, point: Mapping[str, float], decided: list[bool]) -> float:
    """Value of a tree, of which only what is needed is looked at; notes what relations say."""

    def of(k: int) -> float:
        return value_of(node.arguments[k], point, decided)

    def says(relation: str, left: float, right: float) -> bool:
        decided.append(RELATIONS[relation](left, right))
        return decided[-1]

    match node.op:
        case "number":
            return node.value
        case "name":
            return point[node.name]
        case "if":
            return of(1) if of(0) else of(2)
        case "and":
            return of(0) and of(1)
        case "or":
            return of(0) or of(1)
        case "not":
            return not of(0)
        case "min" | "max":
            a, b = of(0), of(1)
            return a if says("<" if node.op == "min" else ">", a, b) else b
        case "abs":
            a = of(0)
            return -a if says("<", a, 0.0) else a
        case op if op in RELATIONS:
            return says(op, of(0), of(1))
        case "/":
            return of(0) / of(1)
        case "**" if node.arguments[1].value == 2.0:
            return of(0) * of(0)
    try:
        return FUNCTIONS[node.op](*map(of, range(len(node.arguments))))
    except ValueError:
        raise Undefined from None


def value(text: str, point: Mapping[str, float]) -> tuple[float, list[bool]]:
    """Value of a text, NaN where it has none, and what its relations say."""
    decided: list[bool] = []
    try:
        return value_of(tree(text), point, decided), decided
    except Undefined:
        return math.nan, decided


tree = cache(parse)


def model_text(texts: Mapping[str, str]) -> str:
    outputs = "".join(f'{name} = {{ value = "{text}" }}\n' for name, text in texts.items())
    return (
        'name = "Random"\n[parameters]\np = { start = 1 }\n[inputs]\nu = {}\n[states]\n'
        f'x = {{ derivative = "y" }}\ny = {{ derivative = "-x" }}\n[outputs]\n{outputs}'
    )


@pytest.fixture(scope="module", params=SEEDS)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple:
    """Compiled expressions, their texts, and chance for points."""
    random_texts = Texts(request.param, NAMES, only_total=False)
    texts = {f"z{i}": random_texts.number(4) for i in range(25)}
    return Model(tmp_path_factory.mktemp("model"), model_text(texts)), texts, random_texts.chance


def points(chance: random.Random, count: int) -> list[dict[str, float]]:
    """On the grid of ties, and off it; at its time a relation of time is past in any case."""
    on_grid = [{name: chance.choice(GRID) for name in NAMES} for _ in range(count)]
    on_grid = [point | {"time": point["time"] + 0.3} for point in on_grid]
    return on_grid + [{name: chance.uniform(-1.5, 1.5) for name in NAMES} for _ in range(count)]


def test_outputs_are_what_python_says(case: tuple) -> None:
    """Also where values tie; not finite where there is none."""
    model, texts, chance = case
    finite = 0
    for point in points(chance, 100):
        values = model.values(**point)
        model.outputs(values, point["time"])
        for name, text in texts.items():
            found, (expected, _) = values[model.names.index(name)], value(text, point)
            if math.isnan(expected):
                assert not np.isfinite(found), (text, point)
            else:
                assert found == pytest.approx(expected, rel=1e-14, abs=1e-14), (text, point)
                finite += 1
    assert finite > 100 * len(texts)


def test_derivatives_are_limits_of_differences(case: tuple) -> None:
    """Where no relation changes nearby."""
    model, texts, chance = case
    compared = 0
    for point in points(chance, 40)[40:]:
        values = model.values(**point)
        model.outputs(values, point["time"])
        for by in NAMES:
            first, second = model.values(**{by: 1.0}), model.values()
            model.derivatives(values, point["time"], float(by == "time"), first, second)
            for name, text in texts.items():
                slopes, decisions = [], []
                for h in (1e-5, 5e-6):
                    ends = [value(text, {**point, by: point[by] + s}) for s in (-h, h)]
                    slopes.append((ends[1][0] - ends[0][0]) / (2 * h))
                    decisions += [decided for _, decided in ends]
                error = abs(slopes[1] - slopes[0])
                if any(decided != decisions[0] for decided in decisions) or not error < 1e-6:
                    continue
                found = first[model.names.index(name)]
                assert abs(found - slopes[1]) <= 1e-9 + 4 * error, (text, point, by)
                compared += 1
    assert compared > 40 * len(texts)


RATE = "1 + 0.5 * sin(time)"  # of x, which rises
STOP = 3.0


def x_at(t: float) -> float:
    return -1.0 + t + 0.5 * (1 - math.cos(t))


def changes(text: str, point: Callable[[float], dict[str, float]]) -> list[float]:
    """The times at which relations of a text change."""
    times = [float(t) for t in np.linspace(0, STOP, 1501)]
    decisions = [value(text, point(t))[1] for t in times]
    found = []
    for begin, end, last in zip(times, times[1:], decisions[1:], strict=False):
        while (first := value(text, point(begin))[1]) != last:
            low, high = begin, end
            while high - low > 1e-13:
                middle = (low + high) / 2
                is_before = value(text, point(middle))[1] == first
                low, high = (middle, high) if is_before else (low, middle)
            found.append(high)
            begin = high
    return found


@pytest.fixture(scope="module", params=SEEDS)
def fmu_case(request: pytest.FixtureRequest) -> tuple:
    """An FMU whose states are integrals of expressions, which are outputs too."""
    random_texts = Texts(1000 + request.param, ("x", "p", "time"), only_total=True)
    texts = {f"z{i}": random_texts.number(4) for i in range(10)}
    text = 'name = "Random"\n[parameters]\np = { start = 0.4 }\n'
    text += f'[states]\nx = {{ start = -1, derivative = "{RATE}" }}\n'
    text += "".join(f'i{name} = {{ derivative = "{rate}" }}\n' for name, rate in texts.items())
    text += "[outputs]\n"
    text += "".join(f'{name} = {{ value = "{rate}" }}\n' for name, rate in texts.items())
    return made(text), texts


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_runs_are_integrals_of_what_python_says(fmu_case: tuple, method: int) -> None:
    """The outputs, but where one has just changed, and their integrals, between the changes."""
    fmu, texts = fmu_case
    run = simulated(fmu, STOP, 0.1, {"solver_method": method}, relative_tolerance=1e-9)
    nodes, weights = np.polynomial.legendre.leggauss(12)

    def point(t: float) -> dict[str, float]:
        return {"time": t, "x": x_at(t), "p": 0.4}

    for name, text in texts.items():
        limits = np.array([0.0, *changes(text, point), STOP])
        for t, found in zip(run["time"], run[name], strict=True):
            if np.min(np.abs(limits[1:-1] - t), initial=1.0) > 1e-6:
                assert found == pytest.approx(value(text, point(t))[0], abs=1e-4), (text, t)
        # towards its ends, where roots begin, the parts of a piece are shorter
        s = np.linspace(-1, 1, 17)
        total = 0.0
        for begin, end in zip(limits, limits[1:], strict=False):
            edges = begin + (end - begin) * (2 + 3 * s - s**3) / 4
            for low, length in zip(edges, np.diff(edges), strict=False):
                at = [value(text, point(low + length * (node + 1) / 2))[0] for node in nodes]
                total += length / 2 * weights @ at
        assert run[f"i{name}"][-1] == pytest.approx(total, abs=2e-6), text
