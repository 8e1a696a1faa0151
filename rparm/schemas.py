"""JSON Schemas (draft 2020-12) of the files that users write: editors complete and check by them.

What a schema cannot say, such as which variables a model has, is left to those who read the files.
"""

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from rparm import project
from rparm.building import NEEDED
from rparm.errors import UserError, one_line
from rparm.files import write_text, written

Schema = dict[str, Any]
DIALECT = "https://json-schema.org/draft/2020-12/schema"
TEMPLATES = Path(__file__).with_name("templates")


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


def _of_file(name: str) -> Schema:
    """Read a schema, and what both have of values."""
    schema = json.loads((TEMPLATES / f"{name}.schema.json").read_text(encoding="utf-8"))
    shared = json.loads((TEMPLATES / "values.schema.json").read_text(encoding="utf-8"))
    return schema | {"$defs": shared | schema["$defs"]}


KINDS: dict[str, Callable[[], Schema]] = {
    "model": _of_models, "scenario": partial(_of_file, "scenario"), "campaign": _of_campaigns,
    "loop": partial(_of_file, "loop"), "estimator": partial(_of_file, "estimator"),
}  # fmt: skip
