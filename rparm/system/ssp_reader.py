"""Reads the structure of a system and its parameter sets from an unpacked SSP 1.0 archive.

It accepts what the engines run: one flat system of FMUs, with outputs connected to inputs and
parameter sets bound at the components. The same set name at several components is one variant of
the system. Times that it does not say are chosen by the default experiments of the FMUs.
"""

import math
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path, PurePosixPath
from typing import NoReturn

import fmpy
from lxml import etree

from rparm.errors import UserError, placed
from rparm.files import UnreadableError, difference, is_file
from rparm.fmi.fmu_file import describe, read_xml, wrong_name
from rparm.fmi.model import Value
from rparm.project import STRUCTURE
from rparm.runs.scenario import MAX_STEPS
from rparm.system.structure import ALONE, Component, Connection, Connector, Parameter, System
from rparm.units import number

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

STEPS = 1000  # of a run whose step nothing says

# of a variant, whose results are files of that name
PLAIN_NAME = re.compile(r"\w[\w .+-]{0,99}")


@cache
def _schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(SCHEMAS / name))


class SspReader:
    """Reads the files of one unpacked SSP; errors name the archive and the file inside."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.path = path
        self.folder = folder
        self.descriptions: dict[str, str] = {}  # of parameter sets, by name
        self.notes: list[str] = []  # what is chosen where the SSP says nothing

    def fail(self, file: str, message: str, node: etree._Element | None = None) -> NoReturn:
        line = f", line {node.sourceline}" if node is not None else ""
        raise UserError(f"{self.path}: {file}{line}: {message}")

    def parse(self, file: str, schema: str) -> etree._Element:
        """Root of an XML file that is valid against its schema."""
        path = self.folder / file
        if not is_file(path):
            self.fail(file, "is missing in the SSP")
        with placed(f"{self.path}: {file}"):
            tree = read_xml(path)
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
        for path in ("ssd:Connectors", "ssd:ParameterBindings"):
            node = system.find(path, NAMESPACES)
            if node is not None:
                name = etree.QName(node).localname
                self.fail(
                    STRUCTURE, f"engines ignore {name} of the system; bind at components", node
                )
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
        connections = system.iterfind("ssd:Connections/ssd:Connection", NAMESPACES)
        start, stop, step = self.experiment(root, components.values())
        return System(
            name=system.get("name"),
            components=tuple(components.values()),
            connections=tuple(self.connection(node) for node in connections),
            start=start,
            stop=stop,
            step=step,
            parameters=self.variants(bound),
            descriptions=self.descriptions,
            notes=tuple(self.notes),
        )

    def component(self, node: etree._Element) -> Component:
        name = node.get("name")
        if etree.QName(node).localname != "Component" or node.get("type", FMU_TYPE) != FMU_TYPE:
            self.fail(STRUCTURE, f"element {name!r} is not an FMU", node)
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

    def connection(self, node: etree._Element) -> Connection:
        ends = ("startElement", "startConnector", "endElement", "endConnector")
        connection = Connection(*(node.get(name, "") for name in ends))
        if not (connection.start_component and connection.end_component):
            self.fail(STRUCTURE, f"connection {connection} to the system's own connectors", node)
        if any(etree.QName(x).namespace == NAMESPACES["ssc"] for x in node):
            self.fail(
                STRUCTURE, f"connection {connection} has a transformation, leave it out", node
            )
        return connection

    def experiment(
        self, root: etree._Element, components: Iterable[Component]
    ) -> tuple[float, float, float]:
        """Start, stop and communication step in s.

        Where the SSP does not say them, the FMUs do: the largest stop and the smallest step.
        """
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
        """A step of which a whole number lead to the stop time."""
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
        """Parameter sets bound at a component, by name."""
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
        """Sets by variant; every component that has a binding has all of them."""
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
    """A time above 0 that an FMU declares."""
    with suppress(TypeError, ValueError):
        time = float(text)  # type: ignore[arg-type]
        if 0 < time < math.inf:
            return time
    return None
