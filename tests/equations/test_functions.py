"""Functions of files with equations, compound events, and values that follow from parameters."""

from math import comb
from pathlib import Path

import mpmath
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from rparm.fmu_tools.compiler.expressions import expression
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from rparm import api
from rparm.fmi.fmu_file import Fmu
from tests.equations.compiled import Model
from tests.equations.examples import METHODS, MODELS, initializing, made, quick, simulated
from tests.support.rparm_project import Console

TEXTS = MODELS["functions"]
EACH_METHOD = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


@pytest.fixture(scope="module")
def length(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return Model(tmp_path_factory.mktemp("length"), TEXTS["LENGTH"])


@pytest.mark.parametrize("power", [-1074, -1030, -664, -501, 0, 500, 664, 1021])
def test_a_length_has_no_square_that_overflows_or_vanishes(length: Model, power: int) -> None:
    """Along x = 3 s + 2 s t, y = 4 s - 3 s t with the size s; x is a state, y an input."""
    s = 2.0**power
    values, first, second = length.values(x=3 * s, y=4 * s), length.values(), length.values()
    first[length.names.index("x")], first[length.names.index("y")] = 2 * s, -3 * s
    length.outputs(values, 0.0)
    length.derivatives(values, 0.0, 0.0, first, second)
    found = [dict(zip(length.names, v, strict=False))["length"] for v in (values, first, second)]
    own = mpmath.taylor(lambda t: mpmath.hypot(3 + 2 * t, 4 - 3 * t), 0, 12)
    assert found[0] == 5 * s == expression.hypot(3 * s, 4 * s)
    assert found[1:] == pytest.approx([-1.2 * s, 2 * float(own[2]) * s], rel=1e-14, abs=5e-324)
    inputs = np.zeros((1, 4))
    inputs[0, :2] = 4 * s, -3 * s
    values[length.names.index("rate")] = 2 * s
    (_, z), exact = length.series(values, 0.0, 1.0, inputs, 11), [float(c) for c in own]
    assert z[1:] == pytest.approx(
        [c * s / (k + 1) for k, c in enumerate(exact[:11])], rel=1e-12, abs=1e-322
    )


@EACH_METHOD
def test_sign_of_a_velocity_switches_where_it_turns(method: int) -> None:
    """Half a swing about k x = F after the other, each shorter by 4 F / k in its range."""
    fmu = made(TEXTS["FRICTION"].replace("start = 2.0", "start = 0.3"))
    run = simulated(fmu, 6.0, 0.01, {"solver_method": method}, relative_tolerance=1e-11)
    w, center, half = np.sqrt(3.0 / 0.5), 0.1, np.pi / np.sqrt(3.0 / 0.5)
    n = np.floor(run["time"] / half)
    amplitude = (1.9 - center - 2 * center * n) * (-1) ** n
    exact = center * (-1) ** n + amplitude * np.cos(w * (run["time"] - n * half))
    assert np.max(np.abs(run["x"] - exact)) < 1e-8
    assert np.max(np.abs(run["power"] - run["force"] * run["v"])) < 1e-12


@EACH_METHOD
def test_an_event_of_several_relations_happens_when_the_whole_comes_true(method: int) -> None:
    """x = sin t: armed above 0.5, left above 0.95; armed again below 0.9, left below -0.5."""
    fmu = made(TEXTS["GATE"])
    run = simulated(fmu, 12.0, 0.01, {"solver_method": method}, also=["armed", "open"])
    assert np.all(run["open"])
    t = run["time"]
    up, top, back = np.arcsin(0.5), np.arcsin(0.95), np.pi - np.arcsin(0.9)
    low = np.pi + np.arcsin(0.5)
    armed = np.zeros(len(t), bool)
    passed = np.zeros(len(t))
    for turn in (0, 2 * np.pi):
        armed |= ((t > up + turn) & (t < top + turn)) | ((t > back + turn) & (t < low + turn))
        passed += 1.0 * (t > top + turn) + (t > low + turn)
    assert np.array_equal(run["armed"] != 0, armed)
    assert np.array_equal(run["passed"], passed)


def room(stop: float, is_enabled: bool) -> np.ndarray:
    """Temperature each second: exponentials from switch to switch; open from 30 s to 40 s."""
    T, t, heating, found = 18.0, 0.0, True, [18.0]
    for second in range(int(stop)):
        while t < second + 1:
            is_open = 30 <= t < 40
            heating = heating and not is_open
            rate = (4 if is_open else 1) / 50
            goal = 5 + (30 if heating and is_enabled else 0)
            limit = 21.0 if heating else 19.0
            there = second + 1.0
            is_ahead = not is_open and (limit - T) * (goal - limit) > 0
            if is_ahead:
                there = min(there, t + np.log((T - goal) / (limit - goal)) / rate)
            if not is_open and not heating and T < 19.0:
                heating = True
                continue
            switches = is_ahead and there < second + 1.0
            T = limit if switches else goal + (T - goal) * np.exp(-rate * (there - t))
            t, heating = there, heating != switches
        found.append(T)
    return np.array(found)


@EACH_METHOD
@pytest.mark.parametrize("is_enabled", [True, False])
def test_a_thermostat_sees_an_open_window(method: int, is_enabled: bool) -> None:
    fmu = made(TEXTS["ROOM"])
    times = [(0.0, 0), (30.0, 0), (30.0, 1), (40.0, 1), (40.0, 0), (100.0, 0)]
    run = simulated(
        fmu, 100.0, 1.0, {"solver_method": method, "enabled": is_enabled},
        input=np.array(times, [("time", "f8"), ("open", "?")]), relative_tolerance=1e-10,
    )  # fmt: skip
    assert np.max(np.abs(run["T"] - room(100.0, is_enabled))) < 1e-8


@EACH_METHOD
@pytest.mark.parametrize("version", ["", "fmi3"])
def test_a_clutch_locks_slips_and_opens(version: str, method: int) -> None:
    """Speeds are straight lines. Closed from 1 s to 8 s; too strong a drive from 3 s to 5 s."""
    fmu = made(TEXTS["CLUTCH"])
    given = [(0, 0, 4), (1, 0, 4), (1, 1, 4), (3, 1, 4), (3, 1, 20), (5, 1, 20), (5, 1, 4)]
    given += [(8, 1, 4), (8, 0, 4), (9, 0, 4)]
    run = simulated(
        fmu.parent / version / fmu.name, 9.0, 0.25, {"solver_method": method}, also=["locked"],
        input=np.array(given, [("time", "f8"), ("closed", "?"), ("drive", "f8")]),
        relative_tolerance=1e-10,
    )  # fmt: skip
    met, again = 1 + 28 / (12 + 20 / 3), 5 + (80 / 3) / (12 + 20 / 3)
    locked = 51 - 12 * (again - 5)
    end = locked + 2 * (8 - again)
    times = [0, 1, met, 3, 5, again, 8, 9]
    w1 = np.interp(run["time"], times, [20, 28, 10, 11, 51, locked, end, end + 8])
    w2 = np.interp(run["time"], times, [0, 0, 10, 11, 11 + 40 / 3, locked, end, end])
    np.testing.assert_allclose([run["w1"], run["w2"]], [w1, w2], rtol=0, atol=1e-7)
    t = run["time"]
    is_locked = ((t > met + 1e-9) & (t < 3)) | ((t > again) & (t < 8))
    is_inside = np.min(np.abs(t[:, None] - times), axis=1) > 1e-6
    assert np.array_equal((run["locked"] != 0)[is_inside], is_locked[is_inside])


# calls of X = 0.6 and Y = -0.25, with their values
OF_ONE = "sin cos tan asin acos atan sinh cosh tanh exp log log10 sqrt cbrt sign"
CALLS = {f"{name}(X)": getattr(mpmath, name)(0.6) for name in OF_ONE.split()}
CALLS |= {"cbrt(Y)": -mpmath.cbrt(0.25), "sign(Y)": -1, "sign(0 * X)": 0}
CALLS |= {"abs(Y)": 0.25, "min(X, Y)": -0.25, "max(Y, X)": 0.6, "floor(Y)": -1, "ceil(X)": 1}
CALLS |= {"round(X)": 1, "mod(Y, X)": 0.35, "hypot(X, Y)": 0.65, "X**3": 0.216, "X / Y": -2.4}
CALLS |= {"atan2(Y, X)": mpmath.atan2(-0.25, 0.6), "X**Y": mpmath.mpf(0.6) ** -0.25, "-X": -0.6}
CALLS |= {"sum(i = 1..n, i * X)": 3.6, "1 if X > 0 and not Y > 0 else 2": 1, "own(X)": 0.375}
CALLS |= {"twice(X)": 0.75}
CALLS |= {"line(X)": 3 - 0.2 / 0.6, "steps(X)": 3, "inside(X)": 3 - 0.2 / 0.6, "in_c(X, Y)": 3.85}
CALLS |= {"curve(X)": PchipInterpolator([0, 0.4, 1], [1, 3, 2])(0.6), "plane(X, Y)": 3.025}
CALLS |= {"floor(1e8 * X - 0.5)": 59999999}  # no float has it
SECTIONS = "functions parameters states discrete where outputs check"


def test_every_function_stands_in_every_place(tmp_path: Path) -> None:
    """Each call has one value wherever it stands; a condition on it gives the number 1."""
    (tmp_path / "Places.c").write_text(TEXTS["PLACES_C"])
    new: dict[str, list[str]] = {section: [] for section in SECTIONS.split()}
    new["functions"] += ["own = { arguments = ['X'], value = 'X / (1 + abs(X))' }"]
    new["functions"] += ["twice = { arguments = ['X'], value = 'own(X) + own(X)' }"]
    new["where"] += ["hypot = '5 * x'"]  # a name is no call
    new["outputs"] += ["named = { value = 'hypot + hypot(x, y)' }"]
    changes, exact = [], {"named": 3.65}
    for i, (call, value) in enumerate(CALLS.items()):
        own, fixed = (call.replace("X", x).replace("Y", y) for x, y in ("xy", "pq"))
        size, whole = abs(float(value)), int(np.floor(float(value)))
        near = f"abs(({{}}) - ({float(value)!r})) < 1e-12".format
        new["functions"] += [f"F{i} = {{ arguments = ['X', 'Y'], value = '{call}' }}"]
        new["parameters"] += [f"k{i} = {{ value = '{fixed}' }}"]
        new["states"] += [f"s{i} = {{ start = '{fixed}', derivative = '{own}' }}"]
        new["states"] += [f"{name}{i} = {{ derivative = '0' }}" for name in ("a", "b")]
        new["discrete"] += [f"c{i} = {{ start = '{fixed}' }}"]
        new["discrete"] += [f"{name}{i} = {{}}" for name in "defg"]
        new["discrete"] += [f"j{i} = {{ type = 'Integer' }}"]
        new["where"] += [f"m{i} = '{own}'"]
        new["outputs"] += [f"o{i} = {{ value = '{own}' }}", f"r{i} = {{ value = 'm{i} + k{i}' }}"]
        new["outputs"] += [f"t{i} = {{ value = 'F{i}(x, y)' }}"]
        new["check"] += [f"'c{i}' = '{near(fixed)}'"]
        changes += [
            f"[events.E{i}]\nwhen = '{near(own)}'\nwhile = '{near(own)}'\n"
            f"reinit = {{ a{i} = '{own}' }}\nset = {{ d{i} = '{own}', j{i} = 'floor({own})' }}\n"
            f"[sampled.S{i}]\nevery = '9 + abs({fixed})'\n"
            f"offset = '4 * abs({fixed}) / (1 + abs({fixed}))'\n"
            f"while = '{near(own)}'\nreinit = {{ b{i} = '{own}' }}\n"
            f"set = {{ e{i} = '{own}', f{i} = '1 if {near(own)} else 0', g{i} = 'time' }}\n"
        ]
        exact |= {f"{name}{i}": value for name in "abcdeot"}
        exact |= {
            f"s{i}": 6 * value,
            f"f{i}": 1,
            f"g{i}": 4 * size / (1 + size),
            f"j{i}": whole,
            f"r{i}": 2 * value,
        }
    text = TEXTS["PLACES"]
    for section, lines in new.items():
        text = text.replace(f"[{section}]\n", "\n".join([f"[{section}]", *lines, ""]))
    (tmp_path / "Places.toml").write_text(text + "\n" + "\n".join(changes))
    run = simulated(quick(tmp_path / "Places.toml", tmp_path, "-O0"), 5.0, 1.0, {})
    for name, value in exact.items():
        assert run[name][-1] == pytest.approx(float(value), rel=1e-12, abs=1e-12), name


@pytest.fixture(scope="module")
def charging() -> np.ndarray:
    """Voltages each 5 ms of a capacitor behind a diode, by scipy."""

    def rate(t: float, u: np.ndarray) -> np.ndarray:
        return (1e-12 * np.expm1((5 * np.sin(314 * t) - u) / 0.02585) - u / 1000) / 1e-5

    options = {"rtol": 1e-10, "atol": 1e-11, "max_step": 1e-4}
    at = np.linspace(0.0, 0.1, 21)
    return solve_ivp(rate, (0.0, 0.1), [0.0], "LSODA", t_eval=at, **options).y[0]


@EACH_METHOD
@pytest.mark.parametrize("step", [1e-3, 5e-3])
def test_a_diode_opens_within_a_step(charging: np.ndarray, method: int, step: float) -> None:
    """At the begin of the step its current is exp(-300)."""
    found = simulated(made(TEXTS["DIODE"]), 0.1, step, {"solver_method": method})
    np.testing.assert_allclose(found["u"][:: round(5e-3 / step)], charging, rtol=0, atol=1e-7)


@pytest.mark.parametrize("step", [0.01, 0.1, 1.0])
def test_what_vanishes_at_both_ends_of_a_step_is_seen(step: float) -> None:
    """Even powers of the sine have a binomial coefficient as their mean."""
    method = {"solver_method": METHODS["taylor"]}
    run = simulated(made(TEXTS["VANISHING"]), 4.0, step, method)
    for name, value in {"swing": comb(6, 3) / 2**4, "pulse": comb(64, 32) / 2**62}.items():
        assert run[name][-1] == pytest.approx(value, rel=0, abs=1e-8), name


# ---- Values that follow from parameters ----------------------------------------------------------


@pytest.fixture(scope="module")
def spring() -> Path:
    return made(MODELS["following_values"]["SPRING"])


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_state_starts_where_its_parameters_say(spring: Path, method: int, kind: str) -> None:
    if kind == "ModelExchange" and method > 1:
        pytest.skip("the importer integrates")
    start = {"solver_method": method, "l0": 2.0, "phi0": 1.1}
    run = simulated(
        spring, 3.0, 0.05, start, also=["k", "weight"], fmi_type=kind, relative_tolerance=1e-10
    )
    w, x0 = np.sqrt(9.81 / 2.0), 2.0 * np.cos(1.1)
    bound = 1e-8 if kind == "CoSimulation" else 1e-4
    assert np.max(np.abs(run["x"] - x0 * np.cos(w * run["time"]))) < bound
    assert set(run["k"]) == {2.0 * 9.81 / 2.0} and set(run["weight"]) == {2.0 * 9.81}
    assert run["energy"][0] == pytest.approx(9.81 / 2 * x0**2, rel=1e-14)
    assert set(run["largest"]) == {4.0}


def test_values_follow_while_parameters_are_set(spring: Path) -> None:
    """In initialization mode all values and their derivatives follow at once, later k does."""
    begun = initializing(spring)
    instance, at = begun.fmi, begun.loaded.references
    for l0, phi0 in ((1.0, 0.5), (3.0, -0.2)):
        instance.setReal([at["l0"], at["phi0"]], [l0, phi0])
        x, largest, k = instance.getReal([at["x"], at["largest"], at["k"]])
        assert (x, largest, k) == pytest.approx(
            (l0 * np.cos(phi0), 2 * l0, 2 * 9.81 / l0), rel=1e-15
        )
        by_l0 = instance.getDirectionalDerivative(
            [at[n] for n in ("x", "k", "energy")], [at["l0"]], [1.0]
        )
        expected = np.cos(phi0), -2 * 9.81 / l0**2, 9.81 * np.cos(phi0) ** 2
        assert by_l0 == pytest.approx(expected, rel=1e-13)
    instance.exitInitializationMode()
    instance.setReal([at["l0"]], [1.0])
    assert instance.getReal([at["k"], at["x"]]) == pytest.approx([2 * 9.81, 3.0 * np.cos(-0.2)])
    instance.reset()
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    assert instance.getReal([at["x"]])[0] == pytest.approx(1.5 * np.cos(0.3))


def test_limits_of_inputs_follow_at_once_within_each_other() -> None:
    """Also where a condition reads what another one decides."""
    begun = initializing(made(MODELS["following_values"]["LIMITS"]))
    instance, at = begun.fmi, begun.loaded.references
    instance.exitInitializationMode()
    instance.doStep(0.0, 0.1)
    for u, high in ((5.0, 1.0), (-5.0, 3.0), (0.5, 3.0), (2.0, -4.0), (-9.0, -1.0)):
        instance.setReal([at["u"], at["high"]], [u, high])
        expected = max(min(max(min(u, high), -2.0), 1.5), -3.0 if high > 0.0 else -1.0)
        assert instance.getReal([at["y"]]) == [expected]


@pytest.mark.parametrize("version", ["", "fmi3"])
def test_a_state_is_beyond_a_new_limit_from_the_next_step_on(version: str) -> None:
    """A relation of a state changes at events only: until then all values are as before it."""
    fmu = made(MODELS["following_values"]["BOUNDED"])
    with Fmu(fmu.parent / version / fmu.name) as opened, opened.instance("bounded") as instance:
        instance.set_up(0.0, None)
        instance.enter_initialization()
        instance.exit_initialization()
        values, t = instance.reals(["x", "y", "z", "der_x"]), 0.0
        for limit, top in ((2.0, 5.0), (0.5, 5.0), (0.5, 0.25), (2.0, 0.25), (0.5, 9.0)):
            values.get()
            x_before, _, _, rate_before = values.view.tolist()
            was_over = instance.discrete("over")
            instance.set("limit", limit)
            instance.set("top", top)
            values.get()
            x, _, _, rate = values.view.tolist()
            assert (x, rate, instance.discrete("over")) == (x_before, rate_before, was_over)
            instance.do_step(t, 2.0**-30)
            t += 2.0**-30
            values.get()
            x, y, z, rate = values.view.tolist()
            assert (y, z, instance.discrete("over")) == (min(x, limit), min(x, top), x > limit)
            assert rate == (0.5 if x > limit else 0.25)


def test_an_importer_cannot_set_a_start_that_follows(spring: Path) -> None:
    begun = initializing(spring)
    instance, at = begun.fmi, begun.loaded.references
    with pytest.raises(FMICallException):
        instance.setReal([at["x"]], [1.0])


def test_a_start_that_follows_survives_serialization(spring: Path) -> None:
    begun = initializing(spring), initializing(spring)
    first, second = (instance.fmi for instance in begun)
    at = begun[0].loaded.references
    first.setReal([at["l0"]], [2.5])
    first.exitInitializationMode()
    for i in range(7):
        first.doStep(i * 0.1, 0.1)
    content = first.serializeFMUstate(first.getFMUstate())
    second.exitInitializationMode()
    second.setFMUstate(second.deSerializeFMUstate(content))
    for instance in (first, second):
        instance.doStep(0.7, 0.1)
    names = [at[name] for name in ("x", "v", "largest")]
    assert first.getReal(names) == second.getReal(names)


@pytest.mark.parametrize(
    ("section", "name", "message"),
    [
        ("parameters", "k", "'k' follows from m, l0, g: set these"),
        ("initial", "x", "'x' follows from l0, phi0: set these"),
    ],
)
def test_a_scenario_does_not_set_it(
    spring: Path, tmp_path: Path, console: Console, section: str, name: str, message: str
) -> None:
    path = tmp_path / "spring.toml"
    path.write_text(
        f'fmu = "{spring}"\ntitle = "t"\ndescription = "d"\ntolerance = 1e-8\n'
        f"[time]\nstart = 0.0\nstop = 1.0\nstep = 0.1\n[{section}]\n{name} = 1.0\n"
    )
    code, _, err = console(str(path))
    assert code == 2 and message in err and err.count("\n") == 1


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_linear_model_is_made_at_states_that_are_given(spring: Path, version: str) -> None:
    path = spring if version == "2.0" else spring.parent / "fmi3" / spring.name
    found = api.linearize(path, at={"x": 0.7, "v": 0.1, "l0": 2.0})
    assert found.at["x"] == 0.7 and found.at["v"] == 0.1
    assert found.between.A[:2, :2].tolist() == [[0.0, 1.0], [-9.81 / 2.0, 0.0]]
    energy = found.C[found.outputs.index("energy")]
    assert energy == pytest.approx([2 * 9.81 / 2.0 * 0.7, 2.0 * 0.1, 0.0], rel=1e-14)
