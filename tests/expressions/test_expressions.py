"""Expressions: against Python's own arithmetic, and what is refused."""

import decimal
import math
import random
from fractions import Fraction

import pytest
from rparm.fmu_tools.compiler import units
from rparm.fmu_tools.compiler.expressions.dimensions import (
    ANY,
    ONE,
    dimension_of,
    of_exponents,
    shown,
)
from rparm.fmu_tools.compiler.expressions.expression import (
    FUNCTIONS,
    ExpressionError,
    Node,
    evaluated,
    in_order,
    names,
    written,
)
from rparm.fmu_tools.compiler.expressions.indexes import at_indexes
from rparm.fmu_tools.compiler.expressions.kinds import CONDITION, WHOLE, kind_of, with_kinds
from rparm.fmu_tools.compiler.expressions.parser import parse, parsed

VALUES = {"x": 0.75, "y": -1.25, "z": 3.0}
PYTHON = {name: getattr(math, name) for name in FUNCTIONS if hasattr(math, name)}
PYTHON |= {"abs": abs, "min": min, "max": max, "pi": math.pi, "pow": math.pow, **VALUES}
BINARY = [" + ", " - ", " * ", "/", "**", "  *"]


def number(chance: random.Random, depth: int) -> str:
    """Text of an expression that means the same in Python."""
    kind = chance.randrange(9) if depth else 0
    if kind == 0:
        return chance.choice([*VALUES, "pi", "2.0", "0.5", ".25", "1e-3", "3."])
    if kind < 5:
        left, right = (number(chance, depth - 1) for _ in range(2))
        return f"{left}{chance.choice(BINARY)}{right}"
    inner = number(chance, depth - 1)
    if kind == 5:
        return f"({inner})"
    if kind == 6:
        return f"-{inner}"
    if kind == 7:
        return f"{chance.choice(['sin', 'atan', 'tanh', 'abs'])}({inner})"
    return f"({inner} if {condition(chance, depth - 1)} else {number(chance, depth - 1)})"


def condition(chance: random.Random, depth: int) -> str:
    left, right = (number(chance, depth - 1) if depth > 0 else "x" for _ in range(2))
    relation = f"{left} {chance.choice(['<', '<=', '>', '>='])} {right}"
    if depth <= 0 or chance.random() < 0.5:
        return relation
    rest = condition(chance, depth - 1)
    return chance.choice([f"not {relation}", f"{relation} and {rest}", f"{relation} or {rest}"])


def outcome(calculate: object) -> float | None:
    try:
        value = calculate()
        return None if isinstance(value, complex) or not math.isfinite(value) else value
    except (ArithmeticError, TypeError, ValueError):  # comparisons of complex numbers
        return None


@pytest.mark.parametrize("seed", range(20))
def test_it_calculates_as_python(seed: int) -> None:
    chance = random.Random(seed)
    defined = 0
    for _ in range(100):
        text = number(chance, 5)
        expected = outcome(lambda text=text: eval(text, {"__builtins__": {}}, PYTHON))
        tree = parse(text)
        found = outcome(lambda tree=tree: evaluated(tree, VALUES))
        again = parse(written(tree))
        assert outcome(lambda tree=again: evaluated(tree, VALUES)) == pytest.approx(found), text
        if expected is None or found is None:
            continue  # Python has complex roots
        defined += 1
        assert found == pytest.approx(expected, rel=1e-12), text
    assert defined > 50


def test_operations_keep_the_order_of_the_text() -> None:
    order = [node.op for node in in_order([parse("a - b - sin(c) * 2**-x**2")])]
    assert order == ["name", "name", "-", "name", "sin", "number", "name", "number", "**"] + [
        "negative", "**", "*", "-",
    ]  # fmt: skip
    assert names(parse("a * part.b + pi + max(c, a)")) == {"a", "part.b", "c"}


def test_a_branch_that_is_not_taken_need_not_have_a_value() -> None:
    assert parsed("1 / x if x > 0 else 0").value({"x": 0.0}) == 0.0


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("", 1), ("1 +", 4), ("2 x", 3), ("2x", 1), ("a < b < c", 7), ("1 if x", 7), ("f(x)", 1),
        ("1 + not x", 5), ("sin()", 5), ("atan2(x)", 1), ("max(x)", 1), ("(a", 3), ("a)", 2),
        ("a @ b", 3), ("a == b", 3), ("a // b", 4), ("'a'", 1), ("a[b]", 3), ("1e999", 1),
        ("1 + True", 5), ("lambda: 1", 7), ("(" * 200, 102), ("-" * 200 + "1", 102), ("a.", 2),
        ("1 + (2 < 3)", 8), ("x if y else z", 6), ("not (1 < 2) + 3", 8), ("1 < 2", 3),
        ("2[rad]s", 7), ("2[rads]", 3), ("2[", 2), ("2[]", 3), ("2[rad", 2), ("x + 1e300[TN]", 5),
        ("2[%]", 3), ("1 if 2[m] else 0", 6),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_column(text: str, column: int) -> None:
    with pytest.raises(ValueError, match=rf"^column {column}: ") as refused:
        parsed(text)
    assert "\n" not in str(refused.value)


