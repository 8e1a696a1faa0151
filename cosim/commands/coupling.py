"""`coupling`: the study of what the coupling of a system costs, which its folder has."""

import argparse

from cosim import project
from cosim.output_files import check_writable
from cosim.system import study


def run(options: argparse.Namespace) -> int:
    """Make the study; 0 if everything is as expected."""
    folder, known = study.of_coupling()
    path = options.ssp or project.built(folder, ".ssp", "--ssp", options.fmi)
    check_writable(options.report)
    return 0 if known.study_coupling(path, options.report) else 1
