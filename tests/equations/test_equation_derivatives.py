"""Random equations against mpmath: values, Jacobians, derivatives along a curve, Taylor series.

And the arm from a file with equations against the one that is written by hand.
"""

import random
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import mpmath
import numpy as np
import pytest

from tests.equations.compiled import LENGTH, Model, c_model, read_text
from tests.equations.examples import MODELS
from tests.support.paths import ROOT

BOUND = 1e-13
WIDE = 10**9  # values that move
NAMES = ("p", "u", "x", "y")
PYTHON = {name: getattr(mpmath, name) for name in dir(mpmath) if not name.startswith("_")}
PYTHON |= {"abs": abs, "min": min, "max": max}
# functions of e that are well conditioned for any e
FORMS = [
    "sin({})", "cos({})", "tan(tanh({}))", "atan({})", "tanh({})", "asin(0.5 * tanh({}))",
    "acos(0.5 * sin({}))", "sinh(sin({}))", "cosh(tanh({}))", "exp(sin({}))", "log(2.0 + sin({}))",
    "sqrt(2.0 + tanh({}))", "(1.5 + cos({}))**2.5", "(1.5 + sin({}))**-1", "sin({})**3",
    "cos({})**12", "log10(2.0 + sin({}))", "hypot(sin({0}), 1.5 + cos({0}))",
    "-{}", "{0} / (2.0 + sin({0}))", "(1.5 + sin({0}))**(0.5 * cos({0}))", "({})",
    "atan2(sin({0}), 1.5 + cos({0}))", "(p + 1 if p < 2 else p - 1) * {}", "max(p, 0.25) * {}",
]  # fmt: skip


def expression(chance: random.Random, depth: int) -> str:
    """Text that means the same in Python, between about -10 and 10."""
    if depth == 0:
        return chance.choice([*NAMES, "time", "0.5", "2.0", "pi"])
    inner = expression(chance, depth - 1)
    if chance.random() < 0.5:
        return chance.choice(FORMS).format(inner)
    other = expression(chance, chance.randrange(depth))
    return f"({inner} {chance.choice('+-*')} {other}) / 3"


def reference(text: str, names: Sequence[str] = (*NAMES, "time")) -> Callable[..., mpmath.mpf]:
    return eval(f"lambda {', '.join(names)}: {text}", {**PYTHON, "__builtins__": {}})


@pytest.fixture(scope="module", params=range(6))
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple:
    """A model, texts of its equations, and a point."""
    chance = random.Random(request.param)
    texts = {name: expression(chance, 5) for name in ("x", "y", *(f"z{i}" for i in range(20)))}
    outputs = "".join(f'{n} = {{ value = "{t}" }}\n' for n, t in texts.items() if n[0] == "z")
    model = Model(
        tmp_path_factory.mktemp("model"),
        'name = "Random"\n[parameters]\np = { start = 1 }\n[inputs]\nu = {}\n[states]\n'
        f'x = {{ derivative = "{texts["x"]}" }}\ny = {{ derivative = "{texts["y"]}" }}\n'
        f"[outputs]\n{outputs}",
    )
    point = {name: chance.uniform(-1.5, 1.5) for name in (*NAMES, "time")}
    return model, texts, point, chance


def field(name: str) -> str:
    return f"d_{name}" if name in "xy" else name


def close(found: float, expected: mpmath.mpf, scale: float = 1.0) -> None:
    assert abs(found - expected) <= BOUND * max(scale, abs(expected)), (found, expected)


