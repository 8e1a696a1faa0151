"""A log to try: made by a system of the project, whose module `identification` says how."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from rparm import project
from rparm.errors import UserError
from rparm.identification.request import Request


@dataclass(frozen=True)
class Demo:
    """A log and what to ask of it."""

    fmu: Path
    request: Request
    true: Mapping[str, float]  # what is to be found


class Recipe(Protocol):
    """The module of a system's folder."""

    @staticmethod
    def demo(folder: Path) -> Demo:
        """Make the logs in a folder."""


def make(folder: Path) -> Demo:
    """Make the log of the system that has one, in a folder; UserError if none has."""
    for system in project.systems().values():
        if (system / f"{project.IDENTIFICATION}.py").is_file():
            module = import_module(f"rparm.models.{system.name}.{project.IDENTIFICATION}")
            return cast(Recipe, module).demo(folder)
    raise UserError(f"{project.models_folder()}: no system makes a log")
