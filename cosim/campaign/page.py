"""The page of a campaign: distributions, worst cases, Sobol' indices, maps, failures."""

import json
from pathlib import Path

import numpy as np

from cosim.campaign import analysis, figures
from cosim.campaign.campaign_file import Campaign
from cosim.campaign.job import Job
from cosim.campaign.planning import FAILURE
from cosim.campaign.results import MANIFEST, Results
from cosim.report import assets
from cosim.report.pages import INDEX, write_page
from cosim.report.style import save

MOST = 10**7  # runs, whose table is held in memory
DISTRIBUTIONS, INDICES, MAP = "distributions", "indices", "map_{}"


def write(campaign: Campaign, job: Job, results: Results, command: str, digest: str) -> Path:
    """Write the page into the folder of the results; its path. `command` makes it again."""
    folder = results.folder
    table = results.table([*results.columns, FAILURE])
    kept = {measure.column: table[measure.column] for measure in job.measures}
    save(figures.distributions(kept), folder / f"{DISTRIBUTIONS}.png")
    found = _indices(campaign, kept)
    if found:
        save(figures.indices(found), folder / f"{INDICES}.png")
    for i, drawn in enumerate(campaign.maps):
        columns = (table[name] for name in (drawn.x, drawn.y, drawn.colour))
        save(figures.heat_map(drawn, *columns), folder / f"{MAP.format(i)}.png")
    names = [*campaign.parameters]
    reasons = table[FAILURE].tolist()
    assets.write(folder)
    return write_page(
        folder / INDEX,
        "campaign.html",
        root="",
        title=campaign.title,
        campaign=campaign,
        digest=digest,
        command=command,
        manifest=json.loads((folder / MANIFEST).read_text(encoding="utf-8")),
        failed=sum(map(bool, reasons)),
        failures=analysis.failures(reasons),
        quantiles={name: analysis.quantiles(values) for name, values in kept.items()},
        steps=job.steps,
        names=names,
        worst={name: _worst(name, names, table) for name in campaign.worst},
        indices=found,
        left_out=_left_out(campaign, kept),
        distributions=DISTRIBUTIONS,
        indices_picture=INDICES,
        maps=[MAP.format(i) for i in range(len(campaign.maps))],
    )


def _indices(campaign: Campaign, kept: dict[str, np.ndarray]) -> dict[str, list[analysis.Index]]:
    if campaign.sampling != "indices":
        return {}
    found = {name: analysis.indices(campaign, values) for name, values in kept.items()}
    return {name: rows for name, rows in found.items() if rows}


def _left_out(campaign: Campaign, kept: dict[str, np.ndarray]) -> int:
    """Groups of runs that the indices lack, because one of them has failed."""
    if campaign.sampling != "indices":
        return 0
    return campaign.runs - min(len(analysis.groups(campaign, x)) for x in kept.values())


def _worst(
    column: str, names: list[str], table: dict[str, np.ndarray]
) -> list[tuple[int, float, list[float]]]:
    """Number, value and parameters of the worst runs."""
    return [
        (run, float(table[column][run]), [float(table[name][run]) for name in names])
        for run in analysis.worst(table[column])
    ]
