"""Rows of a campaign are those of a plain loop in C, bit by bit."""

from pathlib import Path

import numpy as np
import pytest

from rparm.campaign import bases, planning
from rparm.campaign.planning import Points
from rparm.campaign.runs import Runner, open_fmus
from tests.campaign.files import campaign
from tests.campaign.rate.c_loop import CLoop
from tests.campaign.rate.works import WORKS

RUNS = 6


@pytest.mark.parametrize("work", WORKS)
def test_rows_are_those_of_a_loop_in_c(work: str, tmp_path: Path) -> None:
    given = campaign(tmp_path, WORKS[work].format(runs=RUNS))
    with bases.opened(given, None) as base, open_fmus(base.archives, tmp_path) as fmus:
        job = planning.plan(given, base, work)
        points = Points(given, planning.constants(given, base))
        targets = points.targets(points.of(range(RUNS)), job)
        with Runner(job, fmus) as runner:
            rows = runner.rows(range(RUNS), targets)
        loop = CLoop(job, fmus, targets, tmp_path / "c")
        loop.run(RUNS, 2)
    assert rows.failures == [""] * RUNS
    last_and_largest = loop.last_and_largest()
    compared = 0
    for measure, column in zip(job.measures, rows.measures.T, strict=True):
        if measure.kind in ("final", "maximum"):
            place = job.watched.index(measure.variables[0])
            expected = last_and_largest[:, ("final", "maximum").index(measure.kind), place]
            assert np.array_equal(column, expected), measure.column
            compared += 1
    assert compared >= 2
