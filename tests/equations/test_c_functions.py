"""C functions of files with equations: values, derivatives, events, units, and what is refused."""

import ctypes
import random
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.equations.compiled import (
    Model,
    ModelFileError,
    c_model,
    declaration,
    read,
    read_text,
)
from tests.equations.examples import MISTAKES, MODELS
from tests.support.paths import ROOT
from tests.support.tables import cases

import equations_to_fmu  # isort: skip; compiled.py knows where it is

TEXTS = MODELS["c_functions"]


def files(folder: Path, text: str, code: str) -> Path:
    """Write a file of equations with its C file."""
    folder.mkdir(exist_ok=True)
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    (folder / text.split('code = "')[1].split('"')[0]).write_text(code, encoding="utf-8")
    return path


def test_calls_are_what_expressions_are(tmp_path: Path) -> None:
    """All C is the same but for texts and names: values, Jacobian, series, events and checks."""
    files(tmp_path, TEXTS["TWIN"], TEXTS["FUNCTIONS"])
    called = read_text(tmp_path, TEXTS["TWIN"])
    text = TEXTS["TWIN"]
    for call, expression in TEXTS["EXPRESSIONS"]:
        assert call in text
        text = text.replace(call, expression)
    written = read_text(tmp_path, text)
    for file in (called, written):
        file.graph.names.clear()
    for made in (c_model.header, c_model.source):
        first, second = (re.sub(r'"[^"\n]*"', "", made(file)) for file in (called, written))
        assert first == second


def test_values_are_those_of_compiled_c(tmp_path: Path) -> None:
    """Bit by bit, but for functions that are made of others; derivatives by differences."""
    files(tmp_path, TEXTS["VALUES"], TEXTS["VALUES_C"])
    model = Model(tmp_path, TEXTS["VALUES"])
    command = ["cc", "-std=c17", "-O1", "-ffp-contract=off", "-shared", "-fPIC", "-Wall", "-Werror"]
    subprocess.run([*command, tmp_path / "values.c", "-o", tmp_path / "c.so", "-lm"], check=True)
    library = ctypes.CDLL(str(tmp_path / "c.so"))

    def c(name: str, *given: float) -> float:
        function = library[name]
        function.restype = ctypes.c_double
        return function(*map(ctypes.c_double, given))

    for x, y in np.random.default_rng(5).uniform(0.1, 1.0, (40, 2)):
        values = model.values(x=x, y=y)
        model.outputs(values, 0.0)
        found = dict(zip(model.names, values, strict=False))
        assert found["d_x"] == c("mixed", x, y) + 1.5
        assert found["d_y"] == c("polynomial", y)
        assert found["power"] == pytest.approx(c("powers", x, y), rel=4e-16)
        assert model.jacobian(values, 0.0)[1] == pytest.approx([0.0, -2.0 + 2.5 * y], rel=1e-14)
        h = 1e-5
        assert min(abs(x - 0.5), abs(x - 0.8), abs(x - 0.75), abs(y - 0.25), abs(x - y)) > h
        for direction in ((1, 0), (0, 1)):
            first = model.values(x=direction[0], y=direction[1])
            model.derivatives(values, 0.0, 0.0, first, model.values())
            (above, below) = (np.array([x, y]) + s * np.array(direction) for s in (h, -h))
            slope = (c("mixed", *above) - c("mixed", *below)) / (2 * h)
            assert first[model.names.index("d_x")] == pytest.approx(slope, rel=1e-8, abs=1e-9)


def test_where_c_decides_without_an_event_there_is_no_series(tmp_path: Path) -> None:
    code = '#include "real.h"\nreal f(real x) { return value_of(x) > 1.0 ? x : 2.0 * x; }\n'
    (tmp_path / "real.h").write_bytes((ROOT / "models" / "real.h").read_bytes())
    head = 'name = "M"\ncode = "f.c"\n[states]\n'
    path = files(tmp_path, f'{head}x = {{ start = 3, derivative = "-f(x)" }}\n', code)
    model = Model(tmp_path, path.read_text(encoding="utf-8"))  # compiled with all warnings
    assert not model.words.series and not model.words.events
    for x, rate, slope in ((3.0, -3.0, -1.0), (0.5, -1.0, -2.0)):
        values = model.values(x=x)
        model.outputs(values, 0.0)
        assert values[model.names.index("d_x")] == rate
        assert model.jacobian(values, 0.0).tolist() == [[slope]]


def test_functions_without_slope_are_found_where_they_are_called(tmp_path: Path) -> None:
    """By functions of C and their helpers, and by functions of the file."""
    text = """name = "M"
code = "saw.c"
[inputs]
u = {}
[functions]
steps = { arguments = ["x"], value = "mod(x, 2) + saw(x)" }
[outputs]
a = { value = "saw(u) + ceil(u)" }
b = { value = "steps(u)" }
"""
    part = "double part(double x) { return x - floor(x); }\n"
    files(tmp_path, text, f"{part}double saw(double x) {{ return part(2.0 * x); }}")
    found = declaration.flat(read_text(tmp_path, text))
    assert found == ["ceil in a", "floor in a", "floor in b", "mod in b"]


def test_units_that_fit(tmp_path: Path) -> None:
    files(tmp_path, TEXTS["UNITS"], TEXTS["TENSION"])
    text = TEXTS["UNITS"].replace("HERE", TEXTS["WITH_UNITS"])
    for value in ("tension(l, v)", "tension(2, 3) + pull(l, 4) * one(2)", "twice(pull(1, 1))"):
        file = read_text(tmp_path, text.replace("VALUE", value))
        assert file.code.warnings == ["crane.c:2: 1 / 2 of whole numbers is 0: write 1.0 / 2.0"]


