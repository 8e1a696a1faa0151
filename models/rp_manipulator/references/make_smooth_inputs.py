"""Makes the exact final states of ../convergence: inputs that are smooth functions of time.

The equations are those of make_references.py; the inputs are part of them, as functions of time.
heyoka's Taylor method integrates in long double at its precision.
"""

import argparse
import json
import sys
from pathlib import Path

import heyoka as hy
import numpy as np
import sympy as sp
from make_references import INPUTS, MODEL_FOLDER, PARAMETERS, STATES, derive

from rparm import project
from rparm.errors import UserError
from rparm.files import write_text
from rparm.fmi.fmu_file import read_model
from rparm.runs import convergence
from rparm.runs import scenario as scenarios
from rparm.runs.inputs import Sines
from rparm.runs.scenario import Scenario

ON_THE_WAY = 1000  # points at which the largest values are looked for


def signal(sines: Sines, real: type) -> hy.expression:
    """`sines` as a function of heyoka's time."""
    omega = 2 * np.arctan2(real(0), real(-1))
    total = hy.expression(real(sines.offset))
    for amplitude, frequency, phase in sines.terms:
        angle = hy.expression(omega * real(frequency)) * hy.time + hy.expression(real(phase))
        total += hy.expression(real(amplitude)) * hy.sin(angle)
    return total


def integrator(
    scenario: Scenario, inputs: dict[str, hy.expression], real: type = np.longdouble, pars: int = 0
) -> hy.taylor_adaptive:
    """The motion from time 0, with tau1 (N.m) and f2 (N) of heyoka's time and `pars` parameters."""
    start = scenario.start_values
    names = {sp.Symbol(name): hy.expression(real(start[name])) for name in PARAMETERS}
    names |= {sp.Symbol(name): inputs[name] for name in INPUTS}
    states = hy.make_vars(*STATES)
    ddq1, ddq2 = (hy.from_sympy(e, names) for e in derive().accelerations)
    return hy.taylor_adaptive(
        list(zip(states, (states[2], states[3], ddq1, ddq2), strict=True)),
        np.array([start[name] for name in STATES], real),
        pars=np.zeros(pars, dtype=real),
        fp_type=real,
    )


def final_state(
    scenario: Scenario, real: type = np.longdouble
) -> tuple[dict[str, float], dict[str, float]]:
    """States at the end, and the largest absolute value of each on the way."""
    if real is np.longdouble and np.finfo(real).eps > 2e-19:
        raise UserError("long double is no wider than double here: make the references elsewhere")
    sines = convergence.smooth_inputs(scenario)
    motion = integrator(scenario, {name: signal(s, real) for name, s in sines.items()}, real)
    end = real(scenario.stop) - real(scenario.start)
    outcome, *_, path = motion.propagate_grid(np.linspace(real(0), end, ON_THE_WAY))
    if outcome != hy.taylor_outcome.time_limit:
        raise UserError(f"{scenario.path}: the motion blows up")
    largest = np.max(np.abs(path), axis=0)
    return (
        dict(zip(STATES, path[-1].astype(float).tolist(), strict=True)),
        dict(zip(STATES, largest.astype(float).tolist(), strict=True)),
    )


def write(scenario: Scenario, folder: Path) -> None:
    """Write the exact final state of `scenario` to `folder`."""
    final, largest = final_state(scenario)
    content = {"time": scenario.stop, "final": final, "largest": largest}
    file = project.exact_state_file(scenario.path).name
    write_text(folder / file, json.dumps(content, indent=2) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes the exact final states of smooth inputs.")
    parser.add_argument("--output", type=Path, metavar="DIR", help="write to DIR/NAME instead")
    arguments = parser.parse_args()
    try:
        model = read_model(project.built(MODEL_FOLDER, ".fmu"))
        for path in project.convergence_files():
            if project.model_folder(path) == MODEL_FOLDER:
                scenario = scenarios.load(path, model)
                folder = arguments.output / path.stem if arguments.output else None
                write(scenario, folder or scenario.reference_folder)
                print(f"{path.stem}: {scenario.stop:g} s")
    except UserError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
