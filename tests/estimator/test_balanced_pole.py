"""The example of a pole that is held up by FMUs only: its gains, its filter, its order of steps."""

from pathlib import Path

import numpy as np
import pytest

import rparm
from examples import balanced_pole
from rparm.files import read_toml
from tests.support.paths import ROOT
from tests.support.programs import printed

FOLDER = ROOT / "examples"
STATES = balanced_pole.STATES


def test_it_runs_in_any_folder(tmp_path: Path) -> None:
    off, inside = printed("balanced_pole.py", tmp_path)
    assert float(off.split()[-3]) < 1.0 and float(inside.split()[3]) > 99.0


def test_its_file_has_the_gains_of_python_control() -> None:
    given = read_toml(balanced_pole.LOOP)["parameters"]
    for name, gain in balanced_pole.gains().items():
        assert given[name] == pytest.approx(gain, abs=1e-3)


def loop_in_order(order: str, folder: Path) -> Path:
    text = balanced_pole.LOOP.read_text(encoding="utf-8").replace("gauss_seidel", order, 1)
    text = text.replace('"../', f'"{FOLDER.as_posix()}/')
    for name in ("encoder", "observer", "lqr"):
        text = text.replace(f'"{name}.toml"', f'"{FOLDER.as_posix()}/estimator/{name}.toml"')
    path = folder / f"{order}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_errors_fit_in_its_order_and_are_larger_one_step_late(tmp_path: Path) -> None:
    """Squared errors over variances, and nis, which is 1 also where measurements are late."""
    found = {}
    for order in ("gauss_seidel", "jacobi"):
        loop, squares, nis = rparm.System(loop_in_order(order, tmp_path)), [], []
        for seed in range(5):
            table = loop.run("default", parameters={"encoder.seed": seed, "law.seed": 10 + seed})
            late = slice(200, None)
            for name in STATES:
                wrong = table[f"observer.{name}"] - table[f"plant.{name}"]
                squares.append(np.mean((wrong / table[f"observer.sigma_{name}"])[late] ** 2))
            nis.append(table["observer.nis_x"][late].mean())
        found[order] = np.mean(squares), np.mean(nis)
    assert found["gauss_seidel"] == pytest.approx((1.0, 1.0), abs=0.25)
    assert found["jacobi"][0] > 1.5 * found["gauss_seidel"][0]
    assert found["jacobi"][1] == pytest.approx(1.0, abs=0.1)
