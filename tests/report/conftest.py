"""A report that all tests of this folder look at, and one of a user's file."""

from pathlib import Path

import pytest

from rparm.__main__ import main
from tests.support.browser import Browser
from tests.support.rparm_project import MISTAKES

SCENARIOS = ("thrown_against_stop", "actuator_torque_steps", "constant_effort_single_step")
LATE = "late_start"  # at 1e6 s
VARIANT = "wall_contact"
# what may stand in a file name and in a title, and means something in HTML or in an address
STRANGE = "Bögen & <b>50%<b> #1?"

CONTENT = MISTAKES["report"]["SCENARIO"]


@pytest.fixture(scope="session")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a report with scenarios, studies, a variant of a system, and a user's file."""
    folder = tmp_path_factory.mktemp("report") / "der Bericht #1"
    file = tmp_path_factory.mktemp("user") / f"{STRANGE}.toml"
    file.write_text(CONTENT, encoding="utf-8")
    arguments = ["--report", str(folder)]
    assert main(["run", *SCENARIOS, LATE, *arguments]) == 0
    assert main(["system", VARIANT, *arguments]) == 0
    assert main(["run", str(file), *arguments]) == 0
    return folder


def show(browser: Browser, page: Path, **view) -> None:
    """Open a page and wait for its plots."""
    browser.open(page, **view)
    if page.name != "index.html":
        browser.wait("document.documentElement.dataset.ready === 'yes'")
