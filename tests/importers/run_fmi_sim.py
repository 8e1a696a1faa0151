"""fmi-sim: inputs from a CSV file, set at each communication point after the outputs are recorded.

    run_fmi_sim.py PROGRAM INTERFACE [OPTION ...] FMU PLAN RESULT

INTERFACE is co-simulation or model-exchange; the latter integrates by Euler's method, whose steps
are those of the plan. Options are those of the interface, such as --event-mode-used. The program
interpolates the inputs linearly, here between equal times only.
"""

import csv
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from plan import Plan, Rows, main


def run(plan: Plan) -> Rows:
    program, interface, *options = sys.argv[1:-3]
    with TemporaryDirectory() as folder:
        inputs, outputs = Path(folder) / "inputs.csv", Path(folder) / "outputs.csv"
        with inputs.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time", *plan.inputs])
            for i in range(plan.steps + 1):
                writer.writerow([plan.time(i), *plan.inputs_at(i).values()])
        command = [program, "--model", plan.fmu, "-i", inputs, "-o", outputs, interface, *options]
        for name, value in (plan.parameters | plan.initial).items():
            command += ["--init-values", f"{name}={value!r}"]
        command += [f"-s={plan.start!r}", f"-f={plan.stop!r}", f"--output-interval={plan.step!r}"]
        subprocess.run(command, check=True, env=os.environ | {"RUST_LOG": "warn"})
        with outputs.open(encoding="utf-8", newline="") as file:
            return [[float(row[name]) for name in plan.outputs] for row in csv.DictReader(file)]


if __name__ == "__main__":
    main(run)
