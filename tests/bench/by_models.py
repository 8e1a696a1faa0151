"""Models in equations, a step of their FMUs: next to heyoka, and a chain as a band."""

from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import thread_time

import numpy as np
from by_heyoka import compiled

from tests.equations.compiled import read
from tests.equations.examples import FOLDER, METHODS, initializing, made

HERE = Path(__file__).resolve().parent
COLUMN = "one step of 2 s, free motion, error <= 1e-8"
# a state that follows all others: its row of the Jacobian is full
FULL = '\nall = { derivative = "(k - 40) * sum(i = 1..n, v[i])" }\n[where]'
CHAIN = (HERE / "chain.toml").read_text()
# by name: equations, a step in s, the tolerance of taylor
MODELS = {
    "Pleiades": ((HERE / "pleiades.toml").read_text(), 2.0, 1e-12),
    "Lorenz": ((FOLDER / "lorenz.toml").read_text(), 5.0, 1e-9),
    "cart and pole": ((FOLDER / "cart_and_pole.toml").read_text(), 10.0, 1e-9),
    "50 masses": (CHAIN.replace("n = 300", "n = 50"), 10.0, 1e-9),
    "Hodgkin-Huxley": ((HERE / "neuron.toml").read_text(), 50.0, 1e-9),
}
PAIRS = {"Pleiades": HERE / "pairs.toml"}  # the same equations, as they suit heyoka
Run = Callable[..., tuple[float, np.ndarray]]  # by tolerance: processor time, s; states


def by_fmu(fmu_file: Path, method: str, step: float) -> tuple[Run, tuple]:
    """Return what makes the step by an FMU beside its equations, and the start."""
    instance = initializing(fmu_file)
    references, fmu = instance.loaded.references, instance.fmi
    states = [references[x.name] for x in read(fmu_file.with_suffix(".toml")).of("states")]
    start = tuple(fmu.getReal(states))

    def run(tolerance: float) -> tuple[float, np.ndarray]:
        fmu.reset()
        fmu.setInteger([references["solver_method"]], [METHODS[method]])
        fmu.setupExperiment(tolerance=tolerance)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        begin = thread_time()
        fmu.doStep(0.0, step)
        return thread_time() - begin, np.array(fmu.getReal(states))

    return run, start


def by_heyoka(file: Path, step: float, start: tuple) -> Run:
    """Return what makes the step by heyoka."""

    def run(tolerance: float, real: type = float) -> tuple[float, np.ndarray]:
        taylor = compiled(file, start, tolerance, real)
        taylor.time, taylor.state[:] = real(0.0), start
        begin = thread_time()
        taylor.propagate_until(real(step))
        return thread_time() - begin, taylor.state.copy()

    return run


def row(name: str, turns: int, exact: np.ndarray, limit: float, *peers: tuple[Run, float]) -> dict:
    """Let two take turns at their tolerances."""
    times = np.array([[run(tolerance)[0] for run, tolerance in peers] for _ in range(turns)])
    ends = [run(tolerance)[1] for run, tolerance in peers]
    own, other = (
        float(np.abs(end[: exact.size] - exact).max() / np.abs(exact).max()) for end in ends
    )
    return {
        "group": "models", "work": "one step", "column": COLUMN, "run": name,
        "us": 1e6 * median(times[:, 0]), "ratio": median(times[:, 0] / times[:, 1]),
        "error": own, "error_of_peer": other, "judged": "ratio", "limit": limit,
    }  # fmt: skip


def rows(folder: Path, turns: int) -> list[dict]:
    """Measure; heyoka has an error no larger than the FMU's."""
    found = []
    for name, (text, step, tolerance) in MODELS.items():
        fmu = made(folder, text)
        own, start = by_fmu(fmu, "taylor", step)
        peer = by_heyoka(PAIRS.get(name, fmu.with_suffix(".toml")), step, start)
        named, of_peer = f"{name}, taylor to heyoka", 10.0 * tolerance
        exact = peer(1e-19, np.longdouble)[1]
        judged = exact, 1.0, (own, tolerance)
        while (one := row(named, 1, *judged, (peer, of_peer)))["error_of_peer"] > one["error"]:
            of_peer *= 10.0**-0.25
        found.append(row(named, turns, *judged, (peer, of_peer)))
    full = CHAIN.replace("Chain", "FullChain").replace("\n[where]", FULL)
    band, dense = (by_fmu(made(folder, text), "cvode_bdf", 2.0)[0] for text in (CHAIN, full))
    exact = band(1e-9)[1]
    chain = "300 masses, cvode_bdf to full matrices", turns, exact, 0.2
    return [*found, row(*chain, (band, 1e-6), (dense, 1e-6))]
