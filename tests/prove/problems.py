"""Problems for the prover, without FMUs, and what it answers."""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from flint import arb
from rparm.fmu_tools.compiler.read.model_file import ModelFile, read

from rparm.proof import enclosure as enclosures
from rparm.proof.enclosure import Enclosure
from tests.support.paths import ROOT

EXAMPLES = ROOT / "examples" / "models"
ARM = ROOT / "models" / "rp_manipulator" / "rp_manipulator.toml"


@cache
def model(given: str | Path) -> ModelFile:
    """Read a file, or a text."""
    with TemporaryDirectory() as folder:
        path = given if isinstance(given, Path) else Path(folder) / "model.toml"
        if isinstance(given, str):
            path.write_text(given)
        return read(path)


def scenario(
    given: str | Path,
    times: Sequence[float],
    initial: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    inputs: Mapping[str, Sequence[float]] | None = None,
) -> Any:
    """What a proof needs of a scenario: values of the file, but for these; inputs are held."""
    starts = {v.name: v.start for v in model(given).variables.values() if v.start is not None}
    values = starts | dict(parameters or {}) | dict(initial or {})
    return SimpleNamespace(
        path=Path("model.toml"), start=times[0], times=np.array(times), initial=initial or {},
        start_values=values,
        input=lambda name: np.array((inputs or {}).get(name, [values[name]] * len(times))),
    )  # fmt: skip


def enclose(
    given: str | Path,
    times: Sequence[float],
    within: Mapping[str, float] | None = None,
    check: bool = False,
    by: ModuleType = enclosures,
    **more: Any,
) -> Enclosure:
    """Enclose states and outputs at these times; `by`: the module that does it."""
    prover = by.Prover(model(given), with_outputs=True)
    return prover.enclose(scenario(given, times, **more), within, check=check)


def holds(enclosure: Enclosure, row: int, exact: Mapping[str, arb]) -> bool:
    """Whether intervals contain values, which are known far better."""
    for name, x in exact.items():
        i = enclosure.names.index(name)
        high, low, radius = (
            float(part[row, i]) for part in (enclosure.high, enclosure.low, enclosure.radius)
        )
        if x.rad() > 1e-60 * max(1, abs(x).upper()) or abs(x - arb(high) - arb(low)) > arb(radius):
            return False
    return True


PENDULUM, FUNCTIONS = (
    Path(__file__).with_name(f"{name}.toml") for name in ("pendulum", "functions")
)
# arguments of `enclose`
SMALL: dict[str, dict[str, Any]] = {
    "arm": {"given": ARM, "times": [0.0, 0.001, 0.1, 0.35], "inputs": {
        "tau1": [1.0, -0.7, 3.0, 0.0], "f2": [-9.0, -12.0, 2.0, 0.0],
    }},
    "uncertain": {"given": PENDULUM, "times": [0.0, 0.1, 0.3], "within": {"phi": 1e-4, "w": 1e-4}},
    "functions": {"given": FUNCTIONS, "times": [0.0, 0.2, 1.0]},
    "ball": {"given": EXAMPLES / "bouncing_ball.toml", "times": [0.0, 0.3, 0.6]},
    "switch": {
        "given": 'name = "S"\n[states]\nx = { derivative = "1 if time < 0.7 else 2" }',
        "times": [0.0, 0.5, 1.0],
    },
    "corner": {
        "given": 'name = "C"\n[states]\nx = { derivative = "1 + abs(x)" }', "times": [0.0, 0.4, 1.0]
    },
    "lorenz": {"given": EXAMPLES / "lorenz.toml", "times": [0.0, 2.0]},
}  # fmt: skip
