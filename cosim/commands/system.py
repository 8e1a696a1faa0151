"""`system`: run the variants of a system in Ecos, compare them with references, write a report."""

import argparse
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from cosim import console, project
from cosim.errors import UserError
from cosim.output_files import from_here, written
from cosim.system import comparison, report, ssp, study
from cosim.system.comparison import Reference
from cosim.system.ssp import Ssp
from cosim.system.study import Study


def run(options: argparse.Namespace) -> int:
    """Run the variants that the options name, or all; or name them."""
    folder = project.system_folder()
    path = options.ssp or project.built(folder, ".ssp", "--ssp", options.fmi)
    with ExitStack() as stack:
        try:
            unpacked = stack.enter_context(ssp.unpacked(path))
        except UserError:
            if not options.list:
                # if the system cannot be run, older results must not pass for new ones
                with written(options.report):
                    report.remove(options.report, comparison.reference_names(folder))
            raise
        chosen = comparison.choose(unpacked, options.names)
        if options.list:
            print(*chosen, sep="\n")
            return 0
        known = study.load(folder)
        with written(options.report):
            report.remove(options.report, chosen)
        references = {
            name: comparison.load_reference(unpacked, name, folder, known.EXPERIMENT)
            for name in chosen
        }
        return _run(unpacked, known, references, options.report)


def _run(opened: Ssp, known: Study, references: Mapping[str, Reference], folder: Path) -> int:
    """Run variants; a row appears as one ends, and its files are written then."""
    table = console.VariantTable(references, known.MEASURES)
    outcomes = []
    for name, reference in references.items():
        outcome = comparison.simulate(opened, name, reference)
        table.row(outcome)
        console.messages(name, outcome.run.messages)
        with written(folder):
            report.write_variant(folder, known.figure(opened, outcome), outcome)
        outcomes.append(outcome)
    with written(folder):
        index = report.write_page(folder, opened, known, outcomes)
    print(f"\nreport: {from_here(index)}")
    failed = (outcome.variant for outcome in outcomes if not outcome.passed)
    return console.summary(failed, outcomes, "variant")
