"""Slow fits: the machine of the demo, and what a delay that is left out does."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from tests.identification.synthetic import PLANT, identified, write
from tests.support.rparm_project import call


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
