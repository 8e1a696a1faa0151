"""`federate`: step one component of a system in a federation that runs elsewhere."""

import argparse

from cosim.errors import UserError, did_you_mean
from cosim.federation import addresses, component, watching
from cosim.federation.parts import parts
from cosim.fmu_file import Fmu
from cosim.system import ssp


def run(options: argparse.Namespace) -> int:
    """Step the component to the end."""
    addresses.check_form(options.broker)
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
            if not options.owned:
                addresses.wait_for(
                    options.broker,
                    options.silence,
                    lambda: print(f"waiting for a federation at {options.broker}", flush=True),
                )
            is_gone = watching.end_of_input().is_set if options.owned else lambda: False
            component.run(made[options.component], fmu, options.broker, options.silence, is_gone)
    return 0
