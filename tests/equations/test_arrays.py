"""Files with equations whose entries have indexes, and what is counted, named or rounded."""

from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from scipy.linalg import expm

import rparm
from rparm.errors import UserError
from tests.equations.compiled import c_model, read_text
from tests.equations.examples import METHODS, MODELS, initializing, made, simulated

TEXTS = MODELS["arrays"]
EACH_METHOD = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
COUNT = 60


def chain(n: int) -> str:
    return TEXTS["CHAIN"].format(n=n, masses=[1.0 + 0.01 * i for i in range(n)])


def written_out(n: int) -> str:
    """The chain without indexes, whose statements do not repeat."""
    numbers, lines = range(1, n + 1), ['name = "Chain"', "[parameters]", "k = { start = 40.0 }"]
    lines += [f"m{i} = {{ start = {1.0 + 0.01 * (i - 1)!r} }}" for i in numbers]
    lines += ["[inputs]", "F = { start = 0.3 }", "[states]"]
    lines += [f'x{i} = {{ start = "0.1 * {i} * (-1)**{i}", derivative = "v{i}" }}' for i in numbers]
    for i in numbers:
        before, after = "F" if i == 1 else f"f{i - 1}", 0 if i == n else f"f{i}"
        lines.append(f'v{i} = {{ derivative = "({before} - {after}) / m{i} - x{n + 1 - i}**3" }}')
    lines.append("[where]")
    for i in numbers[:-1]:
        d = f"(x{i} - x{i + 1})"
        lines.append(f'f{i} = "k * {d} * (1 + {d}**2)"')
    kinetic = " + ".join(f"m{i} * v{i}**2" for i in numbers)
    sines = " + ".join(f"sin(f{i}) * {i}" for i in numbers[:-1])
    lines += ["[outputs]", f'energy = {{ value = "({kinetic}) / 2 + ({sines})" }}']
    return "\n".join(lines)


@pytest.mark.parametrize("ranges, flat, rows", [
    ("i = 1..2, j = 1..3", [1, 2, 3, 4, 5, 6], [[1, 2, 3], [4, 5, 6]]),
    ("i = 1..3, j = 1..i", ["p", 2, 3, 4, 5, 6], [["p"], [2, 3], [4, 5, 6]]),
    ("i = 1..2, j = 1..2, k = 1..2", [*range(8)], [[[0, 1], [2, 3]], [[4, 5], [6, 7]]]),
    ("i = 1..1, j = 1..1", [7], [[7]]),
])  # fmt: skip
def test_starts_of_two_indexes_are_rows_or_one_list(
    tmp_path: Path, ranges: str, flat: list, rows: list
) -> None:
    """The last index is the fastest."""
    name = f"x[{','.join(part.split()[0] for part in ranges.split(', '))}]"
    text = f'name = "M"\n[parameters]\np = {{ start = 1 }}\n[states]\n"{name}" = '
    text += f'{{ for = "{ranges}", derivative = "1", start = %s }}'
    found = []
    for starts in (flat, rows):
        states = read_text(tmp_path, text % starts).of("states")
        found.append({x.name: x.start if x.initial is None else x.initial.text for x in states})
    assert found[0] == found[1] and [*found[0].values()] == flat


def test_loops_have_the_bits_of_statements_written_out() -> None:
    """All functions of a model: right side, Jacobian, series, outputs, derivatives of outputs."""
    loops, plain = made(chain(COUNT)), made(written_out(COUNT))
    elements = [f"{base}[{i}]" for base in "xv" for i in range(1, COUNT + 1)]
    for method in METHODS.values():
        first = simulated(loops, 0.5, 0.1, {"solver_method": method})
        second = simulated(plain, 0.5, 0.1, {"solver_method": method})
        assert np.ptp(first["energy"]) > 0.01
        assert first["energy"].tobytes() == second["energy"].tobytes()
        for name in elements:
            other = name.replace("[", "").replace("]", "")
            assert first[name].tobytes() == second[other].tobytes(), name
    slopes = []
    for fmu in (loops, plain):
        instance = initializing(fmu)
        instance.fmi.exitInitializationMode()
        by_name = {v.name: v.valueReference for v in instance.loaded.description.modelVariables}
        outputs = [by_name[n] for n in by_name if n == "energy" or n.startswith("der_v")]
        knowns = [by_name[n] for n in by_name if n[0] in "xF"]
        slopes.append(
            [instance.fmi.getDirectionalDerivative(outputs, [known], [1.0]) for known in knowns]
        )
    assert slopes[0] == slopes[1] and np.count_nonzero(slopes[0]) > 3 * COUNT


