"""The command: its JSON, its files, which rparm runs again, and a line for each mistake."""

import json
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.identification.synthetic import ARM, save, write
from tests.support.rparm_project import FMUS, MISTAKES, assert_one_line, call

GIVEN = ("--inputs", "tau1", "f2", "--measured", "q1", "q2")
KNOWN = ("--set", "I1z=0.12", "a=110mm", "l1=0.55")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two seconds of the arm."""
    return write(replace(ARM, duration=2.0), tmp_path_factory.mktemp("logs") / "log.csv", 1)


@pytest.fixture
def identify(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Call the command on the log, or another one; exit code, output and error."""

    def run(*options: object, path: Path = log, given: Sequence[str] = GIVEN):
        output = ("--output", tmp_path / "output")
        return call(capsys, "identify", FMUS["rp_manipulator"], path, *given, *options, *output)

    return run


def changed(log: Path, folder: Path, row: int, column: int, text: str) -> Path:
    """A log with one value replaced."""
    lines = log.read_text().splitlines()
    cells = lines[row].split(",")
    cells[column] = text
    lines[row] = ",".join(cells)
    path = folder / "changed.csv"
    path.write_text("\n".join(lines))
    return path


# ---- results -------------------------------------------------------------------------------------


def test_json_has_what_was_found(identify, tmp_path: Path) -> None:
    second = write(replace(ARM, duration=2.0), tmp_path / "second.csv", 2)
    code, out, _ = identify("--parameters", "m2", *KNOWN, "--validate", second, "--json")
    found = json.loads(out)
    assert code == found["exit_code"] == 0
    m2 = found["parameters"]["m2"]
    assert m2["low"] < 1.1 < m2["high"] and m2["low"] < m2["value"] < m2["high"]
    assert found["unidentifiable"] == [] and 0.8 < found["chi2"] < 1.2
    assert found["whiteness"].keys() == {"q1", "q2"} and found["whiteness"]["q1"]["white"]
    assert found["validation"]["follows"] == {"q1": 2.0, "q2": 2.0}
    assert all(Path(file).is_file() for file in found["files"])


def test_what_cannot_be_known_is_null(identify) -> None:
    code, out, _ = identify("--parameters", "m2,I1z,I2z", "--set", "a=0.11", "l1=0.55", "--json")
    found = json.loads(out)
    assert code == 0 and found["unidentifiable"] == [["I1z", "I2z"]]
    assert found["parameters"]["I1z"]["low"] is None
    assert found["sums"].keys() == {"I1z + I2z"}
    assert found["warnings"] == ["Cannot be known: I1z + I2z."]


