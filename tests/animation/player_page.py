"""Pages that hold a player and nothing else."""

import json
from pathlib import Path
from typing import Any

from rparm.report.recording import ASSETS, SCRIPTS, STYLES
from tests.support.browser import Browser

PAGE = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")

ARM = {"a": 0.1, "l1": 0.5, "lc1": 0.25, "g": 9.81, "stops": None, "wall": None, "payload": None}


def synthetic(**changes: Any) -> dict[str, Any]:
    """A motion of 101 rows in 1 s, in which joint 1 turns by a quarter and link 2 slides out."""
    time = [row / 100 for row in range(101)]
    motion = {
        "time": time,
        "q1": [1.5 * t for t in time],
        "q2": [0.3 * t for t in time],
        "reference": None,
        "arm": ARM,
    }
    return motion | changes


def write(folder: Path, motion: dict[str, Any]) -> Path:
    """Page in `folder` that plays `motion`."""
    styles = "".join(
        f'<link rel="stylesheet" href="{(ASSETS / name).as_uri()}">' for name in STYLES
    )
    scripts = "".join(f'<script src="{(ASSETS / name).as_uri()}"></script>' for name in SCRIPTS)
    page = folder / "player.html"
    text = PAGE.format(styles=styles, scripts=scripts, motion=json.dumps(motion, allow_nan=False))
    page.write_text(text, encoding="utf-8")
    return page


def show(browser: Browser, folder: Path, motion: dict[str, Any], **view: Any) -> None:
    """Open a page that plays `motion`; fail if it complains."""
    browser.open(write(folder, motion), **view)
    browser.check_quiet()
