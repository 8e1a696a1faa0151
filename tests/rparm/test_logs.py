"""Logs as inputs and for comparison: what they give, and one line for each mistake."""

import math
import os
import re
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from rparm.errors import UserError
from rparm.runs import inputs, scenario
from rparm.runs.scenario import Scenario
from tests.rparm.test_scenario import SWITCHED
from tests.support.rparm_project import FMUS, MISTAKES, Console
from tests.support.tables import cases
from tests.support.toy_model import DESCRIPTION, HEAD, TIME, TOY, toy

LOG = "time,force\n0.5,1\n1.5,3\n2.25,4.5\n"  # 2 t; the run is from 1 to 2
FORCE = "[inputs.force]\nfile = 'log.csv'\n"
Write = Callable[..., Path]


def loaded(write: Write, log: str | bytes = LOG, more: str = "", head: str = FORCE) -> Scenario:
    path = write(f"{HEAD}{TIME}{head}{more}")
    content = log if isinstance(log, bytes) else log.encode()
    (path.parent / "log.csv").write_bytes(content)
    return scenario.load(path, SWITCHED if "brake" in head else TOY)


# ---- what a right log gives ----------------------------------------------------------------------


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_logs_of_all_programs_are_read(write: Write, delimiter: str, end: str, mark: str) -> None:
    lines = [
        ["#", '"t [s], of the ""drive"""', " effort ", "text"],
        ["1", "0.5", " 1.0", f'"a{delimiter}b"'],
        [],
        ["2", '"1.5e0"', "+3.", "nan"],
        ["3", "2.25", "4.5", "ä"],
    ]
    rows = [delimiter.join(line) for line in lines]
    text = mark + end.join(rows)  # without an end of the last line
    keys = "column = 'effort'\ntime = 't [s], of the \"drive\"'\n"
    run = loaded(write, text, keys)
    assert run.inputs["force"].tolist() == [2.0, 2.5, 3.0, 3.5, 4.0]
    assert not run.inputs["force"].flags.writeable


def test_rows_are_held_where_that_is_asked_for(write: Write) -> None:
    run = loaded(write, "time,force\n1,5\n1.25,6\n1.4,7\n1.6,8\n1.7500000005,9\n", "hold = true\n")
    assert run.inputs["force"].tolist() == [5.0, 6.0, 7.0, 9.0, 9.0]


@pytest.mark.parametrize(("scale", "factor"), [("-2", -2.0), ("'1 kN'", 1e3), ("'2N'", 2.0)])
def test_a_scale_may_have_a_unit(write: Write, scale: str, factor: float) -> None:
    path = write(f"{HEAD}{TIME}{FORCE}scale = {scale}\n")
    (path.parent / "log.csv").write_text("time,force\n1,0.5\n2,0.5\n")
    newtons = toy(DESCRIPTION.replace('<Real min="-10.0"', '<Real unit="N"'))
    assert scenario.load(path, newtons).inputs["force"].tolist() == [0.5 * factor] * 5


@pytest.mark.parametrize(("scale", "kelvins"), [("'1 degC'", 293.15), ("'2 degC'", 313.15),
                                                ("'1 K'", 20.0), ("1", 20.0)])  # fmt: skip
def test_a_column_has_the_offset_of_its_unit(write: Write, scale: str, kelvins: float) -> None:
    path = write(f"{HEAD}{TIME}{FORCE}scale = {scale}\n")
    (path.parent / "log.csv").write_text("time,force\n1,20\n2,20\n")
    heat = toy(DESCRIPTION.replace('<Real min="-10.0"', '<Real unit="K"'))
    values = scenario.load(path, heat).inputs["force"].tolist()
    assert values == pytest.approx([kelvins] * 5, rel=1e-15)


