"""`campaign`: run a scenario or a system many times, over parameters."""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rparm import console, project
from rparm.command_line import Ended, retyped
from rparm.console import Progress
from rparm.errors import UserError, one_line
from rparm.files import from_here, written
from rparm.interruption import arrived
from rparm.report import overview
from rparm.report.overview import RAN, Entry, sparkline
from rparm.runs.scenario import title

if TYPE_CHECKING:
    from distributed import Security

    from rparm.campaign.work import Work

NEEDED = ("SALib", "cryptography", "distributed", "pyarrow", "scipy")


def do_campaign(options: argparse.Namespace) -> Ended:
    """Run the missing runs of the campaign; 0 when all are there, failed ones among them."""
    if options.list:
        found = [
            {"name": name, "title": title(path)} for name, path in project.campaign_files().items()
        ]
        return Ended(0, console.titles(found), {"campaigns": found})
    if options.file is None:
        raise UserError("expected the file of a campaign, or a name (--help explains)")
    file = project.campaign_file(options.file)
    project.check_installed(NEEDED, "campaign")
    # imported here, as its packages may not be installed
    from rparm.campaign import page, planning, work

    security = _security(options)

    def ask(questions: Sequence[str]) -> None:
        console.messages(f"warning: {file}", questions)

    with work.opened(file, options.fmu, options.output, ask) as made:
        campaign, results, folder = made.campaign, made.results, made.results.folder
        if options.replay is not None:
            results.check()
            again = f"{_command(options)} --replay {options.replay}"
            one = work.replay(campaign, made.base, made.points, options.replay, folder, again)
            print(*one.lines, sep="\n")
            verdict = (
                f"failed: {one.failure}" if one.failure else f"completed: run {options.replay}"
            )
            return Ended(1 if one.failure else 0, verdict, one.document, page=one.page)
        _run_missing(options, security, made)
        failed = results.failed()
        digest = results.digest()
        print(f"table: {digest}")
        document = {"runs": campaign.count, "failed": failed, "table": digest}
        document["results"] = folder.absolute()
        verdict = f"complete: {campaign.count} runs" + (f", {failed} of them failed" * bool(failed))
        if campaign.count > page.MOST:
            print(f"results: {from_here(folder)}, no page of more than {page.MOST} runs")
            return Ended(0, verdict, document)
        units = planning.units(campaign, made.base, made.job.measures)
        try:
            with written(folder):
                index = page.Page(campaign, made.job, results, units, _command(options)).write(
                    digest
                )
                _record(file.stem, made, index, _command(options), failed)
        except UserError:
            raise
        except Exception as error:  # the libraries that draw raise what they like
            raise UserError(
                f"{folder}: the page cannot be written: {type(error).__name__}: {one_line(error)}; "
                "the results are complete"
            ) from error
    return Ended(0, verdict, {**document, "page": index.absolute()}, page=index)


def _record(name: str, made: "Work", page: Path, command: str, failed: int) -> None:
    """Put the campaign on the start page, with the distribution of its first result."""
    count, kept = made.campaign.count, made.job.measures[0].column
    values = np.sort(made.results.table([kept])[kept])
    entry = Entry(
        name, f"{made.campaign.title}: {count} runs" + f", {failed} failed" * bool(failed),
        made.base.path.stem, page.name, RAN, command=command, line_of=f"distribution of {kept}",
        line=sparkline(values, np.arange(count)), line_text=f"Runs with a smaller {kept}",
    )  # fmt: skip
    report = project.results_folder(page.parent)
    overview.record(report, overview.CAMPAIGNS, [entry], page.parent)


def _security(options: argparse.Namespace) -> "Security | None":
    """Read certificates for a scheduler elsewhere; refuse options of another kind of cluster."""
    certificates = options.tls_ca, options.tls_cert, options.tls_key
    if options.scheduler is None:
        if any(path is not None for path in certificates):
            raise UserError("--tls-ca, --tls-cert, --tls-key: are for a --scheduler")
        return None
    if options.no_dashboard:
        raise UserError(
            "--no-dashboard: a --scheduler has its own dashboard: switch it off where it starts"
        )
    from rparm.campaign import engine  # takes long

    return engine.security_for(options.scheduler, *certificates)


def _command(options: argparse.Namespace) -> str:
    path = Path(options.file)
    file = path if project.campaign_file(path) == path else options.file
    return retyped("campaign", [file], {"fmu": options.fmu, "output": options.output})


def _run_missing(options: argparse.Namespace, security: "Security | None", made: "Work") -> None:
    blocks = made.begin()
    if not blocks:
        return
    from rparm.campaign import engine  # takes long

    campaign, count = made.campaign, made.campaign.count
    ahead = sum(len(campaign.block_range(block)) for block in blocks)
    console.stage("starting workers" if options.scheduler is None else "calling the scheduler")
    if ahead < count:
        print(f"resumes: {count - ahead} of {count} runs are there")
    try:
        with (
            made.results.workers_folder() as files,
            engine.opened_cluster(
                options.scheduler, options.workers, files, security, not options.no_dashboard
            ) as client,
        ):
            if not options.no_dashboard:
                print(f"dashboard: {client.dashboard_link}", flush=True)
            begin = time.perf_counter()
            with Progress(campaign.title, ahead, "runs") as progress:
                made.run(client, blocks, progress)
            seconds = time.perf_counter() - begin
    except BaseException:  # Dask may turn a signal's exception into another one
        if arrived():
            print(f"stopped; {engine.RESUMES}", file=sys.stderr)
        raise
    print(f"{ahead} runs in {seconds:.1f} s: {ahead / seconds:.1f} runs/s")