@pytest.mark.parametrize("order", [1, 2])
def test_values_and_derivatives_along_a_curve(case: tuple, order: int) -> None:
    """A parameter moves where only first derivatives are asked for."""
    model, texts, point, chance = case
    values = model.values(**point)
    moving = NAMES if order == 1 else NAMES[1:]
    first, second = (
        model.values(**{name: chance.uniform(-1, 1) for name in moving}) for _ in range(2)
    )
    dt = chance.uniform(0.5, 1)
    model.outputs(values, point["time"])
    curves = {n: [v[model.names.index(n)] for v in (values, first, second)] for n in NAMES}
    curves["time"] = [point["time"], dt, 0.0]
    model.derivatives(values, point["time"], dt, first, second if order == 2 else None)
    for name, text in texts.items():
        function = reference(text)

        def along(s: mpmath.mpf, function: Callable[..., mpmath.mpf] = function) -> mpmath.mpf:
            return function(**{n: a + b * s + c * s**2 / 2 for n, (a, b, c) in curves.items()})

        with mpmath.workdps(40):
            coefficients = mpmath.taylor(along, 0, order)
        at = model.names.index(field(name))
        for k, found in enumerate((values[at], first[at], second[at])[: order + 1]):
            close(found, coefficients[k] * (k or 1), scale=10.0**k)


def test_jacobian(case: tuple) -> None:
    model, texts, point, _ = case
    J = model.jacobian(model.values(**point), point["time"])
    for i, of in enumerate("xy"):
        for k, by in enumerate("xy"):
            with mpmath.workdps(40):
                others = {name: mpmath.mpf(value) for name, value in point.items()}
                slope = mpmath.diff(
                    lambda s, of=of, by=by, o=others: reference(texts[of])(**{**o, by: s}),
                    others[by],
                )
            close(J[i, k], slope, scale=10.0)


def test_series_fits_the_equations(case: tuple) -> None:
    """Of the polynomials of the states: the derivative has the coefficients of the right side."""
    model, texts, point, chance = case
    scale, order = 0.2, 12
    inputs = np.array([[point["u"], 0.3, -0.2, 0.1]])
    rows = model.series(model.values(**point), point["time"], scale, inputs, order)
    assert not model.words.events and rows.shape[1] < LENGTH
    with mpmath.workdps(80):
        polynomials = {"x": list(rows[0]), "y": list(rows[1]), "u": list(inputs[0])}
        polynomials["time"] = [point["time"], scale]
        for name in "xy":

            def side(s: mpmath.mpf, text: str = texts[name]) -> mpmath.mpf:
                at = {n: mpmath.polyval(c[::-1], s) for n, c in polynomials.items()}
                return scale * reference(text)(p=point["p"], **at)

            expected = mpmath.taylor(side, 0, order - 1)
            for k in range(order):
                close((k + 1) * polynomials[name][k + 1], expected[k])


def minus(chance: random.Random, depth: int) -> str:
    """Text of nothing but signs and differences."""
    if depth == 0:
        return chance.choice(["p", "u", "time", "0.5", f"x{chance.randrange(24)}"])
    inner = minus(chance, depth - 1)
    left = minus(chance, chance.randrange(2))
    return chance.choice([f"-{inner}", f"-({inner})", f"{left} - {inner}", f"{left} - ({inner})"])


