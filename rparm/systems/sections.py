"""The sections of a loop file and of the loop files in it, its subsystems, as those of one file.

Names in a subsystem get its name in front: `left.motor.i`. Times, order, variants and recording of
its own file do not apply; the whole file may replace its parameters and feed its inputs.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rparm import project
from rparm.errors import hint
from rparm.files import (
    LARGEST_TOML,
    NAME,
    UnreadableError,
    is_file,
    read_text,
    read_toml,
    show,
)
from rparm.fmi.model import INPUTS, PARAMETERS
from rparm.runs.inputs import Reader
from rparm.units import SECONDS

COMPONENTS, CONNECTIONS, VARIANTS, KEEP = "components", "connections", "variants", "keep"
TIMES = ("start", "stop", "step")
REQUIRED = ("name", COMPONENTS)
OPTIONAL = ("description", *TIMES, "order", KEEP, CONNECTIONS, INPUTS, PARAMETERS, VARIANTS)
OF_COMPONENT = ("parameters", "every")
EQUATIONS, FILE = ".toml", "file"


@dataclass(frozen=True)
class Given:
    """A component as a file gives it."""

    source: str  # file or name
    folder: Path  # that paths begin at
    where: str  # for messages
    every: float | None  # s, its rate; None: the system's


@dataclass
class Flat:
    """Sections by "component.variable", of a file with all its subsystems."""

    components: dict[str, Given] = field(default_factory=dict)
    subsystems: list[str] = field(default_factory=list)  # names, each before those in it
    connections: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, Any] = field(default_factory=dict)
    parameters: dict[str, Any] = field(default_factory=dict)


class Sections(Reader):
    """Takes the sections of one file; errors name the file and the key.

    `above` are the files that it is in; `read` names the files that it takes values from.
    """

    def __init__(self, path: Path, above: tuple[Path, ...] = ()) -> None:
        super().__init__(path)
        self.above = (*above, path.resolve())
        self.read: list[Path] = []
        self.notes: list[str] = []

    def flat(self, content: dict[str, Any]) -> Flat:
        """Check the keys, and join the sections with those of subsystems."""
        self.keys(content, "", REQUIRED, OPTIONAL)
        components = self.table(content[COMPONENTS], f"[{COMPONENTS}]")
        if not components:
            self.fail(f"[{COMPONENTS}]: expected a component")
        found = Flat()
        for name, given in components.items():
            self.name(name, f"[{COMPONENTS}]")
            self._component(name, given, content.get("order"), found)
        for section in (CONNECTIONS, INPUTS):
            own = self.entries(content, section)
            if section == CONNECTIONS:  # in place of the signal of a subsystem
                found.inputs = {k: x for k, x in found.inputs.items() if k not in own}
                twice = next((end for end in own if end in found.connections), None)
                if twice:
                    self.fail(f"[{section}] {twice}: its subsystem has connected it already")
            getattr(found, section).update(own)
        found.parameters |= self.given_values(content, PARAMETERS, f"[{PARAMETERS}]")
        return found

    def _component(self, name: str, given: Any, order: Any, found: Flat) -> None:
        where = f"[{COMPONENTS}] {name}"
        table = given if isinstance(given, dict) else {FILE: given}
        self.keys(table, where, (FILE,), OF_COMPONENT)
        source, every = self.text(table[FILE], where), None
        if "every" in table:
            every = self.quantity(table["every"], f"{where}: every", SECONDS)
            if not every > 0:
                self.fail(f"{where}: every: expected more than 0 s, got {show(table['every'])}")
        path = self.path.parent / source
        is_loop = path.suffix.lower() == EQUATIONS and is_file(path)
        inner = read_toml(path) if is_loop else {}
        if project.is_system(inner):
            self._subsystem(name, path, inner, every, order, found)
        else:
            found.components[name] = Given(source, self.path.parent, where, every)
        values = self.entries({PARAMETERS: table.get(PARAMETERS, {})}, PARAMETERS)
        found.parameters |= {f"{name}.{variable}": value for variable, value in values.items()}

    def _subsystem(
        self, name: str, path: Path, content: dict[str, Any], every: float | None, order: Any,
        found: Flat,
    ) -> None:  # fmt: skip
        where = f"[{COMPONENTS}] {name}"
        if path.resolve() in self.above:
            self.fail(f"{where}: {path.name} contains itself")
        reader = Sections(path, self.above)
        inner = reader.flat(content)
        self.read += [path, *reader.read]
        self.notes += reader.notes
        if "order" in content and content["order"] != (order or "jacobi"):
            self.notes.append(f"{where}: the order of {path.name} does not apply, this file's does")
        for own, given in inner.components.items():
            rate = every if given.every is None else given.every
            place = f"{where}: {path.name}: {given.where}"
            found.components[f"{name}.{own}"] = Given(given.source, given.folder, place, rate)
        for end, start in inner.connections.items():
            fed_by = f"{name}.{start}" if isinstance(start, str) else start
            found.connections[f"{name}.{end}"] = fed_by
        found.subsystems += [name, *(f"{name}.{own}" for own in inner.subsystems)]
        beside = os.path.relpath(path.parent, self.path.parent)
        for end, signal in inner.inputs.items():
            if isinstance(signal, dict) and isinstance(signal.get(FILE), str):
                signal = signal | {FILE: f"{beside}/{signal[FILE]}"}
            found.inputs[f"{name}.{end}"] = signal
        found.parameters |= {f"{name}.{key}": value for key, value in inner.parameters.items()}

    # ---- Names and values ------------------------------------------------------------------------

    def name(self, given: Any, key: str) -> str:
        if not isinstance(given, str) or not NAME.fullmatch(given):
            self.fail(
                f"{key}: expected a name, a letter, then letters, digits, _, got {show(given)}"
            )
        return given

    def entries(self, content: Mapping[str, Any], section: str) -> dict[str, Any]:
        """Return a section by component.variable, which may also be written as tables."""
        found: dict[str, Any] = {}

        def add(table: Mapping[str, Any], begin: str) -> None:
            for key, value in table.items():
                name = f"{begin}{key}"
                # an input is a table itself, whose values are none
                nests = isinstance(value, dict) and (
                    section != INPUTS or any(isinstance(x, dict) for x in value.values())
                )
                if nests:
                    add(value, f"{name}.")
                elif name in found:
                    self.fail(f"[{section}] {name}: is there twice")
                else:
                    found[name] = value

        add(self.table(content.get(section, {}), f"[{section}]"), "")
        return found

    def given_values(self, content: Mapping[str, Any], section: str, where: str) -> dict[str, Any]:
        """Return the entries of a section of values, after those of a file that it names."""
        given = self.entries(content, section)
        if FILE in given:
            given = self.numbers(given.pop(FILE), f"{where} {FILE}") | given
        return given

    def numbers(self, given: Any, where: str) -> dict[str, Any]:
        """Read a JSON file of values by component.variable, or by component and variable."""
        path = self.path.parent / self.text(given, where)
        self.read.append(path)
        try:
            content = json.loads(read_text(path, LARGEST_TOML))
        except (UnreadableError, ValueError, RecursionError) as error:
            self.fail(f"{where}: {path}: {error}")
        return self.entries({PARAMETERS: content}, PARAMETERS)

    def parts(self, given: Any, where: str, components: Mapping[str, Any]) -> tuple[str, str]:
        """Return component and variable of a name "component.variable"; either may have dots."""
        component, dot, variable = given.partition(".") if isinstance(given, str) else ("", "", "")
        if not (component and dot and variable):
            self.fail(f"{where}: expected COMPONENT.VARIABLE, got {show(given)}")
        known = [name for name in components if given.startswith(f"{name}.")]
        if known:
            component = max(known, key=len)
        elif any(name.startswith(f"{component}.") for name in components):
            component = given.rpartition(".")[0]
        if component not in components:
            self.fail(f"{where}: no component {component!r}{hint(component, components)}")
        return component, given[len(component) + 1 :]
