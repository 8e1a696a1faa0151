"""Gradients of random hybrid models against differences of whole runs in 80 bits.

GRADIENT_MODELS: how many models, and by each method if there are more than 100. A failure is
repeated by python -m tests.gradients.random_hybrids SEED.
"""

import os
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from tests.equations.examples import METHODS, quick
from tests.gradients.models import EXACT, by, run
from tests.gradients.random_hybrids import POINTS, STOP, Hybrid, Loop, Real, reference

COUNT = int(os.environ.get("GRADIENT_MODELS", "10"))
KNOWN = 0.6  # of all models: others touch, coincide or grow
NEAR = {"cvode_adams": 2e-7, "cvode_bdf": 2e-7, "erk": 1e-7, "taylor": 1e-8}  # over the size


def failures(seed: int) -> tuple[bool, int, list[str]]:
    """Whether a model is known, its changes but for ticks, and what runs of it do wrong."""
    model, found = Hybrid(seed), []
    known = reference(model)
    if known.doubt:
        return False, 0, []
    names = [*model.states, *(["u"] if model.is_sampled else [])]
    methods = [*METHODS] if COUNT > 100 else [[*METHODS][seed % 4], "taylor"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text(model.text(), encoding="utf-8")
        fmu = quick(path, Path(folder))
        for method in methods:
            version = ("2.0", "3.0")[seed // 4 % 2]
            rows = run(fmu, method, STOP, STOP / POINTS, version)
            columns = {name: known.values[:, k] for k, name in enumerate(names)}
            columns |= {
                by(name, parameter): known.gradients[j, :, k]
                for k, name in enumerate(names) for j, parameter in enumerate(model.by)
            }  # fmt: skip
            for name, exact in columns.items():
                bound = NEAR[method] * max(1, np.abs(exact[known.clear]).max()) + 10 * known.error
                error = np.abs(rows[name] - exact)[known.clear].max()
                if not error <= bound:
                    found.append(f"seed {seed} {method} {name}: {error:.3g}, {bound:.3g} allowed")
            if not rows[EXACT].all():
                t = rows["time"][np.argmin(rows[EXACT])]
                found.append(f"seed {seed} {method}: not exact from {t:.3g}")
    return True, sum(name != "tick" for _, name in known.motion.changes), found


def test_gradients_of_random_models() -> None:
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        made = [*pool.map(failures, range(COUNT))]
    found = [text for *_, texts in made for text in texts]
    assert not found, "\n".join(found)
    assert np.mean([known for known, *_ in made]) > KNOWN
    assert np.mean([changes for known, changes, _ in made if known]) > 2


def test_the_loop_finds_impacts() -> None:
    """x1 = 2 t from -1, back to 0.25 from 0.5: at 0.75, then each 0.125 s; by hand."""
    model = Hybrid(8)
    model.states, model.frozen, model.is_sampled = ["x1"], ["2"], False
    model.indicators, model.events = [], []
    model.event("x1", "top", reset={"x1": "back"})
    motion = Loop(model, {"start(x1)": Real(-1), "top": Real(0.5), "back": Real(0.25)}).run()
    assert not motion.doubt
    times = [float(t) for t, _ in motion.changes]
    assert np.allclose(times, 0.75 + 0.125 * np.arange(len(times)), rtol=0, atol=1e-15)
    assert len(times) in (10, 11)
