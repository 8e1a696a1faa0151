"""What GitHub reads of the project: forms for issues, and the workflow of a release."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from rparm.command_line import COMMANDS
from tests.support.paths import ROOT

HOME = ROOT / ".github"
FORMS = sorted(path for path in HOME.glob("ISSUE_TEMPLATE/*.yml") if path.stem != "config")


def read(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def steps() -> list[str]:
    jobs = read(HOME / "workflows" / "release.yml")["jobs"]
    return [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_a_form_asks_for_what_is_needed(path: Path) -> None:
    form = read(path)
    assert form["name"] and form["description"]
    fields = {field["id"]: field for field in form["body"]}
    assert len(fields) == len(form["body"]) >= 4
    for field in fields.values():
        assert field["type"] in ("input", "textarea", "dropdown")
        assert field["attributes"]["label"]
    assert any(field.get("validations", {}).get("required") for field in fields.values())


def test_the_workflow_calls_what_there_is() -> None:
    text = "\n".join(steps())
    scripts = set(re.findall(r"\./(\w+\.sh)", text))
    assert scripts == {"test.sh", "release.sh"}
    assert all((ROOT / script).is_file() for script in scripts)
    commands = set(re.findall(r"-m rparm ([\w-]+)", text))
    assert commands == {"build", "list", "new-model", "run"} and commands <= set(COMMANDS)


def test_the_workflow_may_only_read() -> None:
    workflow = read(HOME / "workflows" / "release.yml")
    assert workflow["permissions"] == {"contents": "read"}
    assert not any("permissions" in job for job in workflow["jobs"].values())


def test_it_is_said_that_the_workflow_has_not_run() -> None:
    page = (ROOT / "docs" / "release.md").read_text(encoding="utf-8")
    assert re.search(r"`\.github/workflows/release\.yml` .*has not run yet", page, re.DOTALL)