def test_long_texts_take_no_depth() -> None:
    text = " + ".join(["x"] * 100_000)
    assert evaluated(parse(text), {"x": 1.0}) == 100_000.0
    with_kinds(parse(f"{text} < 1"), CONDITION)


UNITS = {
    "m": of_exponents({"kg": 1}),
    "l": of_exponents({"m": 1}),
    "omega": of_exponents({"s": -1}),
    "time": of_exponents({"s": 1}),
    "phi": ONE,
}


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("m * l**2 * omega**2 / 2", "kg.m2/s2"),
        ("m * l**2 * omega**2 / 2 + 3", "kg.m2/s2"),
        ("sqrt(l**2 + 4) * omega", "m/s"),
        ("sin(phi) / time + omega", "1/s"),
        ("abs(-l) if time > 1 else max(0, l)", "m"),
        ("2**phi", "1"),
        ("1 / (m * time)", "1/(kg.s)"),
        ("l**0.5 * sqrt(l)", "m"),
        ("sqrt(m) * l**1.5 / sqrt(time)", "kg0.5.m1.5/s0.5"),
        ("omega * sqrt(1[V/Hz0.5] / 1[V]) * time**0.75", "1"),
        ("sin(2[rad/s] * time) * 3[mm]", "m"),
        ("tanh(omega / 0.5[rpm])", "1"),
        ("mod(time, 86400)", "s"),
        ("mod(time, -24 * 3600)", "s"),
        ("mod(l, 20[cm])", "m"),
        ("l**2[1] + l**-2[1] * l**4", "m2"),
    ],
)
def test_units(text: str, unit: str) -> None:
    assert shown(dimension_of(parse(text), UNITS)) == unit


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("m + l", 3),
        ("sin(l)", 1),
        ("l**phi", 2),
        ("phi**l", 4),
        ("l < m", 3),
        ("2 * 3 + l", 7),
        ("3[m] + time", 6),
        ("mod(time, 2[m])", 1),
        ("1[kg]", 1),
    ],
)
def test_units_that_do_not_fit(text: str, column: int) -> None:
    with pytest.raises(ExpressionError, match=f"^column {column}: "):
        dimension_of(parse(f"{text}"), UNITS, expected=UNITS["time"])


@pytest.mark.parametrize(
    ("text", "fits"),
    [
        ("2[kg] + 1[mm]", False), ("x + 2[kg] + 1[mm]", False), ("x * 2[kg] + 1[mm]", True),
        ("2[kg] if x > 0 else 1[m]", False), ("min(x, 2[kg], y) < 3[s]", False),
        ("sin(2[rad/s] * time) + x**2[m] + 1[J]", True), ("sin(2[m]) + x", False),
        ("sqrt(x) + 2[kg] - time", True), ("pi * 2[kg] + 1[m]", False),
    ],
)  # fmt: skip
def test_numbers_fit_each_other_among_names_of_any_unit(text: str, fits: bool) -> None:
    units = dict.fromkeys(("x", "y", "time"), ANY)
    if fits:
        dimension_of(parse(text), units)
    else:
        with pytest.raises(ExpressionError):
            dimension_of(parse(text), units)


def test_a_wrong_form_is_answered_by_the_right_one() -> None:
    for text in ("any(x > 3)", "any(i = 1..3)", "any(x[i] > 3, i = 1..3)", "any(i in 1..3, x > 1)"):
        with pytest.raises(
            ExpressionError, match=r": over a range it is any\(i = 1..n, x\[i] > 0\)$"
        ):
            parse(text)
    for text in ("min(x)", "min(i = 1..3)", "min(x[i], i = 1..3)", "min(1..3, x[i])"):
        with pytest.raises(ExpressionError, match=r": over a range it is min\(i = 1..n, x\[i]\)$"):
            parse(text)
    for text in ("2[rad]s", "2[rad] x", "2[m][s]", "2[rad](x)"):
        with pytest.raises(ExpressionError, match="behind a unit: write all of the unit between"):
            parse(text)
    for text in ("sin(x)[rad]", "(x)[m]"):
        with pytest.raises(
            ExpressionError, match=r"'\[': only numbers have units, as in 2\[rad/s]"
        ):
            parse(text)


