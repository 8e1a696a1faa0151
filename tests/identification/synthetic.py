"""Logs of machines whose parameters are known: simulated, then disturbed as real ones are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import rparm
from rparm.fmi.model import Value
from rparm.identification.identify import Identification
from tests.support.rparm_project import FMUS

STEP = 1e-3  # s, of logs
FINE = 5  # steps of the simulation in one of the log, where values are late
SINES = ((2.0, 0.7), (1.5, 1.9)), ((3.0, 1.1), (2.0, 2.7))  # amplitude and frequency in Hz
INPUTS, MEASURED = ("tau1", "f2"), ("q1", "q2")


@dataclass(frozen=True)
class Machine:
    """A model, its true parameters, and how its log is disturbed."""

    model: str
    true: Mapping[str, float]
    settings: Mapping[str, Value] = field(default_factory=dict)
    duration: float = 10.0  # s
    noise: Sequence[float] = (1e-4, 1e-4)  # standard deviation of the measured values, rad and m
    counts: Sequence[float] = ()  # of encoders, rad and m
    effort_noise: float = 0.0  # N.m and N, held for a step, not in the log
    late: float = 0.0  # s, a multiple of the simulation's step
    amplitude: float = 1.0  # of the efforts

    @property
    def fmu(self) -> Path:
        """The built FMU."""
        return FMUS[self.model]


ARM = Machine("rp_manipulator", {"m2": 1.1, "I1z": 0.12, "a": 0.11, "l1": 0.55})
PLANT = Machine(
    "rp_plant",
    {
        "m2": 1.1,
        "I1z": 0.12,
        "damping1": 0.3,
        "damping2": 2.0,
        "coulomb_friction1": 0.3,
        "coulomb_friction2": 0.5,
    },
)


def efforts(times: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Sums of sines (rows, 2) that shake both joints; the slide is held against gravity's mean."""
    found = np.zeros((len(times), 2))
    for column, parts in zip(found.T, SINES, strict=True):
        for amplitude, frequency in parts:
            phase = random.uniform(0, 2 * np.pi)
            column += amplitude * np.sin(2 * np.pi * frequency * times + phase)
    return found + [0.0, -9.8]


def write(machine: Machine, path: Path, seed: int) -> Path:
    """Write the log of a random motion."""
    random = np.random.default_rng(seed)
    times = STEP * np.arange(round(machine.duration / STEP) + 1)
    told = machine.amplitude * efforts(times, random)
    applied = told + machine.effort_noise * random.normal(size=told.shape)
    fine = FINE if machine.late else 1
    start = {"q1": -1.2 + 0.1 * random.normal(), "q2": 0.1}
    table = rparm.simulate(
        machine.fmu,
        stop_time=float(times[-1]),
        step=STEP / fine,
        start_values={**machine.true, **machine.settings, **start},
        inputs={
            name: np.append(np.repeat(column[:-1], fine), column[-1])
            for name, column in zip(INPUTS, applied.T, strict=True)
        },
        outputs=MEASURED,
    )
    rows = np.maximum(fine * np.arange(len(times)) - round(machine.late / STEP * fine), 0)
    seen = np.column_stack([table[name][rows] for name in MEASURED])
    if machine.counts:
        seen = np.rint(seen / machine.counts) * machine.counts
    else:
        seen += random.normal(size=seen.shape) * machine.noise
    save(path, times, told, seen)
    return path


def save(path: Path, times: np.ndarray, told: np.ndarray, seen: np.ndarray) -> None:
    """Write a log: times (rows,), inputs (rows, 2) and measured values (rows, 2)."""
    names = ",".join(("time", *INPUTS, *MEASURED))
    table = np.column_stack([times, told, seen])
    np.savetxt(path, table, fmt="%.17g", delimiter=",", header=names, comments="")


def off(true: Mapping[str, float], seed: int) -> dict[str, float]:
    """Starts that are 20 % off, up or down."""
    signs = np.random.default_rng(1000 + seed).choice([-1, 1], len(true))
    return {name: x * (1 + 0.2 * sign) for (name, x), sign in zip(true.items(), signs, strict=True)}


def identified(machine: Machine, log: Path, seed: int = 0, **more: object) -> Identification:
    """Find the parameters of a machine again, from 20 % off."""
    given = {"parameters": list(machine.true), "start": off(machine.true, seed)} | more
    return rparm.identify(
        machine.fmu, log, inputs=INPUTS, measured=MEASURED, settings=machine.settings, **given
    )
