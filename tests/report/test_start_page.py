"""The start page: the door to the results of all commands in a folder."""

import random
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote, urlsplit

import lxml.html
import pytest

from tests.identification.synthetic import ARM, write
from tests.report.conftest import CONTENT, LATE, STRANGE, VARIANT
from tests.support.browser import Browser
from tests.support.rparm_project import Console

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
