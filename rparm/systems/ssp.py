"""Systems of connected FMUs in SSP 1.0 archives: unpacked, read and checked, once.

Accepted is what the engines run: one flat system of FMUs, with outputs connected to inputs and
parameter sets bound at the components. The same set name at several components is one variant of
the system. Times that the SSP does not say are chosen by the default experiments of the FMUs.
Nothing runs before a system is checked against its FMUs.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path, PurePosixPath
from typing import NoReturn

import fmpy
import numpy as np
from lxml import etree

from rparm.errors import UserError, did_you_mean, placed
from rparm.files import UnreadableError, difference, is_file
from rparm.fmi.fmu_file import LARGEST_SYSTEM, Fmu, describe, read_xml, unpack, wrong_name
from rparm.fmi.model import INPUTS, TOLERANCE, Model, Value, Variable
from rparm.interruption import temporary_folder
from rparm.project import STRUCTURE
from rparm.runs.scenario import MAX_STEPS
from rparm.units import number

ALONE = "default"  # the variant of a system that has no parameter sets
NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
}
SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"
STRUCTURE_SCHEMA = "SystemStructureDescription.xsd"
VALUES_SCHEMA = "SystemStructureParameterValues.xsd"
FMU_TYPE = "application/x-fmu-sharedlibrary"
STEP_SIZE = (
    "ssd:Annotations/ssc:Annotation[@type='com.opensimulationplatform']"
    "/osp:Algorithm/osp:FixedStepAlgorithm/@baseStepSize"
)
VERSION, VERSION_1 = "1.0", r"1\."  # of SSP
KINDS = {"System": "a system in the system", "SignalDictionaryReference": "a signal dictionary"}
# of a system, with what to do
IGNORED = {
    "ParameterBindings": "bind at components",
    "SignalDictionaries": "connect outputs to inputs",
}
STEPS = 1000  # of a run whose step nothing says
# of a variant, whose results are files of that name
PLAIN_NAME = re.compile(r"\w[\w .+-]{0,99}")
# type of a variable -> types of a parameter's value that engines can give it
SETTABLE = {
    "Real": ("Real",),
    "Integer": ("Integer",),
    "Enumeration": ("Integer",),
    "Boolean": ("Boolean",),
    "String": ("String",),
}
PARAMETERS = ("parameter", "input", "output")  # causalities of variables with a start value


# ---- Structure -----------------------------------------------------------------------------------
@dataclass(frozen=True)
class Connector:
    """A variable of a component that the system sees."""

    name: str
    kind: str  # input, output, parameter or calculatedParameter
    type: str | None  # Real, Integer, Boolean, String or Enumeration; None: the variable's
    unit: str | None  # None: the variable's


@dataclass(frozen=True)
class Component:
    """One FMU in the system."""

    name: str
    source: str  # path of the FMU inside the SSP
    connectors: dict[str, Connector]  # by name, in the order of the file


@dataclass(frozen=True)
class Connection:
    """An output that feeds an input."""

    start_component: str
    start_connector: str
    end_component: str
    end_connector: str

    @property
    def start(self) -> str:
        """Name "component.variable" of the output."""
        return f"{self.start_component}.{self.start_connector}"

    @property
    def end(self) -> str:
        """Name "component.variable" of the input."""
        return f"{self.end_component}.{self.end_connector}"

    def __str__(self) -> str:
        return f"{self.start} -> {self.end}"


@dataclass(frozen=True)
class Parameter:
    """A value that a parameter set gives to a variable."""

    type: str  # Real, Integer, Boolean or String
    value: Value
    unit: str | None


@dataclass(frozen=True)
class System:
    """Structure of a system, and the variants of its parameters."""

    name: str
    components: tuple[Component, ...]  # in the order of the file
    connections: tuple[Connection, ...]
    start: float  # s
    stop: float  # s
    step: float  # s, communication step
    # variant -> component -> variable; a component without a binding has no values, and without
    # parameter sets ALONE is the only variant
    parameters: dict[str, dict[str, dict[str, Parameter]]]
    descriptions: Mapping[str, str] = field(default_factory=dict)  # of variants that have one
    notes: tuple[str, ...] = ()  # choices where the SSP says nothing

    @property
    def parameter_sets(self) -> dict[str, dict[str, dict[str, Value]]]:
        """Only the values: variant -> component -> variable -> value, variants in file order."""
        return {
            variant: {
                component: {name: parameter.value for name, parameter in values.items()}
                for component, values in components.items()
            }
            for variant, components in self.parameters.items()
        }

    @property
    def steps(self) -> int:
        return round((self.stop - self.start) / self.step)

    @property
    def times(self) -> np.ndarray:
        """Communication points, (steps + 1,) s."""
        return self.start + self.step * np.arange(self.steps + 1)

    @property
    def has_sets(self) -> bool:
        """Whether its variants are parameter sets."""
        return any(self.parameters.values())

    def component(self, name: str) -> Component:
        return next(component for component in self.components if component.name == name)


# ---- Archive -------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Ssp:
    """An SSP that is unpacked and can be run."""

    path: Path
    folder: Path  # where it is unpacked
    system: System
    models: Mapping[str, Model]  # description of each component's FMU

    def fmu(self, component: str) -> Path:
        return self.folder / self.system.component(component).source

    def unpacked_fmu(self, component: str) -> Fmu:
        """Return FMU of a component, unpacked; messages name the SSP."""
        return Fmu(self.fmu(component), shown=self.path / self.system.component(component).source)

    @contextmanager
    def unpacked_fmus(self, names: Iterable[str] | None = None) -> Iterator[dict[str, Fmu]]:
        """Return FMUs of all components, or of those named, in this order."""
        with ExitStack() as stack:
            wanted = self.models if names is None else names
            yield {name: stack.enter_context(self.unpacked_fmu(name)) for name in wanted}

    @property
    def notes(self) -> list[str]:
        """Choices for all runs that the SSP does not make."""
        fed = {c.end for c in self.system.connections}
        alone = [
            f"{component}.{variable.name}"
            for component, model in self.models.items()
            for variable in model.variables.values()
            if variable.is_a(INPUTS) and f"{component}.{variable.name}" not in fed
        ]
        held = [f"not connected, constant: {', '.join(alone)}"] if alone else []
        return [*self.system.notes, *held]

    def variable(self, name: str) -> Variable:
        """Return the variable ``component.variable`` as the FMU declares it."""
        component, _, variable = name.partition(".")
        return self.models[component].variables[variable]


@contextmanager
def unpacked(path: Path) -> Iterator[Ssp]:
    """Unpack and read an SSP until the end; UserError if it is damaged, or `ssp_checks` refuses."""
    path = Path(path)
    with temporary_folder() as folder:
        with placed(path):
            unpack(path, folder, "SSP")
        system = SspReader(path, folder).system()
        yield Ssp(path, folder, system, checked_models(path, folder, system))


# ---- Reader --------------------------------------------------------------------------------------
@cache
def _schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(SCHEMAS / name))


class SspReader:
    """Reads the files of one unpacked SSP; errors name the archive and the file inside."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.path = path
        self.folder = folder
        self.descriptions: dict[str, str] = {}  # of parameter sets, by name
        self.own: dict[str, str] = {}  # kinds of the system's own connectors, by name
        self.notes: list[str] = []  # choices where the SSP says nothing

    def fail(self, file: str, message: str, node: etree._Element | None = None) -> NoReturn:
        line = f", line {node.sourceline}" if node is not None else ""
        raise UserError(f"{self.path}: {file}{line}: {message}")

    def parse(self, file: str, schema: str) -> etree._Element:
        """Parse an XML file that is valid against its schema; return its root."""
        path = self.folder / file
        if not is_file(path):
            self.fail(file, "is missing in the SSP")
        with placed(f"{self.path}: {file}"):
            tree = read_xml(path)
        version = tree.getroot().get("version", VERSION)
        if not re.match(VERSION_1, version):
            self.fail(file, f"is of SSP {version}, expected {VERSION}", tree.getroot())
        validator = _schema(schema)
        if not validator.validate(tree):
            first = validator.error_log[0]
            message = first.message
            for prefix, uri in NAMESPACES.items():
                message = message.replace(f"{{{uri}}}", f"{prefix}:")
            raise UserError(f"{self.path}: {file}, line {first.line}: {message}")
        return tree.getroot()

    def system(self) -> System:
        root = self.parse(STRUCTURE, STRUCTURE_SCHEMA)
        system = root.find("ssd:System", NAMESPACES)
        elements = system.find("ssd:Elements", NAMESPACES)
        for name, way_out in IGNORED.items():
            node = system.find(f"ssd:{name}", NAMESPACES)
            if node is not None:
                self.fail(STRUCTURE, f"engines ignore {name} of the system; {way_out}", node)
        components: dict[str, Component] = {}
        bound: dict[str, dict[str, dict[str, Parameter]]] = {}
        for node in elements if elements is not None else ():
            component = self.component(node)
            if component.name in components:
                self.fail(STRUCTURE, f"component {component.name!r} is there twice", node)
            components[component.name] = component
            bound[component.name] = self.bindings(node, component.name)
        if not components:
            self.fail(STRUCTURE, "the system has no components", system)
        own = system.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES)
        self.own = {node.get("name"): node.get("kind") for node in own}
        nodes = system.iterfind("ssd:Connections/ssd:Connection", NAMESPACES)
        connections = map(self.connection, nodes)
        start, stop, step = self.experiment(root, components.values())
        return System(
            name=system.get("name"),
            components=tuple(components.values()),
            connections=tuple(filter(None, connections)),
            start=start,
            stop=stop,
            step=step,
            parameters=self.variants(bound),
            descriptions=self.descriptions,
            notes=tuple(self.notes),
        )

    def component(self, node: etree._Element) -> Component:
        name = node.get("name")
        kind = KINDS.get(etree.QName(node).localname) or node.get("type", FMU_TYPE)
        if kind != FMU_TYPE:
            self.fail(STRUCTURE, f"element {name!r} is {kind}, expected an FMU", node)
        source = node.get("source")
        self.check_source(source, name, node)
        connectors: dict[str, Connector] = {}
        for child in node.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES):
            variable = child.get("name")
            where = f"component {name!r}: connector {variable!r}"
            if variable in connectors:
                self.fail(STRUCTURE, f"{where} is there twice", child)
            types = [x for x in child if etree.QName(x).namespace == NAMESPACES["ssc"]]
            type_name = etree.QName(types[0]).localname if types else None
            unit = types[0].get("unit") if types else None
            connectors[variable] = Connector(variable, child.get("kind"), type_name, unit)
        return Component(name, str(PurePosixPath(source)), connectors)

    def check_source(self, source: str, component: str, node: etree._Element) -> None:
        wrong = wrong_name(source)
        if wrong:
            where = f"component {component!r}: {source!r} is no path in the SSP"
            self.fail(STRUCTURE, f"{where}: {wrong}", node)

    def connection(self, node: etree._Element) -> Connection | None:
        """Return a connection; None for the system's own connectors, which nothing is behind."""
        ends = ("startElement", "startConnector", "endElement", "endConnector")
        connection = Connection(*(node.get(name, "") for name in ends))
        for child in node:
            if etree.QName(child).namespace == NAMESPACES["ssc"]:
                name = etree.QName(child).localname
                self.fail(STRUCTURE, f"connection {connection}: {name} is not supported", node)
        if connection.start_component and connection.end_component:
            return connection
        name, kind = connection.end_connector, "output"
        if not connection.start_component:
            name, kind = connection.start_connector, "input"
        if self.own.get(name) != kind:
            where = f"connection {connection}: the system"
            self.fail(
                STRUCTURE, f"{where} has no {kind} {name!r}{did_you_mean(name, self.own)}", node
            )
        return None

    def experiment(
        self, root: etree._Element, components: Iterable[Component]
    ) -> tuple[float, float, float]:
        """Start, stop and communication step in s; FMUs give the largest stop and smallest step."""
        node = root.find("ssd:DefaultExperiment", NAMESPACES)
        given = {} if node is None else node.attrib
        sizes = [] if node is None else node.xpath(STEP_SIZE, namespaces=NAMESPACES)
        try:
            start = float(given.get("startTime", 0.0))
            stop = float(given["stopTime"]) if "stopTime" in given else None
            step = float(sizes[0]) if sizes else None
        except ValueError as error:
            self.fail(STRUCTURE, str(error), node)
        defaults = {} if stop and step else self.defaults(components)
        if stop is None:
            later = {name: x for name, (x, _) in defaults.items() if x is not None and x > start}
            if not later:
                self.fail(STRUCTURE, "has no DefaultExperiment with a stopTime, nor have its FMUs")
            longest = max(later, key=lambda name: later[name])
            stop = later[longest]
            self.notes.append(f"stop time {number(stop)} s: the largest of its FMUs ({longest})")
        if step is None:
            step = self.chosen_step(difference(stop, start), defaults)
        if not (all(map(math.isfinite, (start, stop, step))) and 0 < step <= stop - start):
            self.fail(STRUCTURE, f"start {start!r} s, stop {stop!r} s, step {step!r} s", node)
        if (stop - start) / step > MAX_STEPS:
            self.fail(STRUCTURE, f"step {step!r} s makes more than {MAX_STEPS} steps", node)
        return start, stop, step

    def defaults(
        self, components: Iterable[Component]
    ) -> dict[str, tuple[float | None, float | None]]:
        """Stop time and step in s that the FMU of each component declares."""
        found = {}
        for component in components:
            with suppress(UnreadableError, UserError):  # is said when the FMUs are checked
                experiment = describe(self.folder / component.source).description.defaultExperiment
                times = getattr(experiment, "stopTime", None), getattr(experiment, "stepSize", None)
                found[component.name] = tuple(_positive(text) for text in times)
        return found

    def chosen_step(
        self, span: float, defaults: Mapping[str, tuple[float | None, float | None]]
    ) -> float:
        """Choose a step of which a whole number lead to the stop time."""
        steps = {name: x for name, (_, x) in defaults.items() if x is not None}
        shortest = min(steps, key=lambda name: steps[name], default=None)
        step = span / STEPS if shortest is None else min(steps[shortest], span)
        whole = max(round(span / step), 1)
        if abs(whole - span / step) > 1e-6:
            step = span / math.ceil(span / step)
        reason = f"the smallest of its FMUs ({shortest})" if shortest else f"1/{STEPS} of the run"
        self.notes.append(f"communication step {number(step)} s: {reason}")
        return step

    # parameter sets

    def bindings(self, node: etree._Element, component: str) -> dict[str, dict[str, Parameter]]:
        """Return parameter sets bound at a component, by name."""
        sets: dict[str, dict[str, Parameter]] = {}
        sources: set[str] = set()
        for binding in node.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES):
            source = binding.get("source")
            plain = binding.get("prefix", "") == "" and binding.get("sourceBase", "SSD") == "SSD"
            if (
                not (source and plain)
                or binding.find("ssd:ParameterMapping", NAMESPACES) is not None
            ):
                message = f"component {component!r}: bind parameters only by the path of an .ssv"
                self.fail(STRUCTURE, message, binding)
            if source in sources:  # bound first and last: importers take one or the other
                continue
            sources.add(source)
            self.check_source(source, component, binding)
            root = self.parse(source, VALUES_SCHEMA)
            name = root.get("name")
            if not PLAIN_NAME.fullmatch(name):
                self.fail(source, f"name {name!r} of the set is no plain name, as of a file", root)
            if name in sets:
                self.fail(
                    STRUCTURE, f"component {component!r}: set {name!r} is bound twice", binding
                )
            sets[name] = self.values(source, root, component)
            if root.get("description"):
                self.descriptions.setdefault(name, " ".join(root.get("description").split()))
        return sets

    def values(self, file: str, root: etree._Element, component: str) -> dict[str, Parameter]:
        values: dict[str, Parameter] = {}
        for node in root.iterfind("ssv:Parameters/ssv:Parameter", NAMESPACES):
            name = node.get("name")
            where = f"component {component!r}: parameter {name!r}"
            if name in values:
                self.fail(file, f"{where} is there twice", node)
            typed = next(x for x in node if etree.QName(x).namespace == NAMESPACES["ssv"])
            values[name] = self.value(file, where, typed)
        return values

    def value(self, file: str, where: str, node: etree._Element) -> Parameter:
        kind, text = etree.QName(node).localname, node.get("value")
        converted: Value
        if kind == "Real":
            converted = float(text)
            if not math.isfinite(converted):
                self.fail(file, f"{where}: expected a finite number, got {text}", node)
        elif kind == "Integer":
            converted = int(text)
        elif kind == "Boolean":
            converted = text in ("true", "1")
        elif kind == "String":
            converted = text
        else:
            self.fail(file, f"{where}: engines read no {kind}, give its number as an Integer", node)
        return Parameter(kind, converted, node.get("unit"))

    def variants(
        self, bound: dict[str, dict[str, dict[str, Parameter]]]
    ) -> dict[str, dict[str, dict[str, Parameter]]]:
        """Return the sets by variant; every component that has a binding has all of them."""
        if not any(bound.values()):
            return {ALONE: {}}
        names = list(dict.fromkeys(name for sets in bound.values() for name in sets))
        for component, sets in bound.items():
            missing = [name for name in names if name not in sets]
            if sets and missing:
                self.fail(STRUCTURE, f"component {component!r} has no parameter set {missing[0]!r}")
        return {
            name: {component: sets.get(name, {}) for component, sets in bound.items()}
            for name in names
        }


