"""SSP 1.0 archives: unpacked, read and checked, once.

Accepted are systems of FMUs and of such systems, with outputs connected to inputs and parameter
sets bound at the components; names in a system within begin with its own. All sets of a component
apply; but where one is bound first and last, each set name is a variant of the system. Times that
the SSP does not say are chosen by the default experiments of the FMUs. Nothing runs before a
system is checked against its FMUs.
"""

import math
import re
from collections import ChainMap
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from functools import cache
from pathlib import Path, PurePosixPath
from typing import NoReturn

import fmpy
from lxml import etree

from rparm.errors import UnplacedError, UserError, did_you_mean, placed
from rparm.files import is_file
from rparm.fmi.fmu_file import read_xml, unpack, wrong_name
from rparm.fmi.model import Model, Value
from rparm.interruption import temporary_folder
from rparm.systems.structure import (
    ALONE,
    WAYS,
    Component,
    Connection,
    Connector,
    FmuReader,
    OpenedSystem,
    Parameter,
    System,
    check,
    times,
)

STRUCTURE = "SystemStructure.ssd"  # the file that has the system
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
OSP = "ssd:Annotations/ssc:Annotation[@type='com.opensimulationplatform']"
STEP_SIZE = f"{OSP}/osp:Algorithm/osp:FixedStepAlgorithm/@baseStepSize"
RATE = f"{OSP}/osp:StepSizeHint/@value"
ORDER = "ssd:Annotations/ssc:Annotation[@type='rparm']/order/text()"
VERSION, VERSION_1 = "1.0", r"1\."  # of SSP
KINDS = {"SignalDictionaryReference": "a signal dictionary"}
# of a system, with what to do
IGNORED = {
    "ParameterBindings": "bind at components",
    "SignalDictionaries": "connect outputs to inputs",
}
# of a variant, whose results are files of that name
PLAIN_NAME = re.compile(r"\w[\w .+-]{0,99}")


End = tuple[str, str]  # element, "" for the whole system, and connector


