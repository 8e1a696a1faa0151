"""The folder of the programs that make FMUs, each run in a process of its own."""

from rparm.shipped import SHARE

__path__ = [str((SHARE if SHARE.is_dir() else SHARE.parents[1]) / "fmu")]
