"""Samples of mutants: drawn by a seed, stored, and found again in sources that have changed."""

import difflib
import json
import random
import re
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from c_source import Statement, statements_of, tokenized
from sites import REMOVED, Mutant, mutants_of


@dataclass(frozen=True)
class Chosen:
    """A mutant of a sample, and what is known of it.

    Attributes
    ----------
    equivalent : str
        Why no test can notice it; empty where one can.
    lives : str
        Why no test notices it though one could.
    """

    mutant: Mutant
    equivalent: str = ""
    lives: str = ""


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


def read_sample(path: Path) -> list[Chosen]:
    """The mutants of a stored sample."""
    chosen = []
    for entry in json.loads(path.read_text(encoding="utf-8"))["mutants"]:
        known = {key: entry.pop(key, "") for key in ("equivalent", "lives")}
        chosen.append(Chosen(Mutant(**entry), **known))
    return chosen


def write_sample(path: Path, seed: int, chosen: list[Chosen]) -> None:
    """Store a sample, a mutant a line."""
    lines = []
    for each in chosen:
        entry = each.mutant.as_dict()
        entry |= {"equivalent": each.equivalent} if each.equivalent else {}
        entry |= {"lives": each.lives} if each.lives else {}
        lines.append(json.dumps(entry))
    text = ",\n".join(lines)
    path.write_text(f'{{"seed": {seed}, "mutants": [\n{text}\n]}}\n', encoding="utf-8")


def likeness(statement: str) -> str:
    """A statement without its space and its texts: what makes it the same in other sources."""
    code = "".join('""' if each.text[0] == '"' else each.text for each in tokenized(statement))
    return re.sub(r'(?:"")+', '""', code)


class Places:
    """The statements of the sources, in which mutants of a stored sample are found again."""

    def __init__(self, texts: dict[str, str]) -> None:
        self.by_text: defaultdict[str, list[tuple[str, Statement]]] = defaultdict(list)
        for file, text in texts.items():
            for statement in statements_of(text):
                self.by_text[likeness(statement.text())].append((file, statement))

    def find(self, mutant: Mutant) -> Mutant | None:
        """The mutant where it is now; nothing if the place is gone.

        The same statement of the same function is it: in its file, in one of the same name or in
        any other. If there is none, a statement that exists once in all functions is.
        """
        same = self.by_text.get(likeness(mutant.statement), [])
        name = PurePosixPath(mutant.file).name
        files = sorted(
            {file for file, _ in same},
            key=lambda file: (file != mutant.file, PurePosixPath(file).name != name, file),
        )
        same = sorted(same, key=lambda each: each[1].text() != mutant.statement)
        for file in files:
            for place, statement in same:
                where = (place, statement.function, statement.repeat)
                if where == (file, mutant.function, mutant.repeat):
                    return self.moved(mutant, file, statement)
        return self.moved(mutant, *same[0]) if len(same) == 1 else None

    def nearest(self, mutant: Mutant) -> str:
        """The statement that is most like that of a mutant whose place is gone."""
        for like in difflib.get_close_matches(likeness(mutant.statement), self.by_text, n=1):
            file, statement = self.by_text[like][0]
            return f"{file}, {statement.function or 'outside of functions'}: {statement.text()}"
        return "nothing"

    @staticmethod
    def moved(mutant: Mutant, file: str, statement: Statement) -> Mutant:
        """The mutant in this statement."""
        text = statement.text()
        return replace(
            mutant,
            file=file,
            function=statement.function,
            statement=text,
            repeat=statement.repeat,
            before=text if mutant.after == REMOVED else mutant.before,
        )
