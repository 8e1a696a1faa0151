"""Equations in plain C: what is refused, and derivatives of what is read.

Compiled models of them are compared with sympy.
"""

import itertools
import math
import random
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sympy

from tests.equations.compiled import Model
from tests.equations.examples import MISTAKES, MODELS
from tests.support.paths import ROOT
from tests.support.tables import cases

sys.path.insert(0, str(ROOT / "fmu"))
from compiler.graph.graph import Graph, Value  # noqa: E402
from compiler.plain_c.interpreter import Interpreter  # noqa: E402
from compiler.plain_c.text import CTextError, read  # noqa: E402
from compiler.plain_c.values import Conditions, Known  # noqa: E402
from compiler.read.header import made  # noqa: E402
from compiler.write.guards import settled  # noqa: E402

FILE = """
name = "F"
code = "text.h"
[discrete]
m = { type = "Integer", min = 0, max = 2 }
[outputs]
"y[i]" = { for = "i = 0..1" }
[states]
"x[i]" = { for = "i = 0..1", derivative = "y[i]" }
"""
CALCULATE = """
static void model_calculate(struct model_values *values) {
    f(values->x, values->m, values->y);
}
"""
GENERATOR = np.random.default_rng(1)


def written(folder: Path, text: str, name: str = "text.h") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def refusal(folder: Path, text: str) -> str:
    """Message of the error for a text with a function f."""
    with pytest.raises(CTextError) as error:
        program = read(written(folder, text), [ROOT / "models"])
        graph = Graph(has_switches=False, is_guarded=False)
        doubles_move = "real" not in program.typedefs
        interpreter = Interpreter(program, graph, doubles_move=doubles_move)
        interpreter.run("f", lambda place, kind: (
            interpreter.conditions.leaf(place[0], None) if kind in ("int", "bool")
            else graph.value("state", name=".".join(map(str, place)))
        ))  # fmt: skip
    return str(error.value)


def body(*lines: str) -> str:
    """A function whose first statement is in line 2."""
    return "double f(double x) {\n" + "\n".join(lines) + "\n}\n"


@pytest.mark.parametrize(("text", "said"), cases(MISTAKES["c_code"]))
def test_what_is_refused(tmp_path: Path, text: str, said: str) -> None:
    """`said` is the line, and words of the message."""
    message = refusal(tmp_path, f"{text}\n")
    line, expected = said.split(": ", 1)
    assert "\n" not in message
    assert message.startswith(f"text.h:{line}: "), message
    assert expected in message


def test_deep_nesting_is_refused_in_a_line(tmp_path: Path) -> None:
    message = refusal(tmp_path, body("return " + "(" * 3000 + "x" + ")" * 3000 + ";"))
    assert "\n" not in message
    assert "nested" in message


def test_division_of_whole_numbers_is_warned_of(tmp_path: Path) -> None:
    program = read(written(tmp_path, body("return 1 / 2 * x;")))
    graph, warnings = Graph(has_switches=False), []
    Interpreter(program, graph, warn=warnings.append).run("f", lambda *_: graph.value("state"))
    assert warnings == ["text.h:2: warning: 1 / 2 of whole numbers is 0: write 1.0 / 2.0"]


@pytest.mark.parametrize("seed", range(40))
def test_mutants_are_read_or_refused_in_a_line(tmp_path: Path, seed: int) -> None:
    """Words of the arm's equations put in each other's place: never a traceback."""
    text = (ROOT / "models/rp_manipulator/rp_equations.h").read_text(encoding="utf-8")
    words = list(re.finditer(r"\w+|[^\w\s]", text))
    generator = random.Random(seed)
    word, other = generator.choice(words), generator.choice(words)[0]
    mutant = f"{text[: word.start()]} {other} {text[word.end() :]}"
    folders = [ROOT / "models", ROOT / "models/rp_manipulator"]
    try:
        program = read(written(tmp_path, mutant), folders, made=made)
        graph = Graph(has_switches=False, is_guarded=False)
        leaves = Interpreter(program, graph)
        leaves.run("arm_accelerations", lambda place, _: graph.value("state", name=str(place)))
    except CTextError as error:
        assert re.match(r"\w+\.h:\d+: [^\n]+$", str(error))


def test_a_choice_that_the_block_around_it_has_made_is_gone() -> None:
    graph = Graph(has_switches=False, is_guarded=False)
    x, zero = graph.value("state", name="x"), graph.number(0.0)
    is_low, is_high = (graph.value(op, x, graph.number(1.0)) for op in ("<", ">"))
    both = graph.value("and", is_low, graph.value("not", is_high))
    square, other = graph.value("*", x, x), graph.value("+", x, x)
    inner = graph.value("if", is_low, graph.value("if", is_high, other, square), zero)
    value = graph.value("if", both, graph.value("sin", inner), zero)
    became = settled([value, other], Conditions(graph))
    assert became[value] is graph.value("if", both, graph.value("sin", square), zero)
    assert became[inner] is square and became[other] is other


