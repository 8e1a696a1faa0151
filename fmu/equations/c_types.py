"""Types of interpreted C, and where its variables are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pycparser import c_ast

from equations.c_text import NO_TYPES, Program, refused

REAL, DOUBLE, INT, BOOL, VOID = "real", "double", "int", "bool", "void"
NAMES = {"double": DOUBLE, "int": INT, "_Bool": BOOL, "void": VOID}
UNSET = object()  # what a variable has before it gets a value


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
        """Type of a declaration."""
        if isinstance(node, c_ast.Decl | c_ast.Typename | c_ast.Typedef | c_ast.TypeDecl):
            return self.of(node.type)
        if isinstance(node, c_ast.PtrDecl):
            if isinstance(node.type, c_ast.FuncDecl):
                raise refused(node, "pointers to functions are not read: call the function")
            return Pointer(self.of(node.type))
        if isinstance(node, c_ast.ArrayDecl):
            length = None if node.dim is None else self.size(node.dim)
            return Array(self.of(node.type), length)
        if isinstance(node, c_ast.Struct):
            return Structure(node.name or f"at {node.coord}")
        if isinstance(node, c_ast.Enum):
            return INT
        if isinstance(node, c_ast.IdentifierType):
            return self._named(node)
        raise refused(node, f"{type(node).__name__} is no type of the equations' C")

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
        """Types of the fields of a structure."""
        name = structure.name
        if name not in self.structures:
            if name not in self.program.structs:
                raise refused(node, f"struct {name} is not defined")
            self.structures[name] = {
                field.name: self.of(field) for field in self.program.structs[name].decls
            }
        return self.structures[name]
