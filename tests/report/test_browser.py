"""The browser of the tests notices what pages must not do."""

from functools import partial
from pathlib import Path

import pytest

from tests.support import browser as support
from tests.support.browser import Browser

PAGE = """<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Page</title>
<link rel="icon" href="data:,"></head><body><main><h1>Page</h1>{}</main></body></html>"""


@pytest.fixture
def shown(each_browser: Browser, tmp_path: Path):
    return partial(show, each_browser, tmp_path)


def show(browser: Browser, folder: Path, body: str, **view) -> Browser:
    page = folder / "page.html"
    page.write_text(PAGE.format(body), encoding="utf-8")
    browser.open(page, **view)
    return browser


@pytest.mark.parametrize("script", ["console.error('wrong')", "console.warn('odd')", "nothing()"])
def test_a_complaint_is_noticed(shown, script: str) -> None:
    browser = shown(f"<script>{script}</script>")
    assert len(browser.errors) == 1
    with pytest.raises(AssertionError):
        browser.check_quiet()


@pytest.mark.parametrize(("then", "is_quiet"), [("<mn>1</mn>", True), ("", False)])
def test_a_formula_without_a_part_is_noticed_once_the_page_is_there(
    firefox: Browser, tmp_path: Path, then: str, is_quiet: bool
) -> None:
    late = (
        "<script>document.write('<math><msub><mi>x</mi>'); document.body.offsetWidth;"
        f"document.write('{then}</msub></math>')</script>"
    )
    assert (show(firefox, tmp_path, late).errors == []) == is_quiet


@pytest.mark.parametrize(
    "body",
    ["<img alt='' src='https://example.org/a.png'>", "<script>fetch('http://a.test/')</script>"],
)
def test_a_request_is_noticed(shown, body: str) -> None:
    browser = shown(body)
    browser.wait("true")
    browser.update()
    assert len(browser.requests) == 1


def test_overflow_is_measured(shown) -> None:
    assert shown("<div style='width: 1000px'>x</div>", width=400).overflow() >= 600


def test_low_contrast_and_a_missing_text_are_found(shown) -> None:
    found = shown("<p style='color: #aaa'>Text</p><img src='data:,'>").violations()
    assert sorted({text.partition(":")[0] for text in found}) == ["color-contrast", "image-alt"]


def test_modes_and_widths_reach_the_page(shown, tmp_path: Path) -> None:
    browser = shown("<p>Text</p>", width=432, dark=True, reduced_motion=True, scale=2)
    assert browser.run("return [innerWidth, devicePixelRatio]") == [432, 2]
    for query in ("(prefers-color-scheme: dark)", "(prefers-reduced-motion: reduce)"):
        assert browser.run("return matchMedia(arguments[0]).matches", query)
    browser.screenshot(tmp_path / "page.png")
    assert (tmp_path / "page.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("ci", "outcome"), [("", "skipped"), ("true", "failed")])
def test_without_chromium(monkeypatch: pytest.MonkeyPatch, ci: str, outcome: str) -> None:
    monkeypatch.setenv("CI", ci)
    monkeypatch.setattr(support, "PROGRAMS", ("no-such-browser",))
    expected = {"skipped": pytest.skip.Exception, "failed": pytest.fail.Exception}[outcome]
    with pytest.raises(expected, match="missing: no-such-browser"), support.opened():
        pass
