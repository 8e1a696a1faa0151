"""All places where random mutants break a C source, and how; samples of them.

A mutant is identified by the file, the function, the statement and the token that it replaces.
"""

import random
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from c_source import CONTROL, Statement, matching, statements_of

FOLDERS = ("src", "fmu", "models")
ARITHMETIC = {
    "+": "-", "-": "+", "*": "/", "/": "*", "%": "*",
    "&": "|", "|": "&", "^": "|", "<<": ">>", ">>": "<<",
    "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "|=": "=", "&=": "=", "++": "--", "--": "++",
}  # fmt: skip
COMPARISONS = {
    "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"),
    "==": ("!=",), "!=": ("==",),
}  # fmt: skip
LOGICAL = {"&&": "||", "||": "&&"}
NAMES = {"true": "false", "false": "true", "INFINITY": "(-INFINITY)"}
TYPES = {
    "auto", "bool", "char", "const", "double", "enum", "extern", "float", "int", "long", "register",
    "short", "signed", "static", "struct", "typedef", "union", "unsigned", "void", "volatile",
}  # fmt: skip
JUMPS = {"return", "break", "continue", "goto", "case", "default"}
WITHOUT_CODE = {"_Static_assert", "static_assert", "__attribute__", "_Pragma"}
REMOVED = "(removed)"


@dataclass(frozen=True)
class Mutant:
    """One replacement in a source.

    Attributes
    ----------
    kind : str
        Class of the mutation.
    file, function : str
        Where it is; the function is empty outside of functions.
    statement : str
        Text of the statement in one line.
    repeat : int
        How many statements with this text the function has before.
    before, nth : str, int
        The token that is replaced, and how many like it the statement has before.
    after : str
        What takes its place.
    """

    kind: str
    file: str
    function: str
    statement: str
    repeat: int
    before: str
    nth: int
    after: str

    def as_dict(self) -> dict[str, str | int]:
        """For a file of mutants."""
        return asdict(self)

    def description(self) -> str:
        """One line for a reader."""
        where = f"{self.file}, {self.function or 'outside of functions'}"
        if self.after == REMOVED:
            return f"{where}: {self.statement} -> {REMOVED}"
        which = f" ({self.nth + 1}.)" if self.nth else ""
        return f"{where}: {self.statement}: {self.before}{which} -> {self.after or REMOVED}"


def numbers(text: str) -> tuple[str, ...]:
    """What takes the place of a constant."""
    if text.lower().startswith("0x"):
        return (f"({text} + 1)",)
    if "." in text or "e" in text.lower():
        value = float(text.rstrip("fFlL"))
        if value == 0.0:
            return ("1.0",)
        return ("0.0", "2.0", "(-1.0)") if value == 1.0 else (f"(2.0 * {text})", f"(-{text})")
    value = int(text.rstrip("uUlL"))
    return {0: ("1",), 1: ("0", "2")}.get(value, (f"({text} + 1)", f"({text} - 1)"))


def without_code(statement: Statement) -> set[int]:
    """Tokens that are no code: attributes, checks of the compiler, lengths of declared arrays."""
    tokens = statement.tokens
    texts = statement.texts()
    found: set[int] = set()
    for index, token in enumerate(tokens[:-1]):
        if token.text in WITHOUT_CODE and texts[index + 1] == "(":
            found |= set(range(index, matching(tokens, index + 1) + 1))
    if is_declaration(statement):
        end = texts.index("=") if "=" in texts else len(texts)
        found |= {
            inside
            for index in range(end)
            if texts[index] == "["
            for inside in range(index, matching(tokens, index) + 1)
        }
    return found


def is_declaration(statement: Statement) -> bool:
    """Whether the statement declares something."""
    tokens = statement.tokens
    if tokens[0].kind != "name" or tokens[0].text in JUMPS | CONTROL:
        return False
    if tokens[0].text in TYPES:
        return True
    if len(tokens) < 2:
        return False
    pointer = tokens[1].text == "*" and tokens[1].after_space and not tokens[1].before_space
    return pointer or (tokens[1].kind == "name" and tokens[1].text not in CONTROL)


def is_binary(statement: Statement, index: int) -> bool:
    """Whether the operator at the index stands between two values."""
    token = statement.tokens[index]
    return 0 < index < len(statement.tokens) - 1 and token.after_space and token.before_space


