"""The JSON Schemas by which editors complete and check users' files."""

import copy
import json
import random
import re
import tomllib
from collections.abc import Iterator
from functools import cache, reduce
from operator import getitem
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from rparm import schemas
from rparm.runs import inputs, scenario
from rparm.systems import sections
from tests.campaign.test_campaign_file import MISTAKES as OF_CAMPAIGNS
from tests.campaign.test_campaign_file import wrong
from tests.closed_loop.test_loop_file import TABLES as OF_LOOPS
from tests.equations.compiled import ModelFileError, read_text
from tests.equations.examples import MODELS
from tests.equations.test_model_file import EXAMPLES, MISTAKES
from tests.rparm.test_scenario import WRONG as OF_SCENARIOS
from tests.support.paths import ROOT
from tests.support.rparm_project import Console

FILES = {
    "model": [
        *EXAMPLES,
        *ROOT.glob("tests/textbook/*.toml"),
        *(path for path in ROOT.glob("models/*/rp_*.toml") if "lock" not in path.name),
    ],
    "scenario": sorted(ROOT.glob("models/*/scenarios/*.toml")),
    "campaign": sorted(ROOT.glob("models/*/campaigns/*.toml")),
    "loop": [
        *sorted(ROOT.glob("models/*/loop.toml")),
        ROOT / "examples" / "estimator" / "loop.toml",
    ],
    "estimator": [ROOT / "examples" / "estimator" / "observer.toml"],
}
VALUES = (0, -1, 1e999, 1.5, True, "", "x", "1", "a b", [], [1, 2], ["x"], {}, {"x": "1"})
# messages of the mistakes that show without the meaning of texts
OF_MODELS = re.compile(
    r"unknown (key|section)|missing|no variables|Windows|is reserved|in modes already|a control"
    r"|implicit form|none reserved|'\^2'|'a b': expected|line 7|start: expected (a |true)|has more"
    r"|(type|file|nominal = 0|arguments|modes|name|terminate): expected"
    r"|\[(inputs|outputs|where|experiment|events\.('0'|when))\](: \w+)?: expected"
    r"|expected (true or false|set or reinit|a name that is)"
)
OF_OTHERS = re.compile(
    "unknown key|missing key '(title|time|step|frequency)'|expected a (table|text|list|longer list)"
    "|exactly one of|between 0 and 1,|from 1 on, got|more than 0 s|than 0, got|with sines only"
)


@cache
def validator(kind: str) -> Draft202012Validator:
    schema = json.loads(schemas.text(kind))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def is_refused(kind: str, text: str) -> bool:
    """Whether a text is TOML that the schema refuses."""
    try:
        return not validator(kind).is_valid(tomllib.loads(text))
    except ValueError:
        return False


@pytest.mark.parametrize("kind", FILES)
def test_files_of_the_project_are_valid(kind: str) -> None:
    for path in FILES[kind]:
        found = validator(kind).iter_errors(tomllib.loads(path.read_text(encoding="utf-8")))
        assert [f"{path.name}: {error.json_path}: {error.message}" for error in found] == []


@pytest.mark.parametrize(("kind", "reader"), [("scenario", scenario), ("loop", sections)])
def test_keys_are_those_that_the_reader_takes(kind: str, reader: ModuleType) -> None:
    schema = json.loads(schemas.text(kind))
    assert set(schema["properties"]) == {*reader.REQUIRED, *reader.OPTIONAL}
    assert schema["required"] == [*reader.REQUIRED]
    shapes = inputs.CONSTANT, inputs.SINES, inputs.TABLE, inputs.FILE
    assert set(schema["$defs"]["input"]["properties"]) == {*shapes, *inputs.BESIDE}


def test_mistakes_that_show_without_meaning_are_refused(tmp_path: Path) -> None:
    good, of_loops = OF_LOOPS["good"], OF_LOOPS["mistakes"]
    assert not is_refused("loop", good)
    of_campaigns = [
        (wrong(tmp_path, row).read_text(), row[-1]) for row in OF_CAMPAIGNS["arm"]["rows"]
    ]
    for kind, mistakes, said in (
        ("model", MISTAKES, OF_MODELS),
        ("scenario", OF_SCENARIOS, OF_OTHERS),
        ("loop", [(good.replace(old, new), said) for old, new, said in of_loops], OF_OTHERS),
        ("campaign", of_campaigns, OF_OTHERS),
    ):
        shown = [text for text, message in mistakes if said.search(message)]
        assert len(shown) > 8 and [text for text in shown if not is_refused(kind, text)] == []


def places(value: object) -> Iterator[tuple[str | int, ...]]:
    """The keys on the way to each value."""
    pairs = value.items() if isinstance(value, dict) else ()
    for key, inner in enumerate(value) if isinstance(value, list) else pairs:
        yield (key,)
        yield from ((key, *rest) for rest in places(inner))


def value_of_toml(value: object) -> str:
    """A value of TOML: JSON's texts, lists and numbers are the same, but for one character."""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, dict):
        pairs = (f"{value_of_toml(key)} = {value_of_toml(entry)}" for key, entry in value.items())
        return f"{{ {', '.join(pairs)} }}"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def test_what_the_reader_takes_is_valid(tmp_path: Path) -> None:
    """Also with another value, or none, in any place."""
    content, chance = tomllib.loads(MODELS["schema"]["RICH"]), random.Random(1)
    taken = 0
    for place in [(), *chance.choices([*places(content)], k=200)]:
        changed: Any = copy.deepcopy(content)
        if place:
            *above, key = place
            inner = reduce(getitem, above, changed)
            inner[key] = chance.choice(VALUES)
            if chance.random() < 0.2:
                del inner[key]
        text = "".join(f"{json.dumps(key)} = {value_of_toml(x)}\n" for key, x in changed.items())
        try:
            read_text(tmp_path, text)
        except ModelFileError:
            continue
        assert not is_refused("model", text), text
        taken += 1
    assert 10 < taken < 60


def test_the_command_writes_what_a_new_model_names(tmp_path: Path, console: Console) -> None:
    assert console("new-model", "Spring", "--output", tmp_path)[0] == 0
    first = (tmp_path / "Spring.toml").read_text().splitlines()[0]
    written = tmp_path / first.removeprefix("#:schema ./")
    assert written.read_text() == schemas.text("model") == console("schema")[1]
    assert not is_refused("model", (tmp_path / "Spring.toml").read_text())
    written.write_text("of another version")
    assert console("new-model", "Other", "--with", "friction", "--output", tmp_path)[0] == 0
    assert not is_refused("model", (tmp_path / "Other.toml").read_text())
    assert written.read_text() == "of another version"
    assert console("schema", "model", "--output", tmp_path)[0] == 0
    assert written.read_text() == schemas.text("model")
