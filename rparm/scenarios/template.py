"""A scenario of a model to start from: all that can be set, with its meaning, as comments."""

import json
import math
import textwrap
from collections.abc import Iterator

from rparm.fmi.model import INITIAL, INPUTS, PARAMETERS, Model, Value, Variable
from rparm.project import PROGRAM

WIDTH = 100

HEAD = """\
# A scenario. Run it by {program} FILE.toml. Numbers are in SI units; in quotation marks a value may
# have another one: "90 deg", "300 mm", "2kN".
# "# name = value" is a start value as it is: remove the "# " to change it.
{key} = {model}
title = {title}
description = "What happens, in a sentence or two."
tolerance = 1e-8  # of the integrator, relative: between 0 and 1

# Results have every k-th communication point:
# reference_every = 5
{panels}
[time]
start = 0.0  # s
stop = 2.0  # s
step = 0.01  # s; or a pattern that is repeated until stop: [0.01, 0.002]
"""
INPUT_HELP = """\
# An input is one of
#   constant = 1.5
#   table = [[0.0, 0.0], [1.0, 1.5]]  # [time in s from start, value], linear in between
#   sines = [{ amplitude = 1.5, frequency = 0.5, phase = 0.0 }]  # Hz, rad; `offset = 1.0` beside it
#   file = "log.csv"  # of measurements, beside this file; `column = "tau"`, `time = "t"`,
#                     # `scale = "1 kN"`, `begin = 1.5`, `hold = true` beside it
# What was measured of an output is compared with it: [measured.NAME], with the keys of a file.
# A Boolean one is `constant = true`, or a table that holds from each time on. An input that is not
# here has its start value.
"""


def text(name: str, key: str, subject: str, model: Model) -> str:
    """Content of the file, which runs as it is.

    The `key` is `model`, with its folder below models/, or `fmu`, with the path of an FMU from the
    file.
    """
    outputs = model.real_outputs[:2]
    panels = "# Further plots, each of variables of one unit:\n"
    panels += f"# panels = {json.dumps([[output] for output in outputs])}\n"
    given = {"key": key, "model": quoted(subject), "title": quoted(name), "panels": panels}
    parts = [HEAD.format(program=PROGRAM, **given)]
    parts += _values(PARAMETERS, "Parameters.", model)
    parts += _values(INITIAL, "State at the start.", model)
    inputs = [variable for variable in model.variables.values() if variable.is_a(INPUTS)]
    if inputs:
        parts.append(INPUT_HELP + "\n".join(_input(variable) for variable in inputs))
    return "\n".join(parts)


def quoted(content: str) -> str:
    """A text as TOML writes it."""
    return json.dumps(content, ensure_ascii=False)


def _values(section: str, title: str, model: Model) -> Iterator[str]:
    """A section with the start value of each variable in a comment."""
    known = [
        variable
        for variable in model.variables.values()
        if variable.is_a(section) and variable.start is not None and variable.type != "String"
    ]
    if known:
        lines = [f"{_comment(variable)}\n# {_line(variable)}" for variable in known]
        yield f"# {title}\n[{section}]\n" + "\n".join(lines) + "\n"


def _line(variable: Variable) -> str:
    assert variable.start is not None
    line = f"{variable.name} = {_literal(variable.written(variable.start))}"
    return f"{line}  # {variable.unit}" if variable.unit not in (None, "", "1") else line


def _comment(variable: Variable) -> str:
    """Meaning and limits of a variable, above its line, set off from what may be uncommented."""
    limits = []
    if math.isfinite(variable.least) and variable.type == "Real":
        limits.append(f"at least {variable.least:g}")
    if math.isfinite(variable.greatest) and variable.type == "Real":
        limits.append(f"at most {variable.greatest:g}")
    if variable.items:
        limits.append("one of " + ", ".join(map(quoted, variable.items)))
    meaning = "; ".join([" ".join(variable.description.split()) or variable.name, *limits])
    return textwrap.fill(meaning, WIDTH, initial_indent="#   ", subsequent_indent="#   ")


def _literal(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return quoted(value) if isinstance(value, str) else repr(value)


def _input(variable: Variable) -> str:
    start = variable.start if variable.start is not None else 0.0
    unit = f"  # {variable.unit}" if variable.unit else ""
    header = f"[{INPUTS}.{variable.name}]\nconstant = {_literal(start)}{unit}\n"
    if variable.type not in ("Real", "Boolean"):
        return ""
    return f"{_comment(variable)}\n{header}"
