"""What is found out about FMUs by many runs; each needs an extra of the distribution."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rparm import project
from rparm.api.simulations import version
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Value

if TYPE_CHECKING:
    from rparm.identification.identify import Identification
    from rparm.linearization.linear import Linear


def linearize(
    fmu_or_ssp: str | Path,
    *,
    at: Mapping[str, Value] | None = None,
    time: float | None = None,
    trim: Sequence[str] = (),
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    variant: str = "",
    break_at: str = "",
    without: Sequence[str] = (),
    fmi: int = 2,
) -> "Linear":
    """The linear model of an FMU or a system at a point; rparm/linearization/README.md explains.

    Parameters
    ----------
    fmu_or_ssp : path or str
        A file, or a name of the project; a name is taken from version `fmi` of FMI.
    at : mapping, optional
        States, inputs and parameters by name, as numbers or texts with a unit ("30 deg"); with
        `trim` also outputs, and first guesses of what is moved. In a system names are
        "component.variable".
    time : float, optional
        s; default: the start of the FMU's default experiment, or of the system.
    trim : sequence of str
        States and inputs to move until the point is an equilibrium.
    inputs, outputs : sequence of str, optional
        Those of the model; default: all.
    variant, break_at, without
        Of a system: its parameter set (default: the first), an input whose connection is cut, and
        components that are taken as ideal.

    Returns
    -------
    Linear
        `A`, `B`, `C`, `D`; `states`, `inputs`, `outputs`, `held`; `ss()` and `zoh(step)` give them
        to python-control.
    """
    with _needing("control"):
        from rparm.linearization.study import Request, study
    asked = Request(
        fmu_or_ssp, at or {}, time, tuple(trim), inputs, outputs, variant, break_at, tuple(without),
        version=version(fmi),
    )  # fmt: skip
    return study(asked).linear


def identify(
    fmu: str | Path,
    logs: str | Path | Sequence[str | Path],
    *,
    parameters: Sequence[str],
    inputs: Sequence[str],
    measured: Sequence[str],
    settings: Mapping[str, Value] | None = None,
    start: Mapping[str, Value] | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    delay: bool = False,
    validate: str | Path | None = None,
    segment: float = 0.4,
    tolerance: float = 1e-8,
) -> "Identification":
    """Fit parameters of an FMU to logs of a machine; needs the extra `control`.

    Parameters
    ----------
    fmu : path
        Any FMU for co-simulation whose states can be set; see `fmu` for those of the project.
    logs : path or sequence of path
        CSV files with a row of names; "time" in s.
    parameters : sequence of str
        To be estimated. "name>other" stays above another parameter.
    inputs, measured : sequence of str
        Inputs and Real outputs that the logs have.
    settings, start : mapping, optional
        Values of other parameters; where the fit begins, of parameters and of states.
    columns, units : mapping, optional
        Names and units of columns, by variable, where they differ from its own.
    delay : bool
        Estimate by how much the measured values are late, too.
    validate : path, optional
        A log to run with the result.
    segment, tolerance : float
        Length of a segment in s; relative tolerance of the integrator.

    Returns
    -------
    Identification
        `estimates` by name, each with `value`, `low` and `high` (95 %, by the scatter between
        segments) and `classical`; `combinations` that cannot be known; `chi2`, `whiteness`,
        `validation`, `warnings`.
    """
    with _needing("control"):
        from rparm.identification import identify as identification
        from rparm.identification.request import Request
    files = [logs] if isinstance(logs, str | Path) else logs
    request = Request(
        logs=[Path(log) for log in files], parameters=parameters, inputs=inputs,
        measured=measured, settings=settings or {}, starts=start or {}, columns=columns or {},
        units=units or {}, with_delay=delay, segment=segment, tolerance=tolerance,
        validation=None if validate is None else Path(validate),
    )  # fmt: skip
    with Fmu(Path(fmu)) as opened:
        return identification.identify(opened, request)


def run_campaign(
    file: str | Path,
    *,
    output: str | Path | None = None,
    fmu: str | Path | None = None,
    workers: int | None = None,
) -> dict[str, np.ndarray]:
    """Make all runs of a campaign that are missing, in processes of this machine.

    The processes import your program: call this under ``if __name__ == "__main__":``.

    Parameters
    ----------
    file : path or str
        The campaign, as the command takes it.
    output : path, optional
        Folder for the results; default: that in the file, or that of the command.
    fmu : path, optional
        The FMU or SSP; default: that of the project.
    workers : int, optional
        Number of processes; default: one a core.

    Returns
    -------
    dict of str to ndarray
        A value a run, (runs,), in SI units: "run", parameters, what is kept, and "failure", why a
        run failed, else empty.
    """
    with _needing("campaign"):
        from rparm.campaign import engine, work
    with work.opened(
        project.campaign_file(file), fmu and Path(fmu), output and Path(output)
    ) as made:
        if blocks := made.begin():
            with (
                made.results.workers_folder() as files,
                engine.opened_cluster(None, workers, files) as client,
            ):
                made.run(client, blocks)
        return made.table()


@contextmanager
def _needing(extra: str) -> Iterator[None]:
    """Say how to install what an extra of the distribution has, if an import finds it missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise project.not_installed(str(error.name), extra) from error
