"""Another model, built from its folder by the same generator, instance and adapter."""

import os
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from tests.support.paths import ROOT

OMEGA = 3.0


@pytest.fixture(scope="module")
def oscillator() -> Path:
    """The FMU of tests/oscillator, built with the tests."""
    build = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).parent
    return build / "tests" / "oscillator" / "Oscillator.fmu"


def test_fmpy_finds_no_problem(oscillator: Path) -> None:
    assert validate_fmu(str(oscillator)) == []


@pytest.mark.parametrize(
    ("kind", "bound"),
    [("CoSimulation", 1e-8), ("ModelExchange", 1e-5)],  # fmpy's own BDF integrator is coarser
)
def test_it_follows_the_exact_solution(oscillator: Path, kind: str, bound: float) -> None:
    held = np.array([(0.0, 5.0), (4.0, 5.0)], dtype=[("time", float), ("u", float)])
    result = fmpy.simulate_fmu(
        str(oscillator),
        fmi_type=kind,
        stop_time=4.0,
        output_interval=0.01,
        relative_tolerance=1e-9,
        start_values={"omega": OMEGA, "gain": 2.0, "x": 0.2, "v": -1.0},
        input=held,
        output=["x", "v", "a", "energy"],
    )
    rest = 2.0 * 5.0 / OMEGA**2
    phase = OMEGA * result["time"]
    x = rest + (0.2 - rest) * np.cos(phase) - 1.0 / OMEGA * np.sin(phase)
    v = -(0.2 - rest) * OMEGA * np.sin(phase) - np.cos(phase)
    np.testing.assert_allclose(result["x"], x, rtol=0, atol=bound)
    np.testing.assert_allclose(result["v"], v, rtol=0, atol=OMEGA * bound)
    np.testing.assert_allclose(result["a"], 10.0 - OMEGA**2 * result["x"], rtol=0, atol=1e-12)
    energy = (result["v"] ** 2 + (OMEGA * result["x"]) ** 2) / 2
    np.testing.assert_allclose(result["energy"], energy, rtol=1e-14)
