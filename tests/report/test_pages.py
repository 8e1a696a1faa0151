"""The pages of a report in a browser, from the start page on: quiet, readable, complete."""

import random
import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

import lxml.html
import pytest

from rparm import project
from rparm.report.system_page import MOST_ROWS
from rparm.systems import comparison, ssp
from tests.identification.synthetic import ARM, write
from tests.report.conftest import CONTENT, LATE, SCENARIOS, STRANGE, VARIANT, show
from tests.rparm.test_accuracy import OF_SCENARIOS
from tests.support.browser import INVALID, Browser, Firefox
from tests.support.rparm_project import Console

# bytes of a report, so that it stays small
WHOLE = 12_000_000
OF_NUMBER = 15  # in a file of values of a variant
OF_VARIANT_PAGE = 120_000
PAGES = (
    "index.html",
    f"scenarios/{SCENARIOS[0]}.html",  # with motion
    f"scenarios/{SCENARIOS[1]}.html",  # without
    f"scenarios/{SCENARIOS[2]}.html",  # of two rows
    f"scenarios/{LATE}.html",
    "studies/accuracy.html",
    f"system/{VARIANT}.html",
    f"files/{STRANGE}.html",
)


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_quiet_and_fits_a_narrow_view(
    each_browser: Browser, report: Path, name: str
) -> None:
    browser = each_browser
    show(browser, report / name, width=400, dark=True)
    browser.check_quiet()
    assert browser.overflow() == 0
    assert browser.run("return document.querySelectorAll('.plot svg.main-svg').length > 0") == (
        name != "index.html"
    )


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("name", PAGES[:2])
def test_a_page_keeps_the_rules_of_accessibility(
    browser: Browser, report: Path, name: str, dark: bool
) -> None:
    show(browser, report / name, dark=dark)
    assert browser.violations() == []


def test_dark_and_light_have_colours_of_their_own(browser: Browser, report: Path) -> None:
    backgrounds = []
    for dark in (False, True):
        show(browser, report / f"scenarios/{SCENARIOS[1]}.html", dark=dark)
        colour = browser.run(
            "return [getComputedStyle(document.body).backgroundColor,"
            "getComputedStyle(document.querySelector('.main-svg')).backgroundColor]"
        )
        backgrounds.append(colour)
    assert backgrounds[0] == ["rgb(255, 255, 255)"] * 2
    assert backgrounds[1][0] == backgrounds[1][1] != backgrounds[0][0]


def test_the_overview_leads_to_every_page(browser: Browser, report: Path) -> None:
    """It is in view at once: it loads a style sheet, and no script but its own."""
    browser.open(report / "index.html")
    files = [url.rpartition("/")[2] for url in browser.loaded if url.startswith("file:")]
    assert files == ["index.html", "page.css"]
    links = browser.run("return [...document.links].map(link => link.getAttribute('href'))")
    assert sorted(links) == sorted(quote(name) for name in PAGES[1:])
    texts = browser.run(
        "return [...document.querySelectorAll('.result .passed')].map(x => x.innerText)"
    )
    assert len(texts) == len(PAGES) - 2
    lines = browser.run(
        "return [...document.querySelectorAll('svg.thumbnail')].map(line => ["
        "line.getAttribute('aria-label'), line.getBoundingClientRect().width,"
        "Math.max(...[...line.children].map(path => path.getTotalLength?.() ?? 0))])"
    )
    assert len(lines) == len(PAGES) - 1
    assert all("between" in text and wide > 50 and length > 50 for text, wide, length in lines)
    names = browser.run("return [...document.querySelectorAll('.line-of')].map(x => x.innerText)")
    names = [name.partition(":")[0].removeprefix(", ") for name in names]
    assert len(names) == len(PAGES) - 1 and {"q1", "plant.q1"} <= set(names)


def test_the_page_of_a_file_says_what_ran_and_texts_are_no_markup(
    browser: Browser, report: Path
) -> None:
    show(browser, report / f"files/{STRANGE}.html")
    title = '</script><script>alert("1")</script> "Bögen" & <b>'
    assert browser.run("return document.querySelector('h1').innerText") == title
    assert browser.run("return document.title") == title
    assert browser.run("return page.data.title") == title
    assert browser.run("return document.querySelectorAll('h1 *, main > p *').length") == 0
    browser.run("document.querySelectorAll('details').forEach(x => { x.open = true; })")
    text = re.sub(r"\s+", " ", browser.run("return document.body.innerText"))
    for part in (
        "completed model RPManipulator (FMI 2.0) time 0 to 1 s steps 100 of 10 ms",
        "solver_method erk",
        "q1 0.3 rad Angle of joint 1",
        "tau1 N·m 1 sin(2π 1 Hz t)",
        "f2 N 9 at 0 s, 10 at 0.5 s, linear in between",
        "Errors are estimated from a run of the same FMU at tolerance 1e-11",
    ):
        assert part in text, part
    browser.open(report / "index.html")
    assert title in browser.run("return document.body.innerText")


