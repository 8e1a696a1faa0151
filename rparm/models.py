"""The folder of the models: modules of their studies and references are `rparm.models.NAME`."""

from rparm.shipped import SHARE

__path__ = [str((SHARE if SHARE.is_dir() else SHARE.parents[1]) / "models")]
