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

from fmpy.model_description import BaseUnit

from rparm.errors import UserError
from rparm.files import whole
from rparm.fmi.fmu_file import describe
from rparm.fmi.model import Value, Variable
from rparm.interruption import temporary_folder
from rparm.systems import loop_file
from rparm.systems.levels import levels
from rparm.systems.python_component import ANY
from rparm.systems.ssp import FMU_TYPE, NAMESPACES, STRUCTURE
from rparm.systems.structure import ALONE, SETTABLE, OpenedSystem
from rparm.texts import rendered

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")
TYPED = ("Real", "Integer", "Boolean", "String")  # connectors
DATE = (1980, 1, 1, 0, 0, 0)
UNIX = 3
Sets = Mapping[str, Mapping[str, Mapping[str, Value]]]  # by variant, component and variable


def write(path: Path, opened: OpenedSystem, flat: bool = False) -> dict[str, str]:
    """Write a system with its FMUs and variants; inputs that move become inputs of the system.

    Subsystems are systems within, unless it is to be `flat`. Return what components in Python need
    to run. Without these the bytes depend only on the contents.
    """
    with temporary_folder() as folder:
        writer = _Writer(opened, folder, flat)
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
    def __init__(self, opened: OpenedSystem, folder: Path, flat: bool) -> None:
        self.system, self.flat = opened.system, flat
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

    def structure(self) -> str:
        system = self.system
        shown = [self.variable(c.name, name) for c in system.components for name in c.connectors]
        times = {name: _text(getattr(system, name)) for name in ("start", "stop", "step")}
        return rendered(
            "system.ssd", system=system, whole=levels(system, self.inputs, self.flat),
            writer=self, spaces=NAMESPACES,
            units=self.used(shown), typed=TYPED, fmu_type=FMU_TYPE, **times,
        )  # fmt: skip

    def rate(self, component: str) -> str:
        """Return the time between steps of a component that has its own, else nothing."""
        every = self.system.rates.get(component)
        return "" if every is None else _text(every)

    def bound(self, component: str) -> list[str]:
        """Return the files with the sets of a component; the first one is bound last, too."""
        variants = [variant for variant, of in self.sets.items() if component in of]
        return [_set_file(component, variant) for variant in [*variants, *variants[:1]]]

    def parameters(self, variant: str, component: str, values: Mapping[str, Value]) -> str:
        variables = [self.variable(component, name) for name in values]
        rows = [
            (x.name, SETTABLE[x.type][0], _text(value), self.unit(x))
            for x, value in zip(variables, values.values(), strict=True)
        ]
        said = self.system.descriptions.get(variant)
        return parameter_set(variant, rows, said, self.used(variables))

    def variable(self, component: str, name: str) -> Variable:
        return self.variables[component][name]

    def unit(self, variable: Variable) -> str:
        """Return a unit that the FMUs define; else nothing."""
        known = variable.type == "Real" and variable.unit in self.units
        return str(variable.unit) if known else ""

    def used(self, variables: Iterable[Variable]) -> list[tuple[str, dict[str, str]]]:
        """Return the units of variables, each with what it is in SI base units."""
        names = sorted({unit for variable in variables if (unit := self.unit(variable))})
        return [(name, _bases(self.units[name])) for name in names]


def parameter_set(
    name: str,
    rows: Iterable[tuple[str, str, str, str]],
    description: str | None = None,
    units: Iterable[tuple[str, dict[str, str]]] = (),
) -> str:
    """Write a parameter set of SSP 1.0; `rows`: name, type, value and unit of each parameter."""
    given = {"rows": rows, "description": description, "units": units, "spaces": NAMESPACES}
    return rendered("parameters.ssv", name=name, **given)


def _bases(unit: BaseUnit) -> dict[str, str]:
    """Return the exponents of SI base units, factor and offset that a unit has."""
    given = {name: getattr(unit, name) or 0 for name in BASES}
    given["factor"] = 0 if unit.factor in (None, 1) else unit.factor
    return {name: _text(float(x)) for name, x in given.items() if x}


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
