"""The process of one component: steps its FMU between the exchanges of the federation.

Work that waits in HELICS runs in a thread: HELICS has no time limit and ignores signals.
"""

import hashlib
import os
import signal
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from threading import Event, Thread
from typing import TypeVar

import numpy as np

from rparm.errors import UserError
from rparm.federation.network import Federate, mute_libraries
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.loop import check_finite
from rparm.fmi.model import Value
from rparm.interruption import ENDINGS
from rparm.systems.connected_instance import begin_instance
from rparm.systems.master import beyond_steps
from rparm.systems.structure import Connection, OpenedSystem

Result = TypeVar("Result")
POLL = 0.05  # s, between two looks
LEAVE = 2.0  # s, for work and processes to end after a failure


# ---- Parts of a system ---------------------------------------------------------------------------
@dataclass(frozen=True)
class Source:
    """Source of an input: value `index` of those that `component` publishes."""

    component: str
    index: int


@dataclass(frozen=True)
class Part:
    """A component of a system, as one process steps it."""

    component: str
    parameters: dict[str, Value]
    published: tuple[str, ...]  # Real outputs, in the order of the FMU
    inputs: tuple[str, ...]  # connected Real inputs
    sources: tuple[Source, ...]  # of each of `inputs`
    # outputs that feed an input which is no Real, with its start value, which they must keep
    constant: tuple[tuple[str, Value], ...]
    rounds: int  # exchanges in initialization after which no output changes any more
    times: np.ndarray  # s, communication points
    system: str  # variant and SHA-256 of the system's file, the same in all processes
    moved: dict[str, np.ndarray] = field(default_factory=dict)  # (times,) inputs from outside

    def check_same(self, other: str) -> None:
        """Refuse to step with a federation of another variant, or of another SSP."""
        if other == self.system:
            return
        (here, own), (there, foreign) = self.system.rsplit(" ", 1), other.rsplit(" ", 1)
        if here != there:
            variants = f"its variant is {here!r}, the federation's is {there!r}"
            raise UserError(f"{self.component}: {variants}")
        raise UserError(
            f"{self.component}: its file is not the federation's (SHA-256 {own[:12]}..., "
            f"expected {foreign[:12]}...): copy the file"
        )


def parts(ssp: OpenedSystem, variant: str) -> dict[str, Part]:
    """Return the parts of a variant, by component; UserError if it is unknown."""
    system, variant = ssp.system, ssp.variant(variant)
    if more := beyond_steps(system, ssp.models):
        raise UserError(f"{ssp.path}: {more}: processes step side by side, at each point")
    published = {name: model.real_outputs for name, model in ssp.models.items()}
    whole = f"{variant} {hashlib.sha256(ssp.path.read_bytes()).hexdigest()}"

    def source(c: Connection) -> Source:
        return Source(c.start_component, published[c.start_component].index(c.start_connector))

    for name in system.inputs:
        if ssp.variable(name).type != "Real":
            raise UserError(f"{ssp.path}: {name}: moves; processes exchange only Real values")
    made = {}
    for component in system.components:
        name = component.name
        incoming = [c for c in real_connections(ssp) if c.end_component == name]
        others = [c for c in system.connections if c not in real_connections(ssp)]
        constant = [
            (c.start_connector, ssp.variable(c.end).start or 0)
            for c in others
            if c.start_component == name
        ]
        made[name] = Part(
            component=name,
            parameters=system.parameter_sets[variant].get(name, {}),
            published=tuple(published[name]),
            inputs=tuple(c.end_connector for c in incoming),
            sources=tuple(map(source, incoming)),
            constant=tuple(constant),
            rounds=len(real_connections(ssp)) + 1,
            times=system.times,
            system=whole,
            moved={
                ssp.split(end)[1]: signal.values(system.elapsed)
                for end, signal in system.inputs.items()
                if ssp.split(end)[0] == name
            },
        )
    return made


def real_connections(ssp: OpenedSystem) -> Sequence[Connection]:
    return [c for c in ssp.system.connections if ssp.variable(c.start).type == "Real"]


# ---- The process ---------------------------------------------------------------------------------
def run_component(
    part: Part, fmu: Fmu, address: str, silence: float, is_gone: Callable[[], bool] = lambda: False
) -> None:
    """Step a component to the last communication point; UserError if it or the federation fails.

    A call of the FMU, and silence of the broker at `address`, may last `silence` s. `is_gone` says
    whether the process that started this one has ended.
    """
    name = part.component
    federate = Federate(name, address, sorted({s.component for s in part.sources}))
    still = Silence(federate, silence)

    def work() -> None:
        federate.join()
        part.check_same(federate.system())
        with fmu.instance(name) as instance:
            _Stepper(part, instance, federate).run()
        federate.leave()

    def look() -> None:
        if is_gone():
            raise UserError(f"{name}: the process that started it is gone")
        if not still.too_long():
            return
        if not federate.waits:
            raise UserError(f"{name}: its FMU has not returned for {silence:g} s")
        if not federate.has_broker():
            raise UserError(f"{name}: the broker at {address} has been silent for {silence:g} s")

    def end(error: BaseException) -> None:
        is_known = isinstance(error, UserError)
        federate.fail(str(error) if is_known else f"{name}: its process was ended")

    run_watched(work, look, end)