@contextmanager
def unpacked(path: Path, step: float | None = None) -> Iterator[OpenedSystem]:
    """Unpack and read an SSP until the end, with a `step` (s) if given; UserError if it fails."""
    path = Path(path)
    with temporary_folder() as folder:
        with placed(path):
            unpack(path, folder, "SSP")
        reader = SspReader(path, folder)
        system = reader.system(step)
        check(path, system, reader.models)
        yield OpenedSystem(path, folder, system, reader.models, is_plain=reader.is_plain)


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
        # Ecos reads one prefix, no sets in the structure, no connections to the system's own
        self.is_plain = True
        self.are_variants = False  # else all sets of a component apply, the last wins
        self.models: dict[str, Model] = {}  # of the components
        self.rates: dict[str, float] = {}  # s, of those that have one
        self.subsystems: list[str] = []
        self._components: dict[str, Component] = {}
        self._bound: dict[str, dict[str, dict[str, Parameter]]] = {}
        self._kinds: dict[End, str] = {}  # of systems' own connectors
        self._starts: dict[End, End] = {}  # what feeds these
        self._fed: list[tuple[End, End]] = []  # inputs of components, and what feeds them

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
        return self.validated(file, tree, schema)

    def validated(self, file: str, tree: etree._ElementTree, schema: str) -> etree._Element:
        validator = _schema(schema)
        if not validator.validate(tree):
            first = validator.error_log[0]
            message = first.message
            for prefix, uri in NAMESPACES.items():
                message = message.replace(f"{{{uri}}}", f"{prefix}:")
            raise UserError(f"{self.path}: {file}, line {first.line}: {message}")
        return tree.getroot()

    def system(self, step: float | None) -> System:
        root = self.parse(STRUCTURE, STRUCTURE_SCHEMA)
        system = root.find("ssd:System", NAMESPACES)
        self.is_plain = root.prefix == "ssd"
        self.level(system, "")
        components = self._components
        if not components:
            self.fail(STRUCTURE, "the system has no components", system)
        connections, outside = self.connections()
        fmus = FmuReader(self.path)
        for component in components.values():
            file = self.folder / component.source
            if not is_file(file):
                where = f"component {component.name!r}: {component.source}"
                raise UserError(f"{self.path}: {where} is missing in the SSP")
            self.models[component.name] = fmus.read(component.name, file, component.source)
        start, stop, step, notes = self.experiment(root, step)
        return System(
            name=system.get("name"),
            components=tuple(components.values()),
            connections=connections,
            outside=outside,
            start=start,
            stop=stop,
            step=step,
            parameters=self.variants(self._bound),
            descriptions=self.descriptions,
            notes=tuple(notes),
            order=self.order(root),
            rates=self.rates,
            subsystems=tuple(self.subsystems),
        )

    def level(self, system: etree._Element, begin: str) -> None:
        """Read a system, whose elements' names begin so."""
        for name, way_out in IGNORED.items():
            node = system.find(f"ssd:{name}", NAMESPACES)
            if node is not None:
                self.fail(STRUCTURE, f"engines ignore {name} of the system; {way_out}", node)
        own = begin.removesuffix(".")
        for node in system.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES):
            self._kinds[own, node.get("name")] = node.get("kind")
        for node in system.iterfind("ssd:Elements/*", NAMESPACES):
            name = f"{begin}{node.get('name')}"
            if name in self._components or name in self.subsystems:
                self.fail(STRUCTURE, f"component {name!r} is there twice", node)
            if etree.QName(node).localname == "System":
                self.is_plain = False
                self.subsystems.append(name)
                self.level(node, f"{name}.")
                continue
            self._components[name] = self.component(node, name)
            self._bound[name] = self.bindings(node, name)
            for every in node.xpath(RATE, namespaces=NAMESPACES)[:1]:
                self.rates[name] = self.rate(every, name, node)
        for node in system.iterfind("ssd:Connections/ssd:Connection", NAMESPACES):
            self.connection(node, begin)

    def rate(self, text: str, name: str, node: etree._Element) -> float:
        try:
            every = float(text)
        except ValueError:
            every = math.nan
        if not 0 < every < math.inf:
            wrong = f"component {name!r}: StepSizeHint: expected more than 0 s, got {text!r}"
            self.fail(STRUCTURE, wrong, node)
        return every

    def order(self, root: etree._Element) -> str:
        """Return the order of steps, which only this project's SSPs have."""
        found = root.xpath(f"ssd:DefaultExperiment/{ORDER}", namespaces=NAMESPACES)
        if found and found[0] not in WAYS:
            self.fail(STRUCTURE, f"order: expected one of {', '.join(WAYS)}, got {found[0]!r}")
        return found[0] if found else "jacobi"

    def component(self, node: etree._Element, name: str) -> Component:
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

    def connection(self, node: etree._Element, begin: str) -> None:
        """Note a connection between elements and the system's own connectors."""
        ends = []
        for side in ("start", "end"):
            element, connector = node.get(f"{side}Element", ""), node.get(f"{side}Connector", "")
            name = f"{begin}{element}" if element else begin.removesuffix(".")
            ends.append((name, connector))
        start, end = ends
        for child in node:
            if etree.QName(child).namespace == NAMESPACES["ssc"]:
                name = etree.QName(child).localname
                where = f"connection {'.'.join(start)} -> {'.'.join(end)}"
                self.fail(STRUCTURE, f"{where}: {name} is not supported", node)
        for (element, connector), side in ((start, "start"), (end, "end")):
            is_own = element == begin.removesuffix(".") and not node.get(f"{side}Element")
            kind = (
                ("input" if side == "start" else "output")
                if is_own
                else ("output" if side == "start" else "input")
            )
            if element in self._components or self._kinds.get((element, connector)) == kind:
                continue
            if not is_own and element not in self.subsystems:
                continue  # no such component: `check` names it
            known = [name for owner, name in self._kinds if owner == element]
            whose = f"system {element!r}" if element else "the system"
            where = f"connection {'.'.join(start)} -> {'.'.join(end)}"
            wrong = f"{whose} has no {kind} {connector!r}{did_you_mean(connector, known)}"
            self.fail(STRUCTURE, f"{where}: {wrong}", node)
        if not node.get("startElement") or not node.get("endElement"):
            self.is_plain = False
        if end not in self._kinds:
            self._fed.append((end, start))
        elif self._starts.setdefault(end, start) != start:
            wrong = "the connector has a connection already"
            self.fail(STRUCTURE, f"connection {'.'.join(start)} -> {'.'.join(end)}: {wrong}", node)

    def connections(self) -> tuple[tuple[Connection, ...], tuple[str, ...]]:
        """Return those of components, and inputs that only connectors of systems feed."""
        found, outside = [], []
        for end, start in self._fed:
            for _ in self._starts:  # through connectors of systems, as many at most
                start = self._starts.get(start, start)
            if start in self._kinds:
                outside.append(".".join(end))
            else:
                found.append(Connection(*start, *end))
        return tuple(found), tuple(outside)

    def experiment(
        self, root: etree._Element, step: float | None
    ) -> tuple[float, float, float, list[str]]:
        """Start, stop and communication step in s, as `times` chooses them."""
        node = root.find("ssd:DefaultExperiment", NAMESPACES)
        given = {} if node is None else node.attrib
        sizes = [] if node is None else node.xpath(STEP_SIZE, namespaces=NAMESPACES)
        try:
            start = float(given.get("startTime", 0.0))
            stop = float(given["stopTime"]) if "stopTime" in given else None
            step = float(sizes[0]) if sizes and step is None else step
            return times(start, stop, step, self.models)
        except (ValueError, UnplacedError) as error:
            self.fail(STRUCTURE, str(error), node)

    # parameter sets

    def bindings(self, node: etree._Element, component: str) -> dict[str, dict[str, Parameter]]:
        """Return parameter sets bound at a component, by name."""
        sets: dict[str, dict[str, Parameter]] = {}
        sources: set[str] = set()
        for binding in node.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMESPACES):
            source = binding.get("source")
            plain = binding.get("prefix", "") == "" and binding.get("sourceBase", "SSD") == "SSD"
            inside = binding.find("ssd:ParameterValues/ssv:ParameterSet", NAMESPACES)
            if (
                not (plain and (source or inside is not None))
                or binding.find("ssd:ParameterMapping", NAMESPACES) is not None
            ):
                message = f"component {component!r}: bind only parameter sets, by path or within"
                self.fail(STRUCTURE, message, binding)
            if source in sources:  # bound first and last: importers take one or the other
                self.are_variants = True
                continue
            if source:
                sources.add(source)
                self.check_source(source, component, binding)
                root = self.parse(source, VALUES_SCHEMA)
            else:
                source, self.is_plain = STRUCTURE, False
                root = self.validated(STRUCTURE, etree.ElementTree(deepcopy(inside)), VALUES_SCHEMA)
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
        each_has_its_own = all(len(sets) <= 1 for sets in bound.values())
        if len(names) > 1 and (each_has_its_own or not self.are_variants):
            self.is_plain = False
            return {ALONE: {c: dict(ChainMap(*reversed(of.values()))) for c, of in bound.items()}}
        for component, sets in bound.items():
            missing = [name for name in names if name not in sets]
            if sets and missing:
                self.fail(STRUCTURE, f"component {component!r} has no parameter set {missing[0]!r}")
        return {
            name: {component: sets.get(name, {}) for component, sets in bound.items()}
            for name in names
        }
