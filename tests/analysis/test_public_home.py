"""What GitHub reads of the project: forms for issues, and the workflow of a release."""

import re
from pathlib import Path
from typing import Any

import yaml

from rparm.needs import COMMANDS
from tests.support.paths import ROOT

HOME = ROOT / ".github"
FORMS = sorted(path for path in HOME.glob("ISSUE_TEMPLATE/*.yml") if path.stem != "config")


def read(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def test_each_form_names_its_fields() -> None:
    for form in map(read, FORMS):
        assert form["name"] and form["description"]
        assert len({field["id"] for field in form["body"]}) == len(form["body"]) >= 4


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
