"""Checks a system against the FMUs of its components, before anything runs."""

from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

from rparm.errors import UserError, did_you_mean, placed
from rparm.files import is_file
from rparm.fmi.fmu_file import LARGEST_SYSTEM, describe
from rparm.fmi.model import TOLERANCE, Model, Variable
from rparm.system.structure import Component, Connector, Parameter, System

# type of a variable -> types of a parameter's value that engines can give it
SETTABLE = {
    "Real": ("Real",),
    "Integer": ("Integer",),
    "Enumeration": ("Integer",),
    "Boolean": ("Boolean",),
    "String": ("String",),
}
PARAMETERS = ("parameter", "input", "output")  # causalities of what has a start value


def checked_models(path: Path, folder: Path, system: System) -> dict[str, Model]:
    """Read what the FMU of each component declares, and check the system against it.

    Every component has its FMU, every connector is a variable of it with that causality, and with
    that type and unit where it has them, connections go from an output to an input of the same type
    and unit, no input has two, and parameters are variables that can be set. UserError if not; the
    text names component and variable. The SSP is unpacked in `folder`.
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
        """The variable at one end of a connection."""
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
