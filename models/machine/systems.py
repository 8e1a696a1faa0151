"""Systems made of the machine: other parameters and times, or the controller without encoders."""

import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from lxml import etree

from rparm.fmi.model import Model, Value
from rparm.systems import ecos, ssp
from rparm.systems.structure import Connection, OpenedSystem

STRUCTURE = "SystemStructure.ssd"
VARIANT = "changed"
SENSOR = "sensor"
# the components but the sensor, whose outputs have no slopes
SEQUENCE = ("trajectory", "controller", "actuator", "plant", "environment")

Parameters = Mapping[str, Mapping[str, Value]]  # by component and name


def direct(connections: Iterable[Connection]) -> list[Connection]:
    """The connections without the sensor: the controller reads the joints themselves."""
    return [
        replace(c, start_component="plant", start_connector=c.end_connector)
        if c.start_component == SENSOR
        else c
        for c in connections
        if c.end_component != SENSOR
    ]


def write_system(
    opened: OpenedSystem,
    path: Path,
    parameters: Parameters,
    stop: float,
    step: float,
    with_sensor: bool = True,
) -> None:
    """Write an SSP of the machine with one variant, `VARIANT`, with its sensor or `direct`."""
    tree = etree.parse(opened.folder / STRUCTURE)
    root = tree.getroot()
    spaces = root.nsmap
    (experiment,) = root.findall("ssd:DefaultExperiment", spaces)
    experiment.set("stopTime", repr(stop))
    (algorithm,) = experiment.xpath(".//*[@baseStepSize]")
    algorithm.set("baseStepSize", repr(step))
    if not with_sensor:
        _remove_sensor(root)
    kept = root.findall("ssd:System/ssd:Elements/ssd:Component", spaces)
    with zipfile.ZipFile(path, "w") as archive:
        for component in kept:
            name = component.get("name", "")
            (bindings,) = component.findall("ssd:ParameterBindings", spaces)
            first, *others = bindings
            first.set("source", f"resources/{name}.ssv")
            for binding in others:
                bindings.remove(binding)
            text = values_file(opened.models[name], parameters[name])
            archive.writestr(f"resources/{name}.ssv", text)
            archive.write(opened.fmu(name), component.get("source", ""))
        archive.writestr(STRUCTURE, etree.tostring(tree, encoding="UTF-8", xml_declaration=True))


def run_in_ecos(
    opened: OpenedSystem,
    parameters: Parameters,
    stop: float,
    step: float,
    names: Sequence[str],
    with_sensor: bool = True,
) -> np.ndarray:
    """Values after each step in Ecos, (rows, names), of the system that `write_system` writes."""
    with TemporaryDirectory(prefix="rparm-") as folder:
        path = Path(folder) / "Changed.ssp"
        write_system(opened, path, parameters, stop, step, with_sensor)
        with ssp.unpacked(path) as other:
            return ecos.run(other, VARIANT, names).values


def _remove_sensor(root: etree._Element) -> None:
    spaces = root.nsmap
    for connection in root.findall("ssd:System/ssd:Connections/ssd:Connection", spaces):
        if connection.get("endElement") == SENSOR:
            connection.getparent().remove(connection)
        elif connection.get("startElement") == SENSOR:
            connection.set("startElement", "plant")
            connection.set("startConnector", connection.get("endConnector", ""))
    for component in root.findall("ssd:System/ssd:Elements/ssd:Component", spaces):
        if component.get("name") == SENSOR:
            component.getparent().remove(component)


def values_file(model: Model, values: Mapping[str, Value]) -> str:
    rows = "".join(
        f'<ssv:Parameter name="{name}"><ssv:{model.variables[name].type} value="{value!r}"/>'
        "</ssv:Parameter>"
        for name, value in values.items()
    )
    return (
        f'<ssv:ParameterSet version="1.0" name="{VARIANT}" '
        'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">'
        f"<ssv:Parameters>{rows}</ssv:Parameters></ssv:ParameterSet>"
    )
