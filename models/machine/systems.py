"""Systems made of the machine: other parameters and times, or the controller without encoders."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from rparm.fmi.model import Value
from rparm.systems import ecos, ssp_writer
from rparm.systems.structure import SETTABLE, Connection, OpenedSystem, Parameter

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


def changed(
    opened: OpenedSystem, parameters: Parameters, stop: float, step: float, with_sensor: bool = True
) -> OpenedSystem:
    """Return the machine with one variant, `VARIANT`, with its sensor or `direct`."""
    system = opened.system
    components = [c for c in system.components if with_sensor or c.name != SENSOR]
    models = {c.name: opened.models[c.name] for c in components}
    values = {
        name: {
            key: Parameter(SETTABLE[model.variables[key].type][0], value, None)
            for key, value in parameters[name].items()
        }
        for name, model in models.items()
    }
    other = replace(
        system,
        components=tuple(components),
        connections=system.connections if with_sensor else tuple(direct(system.connections)),
        parameters={VARIANT: values},
        stop=stop,
        step=step,
    )
    return replace(opened, system=other, models=models)


def run_in_ecos(
    opened: OpenedSystem,
    parameters: Parameters,
    stop: float,
    step: float,
    names: Sequence[str],
    with_sensor: bool = True,
) -> np.ndarray:
    """Values after each step in Ecos, (rows, names), of the system that `changed` returns."""
    other = changed(opened, parameters, stop, step, with_sensor)
    with TemporaryDirectory(prefix="rparm-") as folder:
        path = Path(folder) / "Changed.ssp"
        ssp_writer.write(path, other)
        return ecos.run(replace(other, path=path), VARIANT, names).values
