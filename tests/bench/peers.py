"""The Python peers of the benchmark: others that integrate the arm, as their users call them.

Each peer's run makes all steps of a problem once and returns the time of the stepping, s, and the
states at the end of each step, shape (steps, 4). Setup and cleanup are not timed.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from statistics import median
from time import thread_time

import fmpy
import mujoco
import numpy as np
from arm import INPUTS, START, STATES, Work, accelerations, taylor_adaptive
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.sundials import CVodeSolver
from scipy.integrate import DOP853

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rparm.fmi.compiled_loop import Part, Stepper
from rparm.fmi.fmu_file import Fmu

FOLDER = Path(__file__).resolve().parent
Run = tuple[float, np.ndarray]


def stepped(work: Work, step: Callable[[int, list[float]], object]) -> Run:
    """Time the calls of step(index, inputs), which returns the states.

    The time is the processor's for this thread, as in bench, without that of reading the clock.
    """
    inputs = work.inputs.tolist()
    states = []
    begin = thread_time()
    for i, u in enumerate(inputs):
        states.append(step(i, u))
    elapsed = thread_time() - begin
    return max(elapsed - clock_cost(), 1e-9), np.array(states)


@cache
def clock_cost() -> float:
    """What two readings of the clock in a row differ by, s."""
    return median(-thread_time() + thread_time() for _ in range(1001))


# ---- heyoka, scipy, MuJoCo


compiled = cache(taylor_adaptive)


def run_heyoka(work: Work, tolerance: float) -> Run:
    """heyoka's compiled Taylor method: sets its parameters, propagate_until, reads its state."""
    taylor = compiled(tolerance)
    taylor.time = 0.0
    taylor.state[:] = START
    pars, state, propagate, size = taylor.pars, taylor.state, taylor.propagate_until, work.step

    def step(i: int, u: list[float]) -> np.ndarray:
        pars[0], pars[1] = u
        propagate(size * (i + 1))
        return state.copy()

    return stepped(work, step)


def run_dop853(work: Work, tolerance: float) -> Run:
    """scipy's DOP853, restarted at each communication point with its last proposed step."""
    x, proposed = np.array(START), None

    def step(i: int, u: list[float]) -> np.ndarray:
        nonlocal x, proposed

        def rhs(t: float, x: np.ndarray) -> tuple[float, float, float, float]:
            q1, q2, dq1, dq2 = x.tolist()
            ddq1, ddq2 = accelerations(q1, q2, dq1, dq2, *u)
            return dq1, dq2, ddq1, ddq2

        first = None if proposed is None else min(proposed, work.step)
        solver = DOP853(
            rhs, 0.0, x, work.step, rtol=tolerance, atol=1e-2 * tolerance, first_step=first
        )
        while solver.status == "running":
            solver.step()
        if solver.status != "finished":
            raise RuntimeError("DOP853 failed")
        proposed = solver.h_abs
        x = solver.y
        return x

    return stepped(work, step)


def run_mujoco(work: Work, tolerance: float) -> Run:
    """MuJoCo's RK4 by its Python bindings, a mj_step each communication step."""
    del tolerance
    model = mujoco.MjModel.from_xml_path(
        str(FOLDER.parent / "rp_manipulator" / "rp_manipulator.xml")
    )
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = work.step
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = START[:2], START[2:]
    efforts, q, dq, mj_step = data.qfrc_applied, data.qpos, data.qvel, mujoco.mj_step

    def step(i: int, u: list[float]) -> tuple[float, ...]:
        efforts[0], efforts[1] = u
        mj_step(model, data)
        return *q, *dq

    return stepped(work, step)


# ---- FMUs driven by fmpy


