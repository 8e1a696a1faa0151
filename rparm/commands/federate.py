"""`federate`: step one component of a system in a federation that runs elsewhere."""

import argparse
import os
from pathlib import Path

from rparm.command_line import Ended
from rparm.command_line.options import add_document, add_silence
from rparm.errors import UserError, hint
from rparm.federation import SILENCE, component, network
from rparm.federation.component import parts
from rparm.federation.network import KEY, key
from rparm.systems import ssp

DESCRIPTION = "Steps one component of a system until the federation has come to the end."


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("ssp", type=Path, metavar="SSP", help="the system")
    parser.add_argument("variant", metavar="VARIANT")
    parser.add_argument("component", metavar="COMPONENT")
    parser.add_argument(
        "--broker", required=True, metavar="ADDRESS", help="of the federation, as --listen there"
    )
    text = "most that a call of the FMU may take, or the broker be silent"
    add_silence(parser, SILENCE, text)
    add_document(parser)
    # for processes that a federation starts: they end with their standard input
    parser.add_argument("--owned", action="store_true", help=argparse.SUPPRESS)


def run(options: argparse.Namespace) -> Ended:
    network.separate_messages()
    network.check_address(options.broker)
    network.check_host_has_address()
    if KEY not in os.environ:
        raise UserError(f"{KEY}: not in the environment, copy the whole line of the federation")
    key()
    with ssp.unpacked(options.ssp) as system:
        made = parts(system, options.variant)
        if options.component not in made:
            known = hint(options.component, made, "there are")
            raise UserError(f"{options.ssp}: has no component {options.component!r}{known}")
        with system.unpacked_fmu(options.component) as fmu:
            if not options.owned:
                network.wait_for_listener(
                    options.broker,
                    options.silence,
                    lambda: print(f"waiting for a federation at {options.broker}", flush=True),
                )
            is_gone = component.end_of_input().is_set if options.owned else lambda: False
            component.run_component(
                made[options.component], fmu, options.broker, options.silence, is_gone
            )
    return Ended(0, "", {"component": options.component})