def test_the_page_of_a_variant_says_what_it_is_and_how_it_was_solved(
    browser: Browser, report: Path
) -> None:
    show(browser, report / f"system/{VARIANT}.html")
    assert "The path leads through a hard wall. Run by Ecos" in browser.run(
        "return document.querySelector('main > p').innerText"
    )
    texts = browser.run(
        "return [...document.querySelectorAll('.drawing')].map(x => x.getAttribute('aria-label'))"
    )
    assert len(texts) == len(set(texts)) > 8
    assert all(re.match(r"Plot of .* from .* to .*, between .* and ", text) for text in texts)
    width, text = browser.run("return (x => [x.naturalWidth, x.alt])(document.images[0])")
    assert width > 100 and "signals" in text
    texts = browser.run("return [...document.querySelectorAll('.note')].map(x => x.innerText)")
    assert any("is held (0)" in text and "(−1)" in text for text in texts)
    titles = browser.run("return [...document.querySelectorAll('summary')].map(x => x.innerText)")
    for component in ("trajectory", "controller", "actuator", "plant", "sensor", "environment"):
        assert f"All other start values of {component}" in titles
    browser.run("document.querySelectorAll('details').forEach(x => { x.open = true; })")
    text = browser.run("return document.body.innerText")
    assert re.search(r"stribeck_velocity1\s+\S+\s+rad/s", text) and "solver_method\t" in text
    rows = browser.run(
        "const table = document.querySelector('[aria-label=Solvers] tbody');"
        "return [...table.rows].map(row => [...row.cells].map(cell => cell.innerText))"
    )
    found = {component: numbers for component, *numbers in rows}
    assert set(found) >= {"controller", "actuator", "plant"} and "environment" not in found
    steps, evaluations, restarts, failed = map(int, found["plant"][:4])
    # its inputs change at most of the 4000 communication points
    assert 3000 < restarts <= steps < evaluations and 0 <= failed < steps
    assert 0 < float(found["plant"][4].replace("\u2212", "-")) < 1e-8


def test_each_swatch_is_that_of_its_curve(browser: Browser, report: Path) -> None:
    """Of more curves than there are colours, some are dashed."""
    show(browser, report / "studies/accuracy.html")
    pairs = browser.run(
        "const plot = page.plots[0], [main] = [plot.plot];"
        "const many = {...main, curves: Array.from({length: 13}, (_, i) =>"
        " ({...main.curves[0], name: `curve ${i}`}))};"
        "plot.plot = many; plot.restyle(); return plot.draw(Plotly).then(() => {"
        " const swatches = [...plot.figure.querySelectorAll('.swatch path')];"
        " return plot.drawing.data.map((trace, i) => [trace.line.color, trace.line.dash,"
        "  swatches[i].getAttribute('stroke'), swatches[i].getAttribute('stroke-dasharray')]);})"
    )
    assert len({tuple(pair[:2]) for pair in pairs}) == 13
    for colour, dash, stroke, dashes in pairs:
        assert stroke == colour
        assert dashes == ("" if dash == "solid" else dash.replace("px", "").replace(",", " "))


def test_an_error_of_0_is_a_gap_in_its_line(browser: Browser, report: Path) -> None:
    """The page says so, the cursor shows 0, and a point between two gaps has a marker."""
    show(browser, report / f"files/{STRANGE}.html")  # its start is exact
    browser.run("page.seek(0)")
    text = browser.run("return [...document.querySelectorAll('.readout li')].at(-1).innerText")
    assert text.replace("\u2212", "-").split() == ["tolerance", "1e-8", "0"], text
    drawn = (
        "const plot = page.plots.at(-1), [trace] = plot.drawing.data;"
        "return [trace.y.slice(0, 6), trace.mode, trace.marker.size, plot.figure.innerText]"
    )
    values, mode, _, text = browser.run(drawn)
    assert values[0] is None and all(values[1:]) and mode == "lines" and "a gap where" in text
    browser.run(
        "const plot = page.plots.at(-1);"
        "plot.plot.curves[0].values.splice(0, 6, 0, 1e-9, 0, 0, 1, 1);"
        "return plot.draw(Plotly)"
    )
    values, mode, sizes, _ = browser.run(drawn)
    assert values == [None, 1e-9, None, None, 1, 1] and mode == "lines+markers"
    assert [i for i, size in enumerate(sizes) if size] == [1]
    show(browser, report / f"scenarios/{SCENARIOS[1]}.html")
    assert "a gap where" not in browser.run("return page.plots[0].figure.innerText")


