"""The figures of the benchmark as Markdown: all tables, and the one of tests/bench/README.md."""

from __future__ import annotations


def result(row: dict) -> str:
    """Say what a row must reach and whether it does."""
    if "judged" not in row:
        return ""
    sign = {"<=": "≤", ">=": "≥"}[row["comparison"]]
    return f"{sign} {row['limit']:g}: {'ok' if row['met'] else '**MISSED**'}"


def number(value: float | None) -> str:
    """Three digits, or nothing."""
    if value is None:
        return ""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def error(row: dict) -> str:
    """Error of a row, and of the peer that it is compared with."""
    values = [row[name] for name in ("error", "error_of_peer") if name in row]
    return ", ".join(f"{value:.0e}" for value in values)


def lines(header: list[str], rows: list[list[str]]) -> list[str]:
    """Make a table."""
    rule = ["---"] + ["--:"] * (len(header) - 1)
    return ["| " + " | ".join(cells) + " |" for cells in (header, rule, *rows)] + [""]


def steps(rows: list[dict]) -> list[str]:
    """A table for each work: who, time, ratio to the plain loop, error."""
    text = []
    header = ["", "us a step", "ratio", "error", "must be"]
    works = dict.fromkeys(row["work"] for row in rows if row["group"] == "steps")
    for work in works:
        cells = [
            [row["run"], number(row.get("us")), number(row.get("ratio")), error(row), result(row)]
            for group in ("steps", "against")
            for row in rows
            if (row["group"], row["work"]) == (group, work)
        ]
        text += [f"**{work[0].upper() + work[1:]}**", "", *lines(header, cells)]
    return text


def busy(row: dict) -> str:
    """Say that the threads had to wait for their cores."""
    return " (busy machine)" if row["processor_share"] < 0.97 else ""


def figures(row: dict, *names: str) -> list[str]:
    """Figures of a row."""
    return [number(row[name]) for name in names]


def life(row: dict) -> str:
    """Time or memory of an instance."""
    return f"{row[row['judged']]:.1f} {'us' if row['judged'] == 'us' else 'KiB'}"


# by group: title, heading of the columns, cells of a row
GROUPS = {
    "instances": (
        "Many instances, each stepped by 1 ms in turn",
        ["instances", "us a step", "ratio", "us more than one alone", "error", "must be"],
        lambda row: [f"{row['run']}, {row['instances']:.0f}", *figures(row, "us", "ratio"),
                     f"{row['more_us']:+.2f}", error(row), result(row)],
    ),
    "threads": (
        "Two threads with an instance each, 1 ms steps",
        ["", "times one thread", "by processor time", "share of a core each had", "error",
         "must be"],
        lambda row: [row["run"], *figures(row, "throughput", "undisturbed", "processor_share"),
                     error(row), result(row) + busy(row)],
    ),
    "instance": (
        "The instance with an integrator that returns at once",
        ["", "us a step", "share of a step with taylor"],
        lambda row: [row["work"], *figures(row, "us", "ratio")],
    ),
    "plant": (
        "Friction and stops, steps of 1 ms",
        ["", "us a step", "ratio", "events in 1000 steps", "must be"],
        lambda row: [f"{row['work']}, {row['run']}", *figures(row, "us", "ratio"),
                     f"{row['events']:.0f}", result(row)],
    ),
    "calls": (
        "Each call by itself, 1 ms steps, inputs changing, medians",
        ["", "Set, us", "DoStep, us", "Get, us", "DoStep 99.9 %, us", "over the median",
         "largest, us"],
        lambda row: [row["run"], *figures(row, "set_us", "step_us", "get_us", "step_percentile_us",
                                          "ratio", "step_largest_us")],
    ),
    "life": (
        "An instance",
        ["", "", "must be"],
        lambda row: [f"{row['run']}, {row['work']}", life(row), result(row)],
    ),
}  # fmt: skip


def of_group(rows: list[dict], group: str) -> list[str]:
    """The table of a group."""
    title, header, cells = GROUPS[group]
    return [f"**{title}**", "", *lines(header, [cells(x) for x in rows if x["group"] == group])]


def energy(rows: list[dict]) -> list[str]:
    """Drift of the energy in motions without losses."""
    last = {(row["work"], row["run"]): row for row in rows if row["group"] == "energy"}
    text = []
    for work in dict.fromkeys(work for work, _ in last):
        mine = [row for row in last.values() if row["work"] == work]
        cells = [[row["run"], number(row["us"]), f"{row['largest']:.1e}", f"{row['at_end']:.1e}"]
                 for row in mine]  # fmt: skip
        header = ["", "us a step", "largest drift", "drift at the end"]
        title = f"**Drift of the energy over {mine[0]['steps']:.0f} steps of 1 ms, {work}**"
        text += [title, "", *lines(header, cells)]
    return text


def markdown(report: dict) -> str:
    """All tables, from the contents of benchmark.json."""
    rows, machine = report["rows"], report["machine"]
    versions = ", ".join(
        f"{name} {machine[name]}" for name in ("fmpy", "heyoka", "scipy", "mujoco", "pythonfmu")
    )
    missed = sum(not row["met"] for row in rows if "judged" in row)
    head = [
        f"{machine['processor']}, {machine['cores']:.0f} cores, load {machine['load']:.1f} at the "
        f"start; {machine['compiler']}, SUNDIALS {machine['sundials']}, Python "
        f"{machine['python']}, {versions}. {missed} of the targets missed.",
        "",
    ]
    tables = {group: of_group(rows, group) for group in GROUPS}
    order = ("instances", "threads", "energy", "instance", "plant", "calls", "life")
    tables["energy"] = energy(rows)
    return "\n".join(head + steps(rows) + [line for group in order for line in tables[group]])


# columns of the table of ratios: heading and work
WORKS = {
    "1 ms": "1 ms steps, inputs changing",
    "10 ms": "10 ms steps, inputs changing",
    "0.1 s": "0.1 s steps, inputs changing",
    "1 ms, constant": "1 ms steps, inputs constant",
    "10 ms, constant": "10 ms steps, inputs constant",
    "2 s": "one step of 2 s, free motion, error <= 1e-8",
}


def miss(row: dict) -> str:
    """Name a target that is missed, with what was measured."""
    count = f", {row['instances']:.0f} of them" if "instances" in row else ""
    return f"- {row['work']}{count}, {row['run']}: {number(row[row['judged']])} ({result(row)})"


def summary(report: dict) -> str:
    """The table of ratios to the plain loop, and a list of the targets that are missed."""
    rows = [row for row in report["rows"] if row["group"] == "steps" and "us" in row]
    ratios = {(row["run"], row["work"]): row["ratio"] for row in rows}
    cells = [
        [run, *(number(ratios.get((run, work))) for work in WORKS.values())]
        for run in dict.fromkeys(run for run, _ in ratios)
    ]
    missed = [miss(row) for row in report["rows"] if "judged" in row and not row["met"]]
    head = f"{len(missed)} targets are missed:"
    return "\n".join([*lines(["", *WORKS], cells), head, "", *missed, ""])
