"""Samples of mutants: drawn by a seed, stored, and found again in sources that have changed.

A table of renames is a TOML file with up to three parts::

    [files]  # where sources have moved; others are searched by their name
    "src/slave.c" = "src/instance/instance.c"
    [parts]  # of names, between their underscores
    slave = "instance"
    [names]  # whole names, before their parts
    two_sum = "exact_sum"
"""

import difflib
import json
import random
import re
import tomllib
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

from c_source import Statement, statements_of, tokenized
from sites import REMOVED, Mutant, mutants_of

NAME = re.compile(r"[A-Za-z_]\w*")


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


@dataclass
class Renames:
    """What has other names in the sources than in a stored sample."""

    files: dict[str, str] = field(default_factory=dict)
    parts: dict[str, str] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path | None) -> "Renames":
        """The table in a file."""
        return cls() if path is None else cls(**tomllib.loads(path.read_text(encoding="utf-8")))

    def name(self, name: str) -> str:
        """A name as it is now."""
        if name in self.names:
            return self.names[name]
        parts = dict(self.parts)
        parts |= {old.upper(): new.upper() for old, new in self.parts.items()}
        return "_".join(parts.get(part, part) for part in name.split("_"))

    def text(self, text: str) -> str:
        """Code with the names as they are now."""
        return NAME.sub(lambda match: self.name(match[0]), text)

    def file(self, path: str) -> str:
        """The path of a source as it is now, as far as it is known."""
        if path in self.files:
            return self.files[path]
        old = PurePosixPath(path)
        return str(old.with_name(self.name(old.stem) + old.suffix))

    def mutant(self, mutant: Mutant) -> Mutant:
        """A mutant with the names as they are now."""
        keyword = mutant.after == REMOVED or mutant.after.endswith(" not")
        return replace(
            mutant,
            file=self.file(mutant.file),
            function=self.name(mutant.function),
            statement=self.text(mutant.statement),
            before=self.text(mutant.before),
            after=mutant.after if keyword else self.text(mutant.after),
        )


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
