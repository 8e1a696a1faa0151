"""A small model for the tests of scenarios."""

from collections.abc import Callable
from pathlib import Path

VARIABLES = """
include = ["../more/solver.toml"]
[variables.mass]
reference = 1
causality = "parameter"
unit = "kg"
min = 0.5
start = 1.0
[variables.speed]
reference = 3
causality = "output"
initial = "exact"
max = 100.0
[variables.force]
reference = 5
causality = "input"
min = -10.0
[variables.power]
reference = 4
causality = "output"
initial = "calculated"
[variables.gear]
reference = 6
type = "Enumeration"
causality = "parameter"
start = "second"
[variables.gear.items]
first = { description = "Slow", constant = "GEAR_FIRST" }
second = { description = "Faster", constant = "GEAR_SECOND" }
third = { description = "Fast", constant = "GEAR_THIRD" }
"""
INCLUDED = """
[variables.max_steps]
reference = 9
type = "Integer"
causality = "parameter"
[variables.time]
reference = 0
causality = "independent"
"""
HEAD = 'title = "A"\ndescription = "B"\ntolerance = 1e-6\n'
TIME = "[time]\nstart = 1.0\nstop = 2.0\nstep = 0.25\n"


def timed(start: object, stop: object, step: object) -> str:
    return f"{HEAD}[time]\nstart = {start}\nstop = {stop}\nstep = {step}\n"


def make_model(tmp_path: Path) -> Callable[..., Path]:
    """Makes the model; what is returned writes a scenario of it and returns its path."""
    model = tmp_path / "models" / "toy"
    (model / "scenarios").mkdir(parents=True)
    (model / "variables.toml").write_text(VARIABLES)
    (tmp_path / "models" / "more").mkdir()
    (tmp_path / "models" / "more" / "solver.toml").write_text(INCLUDED)

    def write(text: str, name: str = "run") -> Path:
        path = model / "scenarios" / f"{name}.toml"
        path.write_text(text)
        return path

    return write
