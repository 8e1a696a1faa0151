"""What programs use: runs as tables, studies, and FMUs of own equations.

All values are in the units of their variables (SI), times in s. What is wrong raises
`rparm.errors.UserError`, whose text is one line.
"""

from rparm.api.simulations import Scenario, System, Table, fmu, simulate
from rparm.api.studies import identify, linearize, run_campaign
from rparm.building import build

__all__ = [
    "Scenario", "System", "Table", "build", "fmu", "identify", "linearize", "run_campaign",
    "simulate",
]  # fmt: skip
