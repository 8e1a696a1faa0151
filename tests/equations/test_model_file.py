"""Files with equations: what is refused and how, value references, units."""

import random
import re
import time
import tomllib
from dataclasses import asdict
from pathlib import Path, PureWindowsPath
from typing import Any

import pytest

from tests.equations.compiled import (
    Model,
    ModelFileError,
    c_model,
    declaration,
    declared,
    lock,
    read,
    read_text,
)
from tests.equations.examples import MISTAKES as WRITTEN
from tests.equations.examples import MODELS
from tests.support.paths import ROOT
from tests.support.tables import cases

EXAMPLES = [
    path
    for path in sorted((ROOT / "examples" / "models").glob("*.toml"))
    if not path.name.endswith(".lock.toml")
]
HEAD = 'name = "M"\n'
STATE = HEAD + '[states]\nx = { derivative = "-x" }\n'
SAMPLED = STATE + "[discrete]\nu = {}\n[sampled.s]\n"

MISTAKES = [
    *cases(WRITTEN["model_file"]),
    (
        STATE + f'[check]\n"{"ä" * 251}" = "1 > 0"', "expected a message of at most 500 bytes",
    ),
    (HEAD + f"[inputs]\nu = {{ start = {'9' * 5000} }}", "has a number or a table that"),
    (
        STATE + '[functions]\nf0 = { arguments = ["a"], value = "a * a" }\n' + "".join(
            f'f{i} = {{ arguments = ["a"], value = "f{i - 1}(a) + f{i - 1}(a)" }}\n'
            for i in range(1, 40)
        ),
        "functions and sums make more than 100000 operations of this expression",
    ),
    (STATE + f'[where]\na = "{"(" * 200}"', "a: column 102: more than 100 levels"),
    (
        HEAD + "[inputs]\n" + "".join(f"u{i} = {{}}\n" for i in range(1001)), "has more than 1000",
    ),
    ("#" * 1_000_001, "has 1000001 bytes, expected at most 1000000"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), MISTAKES, ids=[f"{e:.60}" for _, e in MISTAKES])
def test_a_mistake_is_one_line_with_its_place(text: str, expected: str, tmp_path: Path) -> None:
    with pytest.raises(ModelFileError) as refused:
        read_text(tmp_path, text)
    message = str(refused.value)
    assert message.startswith(f"{tmp_path / 'model.toml'}: ")
    assert expected in message and "\n" not in message and len(message) < 500


def test_names_are_refused_that_no_file_of_windows_has(tmp_path: Path) -> None:
    """As Python knows them for itself."""
    ports = [f"{port}{number}" for port in ("com", "LPT") for number in range(12)]
    for name in ["con", "PRN", "Aux", "nul", "conout", "null", "auxiliary", "coma", "lpt", *ports]:
        if PureWindowsPath(f"{name}.fmu").is_reserved():
            with pytest.raises(ModelFileError, match="for a device"):
                read_text(tmp_path, STATE.replace("M", name))
        else:
            read_text(tmp_path, STATE.replace("M", name))


def test_a_file_of_an_editor_for_windows_is_read(tmp_path: Path) -> None:
    plain = read_text(tmp_path, STATE)
    other = read_text(tmp_path, "\ufeff" + STATE.replace("\n", "\r\n"))
    assert other.text == plain.text and c_model.source(other) == c_model.source(plain)


def test_another_encoding_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_bytes((HEAD + 'description = "Feder für alle"\n').encode("latin-1"))
    with pytest.raises(ModelFileError, match="model.toml: line 2: is not UTF-8"):
        read(path)


def test_a_unit_of_another_meaning_is_refused_with_its_file(tmp_path: Path) -> None:
    text = HEAD + "[units]\nN = { m = 1 }\n[inputs]\nu = { unit = 'N' }\n"
    file = read_text(tmp_path, text)
    with pytest.raises(
        ModelFileError, match=r"model.toml: \[inputs\]: u: unit: 'N' is another unit"
    ):
        declared(file)


def test_texts_with_any_characters_stay_texts(tmp_path: Path) -> None:
    odd = '*/ \\" < & %s ?? $x$ `` ünï 🙂 \\n\\n # [a](b)'
    text = (
        f'name = "M"\ndescription = "{odd}"\n[parameters]\np = {{ start = 1, '
        f'description = "{odd}" }}\n[check]\n"{odd}" = "p > 0"\n'
    )
    model = Model(tmp_path, text)
    given = " ".join(tomllib.loads(text)["description"].split())
    content = declared(model.file)
    assert content.description == content.variables["p"].description == given
    assert odd[:8] in declaration.page(model.file)


def test_value_references_stay_when_the_file_changes(tmp_path: Path) -> None:
    path = tmp_path / "model.lock.toml"

    def references(text: str) -> dict[str, int]:
        file = read_text(tmp_path, text)
        found = lock.references(path, declaration.keys(file))
        path.write_text(lock.text(file.name, found))
        return {name: found[name, kind] for name, kind in declaration.keys(file)}

    first = references(STATE)
    assert first == {"x": 1, "der_x": 2}
    more = references(STATE + '[inputs]\nu = {}\n[where]\na = "x"\n')
    assert more == {"x": 1, "der_x": 2, "u": 3, "a": 4}
    assert references(STATE + "[inputs]\na = {}\nb = {}\n") == first | {"a": 5, "b": 6}
    assert references(STATE + '[where]\na = "x"\n') == first | {"a": 4}
    many = "".join(f"u{i} = {{}}\n" for i in range(100))
    found = references(STATE + f"[inputs]\n{many}")
    assert len({*found.values()}) == 102 and not {0, *range(80, 100)} & {*found.values()}
    sampler = SAMPLED.replace("u", 100 * "u") + f'every = "1"\nset = {{ {100 * "u"} = "x" }}\n'
    assert references(sampler) == references(sampler)  # names with something in front are longer


