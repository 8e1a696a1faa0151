"""Tables of files with equations: interpolation, what lies outside, stops at the rows, files."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

from tests.equations.compiled import Model, ModelFileError, read_text
from tests.equations.examples import METHODS, MISTAKES, MODELS, made, quick, simulated
from tests.support.tables import cases

TEXTS = MODELS["tables"]
EACH_METHOD = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
X, Y = [0.0, 10.0, 20.0, 40.0], [3.0, 2.5, 1.0, 0.25]
LISTS = f"x = {X}\ny = {Y}\n"


def segments(outside: str) -> list[tuple[float, float, float, float]]:
    """Begin and end of each line of the table, and the line a + b w."""
    slopes = np.diff(Y) / np.diff(X)
    lines = [(X[i], X[i + 1], Y[i] - slopes[i] * X[i], slopes[i]) for i in range(3)]
    if outside == "hold":
        return [(-np.inf, 0.0, Y[0], 0.0), *lines, (40.0, np.inf, Y[-1], 0.0)]
    return [(-np.inf, *lines[0][1:]), lines[1], (lines[2][0], np.inf, *lines[2][2:])]


def speed(times: np.ndarray, outside: str, load: float) -> np.ndarray:
    """w of J w' = a + b w - d w - load, from line to line; it is monotone."""
    J, d, w, t, found = 0.05, 0.02, -5.0, 0.0, []
    lines = segments(outside)
    place = next(i for i, line in enumerate(lines) if line[0] <= w < line[1])
    for goal in times:
        while True:
            low, high, a, b = lines[place]
            rate, end = (b - d) / J, (a - load) / (d - b)
            limit = high if end > w else low
            left = np.inf
            if (end - limit) * (limit - w) > 0:
                left = np.log((limit - end) / (w - end)) / rate
            if t + left > goal:
                found.append(end + (w - end) * np.exp(rate * (goal - t)))
                w, t = found[-1], goal
                break
            w, t, place = limit, t + left, place + (1 if limit == high else -1)
    return np.array(found)


@EACH_METHOD
@pytest.mark.parametrize("outside", ["hold", "extend"])
@pytest.mark.parametrize("load", [0.0, -4.0])
def test_a_motor_runs_up_along_its_curve(method: int, outside: str, load: float) -> None:
    fmu = made(TEXTS["MOTOR"].replace("OUTSIDE", outside))
    start = {"solver_method": method, "load": load}
    run = simulated(fmu, 3.0, 0.01, start, relative_tolerance=1e-11, also=["event_count"])
    exact = speed(run["time"], outside, load)
    assert np.max(np.abs(run["w"] - exact)) < 1e-8
    knots = np.array(X if outside == "hold" else X[1:-1])
    assert run["event_count"][-1] == np.sum((exact.min() < knots) & (knots < exact.max()))


ROWS = np.array([0.5, 1.0, 1.7, 3.0]), np.array([1.0, -2.0, 0.5, 4.0])


@EACH_METHOD
def test_integrals_over_tables_of_the_time_are_exact(method: int) -> None:
    fmu = made(TEXTS["SIGNALS"])
    run = simulated(fmu, 4.0, 0.1, {"solver_method": method}, relative_tolerance=1e-11)
    x, y = ROWS
    grid = np.unique(np.concatenate([x, run["time"]]))
    middle = (grid[1:] + grid[:-1]) / 2
    width = np.diff(grid)
    stairs = y[np.clip(np.searchsorted(x, middle, side="right") - 1, 0, 3)]
    for name, rates in (("a", np.interp(middle, x, y)), ("b", stairs)):
        whole = np.concatenate([[0.0], np.cumsum(rates * width)])
        assert np.max(np.abs(run[name] - whole[np.searchsorted(grid, run["time"])])) < 1e-9, name
    curve = PchipInterpolator(x, y)
    primitive = curve.antiderivative()
    assert np.max(np.abs(run["c"] - (primitive(run["time"]) - primitive(0.0)))) < 1e-8


def test_a_table_of_an_input_follows_at_once() -> None:
    times = np.array([0.0, 0.4, 0.4, 1.0, 3.0])
    u = np.array([0.0, 0.9, 2.9, 1.2, 5.0])
    signal = np.array(list(zip(times, u, strict=True)), [("time", "f8"), ("u", "f8")])
    run = simulated(made(TEXTS["SIGNALS"]), 3.0, 0.05, {}, input=signal)
    # a step holds the input of its begin
    exact = np.interp(np.interp(run["time"] - 0.05, times[2:], u[2:]), *ROWS)
    rows = run["time"] > 0.46
    assert np.max(np.abs(run["now"][rows] - exact[rows])) < 1e-12


