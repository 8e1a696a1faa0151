"""Names in the C of a file with equations: a reader finds each equation by its name."""

import math
import re
from pathlib import Path

import pytest

from tests.equations.compiled import Model, c_model, read_text
from tests.equations.examples import FOLDER

# names of C, of its headers, and of what the writer itself declares
WORDS = """
double register EOF NULL DOMAIN M_PI y1 gamma values state rate slope input first second count order
relations t t1 is1 x d_x dd_x x_by_x sin_x r0 row k h s s0 p0 at numbers to
"""
AWKWARD = WORDS.split()


def function(source: str, name: str) -> str:
    """The text of a function."""
    return source.partition(f" {name}(")[2].partition("\n}\n")[0]


def written(folder: Path, name: str) -> str:
    text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    return c_model.source(read_text(folder, text))


def test_equations_stand_under_their_names(tmp_path: Path) -> None:
    source = written(tmp_path, "cart_and_pole")
    lines = " ".join(function(source, "right_hand_side").split())
    for equation in (
        "const double inertia = values->v_m_cart + m_pole * (sin_phi * sin_phi);",
        "const double der_omega = -(a * cos_phi + g * sin_phi) / l;",
        "rate[3] = der_omega;",
    ):
        assert equation in lines
    assert "const double a_by_phi = " in function(source, "jacobian")
    for name in ("d_inertia", "dd_inertia", "d_a"):
        assert f"const double {name} = " in function(source, "derivatives")


def test_an_element_stands_under_its_name_in_a_loop(tmp_path: Path) -> None:
    rate = '"k * (f[i-1] if i > 1 else 0) - f[i]"'
    source = c_model.source(read_text(tmp_path, f"""
name = "Row"
[sizes]
n = 200
[parameters]
k = {{ start = 2 }}
[states]
"x[i]" = {{ for = "i = 1..n", derivative = {rate} }}
[where]
"f[i]" = {{ for = "i = 1..n", value = "sin(x[i]) * k" }}
"""))  # fmt: skip
    lines = " ".join(function(source, "right_hand_side").split())
    assert "f[r0] = sin(state[r0]) * values->v_k;" in lines
    assert "rate[1 + r0] = values->v_k * f[r0] - f[1 + r0];" in lines


@pytest.mark.parametrize("name", AWKWARD)
def test_a_name_of_c_is_one_of_an_equation_too(tmp_path: Path, name: str) -> None:
    model = Model(tmp_path, f"""
name = "Names"
[parameters]
p = {{ start = 0.5 }}
[states]
{name} = {{ derivative = "sin({name}) * w + w" }}
[where]
w = "p * {name}"
[outputs]
z = {{ value = "{name} * w + exp({name})" }}
""")  # fmt: skip
    values = model.values(**{"p": 0.5, name: 0.3})
    model.outputs(values, 0.0)
    found = dict(zip(model.names, values, strict=False))
    assert found["z"] == pytest.approx(0.3 * 0.15 + math.exp(0.3), rel=1e-15)
    slope = math.cos(0.3) * 0.15 + math.sin(0.3) * 0.5 + 0.5
    assert model.jacobian(values, 0.0)[0, 0] == pytest.approx(slope, rel=1e-14)


def test_constants_have_names_of_their_own(tmp_path: Path) -> None:
    for name in ("drive", "axis", "pwm"):
        source = written(tmp_path, name)
        for body in re.findall(
            r"^[\w *]+\([^;{]*\) \{\n(.*?)^\}", source, re.MULTILINE | re.DOTALL
        ):
            straight = re.findall(r"^    const \w+ (\w+) =", body, re.MULTILINE)
            assert len(straight) == len({*straight})