@pytest.mark.parametrize("width", [900, 1200, 1400])
def test_the_player_stays_in_view_beside_the_plots(
    each_browser: Browser, report: Path, width: int
) -> None:
    show(each_browser, report / f"system/{VARIANT}.html", width=width, height=800)
    columns, seen = each_browser.run(
        "const box = selector => document.querySelector(selector).getBoundingClientRect();"
        "const figures = [...document.querySelectorAll('.plot')];"
        "const columns = new Set(figures.map(x => x.getBoundingClientRect().left)).size;"
        "const seen = figures.map(figure => {"
        " figure.scrollIntoView({block: 'center'});"
        " const [canvas, controls] = [box('#player canvas'), box('.player-controls')];"
        " return canvas.top >= 0 && controls.bottom <= innerHeight"
        "  && canvas.right <= box('.plots').left;"
        "});"
        "return [columns, seen]"
    )
    assert columns == (1 if width < 1200 else 2) and len(seen) > 8 and all(seen)


def test_numbers_and_units_have_one_style(browser: Browser, report: Path) -> None:
    for name in (PAGES[2], PAGES[-1]):
        show(browser, report / name)
        browser.run("document.querySelectorAll('details').forEach(x => { x.open = true; })")
        shown = browser.run(
            "return [...document.querySelectorAll('td.number, .readout li, .facts strong,"
            " figcaption')].map(x => x.innerText)"
        )
        assert len(shown) > 5
        for text in shown:
            assert not re.search(r"(^|[\s(])-\d|\de-\d|N\.m|/s2", text), text


def test_the_whole_report_stays_small(report: Path) -> None:
    """By what a variant takes; tests/rparm/test_accuracy.py holds the rest to its share."""
    csv = report / f"system/{VARIANT}.csv"
    assert (report / f"system/{VARIANT}.html").stat().st_size <= OF_VARIANT_PAGE
    whole = OF_SCENARIOS
    numbers = {}
    for folder in project.systems().values():
        with ssp.unpacked(project.built(folder, ".ssp")) as opened:
            columns = 1 + len(comparison.recorded(opened)) + len(comparison.discrete(opened))
            rows = min(MOST_ROWS, opened.system.steps + 1)
            for variant in opened.system.parameters:
                numbers[variant] = rows * columns
                whole += rows * columns * OF_NUMBER + OF_VARIANT_PAGE
    assert numbers[VARIANT] / 2 < len(csv.read_text("utf-8").split(",")) <= numbers[VARIANT]
    assert csv.stat().st_size <= numbers[VARIANT] * OF_NUMBER
    assert len(numbers) >= 10 and whole < WHOLE


# ---- The start page ------------------------------------------------------------------------------


LOOP = """name = "Bench"
step = 0.01
stop = 0.2
[components]
arm = "RPManipulator"
control = "RPController"
[connections]
"control.q1" = "arm.q1"
"arm.tau1" = "control.tau1"
[parameters]
"arm.q1" = 0.3
"""
CAMPAIGN = """title = "Payload"
description = "Another second link."
scenario = "hanging_swing"
time = { stop = 0.1 }
sampling = "sobol"
runs = 8
[parameters.m2]
uniform = [0.5, 1.5]
[keep]
final = ["q1"]
"""
IDENTIFY = (
    *("--inputs", "tau1", "f2", "--measured", "q1", "q2", "--parameters", "m2"),
    *("--set", "I1z=0.12", "a=110mm", "l1=0.55"),
)
QUICK = "constant_effort_single_step"
# a command -> the names of its results
COMMANDS = {
    ("run", QUICK): [QUICK, "accuracy"],
    ("run", "late_start", "--tolerance", "1e-8"): ["late_start"],
    ("run", "mine.toml"): ["mine"],
    ("system", "bench.toml"): ["Bench_default"],
    ("coupling", "bench.toml"): ["Bench_default"],
    ("linearize", "RPPlant"): ["RPPlant"],
    ("linearize", "RPPlant", "--at", "q1=30deg"): ["RPPlant"],
    ("identify", "RPManipulator", "log.csv", *IDENTIFY): ["RPManipulator"],
    ("campaign", "payload.toml", "--workers", "1", "--no-dashboard"): ["payload"],
    ("campaign", "payload.toml", "--replay", "3"): ["run_3"],
    ("prove", QUICK): [QUICK],
}


