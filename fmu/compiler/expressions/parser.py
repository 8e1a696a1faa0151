"""The parser of expressions, which climbs precedences, and the functions that they may call."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, reduce

from ..units import BASE, Unit, shown
from ..units import parsed as unit_of
from .expression import (
    BINDING,
    CONDITIONAL,
    DERIVATIVE,
    EQUALITIES,
    FUNCTIONS,
    MOST_OPERATIONS,
    NOT,
    OR,
    OVER_RANGES,
    PARTIAL,
    POWER,
    RANDOM,
    RELATION,
    RELATIONS,
    SHOWN,
    SIGN,
    TOO_LARGE,
    ExpressionError,
    Node,
    derivative_of,
    evaluated,
    in_order,
    names,
    with_names,
)
from .hints import OF_NUMBERS, SIGNS, meant
from .indexes import Range, at_indexes
from .kinds import with_kinds

LITERALS = {"true": 1.0, "false": 0.0}
# not to be used as names: operators, and words that other languages execute or give a value
WORDS = ("and", "or", "not", "if", "else")
NO_NAMES = (*WORDS, *LITERALS, "True", "False", "None", "lambda")
DEEPEST = 100  # levels of brackets and other nesting
UNIT_ONE = "1"  # name of an operation whose value has this unit
AS_SECOND = "as second"  # name of a "unit", which its second argument has
SPACE = re.compile(r"\s*")
TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?!\w|\.(?!\.))"
    r"|(?P<name>[^\W\d]\w*(?:\.[^\W\d]\w*)*)"
    r"|(?P<text>\"[^\"]*\"|'[^']*')"
    r"|(?P<operator>\*\*|[<>=!]=|\.\.|[-+*/<>(),\[\]=])"
)
LONGEST = 1000  # characters
TERM = {"any": "x[i] > 0", "all": "x[i] > 0"}  # in examples; otherwise x[i]


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


@dataclass(frozen=True)
class Function:
    """A function that stands for an expression of its arguments."""

    arguments: tuple[str, ...]
    body: Node
    has_unit_one: bool = False  # its value takes no other unit, although it is made of numbers
    name: str = ""  # by which `table_unit` has units of its arguments and its value
    function: str = ""  # of `FURTHER`

    def of(self, given: Sequence[Node], column: int) -> Node:
        """Return its expression for these arguments; mistakes in it are at this column."""
        if self.name:
            units = (table_unit(self.name, i) for i in range(len(given)))
            given = [
                Node("unit", a.column, (a,), 0.0, u) for a, u in zip(given, units, strict=True)
            ]
            body = replace(self, name="").of(given, column)
            return Node("unit", column, (body,), name=table_unit(self.name))
        known = dict(zip(self.arguments, given, strict=True))
        found = with_names(self.body, known, column, self.function)
        return replace(found, name=UNIT_ONE) if self.has_unit_one else found


def form_over_range(name: str) -> str:
    """Write how a function over a range is called, behind a message."""
    return f": over a range it is {name}(i = 1..n, {TERM.get(name, 'x[i]')})"


def table_unit(name: str, argument: int | str = "") -> str:
    """Return the key that units have for an argument of a table or function, or for its value."""
    return f"{name}({argument})"


@dataclass(frozen=True)
class Lookup:
    """A table, a function of a C file or of `RANDOM`, floor or hypot: an operation of its own.

    optional: how many of the arguments need not be given; they are 0 then.
    """

    name: str
    arguments: tuple[str, ...]
    op: str = "table"
    optional: int = 0

    def of(self, given: Sequence[Node], column: int) -> Node:
        """Return the operation on these arguments."""
        function = self.name if self.op == self.name else ""
        zeros = [Node("number", column)] * (len(self.arguments) - len(given))
        return Node(self.op, column, (*given, *zeros), name=self.name, function=function)


def parse(
    text: str,
    functions: Mapping[str, Function | Lookup] | None = None,
    unit: Callable[[str], Unit] = unit_of,
) -> Node:
    """Parse an expression; ExpressionError says what is wrong with it.

    functions: further ones, by name. unit: returns the unit of a text, or raises ValueError.
    """
    parser = _Parser(text, FURTHER if functions is None else {**FURTHER, **functions}, unit)
    root = parser.expression(CONDITIONAL)
    if parser.token.kind != "end":
        raise parser.unexpected("an operator")
    return root


def parse_ranges(text: str) -> list[Range]:
    """Parse "i = 1..n, j = 1..i"; ExpressionError says what is wrong with it."""
    parser = _Parser(text, FURTHER, unit_of)
    found = [parser.range()]
    while parser.token.text == ",":
        parser.take()
        found.append(parser.range())
    if parser.token.kind != "end":
        raise parser.unexpected("','")
    return found


def _tokens(text: str) -> list[Token]:
    tokens = []
    at = SPACE.match(text).end()
    while at < len(text):
        found = TOKEN.match(text, at)
        if found is None:
            piece = text[at : at + SHOWN].split()[0]
            hint = f": {SIGNS[piece[0]]}" if piece[0] in SIGNS else ""
            raise ExpressionError(at + 1, f"{piece!r} is no number, name or operator{hint}")
        kind = "operator" if found[0] in WORDS else str(found.lastgroup)
        tokens.append(Token(kind, found[0], at + 1))
        at = SPACE.match(text, found.end()).end()
        if kind == "number" and text[at : at + 1] == "[":  # its unit, of any characters
            end = text.find("]", at)
            if end < 0:
                raise ExpressionError(at + 1, "'[' begins a unit, but there is no ']'")
            tokens.append(Token("unit", text[at + 1 : end], at + 2))
            at = SPACE.match(text, end + 1).end()
    return [*tokens, Token("end", "", len(text) + 1)]


class _Parser:
    def __init__(
        self,
        text: str,
        functions: Mapping[str, Function | Lookup],
        unit: Callable[[str], Unit],
    ) -> None:
        self._functions, self._unit = functions, unit
        self._tokens, self._at = _tokens(text), 0
        self._depth = 0
        self._operations = 0  # that functions stand for
        self._form = ""  # of what is read, in messages

    @property
    def token(self) -> Token:
        return self._tokens[self._at]

    def take(self) -> Token:
        """Return the current token, and go to the next one."""
        token = self.token
        self._at = min(self._at + 1, len(self._tokens) - 1)
        return token

    def unexpected(self, expected: str) -> ExpressionError:
        text = f"expected {expected}, got {self.token.shown}{self._form}"
        if self.token.text == "[" and not self._form:
            text += f": {OF_NUMBERS}, and several indexes are x[i, j]"
        return ExpressionError(self.token.column, text)

    def expect(self, text: str) -> None:
        if self.token.text != text or self.token.kind != "operator":
            raise self.unexpected(repr(text))
        self.take()

    def expression(self, floor: int) -> Node:
        """Parse up to an operator that binds less than `floor`."""
        self._depth += 1
        if self._depth > DEEPEST + 1:
            raise ExpressionError(self.token.column, f"more than {DEEPEST} levels of brackets")
        left = self.operand(floor)
        while self.token.kind == "operator" and BINDING.get(self.token.text, 0) >= floor:
            left = self.operation(left)
        self._depth -= 1
        return left

    def operation(self, left: Node) -> Node:
        """Parse the operation whose operator stands here."""
        operator = self.take()
        binding = BINDING[operator.text]
        if binding == CONDITIONAL:
            condition = self.expression(OR)
            self.expect("else")
            otherwise = self.expression(CONDITIONAL)
            return Node("if", operator.column, (condition, left, otherwise))
        right = self.expression(SIGN if binding == POWER else binding + 1)
        if binding == RELATION and self.token.text in (*RELATIONS, *EQUALITIES):
            raise self.unexpected("no second relation: write a < b and b < c")
        return Node(operator.text, operator.column, (left, right))

    def operand(self, floor: int) -> Node:
        token = self.token
        if token.kind == "number":
            return self.number()
        if token.kind == "text":
            self.take()
            return Node("text", token.column, name=token.text[1:-1])
        if token.text in LITERALS:
            self.take()
            return Node("literal", token.column, value=LITERALS[token.text])
        if token.kind == "name" and token.text not in NO_NAMES:
            self.take()
            return self.call(token) if self.token.text == "(" else self.variable(token)
        if token.text == "(":
            self.take()
            inner = self.expression(CONDITIONAL)
            self.expect(")")
            return inner
        if token.text in ("-", "+"):
            self.take()
            below = self.below_zero() if token.text == "-" else None
            if below:
                return below
            value = self.expression(SIGN)
            return value if token.text == "+" else Node("negative", token.column, (value,))
        if token.text == "not" and floor <= NOT:
            self.take()
            return Node("not", token.column, (self.expression(NOT),))
        raise self.unexpected("a number, a name or '('")

    def variable(self, token: Token, form: str = "{}") -> Node:
        """Parse the indexes of a variable, if it has any; form: of its name."""
        if self.token.text != "[":
            return Node("name", token.column, name=form.format(token.text))
        indexes = []
        while self.token.text == ("," if indexes else "["):
            self.take()
            indexes.append(self.expression(CONDITIONAL))
        self.expect("]")
        name = form.format(f"{token.text}[{','.join(['{}'] * len(indexes))}]")
        return Node("element", token.column, tuple(indexes), name=name)

    def range(self) -> Range:
        """Parse "i = 1..n"."""
        token = self.take()
        if token.kind != "name" or token.text in NO_NAMES or "." in token.text:
            text = f"expected an index such as i, got {token.shown}{self._form}"
            raise ExpressionError(token.column, text)
        self.expect("=")
        first = self.expression(CONDITIONAL)
        self.expect("..")
        return Range(token.text, first, self.expression(CONDITIONAL))

    def has_range(self, function: str) -> bool:
        """Return whether a call, whose bracket stands here, is one over a range."""
        if function not in OVER_RANGES or function in self._functions:
            return False
        ahead = [token.text for token in self._tokens[self._at + 1 : self._at + 3]]
        return function not in FUNCTIONS or ahead[-1] == "="

    def over_range(self, function: Token) -> Node:
        """Parse the range and the terms of a sum, of the least of several, ..."""
        name, column = function.text, function.column
        self.take()
        self._form = form_over_range(name)
        over = self.range()
        self.expect(",")
        self._form = ""
        body = self.expression(CONDITIONAL)
        if self.token.text in ("=", ","):
            raise self.unexpected(f"')', as in {name}(i = 1..n, {name}(j = 1..m, ...))")
        self.expect(")")
        return Node(OVER_RANGES[name], column, (over.first, over.last), 0.0, over.index, body)

    def number(self) -> Node:
        token = self.take()
        value = float(token.text)
        if not math.isfinite(value):
            raise ExpressionError(token.column, f"{token.shown} is too large")
        if self.token.kind == "unit":
            return self.quantity(token.text, token.column)
        return Node("number", token.column, value=value)

    def quantity(self, number: str, column: int) -> Node:
        """Parse the unit of a number, whose value is that in SI."""
        token = self.take()
        try:
            unit = self._unit(token.text.strip())
        except ValueError as error:
            raise ExpressionError(token.column, f"{error}") from None
        try:
            value = unit.value(number)
        except ValueError as error:
            raise ExpressionError(column, f"{error}") from None
        exponents = {base: unit.exponents.get(base, 0) for base in BASE}
        given = (Node("number", column, value=value),)
        of = (tuple(exponents.values()),)
        if self.token.kind in ("name", "number") or self.token.text in ("(", "["):
            text = "behind a unit: write all of the unit between the brackets, as in 2[rad/s]"
            raise ExpressionError(self.token.column, f"{self.token.shown} {text}")
        return Node("unit", column, given, name=f"[{shown(exponents)}]", of=of)

    def below_zero(self) -> Node | None:
        """Parse a number below the zero of a unit that is not SI's: -20[degC] after its sign."""
        at, number = self._at, self.take()
        if number.kind == "number" and self.token.kind == "unit":
            with suppress(ValueError):
                if self._unit(self.token.text.strip()).offset:
                    return self.quantity(f"-{number.text}", number.column)
        self._at = at
        return None

    def call(self, function: Token) -> Node:
        """Parse the arguments of a function."""
        if function.text == DERIVATIVE:
            return self.derivative()
        if self.has_range(function.text):
            return self.over_range(function)
        if function.text == PARTIAL and PARTIAL not in self._functions:
            return self.partial(function)
        further = self._functions.get(function.text)
        if function.text not in FUNCTIONS and further is None:
            known = [*FUNCTIONS, *self._functions, DERIVATIVE, PARTIAL, "sum", "any", "all"]
            text = f"no function {function.shown}{meant(function.text, known)}"
            raise ExpressionError(function.column, f"{text} (known: {', '.join(known)})")
        arguments = []
        separator = "("
        while self.token.text == separator:
            self.take()
            if self.token.text == ")" and further and not further.arguments:
                break
            arguments.append(self.expression(CONDITIONAL))
            separator = ","
        form = form_over_range(function.text) if function.text in OVER_RANGES else ""
        self._form = form
        self.expect(")")
        self._form = ""
        count = len(further.arguments) if further else FUNCTIONS[function.text]
        fewest = 2 if count is None else count - getattr(further, "optional", 0)
        if not fewest <= len(arguments) <= (count or len(arguments)):
            numbers = (
                "2 or more" if count is None else " or ".join(map(str, sorted({fewest, count})))
            )
            wanted = f"{numbers} argument{'s' * (count != 1)}"
            text = f"{function.text}: expected {wanted}, got {len(arguments)}{form}"
            raise ExpressionError(function.column, text)
        if further:
            return self.expanded(further, arguments, function.column)
        if count:
            return Node(function.text, function.column, tuple(arguments))
        return reduce(lambda a, b: Node(function.text, function.column, (a, b)), arguments)

    def expanded(self, function: Function | Lookup, arguments: list[Node], column: int) -> Node:
        """Return the expression that a call stands for; those that multiply are refused."""
        if isinstance(function, Function):
            self._operations += len(in_order([function.body]))
        if self._operations > MOST_OPERATIONS:
            raise ExpressionError(column, TOO_LARGE)
        if function is FURTHER.get("mod"):
            x, y = arguments
            arguments = [x, Node("unit", y.column, (y, x), name=AS_SECOND)]
        return function.of(arguments, column)

    def derivative(self) -> Node:
        """Parse the state whose derivative is meant."""
        self.expect("(")
        state = self.take()
        if state.kind != "name":
            raise ExpressionError(state.column, f"expected a state, got {state.shown}")
        found = self.variable(state, derivative_of("{}"))
        self.expect(")")
        return found

    def partial(self, function: Token) -> Node:
        """Parse an expression and the name by which it is derived."""
        self.expect("(")
        root = self.expression(CONDITIONAL)
        self.expect(",")
        by = self.take()
        if by.kind != "name":
            raise ExpressionError(by.column, f"expected a name to derive by, got {by.shown}")
        found = Node(PARTIAL, function.column, (root, self.variable(by)))
        self.expect(")")
        return found


