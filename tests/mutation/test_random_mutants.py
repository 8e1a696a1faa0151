"""The mutants of tests/mutation: where they are, and what they make."""

import sys
from dataclasses import replace
from operator import itemgetter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))
from sites import REMOVED, Mutant, mutants_of, mutated, order, sources

from tests.support.tables import tables

ROOT = Path(__file__).resolve().parents[2]
TABLES = tables(__file__)
SOURCE = TABLES["source"]


def told() -> set[tuple[str, str, str]]:
    """Function, text and replacement of all mutants of the source."""
    return {(mutant.function, mutant.before, mutant.after) for mutant in mutants_of("a.c", SOURCE)}


def mutant_of(before: str, after: str) -> Mutant:
    """The first mutant of the source with this replacement."""
    return next(
        mutant
        for mutant in mutants_of("src/slave.c", SOURCE)
        if (mutant.before, mutant.after) == (before, after)
    )


@pytest.mark.parametrize(
    ("function", "before", "after"),
    [
        *map(itemgetter("function", "before", "after"), TABLES["mutant"]),
        ("slave_sum", "slave_note(slave, sum)", REMOVED),
        ("slave_sum", "sum[0] = slave->x[0] - slave->x[1]", REMOVED),
    ],
)
def test_mutants_of_every_class_are_made(function: str, before: str, after: str) -> None:
    assert (function, before, after) in told()


def test_what_is_no_code_has_no_mutants() -> None:
    befores = [before for _, before, _ in told()]
    assert "+" not in befores  # directive, comment and string
    assert "==" not in befores  # check of the compiler
    assert "4" not in befores  # lengths of arrays
    assert not any("double sum" in before for before in befores)
    assert befores.count("*") == 1  # no pointer


def test_a_mutant_changes_its_place_alone() -> None:
    changed = mutated(mutant_of("-", ""), SOURCE)
    assert changed == SOURCE.replace("return -sum", "return sum")
    changed = mutated(mutant_of("if", "if not"), SOURCE)
    assert 'if (!(*n < COUNT && !is_set("a - b"))) {' in changed
    changed = mutated(mutant_of("slave_note(slave, sum)", REMOVED), SOURCE)
    assert changed == SOURCE.replace("slave_note(slave, sum);", ";")


def test_mutants_of_the_sources_can_be_made() -> None:
    for file, text in sources(ROOT).items():
        for mutant in mutants_of(file, text)[::20]:
            assert mutated(mutant, text) != text


def test_an_order_follows_from_its_seed() -> None:
    texts = sources(ROOT)
    first = order(texts, 1)
    assert first == order(texts, 1)
    assert first[:100] != order(texts, 2)[:100]
    share = sum(mutant.kind == "constant" for mutant in first) / len(first)
    assert abs(sum(mutant.kind == "constant" for mutant in first[:300]) / 300 - share) < 0.02


def test_a_place_that_is_not_there_is_an_error() -> None:
    mutant = mutant_of("-", "")
    with pytest.raises(LookupError):
        mutated(mutant, SOURCE.replace("return -sum[0]", "return sum[0]"))
    with pytest.raises(LookupError):
        mutated(replace(mutant, nth=1), SOURCE)
