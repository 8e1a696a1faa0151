"""Systems in loop files: components, connections, inputs and parameters, read and checked.

docs/systems.md explains the format. FMUs are copied to a folder, files with equations are built in
it; then a system is the same as one in an SSP.
"""

import os
import re
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from rparm import building, project
from rparm.errors import CodeError, UserError, did_you_mean
from rparm.files import (
    NAME,
    is_file,
    missing,
    read_toml,
    show,
)
from rparm.fmi.fmu_file import read_model
from rparm.fmi.model import INPUTS, PARAMETERS, Model, Variable
from rparm.interruption import temporary_folder
from rparm.project import VERSIONS
from rparm.runs.inputs import Constant, InputReader, Switches
from rparm.systems.feedthrough import on_loops
from rparm.systems.python_component import SUFFIX, PythonComponent, split
from rparm.systems.sections import (
    CONNECTIONS,
    EQUATIONS,
    KEEP,
    TIMES,
    VARIANTS,
    Given,
    Sections,
)
from rparm.systems.structure import (
    ALONE,
    Component,
    Connection,
    Connector,
    FmuReader,
    OpenedSystem,
    Parameter,
    System,
    causality,
    check,
    times,
)
from rparm.units import SECONDS

VARIANT = re.compile(r"\w[\w-]{0,99}", re.ASCII)
FMU, SSP = ".fmu", ".ssp"
RESOURCES = "resources"  # folder of the FMUs, as in an SSP


@contextmanager
def opened(
    path: Path, step: float | None = None, version: str = VERSIONS[0], fmus: Path | None = None
) -> Iterator[OpenedSystem]:
    """Read a loop file and build what it names; a `step` in s replaces its own.

    FMUs of the project, and built ones, are of this `version` of FMI; those in a folder `fmus`
    need not run here. UserError if anything is wrong.
    """
    path = Path(path)
    content = read_toml(path)
    project.refuse_other(path, content, "system")
    with temporary_folder() as folder:
        yield LoopReader(path, folder, version, fmus).system(content, step)


