"""The folder of the models: modules of their studies and references are `rparm.models.NAME`."""

from pathlib import Path

__path__ = [str(Path(__file__).resolve().parents[1] / "models")]
