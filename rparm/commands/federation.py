"""`federation` and `federate`: run a system with each FMU in its own process, coupled by HELICS."""

import argparse
import math
import os
import shlex
import time

import numpy as np

from rparm import console, files, project
from rparm.command_line import Ended
from rparm.console import Progress
from rparm.errors import UserError, counted, hint
from rparm.federation import component, federation, network
from rparm.federation.component import parts, real_connections
from rparm.federation.federation import Record
from rparm.federation.network import KEY, key
from rparm.files import check_writable, from_here, written
from rparm.result_tables import FederationTable
from rparm.systems import comparison, ecos
from rparm.systems.master import Master
from rparm.systems.opened import given_file, opened
from rparm.systems.structure import OpenedSystem

BOUND = 1e-12  # on the largest difference to the master, relative to the variable's largest value


def do_federation(options: argparse.Namespace) -> Ended:
    """Run the variants; compare each with the master that steps all in one process."""
    network.separate_messages()
    path = given_file(next(iter(options.names), None), options.ssp)
    if path != options.ssp:
        options.names.pop(0)
    if path is None:
        folder, _ = comparison.coupling_study()
        path = project.built(folder, ".ssp", "--ssp", options.fmi)
    address = network.free_address() if options.listen is None else options.listen
    network.check_address_is_free(address)
    if options.output:
        check_writable(options.output)
    key()  # a wrong one is refused before anything runs
    with opened(path, version=options.fmi) as system:
        _check_names(system, options)
        console.messages(str(path), system.notes)
        names = options.names or list(system.system.parameters)
        for component in options.elsewhere:
            command = _command(system, names[0], component, address)
            print(f"waiting for: {command}", flush=True)

        def connected() -> None:
            if options.elsewhere:
                print(f"connected: {', '.join(options.elsewhere)}", flush=True)

        console.stage(f"stepping {counted(names, 'variant')} in processes coupled by HELICS")
        table = FederationTable(names, BOUND)
        failed, rows = [], []
        for name in names:
            label, steps = f"{name} by HELICS", system.system.steps
            with Progress(label, steps) as progress:
                record = federation.run(
                    system, name, address, options.elsewhere, options.silence, progress, connected
                )
            difference, master_time = _master(system, name, record)
            ecos_time = math.nan
            if not ecos.unsuited(system):
                ecos_time = ecos.run(system, name, comparison.recorded(system)).wall_time
            passed = difference <= BOUND
            seconds = {"helics": record.wall_time, "ecos": ecos_time, "master": master_time}
            times = {by: 1e6 * s / steps for by, s in seconds.items()}
            table.row(name, steps, difference, list(times.values()), passed)
            if options.output:
                path = options.output / f"{name}.csv"
                with written(path):
                    path.parent.mkdir(parents=True, exist_ok=True)
                    files.write_trajectory(path, record.times, record.names, record.values)
            row = {"name": name, "steps": steps, "difference": difference, "bound": BOUND}
            known = {by: us for by, us in times.items() if math.isfinite(us)}
            rows.append({**row, "microseconds_per_step": known, "passed": passed})
            failed += [] if passed else [name]
    keep = f"values: {from_here(options.output)}" if options.output else "--output DIR keeps values"
    verdict = f"{console.verdict_line(failed, names, 'variant')}; {keep}"
    return Ended(1 if failed else 0, verdict, {"variants": rows})


def _command(system: OpenedSystem, variant: str, component: str, address: str) -> str:
    """Write the command that steps a component in the project's folder of another machine."""
    place = project.from_root(system.path)
    arguments = federation.arguments(place, variant, component, address, system.version)
    return f"{KEY}={key()} {project.PROGRAM} {shlex.join(arguments)}"


def _check_names(system: OpenedSystem, options: argparse.Namespace) -> None:
    for name in options.names:
        system.variant(name)
    for name in options.elsewhere:
        if name not in system.models:
            known = hint(name, system.models, "there are")
            raise UserError(f"{system.path}: has no component {name!r}{known}")
    if options.elsewhere and len(options.names) != 1:
        raise UserError("--elsewhere: name one variant, which the other machine steps too")


def _master(system: OpenedSystem, variant: str, record: Record) -> tuple[float, float]:
    """Compare with the Jacobi master: return the largest relative difference, and its time, s."""
    signals = system.system.inputs
    with (
        system.unpacked_fmus() as fmus,
        Master(fmus, real_connections(system), signals=signals) as master,
    ):
        times = system.system.times
        master.initialize(times[0], times[-1], system.system.parameter_sets[variant])
        begin = time.perf_counter()
        rows = master.run(times)
        seconds = time.perf_counter() - begin
    columns = [master.names.index(name) for name in record.names]
    expected = rows[:, columns]
    scale = np.maximum(np.abs(expected).max(axis=0), np.finfo(float).tiny)
    return float((np.abs(record.values - expected) / scale).max()), seconds


def do_federate(options: argparse.Namespace) -> Ended:
    network.separate_messages()
    network.check_address(options.broker)
    network.check_host_has_address()
    if KEY not in os.environ:
        raise UserError(f"{KEY}: not in the environment, copy the whole line of the federation")
    key()
    with opened(options.ssp, version=options.fmi) as system:
        made = parts(system, options.variant)
        if options.component not in made:
            known = hint(options.component, made, "there are")
            raise UserError(f"{options.ssp}: has no component {options.component!r}{known}")
        with system.unpacked_fmu(options.component) as fmu:
            if not options.owned:
                network.wait_for_listener(
                    options.broker,
                    options.silence,
                    lambda: print(f"waiting for a federation at {options.broker}", flush=True),
                )
            is_gone = component.end_of_input().is_set if options.owned else lambda: False
            component.run_component(
                made[options.component], fmu, options.broker, options.silence, is_gone
            )
    return Ended(0, "", {"component": options.component})
