"""Files with equations: what is refused and how, value references, units."""

import random
import re
import time
import tomllib
from pathlib import Path, PureWindowsPath

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
    toml,
)
from tests.support.paths import ROOT

EXAMPLES = [
    path
    for path in sorted((ROOT / "examples" / "models").glob("*.toml"))
    if not path.name.endswith(".lock.toml")
]
HEAD = 'name = "M"\n'
STATE = HEAD + '[states]\nx = { derivative = "-x" }\n'
SAMPLED = STATE + "[discrete]\nu = {}\n[sampled.s]\n"

MISTAKES = {
    "no TOML": ("name = ", "is not valid TOML"),
    "no name": ("[states]\nx = { derivative = \"1\" }", "name is missing"),
    "bad name": ('name = "a b"', "name: expected a letter"),
    "device": (STATE.replace("M", "cOn"), "line 1: name: Windows keeps this name for a device"),
    "long message": (
        STATE + f'[check]\n"{"ä" * 251}" = "1 > 0"', "expected a message of at most 500 bytes",
    ),
    "nothing": (HEAD, "has no variables"),
    "section": (HEAD + "[state]\n", "line 2: [state]: unknown section 'state'"),
    "odd key at the top": ("de- = 'x'\n" + STATE, "line 1: [de-]: unknown section 'de-'"),
    "key at the top": ("title = 'x'\n" + STATE, "line 1: [title]: unknown section 'title'"),
    "tables of an array": (HEAD + "\n[[inputs]]\n", "line 3: [inputs]: expected a table, got"),
    "key": (HEAD + "[parameters]\np = { start = 1, units = 'm' }", "[parameters]: p: unknown key"),
    "no start": (HEAD + "[parameters]\np = { unit = 'm' }", "[parameters]: p: start is missing"),
    "no derivative": (HEAD + "[states]\nx = {}", "[states]: x: derivative is missing"),
    "no table": (HEAD + "[outputs]\ny = 1", "[outputs]: y: expected a table"),
    "no expression": (STATE + "[where]\na = 1", "[where]: a: expected an expression"),
    "range": (HEAD + "[parameters]\np = { start = 1, max = 0 }", "p: start = 1 is outside"),
    "nominal": (HEAD + '[states]\nx = { derivative = "1", nominal = 0 }', "nominal = 0: expected"),
    "finite": (HEAD + "[parameters]\np = { start = inf }", "p: start: expected a finite number"),
    "truth": (HEAD + "[parameters]\np = { start = true }", "p: start: expected a number"),
    "twice": (STATE + '[where]\nx = "1"', "[where]: x: this name is in [states] already"),
    "function": (HEAD + "[inputs]\nsin = {}", "[inputs]: sin: this name is reserved"),
    "solver": (HEAD + "[inputs]\nmax_step = {}", "[inputs]: max_step: this name is reserved"),
    "der": (HEAD + "[inputs]\nder_x = {}", "[inputs]: der_x: this name is reserved"),
    "name of it": (HEAD + '[inputs]\n"a b" = {}', "[inputs]: 'a b': expected a name"),
    "unknown": (STATE + '[where]\na = "x + y"', "line 5: [where]: a: column 5: unknown name 'y'"),
    "misspelt": (STATE + '[where]\nspeed = "1"\na = "sped"', "name 'sped', did you mean 'speed'?"),
    "a root as unit": (
        HEAD + "[inputs]\nu = { unit = 'm' }\n[where]\na = 'sqrt(u)'",
        "line 5: [where]: a: has unit m1/2, whose exponents are no whole numbers: use its square",
    ),
    "digits": (HEAD + f"[inputs]\nu = {{ start = {'9' * 5000} }}", "has a number or a table that"),
    "syntax": (STATE + '[where]\na = "x + "', "[where]: a: column 5: expected a number"),
    "syntax below": (
        HEAD + '[states]\nx = { derivative = "2 x" }',
        "[states]: x: derivative: column 3: expected",
    ),
    "power": (STATE + '[where]\na = "x^2"', "column 2: '^2' is no number, name or operator: p"),
    "exponent": (STATE + '[inputs]\na = { unit = "m/s^2" }', "'s^2' is no SI symbol with an"),
    "condition": (STATE + '[where]\na = "x < 1"', "line 5: [where]: a: column 3: expected a"),
    "loop": (
        STATE + '[where]\na = "b + x"\nb = "c"\nc = "2 * a"', "algebraic loop 'a -> b -> c -> a'",
    ),
    "loop of one": (STATE + '[where]\na = "a"', "[where]: a: algebraic loop 'a -> a'"),
    "modes": ("modes = 3\n" + STATE, "modes: expected a list of names, or a table of true and"),
    "mode as a number": ("modes = { a = 1 }\n" + STATE, "modes: expected a list of names, or a t"),
    "mode twice": ('modes = ["a", "a"]\n' + STATE, "modes: a: this name is in modes already"),
    "mode as number": (
        'modes = ["a"]\n' + STATE + '[where]\nb = "a"', "column 1: expected a number",
    ),
    "event": (STATE + "[events.e]\n", "[events.e]: when is missing"),
    "event key": (STATE + '[events.e]\nwhen = "x < 0"\nthen = 1', "[events.e]: unknown key 'then'"),
    "no condition": (
        STATE + '[events.e]\nwhen = "x - 1"\nreinit = { x = "0" }',
        "[events.e]: when: column 3: expected a condition",
    ),
    "derivative of a derivative": (
        STATE + '[where]\na = "der(der(x))"', "column 8: expected ')', got '('",
    ),
    "derivative of a number": (STATE + '[where]\na = "der(2)"', "column 5: expected a state, got"),
    "derivative of no state": (
        STATE + '[inputs]\nu = {}\n[where]\na = "der(u)"', "unknown name 'der(u)', did you mean",
    ),
    "derivative in a loop": (
        HEAD + '[states]\nx = { derivative = "-der(x)" }', "[states]: x: algebraic loop 'x -> x'",
    ),
    "function twice": (
        STATE + '[functions]\nsin = { arguments = ["a"], value = "a" }', "expected a name that is",
    ),
    "arguments twice": (
        STATE + '[functions]\nf = { arguments = ["a", "a"], value = "a" }', "arguments: expected",
    ),
    "function of a variable": (
        STATE + '[functions]\nf = { arguments = ["a"], value = "a * x" }', "'x' is no argument",
    ),
    "functions that multiply": (
        STATE + '[functions]\nf0 = { arguments = ["a"], value = "a * a" }\n' + "".join(
            f'f{i} = {{ arguments = ["a"], value = "f{i - 1}(a) + f{i - 1}(a)" }}\n'
            for i in range(1, 40)
        ),
        "functions and sums make more than 100000 operations of this expression",
    ),
    "argument": (
        STATE + '[functions]\nf = { arguments = ["a b"], value = "1" }', "arguments: expected na",
    ),
    "argument that is a function": (
        STATE + '[functions]\nf = { arguments = ["sin"], value = "sin(sin)" }', "none reserved",
    ),
    "name of a function": (
        STATE + '[functions]\nf = { arguments = ["a"], value = "a" }\n[inputs]\nf = {}',
        "[inputs]: f: this name is a function or table already",
    ),
    "unit of a sign": (
        HEAD + '[inputs]\nx = { unit = "m" }\n[where]\nq = "sign(x) + x"',
        "q: column 9: '+': units 1 and m do not fit",
    ),
    "start without value": (
        HEAD + '[states]\nx = { start = "log(-1)", derivative = "1" }',
        "[states]: x: start: is not a finite number at the start values",
    ),
    "endless period": (
        SAMPLED + 'every = "1e308 * 10"\nset = { u = "1" }', "every: is inf s at the start values",
    ),
    "sampler that sets nothing": (SAMPLED + 'every = "1"\nset = {}', "expected set or reinit"),
    "Boolean in quotes": (
        HEAD + '[inputs]\nu = { type = "Boolean", start = "true" }', "expected true or false, got",
    ),
    "recursion": (
        STATE + '[functions]\nf = { arguments = ["a"], value = "f(a - 1)" }', "no function 'f'",
    ),
    "arguments of the file's function": (
        STATE + '[functions]\nf = { arguments = ["a"], value = "a" }\n[where]\nb = "f(x, 1)"',
        "[where]: b: column 1: f: expected 1 argument, got 2",
    ),
    "unit in a function": (
        HEAD + '[functions]\nf = { arguments = ["a", "b"], value = "a + b" }\n'
        '[inputs]\nu = { unit = "m" }\nw = { unit = "s" }\n[where]\nb = "f(u, w)"',
        "b: column 1: '+': units m and s do not fit",
    ),
    "function without value": (
        STATE + '[functions]\nf = { arguments = ["a"] }', "[functions]: f: value is missing",
    ),
    "reinit": (
        STATE + '[events.e]\nwhen = "x < 0"\nreinit = { y = "1" }',
        "reinit: expected a state, got 'y'",
    ),
    "set": (
        STATE + '[events.e]\nwhen = "x < 0"\nset = { x = "1 < 2" }', "set: expected one of modes",
    ),
    "set to number": (
        'modes = ["a"]\n' + STATE + '[events.e]\nwhen = "x < 0"\nset = { a = "1" }',
        "[events.e]: set: a: column 1: expected a condition",
    ),
    "unit of reinit": (
        HEAD + '[states]\nx = { unit = "m", derivative = "1" }\n[inputs]\nu = { unit = "s" }\n'
        '[events.e]\nwhen = "x < 0"\nreinit = { x = "u" }',
        "[events.e]: reinit: x: column 1: expected unit m, got s",
    ),
    "check": (
        STATE + '[check]\n"text" = "x > 0"', "[check]: 'text': column 1: 'x' is no parameter",
    ),
    "check of number": (
        HEAD + '[parameters]\np = { start = 1 }\n[check]\n"text" = "p"',
        "'text': column 1: expected",
    ),
    "unit": (HEAD + "[inputs]\nu = { unit = 'furlong' }", "[inputs]: u: unit: unit 'furlong'"),
    "units": (
        HEAD + '[inputs]\nu = { unit = "m" }\n[outputs]\ny = { value = "u + u**2" }',
        "[outputs]: y: value: column 3: '+': units m and m2 do not fit",
    ),
    "unit of rate": (
        HEAD + '[states]\nx = { unit = "m", derivative = "x" }',
        "[states]: x: derivative: column 1: expected unit m/s, got m",
    ),
    "unit of output": (
        HEAD + '[inputs]\nu = { unit = "m" }\n[outputs]\ny = { value = "u", unit = "s" }',
        "[outputs]: y: value: column 1: expected unit s, got m",
    ),
    "experiment": (
        STATE.replace("[", "experiment = { stop = 0 }\n[", 1), "line 2: [experiment]: expected",
    ),
    "control": (STATE.replace("[", 'description = "\\u0001"\n[', 1), "description: has a control"),
    "deep": (STATE + f'[where]\na = "{"(" * 200}"', "a: column 102: more than 100 levels"),
    "many": (
        HEAD + "[inputs]\n" + "".join(f"u{i} = {{}}\n" for i in range(1001)), "has more than 1000",
    ),
    "array": (STATE + '[where]\na = "x[1]"', "column 1: unknown name 'x[1]'"),
    "number as a file": (
        STATE + '[tables.T]\nfile = 3\nx = "a"\ny = "b"', "[tables.T]: file: expected a text of",
    ),
    "array of starts": (
        HEAD + "[parameters]\np = { start = [1, 2] }", "start: expected a number, got [1, 2]",
    ),
    "implicit": (
        STATE + '[where]\na = "x == 1"', "column 3: '==' compares whole numbers, conditions and",
    ),
    "residuals": (STATE + "[algebraic]\n", "equations in implicit form are not supported: solve"),
    "sampler": (STATE + '[where]\na = "sample(x)"', "samplers are written as [sampled.NAME]"),
    "no period": (SAMPLED + "set = { u = '1' }", "line 6: [sampled.s]: every is missing"),
    "sampler without effect": (SAMPLED + 'every = "1"', "[sampled.s]: expected set or reinit"),
    "sampler key": (SAMPLED + 'every = "1"\nwhen = "x < 0"', "[sampled.s]: unknown key 'when'"),
    "period of a state": (
        SAMPLED + 'every = "x"\nset = { u = "1" }', "every: column 1: 'x' is no parameter",
    ),
    "period of 0": (
        SAMPLED + 'every = "1 - 1"\nset = { u = "1" }',
        "[sampled.s]: every: is 0 s at the start values, expected more than 0",
    ),
    "period without value": (
        SAMPLED + 'every = "1 / (1 - 1)"\nset = { u = "1" }', "every: is nan s at the start values",
    ),
    "offset below 0": (
        SAMPLED + 'every = "1"\noffset = "-1"\nset = { u = "1" }', "offset: is -1 s at the start",
    ),
    "unit of a period": (
        HEAD + '[discrete]\nu = {}\n[parameters]\nT = { start = 1, unit = "m" }\n'
        '[sampled.s]\nevery = "T"\nset = { u = "1" }',
        "[sampled.s]: every: column 1: expected unit s, got m",
    ),
    "sampled parameter": (
        SAMPLED + 'every = "1"\nset = { p = "1" }', "one of modes or of [discrete], got 'p'",
    ),
    "sampled state": (
        SAMPLED + 'every = "1"\nset = { x = "1" }', "one of modes or of [discrete], got 'x'",
    ),
    "sampled condition": (
        SAMPLED + 'every = "1"\nset = { u = "x < 1" }', "set: u: column 3: expected a number",
    ),
    "sampler of a name that is taken": (SAMPLED.replace(".s]", ".u]"), "is in [discrete] already"),
    "limits of a discrete one": (STATE + "[discrete]\nu = { min = 0 }", "unknown key 'min'"),
    "literal as a name": (STATE + "[inputs]\ntrue = {}", "true: this name is reserved"),
    "literal as a number": (STATE + '[where]\na = "x + true"', "expected a number, true gives"),
    "value and start": (
        HEAD + '[parameters]\np = { start = 1, value = "2" }', "p: unknown key 'start'",
    ),
    "loop of parameters": (
        HEAD + '[parameters]\na = { value = "b" }\nb = { value = "2 * a" }',
        "[parameters]: a: algebraic loop 'a -> b -> a'",
    ),
    "parameter of a state": (
        STATE + '[parameters]\np = { value = "x" }', "p: value: column 1: 'x' is no parameter",
    ),
    "start of a state": (
        HEAD + '[states]\nx = { start = "y", derivative = "1" }\ny = { derivative = "1" }',
        "[states]: x: start: column 1: 'y' is no parameter",
    ),
    "start in quotes": (
        HEAD + '[inputs]\nu = { start = "1" }', "[inputs]: u: start: expected a number, got '1'",
    ),
    "unit of a start": (
        HEAD + '[parameters]\np = { start = 1, unit = "s" }\n'
        '[discrete]\nu = { start = "p", unit = "m" }',
        "[discrete]: u: start: column 1: expected unit m, got s",
    ),
    "unit of a parameter that follows": (
        HEAD + '[parameters]\np = { start = 1, unit = "s" }\nq = { value = "p**2", unit = "s" }',
        "[parameters]: q: value: column 2: expected unit s, got s2",
    ),
    "type": (HEAD + '[inputs]\nu = { type = "Real" }', 'u: type: expected "Boolean", '),
    "type of a state": (
        HEAD + '[states]\nx = { type = "Boolean", derivative = "1" }', "x: unknown key 'type'",
    ),
    "limits of a Boolean": (
        HEAD + '[inputs]\nu = { type = "Boolean", min = 0 }', "u: unknown key 'min', expected one",
    ),
    "number as a Boolean": (
        HEAD + '[inputs]\nu = { type = "Boolean", start = 1 }', "start: expected true or false",
    ),
    "Boolean as a number": (
        HEAD + '[inputs]\nu = { type = "Boolean" }\n[where]\na = "u + 1"', "u gives a condition",
    ),
    "noise": (STATE + '[where]\na = "x + noise()"', "noise is not supported: make it outside and"),
    "line": (STATE + "[parameters]\na = { start = 1 }\n\nb = { }", "line 7: [parameters]: b"),
    "line of a table": (STATE + "[inputs.u]\nmin = 1", "line 4: [inputs]: u: start = 0"),
    "line of an odd name": (STATE + "[events.0]\nwhen = 'x < 0'", "line 4: [events.'0']: expected"),
    "line above": (STATE + "[events]\nwhen = 'x < 0'", "line 5: [events.when]: expected"),
    "line of a deep table": (STATE + "[events.0.1]\na = 2", "line 4: [events.'0']: expected"),
    "large": ("#" * 1_000_001, "has 1000001 bytes, expected at most 1000000"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line_with_its_place(name: str, tmp_path: Path) -> None:
    text, expected = MISTAKES[name]
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
    content = declared(model.file)
    assert tomllib.loads(toml(content)) == {key: table for key, table in content.items() if table}
    given = tomllib.loads(text)["description"]
    assert content["variables"]["p"]["description"] == " ".join(given.split())
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


@pytest.mark.parametrize(
    "text",
    ["x", "[[variables]]\nname = 'x'\n", "a = 1", "variables = 3"]
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
