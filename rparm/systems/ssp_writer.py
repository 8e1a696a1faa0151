"""Writes a system as an SSP 1.0 archive for co-simulation engines.

Of the parameter sets at a component Ecos takes the one that it is asked for by name and libcosim
the first; by the standard all apply and the last wins. So the first set is bound last, too, and
every set gives all that any of them changes. OMSimulator needs the type of each component and its
own annotation, and accepts no SystemGeometry.
"""

import sys
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from fmpy.model_description import BaseUnit

from rparm.errors import UserError
from rparm.files import whole
from rparm.fmi.fmu_file import describe
from rparm.fmi.model import Value, Variable
from rparm.interruption import temporary_folder
from rparm.systems import loop_file
from rparm.systems.python_component import ANY
from rparm.systems.ssp import FMU_TYPE, NAMESPACES, STRUCTURE
from rparm.systems.structure import ALONE, SETTABLE, Component, OpenedSystem

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")
TYPED = ("Real", "Integer", "Boolean", "String")  # connectors
DATE = (1980, 1, 1, 0, 0, 0)
UNIX = 3
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
STRUCTURES, COMMON, VALUES, OSP = (f'xmlns:{k}="{uri}"' for k, uri in NAMESPACES.items())
SPACES = f"""{STRUCTURES}
    {COMMON}
    {OSP}
    xmlns:oms="https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd\""""
Sets = Mapping[str, Mapping[str, Mapping[str, Value]]]  # by variant, component and variable


def write(path: Path, opened: OpenedSystem) -> dict[str, str]:
    """Write a system with its FMUs and variants; inputs that move become inputs of the system.

    Return what components in Python need to run. Without these the bytes depend only on the
    contents.
    """
    with temporary_folder() as folder:
        writer = _Writer(opened, folder)
        files = writer.files()
    with whole(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, DATE)
            entry.create_system, entry.external_attr = UNIX, 0o100644 << 16
            # an FMU is compressed already
            stored = name.endswith(".fmu")
            entry.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
            archive.writestr(entry, content, compresslevel=9)
    return writer.needed


