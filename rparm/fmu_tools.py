"""The folder of the programs that make FMUs, each of which runs as a separate process."""

from rparm.shipped import SHARE

__path__ = [str((SHARE if SHARE.is_dir() else SHARE.parents[1]) / "fmu")]
