"""The header that a C file includes to read and write the variables of a file: NAME_values.h.

It is made of NAME.toml beside it. struct NAME_parameters has the parameters, with those of an
included file OTHER.toml in a struct OTHER_parameters; struct NAME_values has the time and all
variables, with the forces of friction and stops. Elements of an array have their places in an array
of C, from 0. What is neither real nor a condition has an enum.
"""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from ..names import OF_VALUES
from . import contacts
from .arrays import elements
from .content import BOOLEAN, INTEGER, ModelFile
from .include import Source, source_of
from .keys import FIELD

GROUPS = {"inputs": "inputs", "states": "states", "discrete": "held between events"}
CALCULATED = ("where", "outputs")  # those without a value are written by C
RATES = "dx"  # of a file with a hook
Place = tuple[str | int, ...]  # a field of struct NAME_values, from its name


@dataclass(frozen=True)
class Field:
    """A field of a struct: a variable, or an array of variables."""

    name: str
    group: str  # the struct that it is in, within another; or none
    elements: tuple[tuple[str, tuple[int, ...]], ...]  # names of variables with their indexes
    entry: Any
    prefix: str  # of the enum

    @property
    def c_type(self) -> str:
        """Its type in C; an enumeration is an int with the values of an enum."""
        is_whole = isinstance(self._type, list | dict) or self._type in (BOOLEAN, INTEGER)
        return "int" if is_whole else "double"

    @property
    def _type(self) -> Any:
        return self.entry.get("type") if isinstance(self.entry, dict) else None

    def lines(self) -> Iterator[str]:
        """Yield its declaration."""
        about = self.entry if isinstance(self.entry, dict) else {}
        texts = [about[key] for key in ("unit", "description") if type(about.get(key)) is str]
        comment = ": ".join(" ".join(text.split()) for text in texts).replace("*/", "* /")
        indexes = zip(*(at for _, at in self.elements), strict=False)  # refused where it is read
        last = [max(column) for column in indexes]
        sizes = "".join(f"[{index + 1}]" for index in last)
        yield f"{self.c_type} {self.name}{sizes};" + (comment and f" /* {comment} */")

    def enum(self) -> Iterator[str]:
        """Yield the enum of its type, if it needs one."""
        if isinstance(self._type, list | dict):
            head = f"{self.prefix}_{self.name}".upper()
            yield f"enum {self.prefix}_{self.name} {{"
            for number, item in enumerate(self._type, 1):
                yield f"    {head}_{str(item).upper()} = {number},"
            yield "};"

    def places(self) -> Iterator[tuple[Place, str]]:
        """Yield the places of variables, from the field or its group."""
        inside = (*filter(None, self.group.split(".")), self.name)
        for name, indexes in self.elements:
            yield (*inside, *indexes), name


def fields_of(entries: Iterable[tuple[str, Any]], prefix: str) -> list[Field]:
    """Return the fields of variables, from their names and entries."""
    found: dict[tuple[str, str], list[tuple[str, tuple[int, ...], Any]]] = {}
    for name, entry in entries:
        given = entry.get("field") if isinstance(entry, dict) else None
        is_path = isinstance(given, str) and FIELD.fullmatch(given)
        path = given if is_path else name
        group, _, field = path.partition("[")[0].rpartition(".")
        found.setdefault((group, field), []).append((name, _indexes(path), entry))
    result = []
    for (group, field), members in found.items():
        by_name = [at for name, at, _ in members if "[" in name]
        first = [min(column) for column in zip(*by_name, strict=True)]  # C counts from 0
        elements = [
            (name, tuple(i - low for i, low in zip(at, first, strict=True)) if first else at)
            for name, at, _ in members
        ]
        result.append(Field(field, group, tuple(elements), members[0][2], prefix))
    return result


