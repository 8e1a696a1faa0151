"""Values with units: exact where they are right, refused in one line where they are not."""

import decimal
import math
import random
from decimal import Decimal
from pathlib import Path

import pytest

from rparm import units
from rparm.errors import UserError, WrongValueError
from rparm.fmi.model import Variable
from rparm.runs import scenario
from rparm.runs.inputs import Polyline, Sines
from rparm.units import HERTZ, SECONDS, duration, rounded_up, typed_quantity, units_of
from tests.support.rparm_project import FMUS, MISTAKES, NAMES, declared, load
from tests.support.toy_model import DESCRIPTION, TOY, toy

PLANT = declared("rp_plant").variables
UNITS = """<UnitDefinitions>
    <Unit name="K"><BaseUnit K="1"/><DisplayUnit name="degC" factor="1" offset="-273.15"/></Unit>
    <Unit name="Pa"><BaseUnit kg="1" m="-1" s="-2"/><DisplayUnit name="bar" factor="1E-05"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Rise"><Real unit="K" relativeQuantity="true"/></SimpleType>
"""
PARAMETER = """<ScalarVariable name="{}" valueReference="{}" causality="parameter"
      variability="tunable"><Real {}/></ScalarVariable>"""
ADDED = (("heat", 'unit="K"'), ("rise", 'declaredType="Rise"'), ("pressure", 'unit="Pa"'))
VARIABLES = "".join(PARAMETER.format(name, 20 + i, x) for i, (name, x) in enumerate(ADDED))
WARM = toy(
    DESCRIPTION.replace("<TypeDefinitions>", UNITS).replace(
        "</ModelVariables>", f"{VARIABLES}</ModelVariables>"
    )
).variables


def literals(count: int = 500) -> list[str]:
    """Numbers as people write them, and as programs do."""
    chance = random.Random(1)
    given = [f"{chance.uniform(-999, 999):.{chance.randrange(17)}f}" for _ in range(count)]
    given += [f"{chance.uniform(-9, 9):.{i % 17}e}" for i in range(count)]
    return [*given, "0", "-0.0", "+7", ".5", "3.", "1e-300", "90", "300", "4.9e-324"]


def test_degrees_are_those_of_math_radians() -> None:
    for text in literals():
        for name, unit in (("q1", "deg"), ("dq1", "deg/s"), ("ddq1", "deg/s2")):
            for blank in ("", " "):
                assert PLANT[name].checked(f"{text}{blank}{unit}") == math.radians(float(text))
    assert PLANT["q1"].checked("90 deg") == math.pi / 2


@pytest.mark.parametrize(
    ("name", "unit", "power"),
    [
        ("q2", "mm", -3), ("q2", "cm", -2), ("q2", "km", 3), ("q2", "m", 0), ("f2", "kN", 3),
        ("f2", "mN", -3), ("tau1", "N.mm", -3), ("tau1", "N·mm", -3), ("tau1", "kN.m", 3),
        ("g", "mm/s2", -3), ("g", "cm/s²", -2), ("I1z", "kg.cm2", -4), ("dq2", "m/ms", 3),
        ("stop_stiffness2", "N/mm", 3), ("q2", "um", -6), ("g", "dm/cs2", 3), ("tau1", "W.ms", -3),
    ],
)  # fmt: skip
def test_prefixes_give_the_nearest_double(name: str, unit: str, power: int) -> None:
    with decimal.localcontext(prec=400, Emin=-9999, Emax=9999):
        for text in literals():
            exact = Decimal(text).scaleb(power)
            if exact >= 0 or name != "I1z" and not name.startswith("stop"):
                assert PLANT[name].checked(f"{text} {unit}") == float(exact)
    assert PLANT["q2"].checked("300 mm") == 0.3


def test_declared_display_units_have_factor_and_offset() -> None:
    assert WARM["heat"].checked("25 degC") == 298.15
    assert WARM["rise"].checked("25 degC") == 25.0
    assert WARM["pressure"].checked("1.2bar") == 120000.0
    assert list(WARM["heat"].units) == ["K", "degC", "mK"]
    for declaration in ('factor="0"', 'factor="nan"', 'factor="1" offset="x"'):
        text = f'<Unit name="x"><DisplayUnit name="y" {declaration}/></Unit>'
        with pytest.raises(ValueError, match=r"factor|float"):
            toy(DESCRIPTION.replace("<Type", f"<UnitDefinitions>{text}</UnitDefinitions><Type", 1))


@pytest.mark.parametrize("model", FMUS)
def test_a_variable_takes_its_own_unit_and_numbers_as_they_are(model: str) -> None:
    for variable in declared(model).variables.values():
        if variable.type == "Real":
            numbers = (max(variable.least, 1.0 / 3.0), 3) if variable.greatest > 3 else ()
            for number in numbers:
                assert variable.checked(number) == number
                for unit in {variable.unit} & set(variable.units):
                    assert variable.checked(f"{number!r} {unit}") == number
        assert bool(variable.units) == (
            variable.type == "Real" and variable.unit not in (None, "1")
        )


