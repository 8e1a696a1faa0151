"""What a test needs and this machine lacks."""

import os
from typing import NoReturn

import pytest


def missing(what: str) -> NoReturn:
    """Skip the test, with this word; in CI, where nothing may be skipped, it fails."""
    if os.environ.get("CI"):
        pytest.fail(what)
    pytest.skip(what)