def test_values_without_states_are_scipys(tmp_path: Path) -> None:
    """Of each interpolation, with each rule for what lies outside; of two arguments, bilinear."""
    cases = [*product(("linear", "previous", "pchip"), ("hold", "extend", "error"))]
    x, y = [0.0, 1.0, 3.0], [-1.0, 0.5, 2.0, 4.0]
    z = np.random.default_rng(3).normal(size=(3, 4)).tolist()
    text = f'name = "M"\n[tables.Z]\nx = {x}\ny = {y}\nz = {z}\n'
    for i, (kind, outside) in enumerate(cases):
        text += f'[tables.T{i}]\n{LISTS}interpolation = "{kind}"\noutside = "{outside}"\n'
    text += '[inputs]\nu = {}\na = {}\nb = {}\n[outputs]\nv = { value = "Z(a, b)" }\n'
    text += "".join(f'y{i} = {{ value = "T{i}(u)" }}\n' for i in range(len(cases)))
    model, curve = Model(tmp_path, text), PchipInterpolator(X, Y)
    for u in (-3.0, -0.0, 0.0, 4.0, 10.0, 13.3, 20.0, 39.999, 40.0, 47.0):
        values = model.values(u=u)
        model.outputs(values, 0.0)
        held = float(np.clip(u, 0.0, 40.0))
        for i, (kind, outside) in enumerate(cases):
            where = u if outside == "extend" and kind != "previous" else held
            k = int(np.clip(np.searchsorted(X, where, side="right") - 1, 0, 2))
            exact = {
                "pchip": float(curve(where, extrapolate=True)),
                "previous": Y[int(np.searchsorted(X, where, side="right")) - 1],
                "linear": Y[k] + (Y[k + 1] - Y[k]) / (X[k + 1] - X[k]) * (where - X[k]),
            }[kind]
            if outside == "error" and not 0.0 <= u <= 40.0:
                exact = np.nan
            found = values[model.names.index(f"y{i}")]
            assert found == pytest.approx(exact, rel=1e-14, abs=1e-14, nan_ok=True), (kind, u)
    surface = RegularGridInterpolator((x, y), np.array(z))
    for a, b in ((0.3, 0.7), (2.9, 3.9), (1.0, 0.5), (3.0, 4.0), (-5.0, 1.0), (2.0, 9.0)):
        values = model.values(a=a, b=b)
        model.outputs(values, 0.0)
        held = surface((np.clip(a, 0.0, 3.0), np.clip(b, -1.0, 4.0)))
        assert values[model.names.index("v")] == pytest.approx(float(held), rel=1e-13)


def test_a_hundred_thousand_rows_of_a_file(tmp_path: Path) -> None:
    """A road of 1 mm rows, driven over at 30 m/s: a hundred rows in 3 ms."""
    way = np.arange(100_000) * 0.001
    height = np.sin(way) + 0.001 * np.random.default_rng(1).normal(size=len(way))
    rows = "".join(f"{a!r}, {b!r}\n" for a, b in zip(way.tolist(), height.tolist(), strict=True))
    (tmp_path / "road.csv").write_text("way, height\n" + rows)
    (tmp_path / "Long.toml").write_text(TEXTS["LONG"])
    fmu = quick(tmp_path / "Long.toml", tmp_path)
    run = simulated(fmu, 0.5, 0.1, {"max_events": 10**6}, also=["event_count"])
    t = run["time"]
    s = 20 * t + 10 * (1 - np.cos(t))
    assert np.max(np.abs(run["height"] - np.interp(s, way, height))) < 1e-5
    assert abs(run["event_count"][-1] - np.floor(s[-1] / 0.001)) <= 1


@pytest.mark.parametrize("content", [
    "n, T,eta\n0, 3,1\n10.5,2.25,1e-1\n", "n;T;eta\n0;3;1\n10,5;2,25;1e-1\n",
    "\ufeffn\tT\teta\r\n0\t3\t1\r\n10.5\t2.25\t0.1\r\n", "sep=;\nn;T;eta\n0;3;\n10,5;2,25;1\n",
    'sep=,\n"n","T"\n0,3\n10.5,2.25\n', "sep=|\nn|T\n0|3\n10,5|2,25\n",
    "n (1,2);n;T\nx;0;3\n;10,5;2,25\n",
])  # fmt: skip
def test_columns_are_separated_as_spreadsheets_write_them(tmp_path: Path, content: str) -> None:
    (tmp_path / "f.csv").write_bytes(content.encode())
    text = 'name = "M"\n[tables.t]\nfile = "f.csv"\nx = "n"\ny = "T"\n[inputs]\nu = {}\n'
    table = read_text(tmp_path, text).tables["t"]
    assert table.axes[0].origins == (0.0, 0.0, 10.5)
    assert table.coefficients[0] == (3.0, 3.0, 2.25)


@pytest.mark.parametrize(("text", "expected"), cases(MISTAKES["tables"]))
def test_a_mistake_in_a_table_is_one_line(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "f.csv").write_text("a,b,b\n1,2,3\n")
    (tmp_path / "g.csv").write_text("a,d\n1,2\n2,inf\n")
    (tmp_path / "i.csv").write_text("a,d\n1,2,\n2,3,5\n")
    (tmp_path / "l.csv").write_text("sep=;\na;d\n0.5;1\n1,234;2\n")  # a thousand, or not
    (tmp_path / "n.csv").write_text("a;d\n1;1,100\n2;900\n")
    (tmp_path / "m.csv").write_text('a,d\n0,1\n"1,234",2\n')
    (tmp_path / "h.csv").write_bytes(b"a,d\n\xff\xfe\n")
    for file, rows in (("j", 5), ("k", 99_999)):  # so many below the quote
        (tmp_path / f"{file}.csv").write_text('a,d\n1,2\n2,"3\n' + "4,5\n" * rows)
    with pytest.raises(ModelFileError) as refused:
        read_text(tmp_path, text)
    message = str(refused.value)
    assert expected in message and "\n" not in message and len(message) < 500
