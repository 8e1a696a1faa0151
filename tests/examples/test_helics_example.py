"""The example of HELICS, in processes of their own: at its end, HELICS may wait for ever."""

import re
from pathlib import Path

import pytest

from tests.examples.scripts import printed, python

FAILING = """
import sys
from examples import helics_federate

def fail(*arguments):
    raise ValueError("this one fails")

if sys.argv[1] == "arm":
    helics_federate.Arm.step = fail
else:
    helics_federate.control = fail
helics_federate.in_federation()
"""


def test_the_federate_has_the_bits_of_a_plain_loop(tmp_path: Path) -> None:
    end, difference = printed("helics_federate.py", tmp_path)
    reached = [float(number) for number in re.findall(r"= (\S+)", end)]
    assert reached == pytest.approx([0.5, 0.1], abs=1e-3)  # the controller's goal
    assert difference == "largest difference from a plain loop: 0"


@pytest.mark.parametrize("who", ["arm", "controller"])
def test_no_federate_waits_for_one_that_failed(who: str, tmp_path: Path) -> None:
    ran = python(tmp_path, "-c", FAILING, who)
    assert ran.returncode == 1
    assert ran.stderr.splitlines()[-1] == "ValueError: this one fails"
