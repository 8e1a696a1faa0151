"""Values of a graph as statements: a constant for each operation, in the order of the text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..expressions.expression import in_order
from ..graph.graph import CONDITIONS, LEAVES, Value
from ..plain_c.values import RELATION, Conditions
from .blocks import Blocks, Writer
from .loops import printed
from .statements import Block, Constant, Item, Operand, Place, store

WITHOUT_DERIVATIVES = ("value_of", "moving_as")  # elsewhere they are their first argument
FUNCTIONS = {"hypot": "slopes_hypot", "noise": "random_normal", "uniform": "random_uniform"}


class Leaves(dict[tuple[str, str], Operand]):
    """Where C has leaves, by operation and name.

    names: of values. arrays: of tables in use. conditions: what integer leaves may be.
    """

    def __init__(
        self,
        places: Mapping[tuple[str, str], Operand],
        names: Mapping[Value, str],
        arrays: set[str],
        conditions: Conditions,
    ) -> None:
        super().__init__(places)
        self.names, self.arrays, self.conditions = names, arrays, conditions

    def but(self, own: Mapping[tuple[str, str], Operand]) -> Leaves:
        """Return these leaves, of which some are elsewhere."""
        return Leaves({**self, **own}, self.names, self.arrays, self.conditions)


class Code(Writer):
    """Statements, each value once; values that do not move are calculated in an `outer` code.

    names: of more values than the source has names for.
    """

    def __init__(
        self,
        leaves: Leaves,
        outer: Code | None = None,
        names: Mapping[Value, str] | None = None,
    ) -> None:
        self.leaves, self.outer = leaves, outer
        self.names = leaves.names if names is None else {**names, **leaves.names}
        self.statements: list[Item] = []
        self.known: dict[Value, Operand] = {}

    def of(self, root: Value) -> Operand:
        """Return the operand of a value."""
        if self.outer and not root.moves:
            return self.outer.of(root)
        for value in () if root in self.known else in_order([root], self.known):
            self.known[value] = self.operand(value, [self.known[x] for x in value.arguments])
        return self.known[root]

    def operand(self, value: Value, given: Sequence[Operand], name: str = "") -> Operand:
        """Return the operand of an operation on others, after its statement."""
        if value.op == "number":
            return value.number
        if value.op in LEAVES:
            place = self.leaves[value.op, value.name]
            return ("double", place) if self._is_int(value) else place
        if self.outer and not value.moves:
            return self.outer.of(value)
        name = self.names.get(value, name)
        match value.op:
            case op if op in WITHOUT_DERIVATIVES:
                return given[0]
            case op if op in RELATION and self._is_int(value.arguments[0]):
                return self._comparison(value, given)
            case "entry":
                self.leaves.arrays.add(value.name)
                return self.constant(("entry", value.name, *given), name=name)
            case "element":
                place, *row = given
                return self.constant(element(row, place), name=name)
            case "locate":
                return self.constant(located(self, value.name, given[0]), "int", name)
        c_type = "int" if value.op in CONDITIONS else "double"
        return self.constant(called(value.op, *given), c_type, name)

    def _is_int(self, value: Value) -> bool:
        """Return whether C has an integer leaf as an int."""
        place = self.leaves.get((value.op, value.name))
        return value.op == "integer" and isinstance(place, Place) and place.c_type == "int"

    def _comparison(self, value: Value, given: Sequence[Operand]) -> Operand:
        """Compare an integer leaf, as an int with a whole number."""
        leaf, other = value.arguments
        if other.op != "number" or other.number != int(other.number):
            return self.constant((value.op, *given), "int")
        return value.op, self.leaves[leaf.op, leaf.name], self.whole(leaf, int(other.number))

    def whole(self, _leaf: Value, number: int) -> str:
        """Return a number that a leaf is compared with."""
        return str(number)

    def constant(
        self, of: Operand, c_type: str = "double", name: str = "", is_kept: bool = False
    ) -> Constant:
        """Return a new constant."""
        self.statements.append(Constant(of, c_type, name, is_kept))
        return self.statements[-1]

    def assign(self, values: Mapping[Place, Value]) -> Code:
        """Give places their values, after all of them have been calculated."""
        before = self.statements
        blocks = Blocks.of_graph(self, [*values.values()], self.leaves.conditions)
        given, statements = blocks.written()
        self.statements = [*before, *statements, *map(store, values, given)]
        return self

    @property
    def has_blocks(self) -> bool:
        """Whether later statements may not read all that is calculated."""
        return any(isinstance(item, Block) for item in self.statements)

    def lines(self) -> list[str]:
        """Return the text of the statements."""
        return printed(self.statements)[0]


def called(op: str, *given: Operand) -> Operand:
    """An operation of the graph."""
    return FUNCTIONS.get(op, op), *given


def element(row: list[Operand], place: Operand) -> Operand:
    """The element of a row at a place; a part of an array of C is read where it is."""
    first, array = row[0], ("row", *row)
    function = "relations_element"
    if isinstance(first, Place) and first.index is not None:
        before, after = first.before, first.after
        following = enumerate(row, first.index)
        if all(isinstance(x, Place) and (x.before, x.index, x.after) == (before, i, after)
               for i, x in following):  # fmt: skip
            array = before.removeprefix("(double)").removesuffix("[")
            array += f" + {first.index}" if first.index else ""
            function = "relations_count" if before.startswith("(double)") else function
    return function, array, len(row), place


def located(code: Code, bounds: str, x: Operand) -> Operand:
    """The segment of x; without bounds the largest whole number up to it."""
    if not bounds:
        return "relations_floor", x
    code.leaves.arrays.add(bounds)
    return "relations_locate", bounds, f"sizeof {bounds} / sizeof *{bounds}", x
