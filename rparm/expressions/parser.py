"""Makes a tree of the text of an expression, by precedence climbing."""

import math
import re
from dataclasses import dataclass
from functools import reduce

from rparm.expressions.tree import (
    FUNCTIONS,
    NO_NAMES,
    RELATIONS,
    WORDS,
    ExpressionError,
    Node,
)

DEEPEST = 100  # levels of brackets, and of what else nests
SPACE = re.compile(r"\s*")
TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?![\w.])"
    r"|(?P<name>[^\W\d]\w*(?:\.[^\W\d]\w*)*)"
    r"|(?P<operator>\*\*|<=|>=|[-+*/<>(),])"
)
SHOWN = 30  # characters of the text in a message

# how tightly operators bind
CONDITIONAL, OR, AND, NOT, RELATION, SUM, PRODUCT, SIGN, POWER = range(1, 10)
BINDING = {"if": CONDITIONAL, "or": OR, "and": AND, "+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT}
BINDING |= {"**": POWER} | dict.fromkeys(RELATIONS, RELATION)


@dataclass(frozen=True, slots=True)
class Token:
    """A number, name or operator; at the end of the text one of kind "end"."""

    kind: str
    text: str
    column: int

    @property
    def shown(self) -> str:
        """As a message names it."""
        return repr(self.text[:SHOWN]) if self.text else "the end"


def parse(text: str) -> Node:
    """Tree of an expression; ExpressionError says what is wrong with it."""
    parser = _Parser(_tokens(text))
    root = parser.expression(CONDITIONAL)
    if parser.token.kind != "end":
        raise parser.unexpected("an operator")
    return root


def _tokens(text: str) -> list[Token]:
    tokens = []
    at = SPACE.match(text).end()
    while at < len(text):
        found = TOKEN.match(text, at)
        if found is None:
            piece = text[at : at + SHOWN].split()[0]
            hint = ": powers are written **" if piece.startswith("^") else ""
            raise ExpressionError(at + 1, f"{piece!r} is no number, name or operator{hint}")
        kind = "operator" if found[0] in WORDS else str(found.lastgroup)
        tokens.append(Token(kind, found[0], at + 1))
        at = SPACE.match(text, found.end()).end()
    return [*tokens, Token("end", "", len(text) + 1)]


class _Parser:
    def __init__(self, tokens: list[Token]) -> None:
        self._tokens = iter(tokens)
        self.token = next(self._tokens)
        self._depth = 0

    def take(self) -> Token:
        """The present token; go to the next one."""
        token = self.token
        self.token = next(self._tokens, token)
        return token

    def unexpected(self, expected: str) -> ExpressionError:
        return ExpressionError(self.token.column, f"expected {expected}, got {self.token.shown}")

    def expect(self, text: str) -> None:
        if self.token.text != text or self.token.kind != "operator":
            raise self.unexpected(repr(text))
        self.take()

    def expression(self, floor: int) -> Node:
        """What stands here, up to an operator that binds less than `floor`."""
        self._depth += 1
        if self._depth > DEEPEST + 1:
            raise ExpressionError(self.token.column, f"more than {DEEPEST} levels of brackets")
        left = self.operand(floor)
        while self.token.kind == "operator" and BINDING.get(self.token.text, 0) >= floor:
            left = self.operation(left)
        self._depth -= 1
        return left

    def operation(self, left: Node) -> Node:
        """The operation whose operator stands here."""
        operator = self.take()
        binding = BINDING[operator.text]
        if binding == CONDITIONAL:
            condition = self.expression(OR)
            self.expect("else")
            otherwise = self.expression(CONDITIONAL)
            return Node("if", operator.column, (condition, left, otherwise))
        right = self.expression(SIGN if binding == POWER else binding + 1)
        if binding == RELATION and self.token.text in RELATIONS:
            raise self.unexpected("no second relation: write a < b and b < c")
        return Node(operator.text, operator.column, (left, right))

    def operand(self, floor: int) -> Node:
        token = self.token
        if token.kind == "number":
            return self.number()
        if token.kind == "name" and token.text not in NO_NAMES:
            self.take()
            if self.token.text == "(":
                return self.call(token)
            return Node("name", token.column, name=token.text)
        if token.text == "(":
            self.take()
            inner = self.expression(CONDITIONAL)
            self.expect(")")
            return inner
        if token.text in ("-", "+"):
            self.take()
            value = self.expression(SIGN)
            return value if token.text == "+" else Node("negative", token.column, (value,))
        if token.text == "not" and floor <= NOT:
            self.take()
            return Node("not", token.column, (self.expression(NOT),))
        raise self.unexpected("a number, a name or '('")

    def number(self) -> Node:
        token = self.take()
        value = float(token.text)
        if not math.isfinite(value):
            raise ExpressionError(token.column, f"{token.shown} is too large")
        return Node("number", token.column, value=value)

    def call(self, function: Token) -> Node:
        """The function whose arguments stand here."""
        if function.text not in FUNCTIONS:
            known = ", ".join(FUNCTIONS)
            raise ExpressionError(function.column, f"no function {function.shown} (known: {known})")
        arguments = []
        separator = "("
        while self.token.text == separator:
            self.take()
            arguments.append(self.expression(CONDITIONAL))
            separator = ","
        self.expect(")")
        count = FUNCTIONS[function.text]
        if len(arguments) != (count or max(2, len(arguments))):
            wanted = count or "2 or more"
            raise ExpressionError(
                function.column,
                f"{function.text}: expected {wanted} argument{'s' * (count != 1)}, "
                f"got {len(arguments)}",
            )
        if count:
            return Node(function.text, function.column, tuple(arguments))
        return reduce(lambda a, b: Node(function.text, function.column, (a, b)), arguments)
