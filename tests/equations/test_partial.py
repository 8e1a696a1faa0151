"""partial(E, NAME) in files with equations: closed forms along a motion, and its mistakes."""

from pathlib import Path

import numpy as np
import pytest

from tests.equations.compiled import ModelFileError, read_text
from tests.equations.examples import METHODS, quick, simulated

CODE = "double pull(double x, double k) { return x > 0.0 ? k * x * x : -x; }\n"
TEXT = """name = "Partial"
code = "pull.c"
[parameters]
l = { start = 2, unit = "m" }
k = { start = 3 }
[inputs]
u = { start = 0.5 }
[tables.T]
x = [-2, 0, 1.5, 3]
y = [0, 1, 4, 5]
[functions]
cube = { arguments = ["z"], value = "z**3" }
[states]
phi = { start = 0.3, unit = "rad", derivative = "omega" }
omega = { unit = "rad/s", derivative = "-weight / l * sin(phi)" }
"x[i]" = { for = "i = 1..2", start = 1, derivative = "-0.1[1/s] * x[i] * x[3 - i]" }
s = { start = 0, derivative = "1[1/s] * partial(cube(x[1]) * exp(sqrt(x[2]) * x[1]), x[1])" }
[where]
weight = "9.81[m/s2]"
[algebraic]
z = { start = 1, equation = "z + exp(z * x[1]) - 4" }
[outputs]
by_state = { value = "partial(der(omega), phi)", unit = "1/s2" }
by_parameter = { value = "partial(der(omega), l)", unit = "rad/(m.s2)" }
by_input = { value = "partial(u**2 * phi, u)", unit = "rad" }
by_time = { value = "partial(sin(2[1/s] * time), time)", unit = "1/s" }
of_table = { value = "partial(T(x[1]), x[1])" }
of_code = { value = "partial(pull(x[1], k), x[1])" }
of_block = { value = "partial(z, x[1])" }
z_shown = { value = "z" }
twice = { value = "partial(partial(x[1]**3 * x[2], x[1]), x[2])" }
"""


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_it_is_the_derivative_by_a_name(method: int, tmp_path: Path) -> None:
    for name, text in {"pull.c": CODE, "partial.toml": TEXT}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    fmu = quick(tmp_path / "partial.toml", tmp_path)
    run = simulated(fmu, 2.0, 0.1, {"solver_method": method}, relative_tolerance=1e-10)
    a, z = run["x[1]"], run["z_shown"]
    grown = np.exp(z * a)
    expected = {
        "by_state": -9.81 / 2 * np.cos(run["phi"]), "by_parameter": 9.81 / 4 * np.sin(run["phi"]),
        "by_input": 2 * 0.5 * run["phi"], "by_time": 2 * np.cos(2 * run["time"]),
        "of_table": np.full(len(a), 2.0), "of_code": 6 * a,
        "of_block": -z * grown / (1 + a * grown),
        "twice": 3 * a**2,
    }  # fmt: skip
    for name, values in expected.items():
        assert run[name] == pytest.approx(values, abs=1e-9), name


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("partial(phi, 2)", "column 14: expected a name to derive by, got '2'"),
        ("partial(phi)", "column 12: expected ',', got ')'"),
        ("partial(phi, half)", "column 14: expected a state, an input, a parameter"),
        ("partial(phi, nothing)", "column 14: unknown name 'nothing'"),
        ("partial(phi > 0, phi)", "expected a number, '>' gives a condition"),
        ("partial(phi, l) + l", "units 1/m and m do not fit"),
    ],
)  # fmt: skip
def test_a_mistake_is_named(value: str, message: str, tmp_path: Path) -> None:
    text = f'''name = "P"
[parameters]
l = {{ start = 1, unit = "m" }}
[states]
phi = {{ unit = "rad", derivative = "0" }}
[where]
half = "phi / 2"
wrong = "{value}"
'''
    with pytest.raises(ModelFileError) as error:
        read_text(tmp_path, text)
    assert message in str(error.value)


def test_a_variable_of_this_name_wins_and_so_does_a_function(tmp_path: Path) -> None:
    text = """name = "P"
[functions]
partial = { arguments = ["x", "y"], value = "x + y" }
[states]
x = { start = 1, derivative = "partial(x, 2)" }
"""
    assert read_text(tmp_path, text).of("states")[0].expression.tree.op != "partial"
