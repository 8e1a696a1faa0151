"""C of a file reads the unknown forces of friction and stops as fields of its struct of values."""

from pathlib import Path

from fmpy import simulate_fmu

from tests.equations.examples import build

FILE = """
name = "Slide"
code = "slide.h"
[sizes]
n = 2
[states]
"x[i]" = { for = "i = 1..n", start = "0.5 * i", derivative = "v[i]" }
"v[i]" = { for = "i = 1..n", derivative = "a[i]" }
[where]
"a[i]" = { for = "i = 1..n" }
[outputs]
taken = {}
steps = { type = "Integer", value = "2 if friction.first.mode == 'stuck' else 1", min = 0, max = 9 }
[friction.first]
force = "F[1]"
velocity = "v[1]"
coulomb = "0.5"
[friction.second]
force = "F[2]"
velocity = "v[2]"
coulomb = "0.5"
[stops.end]
force = "P"
position = "x[2]"
velocity = "v[2]"
lower = "0"
restitution = "0.5"
"""
CODE = """
#include "slide_values.h"
static void slide_calculate(struct slide_values *values) {
    values->a[0] = -1.0 - values->F[0];
    values->a[1] = -1.0 - values->F[1] + values->P;
    values->taken = values->F[0] * values->v[0] + values->F[1] * values->v[1];
}
"""


def test_two_slides_fall_and_one_bounces(tmp_path: Path) -> None:
    """Each falls with 1 - 0.5; the second one, from 1, meets its stop at 2 with 1."""
    (tmp_path / "slide.toml").write_text(FILE, encoding="utf-8")
    (tmp_path / "slide.h").write_text(CODE, encoding="utf-8")
    fmu = build(tmp_path / "slide.toml", tmp_path)
    names = ["v[1]", "v[2]", "taken", "stops.end.impulse", "stops.end.impulses", "steps"]
    found = simulate_fmu(
        fmu, stop_time=2.2, output_interval=0.1, relative_tolerance=1e-10, output=names
    )
    at = {name: found[name][-1] for name in found.dtype.names}
    assert abs(at["v[1]"] + 0.5 * 2.2) < 1e-8
    assert abs(at["v[2]"] - (0.5 - 1.5 * 0.2)) < 1e-8
    assert abs(at["taken"] - 0.5 * (0.5 * 2.2 + 0.2)) < 1e-8
    assert abs(at["stops.end.impulse"] - 1.5) < 1e-8
    assert at["steps"] == 1
    assert at["stops.end.impulses"] == at["stops.end.impulse"]
