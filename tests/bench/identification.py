"""rparm's identification and mujoco.sysid on the same logs: errors, intervals, processor time.

    build/venv/bin/python -m tests.bench.identification

The arm with damping, at 1 kHz for 10 s, with effort noise for 3 s; all starts are 20 % off.
mujoco.sysid runs each log in one go from its first row, as its examples do, with its own optimizer
and its classical intervals. What it imports is in requirements/dev.in.
"""

import time
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
from mujoco import sysid

from tests.identification.synthetic import INPUTS, MEASURED, PLANT, Machine, identified, off, write
from tests.support.paths import ROOT

TRUE = {"m2": 1.1, "I1z": 0.12, "damping1": 0.3, "damping2": 2.0}
CASES = {
    "white noise": replace(PLANT, true=TRUE),
    # in one run of 10 s, mujoco.sysid did not end in 15 minutes
    "effort noise": replace(PLANT, true=TRUE, effort_noise=0.02, noise=(1e-5, 1e-5), duration=3.0),
}
MODEL = ROOT / "tests" / "rp_manipulator" / "rp_manipulator.xml"
MORE = """<actuator><motor name="tau1" joint="q1"/><motor name="f2" joint="q2"/></actuator>
<sensor><jointpos name="q1" joint="q1"/><jointpos name="q2" joint="q2"/></sensor></mujoco>"""
LOGS = 3
Found = dict[str, tuple[float, float]]  # value and half its interval


def by_rparm(machine: Machine, log: Path, seed: int) -> Found:
    """Values and intervals of rparm."""
    found = identified(machine, log, seed).estimates
    return {name: (x.value, (x.high - x.low) / 2) for name, x in found.items()}


def by_mujoco(machine: Machine, log: Path, seed: int) -> Found:
    """The same of mujoco.sysid."""
    spec = mujoco.MjSpec.from_string(MODEL.read_text().replace("</mujoco>", MORE))
    spec.option.timestep = 1e-3
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    parameters = sysid.ParameterDict()
    start = off(machine.true, seed)
    for name, true in machine.true.items():
        parameters.add(
            sysid.Parameter(
                name,
                nominal=start[name],
                min_value=0.1 * true,
                max_value=10 * true,
                modifier=lambda spec, parameter, name=name: _set(spec, name, parameter.value[0]),
            )
        )
    table = np.loadtxt(log, delimiter=",", skiprows=1)
    times, told, seen = table[:, 0], table[:, 1:3], table[:, 3:5]
    model = spec.compile()
    state = sysid.create_initial_state(model, seen[0], np.zeros(2), np.zeros(0))
    sequences = sysid.ModelSequences(
        "arm",
        spec,
        "log",
        state,
        sysid.TimeSeries(times, told),
        sysid.TimeSeries.from_names(times, seen, model),
    )
    residuals = sysid.build_residual_fn(models_sequences=[sequences])
    with redirect_stdout(StringIO()):  # each step is printed
        best, result = sysid.optimize(parameters, residuals, verbose=False, x_scale="jac")
    left, _, _ = residuals(result.x, best)
    halves = sysid.calculate_intervals(left, result.jac)[1]
    return dict(zip(machine.true, zip(result.x, halves, strict=True), strict=True))


def _set(spec: mujoco.MjSpec, name: str, value: float) -> None:
    if name == "m2":
        spec.body("link2").mass = value
    elif name == "I1z":
        spec.body("link1").inertia = [value] * 3
    else:
        spec.joint(name.replace("damping", "q")).damping[0] = value


def row(
    machine: Machine, logs: Mapping[int, Path], by: Callable[[Machine, Path, int], Found]
) -> str:
    """Cells: largest error, share of the intervals that hold, processor time of a log."""
    errors, holds, seconds = [], [], 0.0
    for seed, log in logs.items():
        begin = time.process_time()
        found = by(machine, log, seed)
        seconds += time.process_time() - begin
        for name, true in machine.true.items():
            value, half = found[name]
            errors.append(abs(value / true - 1))
            holds.append(abs(value - true) < half)
    return f"{max(errors):.1e} | {np.mean(holds):.2f} | {seconds / len(logs):.1f}"


def main() -> None:
    """Print the table."""
    assert (*INPUTS, *MEASURED) == ("tau1", "f2", "q1", "q2")  # the order in MORE
    print("| case | by | largest error | intervals that hold | s |\n|---|---|--:|--:|--:|")
    with TemporaryDirectory() as folder:
        for case, machine in CASES.items():
            logs = {
                seed: write(machine, Path(folder) / f"{seed}.csv", seed) for seed in range(LOGS)
            }
            identified(machine, logs[0])  # what numba compiles is kept
            for name, by in (("rparm", by_rparm), ("mujoco.sysid", by_mujoco)):
                print(f"| {case} | {name} | {row(machine, logs, by)} |", flush=True)


if __name__ == "__main__":
    main()
