"""The origin of an FMU: version, author, license, copyright and date."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from program import WrongInputError, read_text


@dataclass(frozen=True)
class Provenance:
    """Texts for the model description; None is left out of it."""

    version: str = "0.0.0"
    author: str | None = None
    license: str | None = None  # by its SPDX identifier
    copyright: str | None = None
    date: str | None = None  # UTC, ISO 8601


def license_texts(path: Path) -> dict[str, str]:
    """Author, license and copyright of a LICENSE: "NAME License", "Copyright (c) YEAR, AUTHOR"."""
    text = read_text(path)
    title = re.match(r"(.+) License\n", text)
    notice = re.search(r"^Copyright \(c\) [-\d]+, (.+)$", text, re.MULTILINE)
    if not title or not notice:
        raise WrongInputError(f"{path}: lacks 'NAME License' or 'Copyright (c) YEAR, AUTHOR'")
    return {"license": title[1].replace(" ", "-"), "copyright": notice[0], "author": notice[1]}


def build_date(environment: Mapping[str, str]) -> str | None:
    """Date by SOURCE_DATE_EPOCH; without it none, so that equal sources give equal bytes."""
    epoch = environment.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return None
    try:
        return datetime.fromtimestamp(int(epoch), UTC).isoformat()
    except (ValueError, OverflowError, OSError):
        raise WrongInputError(f"SOURCE_DATE_EPOCH = {epoch!r:.40} is not a time in s") from None
