"""The page of an identification in a browser: it fits, is quiet, and has everything."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rparm.fmi.fmu_file import read_model
from rparm.identification import page
from tests.identification.synthetic import PLANT, identified, write
from tests.support.browser import Browser


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with a sum, a delay, noise of the efforts and a second log."""
    folder = tmp_path_factory.mktemp("page")
    machine = replace(PLANT, duration=4.0, effort_noise=0.05)
    logs = [write(machine, folder / f"{seed}.csv", seed) for seed in (1, 2)]
    parameters = ["m2", "armature1", "I1z", "damping1", "coulomb_friction1"]
    start = {"armature1": 0.05, "damping1": 0.2, "coulomb_friction1": 0.2}
    found = identified(
        replace(machine, settings={"damping2": 2.0, "coulomb_friction2": 0.5}),
        logs[0],
        parameters=parameters,
        start=start,
        delay=True,
        validate=logs[1],
    )
    page.write(found, folder, read_model(machine.fmu), machine.true, "rparm identify again")
    return folder


def shown(browser: Browser, folder: Path, **view) -> None:
    browser.open(folder / "index.html", **view)
    for name in ("ready", "charts"):
        browser.wait(f"document.documentElement.dataset.{name} === 'yes'")


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [400, 1200])
def test_it_fits_is_quiet_and_accessible(
    folder: Path, width: int, dark: bool, browser: Browser
) -> None:
    shown(browser, folder, width=width, dark=dark)
    browser.check_quiet()
    assert browser.overflow() == 0
    assert browser.violations() == []


def test_it_says_all(folder: Path, browser: Browser) -> None:
    shown(browser, folder)
    text = browser.run("return document.body.innerText")
    for part in (
        "armature1 + I1z",
        "Cannot be known: armature1 + I1z.",
        "efforts or model are not exact",
        "Ljung-Box",
        "validation: q1",
        "residuals of q2",
        "Validation on 2.csv",
        "rparm identify again",
    ):
        assert part in text, part
    parts = "Parameters\n", "Correlations of", "residuals of q1", "Ljung-Box"
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    drawn = browser.run("return document.querySelector('.chart .drawing').data[0]")
    values = np.array(drawn["z"])
    assert np.array_equal(values, values.T) and np.allclose(np.diag(values), 1.0)
    assert len(drawn["y"]) == len(values) >= 5 and np.abs(values).max() <= 1 + 1e-6
