"""Writes a system as an SSP 1.0 archive for co-simulation engines.

Of the parameter sets at a component Ecos takes the one that it is asked for by name and libcosim
the first; by the standard all apply and the last wins. So the first set is bound last, too, and
every set gives all that any of them changes. OMSimulator needs the type of each component and its
own annotation, and accepts no SystemGeometry.
"""

import zipfile
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from fmpy.model_description import BaseUnit

from rparm.files import whole
from rparm.fmi.fmu_file import Described, describe
from rparm.fmi.model import Value, Variable
from rparm.project import STRUCTURE
from rparm.systems.ssp import ALONE, FMU_TYPE, SETTABLE, System

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")
DATE = (1980, 1, 1, 0, 0, 0)
UNIX = 3
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
COMMON = 'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
VALUES = 'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
SPACES = f"""xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    {COMMON}
    xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations"
    xmlns:oms="https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd\""""
Sets = Mapping[str, Mapping[str, Mapping[str, Value]]]  # by variant, component and variable


def write(path: Path, system: System, fmus: Mapping[str, Path], inputs: Iterable[str] = ()) -> None:
    """Write a system with the FMU of each component; `inputs` of these become the system's.

    The bytes depend only on the contents.
    """
    writer = _Writer(system, fmus, inputs)
    with whole(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, content in sorted(writer.files().items()):
            entry = zipfile.ZipInfo(name, DATE)
            entry.create_system, entry.external_attr = UNIX, 0o100644 << 16
            # an FMU is compressed already
            stored = name.endswith(".fmu")
            entry.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
            archive.writestr(entry, content, compresslevel=9)


def sources(fmus: Mapping[str, Path]) -> dict[str, str]:
    """Return the place of each component's FMU in an archive; other FMUs of a name get others."""
    found: dict[str, str] = {}
    taken: dict[str, Path] = {}
    for component, path in fmus.items():
        name = (
            path.name if taken.setdefault(path.name, path) == path else f"{component}_{path.name}"
        )
        found[component] = f"resources/{name}"
    return found


def complete_sets(system: System, described: Mapping[str, Described]) -> Sets:
    """Return sets that each give all that any changes; without one that another set repeats."""
    names: dict[str, dict[str, None]] = {}
    for components in system.parameter_sets.values():
        for component, values in components.items():
            names.setdefault(component, {}).update(dict.fromkeys(values))
    sets = {
        variant: {
            component: {
                name: components.get(component, {}).get(
                    name, described[component].model.start_values[name]
                )
                for name in wanted
            }
            for component, wanted in names.items()
            if wanted
        }
        for variant, components in system.parameter_sets.items()
    }
    others = [values for variant, values in sets.items() if variant != ALONE]
    return {v: values for v, values in sets.items() if v != ALONE or values not in others}


class _Writer:
    def __init__(self, system: System, fmus: Mapping[str, Path], inputs: Iterable[str]) -> None:
        self.system = system
        self.fmus = fmus
        self.inputs = [(name, *name.split(".", 1)) for name in inputs]
        self.sources = sources(fmus)
        self.described = {name: describe(path) for name, path in fmus.items()}
        self.units: dict[str, BaseUnit] = {}
        for described in self.described.values():
            for unit in described.description.unitDefinitions:
                if unit.baseUnit is not None:
                    self.units.setdefault(unit.name, unit.baseUnit)
        self.sets = complete_sets(system, self.described)

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
        used = {end for connection in ends for end in (connection[:2], connection[2:])}
        used |= {(component, name) for _, component, name in self.inputs}
        elements = [self.component(i, c.name, used) for i, c in enumerate(system.components)]
        own = "".join(self.connector(x, 0, 0.5, *of) for x, *of in self.inputs)
        connectors = f"    <ssd:Connectors>\n{own}    </ssd:Connectors>\n" if own else ""
        connections = [_connection(*end) for end in ends]
        connections += [_connection("", *entry) for entry in self.inputs]
        return f"""{HEAD}<ssd:SystemStructureDescription version="1.0" name={quoteattr(system.name)}
    {SPACES}>
  <ssd:System name={quoteattr(system.name)}>
{connectors}    <ssd:Elements>
{"".join(elements)}    </ssd:Elements>
    <ssd:Connections>
{"".join(connections)}    </ssd:Connections>
    <ssd:Annotations>
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
{self.unit_list("ssd", (self.variable(*end) for end in used))}\
  <ssd:DefaultExperiment startTime="{start}" stopTime="{stop}">
    <ssd:Annotations>
      <ssc:Annotation type="com.opensimulationplatform">
        <osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="{step}"/></osp:Algorithm>
      </ssc:Annotation>
    </ssd:Annotations>
  </ssd:DefaultExperiment>
</ssd:SystemStructureDescription>
"""

    def component(self, number: int, name: str, used: Collection[tuple[str, str]]) -> str:
        """Return an element with its `used` variables as connectors: inputs left, outputs right."""
        described = self.described[name]
        variables = [v for v in described.model.variables.values() if (name, v.name) in used]
        connectors = ""
        for x, causality in enumerate(("input", "output")):
            shown = [v.name for v in variables if v.causality == causality]
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
        description = described.description.description or ""
        left = 70 * number
        return f"""\
      <ssd:Component name={quoteattr(name)} type="{FMU_TYPE}"
          source={quoteattr(self.sources[name])} implementation="CoSimulation"
          description={quoteattr(description)}>
        <ssd:Connectors>
{connectors}        </ssd:Connectors>
        <ssd:ElementGeometry x1="{left}" y1="0" x2="{left + 40}" y2="40"/>
{bindings}      </ssd:Component>
"""

    def connector(self, shown: str, x: int, y: float, component: str, name: str) -> str:
        variable = self.variable(component, name)
        kind = f"<ssc:{variable.type}{self.unit(variable)}/>"
        if variable.type == "Enumeration":  # whose items a file would have to list: the FMU's
            kind = ""
        return (
            f"      <ssd:Connector name={quoteattr(shown)} kind={quoteattr(variable.causality)}>"
            f'{kind}<ssd:ConnectorGeometry x="{x}" y="{y:.3g}"/></ssd:Connector>\n'
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
        return self.described[component].model.variables[name]

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
