"""The playground in a browser, and the native FMUs beside it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.platforms.platforms import newest_source
from tests.playground.native import Native
from tests.playground.opened_page import OpenedPage
from tests.support.browser import Browser
from tests.support.missing import missing
from tests.support.paths import ROOT


@pytest.fixture(scope="session")
def page(fmu: Path) -> Path:
    """The page beside the built FMU; tests are skipped where it was not built, and fail in CI."""
    path = fmu.parent / "playground" / "index.html"
    scripts = [*(ROOT / "playground").rglob("*.*"), *(ROOT / "rparm/report/assets").iterdir()]
    newest = max(newest_source(), *(script.stat().st_mtime for script in scripts))
    if path.is_file() and path.stat().st_mtime >= newest:
        return path
    missing(f"{path} is missing or older than its sources: ./run.sh playground builds it")


@pytest.fixture
def opened(browser: Browser, page: Path) -> Iterator[OpenedPage]:
    """The page, opened and not running; after the test it must have been quiet."""
    opened = OpenedPage(browser, page)
    yield opened
    browser.check_quiet()


@pytest.fixture(scope="session")
def plant(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Native:
    return Native(fmu.with_name("RPPlant.fmu"), tmp_path_factory.mktemp("plant"))


@pytest.fixture(scope="session")
def controller(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Native:
    return Native(fmu.with_name("RPController.fmu"), tmp_path_factory.mktemp("controller"))
