"""The loop of rparm against what it calls: components of a system, one FMU, one in Python."""

import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from operator import truediv
from pathlib import Path
from statistics import median

import numpy as np
from by_heyoka import START, STATES, Work
from solvers import Solvers

from rparm.fmi.fmu_file import Fmu
from rparm.fmi.loop import one_component
from rparm.project import child_environment
from rparm.runs import simulation
from rparm.systems.connected_instance import begin_instance
from rparm.systems.master import Master, master_of
from rparm.systems.opened import opened
from rparm.systems.structure import OpenedSystem, System

VARIANT = "nominal"
LAW = """
def step(t, h, inputs):
    return {"tau1": -10.0 * inputs["q1"] - inputs["dq1"]}
"""
LOOP = """
name = "Loop"
stop = 10.0
step = 0.001
[components]
arm = {{ file = "{arm}" }}
law = {{ file = "law.py" }}
[connections]
"law.q1" = "arm.q1"
"law.dq1" = "arm.dq1"
"arm.tau1" = "law.tau1"
"""
FIRST = "import rparm, sys; rparm.System(sys.argv[1]).run()"


def begun(system: OpenedSystem, stack: ExitStack, variant: str) -> Master:
    fmus = stack.enter_context(system.unpacked_fmus())
    master = stack.enter_context(master_of(system, fmus))
    of = system.system
    master.initialize(of.start, float(of.times[-1]), of.parameter_sets[variant])
    return master


def seconds(call: Callable[[], object]) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


def seconds_alone(
    system: System, variant: str, master: Master, name: str, fmu: Fmu, rows: np.ndarray
) -> float:
    """Return s of all steps of one component that gets the inputs of a run."""
    index = {key: i for i, key in enumerate(master.names)}
    fed = {c.end_connector: index[c.start] for c in system.connections
           if c.end_component == name and c.start in index}  # fmt: skip
    with fmu.instance(name) as instance:
        parameters = system.parameter_sets[variant].get(name, {})
        begin_instance(instance, system.start, float(system.times[-1]), parameters)
        instance.exit_initialization()
        loop = one_component(instance, list(fed), [], fmu.model.real_outputs)
        loop.start(system.start)
        driven = np.ascontiguousarray(rows[:, list(fed.values())])
        found = np.empty((len(rows), loop.width))
        return seconds(lambda: loop.run(system.times[1:], driven[:-1], rows=found))


def system_times(path: Path) -> tuple[float, float]:
    """Return s of a step of a system, and of its components one by one."""
    with opened(path) as system, ExitStack() as stack:
        master, of = begun(system, stack, VARIANT), system.system
        rows = []
        whole = seconds(lambda: rows.append(master.run(of.times)))
        parts = 0.0
        for name in master.components:
            with system.unpacked_fmu(name) as fmu:
                parts += seconds_alone(of, VARIANT, master, name, fmu, rows[0])
        return whole / of.steps, parts / of.steps


def python_time(folder: Path, arm: Path) -> float:
    """Return s of a call of a component in Python: a step of its loop, less the arm's alone."""
    (folder / "law.py").write_text(LAW, encoding="utf-8")
    file = folder / "loop.toml"
    file.write_text(LOOP.format(arm=arm), encoding="utf-8")
    with opened(file) as system, ExitStack() as stack:
        master, of = begun(system, stack, "default"), system.system
        rows = []
        whole = seconds(lambda: rows.append(master.run(of.times)))
        with Fmu(arm) as fmu:
            own = seconds_alone(of, "default", master, "arm", fmu, rows[0])
    return (whole - own) / of.steps


def simulate_times(solvers: Solvers, arm: Path) -> tuple[float, float]:
    """Return s of a step of rparm.simulate, which reads all Real outputs, and of a loop in C."""
    work = Work("1 ms steps, inputs changing", 1e-3, 2000, "changing", START)
    held = np.vstack([work.inputs, work.inputs[-1:]])
    inputs = {"tau1": held[:, 0], "f2": held[:, 1]}
    start = dict(zip(STATES, START, strict=True))
    with Fmu(arm) as fmu:

        def run(steps: int) -> float:
            times = (0.0, work.step * steps, work.step)
            given = {name: values[: steps + 1] for name, values in inputs.items()}
            return seconds(lambda: simulation.of_program(fmu, times, start, given, 1e-8))

        own = (run(work.steps) - run(1)) / work.steps
    return own, solvers.fmu("cvode_adams")(work, 1e-8, 1)[0]


def first_time(path: Path) -> float:
    """Return s of a new process that runs a system."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", FIRST, path], check=True, env=child_environment())
    return time.perf_counter() - begin


def rows(turns: int, build: Path, folder: Path, solvers: Solvers) -> list[dict]:
    """Measure: a system may take 1.5 times its components and 3 us, a call of Python 15 us."""
    loop, arm = build / "ClosedLoop.ssp", (build / "RPManipulator.fmu").resolve()
    pairs = [system_times(loop) for _ in range(turns)]
    simulated = [simulate_times(solvers, arm) for _ in range(turns)]
    in_python = median(python_time(folder, arm) for _ in range(turns))
    own, parts = (1e6 * median(x) for x in zip(*pairs, strict=True))
    first = [1e6 * first_time(loop) for _ in range(3)]
    return [
        {"group": "loop", "work": "1 ms steps, inputs changing",
         "run": "closed loop in rparm to its FMUs one by one",
         "us": own, "ratio": median(truediv(*pair) for pair in pairs),
         "judged": "us", "limit": 1.5 * parts + 3.0},
        {"group": "loop", "work": "1 ms steps, inputs changing",
         "run": "rparm.simulate to a loop in C",
         "us": 1e6 * median(x for x, _ in simulated),
         "ratio": median(truediv(*pair) for pair in simulated), "judged": "ratio", "limit": 1.3},
        {"group": "loop", "work": "a component in Python", "run": "call", "us": 1e6 * in_python,
         "judged": "us", "limit": 15.0},
        {"group": "loop", "work": "a new process", "run": "6000 steps of the closed loop",
         "us": median(first)},
    ]  # fmt: skip
