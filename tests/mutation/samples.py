"""Samples of mutants, drawn by a seed."""

import random
from collections import defaultdict

from sites import Mutant, mutants_of


def order(texts: dict[str, str], seed: int) -> list[Mutant]:
    """One mutant of every place, in an order of which each beginning is a fair sample.

    Each class of mutations in each of the folders has the share in a beginning that it has in all.
    """
    chance = random.Random(seed)
    places: defaultdict[tuple[object, ...], list[Mutant]] = defaultdict(list)
    for file, text in texts.items():
        for mutant in mutants_of(file, text):
            unlike = (mutant.file, mutant.function, mutant.statement, mutant.repeat)
            places[(*unlike, mutant.before, mutant.nth)].append(mutant)
    strata: defaultdict[tuple[str, str], list[Mutant]] = defaultdict(list)
    for alternatives in places.values():
        mutant = chance.choice(alternatives)
        strata[mutant.file.partition("/")[0], mutant.kind].append(mutant)
    ranked = []
    for mutants in strata.values():
        chance.shuffle(mutants)
        offset = chance.random()
        ranked += [((rank + offset) / len(mutants), each) for rank, each in enumerate(mutants)]
    return [mutant for _, mutant in sorted(ranked, key=lambda pair: pair[0])]