def test_a_lock_file_in_the_older_form_is_read_and_written_in_the_new_one(tmp_path: Path) -> None:
    path = tmp_path / "model.lock.toml"
    variables = [("x", "output", 7), ("x[1,2]", "local", 3), ("x", "input", 9), ("up", "mode", 2)]
    path.write_text(
        "# Value references of M: written by the build. Keep it with the model.\n"
        + "".join(
            f'\n[[variables]]\nname = "{name}"\nkind = "{kind}"\nreference = {reference}\n'
            for name, kind, reference in variables
        )
    )
    found = lock.references(path, [("x", "input"), ("y", "input")])
    expected = {(name, kind): reference for name, kind, reference in variables}
    assert found == expected | {("y", "input"): 10}
    path.write_text(lock.text("M", found))
    assert path.read_text() == (
        "# Value references of M: written by the build. Keep it with the model.\n\n"
        '[mode]\nup = 2\n\n[local]\n"x[1,2]" = 3\n\n[output]\nx = 7\n\n[input]\nx = 9\ny = 10\n'
    )
    assert lock.references(path, []) == found


@pytest.mark.parametrize(
    "text",
    ["x", "[[variables]]\nname = 'x'\n", "a = 1", "variables = 3"]
    + ["[input]\nx = 5\nx = 6\n", "[input]\nx = 5\n[local]\ny = 5\n", "[input]\nx.y = 5\n"]
    + ["[input]\nx = 5\n[[variables]]\n", "[input]\nx = true\n", "[input]\n'x y' = 5\n"]
    + [f"[input]\nx = {r}\n" for r in ("0", "80", "99", "100000", "-1", "5.0", "'5'")]
    + [2 * f"[[variables]]\nname = 'x'\nkind = '{kind}'\nreference = 5\n" for kind in ("local", "")]
    + [
        f"[[variables]]\nname = 'x'\nkind = 'input'\nreference = {r}\n" for r in (0, 80, 99, 100000)
    ],
)
def test_a_lock_file_that_says_nothing_clear_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "model.lock.toml"
    path.write_text(text)
    with pytest.raises(ModelFileError, match=r"^[^\n]*model.lock.toml: is no lock file: [^\n]*$"):
        lock.references(path, [("x", "input")])


def test_terminals_are_declared_as_the_file_has_them(tmp_path: Path) -> None:
    text = MODELS["schema"]["RICH"]
    terminals = declared(read_text(tmp_path, text)).terminals
    found = {name: asdict(terminal) for name, terminal in terminals.items()}
    assert without_empty(found) == tomllib.loads(text)["terminals"] != {}


def without_empty(table: dict[str, Any]) -> dict[str, Any]:
    """A table without the tables that have nothing."""
    inner = {k: without_empty(x) if isinstance(x, dict) else x for k, x in table.items()}
    return {key: value for key, value in inner.items() if value != {}}


def mutated(chance: random.Random, text: str) -> str:
    """A text with some of its pieces moved, doubled, removed or replaced."""
    odd = ["*/", '"', "'", "<", "\n", "\\", "{", "}", "(", "**", "-", "1e999", "if", "é", "\x00"]
    for _ in range(chance.choice([1, 1, 2])):
        a, b = sorted(chance.randrange(len(text)) for _ in range(2))
        b = min(b, a + chance.randrange(12))
        words = text.split()
        piece = chance.choice([chance.choice(odd), str(chance.random()), "", chance.choice(words)])
        text = text[:a] + piece + text[b:]
    return text


def read_mutations(folder: Path, seed: int, count: int) -> int:
    """Read so many mutations of the examples and write the C of each that is one; their number."""
    chance, accepted = random.Random(seed), 0
    texts = [path.read_text() for path in EXAMPLES]
    for _ in range(count):
        text = mutated(chance, chance.choice(texts))
        began = time.process_time()
        try:
            file = read_text(folder, text)
            assert c_model.header(file) and c_model.source(file) and declared(file)
            accepted += 1
        except ModelFileError as error:
            message = str(error)
            assert "\n" not in message and len(message) < 1000
            # what is not in the file at all has no line
            assert re.search(r"line [0-9]+|end of|unknown section|has no|name is missing", message)
        assert time.process_time() - began < 2, text
    return accepted


def test_mutated_examples_are_read_or_refused(tmp_path: Path) -> None:
    assert 60 < read_mutations(tmp_path, 0, 600) < 550


@pytest.mark.long
def test_a_million_mutated_examples(tmp_path: Path) -> None:
    assert 100_000 < read_mutations(tmp_path, 1_000_000, 1_000_000) < 900_000


@pytest.mark.long
def test_what_is_accepted_compiles(tmp_path: Path) -> None:
    chance, texts = random.Random(2), [path.read_text() for path in EXAMPLES]
    compiled = 0
    while compiled < 100:
        folder = tmp_path / str(compiled)
        folder.mkdir(exist_ok=True)
        try:
            Model(folder, mutated(chance, chance.choice(texts)))
        except ModelFileError:
            continue
        compiled += 1