class LoadedFmu:
    """An FMU, extracted into a folder, of which fmpy makes instances."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.folder = fmpy.extract(path, unzipdir=folder)
        self.description = fmpy.read_model_description(path, validate=False)
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}
        self.states = [self.reference[name] for name in STATES]
        self.inputs = [self.reference[name] for name in INPUTS]

    def start(self, kind: type, tolerance: float, method: int = 0) -> FMU2Slave | FMU2Model:
        """Make an instance at START; method: of solver_method, 0: leave it."""
        interface = (
            self.description.coSimulation if kind is FMU2Slave else self.description.modelExchange
        )
        fmu = kind(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=interface.modelIdentifier,
            instanceName="benchmark",
        )
        fmu.instantiate()
        fmu.setReal(self.states, START)
        if method:
            fmu.setInteger([self.reference["solver_method"]], [method])
        fmu.setupExperiment(tolerance=tolerance)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        return fmu


def run_co_simulation(loaded: LoadedFmu, work: Work, tolerance: float, method: int = 0) -> Run:
    """Co-simulation: setReal, doStep and getReal of fmpy."""
    fmu = loaded.start(FMU2Slave, tolerance, method)

    def step(i: int, u: list[float]) -> list[float]:
        fmu.setReal(loaded.inputs, u)
        fmu.doStep(work.step * i, work.step)
        return fmu.getReal(loaded.states)

    run = stepped(work, step)
    fmu.terminate()
    fmu.freeInstance()
    return run


def run_compiled(path: Path, work: Work, tolerance: float) -> Run:
    """Co-simulation by the compiled loop of rparm.simulate."""
    times = work.step * np.arange(work.steps + 1)
    held = np.vstack((work.inputs, work.inputs[-1:]))
    switches = np.empty((work.steps + 1, 0), np.int32)
    states = np.empty((work.steps, 4))
    with Fmu(path) as fmu, fmu.instance("benchmark") as instance:
        inputs, outputs = (
            tuple(fmu.model.variables[name].reference for name in names)
            for names in (INPUTS, STATES)
        )
        stepper = Stepper([Part(inputs, (0, 1), outputs)], [Part((), (), ())], 2, 0)
        stepper.connect([instance])
        instance.set_up(0.0, None, tolerance)
        for name, value in zip(STATES, START, strict=True):
            instance.set(name, value)
        instance.enter_initialization()
        instance.exit_initialization()

        def advance(steps: int) -> None:
            here, points = slice(steps + 1), np.arange(1, steps + 1)
            _, failure = stepper.advance(
                times[here], held[here], switches[here], points, np.arange(2, 6), states
            )
            if failure is not None:
                raise failure

        advance(0)  # compiles it
        begin = thread_time()
        advance(work.steps)
        elapsed = thread_time() - begin
    return max(elapsed - clock_cost(), 1e-9), states


class NoInput:
    """Inputs are set by the loop, at its events."""

    def apply(self, time: float) -> None:
        """Change nothing."""


def run_model_exchange(loaded: LoadedFmu, work: Work, tolerance: float) -> Run:
    """Model exchange with the CVODE of fmpy (BDF): each change of inputs is an event, as in
    fmpy.simulate_fmu, where the solver restarts."""
    fmu = loaded.start(FMU2Model, tolerance)
    fmu.newDiscreteStates()
    fmu.enterContinuousTimeMode()
    solver = CVodeSolver(
        nx=4,
        nz=0,
        get_x=fmu.getContinuousStates,
        set_x=fmu.setContinuousStates,
        get_dx=fmu.getDerivatives,
        get_z=fmu.getEventIndicators,
        get_nominals=fmu.getNominalsOfContinuousStates,
        set_time=fmu.setTime,
        input=NoInput(),
        startTime=0.0,
        relativeTolerance=tolerance,
        maxNumSteps=100000,
    )

    def step(i: int, u: list[float]) -> list[float]:
        if work.kind == "changing":
            fmu.enterEventMode()
            fmu.setReal(loaded.inputs, u)
            fmu.newDiscreteStates()
            fmu.enterContinuousTimeMode()
            solver.reset(work.step * i)
        solver.step(work.step * i, work.step * (i + 1))
        fmu.setTime(work.step * (i + 1))
        fmu.completedIntegratorStep()
        return fmu.getReal(loaded.states)

    run = stepped(work, step)
    fmu.terminate()
    fmu.freeInstance()
    return run


def build_python_plant(folder: Path) -> Path:
    """Let pythonfmu make an FMU of python_plant.py."""
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", FOLDER / "python_plant.py"]
    subprocess.run([*command, "-d", folder], check=True, capture_output=True)
    return folder / "PythonPlant.fmu"
