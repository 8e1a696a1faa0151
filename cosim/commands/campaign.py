"""`campaign`: run a scenario or a system many times, over parameters."""

import argparse
import shlex
import sys
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from cosim import project
from cosim.errors import UserError, one_line
from cosim.interruption import arrived
from cosim.output_files import from_here, written
from cosim.progress import Progress

if TYPE_CHECKING:
    from cosim.campaign.bases import Base
    from cosim.campaign.campaign_file import Campaign
    from cosim.campaign.job import Job
    from cosim.campaign.points import Points
    from cosim.campaign.results import Results

NEEDED = ("SALib", "distributed", "numba", "pyarrow", "scipy")


def run(options: argparse.Namespace) -> int:
    """Run what is missing of the campaign; 0 when all runs are there, failed ones among them."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise UserError(f"{', '.join(missing)}: not installed, ./setup.sh --campaign does it")
    # imported here: what a campaign needs may not be installed
    from cosim.campaign import bases, campaign_file, page, planning, replay, runs
    from cosim.campaign.points import Points
    from cosim.campaign.results import Results

    campaign = campaign_file.read(options.file)
    with bases.opened(campaign, options.fmu, options.file) as base:
        job = planning.plan(campaign, base, options.file)
        points = Points(campaign, planning.constants(campaign, base))
        folder = _folder(options, campaign)
        text = Path(options.file).read_text(encoding="utf-8")
        results = Results(folder, campaign, job, text)
        if options.replay is not None:
            results.check()
            again = f"{_command(options)} --replay {options.replay}"
            lines, ended = replay.replay(campaign, base, points, options.replay, folder, again)
            print(*lines, sep="\n")
            return 0 if ended else 1
        runs.check(job, base.archives, base.path)
        results.begin()
        _run_missing(options, _Plan(campaign, base, job, points, results))
        failed = results.failed()
        if failed:
            print(f"failed: {failed} of {campaign.count} runs")
        digest = results.digest()
        print(f"table: {digest}")
        if campaign.count > page.MOST:
            print(f"results: {from_here(folder)}, no page of more than {page.MOST} runs")
            return 0
        units = planning.units(campaign, base, job.measures)
        try:
            with written(folder):
                index = page.write(campaign, job, results, units, _command(options), digest)
        except UserError:
            raise
        except Exception as error:  # the libraries that draw raise what they like
            raise UserError(
                f"{folder}: the page cannot be written: {type(error).__name__}: {one_line(error)}; "
                "the results are complete"
            ) from error
    print(f"page: {from_here(index)}")
    return 0


def _command(options: argparse.Namespace) -> str:
    """What to type for the campaign, in the project's folder."""
    parts = ["./run.sh", "campaign", str(project.from_root(options.file))]
    for name in ("fmu", "output"):
        value = getattr(options, name)
        parts += [] if value is None else [f"--{name}", str(project.from_root(value))]
    return shlex.join(parts)


def _folder(options: argparse.Namespace, campaign: "Campaign") -> Path:
    if options.output is not None:
        return options.output
    if campaign.output is not None:
        return options.file.parent / campaign.output
    return project.ROOT / "build" / "campaigns" / options.file.stem


@dataclass(frozen=True)
class _Plan:
    """A campaign that is ready to run."""

    campaign: "Campaign"
    base: "Base"
    job: "Job"
    points: "Points"
    results: "Results"


def _run_missing(options: argparse.Namespace, plan: _Plan) -> None:
    """Run the blocks whose results are not there."""
    blocks = plan.results.missing()
    if not blocks:
        return
    from cosim.campaign import engine  # takes long

    count = plan.campaign.count
    ahead = sum(len(plan.campaign.block_range(block)) for block in blocks)
    if ahead < count:
        print(f"goes on: {count - ahead} of {count} runs are there")
    try:
        with (
            plan.results.workers_folder() as files,
            engine.cluster(options.scheduler, options.workers, files) as client,
        ):
            print(f"dashboard: {client.dashboard_link}", flush=True)
            made = engine.Engine(
                client, plan.campaign, plan.job, plan.base.archives, plan.points, plan.results
            )
            begin = time.perf_counter()
            with Progress(plan.campaign.title, ahead, "runs") as progress:
                made.run(blocks, progress)
            seconds = time.perf_counter() - begin
    except BaseException:  # Dask may turn that of a signal into another one
        if arrived():
            print(f"stopped; {engine.GOES_ON}", file=sys.stderr)
        raise
    print(f"{ahead} runs in {seconds:.1f} s: {ahead / seconds:.1f} runs/s")