def test_the_files_run_again(identify, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert identify("--parameters", "m2", *KNOWN)[0] == 0
    folder = tmp_path / "output"
    code, out, _ = call(capsys, folder / "scenario.toml", "--json", "--output", tmp_path / "report")
    (scenario,) = json.loads(out)["scenarios"]
    assert code == 0
    for compared in scenario["runs"][0]["measured"].values():
        assert 0.9e-4 < compared["rms"] < 1e-3  # noise of the log, and a start state's that grows
    values = tomllib.loads((folder / "parameters.toml").read_text())["parameters"]
    assert values["a"] == 0.11 and values["m2"] == pytest.approx(1.1, rel=1e-3)
    space = {"ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues"}
    parsed = etree.parse(folder / "parameters.ssv")
    written = {
        node.get("name"): float(node[0].get("value"))
        for node in parsed.iterfind(".//ssv:Parameter", space)
    }
    assert written == {name: x for name, x in values.items() if name in written}
    assert {"m2", "a"} <= written.keys()


def test_columns_may_have_other_names_and_units(identify, log: Path, tmp_path: Path) -> None:
    table = np.loadtxt(log, delimiter=",", skiprows=1)
    table[:, 3] = np.degrees(table[:, 3])
    table[:, 4] *= 1000
    path = tmp_path / "other.csv"
    names = "t;torque;f2;enc1;enc2"
    np.savetxt(path, table, fmt="%.17g", delimiter=";", header=names, comments="")
    columns = "--columns", "time=t", "tau1=torque", "q1=enc1", "q2=enc2"
    found = [
        json.loads(identify("--parameters", "m2", *KNOWN, "--json", *more, path=file)[1])
        for file, more in ((log, ()), (path, (*columns, "--units", "q1=deg", "q2=mm")))
    ]
    values = [each["parameters"]["m2"]["value"] for each in found]
    assert values[0] == pytest.approx(values[1], rel=1e-9)


def test_the_clock_of_the_log_makes_no_difference(
    identify, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Doubles near 1.7e9 are 2.4e-7 s apart, more than the fit moves a delay."""
    head, *rows = log.read_text().splitlines()
    cells = [row.split(",", 1) for row in rows]
    later = [
        f"{Decimal('1700000000.25') + Decimal(repr(float(t)))},{others}" for t, others in cells
    ]
    path = tmp_path / "later.csv"
    path.write_text("\n".join([head, *later]))
    found = []
    for file in (log, path):
        code, out, _ = identify("--parameters", "m2", *KNOWN, "--delay", "--json", path=file)
        assert code == 0
        found.append(json.loads(out)["parameters"])
    for name in ("m2", "delay"):
        for end in ("value", "low", "high"):
            ends = [parameters[name][end] for parameters in found]
            assert ends[0] == pytest.approx(ends[1], rel=1e-9, abs=1e-12)
    file = tmp_path / "output/scenario.toml"
    code, out, _ = call(capsys, file, "--json", "--output", tmp_path / "report")
    (scenario,) = json.loads(out)["scenarios"]
    assert code == 0 and scenario["runs"][0]["measured"]["q1"]["rms"] < 1e-3


@pytest.mark.parametrize(
    ("row", "size", "code", "begin"),
    [(slice(200, 1200, 200), 5e-3, 0, "identified"), (slice(700, 701), 0.1, 1, "failed")],
)
def test_what_is_far_above_noise_is_said_in_the_last_line(
    row: slice, size: float, code: int, begin: str, identify, log: Path, tmp_path: Path
) -> None:
    """Outliers add their squares: 5 of 50 deviations of the noise, and 1 of 1000, to 4004 rows."""
    table = np.loadtxt(log, delimiter=",", skiprows=1)
    table[row, 3] += size
    path = tmp_path / "outliers.csv"
    save(path, table[:, 0], table[:, 1:3], table[:, 3:])
    ended, out, error = identify("--parameters", "m2", *KNOWN, "--json", path=path)
    last, found = error.splitlines()[-1], json.loads(out)
    assert ended == code and last.startswith(f"{begin}: chi2 is ") and "units, outliers" in last
    outliers = len(table[row]) * (size / 1e-4) ** 2
    assert found["chi2"] == pytest.approx(1 + outliers / (2 * len(table)), rel=0.3)
    assert (found["exit_code"], found["passed"]) == (code, code == 0)
    assert any(text.startswith("Chi2 is") for text in found["warnings"])


def test_swallowed_rows_are_said(identify, log: Path, tmp_path: Path) -> None:
    lines = log.read_text().splitlines()
    noted = [lines[0] + ",note", *(f"{line},ok" for line in lines[1:])]
    noted[301], noted[361] = f'{lines[301]},"', f'{lines[361]},"'
    path = tmp_path / "noted.csv"
    path.write_text("\n".join(noted))
    code, out, _ = identify("--parameters", "m2", *KNOWN, "--json", path=path)
    joined, gap, *_ = json.loads(out)["warnings"]
    assert code == 0 and "lines 302 to 362 are one row" in joined
    assert "a gap of 0.061 s" in gap


# ---- mistakes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("options", "message"), MISTAKES["identify"]["options"])
def test_a_mistake_in_the_options_is_one_line(options: list[str], message: str, identify) -> None:
    code, _, error = identify(*options)
    assert code == 2 and message in error
    assert_one_line(error)


@pytest.mark.parametrize(("given", "message"), MISTAKES["identify_variables"]["rows"])
def test_a_wrong_variable_is_one_line(given: Sequence[str], message: str, identify) -> None:
    code, _, error = identify("--parameters", "m2", given=given)
    assert code == 2 and message in error
    assert_one_line(error)


@pytest.mark.parametrize(("row", "column", "text", "message"), MISTAKES["identify_log"]["rows"])
def test_a_mistake_in_a_log_is_one_line(
    row: int, column: int, text: str, message: str, identify, log: Path, tmp_path: Path
) -> None:
    path = changed(log, tmp_path, row, column, text)
    code, _, error = identify("--parameters", "m2", path=path)
    assert code == 2 and message in error and str(path) in error
    assert_one_line(error)


def test_short_and_constant_logs_are_refused(identify, log: Path, tmp_path: Path) -> None:
    lines = log.read_text().splitlines()
    path = tmp_path / "log.csv"
    constant = [lines[0], *(",".join([*line.split(",")[:3], "1", "2"]) for line in lines[1:])]
    for content, message in (
        (lines[:2], "has 1 rows, a segment needs 20"),
        (lines[:10], "has 9 rows, a segment needs 20"),
        (lines[:300], "a segment needs 0.4 s"),
        (constant, "column 'q1' is constant"),
        (lines[:1], "has no rows"),
    ):
        path.write_text("\n".join(content))
        code, _, error = identify("--parameters", "m2", path=path)
        assert code == 2 and message in error
        assert_one_line(error)


ARM_FMU = FMUS["rp_manipulator"]
TWICE = ("--parameters", "m2", *GIVEN)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        # a copy would make the intervals too narrow
        ((ARM_FMU, "LOG", "LOG", *TWICE), "is there twice"),
        ((ARM_FMU, "LOG", *TWICE, "--validate", "LOG"), "is fitted, expected another log"),
        ((ARM_FMU, "LOG", *TWICE, "--segment", "1e-9"), "has 20 rows in 0.019 s, expected at"),
        ((ARM_FMU, "LOG", *TWICE, "--segment", "0.018"), "has 20 rows in 0.019 s, expected at"),
        (("LOG", ARM_FMU), "log.csv: expected an FMU (.fmu)"),
        (("rp_manipulatr", "LOG"), "did you mean 'rp_manipulator'?"),
        ((), ""),
        ((ARM_FMU,), ""),
        (("--demo", ARM_FMU), ""),
        (("--demo", "--set", "m2=1"), ""),
        (
            (FMUS["rp_plant"], "LOG", *TWICE[:4], "--measured", "impact_loss"),
            "'impact_loss' is no continuous output",
        ),
    ],
)
def test_what_does_not_fit_together_is_one_line(
    arguments: tuple, message: str, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [log if argument == "LOG" else argument for argument in arguments]
    code, _, error = call(capsys, "identify", *given)
    assert code == 2 and message in error
    assert_one_line(error)
