"""The start page: the door to the results of all commands in a folder."""

import random
from pathlib import Path
from urllib.parse import unquote, urlsplit

import lxml.html
import pytest

from tests.report.conftest import CONTENT
from tests.support.rparm_project import Console

LOOP = """name = "Bench"
step = 0.01
stop = 0.2
[components]
plant = "RPPlant"
[inputs]
"plant.tau1" = { constant = 20.0 }
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
QUICK = "constant_effort_single_step"
# a command -> the names of its results
COMMANDS = {
    ("run", QUICK, "--tolerance", "1e-8"): [QUICK],
    ("run", "mine.toml"): ["mine"],
    ("system", "bench.toml"): ["Bench_default"],
    ("coupling", "bench.toml"): ["Bench_default"],
    ("linearize", "RPPlant"): ["RPPlant"],
    ("linearize", "RPPlant", "--at", "q1=30deg"): ["RPPlant"],
    ("identify", "--demo"): ["RPPlant"],
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
    order = random.Random(45).sample(list(COMMANDS), len(COMMANDS))
    for command in order:
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
