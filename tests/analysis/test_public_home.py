"""What GitHub reads of the project: forms for issues, and the workflow of a release."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from rparm.needs import COMMANDS
from tests.support.paths import ROOT

HOME = ROOT / ".github"
FORMS = sorted(path for path in HOME.glob("ISSUE_TEMPLATE/*.yml") if path.stem != "config")


def read(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


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


def test_the_workflow_calls_what_there_is_and_may_only_read() -> None:
    workflow = read(HOME / "workflows" / "release.yml")
    jobs = workflow["jobs"].values()
    text = "\n".join(step.get("run", "") for job in jobs for step in job["steps"])
    scripts, commands = (set(re.findall(x, text)) for x in (r"\./(\w+\.sh)", r"-m rparm ([\w-]+)"))
    assert scripts == {"test.sh", "release.sh"} and all((ROOT / x).is_file() for x in scripts)
    assert commands == {"build", "list", "new-model", "run"} and commands <= set(COMMANDS)
    assert workflow["permissions"] == {"contents": "read"}
    assert not any("permissions" in job for job in jobs)
    page = (ROOT / "docs" / "release.md").read_text(encoding="utf-8")
    assert re.search(r"`\.github/workflows/release\.yml` .*has not run yet", page, re.DOTALL)