def _positive(text: object) -> float | None:
    """Return a time above 0 that an FMU declares; None for others."""
    with suppress(TypeError, ValueError):
        time = float(text)  # type: ignore[arg-type]
        if 0 < time < math.inf:
            return time
    return None


# ---- Checks against the FMUs ---------------------------------------------------------------------
def checked_models(path: Path, folder: Path, system: System) -> dict[str, Model]:
    """Read what the FMU of each component declares, and check the system against it.

    Connectors are variables of the same causality, type and unit, connections lead from outputs to
    inputs of the same type and unit, no input has two, parameters can be set; else UserError.
    """
    checker = _Checker(path, system)
    for component in system.components:
        checker.models[component.name] = checker.read(folder, component)
    checker.check()
    return checker.models


class _Checker:
    def __init__(self, path: Path, system: System) -> None:
        self.path = path
        self.system = system
        self.models: dict[str, Model] = {}
        self.bytes = 0  # of the FMUs of all components, unpacked

    def fail(self, message: str) -> NoReturn:
        raise UserError(f"{self.path}: {message}")

    def check(self) -> None:
        for component in self.system.components:
            for connector in component.connectors.values():
                self.connector(component, connector)
        self.connections()
        for variant, components in self.system.parameters.items():
            for component, values in components.items():
                for name, parameter in values.items():
                    self.parameter(variant, component, name, parameter)
                self.tolerance(variant, component, values)

    def read(self, folder: Path, component: Component) -> Model:
        path = folder / component.source
        where = f"component {component.name!r}: {component.source}"
        if not is_file(path):
            self.fail(f"{where} is missing in the SSP")
        with placed(f"{self.path}: {where}"):
            found = describe(path)
        self.bytes += sum(found.sizes.values())
        if self.bytes > LARGEST_SYSTEM:
            most = f"{LARGEST_SYSTEM / 1e6:.0f} MB"
            self.fail(f"the FMUs up to component {component.name!r} have more than {most} inside")
        return found.model

    def connector(self, component: Component, connector: Connector) -> None:
        where = f"component {component.name!r}: connector {connector.name!r}"
        variable = self.variable(component.name, connector.name, where, "such variable")
        if variable.causality != connector.kind:
            self.fail(f"{where} is an {connector.kind}, in its FMU {_causality(variable)}")
        if connector.type is not None and variable.type != connector.type:
            self.fail(f"{where} is of type {connector.type}, in its FMU {variable.type}")
        if connector.unit is not None and variable.unit != connector.unit:
            self.fail(f"{where} is in {_unit(connector.unit)}, in its FMU {_unit(variable.unit)}")

    def variable(self, component: str, name: str, where: str, what: str) -> Variable:
        variables: Mapping[str, Variable] = self.models[component].variables
        if name not in variables:
            self.fail(f"{where}: its FMU has no {what}{did_you_mean(name, variables)}")
        return variables[name]

    def connections(self) -> None:
        fed: dict[tuple[str, str], str] = {}
        for connection in self.system.connections:
            where = f"connection {connection}"
            start = self.end(where, connection.start_component, connection.start_connector)
            end = self.end(where, connection.end_component, connection.end_connector)
            if start.causality != "output":
                self.fail(f"{where}: {connection.start_connector!r} is no output")
            if end.causality != "input":
                self.fail(f"{where}: {connection.end_connector!r} is no input")
            if start.type != end.type:
                self.fail(f"{where}: types differ, {start.type} and {end.type}")
            if start.unit != end.unit:
                self.fail(f"{where}: units differ, {_unit(start.unit)} and {_unit(end.unit)}")
            target = (connection.end_component, connection.end_connector)
            if target in fed:
                self.fail(f"{where}: the input has a connection already, {fed[target]}")
            fed[target] = str(connection)

    def end(self, where: str, component: str, connector: str) -> Variable:
        """Return the variable at one end of a connection."""
        names = [known.name for known in self.system.components]
        if component not in names:
            hint = did_you_mean(component, names)
            self.fail(f"{where}: there is no component {component!r}{hint}")
        connectors = self.system.component(component).connectors
        if connector not in connectors:
            hint = did_you_mean(connector, connectors)
            self.fail(f"{where}: component {component!r} has no connector {connector!r}{hint}")
        return self.models[component].variables[connector]

    def parameter(self, variant: str, component: str, name: str, parameter: Parameter) -> None:
        where = f"parameter set {variant!r}: component {component!r}"
        variable = self.variable(component, name, where, f"variable {name!r}")
        where = f"{where}: {name!r}"
        if variable.causality not in PARAMETERS or variable.start is None:
            self.fail(f"{where} is {_causality(variable)} and cannot be set")
        if parameter.type not in SETTABLE[variable.type]:
            self.fail(f"{where} is of type {parameter.type}, in its FMU {variable.type}")
        if parameter.unit is not None and parameter.unit != variable.unit:
            self.fail(f"{where} is in {_unit(parameter.unit)}, in its FMU {_unit(variable.unit)}")
        if parameter.type in ("Real", "Integer"):
            least, greatest = variable.least, variable.greatest
            if not least <= parameter.value <= greatest:
                self.fail(f"{where} is {parameter.value!r}, expected {least:g} to {greatest:g}")

    def tolerance(self, variant: str, component: str, values: Mapping[str, Parameter]) -> None:
        """Refuse a tolerance that the component's method of integration cannot reach."""
        given = {name: parameter.value for name, parameter in values.items()}
        where = f"parameter set {variant!r}: component {component!r}: {TOLERANCE!r}"
        if given.get(TOLERANCE):
            with placed(f"{self.path}: {where}"):
                self.models[component].check_tolerance(given[TOLERANCE], given)


def _unit(unit: str | None) -> str:
    return "no unit" if unit is None else repr(unit)


def _causality(variable: Variable) -> str:
    article = "an" if variable.causality[0] in "aeiou" else "a"
    return f"{article} {variable.causality}"