def holds(condition: Value, given: dict[Value, float]) -> bool:
    """Return whether a condition holds; given: truths and whole numbers."""
    if condition in given:
        return bool(given[condition])
    if condition.op == "not":
        return not holds(condition.arguments[0], given)
    if condition.op == "==":
        return given[condition.arguments[0]] == condition.arguments[1].number
    return {"and": all, "or": any}[condition.op](holds(c, given) for c in condition.arguments)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_known_holds_in_all_cases_that_are_left(seed: int) -> None:
    """A part that a condition decides is known, and it is known where nothing is left."""
    chance, graph = random.Random(seed), Graph(has_switches=False, is_guarded=False)
    conditions = Conditions(graph)
    leaf = conditions.leaf("m", (0, 1, 2)).leaf
    x, numbers = graph.value("state", name="x"), [graph.number(float(i)) for i in range(3)]
    free = [graph.value("<", x, number) for number in numbers]
    made = [*free, *(graph.value("==", leaf, number) for number in numbers)]
    conditions.learn(made)
    for _ in range(12):
        parts = [conditions.no(c) if chance.random() < 0.3 else c for c in chance.sample(made, 2)]
        made.append(getattr(conditions, chance.choice(["both", "either"]))(*parts))
    made = [condition for condition in made if condition.op != "number"]
    cases = [
        dict(zip([*free, leaf], case, strict=True))
        for case in itertools.product([False, True], [False, True], [False, True], range(3))
    ]
    known, taken = Known(), cases
    for condition in chance.choices(made, k=4):
        truth = chance.random() < 0.7
        left = [case for case in taken if holds(condition, case) is truth]
        new = conditions.assume(condition, truth, known)
        assert new is not None or not left
        if new is not None and left:
            known, taken = new, left
            assert conditions.resolve(condition, known).number == truth
        for other in made:
            found = conditions.resolve(other, known)
            assert found is other or {holds(other, case) for case in taken} == {found.number != 0.0}


def test_shared_parts_of_conditions_are_resolved_once() -> None:
    graph, steps = Graph(has_switches=False, is_guarded=False), []
    conditions = Conditions(graph, lambda: steps.append(1))
    x = graph.value("state", name="x")
    chain = graph.value("<", x, graph.number(0.0))
    for i in range(1, 60):
        first, second = (graph.value(op, x, graph.number(float(i))) for op in "<>")
        again = graph.value("and", graph.value("not", chain), second)
        chain = graph.value("or", graph.value("and", chain, first), again)
    known = conditions.assume(chain, True, Known())
    assert conditions.resolve(chain, known) is conditions.true
    assert conditions.resolve(again, known) is again
    assert len(steps) < 60 * 20


# ---- Derivatives ---------------------------------------------------------------------------------


def compiled(folder: Path, text: str, n: int) -> Model:
    """A model whose outputs y are f(x, m, y); the first two states have them as derivatives."""
    shutil.copy(ROOT / "models" / "real.h", folder)
    head = f'#include "model_values.h"\n#include "real.h"\nenum {{ N = {n} }};\n'
    written(folder, head + text + CALCULATE)
    others = f'"x[j]" = {{ for = "j = 2..{n - 1}", derivative = "0" }}'
    return Model(folder, FILE + others * (n > 2))


class Point:
    """Values of x and m, and what follows from them."""

    def __init__(self, model: Model, x: np.ndarray, m: int) -> None:
        self.model, self.n = model, len(x)
        self.values = self.curve(x)
        ints = self.values.view(np.int32)[2 * len(model.names) :]
        ints[model.ints.index("is_begun")], ints[model.ints.index("m_m")] = 1, m
        model.outputs(self.values, 0.0)
        self.y = self._y(self.values)
        self.jacobian = model.jacobian(self.values, 0.0)[:2]

    def curve(self, x: np.ndarray) -> np.ndarray:
        return self.model.values(**{f"x[{i}]": value for i, value in enumerate(x)})

    def _y(self, values: np.ndarray) -> list[float]:
        return [values[self.model.names.index(f"y[{i}]")] for i in (0, 1)]

    def derivatives(self, first: np.ndarray, second: np.ndarray) -> list[list[float]]:
        """First and second ones of y along a curve of x."""
        found = [self.curve(first), self.curve(second)]
        self.model.derivatives(self.values, 0.0, 1.0, *found)
        return [self._y(values) for values in found]


Formula = Callable[[list, int], list]

