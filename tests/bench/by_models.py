"""Models in equations, a step of their FMUs: next to heyoka, loops, and a chain as a band."""

import ctypes
from collections.abc import Callable, Sequence
from operator import truediv
from pathlib import Path
from statistics import median
from time import thread_time

import numpy as np
from by_heyoka import compiled

from tests.equations.compiled import read
from tests.equations.examples import FOLDER, METHODS, build, initializing, made

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
NAMES = ("Lorenz", "CartAndPole", "HodgkinHuxley", "Chain", "Pleiades")  # in loops.c, in this order
TYPES = [*[ctypes.c_int] * 4, *[ctypes.c_double] * 2, *[np.ctypeslib.ndpointer(float)] * 3]
RESTARTS = "0.1 s steps, inputs changing"
NONE = (0.0,)  # force in one step
FORCES = 10.0 * np.sin(np.arange(100.0))  # on the cart, held over a step each, N
FRACTION = 2e-3  # of the tolerance, at which an FMU runs CVODE
Run = Callable[..., tuple[float, np.ndarray]]  # by tolerance: processor time, s; states


def by_fmu(
    fmu_file: Path, method: str, step: float, forces: Sequence[float] = NONE
) -> tuple[Run, tuple]:
    """Return what makes the step by an FMU beside its equations, or one a force; and the start."""
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
        for i, force in enumerate(forces):
            if len(forces) > 1:
                fmu.setReal([references["force"]], [force])
            fmu.doStep(i * step, step)
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


def by_loop(
    library: ctypes.CDLL,
    file: Path,
    method: str,
    step: float,
    start: tuple,
    forces: Sequence[float] = NONE,
) -> Run:
    """Return what makes the same steps by a loop of CVODE (loops.c)."""
    loop = library.loop_run_model
    loop.restype, loop.argtypes = ctypes.c_double, TYPES
    model, held = read(file), np.array(forces)
    which = NAMES.index(model.name), method == "cvode_bdf", len(start), len(held)
    nominal = np.array([x.nominal or 1.0 for x in model.of("states")])

    def run(tolerance: float) -> tuple[float, np.ndarray]:
        states = np.array(start)
        return loop(*which, FRACTION * tolerance, step, nominal, held, states), states

    return run


def row(name: str, turns: int, exact: np.ndarray, limit: float, *peers: tuple[Run, float]) -> dict:
    """Let two take turns at their tolerances."""
    times = [[run(tolerance)[0] for run, tolerance in peers] for _ in range(turns)]
    own_times, other_times = zip(*times, strict=True)
    ends = [run(tolerance)[1] for run, tolerance in peers]
    own, other = (
        float(np.abs(end[: exact.size] - exact).max() / np.abs(exact).max()) for end in ends
    )
    return {
        "group": "models", "work": "one step", "column": COLUMN, "run": name,
        "us": 1e6 * median(own_times), "ratio": median(map(truediv, own_times, other_times)),
        "error": own, "error_of_peer": other, "judged": "ratio", "limit": limit,
    }  # fmt: skip


def by_hand(turns: int, loops: ctypes.CDLL, exact: dict[str, np.ndarray]) -> list[dict]:
    """Measure against loops at the same tolerance: the largest ratio and errors of all models."""

    def race(name: str, method: str, limit: float, step: float, forces: Sequence[float]) -> dict:
        fmu = made(MODELS[name][0], build)
        own, start = by_fmu(fmu, method, step, forces)
        loop = by_loop(loops, fmu.with_suffix(".toml"), method, step, start, forces)
        whose, true = (name, loop(1e-11)[1]) if len(forces) > 1 else ("own equations", exact[name])
        title = f"{whose}, {method} to a loop by hand"
        return row(title, turns, true, limit, (own, 1e-8), (loop, 1e-8))

    found = []
    for method in ("cvode_adams", "cvode_bdf"):
        names = [name for name in MODELS if (name, method) != ("Pleiades", "cvode_bdf")]
        of_models = [race(name, method, 1.05, MODELS[name][1], NONE) for name in names]
        found.append({key: max(one[key] for one in of_models) for key in of_models[0]})
    restarts = race("cart and pole", "cvode_adams", 0.5, 0.1, FORCES)
    return [*found, restarts | {"work": RESTARTS, "column": RESTARTS}]


def rows(turns: int, loops: ctypes.CDLL) -> list[dict]:
    """Measure; heyoka has an error no larger than the FMU's. loops: libbench.so."""
    found, solutions = [], {}
    for name, (text, step, tolerance) in MODELS.items():
        fmu = made(text, build)
        own, start = by_fmu(fmu, "taylor", step)
        peer = by_heyoka(PAIRS.get(name, fmu.with_suffix(".toml")), step, start)
        named, of_peer = f"{name}, taylor to heyoka", 10.0 * tolerance
        exact = solutions[name] = peer(1e-19, np.longdouble)[1]
        judged = exact, 0.9, (own, tolerance)
        while (one := row(named, 1, *judged, (peer, of_peer)))["error_of_peer"] > one["error"]:
            of_peer *= 10.0**-0.25
        found.append(row(named, turns, *judged, (peer, of_peer)))
    full = CHAIN.replace("Chain", "FullChain").replace("\n[where]", FULL)
    band, dense = (by_fmu(made(text, build), "cvode_bdf", 2.0)[0] for text in (CHAIN, full))
    exact = band(1e-9)[1]
    chain = "300 masses, cvode_bdf to full matrices", turns, exact, 0.2
    found.append(row(*chain, (band, 1e-6), (dense, 1e-6)))
    return [*found, *by_hand(turns, loops, solutions)]