class LoopReader(Sections):
    """Takes a file with its subsystems; errors name the file and the key."""

    def __init__(self, path: Path, folder: Path, version: str, fmus: Path | None) -> None:
        super().__init__(path)
        self.folder, self.version, self.fmus = folder, version, fmus
        self.models: dict[str, Model] = {}  # by component, as the rest
        self.sources: dict[str, str] = {}  # in the folder
        self.files: dict[str, Path] = {}  # FMUs that the user knows
        self.python: dict[str, Any] = {}
        self._fmus = FmuReader(path)
        self._copied: dict[Path, str] = {}  # sources, by what they are made of

    def system(self, content: dict[str, Any], step: float | None) -> OpenedSystem:
        given = self.flat(content)
        name = self.name(content["name"], "name")
        order = self.order(content)
        others = [name for name, own in given.orders.items() if own != order]
        if others:
            kept = f"its file's order does not apply, {order} does"
            self.notes.append(f"subsystem {', '.join(others)}: {kept}")
        description = (
            self.text(content["description"], "description") if "description" in content else ""
        )
        components, self.moved = given.components, given.inputs
        self.connections = connections = [
            self.connection(end, start, components) for end, start in given.connections.items()
        ]
        for component, made_of in components.items():
            self.component(component, made_of)
        start, stop, step = self.times(content, step)
        parameters, descriptions = self.parameters(content, given.parameters)
        system = System(
            name=name, components=tuple(self.connected(component) for component in components),
            connections=tuple(connections), start=start, stop=stop, step=step,
            parameters=parameters, descriptions=descriptions, description=description, order=order,
            rates={c: x.every for c, x in components.items() if x.every is not None},
            subsystems=tuple(given.subsystems),
        )  # fmt: skip
        check(self.path, system, self.models)
        solved = on_loops(system.connections, self.models)
        system = self.with_inputs(system, self.moved, solved)
        keep = None
        if KEEP in content:
            keep = tuple(map(self.kept, self.array(content[KEEP], KEEP, "component.variable")))
            if twice := [name for i, name in enumerate(keep) if name in keep[:i]]:
                self.fail(f"{KEEP}: {twice[0]} is there twice")
        system = replace(system, keep=keep, notes=tuple(self.notes))
        return OpenedSystem(
            self.path, self.folder, system, self.models, files=self.files, python=self.python,
            version=self.version, read=self.read,
            solved=solved,
        )  # fmt: skip

    # ---- Names -----------------------------------------------------------------------------------

    def variable(self, given: Any, where: str) -> tuple[str, Variable]:
        """Return component and variable of a name."""
        component, name = self.parts(given, where, self.models)
        variables = self.models[component].variables
        if name not in variables:
            guess = did_you_mean(name, variables)
            self.fail(f"{where}: {component!r} has no variable {name!r}{guess}")
        return component, variables[name]

    # ---- Components ------------------------------------------------------------------------------

    def component(self, name: str, given: Given) -> None:
        """Find what a component is made of, and what it declares."""
        file, _ = split(given.source)
        path, suffix = given.folder / file, Path(file).suffix.lower()
        if suffix in (FMU, EQUATIONS, SUFFIX, SSP) and not is_file(path):
            self.fail(f"{given.where}: {file}: {missing(path)}")
        try:
            if suffix == SUFFIX:
                self.code(name, given)
                return
            if suffix == SSP:
                way_out = "write its components and connections into a loop file"
                raise UserError(f"{file} is a system, expected one component: {way_out}")
            if suffix == EQUATIONS:
                made = path
                fmu = self.built(path)
            elif suffix == FMU:
                made = fmu = path
            elif not NAME.fullmatch(given.source):
                expected = "a file .fmu, .toml with equations or .py, or a name of the project"
                raise UserError(f"expected {expected}, got {show(given.source)}")
            elif self.fmus:
                made = fmu = self.fmus / f"{given.source}{FMU}"
            else:
                found = project.model(given.source)
                made = fmu = project.built(found, FMU, version=self.version)
            if not self.fmus:
                read_model(fmu)  # runs on this platform
        except CodeError:
            raise  # has its place
        except UserError as error:
            self.fail(f"{given.where}: {error}")
        self.files[name] = made
        self.models[name] = self._fmus.read(name, fmu, made)
        self.sources[name] = self.copied(name, fmu)

    def code(self, name: str, given: Given) -> None:
        """Read a component in Python; a function has the inputs and outputs that are connected."""
        known = {name: ""}
        outside = [self.parts(x, INPUTS, known)[1] for x in self.moved if x.startswith(f"{name}.")]
        inputs = [c.end_connector for c in self.connections if c.end_component == name] + outside
        outputs = [c.start_connector for c in self.connections if c.start_component == name]
        made = PythonComponent.read(
            given.source, given.folder, list(dict.fromkeys(inputs)), list(dict.fromkeys(outputs))
        )
        self.python[name] = lambda: made
        self.read += given.folder.glob(f"*{SUFFIX}")  # it may import others
        self.models[name] = made.model
        self.sources[name] = os.path.relpath(given.folder / given.source, self.path.parent)

    def built(self, path: Path) -> Path:
        """Build an FMU of a file with equations, once."""
        folder = self.folder / "built" / str(len(self._copied))
        for made, source in self._copied.items():
            if made == path.resolve():
                return self.folder / source
        fmus = building.build(path, output=folder, lock=False)
        fmu = fmus[VERSIONS.index(self.version)]
        self._copied[path.resolve()] = fmu.relative_to(self.folder).as_posix()
        return fmu

    def copied(self, name: str, fmu: Path) -> str:
        """Copy an FMU to the folder, once; return its path there."""
        key = fmu.resolve()
        if key not in self._copied:
            source = f"{RESOURCES}/{fmu.name}"
            if source in self._copied.values():
                source = f"{RESOURCES}/{name}_{fmu.name}"
            (self.folder / RESOURCES).mkdir(exist_ok=True)
            shutil.copyfile(fmu, self.folder / source)
            self._copied[key] = source
        return self._copied[key]

    def connected(self, name: str) -> Component:
        """Return a component with all its inputs and outputs as connectors."""
        known = self.models[name].variables.values()
        ends = [v for v in known if v.causality in ("input", "output")]
        connectors = {v.name: Connector(v.name, v.causality, v.type, v.unit) for v in ends}
        return Component(name, self.sources[name], connectors)

    def connection(self, end: str, start: Any, components: Mapping[str, Any]) -> Connection:
        where = f"[{CONNECTIONS}] {end}"
        return Connection(
            *self.parts(start, where, components), *self.parts(end, where, components)
        )

    # ---- Times -----------------------------------------------------------------------------------

    def times(self, content: Mapping[str, Any], step: float | None) -> tuple[float, float, float]:
        given = {key: self.quantity(content[key], key, SECONDS) for key in TIMES if key in content}
        begin = given.get("start", 0.0)
        if "stop" in given and not given["stop"] > begin:
            self.fail(f"stop: expected a time after start = {begin!r} s, got {given['stop']!r} s")
        step = given.get("step") if step is None else step
        if step is not None and step <= 0:
            self.fail(f"step: expected more than 0 s, got {step!r} s")
        with self.placed("times"):
            start, stop, step, notes = times(begin, given.get("stop"), step, self.models)
        self.notes += notes
        return start, stop, step

    # ---- Parameters ------------------------------------------------------------------------------

    def parameters(
        self, content: Mapping[str, Any], given: Mapping[str, Any]
    ) -> tuple[dict[str, dict[str, dict[str, Parameter]]], dict[str, str]]:
        """Return values by variant, component and variable, and descriptions of variants."""
        own = self.values(given, f"[{PARAMETERS}]")
        found, descriptions = {ALONE: own}, {}
        for name, changes in self.table(content.get(VARIANTS, {}), f"[{VARIANTS}]").items():
            where = f"[{VARIANTS}.{name}]"
            if not VARIANT.fullmatch(name):
                self.fail(f"{where}: expected a name of letters, digits, _ and -")
            if name == ALONE:
                self.fail(f"{where}: {ALONE!r} stands for [{PARAMETERS}]; choose another name")
            table = dict(self.table(changes, where))
            if "description" in table:
                descriptions[name] = self.text(table.pop("description"), f"{where} description")
            changed = self.values(self.given_values({PARAMETERS: table}, PARAMETERS, where), where)
            every = dict.fromkeys([*own, *changed])
            found[name] = {c: own.get(c, {}) | changed.get(c, {}) for c in every}
        return found, descriptions

    def values(self, given: Mapping[str, Any], where: str) -> dict[str, dict[str, Parameter]]:
        """Return values by component and variable."""
        found: dict[str, dict[str, Parameter]] = {}
        for name, value in given.items():
            component, variable = self.variable(name, where)
            own = found.setdefault(component, {})
            own[variable.name] = self.parameter(value, variable, f"{where} {name}")
        return found

    def parameter(self, given: Any, variable: Variable, where: str) -> Parameter:
        with self.placed(where):
            parameter = Parameter.of(variable, given)
        if question := variable.question(given):
            self.notes.append(f"{where}: {question}")
        return parameter

    # ---- Inputs ----------------------------------------------------------------------------------

    def with_inputs(
        self, system: System, given: Mapping[str, Any], solved: Collection[str]
    ) -> System:
        """Add inputs from outside; constants are parameters of all variants that give no other.

        Those `solved`, on algebraic loops, may have values though they are connected.
        """
        known: dict[str, Variable] = {}
        fed = {c.end: c.start for c in system.connections}
        for values in system.parameters.values():
            for name in (f"{component}.{x}" for component in values for x in values[component]):
                if name in fed and name not in solved:
                    self.fail(f"{name}: is connected to {fed[name]} and cannot be set")
        for name in given:
            component, variable = self.variable(name, f"[{INPUTS}]")
            if not variable.is_a(INPUTS):
                self.fail(f"[{INPUTS}]: {name!r} is {causality(variable)} of {component!r}")
            if name in fed:
                self.fail(f"[{INPUTS}.{name}]: is connected to {fed[name]} already")
            known[name] = replace(variable, name=name)
        whole = Model(system.name, self.version, known, (), False, False, False, False)
        reader = InputReader(self, whole, system.times, system.elapsed)
        signals = reader.inputs({INPUTS: given})
        self.read += [self.path.parent / file for file in reader.hashes]
        reader.sampled(signals)  # checks their values
        self.notes += reader.warnings
        moving, variants = {}, system.parameters
        for name, signal in signals.items():
            component, variable = self.parts(name, INPUTS, self.models)
            if isinstance(signal, Constant):
                held = Parameter("Real", signal.value, known[name].unit)
            elif isinstance(signal, Switches) and len(signal.points) == 1:
                held = Parameter("Boolean", signal.points[0][1], None)
            else:
                moving[name] = signal
                if any(variable in values.get(component, {}) for values in variants.values()):
                    self.fail(f"[{INPUTS}.{name}]: moves, but has a value among the parameters")
                continue
            if variable in variants[ALONE].get(component, {}):
                self.fail(f"[{INPUTS}.{name}]: has a value in [{PARAMETERS}], too: give it once")
            for values in variants.values():
                values.setdefault(component, {}).setdefault(variable, held)
        return replace(system, inputs=moving)

    # ---- Recording -------------------------------------------------------------------------------

    def kept(self, given: Any) -> str:
        component, variable = self.variable(given, KEEP)
        if variable.type not in ("Real", "Integer", "Boolean"):
            self.fail(f"{KEEP}: {given!r} is of type {variable.type}, which is not recorded")
        return str(given)