def links(page: Path) -> list[Path]:
    """The files that a page leads to by plain links."""
    tree = lxml.html.fromstring(page.read_bytes())
    addresses = [urlsplit(link) for link in tree.xpath("//a/@href")]
    return [(page.parent / unquote(x.path)).resolve() for x in addresses if x.path]


def test_each_result_is_listed_once_and_opens(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the order of the commands: from the start page to each page and back."""
    monkeypatch.chdir(tmp_path)
    for name, text in (("mine", CONTENT), ("bench", LOOP), ("payload", CAMPAIGN)):
        Path(f"{name}.toml").write_text(text, encoding="utf-8")
    write(replace(ARM, duration=2.0), Path("log.csv"), 1)
    order = random.Random(45).sample(list(COMMANDS), len(COMMANDS))
    for command in (*order, order[0]):
        code, out, err = console(*command, "--output", "all")
        assert code == 0, (command, out, err)
        assert "all/" in out.splitlines()[-1] and " --open" in out.splitlines()[-1], command
    index = Path("all/index.html").resolve()
    found = links(index)
    names = [name for some in COMMANDS.values() for name in some]
    assert len(found) == len(set(found)) == len(names)
    pages = {page for page in index.parent.rglob("*.html") if page != index}
    assert pages == set(found)
    for page in pages:
        assert index in links(page), page
    for style in lxml.html.fromstring(index.read_bytes()).xpath("//link[@rel='stylesheet']/@href"):
        assert (index.parent / style).is_file()


def test_it_searches_filters_and_sorts(browser: Browser, report: Path) -> None:
    """Without scripts all lines are there; with them those that were asked for."""
    browser.open(report / "index.html")
    shown = (
        "Object.entries(arguments[0]).forEach(([id, value]) => {"
        " document.getElementById(id).value = value;"
        " document.getElementById(id).dispatchEvent(new Event('input', {bubbles: true})); });"
        "return [...document.querySelectorAll('.what a')].filter(x => x.offsetParent)"
        ".map(x => x.innerText)"
    )
    every = browser.run(shown, {})
    assert browser.run(shown, {"search": LATE.upper(), "kind": "scenario"}) == [LATE]
    assert browser.run(shown, {"search": "", "kind": "", "verdict": "completed"}) == [STRANGE]
    assert browser.run(shown, {"verdict": "", "kind": "system"}) == [VARIANT]
    by_name = browser.run(shown, {"kind": "", "sort": "name"})
    assert by_name == sorted(every, key=str.lower) != every
    assert browser.run(shown, {"sort": ""}) == every


# ---- The browsers of the tests -------------------------------------------------------------------

WRONG = """<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Page</title>
<link rel="icon" href="data:,"></head><body><main><h1>Page</h1><div style="width: 1000px">x</div>
<p style="color: #aaa">Text</p><img src="data:,"><math><msub><mi>x</mi></msub></math>
<img alt="" src="https://example.org/a.png"><script>
console.error("wrong"); console.warn("odd"); fetch("http://a.test/"); nothing();
</script></main></body></html>"""


def test_what_pages_must_not_do_is_noticed(each_browser: Browser, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(WRONG, encoding="utf-8")
    each_browser.open(page, width=400, dark=True, reduced_motion=True, scale=2)
    for _ in range(1000):
        each_browser.update()
        if len(each_browser.requests) == 2:
            break
    with pytest.raises(AssertionError) as caught:
        each_browser.check_quiet()
    words = ["wrong", "odd", "nothing", *[INVALID] * isinstance(each_browser, Firefox)]
    assert all(word in str(caught.value) for word in words)
    assert each_browser.overflow() >= 600
    found = {text.partition(":")[0] for text in each_browser.violations()}
    assert found == {"color-contrast", "image-alt"}
    shown = "return [innerWidth, devicePixelRatio, ...arguments[0].map(x => matchMedia(x).matches)]"
    queries = ["(prefers-color-scheme: dark)", "(prefers-reduced-motion: reduce)"]
    assert each_browser.run(shown, queries) == [400, 2, True, True]