# functions whose names are free for variables
FURTHER: dict[str, Function | Lookup] = {}
_WHOLE = {"whole": Lookup("floor", ("x",), "floor")}
for _name, _arguments, _body in (
    ("sign", "x", "1 if x > 0 else -1 if x < 0 else 0"),
    ("log10", "x", f"log(x) / {math.log(10)!r}"),
    ("cbrt", "x", f"x**{1 / 3!r} if x >= 0 else -(-x)**{1 / 3!r}"),
    ("ceil", "x", "-whole(-x)"),
    ("round", "x", "whole(x + 0.5)"),
    ("mod", "x y", "x - y * whole(x / y)"),
):
    _parts = (tuple(_arguments.split()), parse(_body, _WHOLE), _name == "sign")
    FURTHER[_name] = Function(*_parts, function=_name)
FURTHER |= {"floor": _WHOLE["whole"], "hypot": Lookup("hypot", ("x", "y"), "hypot")}
# of files with equations; a function of the same name that the file has is meant instead
RANDOM_FUNCTIONS = {name: Lookup(name, ("seed", "k", "stream"), name, 1) for name in RANDOM}


@dataclass(frozen=True)
class Expression:
    """A number that follows from others. A name may have dots: ``component.variable``."""

    text: str
    tree: Node

    @cached_property
    def names(self) -> frozenset[str]:
        """Names whose values it needs."""
        return names(self.tree)

    def value(self, values: Mapping[str, float]) -> float:
        """Return the value; ArithmeticError, ValueError if it is not defined or too large."""
        result = evaluated(self.tree, values)
        if not math.isfinite(result):
            raise ValueError("is not a finite number")
        return result


def parsed(text: str) -> Expression:
    """Parse and check an expression; ValueError says what is wrong with it."""
    if len(text) > LONGEST:
        raise ValueError(f"has more than {LONGEST} characters")
    return Expression(text, with_kinds(at_indexes(parse(text), {})))
