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

from tests.equations.compiled import Model, ModelFileError, c_model, read_text
from tests.equations.examples import METHODS, build, simulated

import equations_to_fmu  # isort: skip; compiled.py knows where it is

HOIST = """
name = "Hoist"
code = "crane.c"
[parameters]
m = { start = 500, unit = "kg", min = 1 }
k = { start = 2e5, unit = "N/m" }
d = { start = 0, unit = "N.s/m" }
g = { start = 9.81, unit = "m/s2" }
[inputs]
speed = { start = 0.5, unit = "m/s", description = "At which the drum lets the rope out" }
[functions]
tension = { arguments = { stretch = "m", rate = "m/s", k = "N/m", d = "N.s/m" }, unit = "N" }
[states]
l = { start = 5, unit = "m", derivative = "speed" }
z = { start = 5, unit = "m", derivative = "v" }
v = { start = -0.5, unit = "m/s", derivative = "g - force / m" }
[where]
force = "tension(z - l, v - speed, k, d)"
[outputs]
rope = { value = "force", unit = "N" }
"""
CRANE = """#include <math.h>

/* A rope pulls, and does not push: also where its damper would. */
double tension(double stretch, double rate, double k, double d) {
    if (stretch <= 0.0) {
        return 0.0; // slack
    }
    return fmax(k * stretch + d * rate, 0.0);
}
"""