def token_changes(statement: Statement, index: int) -> Iterator[tuple[str, str]]:
    """Class and replacement of the mutants of one token."""
    tokens = statement.tokens
    text = tokens[index].text
    in_head = tokens[0].text == "for" or tokens[min(1, len(tokens) - 1)].text == "for"
    if tokens[index].kind == "number":
        yield from (("constant", after) for after in numbers(text))
    elif text in NAMES:
        yield "constant", NAMES[text]
    elif text in ("++", "--"):
        if not in_head:  # a loop that counts the wrong way proves nothing
            yield "arithmetic", ARITHMETIC[text]
    elif text == "!":
        yield "negation", ""
    elif text == "-" and not is_binary(statement, index):
        yield "sign", ""
    elif is_binary(statement, index):
        if text in ARITHMETIC:
            yield "arithmetic", ARITHMETIC[text]
        elif text in COMPARISONS:
            neighbours = COMPARISONS[text][: 1 if in_head else 2]  # no loop that never runs
            yield from (("comparison", after) for after in neighbours)
        elif text in LOGICAL:
            yield "logical", LOGICAL[text]


def can_be_negated(statement: Statement) -> bool:
    """Whether the condition of an if or while is more than what other mutants negate."""
    texts = statement.texts()
    joined = any(text in LOGICAL for text in texts)
    single = any(text in COMPARISONS or text == "!" for text in texts)
    return joined or not single


def can_be_removed(statement: Statement) -> bool:
    """Whether the statement does something that can be left out."""
    texts = statement.texts()
    if statement.ended_by != ";" or not statement.function or is_declaration(statement):
        return False
    if texts[0] in JUMPS | CONTROL | WITHOUT_CODE or texts[:3] == ["(", "void", ")"]:
        return False
    return "=" in texts or "(" in texts or any(text in ARITHMETIC for text in texts)


def changes(statement: Statement) -> Iterator[tuple[str, int, str]]:
    """Class, index of the token and replacement of all mutants of a statement."""
    texts = statement.texts()
    if not statement.function and "=" not in texts:
        return
    if statement.ended_by == "{" and texts[-1] == ")" and not set(texts[:3]) & CONTROL:
        return  # head of a function
    left_out = without_code(statement)
    first = 0 if statement.function else texts.index("=")
    for index in range(first, len(texts)):
        if index not in left_out:
            for kind, after in token_changes(statement, index):
                yield kind, index, after
    for index, text in enumerate(texts):
        if text in ("if", "while") and statement.function and can_be_negated(statement):
            yield "negation", index, f"{text} not"
    if can_be_removed(statement):
        yield "removal", 0, REMOVED


def mutants_of(file: str, text: str) -> list[Mutant]:
    """All mutants of a source in the order of their places."""
    return [
        Mutant(
            kind,
            file,
            statement.function,
            statement.text(),
            statement.repeat,
            statement.text() if after == REMOVED else statement.tokens[index].text,
            0 if after == REMOVED else statement.nth(index),
            after,
        )
        for statement in statements_of(text)
        for kind, index, after in changes(statement)
    ]


def sources(root: Path) -> dict[str, str]:
    """Text of every C file that mutants are made of, by its path from the root."""
    return {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for folder in FOLDERS
        for path in sorted((root / folder).rglob("*.[ch]"))
        if path.parent.name != "proof"  # has its own faults: tests/prove
    }


def mutated(mutant: Mutant, text: str) -> str:
    """The source with the mutant in it.

    Raises
    ------
    LookupError
        The source has no such place.
    """
    for statement in statements_of(text):
        place = (statement.function, statement.repeat)
        if place == (mutant.function, mutant.repeat) and statement.text() == mutant.statement:
            return changed(mutant, statement, text)
    raise LookupError(mutant.description())


def changed(mutant: Mutant, statement: Statement, text: str) -> str:
    """The source with the mutant in this statement of it."""
    tokens = statement.tokens
    if mutant.after == REMOVED:
        return text[: tokens[0].start] + text[tokens[-1].end :]
    places = [index for index, each in enumerate(statement.texts()) if each == mutant.before]
    if mutant.nth >= len(places):
        raise LookupError(mutant.description())
    index = places[mutant.nth]
    token = tokens[index]
    if mutant.after.endswith(" not"):
        end = matching(tokens, index + 1)
        condition = text[tokens[index + 1].start : tokens[end].end]
        return f"{text[: token.end]} (!{condition}){text[tokens[end].end :]}"
    return text[: token.start] + mutant.after + text[token.end :]


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
