"""The page on estimators: its files and commands."""

import json
import re
import tomllib
from pathlib import Path

from tests.estimator.filters import opened
from tests.support.paths import ROOT
from tests.support.programs import RPARM, python

PAGE = (ROOT / "docs" / "estimators.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
COMMANDS = re.findall(r"^\./run\.sh ([^#\n]+?) *(?:#.*)?$", PAGE, re.MULTILINE)


def test_its_commands_do_what_it_says(tmp_path: Path) -> None:
    for name, text in zip(("pendulum", "observer"), BLOCKS, strict=False):
        assert f"`{name}.toml`" in PAGE
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    printed = {}
    assert len(COMMANDS) == 4
    for command in COMMANDS:
        elsewhere = ["--output", "report"] if command.startswith("system") else []
        ran = python(*RPARM, *command.split(), *elsewhere, folder=tmp_path)
        assert ran.returncode == 0, ran.stderr
        printed[command.split()[0]] = ran.stdout
    assert json.loads(printed["schema"])["title"] == "Estimator"
    assert "completed" in printed["system"]
    kept = tomllib.loads((tmp_path / "filter.toml").read_text(encoding="utf-8"))
    assert {"phi", "omega", "l", "P_phi_omega"} <= kept["states"].keys()
    with opened(tmp_path / "PendulumObserver.fmu", tmp_path) as slave:
        for name in re.findall(r"`((?:sigma|nis|noise|spread|P|filter)_\w+)`", PAGE):
            assert name in slave.references