def test_indexes_keep_units() -> None:
    def at(text: str) -> Node:
        return at_indexes(parse(text), {"n": 3})

    assert shown(dimension_of(at("sum(i = 1..n, i * 2[rad/s] * time) + n"), UNITS)) == "1"
    for text in ("l + n * 1[kg]", "sum(i = 1..n, i * 2[km]) + phi"):
        with pytest.raises(ExpressionError, match="do not fit"):
            dimension_of(at(text), UNITS)
    for text in ("x[2[m]]", "min(i = 1..3[m], i)"):
        with pytest.raises(ExpressionError, match="expected a whole number as index"):
            at(text)


def test_over_a_range() -> None:
    """The least, the greatest, any and all of terms; none of them without a term, or with it."""
    x = {f"x[{i}]": value for i, value in enumerate([3.0, -1.0, 7.0, 2.0], 1)}
    for text, value in (
        ("min(i = 1..n, x[i])", -1.0), ("max(i = 1..n - 2, i * x[i])", 3.0),
        ("max(x[1], x[2])", 3.0), ("min(i = 2..3, max(j = i..n, x[j]))", 7.0),
        ("1 if any(i = 1..n, x[i] > 6) else 0", 1.0), ("1 if all(i = 1..n, x[i] > 0) else 0", 0.0),
        ("1 if any(i = 1..0, x[i] > 6) else 0", 0.0), ("1 if all(i = 1..0, x[i] > 0) else 0", 1.0),
    ):  # fmt: skip
        assert evaluated(with_kinds(at_indexes(parse(text), {"n": 4})), x) == value, text
    with pytest.raises(ExpressionError, match="^column 1: min: the range is empty"):
        at_indexes(parse("min(i = 1..0, x[i])"), {})
    with pytest.raises(ExpressionError, match="^column 15: expected a condition"):
        with_kinds(at_indexes(parse("any(i = 1..2, x[i]) or x[1] > 0"), {}))


def test_a_number_with_a_unit_is_in_si() -> None:
    """Their nearest doubles, as the exact factor has them."""
    for text, value in (
        ("90[deg]", math.pi / 2), ("3[ mm ]", 0.003), ("20[degC]", 293.15), ("-2[min]", -120.0),
        ("-20[degC]", 253.15), ("- 20[degC] + 0", 253.15), ("-2[m]**2", -4.0),
        ("1.5e3 [rpm] / 1[rad/s]", 50 * math.pi), ("2**3[1]", 8.0), ("mod(7[km], 1.5[km])", 1000.0),
    ):  # fmt: skip
        assert parsed(text).value({}) == value
    assert written(parse("x + 3[mm] * y")) == "x + 0.003[m] * y"
    assert kind_of(parse("mod(k, 4)"), {"k": WHOLE}) == WHOLE  # as before


def test_a_unit_is_a_product_of_symbols() -> None:
    assert units.parsed("N.m.s/rad").exponents == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert units.parsed("V/(A.s)").exponents == {"kg": 1, "m": 2, "s": -4, "A": -2}
    assert units.parsed("1").exponents == {}
    for text in ("", "kg m", "m/s/s", "x", "m^2", "2", "1.m", "(m)", "m10", "m0", "m0.0", "m.5"):
        with pytest.raises(ValueError):
            units.parsed(text)


def test_exponents_may_be_halves() -> None:
    """Their factors are the nearest doubles: exact where they are a fraction."""
    kv = units.parsed("m3/(s.kPa0.5)")
    assert kv.exponents == {"m": 3.5, "kg": -0.5} and kv.base == "m3/(s.Pa0.5)"
    assert units.parsed("V/Hz0.5").exponents == {"kg": 1, "m": 2, "s": -2.5, "A": -1}
    assert units.parsed("cm0.5.m-0.5").factor == units.parsed("dm.m-1").factor
    with decimal.localcontext(prec=60):
        for text, square in (("kPa0.5", "1e3"), ("mm2.5", "1e-15"), ("1/bar1.5", "1e-15")):
            root = decimal.Decimal(square).sqrt()
            for number in ("1", "5", "0.3", "1e300", "7.123456789012345e-9"):
                assert units.parsed(text).value(number) == float(decimal.Decimal(number) * root)
    chance = random.Random(3)
    for _ in range(200):
        half = {base: Fraction(chance.choice([*range(-9, 0), *range(1, 10)]), 2) for base in "msA"}
        assert units.parsed(units.shown(half)).exponents == half
    for text in ("m0.3", "m1.50", "V/sqrt(Hz)", "V/Hz1/2", "m.5"):
        with pytest.raises(ValueError, match=r"^unit .* whole or halves, as in Hz0.5, up to 9.5"):
            units.parsed(text)


def test_files_and_scenarios_have_the_same_degrees() -> None:
    for i in range(-900, 900):
        assert units.parsed("deg/s").value(i / 10) == math.radians(i / 10)
    assert math.copysign(1.0, units.parsed("mm").value(-0.0)) == -1.0
