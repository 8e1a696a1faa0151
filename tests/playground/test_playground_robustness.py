"""The playground keeps running whatever users do to it, and its memory does not grow."""

import math
import random
import re
from pathlib import Path

import pytest

from tests.playground.opened_page import OpenedPage
from tests.support.browser import Browser

CHANGES = 250
WILD = (-1.0, 0.0, 1e-300, 1e9, 1e300)  # beside the values that sliders have

# changes one after the other, 20 steps after each; where a step fails, as the page goes back
TORTURE = """
const [changes] = arguments, counts = {accepted: 0, refused: 0, failed: 0};
window.tested.reset();
simulation.isControlled = true;
for (const [fmu, name, value] of changes) {
  try {
    simulation.change(fmu, name, value);
    counts.accepted++;
  } catch (error) {
    if (!(error instanceof FmuError)) throw error;
    counts.refused++;
  }
  try {
    for (let n = 0; n < 20; n++) simulation.step();
  } catch (error) {
    if (!(error instanceof FmuError)) throw error;
    counts.failed++;
    if (!simulation.goBack(simulation.time)) throw new Error('there is no state to go back to');
  }
}
counts.energy = plant.get('total_energy');
counts.steps = simulation.steps;
return counts;
"""


def changes(opened: OpenedPage, chance: random.Random) -> list[tuple[str, str, float]]:
    """Random values, most of them of sliders, for the variables that the page has controls for."""
    rows = []
    groups = opened.run("return Settings.groups")
    for _ in range(CHANGES):
        group = chance.choice(groups)
        name, *limits = chance.choice(group["controls"])
        if not limits:
            value = chance.randint(0, 3)
        elif chance.random() < 0.15:
            value = chance.choice(WILD)
        else:
            value = chance.uniform(limits[0], limits[1])
        rows.append((group["fmu"], name, value))
        if chance.random() < 0.1:
            rows.append(("plant", "solver_method", chance.randint(1, 4)))
        if chance.random() < 0.1:
            rows.append(("plant", "payload_attached", chance.randint(0, 1)))
    return rows


@pytest.mark.parametrize("seed", range(4))
def test_random_changes(opened: OpenedPage, seed: int) -> None:
    counts = opened.run(TORTURE, changes(opened, random.Random(seed)))
    assert counts["accepted"] > 100
    assert counts["refused"] > 10
    assert counts["steps"] > 100
    assert math.isfinite(counts["energy"])


def test_memory_stays_as_large(opened: OpenedPage) -> None:
    """Once the history is full, states that are kept take the place of old ones."""
    sizes = opened.run("""
        const sizes = [];
        simulation.hand.target = [0.3, 0.3];
        for (let turn = 0; turn < 3; turn++) {
          for (let n = 0; n < 15000; n++) simulation.step();
          window.tested.save();
          sizes.push([plant.buffer.byteLength, controller.buffer.byteLength]);
        }
        return sizes;
    """)
    assert sizes[0] == sizes[1] == sizes[2]
    assert max(sizes[0]) < 64e6


def test_a_page_that_cannot_start_says_why(browser: Browser, page: Path, tmp_path: Path) -> None:
    """Description and module of two builds: the FMU refuses the GUID."""
    other = tmp_path / "index.html"
    text, count = re.subn(r'guid="\{\w+-', 'guid="{00000000-', page.read_text(), count=1)
    assert count == 1
    other.write_text(text)
    browser.open(other)
    browser.wait("!document.getElementById('message').hidden")
    said = browser.run("return document.getElementById('message').textContent")
    assert said.startswith("The playground does not start: the GUID '{00000000-")
    browser.check_quiet()
