"""`federation`: run variants of a system with each FMU in its own process, coupled by HELICS."""

import argparse
import shlex
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from cosim import console, project
from cosim.coupling.master import Master
from cosim.errors import UserError, did_you_mean
from cosim.federation import addresses, federation
from cosim.federation.federation import Record
from cosim.federation.parts import parts, real_connections
from cosim.fmu_file import Fmu
from cosim.progress import Progress
from cosim.system import comparison, ecos, ssp, study
from cosim.system.ssp import Ssp

BOUND = 1e-12  # on the largest difference to the master, relative to the variable's largest value


def run(options: argparse.Namespace) -> int:
    """Run the variants; compare each with the master that steps all in one process."""
    path = options.ssp
    if path is None:
        folder, _ = study.of_coupling()
        path = project.built(folder, ".ssp", "--ssp", options.fmi)
    address = addresses.free() if options.listen is None else options.listen
    addresses.check_free(address)
    with ssp.unpacked(path) as system:
        _check_names(system, options)
        names = options.names or list(system.system.parameters)
        for component in options.elsewhere:
            print(f"waiting for: {_command(path, names[0], component, address)}", flush=True)
        table = console.FederationTable(names)
        failed = []
        for name in names:
            label, steps = f"{name} by HELICS", system.system.steps
            with Progress(label, steps) as progress:
                record = federation.run(
                    system, name, address, options.elsewhere, options.silence, progress
                )
            difference, master_time = _master(system, name, record)
            ecos_time = ecos.run(system, name, comparison.recorded(system)).wall_time
            passed = difference <= BOUND
            times = [1e6 * s / steps for s in (record.wall_time, ecos_time, master_time)]
            table.row(name, steps, difference, BOUND, times, passed)
            failed += [] if passed else [name]
    return console.summary(failed, names, "variant")


def _command(path: Path, variant: str, component: str, address: str) -> str:
    """What steps a component on another machine, in the folder of the project there."""
    place = project.from_root(path)
    return f"./run.sh {shlex.join(federation.arguments(place, variant, component, address))}"


def _check_names(system: Ssp, options: argparse.Namespace) -> None:
    for kind, given, known in (
        ("variant", options.names, system.system.parameters),
        ("component", options.elsewhere, system.models),
    ):
        for name in given:
            if name not in known:
                hint = did_you_mean(name, known)
                raise UserError(
                    f"{system.path}: has no {kind} {name!r}{hint} (there are: {', '.join(known)})"
                )
    if options.elsewhere and len(options.names) != 1:
        raise UserError("--elsewhere: name one variant, which the other machine steps too")


def _master(system: Ssp, variant: str, record: Record) -> tuple[float, float]:
    """Largest relative difference to the Jacobi master, and its time for all steps, s."""
    with ExitStack() as stack:
        fmus = {
            c.name: stack.enter_context(Fmu(system.fmu(c.name))) for c in system.system.components
        }
        master = stack.enter_context(Master(fmus, real_connections(system)))
        times = next(iter(parts(system, variant).values())).times
        master.initialize(times[0], times[-1], system.system.parameter_sets[variant])
        begin = time.perf_counter()
        rows = master.run(times)
        seconds = time.perf_counter() - begin
    places = [master.names.index(name) for name in record.names]
    expected = rows[:, places]
    scale = np.maximum(np.abs(expected).max(axis=0), np.finfo(float).tiny)
    return float((np.abs(record.values - expected) / scale).max()), seconds