class _Stepper:
    def __init__(self, part: Part, instance: Instance, federate: Federate) -> None:
        self._part, self._instance, self._federate = part, instance, federate
        self._outputs = instance.reals(part.published)
        self._inputs = instance.reals(part.inputs)
        self._moved = instance.reals(list(part.moved))

    def run(self) -> None:
        self._initialize()
        self._check_constants(float(self._part.times[0]))
        times = self._part.times.tolist()
        for point, (start, end) in enumerate(zip(times[:-1], times[1:], strict=True), start=1):
            with self._instance.explained(f"in the step from t = {start!r} s"):
                self._take(point - 1)
                self._instance.do_step(start, end - start)
            with self._instance.explained(f"at t = {end!r} s"):
                self._give(f"at t = {end!r} s")
            self._check_constants(end)
            self._federate.go_to(point)

    def _initialize(self) -> None:
        part, instance = self._part, self._instance
        begin_instance(instance, part.times[0], part.times[-1], part.parameters)
        self._federate.enter_initialization()
        self._settle(instance.explained_early, "in initialization")
        instance.exit_initialization()
        start = f"at t = {float(part.times[0])!r} s"
        self._settle(lambda: instance.explained(start), start)  # samplers have ticked
        self._federate.begin()

    def _settle(self, explained: Callable[[], AbstractContextManager], when: str) -> None:
        """Exchange values at the start until no output follows any more."""
        with explained():
            self._give(when)
        for _ in range(self._part.rounds):
            before = self._outputs.view.copy()
            self._federate.exchange()
            with explained():
                self._take(0)
                self._give(when)
        if not np.array_equal(before, self._outputs.view):
            raise UserError(f"{self._part.component}: the connections form an algebraic loop")

    def _take(self, point: int) -> None:
        """Set the inputs to what their sources have published, or to their values at a time."""
        if self._part.moved:
            self._moved.view[:] = [values[point] for values in self._part.moved.values()]
            self._moved.set()
        if self._part.inputs:
            values = self._federate.read()
            self._inputs.view[:] = [values[s.component][s.index] for s in self._part.sources]
            self._inputs.set()

    def _give(self, when: str) -> None:
        """Read the outputs and publish them."""
        self._outputs.get()
        check_finite(self._part.component, self._outputs, when)
        self._federate.publish(self._outputs.view)

    def _check_constants(self, now: float) -> None:
        """Refuse an output that is no Real and not as the input begins that it feeds."""
        for name, start in self._part.constant:
            if self._instance.discrete(name) != start:
                raise UserError(
                    f"{self._part.component}: {name} changed by t = {now!r} s; only Real values "
                    "are exchanged"
                )


# ---- Watching ------------------------------------------------------------------------------------
def run_watched(
    work: Callable[[], Result], look: Callable[[], None], end: Callable[[BaseException], None]
) -> Result:
    """Do `work`, and `look` now and then; `end` both if one fails or a signal arrives."""
    outcome: Future[Result] = Future()

    def do() -> None:
        if hasattr(signal, "pthread_sigmask"):  # also for the threads of HELICS that begin here
            endings = {getattr(signal, name) for name in ENDINGS if hasattr(signal, name)}
            signal.pthread_sigmask(signal.SIG_BLOCK, endings)
        try:
            outcome.set_result(work())
        except BaseException as error:
            outcome.set_exception(error)

    try:
        Thread(target=do, daemon=True).start()
        while not wait([outcome], POLL).done:
            look()
        return outcome.result()
    except BaseException as error:
        mute_libraries()
        end(error)
        wait([outcome], LEAVE)
        raise


class Silence:
    """Detects calls of HELICS that take too long; counts polls, so suspension does not count."""

    def __init__(self, federate: Federate, limit: float) -> None:
        self._federate, self._limit = federate, limit
        self._calls, self._looks = federate.calls, 0

    def too_long(self) -> bool:
        """Return at each look whether the limit is reached since the last call or True."""
        is_new = self._federate.calls != self._calls
        self._calls, self._looks = self._federate.calls, 0 if is_new else self._looks + 1
        if self._looks * POLL < self._limit:
            return False
        self._looks = 0
        return True


def end_of_input() -> Event:
    """Set as soon as standard input is at its end: its other side has closed it, or is gone."""
    ended = Event()

    def read() -> None:
        # no buffer: the interpreter could not close one that a thread still reads
        while os.read(sys.__stdin__.fileno(), 1024):
            pass
        ended.set()

    Thread(target=read, daemon=True).start()
    return ended