def test_the_text_of_a_model_does_not_grow_with_its_arrays(tmp_path: Path) -> None:
    """Nor with a falling index, x[n+1-i]; written out, 900 indicators took 110 s to compile."""

    def lines(text: str, *names: str) -> int:
        source = c_model.source(read_text(tmp_path, text))
        parts = [source.split(f" {name}(")[-1].split("\n}\n")[0] for name in names] or [source]
        kept = [line for part in parts for line in part.splitlines() if line[:5] != "    {"]
        return sum(line.endswith((";", "{", "}")) for line in kept)  # some have two lines

    assert lines(chain(210)) == lines(chain(260)) < 1500
    cells = [TEXTS["CELLS"].replace("300", n) for n in ("100", "150")]
    first, second = (lines(text, "describe", "derivatives", "indicators") for text in cells)
    assert first == second


def test_a_check_holds_for_each_element() -> None:
    instance = initializing(made(chain(COUNT)))
    (m,) = (v for v in instance.loaded.description.modelVariables if v.name == "m[17]")
    instance.fmi.setReal([m.valueReference], [-1.0])
    with pytest.raises(FMICallException):
        instance.fmi.exitInitializationMode()
    assert "masses must be positive" in instance.messages[-1].text


@EACH_METHOD
def test_a_rod_follows_its_modes(method: int) -> None:
    n, d, t = 100, 1 / 101, 0.05
    run = simulated(made(TEXTS["HEAT"]), t, t, {"solver_method": method})
    found = np.array([run[f"T[{i}]"][-1] for i in range(1, n + 1)])
    at = np.arange(1, n + 1) * d
    modes = np.array([np.sin(np.pi * k * at) for k in range(1, n + 1)])
    decays = 4 / d**2 * np.sin(np.pi * np.arange(1, n + 1) * d / 2) ** 2
    weights = 2 * d * modes @ (np.sin(np.pi * at) - 0.5 * at)
    cells = 0.5 * at + (weights * np.exp(-decays * t)) @ modes
    assert found == pytest.approx(cells, abs=2e-9)


@pytest.mark.parametrize("seed", range(2))
def test_a_band_has_the_solution_of_a_full_matrix(seed: int, tmp_path: Path) -> None:
    """Of random sparse equations in any order; a state that follows all others has a full row."""
    chance, n = np.random.default_rng(seed), 64
    order, near = chance.permutation(n), np.tri(n, k=2) * np.tri(n, k=2).T
    matrix = near * (chance.random((n, n)) < 0.7) * chance.normal(size=(n, n))
    matrix = (matrix - np.diag(np.geomspace(2.0, 1e3, n)))[order][:, order]
    rates = [" + ".join(f"{a} * x{j}" for j, a in enumerate(row) if a) for row in matrix]
    text = 'name = "Sparse"\n[parameters]\np = { start = 0 }\n[states]\n'
    text += "".join(f'x{i} = {{ start = 1, derivative = "{r}" }}\n' for i, r in enumerate(rates))
    full = f'y = {{ derivative = "p * ({" + ".join(f"x{i}" for i in range(n))})" }}'
    works = []
    for own in (text, text.replace("Sparse", "Full") + full):
        assert ("struct band band" in c_model.source(read_text(tmp_path, own))) == (own is text)
        counted = ["solver_steps", "solver_rhs_evaluations"]
        run = simulated(made(own), 1.0, 1.0, {"solver_method": 2}, also=counted)
        found = [run[f"x{i}"][-1] for i in range(n)]
        assert found == pytest.approx(expm(matrix) @ np.ones(n), abs=1e-8)
        works.append([run[name][-1] for name in counted])
    assert works[0] == pytest.approx(works[1], rel=0.05)