@pytest.mark.parametrize("seed", range(3))
def test_signs_and_differences_nest(tmp_path: Path, seed: int) -> None:
    """Coefficients are as linear as differences: Python takes these of arrays."""
    chance = random.Random(seed)
    texts = {f"x{i}": minus(chance, 1 + i // 3) for i in range(24)}
    states = "".join(f'{name} = {{ derivative = "{text}" }}\n' for name, text in texts.items())
    head = 'name = "Minus"\n[parameters]\np = { start = 1 }\n[inputs]\nu = {}\n[states]\n'
    model = Model(tmp_path, head + states)
    point = {name: chance.uniform(-1, 1) for name in (*texts, "p", "u", "time")}
    scale, inputs = 0.5, np.array([[point["u"], 0.3, -0.2, 0.1]])
    values = model.values(**point)
    rows = model.series(values, point["time"], scale, inputs, 6)
    rest = np.zeros(6)
    known = {name: rows[i, :6] for i, name in enumerate(texts)} | {
        "u": np.array([*inputs[0], 0, 0])
    }
    known |= {"p": rest, "time": np.array([0, scale, 0, 0, 0, 0])}
    model.outputs(values, point["time"])
    for i, (name, text) in enumerate(texts.items()):
        value = eval(text, dict(point))
        assert values[model.names.index(f"d_{name}")] == value
        expected = eval(re.sub(r"\b0\.5\b", "rest", text), known | {"rest": rest})
        expected = np.array([value, *np.asarray(expected)[1:]]) * scale / np.arange(1, 7)
        np.testing.assert_allclose(rows[i, 1:], expected, rtol=0, atol=1e-14)


def test_a_branch_that_is_not_taken_may_be_undefined(tmp_path: Path) -> None:
    """Where p = 0 all derivatives are those of the other branch."""
    found = []
    for name, rate in (
        ("branch", "x / p + log(p) * x**p + sqrt(p - x) if p > 0 else -x"),
        ("x", "-x"),
    ):
        (tmp_path / name).mkdir()
        head = 'name = "M"\n[parameters]\np = { start = 0 }\n'
        model = Model(tmp_path / name, f'{head}[states]\nx = {{ derivative = "{rate}" }}\n')
        values = model.values(x=0.7, p=0.0)
        by_parameter, first, second = (
            model.values(x=x, p=p) for x, p in ((0.2, 0.3), (0.2, 0.0), (-0.4, 0.0))
        )
        model.outputs(values, 0.0)
        model.derivatives(values, 0.0, 1.0, by_parameter, None)
        model.derivatives(values, 0.0, 1.0, first, second)
        series = model.series(values, 0.0, 0.5, np.zeros((1, 4)), 20)
        found.append([values, by_parameter, first, second, model.jacobian(values, 0.0), series])
    for branch, alone in zip(*found, strict=True):
        np.testing.assert_array_equal(branch, alone)
        assert np.all(np.isfinite(branch))


ENDS = MODELS["derivatives_at_ends"]["of_domains"]


def test_a_series_with_values_side_by_side_is_the_same(
    case: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As large models have it (fmu/compiler/write/c_series.py)."""
    model, _, point, _ = case
    given = (
        model.values(**point),
        point["time"],
        0.2,
        np.array([[point["u"], 0.3, -0.2, 0.1]]),
        12,
    )
    monkeypatch.setattr("compiler.write.sums.FEWEST_IN_PAIRS", WIDE)
    text = model.file.text.partition("[outputs]")[0]
    one_by_one = Model(tmp_path, text)
    np.testing.assert_array_equal(one_by_one.series(*given), model.series(*given))
    monkeypatch.setattr("compiler.write.c_series.WIDE", 0)
    wide = Model(tmp_path, text)
    assert "const at)" in (tmp_path / "equations.c").read_text()
    np.testing.assert_allclose(wide.series(*given), model.series(*given), rtol=1e-12, atol=1e-14)


def test_sums_of_one_form_are_side_by_side(tmp_path: Path) -> None:
    """Compilers shuffle vectors where sums of several forms take turns in the array."""
    text = (ROOT / "tests" / "bench" / "pleiades.toml").read_text(encoding="utf-8")
    source = c_model.source(read_text(tmp_path, text))
    assert re.search(r" s\[\d+ \+ r0\] = s\[\d+ \+ r0\] \+ ", source)  # four terms at once
    assert not re.search(r" s\[\d+ \+ \d+ \* r0\]", source)


def test_a_rate_may_be_a_state_before_its_own(tmp_path: Path) -> None:
    states = ['x = { derivative = "v" }', 'v = { derivative = "-x * x * v" }']
    found = []
    for folder, order in (("after", states), ("before", states[::-1])):
        (tmp_path / folder).mkdir()
        model = Model(tmp_path / folder, "\n".join(['name = "M"', "[states]", *order]))
        found.append(model.series(model.values(x=0.7, v=0.4), 0.0, 0.5, np.zeros((1, 4)), 12))
    np.testing.assert_array_equal(found[0], found[1][::-1])


def test_1_over_a_denominator_may_be_infinite(tmp_path: Path) -> None:
    rate = '"-b * x / (b + b * x**2)"'
    model = Model(
        tmp_path, f'name = "M"\n[inputs]\nb = {{}}\n[states]\nx = {{ derivative = {rate} }}'
    )
    tiny, usual = (
        model.series(model.values(x=0.7), 0.0, 0.5, np.array([[b, 0.0, 0.0, 0.0]]), 12)
        for b in (1e-310, 1.0)
    )
    np.testing.assert_allclose(tiny, usual, rtol=0.0, atol=1e-12)


def test_avx2_gives_the_bits_of_sse2(tmp_path: Path) -> None:
    """Of seven stars in a plane, the Pleiades problem."""
    text, start = 'name = "Stars"\n[states]\n', {}
    for i, (x, y) in enumerate(zip((3, 3, -1, -3, 2, -2, 2), (3, -3, 2, 0, 0, -4, 4), strict=True)):
        start |= {f"x{i}": x, f"y{i}": y, f"u{i}": 0.3 * y, f"v{i}": -0.2 * x}
        for place, velocity in ("xu", "yv"):
            pulls = (
                f"{j + 1} * ({place}{j} - {place}{i}) / ((x{j} - x{i})**2 + (y{j} - y{i})**2)**1.5"
                for j in range(7)
                if j != i
            )
            text += f'{place}{i} = {{ derivative = "{velocity}{i}" }}\n'
            text += f'{velocity}{i} = {{ derivative = "{" + ".join(pulls)}" }}\n'
    model = Model(tmp_path, text, "-O3")
    given = model.values(**start), 0.0, 0.1, np.zeros((1, 4)), 20
    found = model.series(*given)
    assert np.abs(found[:, 20]).min() > 0.0
    has_avx2 = " avx2 " in Path("/proc/cpuinfo").read_text()
    np.testing.assert_array_equal(model.series(*given, has_avx2), found)


def test_derivatives_where_plain_rules_give_none(tmp_path: Path) -> None:
    """Finite ones are found; others are not finite, never a wrong number."""
    text, given = 'name = "M"\n[parameters]\n', {}
    text += "".join(f"p{i} = {{ start = 1 }}\n" for i in range(len(ENDS))) + "[states]\n"
    for i, (rate, point, _) in enumerate(ENDS):
        own = re.sub(r"\b([xyp])\b", rf"\g<1>{i}", rate)
        text += f'x{i} = {{ derivative = "{own}" }}\ny{i} = {{ derivative = "0" }}\n'
        given |= {f"{name}{i}": value for name, value in point.items()}
    model = Model(tmp_path, text)
    values = model.values(**given)
    model.outputs(values, 0.0)
    J = model.jacobian(values, 0.0)
    for i, (rate, _, expected) in enumerate(ENDS):
        at = model.names.index(f"d_x{i}")
        assert np.isfinite(values[at]), rate
        for k, (by, slope) in enumerate(zip("xyp", expected, strict=True)):
            first = model.values(**{f"{by}{i}": 1.0})
            model.derivatives(values, 0.0, 0.0, first, model.values())
            for found in (first[at], *J[2 * i, 2 * i : 2 * i + 2][k : k + 1]):
                is_right = found == slope if np.isfinite(slope) else not np.isfinite(found)
                assert is_right, (rate, by)


@pytest.mark.parametrize("wide", [0, WIDE])
def test_a_series_of_a_power_begins_at_0(
    tmp_path: Path, wide: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of an exponent that is a parameter: a whole one, or half a one of a square."""
    monkeypatch.setattr("compiler.write.c_series.WIDE", wide)
    head = 'name = "M"\n[parameters]\nn = { start = 1 }\n[states]\n'
    text = 'x = { derivative = "2 + time" }\ny = { derivative = "(3 * x)**n" }\n'
    text += 'z = { derivative = "(x * x)**(0.5 + n / 2)" }\n'
    model, x = Model(tmp_path, head + text), np.polynomial.Polynomial([0.0, 2.0, 0.5])
    for n in (1, 2, 3, 5, 17):
        rows = model.series(model.values(n=n), 0.0, 0.7, np.zeros((1, 4)), 20)
        for row, side in ((rows[1], (3 * x) ** n), (rows[2], x ** (n + 1))):
            known = side.integ().coef[:21]
            scaled = known * 0.7 ** np.arange(len(known))
            np.testing.assert_allclose(row[: len(known)], scaled, rtol=1e-13, atol=1e-300)
