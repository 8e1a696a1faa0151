"""Campaign files for the tests."""

import re
import shlex
from collections.abc import Sequence
from html import unescape
from pathlib import Path

from rparm.campaign import campaign_file
from rparm.campaign.campaign_file import Campaign
from tests.support.tables import tables

MISTAKES = tables(str(Path(__file__).with_name("mistakes")))
FILES = MISTAKES["files"]
HEAD = FILES["HEAD"]
ARM = HEAD + FILES["ARM"]


def write(folder: Path, text: str = ARM, changes: Sequence[tuple[str, str]] = ()) -> Path:
    """A campaign file with changes, old text and new."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "test.toml"
    path.write_text(text, encoding="utf-8")
    return path


def campaign(folder: Path, text: str = ARM, changes: Sequence[tuple[str, str]] = ()) -> Campaign:
    """A campaign from its file."""
    return campaign_file.read(write(folder, text, changes))


def commands(page: str) -> list[list[str]]:
    """Commands that a page shows, split as a shell does it."""
    found = [unescape(re.sub("<.*?>", "", code)) for code in re.findall("<code>.*?</code>", page)]
    return [shlex.split(text) for text in found if text.startswith("./run.sh")]