class _Writer:
    def __init__(self, opened: OpenedSystem, folder: Path) -> None:
        self.system = opened.system
        self.inputs = [(name, *opened.split(name)) for name in self.system.inputs]
        self.needed: dict[str, str] = {}  # by components in Python, whose FMUs go into the folder
        self.fmus: dict[str, Path] = {}
        self.sources: dict[str, str] = {}
        self.descriptions: dict[str, str] = {}
        self.variables: dict[str, Mapping[str, Variable]] = {}  # by component and name
        self.units: dict[str, BaseUnit] = {}
        for component in self.system.components:
            name, source = component.name, component.source
            fmu = opened.fmu(name)
            if name in opened.python:
                fmu, source = folder / f"{name}.fmu", f"resources/{name}.fmu"
                self.needed[name] = self.pack(opened, name, fmu)
            found = describe(fmu)
            self.fmus[name], self.sources[name] = fmu, source
            self.descriptions[name] = found.description.description or ""
            self.variables[name] = found.model.variables
            for unit in found.description.unitDefinitions:
                if unit.baseUnit is not None:
                    self.units.setdefault(unit.name, unit.baseUnit)
        self.sets = self.complete_sets()

    def pack(self, opened: OpenedSystem, name: str, path: Path) -> str:
        """Pack a component in Python, with its values of all variants that no FMU can take."""
        from rparm.systems import python_fmu  # a build needs none of it

        found = [
            {k: p.value for k, p in components.get(name, {}).items() if p.type == ANY}
            for components in self.system.parameters.values()
        ]
        if any(values != found[0] for values in found):
            text = "variants give arrays or tables different values, which no FMU can have"
            raise UserError(f"{opened.path}: component {name!r}: {text}")
        return python_fmu.pack(name, opened.python[name](), found[0], path)

    def complete_sets(self) -> Sets:
        """Return sets that each give all that any changes; not a default that another repeats."""
        names: dict[str, dict[str, None]] = {}
        for components in self.system.parameters.values():
            for component, values in components.items():
                own = {name: None for name, value in values.items() if value.type != ANY}
                names.setdefault(component, {}).update(own)
        sets = {
            variant: {
                component: {
                    name: components.get(component, {}).get(
                        name, self.variable(component, name).start
                    )
                    for name in own
                }
                for component, own in names.items()
                if own
            }
            for variant, components in self.system.parameter_sets.items()
        }
        others = [values for variant, values in sets.items() if variant != ALONE]
        return {v: values for v, values in sets.items() if v != ALONE or values not in others}

    def files(self) -> dict[str, bytes]:
        """Return the content of each file by its name."""
        texts = {STRUCTURE: self.structure()}
        for variant, components in self.sets.items():
            for component, values in components.items():
                texts[_set_file(component, variant)] = self.parameters(variant, component, values)
        files = {name: text.encode() for name, text in texts.items()}
        return files | {self.sources[name]: path.read_bytes() for name, path in self.fmus.items()}

    # ---- The structure ---------------------------------------------------------------------------
    def structure(self) -> str:
        system = self.system
        step, start, stop = map(_text, (system.step, system.start, system.stop))
        ends = [(c.start_component, c.start_connector, c.end_component, c.end_connector)
                for c in system.connections]  # fmt: skip
        connections = "".join(_connection(*end) for end in ends)
        connections += "".join(_connection("", *entry) for entry in self.inputs)
        if connections:
            connections = f"    <ssd:Connections>\n{connections}    </ssd:Connections>\n"
        elements = [self.component(i, c) for i, c in enumerate(system.components)]
        own = "".join(self.connector(x, 0, 0.5, *of) for x, *of in self.inputs)
        connectors = f"    <ssd:Connectors>\n{own}    </ssd:Connectors>\n" if own else ""
        name = quoteattr(system.name)
        said = f" description={quoteattr(system.description)}" if system.description else ""
        shown = [self.variable(c.name, name) for c in system.components for name in c.connectors]
        return f"""{HEAD}<ssd:SystemStructureDescription version="1.0" name={name}{said}
    {SPACES}>
  <ssd:System name={name}>
{connectors}    <ssd:Elements>
{"".join(elements)}    </ssd:Elements>
{connections}    <ssd:Annotations>
      <ssc:Annotation type="org.openmodelica">
        <oms:Annotations>
          <oms:SimulationInformation>
            <oms:FixedStepMaster description="oms-ma" stepSize="{step}"
                absoluteTolerance="1e-8" relativeTolerance="1e-8"/>
          </oms:SimulationInformation>
        </oms:Annotations>
      </ssc:Annotation>
    </ssd:Annotations>
  </ssd:System>
{self.unit_list("ssd", shown)}\
  <ssd:DefaultExperiment startTime="{start}" stopTime="{stop}">
    <ssd:Annotations>
      <ssc:Annotation type="com.opensimulationplatform">
        <osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="{step}"/></osp:Algorithm>
      </ssc:Annotation>
    </ssd:Annotations>
  </ssd:DefaultExperiment>
</ssd:SystemStructureDescription>
"""

    def component(self, number: int, component: Component) -> str:
        """Return an element: inputs to its left, outputs to its right."""
        name, connectors = component.name, ""
        for x, kind in enumerate(("input", "output")):
            shown = [c.name for c in component.connectors.values() if c.kind == kind]
            for i, variable in enumerate(shown):
                place = 1 - (i + 0.5) / len(shown)
                connectors += "    " + self.connector(variable, x, place, name, variable)
        variants = [variant for variant, of in self.sets.items() if name in of]
        bindings = "".join(
            f"          <ssd:ParameterBinding source={quoteattr(_set_file(name, variant))}/>\n"
            for variant in [*variants, *variants[:1]]
        )
        if bindings:
            bindings = f"""        <ssd:ParameterBindings>
{bindings}        </ssd:ParameterBindings>
"""
        left = 70 * number
        return f"""\
      <ssd:Component name={quoteattr(name)} type="{FMU_TYPE}"
          source={quoteattr(self.sources[name])} implementation="CoSimulation"
          description={quoteattr(self.descriptions[name])}>
        <ssd:Connectors>
{connectors}        </ssd:Connectors>
        <ssd:ElementGeometry x1="{left}" y1="0" x2="{left + 40}" y2="40"/>
{bindings}      </ssd:Component>
"""

    def connector(self, shown: str, x: int, y: float, component: str, name: str) -> str:
        variable = self.variable(component, name)
        # an Enumeration would have to be listed here: without a type it is the FMU's
        typed = f"<ssc:{variable.type}{self.unit(variable)}/>" if variable.type in TYPED else ""
        return (
            f"      <ssd:Connector name={quoteattr(shown)} kind={quoteattr(variable.causality)}>"
            f'{typed}<ssd:ConnectorGeometry x="{x}" y="{y:.3g}"/></ssd:Connector>\n'
        )

    # ---- Parameter sets and units ----------------------------------------------------------------
    def parameters(self, variant: str, component: str, values: Mapping[str, Value]) -> str:
        variables = [self.variable(component, name) for name in values]
        rows = "".join(
            f"    <ssv:Parameter name={quoteattr(variable.name)}>"
            f"<ssv:{SETTABLE[variable.type][0]} value={quoteattr(_text(value))}"
            f"{self.unit(variable)}/></ssv:Parameter>\n"
            for variable, value in zip(variables, values.values(), strict=True)
        )
        said = self.system.descriptions.get(variant)
        description = f" description={quoteattr(said)}" if said else ""
        return f"""{HEAD}<ssv:ParameterSet version="1.0" name={quoteattr(variant)}{description}
    {VALUES}
    {COMMON}>
  <ssv:Parameters>
{rows}  </ssv:Parameters>
{self.unit_list("ssv", variables)}</ssv:ParameterSet>
"""

    def variable(self, component: str, name: str) -> Variable:
        return self.variables[component][name]

    def unit(self, variable: Variable) -> str:
        """Return the attribute for a unit that the FMUs define."""
        known = variable.type == "Real" and variable.unit in self.units
        return f" unit={quoteattr(str(variable.unit))}" if known else ""

    def unit_list(self, space: str, variables: Iterable[Variable]) -> str:
        used = dict.fromkeys(v.unit for v in variables if self.unit(v) and v.unit is not None)
        rows = "".join(
            f"    <ssc:Unit name={quoteattr(unit)}><ssc:BaseUnit{_bases(self.units[unit])}/>"
            "</ssc:Unit>\n"
            for unit in sorted(used)
        )
        return f"  <{space}:Units>\n{rows}  </{space}:Units>\n" if rows else ""


def _bases(unit: BaseUnit) -> str:
    """Return the attributes of a unit in SI base units."""
    given = {name: getattr(unit, name) or 0 for name in BASES}
    given["factor"] = 0 if unit.factor in (None, 1) else unit.factor
    return "".join(f' {name}="{_text(float(x))}"' for name, x in given.items() if x)


def _connection(start: str, connector: str, component: str, name: str) -> str:
    source = f"startElement={quoteattr(start)} " if start else ""  # else the system's own
    return (
        f"      <ssd:Connection {source}startConnector={quoteattr(connector)}\n"
        f"          endElement={quoteattr(component)} endConnector={quoteattr(name)}/>\n"
    )


def _set_file(component: str, variant: str) -> str:
    return f"resources/{component}_{variant}.ssv"


def _text(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(float(value)).removesuffix(".0") if isinstance(value, float) else str(value)


def main() -> None:
    """Write the SSP of a loop file for a build: LOOP FMUS SSP; the folder FMUS has those named."""
    loop, fmus, path = map(Path, sys.argv[1:])
    try:
        with loop_file.opened(loop, fmus=fmus) as opened:
            write(path, opened)
    except UserError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
