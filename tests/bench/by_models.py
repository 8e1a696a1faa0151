"""Models in equations, a step of 2 s of their FMUs: Pleiades next to heyoka, a chain as a band."""

import sys
import tomllib
from collections.abc import Callable
from functools import cache
from itertools import combinations
from pathlib import Path
from statistics import median
from time import thread_time

import heyoka as hy
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parents[1]))
from tests.equations.examples import METHODS, initializing, made  # noqa: E402

STEP, COLUMN = 2.0, "one step of 2 s, free motion, error <= 1e-8"  # s
STARS = range(7)
# a state that follows all others: its row of the Jacobian is full
FULL = '\nall = { derivative = "(k - 40) * sum(i = 1..n, v[i])" }\n[where]'
PLEIADES, CHAIN = ((HERE / f"{name}.toml").read_text() for name in ("pleiades", "chain"))
START = np.array([x for v in tomllib.loads(PLEIADES)["states"].values() for x in v["start"]])
Run = Callable[[float], tuple[float, np.ndarray]]  # by tolerance: processor time, s; states


def by_fmu(text: str, method: str, folder: Path) -> Run:
    """Return what makes the step by the FMU of a text."""
    instance = initializing(made(folder, text))
    references, fmu = instance.loaded.references, instance.fmi
    states = [references[n] for base in "xyuv" for n in references if n.startswith(f"{base}[")]

    def run(tolerance: float) -> tuple[float, np.ndarray]:
        fmu.reset()
        fmu.setInteger([references["solver_method"]], [METHODS[method]])
        fmu.setupExperiment(tolerance=tolerance)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        begin = thread_time()
        fmu.doStep(0.0, STEP)
        return thread_time() - begin, np.array(fmu.getReal(states))

    return run


@cache
def pleiades(tolerance: float, real: type) -> hy.taylor_adaptive:
    """Compile the equations of seven stars, each pair once."""
    x, y, u, v = (hy.make_vars(*(f"{base}{i}" for i in STARS)) for base in "xyuv")
    pulls = [[[] for _ in STARS] for _ in range(2)]
    for i, j in combinations(STARS, 2):
        ways = x[j] - x[i], y[j] - y[i]
        weight = (ways[0] ** 2 + ways[1] ** 2) ** -1.5
        for of, way in zip(pulls, ways, strict=True):
            pull = way * weight
            of[i].append((j + 1.0) * pull)
            of[j].append(-(i + 1.0) * pull)
    rates = [*u, *v, *(hy.sum(own) for of in pulls for own in of)]
    equations = list(zip([*x, *y, *u, *v], rates, strict=True))
    return hy.taylor_adaptive(equations, START.astype(real), tol=real(tolerance), fp_type=real)


def by_heyoka(tolerance: float, real: type = float) -> tuple[float, np.ndarray]:
    """Make the step of Pleiades."""
    taylor = pleiades(tolerance, real)
    taylor.time, taylor.state[:] = real(0.0), START
    begin = thread_time()
    taylor.propagate_until(real(STEP))
    return thread_time() - begin, taylor.state.copy()


def row(name: str, turns: int, exact: np.ndarray, limit: float, *peers: tuple[Run, float]) -> dict:
    """Let two take turns at their tolerances."""
    times = np.array([[run(tolerance)[0] for run, tolerance in peers] for _ in range(turns)])
    ends = [run(tolerance)[1] for run, tolerance in peers]
    own, other = (float(np.abs(end - exact).max() / np.abs(exact).max()) for end in ends)
    return {
        "group": "models", "work": f"one step of {STEP:g} s", "column": COLUMN, "run": name,
        "us": 1e6 * median(times[:, 0]), "ratio": median(times[:, 0] / times[:, 1]),
        "error": own, "error_of_peer": other, "judged": "ratio", "limit": limit,
    }  # fmt: skip


def rows(folder: Path, turns: int) -> list[dict]:
    """Measure; heyoka has an error no larger than the FMU's."""
    named = "Pleiades, taylor to heyoka", 1, by_heyoka(1e-19, np.longdouble)[1], 1.0
    fmu, tolerance = (by_fmu(PLEIADES, "taylor", folder), 1e-12), 1e-11
    while (found := row(*named, fmu, (by_heyoka, tolerance)))["error_of_peer"] > found["error"]:
        tolerance *= 10.0**-0.25
    full = CHAIN.replace("Chain", "FullChain").replace("\n[where]", FULL)
    band, dense = ((by_fmu(text, "cvode_bdf", folder), 1e-6) for text in (CHAIN, full))
    chain = "300 masses, cvode_bdf to full matrices", turns, band[0](1e-9)[1], 0.2
    return [row(named[0], turns, *named[2:], fmu, (by_heyoka, tolerance)), row(*chain, band, dense)]
