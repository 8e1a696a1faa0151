"""Tables of tests, as TOML beside them."""

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any


def tables(module: str) -> dict[str, Any]:
    """The tables of a test module, whose __file__ is given."""
    return tomllib.loads(Path(module).with_suffix(".toml").read_text(encoding="utf-8"))


def cases(groups: Iterable[dict[str, Any]]) -> list[tuple[str, str]]:
    """Texts and messages: in the place of @ in a group's base stand the lines of each row."""
    return [
        (group["base"].replace("@", "\n".join(lines)), message)
        for group in groups
        for *lines, message in group["rows"]
    ]