@pytest.mark.parametrize("mark", ["sep=;\n", "SEP=;\r\n", '"sep=;"\n', ""])
def test_logs_of_spreadsheets_are_read(write: Write, mark: str) -> None:
    """Of the empty cells in other columns nothing is lost, of those in its own linear ones."""
    rows = "1;1;;", "1,25;;0,5;", "1,5;n/a;;7", "1,75;4;x;NaN", "2;2,5E0;;", ";;;", ""
    log = "\n".join([f"{mark}time;force;note;speed", *rows])
    assert loaded(write, log).inputs["force"].tolist() == [1.0, 2.0, 3.0, 4.0, 2.5]
    assert loaded(write, log, "hold = true\n").inputs["force"].tolist() == [1.0, 1.0, 1.0, 4.0, 2.5]
    times = "1,000", "1,250", "1,500", "1,750", "2,000"  # 1,000 s, not 1000: 1,250 with 0,5 says so
    log = "\n".join([f"{mark}time;force", *(f"{time};0,5" for time in times)])
    assert loaded(write, log).inputs["force"].tolist() == [0.5] * 5


def test_a_gap_in_what_was_measured_is_no_measurement() -> None:
    times = np.array([*range(10), *range(40, 50)], float)
    log = inputs.Logged(times, times, False, "")
    elapsed = np.array([-1.0, 0.0, 0.5, 9.0, 9.1, 39.9, 40.0, 49.0, 49.5])
    assert np.flatnonzero(log.covers(elapsed)).tolist() == [1, 2, 3, 6, 7]


def test_a_boolean_input_is_held(write: Write) -> None:
    head = "[inputs.brake]\nfile = 'log.csv'\n"
    values = loaded(write, "time,brake\n1,0\n1.5,1\n1.9,0\n", head=head).inputs["brake"]
    assert values.dtype == bool and values.tolist() == [False, False, True, True, False]
    for log, more, message in (
        ("time,brake\n1,0\n2,0.5\n", "", "expected 0 or 1 in a log, got 0.5"),
        ("time,brake\n1,0\n2,1\n", "scale = 1\n", "is held and not scaled"),
        ("time,brake\n1,0\n2,1\n", "hold = false\n", "is held and not scaled"),
    ):
        with pytest.raises(UserError, match=f"brake\\]: .*{message}"):
            loaded(write, log, more, head)


def test_a_log_may_lie_elsewhere_and_end_where_the_last_step_begins(write: Write) -> None:
    path = write(f"{HEAD}{TIME}[inputs.force]\nfile = '../a log/ü.csv'\n")
    (path.parents[1] / "a log").mkdir()
    (path.parents[1] / "a log" / "ü.csv").write_text("time,force\n1,1\n1.75,4\n")
    run = scenario.load(path, TOY)
    assert run.inputs["force"].tolist() == [1.0, 2.0, 3.0, 4.0, 4.0]
    assert list(run.logs) == ["../a log/ü.csv"]


@pytest.mark.parametrize(("log", "names"), MISTAKES["delimiters"]["rows"])
def test_the_delimiter_is_that_of_the_rows(write: Write, log: str, names: list[str]) -> None:
    run = loaded(write, log, f"column = '{names[0]}'\n")
    assert run.inputs["force"].tolist() == [2.0, 2.5, 3.0, 3.5, 4.0] and run.questions == ()


def test_a_quotation_mark_that_swallows_rows_is_said(write: Write) -> None:
    rows = [f"{1 + i / 100},1,ok" for i in range(201)]
    rows[70] = f'{1 + 70 / 100},1,"5 mm'  # begins a field that ends 60 rows later
    rows[130] = f'{1 + 130 / 100},1,ok"'
    run = loaded(write, "\n".join(["time,force,note", *rows]))
    joined, gap = run.questions
    assert "log.csv: lines 72 to 132 are one row, by a quoted field with line ends" in joined
    assert "log.csv: line 133: a gap of 0.61 s before it, where rows are 0.01 s apart" in gap
    header = loaded(write, 'time,force,"note\n1,1,a\n1.5,1,b"\n1,2,c\n2,2,d\n')
    assert ["lines 1 to 3 are one row" in text for text in header.questions] == [True]


