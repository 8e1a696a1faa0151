"""Cost of gradients: a run with those by 1, 5 and 20 parameters against the run without them."""

from operator import truediv
from statistics import median

from by_models import by_fmu

from tests.equations.examples import METHODS, build, made

COUNTS = 1, 5, 20
MASSES = """
name = "Masses"
experiment = { stop = 10.0, tolerance = 1e-6 }
[sizes]
n = 10
[parameters]
"k[i]" = { for = "i = 1..n", start = 40.0 }
"c[i]" = { for = "i = 1..n", start = 0.5 }
[states]
"x[i]" = { for = "i = 1..n", start = "0.1 * sin(i)", derivative = "v[i]" }
"v[i]" = { for = "i = 1..n", derivative = "(sin(3 * time) if i == 1 else f[i-1]) - f[i]" }
[where]
"d[i]" = { for = "i = 1..n", value = "x[i] - (0 if i == n else x[i+1])" }
"w[i]" = { for = "i = 1..n", value = "v[i] - (0 if i == n else v[i+1])" }
"f[i]" = { for = "i = 1..n", value = "k[i] * d[i] * (1 + d[i]**2) + c[i] * w[i]" }
"""
STIFF = MASSES.replace("start = 0.5", "start = 500.0")  # dampers
PARAMETERS = [f"{name}[{i}]" for name in "kc" for i in range(1, 11)]
STEP, TOLERANCE = 10.0, 1e-6


def with_gradients(text: str, count: int) -> str:
    """Return the equations with the gradients by the first parameters."""
    return f"{text}\n[gradients]\nby = {PARAMETERS[:count]}\n".replace("'", '"')


def rows(turns: int) -> list[dict]:
    """Measure, in base runs: BDF may take 1 and 1.2 a parameter, the others 2 and 1 a
    parameter."""
    found = []
    for method in METHODS:
        text, limit = (STIFF, (1.2, 1.0)) if method == "cvode_bdf" else (MASSES, (1.0, 2.0))
        base = by_fmu(made(text, build), method, STEP)[0]
        for count in COUNTS:
            own = by_fmu(made(with_gradients(text, count), build), method, STEP)[0]
            times = [(own(TOLERANCE)[0], base(TOLERANCE)[0]) for _ in range(turns)]
            found.append({
                "group": "gradients", "work": f"gradients by {count}", "run": method,
                "us": 1e6 * median(time for time, _ in times),
                "ratio": median(truediv(*pair) for pair in times),
                "judged": "ratio", "limit": limit[0] * count + limit[1],
            })  # fmt: skip
    return found