def files(folder: Path, text: str, code: str) -> Path:
    """Write a file of equations with its C file."""
    folder.mkdir(exist_ok=True)
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    (folder / text.split('code = "')[1].split('"')[0]).write_text(code, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def hoist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hoist")
    return build(files(folder, HOIST, CRANE), folder)


def stretch(times: np.ndarray) -> np.ndarray:
    """z - l of the hoist without damping: parabolas of a slack rope, and parts of harmonic ones."""
    g, w, speed = 9.81, np.sqrt(2e5 / 500), 1.0
    rest = g / w**2
    slack, taut = 2 * speed / g, 2 * (np.pi - np.arctan(speed / (w * rest))) / w
    t = np.mod(times, slack + taut)
    after = w * (t - slack)
    harmonic = rest * (1 - np.cos(after)) + speed / w * np.sin(after)
    return np.where(t < slack, -speed * t + g * t**2 / 2, harmonic)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_rope_is_slack_and_taut_in_turn(hoist: Path, method: int) -> None:
    options = {"solver_method": method}
    run = simulated(hoist, 2.0, 0.01, options, relative_tolerance=1e-11, also=["event_count"])
    exact = stretch(run["time"])
    assert np.max(np.abs(run["z"] - run["l"] - exact)) < 1e-8
    assert np.max(np.abs(run["rope"] - 2e5 * np.maximum(exact, 0.0))) < 2e-3
    turns = np.count_nonzero(np.diff(exact > 0))
    assert turns > 8 and turns <= run["event_count"][-1] <= 2 * turns + 2


# the same operations as calls and as expressions
FUNCTIONS = """#include <math.h>
double spring(double x, double k) {
    double force = 0.0;
    if (x < 0.0 && k > 0.0) {
        force = -k * x;
    }
    return force;
}
static double squared(double v) { return v * fabs(v); }
double drag(double v, double c) { return c * squared(v) + pow(v, 3); }
double rebound(double v, double limit) { return v < -limit ? 0.5 * -v : 0.0; }
double load(double x, double t) {
    double sum = x;
    for (int i = 0; i < 2; i++) {
        sum += fmin(x, t) * sin(t);
    }
    return sqrt(sum) > 1.0 ? sum : t;
}
"""
TWIN = """
name = "Twin"
code = "functions.c"
modes = ["resting"]
[parameters]
k = { start = 5 }
follows = { value = "spring(k, k) + 2" }
[inputs]
u = {}
[states]
x = { start = "rebound(k, k)", derivative = "v" }
v = { derivative = "spring(x, k) - drag(v, 0.1) - load(x, time) + u" }
[discrete]
held = {}
[sampled.s]
every = "follows - 1.9"
set = { held = "load(x, time)" }
[events.floor]
when = "spring(x - 1, k) > 2"
while = "not resting"
reinit = { v = "rebound(v, k)" }
[outputs]
sum = { value = "load(u, held) + der(v)" }
[check]
"k" = "spring(k, k) < 2"
"""


def load(x: str, t: str) -> str:
    """Write load(x, t) of these functions as an expression."""
    total = f"({x} + min({x}, {t}) * sin({t}) + min({x}, {t}) * sin({t}))"
    return f"({total} if sqrt({total}) > 1 else {t})"


EXPRESSIONS = {
    "spring(k, k)": "(-k * k if k < 0 and k > 0 else 0)",
    "spring(x, k)": "(-k * x if x < 0 and k > 0 else 0)",
    "spring(x - 1, k)": "(-k * (x - 1) if x - 1 < 0 and k > 0 else 0)",
    "drag(v, 0.1)": "(0.1 * (v * abs(v)) + v**3)",
    "rebound(k, k)": "(0.5 * -k if k < -k else 0)",
    "rebound(v, k)": "(0.5 * -v if v < -k else 0)",
    "load(x, time)": load("x", "time"),
    "load(u, held)": load("u", "held"),
}


def test_calls_are_what_expressions_are(tmp_path: Path) -> None:
    """All C of the model is the same: values, Jacobian, series, events, starts and checks."""
    files(tmp_path, TWIN, FUNCTIONS)
    called = read_text(tmp_path, TWIN)
    text = TWIN
    for call, expression in EXPRESSIONS.items():
        assert call in text
        text = text.replace(call, expression)
    written = read_text(tmp_path, text)
    for made in (c_model.header, c_model.source):
        assert made(called) == made(written)


VALUES = """
name = "Values"
code = "values.c"
[states]
x = { derivative = "mixed(x, y) + rated()" }
y = { derivative = "polynomial(y)" }
[outputs]
power = { value = "powers(x, y)" }
"""
VALUES_C = """#include <math.h>
struct point { double x[2]; };
enum { N = 3 };
static const double weight[] = {0.5, -2.0, 1.25};
static void swap(double *a, double *b) { const double kept = *a; *a = *b; *b = kept; }
static double dot(const double a[], int n) {
    double s = 0.0;
    for (int i = 0; i < n; i++) { s += weight[i] * a[i]; }
    return s;
}
static struct point turned(struct point p, double angle) {
    return (struct point){{p.x[0] * cos(angle) - p.x[1] * sin(angle), p.x[1] + angle}};
}
double rated(void) { return 3.0 / 2.0; }
double polynomial(double x) {
    double y = 0.0;
    for (int i = N - 1; i >= 0; i--) { y = y * x + weight[i]; }
    return y;
}
double mixed(double x, double y) {
    double a[N] = {x, y};
    a[N - 1] = x * y;
    swap(&a[0], a + 1);
    struct point p = turned((struct point){{a[0], a[2]}}, rated());
    a[x > y ? 1 : 2] += atan2(x, y) / 3.0;
    _Bool high = !(x > 0.5) || y <= 0.25;
    if (high && x < 0.8) {
        p.x[1] -= fmin(x, y) * exp(y);
    } else if (!high) {
        return dot(a, 2) + fabs(p.x[0] - 1.0);
    } else {
        p.x[0] *= fmax(x, 0.75) + tanh(y);
    }
    return dot(a, N) + p.x[0] * p.x[1];
}
double powers(double x, double y) {
    return pow(x, 2.5) + pow(y, 3) + hypot(x, y) + cbrt(y) + log10(x);
}
"""


def test_values_are_those_of_compiled_c(tmp_path: Path) -> None:
    """Bit by bit, but for functions that are made of others; derivatives by differences."""
    files(tmp_path, VALUES, VALUES_C)
    model = Model(tmp_path, VALUES)
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
            model.propagate(values, 0.0, 0.0, first, model.values())
            (above, below) = (np.array([x, y]) + s * np.array(direction) for s in (h, -h))
            slope = (c("mixed", *above) - c("mixed", *below)) / (2 * h)
            assert first[model.names.index("d_x")] == pytest.approx(slope, rel=1e-8, abs=1e-9)


UNITS = """
name = "Units"
code = "crane.c"
[functions]
HERE
[inputs]
l = { unit = "m" }
v = { unit = "m/s" }
[outputs]
force = { value = "VALUE", unit = "N" }
"""
TENSION = """double tension(double l, double v) { return l * v; }
double one(double x) { return x + 1 / 2; }
"""
OF_C = 'tension = { arguments = { v = "m/s", l = "m" }, unit = "N" }'
OWN = 'pull = { arguments = { l = "m", k = "N/m" }, value = "k * l", unit = "N" }'


def test_units_that_fit(tmp_path: Path) -> None:
    files(tmp_path, UNITS, TENSION)
    text = UNITS.replace("HERE", f"{OF_C}\n{OWN}\ntwice = {{ arguments = ['x'], value = 'x + x' }}")
    for value in ("tension(l, v)", "tension(2, 3) + pull(l, 4) * one(2)", "twice(pull(1, 1))"):
        file = read_text(tmp_path, text.replace("VALUE", value))
        assert file.code.warnings == ["crane.c:2: 1 / 2 of whole numbers is 0: write 1.0 / 2.0"]


@pytest.mark.parametrize(
    ("functions", "value", "expected"),
    [
        (OF_C, "tension(v, l)", "force: value: column 1: tension takes unit m, got m/s"),
        (OF_C, "l * tension(l, v)", "expected unit kg.m/s2, got kg.m2/s2"),
        (OF_C, "one(l)", "one takes unit 1, got m"),
        ("", "tension(l, v)", "tension takes unit 1, got m: write its units into [functions]"),
        (OWN, "pull(v, 1)", "column 6: pull takes unit m, got m/s"),
        (OWN, "v * pull(l, 1)", "expected unit kg.m/s2, got kg.m2/s3"),
        (OWN.replace("k * l", "k + l"), "1", "pull: value: column 3: '+': units"),
        (OWN.replace('"N" }', '"m" }'), "1", "pull: value: column 3: expected unit m, got kg.m/s2"),
        (OF_C.replace('"m/s"', '"q"'), "1", "tension: unit 'q'"),
        (OF_C.replace("v =", "w ="), "1", "tension: arguments: expected all of the C file: l, v"),
        (OF_C.replace('"m/s"', "3"), "1", "arguments: expected a list of names, each once, or a"),
        ('tension = { unit = "N" }', "1", "tension: arguments: expected all of the C file: l, v"),
        ('one = { arguments = ["x"], unit = "N" }', "1", "one: unit: expected units of arguments"),
        (OF_C.replace("unit =", "value = 'l', unit ="), "1", "tension: expected a name that is no"),
        ("", "rated()", "no function 'rated' (known: sin"),
    ],
)  # fmt: skip
def test_units_that_do_not_fit(tmp_path: Path, functions: str, value: str, expected: str) -> None:
    files(tmp_path, UNITS, TENSION)
    with pytest.raises(ModelFileError) as refused:
        read_text(tmp_path, UNITS.replace("HERE", functions).replace("VALUE", value))
    assert expected in str(refused.value) and "\n" not in str(refused.value)


# ---- What is refused -----------------------------------------------------------------------------

BAD = """
name = "Bad"
code = "bad.c"
[parameters]
p = { start = 1 }
[states]
x = { derivative = "f(x) + p" }
"""
LOOP = "for (int i = 0; i < {}; i++) {{ y = y * x; }}"
F = "double f(double x) { return x; }\n"
STEPS = "more than 100000 steps: use fewer rounds of loops, or fewer calls"
STATEMENTS = [  # line 2 of a function of x, before it returns y
    ("while (1) { }", "bad.c:2: a while loop has no fixed number of rounds: use for"),
    ("for (;;) { }", "bad.c:2: this loop has no end: use for"),
    (LOOP.format("x"), "bad.c:2: the number of rounds is not fixed"),
    (LOOP.format(10**9), f"bad.c:2: {STEPS}"),
    ("y = x > 1.0 ? f(x - 1.0) : x;", "bad.c:2: f calls itself: write a loop"),
    ('__asm__ volatile("nop");', "bad.c:2: assembly is not read: write the equation in C"),
    ("again: if (x > 1.0) goto again;", "bad.c:2: labels are not read"),
    ('_Pragma("omp")', "bad.c:2: of directives, only #include <math.h> is read"),
    ("double (*g)(double) = sin;", "bad.c:2: pointers to functions are not read"),
    ("double *p = malloc(8);", "bad.c:2: malloc is not known: besides functions of the text"),
    ("static double kept = 0.0;", "bad.c:2: kept keeps a value between calls: leave out static"),
    ("if (x == 1.0) { y = 1.0; }", "bad.c:2: == is for whole numbers"),
    ("return;", "bad.c:2: f does not return a value here"),
    ("y = x * ;", "bad.c:2: invalid expression near ;"),
    ("y = x", "bad.c:3: return does not fit here: often a ; is missing before it"),
    ("y = x" + " + x" * 5000 + ";", "bad.c:1: f is nested too deeply"),
    ("y = x * y + y;\n" * 6000, "bad.c:1: a call makes more than 10000 operations"),
    ("double a[1000000000] = {x};", "bad.c:2: an array has 1 to 10000 elements, not 1000000000"),
    ("double a[9999][9999][9999] = {{{x}}};", f"bad.c:2: {STEPS}"),
    ("int n = 3;" + "n = n * n;" * 6, "bad.c:2: this whole number is too large for an int"),
    ("".join(f"if (x > {i}.0) {{ if (x < {i}.5) return x; }}" for i in range(40)), STEPS),
    ("".join(f"if (y > {i}.0) {{ y += 1.0; }}" for i in range(1100)), "more than 1000 conditions"),
]
LINES = [  # before F
    ('#include "other.h"', "bad.c:1: only #include <math.h> is read: put all functions into this"),
    ("#include <math.h>" + " " * 180_000 + "x", "bad.c:1: only #include <math.h> is read"),
    ("#def\\\nine N 3", "bad.c:1: macros are not read: write static const double NAME = ..."),
    ("#if 1", "bad.c:1: of directives, only #include <math.h> is read"),
    ('# 1 "/etc/passwd"', "bad.c:1: of directives, only #include <math.h> is read"),
    ("%:define N 3", "bad.c:1: of directives, only #include <math.h> is read"),
    ("double h(double x);\ndouble g(double x) { return h(x); }\n"
     "double h(double x) { return g(x); }", "bad.c:3: g calls itself"),
    ("double g(double x, double y) { return x; }\ndouble h(double x) { return g(x); }",
     "bad.c:2: g has 2 arguments, not 1"),
    ("static double kept;", "bad.c:1: kept keeps a value between calls: pass it as an argument"),
    ("double p(double x) { return x; }", "[parameters]: p: this name is a function or table"),
    ("double sign(double x) { return x; }", "bad.c:1: sign: expected a name that is no function"),
    ("double fabs(double x) { return x; }", "bad.c:1: fabs is a function of math.h: give this"),
    ("".join(f"double g{i}(double x) {{ double y = x; {LOOP.format(3000)} return y; }}\n"
             for i in range(40)), "calls take more than 500000 steps"),
    ("double f0(double x) { return x; }\n" + "".join(
        f"double f{i}(double x) {{ return f{i - 1}(x) + f{i - 1}(x + 1.0); }}\n"
        for i in range(1, 40)), STEPS),
    ("\\" * 190_000, "bad.c:1: illegal character"),
    ('"\\' * 90_000, "bad.c:1: "),
    ("/* and", "bad.c:1: this comment has no end"),
]  # fmt: skip
WHOLE = [
    (None, "code: bad.c: no such file"),
    (b"", "code: bad.c: is empty, or has more than 200000 bytes"),
    (b" " * 10_000_000 + F.encode(), "code: bad.c: is empty, or has more than 200000 bytes"),
    (b"double f(double x) {\n// \xff\n}", "bad.c:2: is not UTF-8"),
    (b"double f(double x, double y) { return x; }", "column 1: f: expected 2 arguments, got 1"),
    (b"int f(double x) { return 1; }", "f: bad.c:1: expressions call functions of doubles"),
    (b"double f(double *x) { return *x; }", "f: bad.c:1: expressions call functions of doubles"),
    (b"double g(double x) { return x; }", "column 1: no function 'f'"),
]
WHOLE += [(f"double f(double x) {{ double y = x;\n{s}\nreturn y; }}".encode(), e)
          for s, e in STATEMENTS]  # fmt: skip
WHOLE += [(f"{line}\n{F}".encode(), expected) for line, expected in LINES]


@pytest.mark.parametrize(("code", "expected"), WHOLE, ids=[f"{e:.30}" for _, e in WHOLE])
def test_a_mistake_in_c_is_one_line(
    code: bytes | None, expected: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    path = tmp_path / "model.toml"
    path.write_text(BAD, encoding="utf-8")
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
    generator = random.Random(seed)
    words = list(
        re.finditer(r"(?P<name>[A-Za-z_]\w*)|(?P<number>[\d.]+)|[-+*/<>=!&|?:]+", VALUES_C)
    )
    word = generator.choice(words)
    other = generator.choice([w for w in words if w.lastgroup == word.lastgroup])[0]
    files(tmp_path, VALUES, f"{VALUES_C[: word.start()]}{other}{VALUES_C[word.end() :]}")
    try:
        read_text(tmp_path, VALUES)
    except ModelFileError as error:
        assert re.search(r"values\.c:\d+: |no function|expected \d arg", str(error))
        assert "\n" not in str(error)


@pytest.mark.parametrize("name", ['"crane"', '"C:\\\\crane.c"', "3", '"a\\"b.c"', '"\\n.c"'])
def test_a_name_that_is_no_c_file_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match="line 2: code: expected a C file such as crane.c, "):
        read_text(tmp_path, f'name = "M"\ncode = {name}\n[inputs]\nu = {{}}\n')
