"""What programs use: runs as tables, and studies.

All values are in the units of their variables (SI), times in s. What is wrong raises
`rparm.errors.UserError`, whose text is one line.
"""

from rparm.api.simulations import Scenario, System, Table, fmu, simulate
from rparm.api.studies import identify, linearize, run_campaign

__all__ = [
    "Scenario", "System", "Table", "fmu", "identify", "linearize", "run_campaign", "simulate",
]  # fmt: skip
