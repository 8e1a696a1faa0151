"""The memory of interpreted C: types and addresses, and what variables hold on a path."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from pycparser import c_ast

from ..graph.graph import Graph, Value
from .text import NO_TYPES, Program, refused
from .values import Cases, Choice, Conditions, Known

REAL, DOUBLE, INT, BOOL, VOID = "real", "double", "int", "bool", "void"
NAMES = {"double": DOUBLE, "int": INT, "_Bool": BOOL, "void": VOID}
LONGEST_ARRAY = 10_000
UNSET = object()  # what a variable has before it gets a value
# leaf of an argument's part: its path from the name of the argument, and its type
LeafOf = Callable[[tuple[str | int, ...], Any], Any]


@dataclass(frozen=True)
class Array:
    of: Any
    length: int | None  # None: of an argument, whose length is the caller's matter


@dataclass(frozen=True)
class Structure:
    name: str


@dataclass(frozen=True)
class Pointer:
    to: Any


@dataclass(frozen=True)
class Address:
    """Of an object or a part of it: a path of fields and indices."""

    object: int
    path: tuple[str | int, ...] = ()

    def __add__(self, part: str | int) -> Address:
        return Address(self.object, (*self.path, part))


def is_real(kind: Any) -> bool:
    return kind in (REAL, DOUBLE)


def is_whole(kind: Any) -> bool:
    return kind in (INT, BOOL)


class Types:
    """The types of a program; size: calculates the length of an array."""

    def __init__(self, program: Program, size: Callable[[c_ast.Node], int]) -> None:
        self.program, self.size = program, size
        self.structures: dict[str, dict[str, Any]] = {}

    def of(self, node: c_ast.Node) -> Any:
        """Return the type of a declaration."""
        if isinstance(node, c_ast.Decl | c_ast.Typename | c_ast.Typedef | c_ast.TypeDecl):
            return self.of(node.type)
        if isinstance(node, c_ast.PtrDecl):
            if isinstance(node.type, c_ast.FuncDecl):
                raise refused(node, "pointers to functions are not read: call the function")
            return Pointer(self.of(node.type))
        if isinstance(node, c_ast.ArrayDecl):
            length = None if node.dim is None else self.size(node.dim)
            if length is not None and not 0 < length <= LONGEST_ARRAY:
                raise refused(node, f"an array has 1 to {LONGEST_ARRAY} elements, not {length}")
            return Array(self.sized(node.type), length)
        if isinstance(node, c_ast.Struct):
            return Structure(node.name or f"at {node.coord}")
        if isinstance(node, c_ast.Enum):
            return INT
        if isinstance(node, c_ast.IdentifierType):
            return self._named(node)
        raise refused(node, f"{type(node).__name__} is no type of the equations' C")

    def sized(self, node: c_ast.Node) -> Any:
        """Return the type of a part, whose length has to be known."""
        kind = self.of(node)
        if isinstance(kind, Array) and kind.length is None:
            raise refused(node, "this array has no size")
        return kind

    def _named(self, node: c_ast.IdentifierType) -> Any:
        name = " ".join(node.names)
        if name in ("real", "size_t") and name in self.program.typedefs:
            return REAL if name == "real" else INT
        if name in NAMES:
            return NAMES[name]
        if name in self.program.typedefs:
            return self.of(self.program.typedefs[name])
        for part in node.names:
            if part in NO_TYPES:
                raise refused(node, NO_TYPES[part])
        raise refused(node, f"{name} is no type of the equations' C: use double, int or a struct")

    def fields(self, structure: Structure, node: c_ast.Node) -> dict[str, Any]:
        """Return the types of the fields of a structure."""
        name = structure.name
        if name not in self.structures:
            if name not in self.program.structs:
                raise refused(node, f"struct {name} is not defined")
            found = self.structures[name] = {}
            for field in self.program.structs[name].decls:
                if not isinstance(field, c_ast.Decl) or field.name is None:
                    raise refused(field, "each field of a struct needs a type and a name")
                found[field.name] = self.sized(field)
        return self.structures[name]


@dataclass
class State:
    """Values of the variables on a path, and facts known there."""

    memory: dict[Address, Any] = field(default_factory=dict)
    known: Known = field(default_factory=Known)


Scope = ChainMap[str, tuple[Address, Any]]  # variables of a block and those around it, by name


class Memory:
    """Objects of a program with their parts, and how these are read and written."""

    most_steps = 10**6  # of a run, before its text is refused

    def __init__(self, program: Program, graph: Graph) -> None:
        self.program, self.graph = program, graph
        self.types = Types(program, self.size)
        self.conditions = Conditions(graph, self.spend)
        self.names = self.graph.names  # of values, by the variables that got them
        self.inputs: dict[int, tuple[str, LeafOf]] = {}
        self.objects: dict[int, Any] = {}  # types
        self.titles: dict[int, str] = {}  # names of variables
        self.read: set[Address] = set()  # parts of arguments that were read before they were set
        self.steps = 0  # of this run
        self.here: c_ast.Node | None = None  # the expression that is read

    def size(self, node: c_ast.Node) -> int:
        """Evaluate a whole number that is known: length of an array, value of an enumerator."""
        raise NotImplementedError

    def spend(self, steps: int = 1) -> None:
        """Count steps; a text that takes too many is refused where it does."""
        self.steps += steps
        if self.steps > self.most_steps:
            what = f"more than {self.most_steps} steps"
            raise refused(self.here, f"{what}: use fewer rounds of loops, or fewer calls")

    def new_object(self, kind: Any) -> Address:
        self.objects[len(self.objects)] = kind
        return Address(len(self.objects) - 1)

    def declare(self, scope: Scope, name: str, kind: Any, value: Any, state: State) -> None:
        """Declare a new variable with a value, of its type."""
        address = self.new_object(kind)
        self.titles[address.object] = name
        scope[name] = (address, kind)
        if value is not UNSET:
            self.set_all(address, value, state)

    def kind_at(self, address: Address, node: c_ast.Node | None) -> Any:
        """Return the type of a part of an object."""
        kind = self.objects[address.object]
        for part in address.path:
            if isinstance(kind, Structure) and isinstance(part, str):
                fields = self.types.fields(kind, node)
                if part not in fields:
                    raise refused(node, f"struct {kind.name} has no field {part}")
                kind = fields[part]
            elif isinstance(kind, Array) and isinstance(part, int):
                if part < 0 or (kind.length is not None and part >= kind.length):
                    raise refused(node, f"index {part} is outside of an array of {kind.length}")
                kind = kind.of
            else:
                raise refused(node, "this pointer points to one value, not to an array")
        return kind

    def _leaf(self, address: Address) -> Any:
        name, leaf_of = self.inputs[address.object]
        kind = self.kind_at(address, None)
        return leaf_of((name, *address.path), kind)

    def get(self, address: Address, kind: Any, state: State, node: c_ast.Node) -> Any:
        """Read the value at an address."""
        self.spend()
        if isinstance(kind, Structure):
            fields = self.types.fields(kind, node)
            return {name: self.get(address + name, of, state, node) for name, of in fields.items()}
        if isinstance(kind, Array):
            return [self.get(address + i, kind.of, state, node) for i in range(kind.length or 0)]
        value = state.memory.get(address, UNSET)
        if value is UNSET and address not in state.memory and address.object in self.inputs:
            if isinstance(kind, Pointer):
                raise refused(node, "an argument has a pointer in it: pass what it points to")
            value = state.memory[address] = self._leaf(address)
            self.read.add(address)
        return value

    def set_all(self, address: Address, value: Any, state: State) -> None:
        """Store a value with all of its parts."""
        self.spend()
        if isinstance(value, dict):
            for name, part in value.items():
                self.set_all(address + name, part, state)
        elif isinstance(value, list):
            for i, part in enumerate(value):
                self.set_all(address + i, part, state)
        else:
            state.memory[address] = value
            if isinstance(value, Value) and value.arguments:
                self.names.setdefault(value, self._name_of(address))

    def _name_of(self, address: Address) -> str:
        """Return the last field of a path with its indices, or the variable's name."""
        names = [self.titles.get(address.object, "t"), *address.path]
        last = max(i for i, part in enumerate(names) if isinstance(part, str))
        return "_".join(map(str, names[last:]))

    def store(self, places: Any, value: Any, state: State, node: c_ast.Node) -> None:
        """Store a value at an address, or at choices of addresses."""
        for address, condition in self.alternatives(places, state.known):
            if condition is None:
                self.set_all(address, value, state)
                continue
            before = self.get(address, self.kind_at(address, node), state, node)
            if before is UNSET:
                raise refused(node, "set all elements before one is chosen by a condition")
            self.set_all(address, self.chosen(condition, value, before), state)

    def alternatives(
        self, places: Any, known: Known, condition: Value | None = None
    ) -> list[tuple[Address, Value | None]]:
        """Return addresses with the conditions under which they are meant; None: always."""
        places = self.conditions.simplified(places, known)
        if isinstance(places, Cases):
            places = self.conditions.as_choice(places, known)
        if not isinstance(places, Choice):
            return [(places, condition)]
        c, both = places.condition, self.conditions.both
        no = self.conditions.no(c)
        return [
            *self.alternatives(places.first, known, c if condition is None else both(condition, c)),
            *self.alternatives(
                places.second, known, no if condition is None else both(condition, no)
            ),
        ]

    def load(self, places: Any, state: State, node: c_ast.Node) -> tuple[Any, Any]:
        """Read type and value at an address, or at choices of addresses."""
        places = self.conditions.simplified(places, state.known)
        if isinstance(places, Cases):
            places = self.conditions.as_choice(places, state.known)
        if isinstance(places, Choice):
            kind, first = self.load(places.first, state, node)
            _, second = self.load(places.second, state, node)
            return kind, self.chosen(places.condition, first, second)
        kind = self.kind_at(places, node)
        if isinstance(kind, Array):  # as a value, it is a pointer to its first element
            return Pointer(kind.of), places + 0
        return kind, self.get(places, kind, state, node)

    def chosen(self, condition: Value, first: Any, second: Any) -> Any:
        """Choose the first value where the condition holds, else the second."""
        if isinstance(first, dict):
            return {k: self.chosen(condition, first[k], second[k]) for k in first}
        if isinstance(first, list):
            pairs = zip(first, second, strict=True)
            return [self.chosen(condition, a, b) for a, b in pairs]
        if first is second:
            return first
        if first is UNSET or second is UNSET:
            return UNSET
        if isinstance(first, Value):
            return self.conditions.select(condition, first, second)
        return self.conditions.choice(condition, first, second)