@pytest.mark.parametrize(("missing", "said"), MISTAKES["gaps"]["rows"])
def test_gaps_above_ten_steps_are_said(
    write: Write, missing: list[tuple[int, int]], said: str
) -> None:
    rows = [f"{t / 100},1" for t in range(301) if not any(a <= t < b for a, b in missing)]
    questions = loaded(write, "\n".join(["time,force", *rows])).questions
    assert [said in text for text in questions] == [True] * bool(said)


@pytest.mark.parametrize("start", ["0", "1700000000", "1700000000.3"])
def test_late_clocks_lose_no_row(write: Write, start: str) -> None:
    """Doubles near 1.7e9 are 2.4e-7 apart: rows and switches at points of the run count there."""
    begin = Decimal(start)
    stop, switch = begin + 1, "[inputs.brake]\ntable = [[0.0, false], [0.3, true], [0.7, false]]\n"
    held = "[inputs.force]\nfile = 'log.csv'\nhold = true\n"
    path = write(f"{HEAD}[time]\nstart = {begin}\nstop = {stop}\nstep = 0.1\n{held}{switch}")
    rows = [f"{begin + Decimal(i) / 10},{i / 2}" for i in range(11)]
    (path.parent / "log.csv").write_text("\n".join(["time,force", *rows]))
    run = scenario.load(path, SWITCHED)
    assert run.inputs["force"].tolist() == [i / 2 for i in range(11)]
    assert run.inputs["brake"].tolist() == [3 <= i < 7 for i in range(11)]
    assert run.elapsed.tolist() == pytest.approx([i / 10 for i in range(11)], abs=1e-15)


def test_a_log_may_begin_elsewhere_than_the_run(write: Write) -> None:
    rows = "".join(f"1700000000.{i}23456,{i}\n" for i in range(10))
    log = f"time,force\n{rows}"
    run = loaded(write, log, "hold = true\nbegin = 1700000000.123456\n")
    assert run.inputs["force"].tolist() == [1.0, 3.0, 6.0, 8.0, 9.0]  # every 0.25 s
    for given, message in (
        ("1699999999", "begins at 1700000000.023456 s, the run needs it from 1699999999.0 to"),
        ("1700000000.5", "ends at 1700000000.923456 s, the run needs it from 1700000000.5 to"),
        ("'soon'", "begin: expected a number"),
    ):
        with pytest.raises(UserError, match=message):
            loaded(write, log, f"begin = {given}\n")


# ---- mistakes ------------------------------------------------------------------------------------

WRONG = [
    # log, further keys, message
    *((f"{log}\n", "", message) for log, message in cases(MISTAKES["log"])),
    *((LOG, f"{keys}\n", message) for keys, message in MISTAKES["keys_of_log"]["rows"]),
    ("", "", "log.csv: expected names of columns in its first line"),
    ('time,force\n1,"' + "x" * 200_000, "", "log.csv, line 2: field larger than field limit"),
    (
        'time,force\n1,2\n2,"3\n' + "4,5\n" * 99_999,
        "",
        "line 3: field larger than field limit (131072): a quote opens that is not closed",
    ),
    (b"time,force\n1,\xb0\n", "", "log.csv: not UTF-8 text, at byte 13"),
    (LOG.encode("utf-16"), "", "log.csv: not UTF-8 text, at byte 0"),
    ("time,force\n1,\0\n", "", "line 2: column 'force': expected a number"),
    (",".join(["time", *map(str, range(999))]) + "\n", "", "17, 18, ...)"),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("log", "keys", "message"), WRONG)
@pytest.mark.parametrize("section", ["inputs", "measured"])
def test_a_mistake_is_explained_in_one_line(
    write: Write, log: str | bytes, keys: str, message: str, section: str
) -> None:
    head = FORCE
    if section == "measured":  # the same log of an output
        if "goes with" in message or "exactly" in message or "at least" in message:
            return
        head = "[measured.power]\nfile = 'log.csv'\n"
        keys = keys if "column" in keys else f"{keys}column = 'force'\n"
        message = message.replace("[inputs.force]", "[measured.power]")
    with pytest.raises(UserError) as caught:
        loaded(write, log, keys, head)
    said = str(caught.value)
    assert message in said and "\n" not in said and len(said) < 1000