def test_a_plate_has_two_indexes() -> None:
    n = 6
    run = simulated(made(TEXTS["PLATE"]), 1.0, 1.0, {"solver_method": 4})
    line = np.diag(-2.0 * np.ones(n)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    matrix = np.kron(line, np.eye(n)) + np.kron(np.eye(n), line)
    exact = expm(matrix) @ np.outer(np.arange(1, n + 1), np.arange(1, n + 1)).ravel()
    names = [f"T[{i},{j}]" for i in range(1, n + 1) for j in range(1, n + 1)]
    assert [run[name][-1] for name in names] == pytest.approx(exact, abs=1e-10)
    description = fmpy.read_model_description(made(TEXTS["PLATE"]))
    assert description.variableNamingConvention == "structured"
    assert {"T[6,6]", "der_T[6,6]"} <= {v.name for v in description.modelVariables}


@EACH_METHOD
def test_each_ball_bounces_by_itself(method: int) -> None:
    run = simulated(made(TEXTS["BALLS"]), 6.0, 0.01, {"solver_method": method})
    for i, e in enumerate((0.5, 0.6, 0.7), 1):
        impacts, time, speed = 0, np.sqrt(2 * i / 9.81), e * np.sqrt(2 * i * 9.81)
        while time <= 6.0:
            impacts += 1
            if speed <= 0.1:
                break
            time, speed = time + 2 * speed / 9.81, e * speed
        assert run[f"hits[{i}]"][-1] == impacts
    assert np.array_equal(run["near"], np.floor(run["h[1]"] * 10 + 0.5))
    assert np.array_equal(run["above"], np.ceil(-run["h[2]"] * 3))
    jumps = np.arange(len(run["time"])) % 25 == 0  # where either side is right
    assert run["saw"][~jumps] == pytest.approx(run["time"][~jumps] % 0.25, abs=1e-12)


def test_numbers_of_other_units_are_declared_in_si() -> None:
    description = fmpy.read_model_description(made(TEXTS["MACHINE"]))
    shown = {v.name: (v.unit, v.displayUnit, float(v.start)) for v in description.modelVariables
             if v.displayUnit and v.causality == "parameter"}  # fmt: skip
    assert shown == {
        "way": ("m", "mm", 0.3),
        "heat": ("K", "degC", 293.15),
        "ice": ("K", "degC", 273.15),
        "turn": ("rad", "deg", np.pi / 2),
        "speed": ("rad/s", "rpm", 2 * np.pi),
    }
    (way,) = (v for v in description.modelVariables if v.name == "way")
    assert (float(way.min), float(way.max)) == (-0.001, 1.0)
    units = {unit.name: unit.displayUnits for unit in description.unitDefinitions}
    (celsius,) = units["K"]
    assert (celsius.factor, celsius.offset) == (1.0, -273.15)
    (rpm,) = (display for display in units["rad/s"] if display.name == "rpm")
    assert 2 * np.pi * rpm.factor == pytest.approx(60.0, rel=1e-15)
    assert [*map(str, units["m"])] and [d.name for d in units["m"]] == ["mm"]


@pytest.mark.parametrize("version", ["", "fmi3"])
@EACH_METHOD
def test_right_sides_of_a_whole_array_see_the_values_before(method: int, version: str) -> None:
    """A line of exponentials, which a sampler shifts by one; a matrix that an event turns."""
    fmu = made(TEXTS["LINE"])
    start = {"solver_method": method}
    run = simulated(fmu.parent / version / fmu.name, 3.0, 0.1, start, relative_tolerance=1e-10)
    rates, expected = -np.arange(6) / 10, np.arange(6.0) * np.exp(-np.arange(6) / 20)
    for span in (1.0, 1.0, 0.5):
        expected = np.roll(expected, 1) * np.exp(rates * span)
    assert [run[f"x[{i}]"][-1] for i in range(6)] == pytest.approx(expected, rel=1e-8)
    z = np.array([[run[f"z[{i},{j}]"] for j in (1, 2, 3)] for i in (1, 2)])
    assert np.array_equal(z[..., 0], [[1, 2, 3], [4, 5, 6]])
    assert np.array_equal(z[..., -1], [[6, 5, 4], [3, 2, 1]])


@pytest.mark.parametrize("version", ["", "fmi3"])
def test_a_unit_with_halves_has_no_base_unit(version: str) -> None:
    """FMI has no fraction there. What users write is converted as any other unit."""
    fmu = made(TEXTS["VALVE"])
    fmu = fmu.parent / version / fmu.name
    description = fmpy.read_model_description(fmu)
    units = {unit.name: unit for unit in description.unitDefinitions}
    halves = ["V/Hz0.5", "flow_per_root", "kg0.5/(m0.5.s)", "m3/(s.Pa0.5)"]
    assert sorted(name for name, unit in units.items() if unit.baseUnit is None) == halves
    (kv,) = units["m3/(s.Pa0.5)"].displayUnits
    assert (kv.name, kv.factor) == ("m3/(h.bar0.5)", pytest.approx(3600 * 1e5**0.5, rel=1e-15))
    for given, flow in (
        ("5 m3/(h.bar0.5)", 5 * 5**0.5), ("20 l/(min.kPa0.5)", 1.2 * 500**0.5),
        ("3 m³/(h·bar0.5)", 3 * 5**0.5), (2 / 3600 / 1e5**0.5, 2 * 5**0.5),
    ):  # fmt: skip
        start = {"Kv": given, "drop": "5 bar", "density": "7 nV/Hz0.5"}
        run = rparm.simulate(
            fmu, stop_time=7200.0, step=3600.0, start_values=start, outputs=["h", "q", "again", "V"]
        )
        assert run["q"] == pytest.approx(flow / 3600, rel=1e-14)
        assert run["again"] == pytest.approx(flow / 3600 * 2.5, rel=1e-14)
        assert run["h"][-1] == pytest.approx(flow, rel=1e-9)
        assert run["V"] == pytest.approx(7e-9 * 2000**0.5, rel=1e-14)
    with pytest.raises(UserError, match="Kv: unknown unit 'm3/h'"):
        rparm.simulate(fmu, stop_time=1.0, step=1.0, start_values={"Kv": "1 m3/h"})


@pytest.mark.parametrize("version", ["", "fmi3"])
def test_types_of_similar_names_are_told_apart(version: str) -> None:
    fmu = made(TEXTS["MACHINE"])
    description = fmpy.read_model_description(fmu.parent / version / fmu.name)
    items = {v.name: [item.name for item in v.declaredType.items]
             for v in description.modelVariables if v.name in ("drive", "Drive")}  # fmt: skip
    assert items == {"drive": ["slow", "fast"], "Drive": ["a", "b"]}
    names = [kind.name for kind in description.typeDefinitions]
    assert len({*names, *(v.name for v in description.modelVariables)}) == (
        len(names) + len(description.modelVariables)
    )


@pytest.mark.parametrize("drive", [1, 2])
def test_what_is_counted_and_named_changes_at_ticks(drive: int) -> None:
    fmu = made(TEXTS["MACHINE"])
    run = simulated(fmu, 0.6, 0.1, {"drive": drive})
    ticks = np.arange(len(run["time"]))
    assert np.array_equal(run["count"], 3 * (ticks + 1))
    assert np.array_equal(run["is_odd"], ticks % 2 == 1)
    is_broken = (ticks >= 2) & (drive == 2)
    assert np.array_equal(run["state"], np.where(is_broken, 3, 1))
    assert np.array_equal(run["name"], run["state"])
    assert np.array_equal(run["same"], (run["is_odd"] != 0) == (run["count"] == 3))


def test_a_count_that_no_integer_holds_is_named() -> None:
    instance = initializing(made(TEXTS["MACHINE"]))
    by_name = {v.name: v.valueReference for v in instance.loaded.description.modelVariables}
    instance.fmi.setInteger([by_name["gain"]], [2_000_000_000])  # a tick at the start adds it
    with pytest.raises(FMICallException):
        instance.fmi.exitInitializationMode()
    assert "count is beyond 2147483647" in instance.messages[-1].text


def test_a_moving_number_beyond_all_counts_has_no_whole_part() -> None:
    text = 'name = "Far"\n[states]\nx = { derivative = "1" }\n[outputs]\ny = { value = "floor(x)" }'
    fmu = made(text)
    for x in (-2.5, 7.0, 1e6 + 0.5):
        run = simulated(fmu, 0.1, 0.1, {"x": x})
        assert np.array_equal(run["y"], np.floor(run["x"]))
    for x in (2.0**30, -1e12):
        with pytest.raises(FMICallException):
            simulated(fmu, 0.1, 0.1, {"x": x})