# length of x, and the exact y
FORMULAS: dict[str, tuple[int, Formula]] = {
    "pendulum on a cart": (4, lambda x, m: [
        (x[3] + sympy.sin(x[0]) * (x[1] ** 2 + 9.81 * sympy.cos(x[0])) / 2)
        / (1 + sympy.sin(x[0]) ** 2 / 2),
        (-x[3] * sympy.cos(x[0]) - x[1] ** 2 * sympy.cos(x[0]) * sympy.sin(x[0]) / 2
         - 1.5 * 9.81 * sympy.sin(x[0])) / (2 + sympy.sin(x[0]) ** 2),
    ]),
    "Van der Pol and Duffing": (2, lambda x, m: [
        (1 - x[0] ** 2) * x[1] - x[0] if m == 1 else x[0] - x[0] ** 3 - x[1] / 5, x[1],
    ]),
    "Arrhenius and Monod": (2, lambda x, m: [
        3 * sympy.exp(-2 / x[1]) * x[0],
        x[0] / (sympy.Rational(1, 2) + x[0]) * sympy.sqrt(x[1])
        + sympy.log(x[1]) * sympy.atan2(x[0], x[1]),
    ]),
    "two link arm": (4, lambda x, m: list(
        sympy.Matrix([[3 + 2 * sympy.cos(x[1]), 1 + sympy.cos(x[1])],
                      [1 + sympy.cos(x[1]), 1]]).inv() * sympy.Matrix(x[2:4])
    )),
    "drag and pow": (2, lambda x, m: [
        -0.3 * sympy.sqrt(x[0] ** 2 + x[1] ** 2) * x[0] + sympy.tanh(x[1]) * x[0],
        sympy.sqrt(x[0] ** 2 + x[1] ** 2) ** 1.7 - sympy.acos(0.3 * x[0]) * sympy.cosh(x[1]),
    ]),
    "all that is read": (3, lambda x, m: all_that_is_read(x, m)),
}  # fmt: skip


def all_that_is_read(x: list, m: int) -> list:
    """Of value_of and moving_as as they are derived: `held` is a symbol that rests."""
    weights = [sympy.Rational(1, 2), 2] if m > 0 else [2, sympy.Rational(1, 2)]
    total = weights[0] * x[0] + weights[1] * x[1]
    z = [1, 1, 1]
    z[2 if m > 1 else 0] = total * x[2]
    early = x[0] * x[1] if m == 0 else x[m - 1] / (1 + x[2] ** 2)
    held, shift = sympy.Symbol("held"), sympy.Symbol("shift")
    last = -x[2] if m == 0 else sympy.sin(x[1])
    return [z[0] + 3 * z[2] + early * held, m * (x[0] ** 2 + shift) + last]


@pytest.mark.parametrize("name", FORMULAS)
def test_derivatives_are_those_of_sympy(tmp_path: Path, name: str) -> None:
    n, formula = FORMULAS[name]
    model = compiled(tmp_path, MODELS["c_code"][name], n)
    symbols = list(sympy.symbols(f"x:{n}"))
    t = sympy.Symbol("t")
    for m in range(3):
        x, first, second = GENERATOR.uniform(0.3, 1.5, (3, n))
        rest = {"held": x[0], "shift": x[1] - x[0] ** 2}
        at = dict(zip(symbols, x, strict=True)) | {sympy.Symbol(k): v for k, v in rest.items()}
        y, point = sympy.Matrix(formula(symbols, m)), Point(model, x, m)
        assert point.y == pytest.approx(numbers(y, at), rel=1e-13)
        assert point.jacobian == pytest.approx(numbers(y.jacobian(symbols), at), rel=1e-12)

        curve = {s: a + b * t + c * t**2 / 2
                 for s, a, b, c in zip(symbols, x, first, second, strict=True)}  # fmt: skip
        along = y.subs(curve)
        start = {t: 0} | {sympy.Symbol(k): v for k, v in rest.items()}
        expected = [numbers(along.diff(t, order), start) for order in (1, 2)]
        found = point.derivatives(first, second)
        assert found[0] == pytest.approx(expected[0], rel=1e-12)
        assert found[1] == pytest.approx(expected[1], rel=1e-11, abs=1e-11)


def numbers(matrix: sympy.Matrix, at: dict) -> np.ndarray:
    found = np.array(matrix.subs(at).evalf(30).tolist(), dtype=float)
    return found[:, 0] if found.shape[1] == 1 else found


def test_only_the_branch_of_a_mode_is_calculated(tmp_path: Path) -> None:
    """A root that is not defined in another mode is not taken there."""
    model = compiled(tmp_path, MODELS["c_code"]["a root of a mode"], 2)
    source = (tmp_path / "equations.c").read_text(encoding="utf-8")
    outputs = source[source.index("enum status outputs") : source.index("enum status derivatives")]
    assert outputs.count("if (") == 1
    assert outputs.count("exp(") == 1
    x = np.array([-1.0, 0.5])
    assert np.isfinite(Point(model, x, 0).jacobian).all()
    assert math.isnan(Point(model, x, 2).jacobian[0, 0])
