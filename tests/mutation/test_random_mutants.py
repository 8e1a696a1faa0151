"""The mutants of tests/mutation: what is changed, and what is left alone."""

import pytest

from tests.mutation.random_mutants import mutants_of, order, sources
from tests.support.paths import ROOT
from tests.support.tables import tables

SOURCE, MADE = tables(__file__)["source"], tables(__file__)["made"]
MUTANTS = [mutant for place in mutants_of("a.c", SOURCE) for mutant in place]
TEXTS = [mutant.of(SOURCE) for mutant in MUTANTS]


@pytest.mark.parametrize(("before", "after"), MADE)
def test_mutants_of_every_class_are_made(before: str, after: str) -> None:
    assert SOURCE.count(before) == 1
    assert SOURCE.replace(before, after) in TEXTS


def test_what_is_no_code_has_no_mutants() -> None:
    """Directives, comments, strings, declarations."""
    for kept in ("#define LIMIT (1 + 2)", "/* a + b */", '"a - b"', "// n < 1", "double sum[4];"):
        assert all(kept in text for text in TEXTS)
    assert len(set(TEXTS)) == len(TEXTS) and SOURCE not in TEXTS


def test_an_order_follows_from_its_seed() -> None:
    texts = sources(ROOT)
    first = order(texts, 1)
    assert first == order(texts, 1) and first[:100] != order(texts, 2)[:100]
    assert {mutant.file.partition("/")[0] for mutant in first[:100]} == {"src", "fmu", "models"}
    for mutant in first[:500]:
        assert mutant.of(texts[mutant.file]) != texts[mutant.file]
        assert mutant.file in mutant.description(texts[mutant.file])
