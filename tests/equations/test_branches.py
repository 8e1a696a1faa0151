"""Choices by modes: in each one values, derivatives and series are those of its equations.

Rows of series that the other branches need stay unwritten.
"""

import itertools
import re
import shutil
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from tests.equations.compiled import Model, c_model
from tests.equations.test_equation_derivatives import PYTHON, close
from tests.support.paths import ROOT

STATES, INPUTS = ("q1", "q2", "w1", "w2"), ("fx", "fy")
WHERE = {  # two joints that stick (0), slide (-1, 1) or are free (2), with stops that push (-1, 1)
    "rub1": "mode1 * (1 + exp(-(w1 / 0.5)**2)) if mode1 == 1 or mode1 == -1 else 0",
    "rub2": "mode2 * (2 + exp(-(w2 / 0.25)**2)) if mode2 == 1 or mode2 == -1 else 0",
    "depth": "0.5 - q2 if contact == 1 else q2 - 2",
    "stop": "contact * depth * (1 - contact * 0.1 * w2) if contact == 1 or contact == -1 else 0",
    "drive": "(1.5 + q2) * cos(q1) * fy - (1.5 + q2) * sin(q1) * fx",
    "force1": "drive - rub1 - 2 * w1 * w2 * (1 + q2) - 9 * cos(q1)",
    "force2": "cos(q1) * fx + sin(q1) * fy - rub2 + stop + w1**2 * q2 - 9 * sin(q1)",
    "J": "2 + (1 + q2)**2",
    "both1": "(force1 + 0.3 * force2) / (J - 0.09)",
    "a1": "both1 if mode1 != 0 and mode2 != 0 else force1 / J if mode1 != 0 else 0",
    "a2": "force2 + 0.3 * both1 if mode1 != 0 and mode2 != 0 else force2 if mode2 != 0 else 0",
    "held1": "force1 - 0.3 * a2 if mode1 == 0 else 1",
    "held2": "force2 - 0.3 * a1 if mode2 == 0 else 1",
}
RATES = {"q1": "w1", "q2": "w2", "w1": "a1", "w2": "a2"}
MODES = {"mode1": range(-1, 3), "mode2": range(-1, 3), "contact": range(-1, 2)}
SCALE = 0.1
POINT = {"q1": 0.3, "q2": 0.7, "w1": 0.4, "w2": -0.3, "fx": 0.8, "fy": -1.2}


def text_of(rates: Mapping[str, str], where: Mapping[str, str], more: str = "") -> str:
    """A file with equations whose outputs are the values of `where`."""
    return "\n".join([
        'name = "Joints"', more, "[discrete]",
        *(f'{m} = {{ type = "Integer", start = 0, min = {of[0]}, max = {of[-1]} }}'
          for m, of in MODES.items()),
        "[inputs]", *(f"{u} = {{}}" for u in INPUTS),
        "[states]", *(f'{x} = {{ derivative = "{rate}" }}' for x, rate in rates.items()),
        "[outputs]", *(f'{name} = {{ value = "{text}" }}' for name, text in where.items()),
    ])  # fmt: skip


