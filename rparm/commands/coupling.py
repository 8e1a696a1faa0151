"""`coupling`: the study of what the coupling of a system costs, which its folder has."""

import argparse

from rparm import console, project
from rparm.command_line import Ended
from rparm.command_line.options import add_report, add_system
from rparm.files import check_writable
from rparm.linearization import largest_step
from rparm.systems import comparison

DESCRIPTION = (
    "Steps the system in several orders, with inputs held and extrapolated and with step-size "
    "control, and compares it with the solution in continuous time; predicts and measures the "
    "largest stable steps of each system."
)


def add_options(parser: argparse.ArgumentParser) -> None:
    add_system(parser)
    add_report(parser, "system")


def run(options: argparse.Namespace) -> Ended:
    folder, known = comparison.coupling_study()
    path = options.ssp or project.built(folder, ".ssp", "--ssp", options.fmi)
    check_writable(options.report)
    console.stage(f"studying the coupling of {folder.name}")
    parts = known.study_coupling(path, options.report)
    for other, rest in comparison.rests().items():
        if other != folder and not options.ssp:
            ssp = project.built(other, ".ssp", version=options.fmi)
            parts[f"largest steps of {other.name}"] = largest_step.study_steps(ssp, rest)
    failed = [name for name, part in parts.items() if not part["passed"]]
    picture = (options.report / known.COUPLING_PICTURE).absolute()
    verdict = console.verdict_line(failed, parts, "part")
    document = {"parts": parts, "picture": picture}
    return Ended(1 if failed else 0, verdict, document, page=picture)
