"""Slow tests: the page of an identification in a browser, the machine of the demo, delays."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rparm.fmi.fmu_file import read_model
from rparm.identification import page
from tests.identification.synthetic import PLANT, identified, write
from tests.support.browser import Browser
from tests.support.rparm_project import call


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


# ---- Slow fits -----------------------------------------------------------------------------------


def test_the_demo_finds_its_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from rparm.models.machine.identification import LATE, TRUE

    code, out, _ = call(capsys, "identify", "--demo", "--json", "--output", tmp_path)
    found = json.loads(out)
    assert code == 0 and found["warnings"] == []
    for name, true in {**TRUE, "delay": LATE}.items():
        estimate = found["parameters"][name]
        assert abs(estimate["value"] - true) < estimate["high"] - estimate["low"] < 0.01 * true
    assert 0.9 < found["validation"]["chi2"] < 1.1
    # the result, run from the start in one go, is the motion that was logged, but for the delay
    assert found["validation"]["follows"] == {"q1": 8.0, "q2": 8.0}
    scenario = tmp_path / "scenario.toml"
    code, out, _ = call(capsys, scenario, "--json", "--output", tmp_path / "report")
    (ran,) = json.loads(out)["scenarios"]
    assert code == 0
    assert all(x["rms"] < 0.01 for x in ran["runs"][0]["measured"].values())


def test_a_delay_is_found(tmp_path: Path) -> None:
    machine = replace(PLANT, late=1.4e-3, noise=(2e-5, 2e-5))
    log = write(machine, tmp_path / "log.csv", 8)
    found = identified(machine, log, 8, delay=True)
    late = found.estimates["delay"]
    assert late.low < 1.4e-3 < late.high < 1.5e-3
    ignored = identified(machine, log, 8)
    wrong = [
        name
        for name, true in machine.true.items()
        if not ignored.estimates[name].low < true < ignored.estimates[name].high
    ]
    assert wrong and ignored.warnings  # what is left out is seen