@pytest.fixture(scope="module")
def joints(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """A model whose series has branches, though they save little."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("compiler.write.c_series.WORTH_BRANCHES", 0)
        model = Model(tmp_path_factory.mktemp("joints"), text_of(RATES, WHERE))
        extend = c_model.source(model.file).partition(" extend(")[2].partition("\n}\n")[0]
    assert "for (int i" in extend.partition("if (values->m_mode1 != 0")[2]
    return model


EACH_MODE = pytest.mark.parametrize("modes", [*itertools.product(*MODES.values())])


def values_in(model: Model, modes: tuple[int, ...], **given: float) -> np.ndarray:
    """A value structure in these modes."""
    values, ints = model.values(**given), dict(zip(MODES, modes, strict=True)) | {"is_begun": 1}
    names = re.findall(r"\bint (?:m_)?(\w+)[;[]", c_model.header(model.file))
    for name, value in ints.items():
        values[len(model.names) :].view(np.int32)[names.index(name)] = value
    return values


def exact(modes: tuple[int, ...], **known: mpmath.mpf) -> dict[str, mpmath.mpf]:
    """All values by states and inputs."""
    found = {**PYTHON, **dict(zip(MODES, modes, strict=True)), **known}
    for name, text in (WHERE | {f"d_{x}": rate for x, rate in RATES.items()}).items():
        found[name] = mpmath.mpf(eval(text, {"__builtins__": {}}, found))
    return found


@EACH_MODE
def test_values_and_derivatives_along_a_curve(joints: Model, modes: tuple[int, ...]) -> None:
    curve = {name: (x, 0.5 - x, x * x) for name, x in POINT.items()}
    orders = [{name: of[i] for name, of in curve.items()} for i in range(3)]
    values = values_in(joints, modes, **orders[0])
    first, second = (joints.values(**order) for order in orders[1:])
    joints.outputs(values, 0.0)
    joints.derivatives(values, 0.0, 1.0, first, second)
    alone = joints.values(**orders[1])
    joints.derivatives(values, 0.0, 1.0, alone, None)
    np.testing.assert_array_equal(alone, first)
    for name in (*WHERE, "d_w1", "d_w2"):

        def along(s: mpmath.mpf, name: str = name) -> mpmath.mpf:
            return exact(modes, **{n: a + b * s + c * s**2 / 2 for n, (a, b, c) in curve.items()})[
                name
            ]

        with mpmath.workdps(40):
            expected = mpmath.taylor(along, 0, 2)
        at = joints.names.index(name)
        for order, found in enumerate((values[at], first[at], second[at])):
            close(found, expected[order] * (order or 1), scale=100.0)


@EACH_MODE
def test_jacobian(joints: Model, modes: tuple[int, ...]) -> None:
    """Of a joint that sticks, derivatives by its velocity, which rests, are left out."""
    J = joints.jacobian(values_in(joints, modes, **POINT), 0.0)

    def at(name: str, by: str, x: mpmath.mpf) -> mpmath.mpf:
        return exact(modes, **(POINT | {by: x}))[name]

    for (i, of), (k, by) in itertools.product(enumerate(STATES), repeat=2):
        with mpmath.workdps(40):
            slope = mpmath.diff(partial(at, f"d_{of}", by), POINT[by])
        rests = by in ("w1", "w2") and modes[int(by[1]) - 1] == 0
        close(J[i, k], mpmath.mpf(0) if rests else slope, scale=100.0)


def assert_fits(model: Model, rows: np.ndarray, inputs: np.ndarray, right: Any) -> None:
    """Assert that the derivatives of the series have the coefficients of the right sides."""
    order = rows.shape[1] - 1
    with mpmath.workdps(80):
        names = [v.name for v in model.file.of("states")]
        series = dict(zip((*names, *INPUTS), [*rows.tolist(), *inputs.tolist()], strict=True))
        for i, name in enumerate(names):

            def side(s: mpmath.mpf, name: str = name) -> mpmath.mpf:
                return SCALE * right(
                    name, {n: mpmath.polyval(c[::-1], s) for n, c in series.items()}
                )

            expected = mpmath.taylor(side, 0, order - 1)
            for k in range(order):
                close((k + 1) * rows[i, k + 1], expected[k], scale=10.0)


@EACH_MODE
@pytest.mark.parametrize("has_inputs", [False, True])
def test_series(joints: Model, modes: tuple[int, ...], has_inputs: bool) -> None:
    inputs = np.zeros((2, 4))
    if has_inputs:
        inputs[:] = [[0.0, 0.3, -0.2, 0.1], [POINT["fy"], 0.0, 0.0, 0.2]]
    rows = joints.series(values_in(joints, modes, **POINT), 0.0, SCALE, inputs, 7)
    assert_fits(joints, rows, inputs, lambda name, x: exact(modes, **x)[f"d_{name}"])


LAW = """
#include "real.h"
static real tail(real v) { return exp(-(v * v)) * v; }
real law(real v) {
    if (value_of(v) > 1.0) {
        return tail(v) * (v + 2.0);
    }
    return value_of(v) < 0.0 ? v * v * v : sin(v) + v * v;
}
"""


@pytest.mark.parametrize("worth", [0, 10**9])
@pytest.mark.parametrize(
    ("start", "law"),
    [(-0.01, "w1**3"), (0.99, "sin(w1) + w1**2"), (1.01, "exp(-w1**2) * w1 * (w1 + 2)")],
)
def test_values_that_c_compares_decide_at_the_origin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, start: float, law: str, worth: int
) -> None:
    """The series is that of one branch, also where it moves to the other one."""
    monkeypatch.setattr(c_model, "_has_kinks", lambda _: False)
    monkeypatch.setattr("compiler.write.c_series.WORTH_BRANCHES", worth)
    (tmp_path / "law.h").write_text(LAW, encoding="utf-8")
    shutil.copy(ROOT / "models" / "real.h", tmp_path)
    rates = {"q1": "w1", "w1": "0.3 * fx - 3 * law(w1)"}
    model = Model(tmp_path, text_of(rates, {}, 'code = "law.h"'))
    inputs = np.array([[-9.0, 0.5, 0.0, 0.0], [0.0] * 4])
    rows = model.series(model.values(q1=0.1, w1=start), 0.0, SCALE, inputs, 9)
    texts = rates | {"w1": rates["w1"].replace("law(w1)", f"({law})")}
    assert_fits(
        model, rows, inputs, lambda name, x: eval(texts[name], {"__builtins__": {}}, PYTHON | x)
    )
