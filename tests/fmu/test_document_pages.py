"""The documentation inside the FMUs in a browser."""

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.support.browser import Browser
from tests.support.paths import FOLDERS


@pytest.fixture
def opened_page(fmu: Path, tmp_path: Path) -> Callable[[Browser, str], None]:
    def opened(browser: Browser, name: str, **view: Any) -> None:
        with zipfile.ZipFile(fmu.with_name(f"{name}.fmu")) as archive:
            archive.extractall(tmp_path)
        browser.open(tmp_path / "documentation" / "index.html", **view)

    return opened


@pytest.mark.parametrize("name", FOLDERS)
def test_the_page_of_an_fmu_is_narrow_and_accessible(
    browser: Browser, opened_page: Callable[..., None], name: str
) -> None:
    """Contrasts are looked at on the shortest page: the colours are those of one style sheet."""
    for dark in (False, True):
        opened_page(browser, name, width=400, dark=dark)
        assert browser.overflow() == 0
        if dark or name == "RPEnvironment":
            assert browser.violations(contrast=name == "RPEnvironment") == []
        browser.check_quiet()


@pytest.mark.parametrize("dark", [False, True])
def test_the_page_is_dark_where_the_reader_wants_it(
    each_browser: Browser, opened_page: Callable[..., None], dark: bool
) -> None:
    opened_page(each_browser, "RPManipulator", width=400, dark=dark)
    colours = each_browser.run(
        "const {backgroundColor, color} = getComputedStyle(document.body);"
        "return [backgroundColor, color].map(text => Math.max(...text.match(/\\d+/g)))"
    )
    assert (colours[0] < 50 < 200 < colours[1]) if dark else (colours[1] < 50 < 200 < colours[0])
    assert each_browser.overflow() == 0
    each_browser.check_quiet()