NUMBER = "expected a number, or a number and its unit (known: m, mm, cm, km), got"
WRONG = [
    *MISTAKES["value"]["rows"],
    *(
        ("q2", text, f"{NUMBER} {text!r}")
        for text in ("", "m", "nan m", "inf m", "-inf", "1,5 m", "1 000 m", "٣ m", "--1 m", "\n")
    ),
    ("q2", "9" * 500 + " m", f"{NUMBER} '999"),
]


@pytest.mark.parametrize(("name", "given", "message"), WRONG)
def test_what_is_no_value_is_refused_with_the_known_units(
    name: str, given: str, message: str
) -> None:
    with pytest.raises(WrongValueError) as caught:
        PLANT[name].checked(given)
    assert str(caught.value).startswith(message) and "\n" not in str(caught.value)


def test_a_boolean_has_no_unit() -> None:
    with pytest.raises(WrongValueError, match=r"^expected true or false, got '1 s'$"):
        TOY.variables["quiet"].checked("1 s")


def test_a_time_is_written_in_the_unit_that_fits() -> None:
    written = {
        0.002: "2 ms", 3.33255e8: "3.33255e8 s", 12.5: "12.5 s", 0.9999999: "1 s", 0.0: "0 s",
        0.99999: "999.99 ms", 2.02e-8: "20.2 ns", 1e-6: "1 us", -0.25: "-250 ms", 4e-12: "0.004 ns",
        math.inf: "inf s",
    }  # fmt: skip
    assert {time: duration(time) for time in written} == written


def test_the_command_line_needs_no_unit() -> None:
    assert typed_quantity("60", SECONDS) == typed_quantity(" 60000 ms", SECONDS) == 60.0
    assert typed_quantity("0.5", {}) == 0.5
    assert typed_quantity("1.5 min", SECONDS) == typed_quantity("90000000us", SECONDS) == 90.0
    assert typed_quantity("500 mHz", HERTZ) == typed_quantity("30 1/min", HERTZ) == 0.5
    assert typed_quantity("25 degC", units_of("K", {})) == 298.15
    for text in ("", "nan", "5 m", "1e999", "1 rad/s", "1 degC"):
        with pytest.raises(WrongValueError):
            typed_quantity(text, SECONDS)


def question(name: str, given: object) -> str:
    variable: Variable = PLANT[name]
    variable.checked(given)
    return variable.question(given)


def test_an_angle_beyond_a_turn_is_asked_about() -> None:
    for given, turns in ((90, "14.3"), (-90.0, "-14.3"), (6.29, "1")):
        text = f'{given:g} rad is {turns} turns, is that meant? In degrees it is "{given:g} deg".'
        assert question("q1", given) == text
    for name, given in (("q1", 6.28), ("q1", "900 deg"), ("q1", "90 rad"), ("dq1", 90), ("q2", 90)):
        assert question(name, given) == ""


def test_a_scenario_takes_units_wherever_it_takes_values(tmp_path: Path) -> None:
    text = MISTAKES["units"]["text"]
    path = tmp_path / "units.toml"
    path.write_text(text.format(stop='"0.0012 ks"', force='"2000 mN"'), encoding="utf-8")
    run = scenario.load(path, declared("rp_plant"))
    assert (run.start, run.stop, run.steps) == (0.5, 1.2, (0.1, 0.2))
    assert (run.parameters, run.initial) == ({"l1": 0.5}, {"q1": math.radians(-45)})
    assert run.signals == {
        "tau1": Sines(0.3, ((2.0, 0.5, math.pi / 2),)),
        "f2": Polyline(((0.0, 1000.0), (1.0, 2.0))),
    }
    assert run.questions == ()
    for stop, force, message in (
        ('"1 m"', "1", r"\[time\] stop: unknown unit 'm', did you mean 'ms'\?"),
        ("2", '"1 deg"', r"\[inputs.f2\] table\[1\]: unknown unit 'deg' \(known: N, mN, kN\)"),
    ):
        path.write_text(text.format(stop=stop, force=force), encoding="utf-8")
        with pytest.raises(UserError, match=message):
            scenario.load(path, declared("rp_plant"))


def test_pages_write_units_as_people_do() -> None:
    given = {"kg.m2/s2": "kg·m²/s²", "m3/(s.Pa0.5)": "m³/(s·Pa0.5)", "m2.5.s3": "m2.5·s³", None: ""}
    for text, shown in given.items():
        assert units.unit(text) == shown


def test_no_scenario_of_the_project_is_asked_about() -> None:
    assert not [name for name in NAMES if load(name).questions]


@pytest.mark.parametrize("value", [1.21e-8, 1.2e-8, 9.99e-14, 1.0, 0.0, 2.0**-1074])
def test_bounds_are_printed_rounded_up(value: float) -> None:
    for digits in (1, 2):
        assert value <= float(rounded_up(value, digits)) <= value * (1 + 10.0**-digits) + 1e-323
