"""`federate`: step one component of a system in a federation that runs elsewhere."""

import argparse

from cosim.errors import UserError, did_you_mean
from cosim.federation import component
from cosim.federation.parts import parts
from cosim.fmu_file import Fmu
from cosim.system import ssp


def run(options: argparse.Namespace) -> int:
    """Step the component to the end."""
    with ssp.unpacked(options.ssp) as system:
        made = parts(system, options.variant)
        if options.component not in made:
            hint = did_you_mean(options.component, made)
            raise UserError(
                f"{options.ssp}: has no component {options.component!r}{hint} (there are: "
                f"{', '.join(made)})"
            )
        with Fmu(system.fmu(options.component)) as fmu:
            fmu.path = options.ssp / system.system.component(options.component).source
            component.run(made[options.component], fmu, options.broker)
    return 0