@pytest.mark.parametrize(("functions", "value", "said"), MISTAKES["units_of_c_functions"]["rows"])
def test_units_that_do_not_fit(tmp_path: Path, functions: str, value: str, said: str) -> None:
    text = TEXTS["UNITS"].replace("HERE", functions).replace("VALUE", value)
    files(tmp_path, text, TEXTS["TENSION"])
    with pytest.raises(ModelFileError) as refused:
        read_text(tmp_path, text)
    assert said in str(refused.value) and "\n" not in str(refused.value)


# ---- What is refused -----------------------------------------------------------------------------

F = "double f(double x) { return x; }\n"
Y = "double f(double x) { double y = x;\n"
STEPS = "more than 100000 steps: use fewer rounds of loops, or fewer calls"
WHOLE = [(code.encode(), expected) for code, expected in cases(MISTAKES["c_functions"])]
WHOLE += [
    (None, "code: bad.c: no such file"),
    (b"", "code: bad.c: is empty, or has more than 200000 bytes"),
    (b" " * 10_000_000 + F.encode(), "code: bad.c: is empty, or has more than 200000 bytes"),
    (b"double f(double x) {\n// \xff\n}", "bad.c:2: is not UTF-8"),
]
LONG = [
    (Y + "y = x" + " + x" * 5000 + ";\nreturn y; }", "bad.c:1: f is nested too deeply"),
    (Y + "y = x * y + y;\n" * 6000 + "\nreturn y; }",
     "bad.c:1: a call makes more than 10000 operations"),
    (Y + "".join(f"if (x > {i}.0) {{ if (x < {i}.5) return x; }}" for i in range(40))
     + "\nreturn y; }", STEPS),
    (Y + "".join(f"if (y > {i}.0) {{ y += 1.0; }}" for i in range(1100)) + "\nreturn y; }",
     "more than 1000 conditions"),
    ("#include <math.h>" + " " * 180_000 + f"x\n{F}", "bad.c:1: of directives, only #include and"),
    ("".join(f"double g{i}(double x) {{ double y = x; "
             "for (int i = 0; i < 3000; i++) { y = y * x; } return y; }\n"
             for i in range(40)) + f"\n{F}", "calls take more than 500000 steps"),
    ("double f0(double x) { return x; }\n" + "".join(
        f"double f{i}(double x) {{ return f{i - 1}(x) + f{i - 1}(x + 1.0); }}\n"
        for i in range(1, 40)) + f"\n{F}", STEPS),
    ("\\" * 190_000 + f"\n{F}", "bad.c:1: illegal character"),
    ('"\\' * 90_000 + f"\n{F}", "bad.c:1: "),
]  # fmt: skip
WHOLE += [(text.encode(), expected) for text, expected in LONG]


@pytest.mark.parametrize(("code", "expected"), WHOLE, ids=[f"{e:.30}" for _, e in WHOLE])
def test_a_mistake_in_c_is_one_line(
    code: bytes | None, expected: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    path = tmp_path / "model.toml"
    path.write_text(TEXTS["BAD"], encoding="utf-8")
    if code is not None:
        (tmp_path / "bad.c").write_bytes(code)
    command = ["equations_to_fmu.py", path, "--output", tmp_path, "--runtime", "none"]
    monkeypatch.setattr(sys, "argv", [*map(str, command)])
    begin = time.process_time()
    assert equations_to_fmu.main() == 2
    assert time.process_time() - begin < 20.0
    message = capsys.readouterr().err
    assert expected in message and message.count("\n") == 1 and message.startswith(f"{path}: line ")


@pytest.mark.parametrize("seed", range(30))
def test_mutants_are_read_or_refused_in_a_line(tmp_path: Path, seed: int) -> None:
    """Words in the place of others of their kind: never a traceback."""
    generator, code = random.Random(seed), TEXTS["VALUES_C"]
    words = [*re.finditer(r"(?P<name>[A-Za-z_]\w*)|(?P<number>[\d.]+)|[-+*/<>=!&|?:]+", code)]
    word = generator.choice(words)
    other = generator.choice([w for w in words if w.lastgroup == word.lastgroup])[0]
    files(tmp_path, TEXTS["VALUES"], f"{code[: word.start()]}{other}{code[word.end() :]}")
    try:
        read_text(tmp_path, TEXTS["VALUES"])
    except ModelFileError as error:
        assert re.search(r"values\.c:\d+: |no function|expected \d arg", str(error))
        assert "\n" not in str(error)


@pytest.mark.parametrize("name", ['"crane"', '"C:\\\\crane.c"', "3", '"a\\"b.c"', '"\\n.c"'])
def test_a_name_that_is_no_c_file_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match="line 2: code: expected a C file such as crane.c, "):
        read_text(tmp_path, f'name = "M"\ncode = {name}\n[inputs]\nu = {{}}\n')


def test_relations_are_named_where_they_stand(tmp_path: Path) -> None:
    """Of the file and of its C, each by its own text."""
    (tmp_path / "wall.c").write_text(
        "double wall(double x) {\n    return x < 0.0 ? -x : 0.0;\n}\n", encoding="utf-8"
    )
    path = tmp_path / "wall.toml"
    path.write_text(
        'name = "Wall"\ncode = "wall.c"\n[states]\nx = { start = 1, derivative = "y" }\n'
        '[where]\ny = "-1 if x > 0.5 else wall(x)"\n',
        encoding="utf-8",
    )
    assert read(path).relation_texts == ["x > 0.5 of [where] y", "x < 0.0 of wall.c:2"]
