"""JSON Schemas (draft 2020-12) of the files that users write: editors complete and check by them.

What a schema cannot say, such as which variables a model has, is left to those who read the files.
"""

import json
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from rparm import project
from rparm.building import NEEDED
from rparm.errors import UserError, one_line
from rparm.files import write_text, written
from rparm.fmi.model import INITIAL, INPUTS, PARAMETERS
from rparm.runs import scenario
from rparm.runs.inputs import BESIDE, CONSTANT, FILE, MEASURED, SINE, SINES, TABLE
from rparm.systems import loop_file
from rparm.units import NUMBER

Schema = dict[str, Any]
DIALECT = "https://json-schema.org/draft/2020-12/schema"
TEXT = {"type": "string", "pattern": r"\S"}
WITH_UNIT = rf"^\s*{NUMBER}[ \t]*([^\s\d.,+-]|1/)"
QUANTITY = {"anyOf": [{"type": "number"}, {"type": "string", "pattern": WITH_UNIT}]}


def text(kind: str) -> str:
    """Return the schema of a kind of files, one of `KINDS`; UserError if packages are missing."""
    return f"{json.dumps(KINDS[kind](), indent=2)}\n"


def write(file: Path, schema: str) -> Path:
    """Write a schema's text, in place of an older one; UserError if that fails."""
    with written(file):
        write_text(file, schema)
    return file


def _of_models() -> Schema:
    project.check_installed(NEEDED, "build")
    command = [sys.executable, project.model_builder().with_name("equations_schema.py")]
    pipes = {"stdin": subprocess.DEVNULL, "capture_output": True, "encoding": "utf-8"}
    ended = subprocess.run(command, env=project.child_environment(), check=False, **pipes)
    if ended.returncode:
        raise UserError(f"{command[1]}: {one_line(ended.stderr.strip().splitlines()[-1])}")
    return json.loads(ended.stdout)


def _of_campaigns() -> Schema:
    project.check_installed(["pydantic"], "campaign")
    from rparm.campaign.campaign_file import Campaign

    return {"$schema": DIALECT} | _without_null(Campaign.model_json_schema())


def _without_null(found: Any) -> Any:
    """Leave out null, which TOML has not: keys without a value are left out."""
    if isinstance(found, list):
        return [_without_null(item) for item in found if item != {"type": "null"}]
    if not isinstance(found, dict):
        return found
    return {key: _without_null(value) for key, value in found.items() if value is not None}


def _input() -> Schema:
    signal = {"anyOf": [*QUANTITY["anyOf"], {"type": "boolean"}]}
    row = {"type": "array", "prefixItems": [QUANTITY, signal], "minItems": 2, "maxItems": 2}
    shapes = {CONSTANT: signal, TABLE: _list(row), FILE: TEXT}
    shapes[SINES] = _list(_table(dict.fromkeys((*SINE[0], *SINE[1]), QUANTITY), SINE[0]))
    beside = dict.fromkeys(BESIDE, QUANTITY) | dict.fromkeys(("column", "time"), TEXT)
    beside["hold"] = {"type": "boolean"}
    one = {"oneOf": [{"required": [shape]} for shape in shapes]}
    one |= {"dependentRequired": {key: [shape] for key, shape in BESIDE.items()}}
    return _table(shapes | beside) | one


def _of_scenarios() -> Schema:
    given = _input()["properties"]
    of_file = {key: given[key] for key, shape in BESIDE.items() if shape == FILE}
    length = {"if": {"type": "number"}, "then": {"exclusiveMinimum": 0}} | QUANTITY
    times = dict.fromkeys(scenario.TIMES, QUANTITY) | {"step": {"anyOf": [length, _list(length)]}}
    keys = {
        **dict.fromkeys(("title", "description", scenario.MODEL, scenario.FMU), TEXT),
        "tolerance": {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1},
        "reference_every": {"type": "integer", "minimum": 1},
        "panels": _list(_list({"type": "string"})),
        "time": _table(times, scenario.TIMES),
        **dict.fromkeys((PARAMETERS, INITIAL), _by_name({"type": ["number", "string", "boolean"]})),
        INPUTS: _by_name(_input()),
        MEASURED: _by_name(_table({FILE: TEXT} | of_file, [FILE])),
    }
    known = {key: keys[key] for key in (*scenario.REQUIRED, *scenario.OPTIONAL)}
    both = {"not": {"required": [scenario.MODEL, scenario.FMU]}}
    return {"$schema": DIALECT, "title": "Scenario"} | _table(known, scenario.REQUIRED) | both


def _of_loops() -> Schema:
    def of_variables(entry: Schema) -> Schema:
        """By component.variable, or in a table by component."""
        return _by_name({"anyOf": [entry, _by_name(entry)]})

    value = {"type": ["number", "string", "boolean", "array"]}
    times = dict.fromkeys(loop_file.TIMES, QUANTITY)
    times["step"] = {"if": {"type": "number"}, "then": {"exclusiveMinimum": 0}} | QUANTITY
    keys = {
        "name": {"type": "string", "pattern": f"^{loop_file.NAME.pattern}$"},
        "description": TEXT,
        loop_file.KEEP: _list({"type": "string", "pattern": r"\."}),
        loop_file.COMPONENTS: _by_name(TEXT),
        loop_file.CONNECTIONS: of_variables({"type": "string", "pattern": r"\."}),
        INPUTS: of_variables(_input()),
        PARAMETERS: of_variables(value),
        loop_file.VARIANTS: _by_name(of_variables(value) | {"properties": {"description": TEXT}}),
    }
    head = {"$schema": DIALECT, "title": "System"}
    return head | _table(times | keys, loop_file.REQUIRED)


def _list(item: Schema) -> Schema:
    return {"type": "array", "items": item, "minItems": 1}


def _table(properties: Schema, required: Iterable[str] = ()) -> Schema:
    found = {"type": "object", "properties": properties, "additionalProperties": False}
    return found | {"required": [*required]}


def _by_name(entry: Schema) -> Schema:
    return {"type": "object", "additionalProperties": entry}


KINDS: dict[str, Callable[[], Schema]] = {
    "model": _of_models, "scenario": _of_scenarios, "campaign": _of_campaigns, "loop": _of_loops,
}  # fmt: skip
