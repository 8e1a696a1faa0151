"""What a campaign's table says: quantiles, worst cases, failures, Sobol' indices."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from SALib.analyze import sobol

from rparm.campaign.campaign_file import Campaign
from rparm.campaign.sampling import problem

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
WORST = 10  # runs that are listed
RESAMPLES = 1000  # of the bootstrap
CONFIDENCE = 0.95
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\.?\d[\d.]*(?:[eE][-+]?\d+)?|(?:inf|nan)\b)")


@dataclass(frozen=True)
class Failure:
    """Runs that have failed for the same reason, whatever numbers it has."""

    reason: str  # of the first one
    count: int
    run: int  # the first one


@dataclass(frozen=True)
class Index:
    """Sobol' indices of a parameter, with half the width of their confidence intervals."""

    parameter: str
    first: float
    first_confidence: float
    total: float
    total_confidence: float


def quantiles(values: np.ndarray) -> list[float]:
    """Quantiles of the numbers in `values`, (runs,); NaN if there are none."""
    numbers = values[np.isfinite(values)]
    return np.quantile(numbers, QUANTILES).tolist() if len(numbers) else [np.nan] * len(QUANTILES)


def worst(values: np.ndarray) -> list[int]:
    """Numbers of the runs with the largest of `values`, (runs,), the largest first."""
    numbers = np.flatnonzero(np.isfinite(values))
    order = np.argsort(-values[numbers], kind="stable")
    return numbers[order[:WORST]].tolist()


def failures(reasons: Iterable[str]) -> list[Failure]:
    """Reasons of the runs that failed, the most frequent first."""
    counts: Counter[str] = Counter()
    firsts: dict[str, tuple[str, int]] = {}
    for run, reason in enumerate(reasons):
        if reason:
            kind = NUMBER.sub("0", reason)
            counts[kind] += 1
            firsts.setdefault(kind, (reason, run))
    ordered = ((firsts[kind], count) for kind, count in counts.most_common())
    return [Failure(reason, count, run) for (reason, run), count in ordered]


def groups(campaign: Campaign, values: np.ndarray) -> np.ndarray:
    """Rows of runs (groups, parameters + 2) that belong together, without incomplete ones."""
    rows = values.reshape(-1, len(campaign.parameters) + 2)
    return rows[np.isfinite(rows).all(axis=1)]


def indices(campaign: Campaign, values: np.ndarray) -> list[Index]:
    """First-order and total Sobol' indices of `values`, (runs,); none if too few runs have any."""
    rows = groups(campaign, values)
    if len(rows) < 2 or np.ptp(rows) == 0:
        return []
    found: Mapping[str, np.ndarray] = sobol.analyze(
        problem(campaign),
        rows.ravel(),
        calc_second_order=False,
        num_resamples=RESAMPLES,
        conf_level=CONFIDENCE,
        seed=campaign.seed,
    )
    rows = np.column_stack([found[key] for key in ("S1", "S1_conf", "ST", "ST_conf")])
    return [Index(name, *row) for name, row in zip(campaign.parameters, rows.tolist(), strict=True)]
