"""The cursor of a page: it shows the values that the page links, in all plots and the player."""

from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys

from rparm.__main__ import main
from rparm.report.run_data import ROUNDING
from rparm.runs.comparison import SMALLEST_SCALE
from tests.report.conftest import LATE, SCENARIOS, STRANGE, VARIANT, show
from tests.support.browser import Browser
from tests.support.rparm_project import MISTAKES
from tests.support.ssp_files import read_csv

PREFIXES = {1e-12: " p", 1e-9: " n", 1e-6: " µ", 1e-3: " m", 1.0: "", 1e3: " k"}


@pytest.mark.parametrize(
    ("name", "curves"),
    [
        (f"scenarios/{SCENARIOS[0]}", {"q1", "q2", "dq1", "dq2", "mode1"}),
        (f"scenarios/{SCENARIOS[1]}", {"current1", "tau1_cmd"}),
        (f"system/{VARIANT}", {"plant.q1", "environment.wall_force", "plant.mode1"}),
        (f"files/{STRANGE}", {"q1", "ee_x", "ee_y", "tau1", "f2"}),
    ],
)
def test_the_cursor_shows_rows_of_the_values(
    browser: Browser, report: Path, name: str, curves: set[str]
) -> None:
    show(browser, report / f"{name}.html")
    href = browser.run("return document.querySelector('.facts a').getAttribute('href')")
    assert href == quote(f"{Path(name).name}.csv")
    values = read_csv(report / f"{name}.csv")
    rows = browser.run("return page.x.length")
    last = len(values["time"]) - 1
    for row in (0, rows // 3, rows - 1):
        time, shown = browser.run(
            "page.seek(arguments[0]);"
            "const shown = [...document.querySelectorAll('[data-curve]')];"
            "const read = x => [x.dataset.curve, x.innerText, x.dataset.factor];"
            "return [page.x[page.row], shown.map(read)]",
            row,
        )
        found = np.flatnonzero(values["time"] == time)
        assert len(found) == 1 and (row < rows - 1 or found[0] == last)
        seen = {
            curve: float(text.split()[0].replace("\N{MINUS SIGN}", "-")) * float(factor)
            for curve, text, factor in shown
            if curve in values and PREFIXES[float(factor)] in text
        }
        assert curves <= set(seen)
        for curve, number in seen.items():
            value = values[curve][found[0]]
            last_digit = 10.0 ** (np.floor(np.log10(abs(value))) - 6) if value else 0.0
            rounding = ROUNDING * max(np.max(np.abs(values[curve])), SMALLEST_SCALE)
            assert abs(number - value) <= max(last_digit, rounding), curve  # seven digits
            assert not number or abs(value) >= rounding


def test_cursor_player_and_plots_are_in_step(browser: Browser, report: Path) -> None:
    show(browser, report / f"scenarios/{SCENARIOS[0]}.html", width=1400)
    state = "return [page.row, Number(page.bar.value), page.player.time, page.x[page.row]]"
    browser.keys("#cursor", Keys.END, Keys.ARROW_LEFT)
    row, bar, time, x = browser.run(state)
    assert row == bar == browser.run("return page.x.length") - 2 and time == x
    browser.run("page.player.seek(0.5)")
    row, bar, time, x = browser.run(state)
    assert row == bar and time == x == 0.5
    lines = browser.run(
        "return page.plots.map(plot => [plot.line.hidden, parseFloat(plot.line.style.left)"
        " - plot.drawing._fullLayout.xaxis._offset, plot.drawing._fullLayout.xaxis._length])"
    )
    for hidden, place, length in lines:
        assert not hidden and place / length == pytest.approx(0.5 / 2.0, abs=0.01)
    # a click at three quarters of a plot
    browser.run(
        "const {drawing} = page.plots[2], {xaxis} = drawing._fullLayout;"
        "const left = drawing.getBoundingClientRect().left + xaxis._offset;"
        "drawing.dispatchEvent(new MouseEvent('click', {clientX: left + 0.75 * xaxis._length}))"
    )
    assert browser.run(state)[2] == pytest.approx(1.5, abs=0.02)
    browser.check_quiet()


def test_a_zoom_is_that_of_all_plots(browser: Browser, report: Path) -> None:
    show(browser, report / f"system/{VARIANT}.html")
    ranges = "page.plots.map(plot => plot.drawing._fullLayout.xaxis.range.join())"
    browser.run("Plotly.relayout(page.plots[1].drawing, {'xaxis.range': [1, 2]})")
    browser.wait(f"new Set({ranges}).size === 1 && {ranges}[0] === '1,2'")
    browser.run("page.seek(0)")
    assert browser.run("return page.plots.every(plot => plot.line.hidden)")
    browser.run("Plotly.relayout(page.plots[0].drawing, {'xaxis.autorange': true})")
    browser.wait(f"new Set({ranges}).size === 1 && {ranges}[0] === '0,4'")


def test_a_late_time_keeps_its_digits(browser: Browser, report: Path) -> None:
    show(browser, report / f"scenarios/{LATE}.html")
    values = read_csv(report / f"scenarios/{LATE}.csv")
    browser.run("page.seek(arguments[0])", 123)
    text = browser.run("return page.output.textContent")
    assert text == f"time {values['time'][123]:.12g} s" and text.startswith("time 1000001.")
    labels = browser.run(
        "return [...document.querySelectorAll('.xtick text')].map(tick => tick.textContent)"
    )
    assert labels and all(float(label.replace("\u202f", "")) >= 1e6 for label in labels)


# ---- Another result ------------------------------------------------------------------------------
IN_PAGE = Path(__file__).with_name("compare_in_page.js").read_text(encoding="utf-8")


def test_a_dropped_line_is_interpolated_exactly(each_browser: Browser, report: Path) -> None:
    """A straight line is linear between any of its rows; outside there is nothing."""
    show(each_browser, report / f"scenarios/{SCENARIOS[0]}.html", width=400)
    rows = [[time, 0.25 - 0.5 * time] for time in (0.1003, 0.7113, 1.9003)]
    found = each_browser.run(f"{IN_PAGE} return compared(arguments[0])", rows)
    assert "a line.csv" in found["said"] and "interpolated linearly" in found["said"]
    for time, value, other, left in zip(
        *(found[key] for key in ("times", "values", "other", "difference")), strict=True
    ):
        inside = 0.1003 <= time <= 1.9003
        assert (other is not None) == inside
        if inside:
            assert other == pytest.approx(0.25 - 0.5 * time, abs=1e-12)
            assert left == pytest.approx(value - other, abs=1e-7)
    assert each_browser.overflow() == 0
    for text, _, words in MISTAKES["compared"]["rows"]:
        assert words in each_browser.run(f"{IN_PAGE} return drop('x.csv', arguments[0])", text)
    each_browser.check_quiet()
    each_browser.run("page.clear.click()")
    assert not each_browser.run("return page.data.plots.some(x => x.curves[0].other)")


def test_a_difference_has_all_digits(browser: Browser, report: Path, tmp_path: Path) -> None:
    """Of the same run with a drift of 1 nrad/s: a millionth of what seven digits show."""
    csv = (report / f"scenarios/{SCENARIOS[0]}.csv").read_text().splitlines()
    split = [line.split(",") for line in csv]
    for row in split[1:]:
        row[1] = repr(float(row[1]) + 1e-9 * float(row[0]))
    other = tmp_path / "scenarios" / f"{SCENARIOS[0]}.csv"
    other.parent.mkdir()
    other.write_text("\n".join(map(",".join, split)) + "\n")
    given = ["run", SCENARIOS[0], "--tolerance", "1e-8", "--report", str(tmp_path), "--with"]
    assert split[0][:2] == ['"time"', '"q1"'] and main([*given, str(tmp_path)]) == 0
    show(browser, tmp_path / f"scenarios/{SCENARIOS[0]}.html")
    times, left, unit, said = browser.run(
        "const [{plot, units}] = page.plots, {difference} = plot.curves[0];"
        "return [page.x, difference, units.difference.unit, page.notice.textContent]"
    )
    assert left == pytest.approx([-1e-9 * time for time in times], abs=2e-12)
    assert unit == "nrad" and "interpolated" not in said and "q1 2\xa0nrad" in said
    assert browser.violations() == []


def test_a_system_says_how_far_another_result_is(
    report: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A shift of one signal is the whole difference: its file has a tenth of the steps."""
    values = read_csv(report / f"system/{VARIANT}.csv")
    values["plant.q1"] = values["plant.q1"] + 1e-3
    file, rows = tmp_path / "shifted.csv", np.column_stack([*values.values()])
    np.savetxt(file, rows, "%.17g", ",", header=",".join(values), comments="")
    assert main(["system", VARIANT, "--report", str(tmp_path), "--with", str(file)]) == 0
    said = f"{VARIANT}: largest difference plant.q1 1 mrad from {file}\n"
    assert capsys.readouterr().out.count(said) == 1


def test_files_of_no_use_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "log.csv"
    given = ["run", SCENARIOS[0], "--tolerance", "1e-8", "--report", str(tmp_path / "report")]
    for text, words, _ in [*MISTAKES["compared"]["rows"], (None, "no such file", "")]:
        file.unlink(missing_ok=True)
        if text is not None:
            file.write_text(text)
        assert main([*given, "--with", str(file)]) == 2
        error = capsys.readouterr().err.strip().splitlines()[-1]
        assert error.startswith("error: ") and str(file) in error and words in error
    assert main([*given, "--with", str(tmp_path)]) == 2
    assert f"{SCENARIOS[0]}.csv: no such file" in capsys.readouterr().err
