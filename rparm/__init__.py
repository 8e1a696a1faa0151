"""Drives FMUs through fmpy: compares them with references, plots, couples, runs systems.

For programs there are the names in `__all__`; docs/python-api.md is their page.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rparm.api import (
        Gradient,
        Scenario,
        System,
        Table,
        build,
        fmu,
        gradient,
        identify,
        linearize,
        run_campaign,
        simulate,
    )

__all__ = [
    "Gradient", "Scenario", "System", "Table", "build", "fmu", "gradient", "identify",
    "linearize", "run_campaign", "simulate",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import what programs use when they use it: the command line does without."""
    if name in __all__:
        return getattr(import_module("rparm.api"), name)
    raise AttributeError(f"module 'rparm' has no attribute {name!r}")