@pytest.mark.parametrize("section", ["inputs.force", "measured.speed"])
def test_what_is_no_file(write: Write, section: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write("").parent
    os.mkfifo(folder / "pipe")
    (folder / "big").write_bytes(b"time,force\n" + b"0" * 100)
    monkeypatch.setattr(inputs, "LARGEST_LOG", 100)
    for file, message in (
        *MISTAKES["no_file"]["rows"],
        ("x" * 5000, "cannot be read: File name too long"),
        (" ", f"[{section}] file: expected a text"),
    ):
        path = write(f'{HEAD}{TIME}[{section}]\nfile = "{file}"\n')
        with pytest.raises(UserError) as caught:
            scenario.load(path, TOY)
        assert message in str(caught.value) and f"[{section}]" in str(caught.value)


def test_only_real_outputs_are_measured(write: Write) -> None:
    for name, guess in (("sped", ", did you mean 'speed'?"), ("mass", "")):
        message = (
            rf"has no Real output '{name}'{guess.replace('?', '[?]')} \(known: speed, power\)$"
        )
        with pytest.raises(UserError, match=message):
            loaded(write, head=f"[measured.{name}]\nfile = 'log.csv'\n")


# ---- an example ----------------------------------------------------------------------------------

EXAMPLE = MISTAKES["logs"]["EXAMPLE"]


def test_an_example_is_run_and_compared(
    tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    """m2 = 1 kg at f2 = 2 t, held over steps h: v_n = h^2 n (n - 1), and q2 its exact sum."""
    monkeypatch.chdir(tmp_path)
    h, n = 0.01, np.arange(101)
    speed = h**2 * n * (n - 1)
    force = 2 * h * n
    position = 0.3 + np.concatenate(([0.0], np.cumsum(speed * h + force * h**2 / 2)[:-1]))
    off = np.where(n % 2, 3.0, -1.0)  # mm
    rows = zip(h * n, force / 2, 1e3 * position + off, speed, strict=True)
    text = "".join("{:.17g};{:.17g};{:.17g};{:.17g}\n".format(*row) for row in rows)
    (tmp_path / "log.csv").write_text(f"time;force;encoder;speed\n{text}", encoding="utf-8")
    (tmp_path / "pushed.toml").write_text(EXAMPLE, encoding="utf-8")
    arguments = ("run", "pushed.toml", "--fmu", FMUS["rp_manipulator"], "--report", "out")
    code, out, err = console(*arguments)
    assert (code, err) == (0, "")
    rms = math.sqrt((50 * 9 + 51 * 1) / 101) * 1e-3
    assert f"pushed: q2 is {rms:.3g} m RMS from log.csv, column encoder\n" in out
    exact = re.search(r"pushed: ee_vy is (\S+) m/s RMS from log.csv, column speed\n", out)
    assert exact and float(exact[1]) < 1e-9
    page = (tmp_path / "out/files/pushed.html").read_text(encoding="utf-8")
    assert page.count('"name":"measured"') == 2
    assert f"{rms:.4g}" in page and "log.csv, column force, linear in between" in page
    assert page.index("Difference from what was measured") < page.index("Solver")


def test_an_angle_in_degrees_without_their_unit_is_asked_about(
    tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = EXAMPLE[: EXAMPLE.index("[inputs")].replace('"90 deg"', "90")
    (tmp_path / "turns.toml").write_text(text, encoding="utf-8")
    arguments = ("run", "turns.toml", "--fmu", FMUS["rp_manipulator"], "--report", "out")
    code, _, err = console(*arguments)
    question = '[initial] q1: 90 rad is 14.3 turns, is that meant? In degrees it is "90 deg".'
    assert (code, err) == (0, f"warning: turns.toml: {question}\n")
    page = (tmp_path / "out/files/turns.html").read_text(encoding="utf-8")
    assert "90 rad is 14.3 turns" in page
