"""Runs of an FMU of a model's text: co-simulation, early return, snapshots, Model Exchange.

The FMU is linked to the runtime that is compiled once; it has no archive.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Slave

from tests.equations.compiled import building, declaration, lock, read_text
from tests.equations.examples import METHODS, runtime
from tests.equations.hybrid_models import Polynomial

MASTER_STEP = 1e-3  # s, of Model Exchange
MOST_EVENTS = 300


@dataclass
class Run:
    """What a run returned, row by row."""

    times: list[float] = field(default_factory=list)
    x: list[list[float]] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)  # event_count
    events: list[float] = field(default_factory=list)  # s; of those that the importer saw
    last_event: float = 0.0  # s
    failure: str = ""
    differences: list[str] = field(default_factory=list)  # of what snapshots continued


class Unit:
    """The shared objects of a text, each linked when an instance needs it."""

    def __init__(self, folder: Path, text: str) -> None:
        file = read_text(folder, text)
        keys = lock.references(Path("no-such-file"), declaration.keys(file))
        declared = building.write_c(file, keys, folder)
        self.made = runtime("-O1")
        self.objects = self.made.compile([folder / name for name in building.C_FILES], folder)
        self.folder = folder
        self.guids = {"fmi2": declared.guid, "fmi3": declared.token("fmi3")}
        self.references = {name: v.reference for name, v in declared.variables.items()}
        self.states = [v.name for v in file.of("states")]
        self.unknowns = [name for block in file.blocks.values() for name in block.unknowns]
        self.indicators = len(declared.indicators)

    def instance(self, kind: type) -> Any:
        """An instance of a class of fmpy, not yet instantiated."""
        version = "fmi3" if kind is FMU3Slave else "fmi2"
        place = self.folder / version / self.made.content["versions"][version]["folder"]
        if not place.exists():
            place.mkdir(parents=True)
            library = self.folder / f"model{self.made.content['suffix']}"
            self.made.link(version, self.objects, library)
            library.rename(place / library.name)
        return kind(
            guid=self.guids[version],
            modelIdentifier="model",
            unzipDirectory=str(self.folder / version),
        )

    def of(self, *names: str) -> list[int]:
        return [self.references[name] for name in names]


def _said(error: FMICallException) -> str:
    return f"{error.function} returned {error.status}"


def _snapshot_steps(count: int, impacts: Sequence[float], step: float) -> list[int]:
    """Numbers of communication points before and behind the first impacts."""
    near = {int(t / step) + k for t in impacts[:4] for k in (0, 1)}
    return sorted(k for k in near if k < count)


def co_simulation(
    unit: Unit, method: str, tolerance: float, step: float, count: int,
    inputs: dict[str, Polynomial], impacts: Sequence[float] = (), start: dict | None = None,
) -> Run:  # fmt: skip
    """A run of FMI 2.0; near the times of the impacts it takes snapshots and goes back to them."""
    fmu = unit.instance(FMU2Slave)
    fmu.instantiate()
    fmu.setupExperiment(tolerance=tolerance)
    fmu.setInteger(unit.of("solver_method"), [METHODS[method]])
    if start:
        fmu.setReal(unit.of(*start), list(start.values()))
    states, counts, run = unit.of(*unit.states), unit.of("event_count"), Run()
    saved, every = {}, set(_snapshot_steps(count, impacts, step))

    def set_inputs(t: float) -> None:
        for name, polynomial in inputs.items():
            value, *derivatives = polynomial.at(t)
            fmu.setReal(unit.of(name), [value])
            orders = range(1, len(derivatives) + 1)
            fmu.setRealInputDerivatives(unit.of(name) * len(derivatives), orders, derivatives)

    def advance(first: int, last: int) -> list[tuple]:
        rows = []
        for k in range(first, last):
            set_inputs(k * step)
            if k in every and k not in saved:
                saved[k] = fmu.getFMUState()
            fmu.doStep(k * step, step)
            rows.append(((k + 1) * step, fmu.getReal(states), fmu.getInteger(counts)[0]))
        return rows

    def keep(rows: list[tuple]) -> None:
        for t, x, events in rows:
            run.times.append(t)
            run.x.append(x)
            run.counts.append(events)

    try:
        set_inputs(0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        for k in range(count):
            keep(advance(k, k + 1))
        run.last_event = fmu.getReal(unit.of("last_event_time"))[0]
        for k, state in saved.items():
            if k % 2:
                state = fmu.deSerializeFMUstate(fmu.serializeFMUState(state))
            fmu.setFMUState(state)
            last = min(count, k + max(10, round(0.1 / step)))
            again = advance(k, last)
            for (t, x, events), old, old_events in zip(
                again, run.x[k:last], run.counts[k:last], strict=True
            ):
                if (x, events) != (old, old_events):
                    run.differences.append(f"from {k * step:.6g} at {t:.6g}: {x} for {old}")
                    break
    except FMICallException as error:
        run.failure = f"{_said(error)} after {run.times[-1] if run.times else 0}"
    fmu.freeInstance()
    return run


def early_return(
    unit: Unit, method: str, tolerance: float, step: float, count: int, snapshots: bool = False
) -> Run:
    """A run of FMI 3.0 whose steps end at events, with snapshots there."""
    fmu = unit.instance(FMU3Slave)
    fmu.instantiate(eventModeUsed=True, earlyReturnAllowed=True)
    fmu.setInt64(unit.of("solver_method"), [METHODS[method]])
    states, run, saved = unit.of(*unit.states), Run(), []

    def handle() -> None:
        needed, rounds = True, 0
        while needed:
            rounds += 1
            assert rounds < 100
            needed = fmu.updateDiscreteStates()[0]
        fmu.enterStepMode()

    def advance(t: float, k: int, stop: int, rows: list, keeps: bool) -> None:
        """From t, within step number k, up to the end of step number stop."""
        while k < stop:
            end = (k + 1) * step
            needed, _, early, last = fmu.doStep(t, end - t)
            at_event = needed
            if needed:
                if keeps and snapshots and len(saved) < 8:
                    saved.append((last, k, len(rows), fmu.getFMUState()))
                fmu.enterEventMode()
                if keeps:
                    run.events.append(last)
                    assert len(run.events) < MOST_EVENTS
                handle()
            t = last if early else end
            if not early:
                k += 1
            x, events = fmu.getFloat64(states), fmu.getInt32(unit.of("event_count"))[0]
            rows.append((t, x, events, at_event))

    rows: list = []
    try:
        fmu.enterInitializationMode(tolerance=tolerance)
        fmu.exitInitializationMode()
        handle()
        advance(0.0, 0, count, rows, True)
        for number, (t, k, place, state) in enumerate(saved):
            if number % 2:
                state = fmu.deserializeFMUState(fmu.serializeFMUState(state))
            fmu.setFMUState(state)
            fmu.enterEventMode()
            handle()
            again: list = []
            begins = t if t < (k + 1) * step else (k + 1) * step
            advance(
                begins, k if begins < (k + 1) * step else k + 1, min(k + 20, count), again, False
            )
            old = rows[place + 1 : place + 1 + len(again)]
            if again != old:
                run.differences.append(f"from the event at {t}: {again[:1]} for {old[:1]}")
    except FMICallException as error:
        run.failure = f"{_said(error)} after {rows[-1][0] if rows else 0}"
    except AssertionError:
        run.failure = f"events without end at {rows[-1][0] if rows else 0}"
    fmu.freeInstance()
    for t, x, events, at_event in rows:
        if not at_event:
            run.times.append(t)
            run.x.append(x)
            run.counts.append(events)
    return run


def _copied(fmu: FMU2Model, state: Any, run: Run) -> Any:
    """A state written as bytes and read again, or itself if it is refused."""
    try:
        return fmu.deserializeFMUState(fmu.serializeFMUState(state))
    except FMICallException as error:
        run.differences.append(_said(error))
        return state


class Exchange:
    """A small importer for Model Exchange: Runge-Kutta of order 4, events by bisection."""

    def __init__(self, unit: Unit, tolerance: float, inputs: dict[str, Polynomial]) -> None:
        self.unit, self.inputs = unit, inputs
        self.fmu = unit.instance(FMU2Model)
        self.fmu.instantiate()
        self.fmu.setupExperiment(tolerance=tolerance)
        self.nx, self.nz = len(unit.states), unit.indicators
        self._x, self._dx, self._z = ((ctypes.c_double * n)() for n in (self.nx, self.nx, self.nz))
        self.x, self.dx, self.z = (np.frombuffer(v) for v in (self._x, self._dx, self._z))

    def put(self, t: float, x: np.ndarray) -> None:
        self.fmu.setTime(t)
        self.x[:] = x
        self.fmu.setContinuousStates(self._x, self.nx)
        for name, polynomial in self.inputs.items():
            self.fmu.setReal(self.unit.of(name), [polynomial.at(t)[0]])

    def rates(self, t: float, x: np.ndarray) -> np.ndarray:
        self.put(t, x)
        self.fmu.getDerivatives(self._dx, self.nx)
        return self.dx.copy()

    def signs(self, t: float, x: np.ndarray) -> np.ndarray:
        """Whether each indicator is above 0."""
        self.put(t, x)
        self.fmu.getEventIndicators(self._z, self.nz)
        return self.z > 0.0

    def moved(self, t: float, x: np.ndarray, h: float, k1: np.ndarray) -> np.ndarray:
        k2 = self.rates(t + h / 2, x + h / 2 * k1)
        k3 = self.rates(t + h / 2, x + h / 2 * k2)
        k4 = self.rates(t + h, x + h * k3)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def settle(self, x: np.ndarray) -> np.ndarray:
        """From event mode to continuous-time mode; the states there."""
        needed, changed, rounds = True, False, 0
        while needed:
            rounds += 1
            assert rounds < 100
            needed, _, _, values_changed, _, _ = self.fmu.newDiscreteStates()
            changed = changed or values_changed
        self.fmu.enterContinuousTimeMode()
        if not changed:
            return x
        self.fmu.getContinuousStates(self._x, self.nx)
        return self.x.copy()

    def first_change(
        self, t: float, x: np.ndarray, h: float, k1: np.ndarray, signs: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """The shortest step behind which an indicator has changed its sign, and its end."""
        low, high, end = 0.0, h, x
        while high - low > 1e-14 + 4e-16 * t:
            middle = (low + high) / 2
            at = self.moved(t, x, middle, k1)
            if (self.signs(t + middle, at) != signs).any():
                high, end = middle, at
            else:
                low = middle
        return high, self.moved(t, x, high, k1) if end is x else end


def model_exchange(
    unit: Unit, tolerance: float, step: float, count: int, inputs: dict[str, Polynomial],
    start: dict | None = None,
) -> Run:  # fmt: skip
    """A run of FMI 2.0 by the importer above; rows at the ends of the steps."""
    master, run = Exchange(unit, tolerance, inputs), Run()
    fmu, t, x = master.fmu, 0.0, np.zeros(master.nx)
    if start:
        fmu.setReal(unit.of(*start), list(start.values()))
    try:
        for name, polynomial in inputs.items():
            fmu.setReal(unit.of(name), [polynomial.at(0.0)[0]])
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        master.settle(x)
        fmu.getContinuousStates(master._x, master.nx)
        x = master.x.copy()
        signs = master.signs(t, x)
        for k in range(count):
            while t < (k + 1) * step:
                left = (k + 1) * step - t
                h = left if left < 1.5 * MASTER_STEP else MASTER_STEP
                k1 = master.rates(t, x)
                end = master.moved(t, x, h, k1)
                passed = (master.signs(t + h, end) != signs).any()
                if passed:
                    h, end = master.first_change(t, x, h, k1, signs)
                t = (k + 1) * step if h == left else t + h
                x = end
                master.put(t, x)
                wants_event = fmu.completedIntegratorStep()[0]
                if passed or wants_event:
                    run.events.append(t)
                    assert len(run.events) < MOST_EVENTS
                    fmu.enterEventMode()
                    saved = fmu.getFMUState() if len(run.events) < 8 else None
                    x = master.settle(x)
                    signs = master.signs(t, x)
                    if saved:
                        fmu.setFMUState(_copied(fmu, saved, run))
                        again = master.settle(np.array(end))
                        if (again != x).any() or (master.signs(t, x) != signs).any():
                            run.differences.append(f"at the event at {t}: {again} for {x}")
            run.times.append(t)
            run.x.append(list(x))
            run.counts.append(fmu.getInteger(unit.of("event_count"))[0])
        run.last_event = fmu.getReal(unit.of("last_event_time"))[0]
    except FMICallException as error:
        run.failure = f"{_said(error)} after {t}"
    except AssertionError:
        run.failure = f"events without end at {t}"
    fmu.freeInstance()
    return run