class Header:
    """The header of a file, and where each variable is in its struct of values."""

    def __init__(self, source: Source) -> None:
        self.stem, self.folder = source.path.stem, source.path.parent
        self.inner = [header for each in source.included for header in Header(each).outer()]
        inner = {name for header in self.inner for _, name in header.parameters()}
        tables = source.tables
        has_hook = "hook" in tables
        file = ModelFile("", "", {}, source.path, "", set())
        with suppress(AttributeError):  # what is wrong with it is said where it is read
            file.sizes.update(tables.get("sizes", {}).items())

        def fields(*sections: str, only_called: bool = False) -> list[Field]:
            found = []
            for section in sections:
                given = tables.get(section)
                for key, entry in given.items() if isinstance(given, dict) else ():
                    is_called = isinstance(entry, dict) and "value" not in entry
                    if not only_called or is_called:
                        with suppress(Exception):  # as above
                            found += [(each.name, entry) for each in elements(file, key, entry)]
            kept = [(name, entry) for name, entry in found if name not in inner]
            return fields_of(kept, self.stem)

        self.own = fields("parameters")
        self.variables = {title: fields(section) for section, title in GROUPS.items()}
        modes = tables.get("modes", [])
        if isinstance(modes, dict | list):
            boolean = {"type": BOOLEAN}
            names = [(name, boolean) for name in modes if isinstance(name, str)]
            self.variables["modes"] = fields_of(names, self.stem)
        forces = [(name, None) for name in _forces(file, tables)]
        self.variables["forces of friction and stops"] = fields_of(forces, self.stem)
        self.variables["calculated"] = fields(*CALCULATED, only_called=not has_hook)
        states = sum(len(field.elements) for field in self.variables["states"])
        self.rates = [f"double {RATES}[{states}]; /* derivatives of the states */"]
        self.rates *= has_hook and states > 0

    def all(self) -> Iterator["Header"]:
        """Yield this header and those that it includes."""
        yield self
        for header in self.inner:
            yield from header.all()

    def outer(self) -> list["Header"]:
        """Return this header or, if it declares no parameters, the headers that it includes."""
        return [self] if self.own else self.inner

    def parameters(self) -> Iterator[tuple[Place, str]]:
        """Yield the places of parameters, from the struct of parameters."""
        for header in self.inner:
            for place, name in header.parameters():
                yield (header.stem, *place), name
        for field in self.own:
            yield from field.places()

    @property
    def places(self) -> dict[Place, str]:
        """Variables by their places in the struct of values."""
        found: dict[Place, str] = {("time",): "time"}
        found |= {("parameters", *place): name for place, name in self.parameters()}
        for fields in self.variables.values():
            found |= dict(pair for field in fields for pair in field.places())
        return found

    def text(self) -> str:
        """The text of the header."""
        lines = [f"/* Made of {self.stem}.toml: change that file. */", "#pragma once", ""]
        folders = [Path(os.path.relpath(header.folder, self.folder)) for header in self.inner]
        paths = [f / (h.stem + OF_VALUES) for f, h in zip(folders, self.inner, strict=True)]
        lines += [f'#include "{path.as_posix()}"' for path in paths]
        for field in (*self.own, *(f for fields in self.variables.values() for f in fields)):
            lines += [*field.enum()]
        inner = [f"struct {h.stem}_parameters {h.stem};" for h in self.inner if h.has_parameters]
        own = [line for field in self.own for line in field.lines()]
        if self.has_parameters:
            lines += _struct(f"{self.stem}_parameters", [*inner, *own])
        fields = [f"struct {self.stem}_parameters parameters;"] if self.has_parameters else []
        fields.append("double time; /* s */")
        for title, group in self.variables.items():
            fields += [f"/* {title} */"] if group else []
            for name, members in groupby(group, lambda field: field.group):
                own = [line for field in members for line in field.lines()]
                if name:
                    lines += _struct(f"{self.stem}_{name}", own)
                    own = [f"struct {self.stem}_{name} {name};"]
                fields += own
            fields += self.rates if title == "states" else []
        return "\n".join([*lines, *_struct(f"{self.stem}_values", fields)])

    @property
    def has_parameters(self) -> bool:
        """Whether there is a struct of parameters."""
        return bool(self.own) or any(header.has_parameters for header in self.inner)


def _forces(file: ModelFile, tables: dict[str, Any]) -> Iterator[str]:
    """Yield the names of the forces of friction and stops."""
    for section in contacts.SECTIONS:  # C reads their forces
        given = tables.get(section)
        for key, entry in given.items() if isinstance(given, dict) else ():
            with suppress(Exception):  # what is wrong with it is said where it is read
                for each in elements(file, key, entry):
                    yield file.expression(each, (), each.entry["force"], None).tree.name


def _indexes(name: str) -> tuple[int, ...]:
    """Return the indexes of an element."""
    return tuple(map(int, re.findall(r"(?<=[\[,])\d+", name)))


def _struct(name: str, fields: Iterable[str]) -> list[str]:
    return [f"struct {name} {{", *(f"    {field}" for field in fields), "};", ""]


def origin(path: Path) -> Path:
    """Return NAME.toml in place of a file NAME_values.h that is not there."""
    is_made = path.name.endswith(OF_VALUES) and not path.is_file()
    return path.with_name(path.name.removesuffix(OF_VALUES) + ".toml") if is_made else path


def made(path: Path) -> str | None:
    """Return the text of NAME_values.h if NAME.toml is beside it."""
    file = origin(path)
    return Header(source_of(file)).text() if file != path and file.is_file() else None
