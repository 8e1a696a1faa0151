"""Gradients through friction and stops: closed forms, and random plants against differences.

GRADIENT_PLANTS: how many of these.
"""

import os
import random
import tomllib
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.contacts.random_plants import plant
from tests.equations.examples import METHODS, made, quick, simulated

COUNT = int(os.environ.get("GRADIENT_PLANTS", "6"))
STOP = 3.0
# a block that slides to rest, a block at rest that a ramp pulls, and a body that strikes another
THREE = """
name = "Three"
[parameters]
mu = { start = 0.3 }
g = { start = 9.81 }
r = { start = 1.7 }
c = { start = 2.1 }
m1 = { start = 1.3 }
m2 = { start = 0.8 }
e = { start = 0.6 }
gap = { start = 0.9 }
[states]
x = { derivative = "v" }
v = { start = 4.0, derivative = "-F" }
y = { derivative = "w" }
w = { derivative = "r * time - G" }
a = { derivative = "va" }
va = { start = 1.1, derivative = "-P / m1" }
b = { derivative = "vb" }
vb = { derivative = "P / m2" }
[friction.slide]
force = "F"
velocity = "v"
coulomb = "mu * g"
[friction.rest]
force = "G"
velocity = "w"
coulomb = "c"
[stops.meet]
force = "P"
position = "b - a"
velocity = "vb - va"
lower = "-gap"
restitution = "e"
[gradients]
by = ["mu", "g", "r", "c", "m1", "m2", "e", "gap", "start(v)", "start(w)", "start(va)"]
"""
START = {
    **{"mu": 0.3, "g": 9.81, "r": 1.7, "c": 2.1, "m1": 1.3, "m2": 0.8, "e": 0.6, "gap": 0.9},
    **{"v": 4.0, "va": 1.1},
}
OF = ("x", "v", "y", "w", "a", "va", "b", "vb")


def end(at: dict[str, complex]) -> np.ndarray:
    """Where the three are at the end; analytic in all that is given."""
    x = at["v"] ** 2 / (2 * at["mu"] * at["g"])
    pulled = STOP - at["c"] / at["r"]  # F = c at first
    w, y = at["r"] * pulled**2 / 2, at["r"] * pulled**3 / 6
    met = at["gap"] / at["va"]
    mean, part = at["m1"] * at["va"] / (at["m1"] + at["m2"]), at["e"] / (at["m1"] + at["m2"])
    va, vb = mean - part * at["m2"] * at["va"], mean + part * at["m1"] * at["va"]
    left = STOP - met
    return np.array([x, 0, y, w, at["gap"] + va * left, va, vb * left, vb])


@pytest.fixture(scope="module")
def three() -> Path:
    return made(THREE)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("method", METHODS)
def test_gradients_are_those_of_closed_forms(three: Path, method: str, version: str) -> None:
    """By complex steps, which have no cancellation. What is held does not keep its start."""
    fmu = three if version == "2.0" else three.parent / "fmi3" / three.name
    start = {"solver_method": METHODS[method]}
    run = simulated(fmu, STOP, STOP / 10, start, relative_tolerance=1e-10)
    assert run["gradients_are_exact"].all()
    for name in START:
        wanted = end(START | {name: START[name] + 1e-30j}).imag / 1e-30
        suffix = f"start_{name}" if name in OF else name
        found = [run[f"{of}_by_{suffix}"][-1] for of in OF]
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9, err_msg=name)
    assert [run[f"{of}_by_start_w"][-1] for of in OF] == [0.0] * len(OF)


def differences(run: Callable[[float], np.ndarray], value: float) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by differences of two sizes, and where these agree: no event lies between."""
    h = 1e-6 * abs(value)
    found = [(run(value + k * h) - run(value - k * h)) / (2 * k * h) for k in (1, 8)]
    size = 1e-2 + np.abs(found[0]).max(axis=0)
    return found[0], np.abs(found[0] - found[1]) <= 1e-5 * size


def wrong(seed: int, folder: Path) -> list[str]:
    """What is wrong with gradients of a plant, by chosen parameters and the start of a velocity."""
    text, chance = plant(seed).text(), random.Random(seed)
    file = folder / f"{seed}.toml"
    file.write_text(text, encoding="utf-8")
    values = {name: entry["start"] for name, entry in tomllib.loads(text)["parameters"].items()}
    by = chance.sample([name for name, value in values.items() if value], 4)
    fmu = quick(file, folder / str(seed), by=by)
    method = chance.choice([*METHODS])
    start = {"solver_method": METHODS[method]}
    run = simulated(fmu, STOP, STOP / 20, start, relative_tolerance=1e-10)
    of = [name for name in run.dtype.names if f"{name}_by_{by[0]}" in run.dtype.names]
    found, best = [], {"solver_method": METHODS["taylor"]}
    for name in by if run["gradients_are_exact"].all() else ():

        def at(given: float, name: str = name) -> np.ndarray:
            other = simulated(fmu, STOP, STOP / 20, best | {name: given}, relative_tolerance=1e-12)
            return np.array([other[each] for each in of]).T

        wanted, is_sure = differences(at, values[name])
        gradient = np.array([run[f"{each}_by_{name}"] for each in of]).T
        error = np.abs(gradient - wanted) / (1e-2 + np.abs(wanted).max(axis=0))
        if (error[is_sure] > 1e-4).any():
            found.append(f"seed {seed}, {method}: by {name}: {error[is_sure].max():.1e}")
    return found


def test_gradients_of_random_plants(tmp_path: Path) -> None:
    with ProcessPoolExecutor(2) as pool:
        found = [*pool.map(partial(wrong, folder=tmp_path), range(COUNT))]
    assert not (texts := [text for each in found for text in each]), "\n".join(texts)
