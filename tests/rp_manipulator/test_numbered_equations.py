"""Headers of equations: each equation of the notes is in them once, and they are plain C.

A comment that begins with a number, such as "(4)-(8) Mass matrix", stands above this equation.
"""

import re
import subprocess
from pathlib import Path

import pytest

from tests.support.paths import ROOT

MODELS = ROOT / "models"
ARM = MODELS / "rp_manipulator"
PLANT = MODELS / "rp_plant"

# function: equations of the notes
STATED = {
    "arm_angular_jacobian": [1, 2], "arm_link1_jacobian": [3], "arm_mass_matrix": [4, 5, 6, 7, 8],
    "arm_christoffel": [9], "arm_potential_energy": [10], "arm_gravity_forces": [11],
    "arm_coriolis_matrix": [12], "arm_inverse_dynamics": [13, 14, 15], "link_motion": [16, 17, 18],
    "link2_loads": [19, 20, 24, 25], "link1_loads": [21, 22, 23], "loads_of_motion": [26, 27],
}  # fmt: skip
COMMENT = re.compile(
    r"/\* (\(\d+\)(?:(?:-|, )\(\d+\))*) (?:[^*]|\*(?!/))*\*/\nstatic inline [^(]*?(\w+)\("
)


def numbers(text: str) -> list[int]:
    """Numbers of "(4)-(8)" or "(21)-(23), (27)"."""
    found = []
    for part in text.replace("(", "").replace(")", "").split(", "):
        first, _, last = part.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


def test_each_equation_of_the_notes_is_stated_once() -> None:
    texts = [(ARM / name).read_text() for name in ("rp_equations.h", "rp_recursion.h")]
    stated = [
        (function, numbers(number)) for text in texts for number, function in COMMENT.findall(text)
    ]
    assert stated == list(STATED.items())
    assert sorted(sum(STATED.values(), [])) == list(range(1, 28))


@pytest.mark.parametrize(
    "header",
    [
        ARM / "rp_equations.h",
        ARM / "rp_recursion.h",
        ARM / "rp_payload.h",
        PLANT / "equations" / "rp_plant_equations.h",
        PLANT / "rp_plant_calculated.h",
        MODELS / "rp_controller" / "rp_controller_law.h",
        MODELS / "rp_actuator" / "rp_actuator_equations.h",
    ],
    ids=lambda header: header.name,
)
def test_equations_compile_as_they_stand(header: Path, tmp_path: Path) -> None:
    source = tmp_path / "equations.c"
    source.write_text(f'#include "{header.name}"\n')
    folders = [MODELS, ARM, PLANT / "equations", header.parent, ROOT / "src" / "model"]
    include = [f"-I{folder}" for folder in folders]
    subprocess.run(
        ["cc", "-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", *include,
         source],
        check=True,
    )  # fmt: skip
