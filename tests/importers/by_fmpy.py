"""What the importers are compared with: the same runs by fmpy's own loops."""

from typing import Any

import fmpy
import numpy as np

from tests.support.instances import LoadedFmu


def co_simulation(loaded: LoadedFmu, plan: dict[str, Any], held: int = 0) -> np.ndarray:
    """Return the outputs (steps + 1, outputs); a step holds the inputs of so many steps later."""
    return _run(loaded, plan, "CoSimulation", held)


def euler(loaded: LoadedFmu, plan: dict[str, Any]) -> np.ndarray:
    """Outputs (steps + 1, outputs) of Model Exchange by Euler's method, inputs as they are."""
    return _run(loaded, plan, "ModelExchange", 0)


def _run(loaded: LoadedFmu, plan: dict[str, Any], kind: str, held: int) -> np.ndarray:
    count, step = plan["steps"], plan["step"]
    times = plan["start"] + step * np.arange(count + 1)
    inputs = np.zeros(count + 1, [("time", float), *((name, float) for name in plan["inputs"])])
    inputs["time"] = times
    for name, values in plan["inputs"].items():
        inputs[name] = np.take(values, np.arange(count + 1) + held, mode="clip")
    result = fmpy.simulate_fmu(
        str(loaded.folder),
        fmi_type=kind,
        solver="Euler",
        start_time=plan["start"],
        stop_time=times[-1],
        step_size=step,
        output_interval=step,
        start_values=plan["parameters"] | plan["initial"],
        input=inputs,
        output=plan["outputs"],
        record_events=False,
    )
    return np.column_stack([result[name] for name in plan["outputs"]])
