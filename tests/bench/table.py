"""The figures of the benchmark as Markdown: all tables, and the one of tests/bench/README.md."""

from __future__ import annotations

# by group: title, figures
GROUPS = {
    "steps": ("Communication steps", ("us", "ratio", "error")),
    "against": ("One against another", ("ratio", "error", "error_of_peer")),
    "instances": (
        "Many instances, each stepped by 1 ms in turn",
        ("us", "ratio", "more_us", "error"),
    ),
    "threads": (
        "Two threads with an instance each, 1 ms steps",
        ("throughput", "undisturbed", "processor_share", "error"),
    ),
    "plant": ("Friction and stops, steps of 1 ms", ("us", "ratio", "events")),
    "life": ("An instance", ("us", "kib")),
}
# columns of the table of ratios: heading and work
WORKS = {
    "1 ms": "1 ms steps, inputs changing",
    "10 ms": "10 ms steps, inputs changing",
    "0.1 s": "0.1 s steps, inputs changing",
    "1 ms, constant": "1 ms steps, inputs constant",
    "10 ms, constant": "10 ms steps, inputs constant",
    "2 s": "one step of 2 s, free motion, error <= 1e-8",
}


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


def lines(header: list[str], rows: list[list[str]]) -> list[str]:
    """Make a table."""
    rule = ["---"] + ["--:"] * (len(header) - 1)
    return ["| " + " | ".join(cells) + " |" for cells in (header, rule, *rows)] + [""]


def of_group(rows: list[dict], group: str) -> list[str]:
    """The table of a group."""
    title, figures = GROUPS[group]
    mine = [row for row in rows if row["group"] == group]
    cells = [
        [f"{row['work']}: {row['run']}", *(number(row.get(name)) for name in figures), result(row)]
        for row in mine
    ]
    return [f"**{title}**", "", *lines(["", *figures, "must be"], cells)]


def markdown(report: dict) -> str:
    """All tables, from the contents of benchmark.json."""
    rows = report["rows"]
    about = ", ".join(f"{name} {value}" for name, value in report["machine"].items())
    missed = sum(not row["met"] for row in rows if "judged" in row)
    head = [f"{about}. {missed} of the targets missed.", ""]
    return "\n".join(head + [line for group in GROUPS for line in of_group(rows, group)])


def miss(row: dict) -> str:
    """Name a target that is missed, with what was measured."""
    return f"- {row['work']}, {row['run']}: {number(row[row['judged']])} ({result(row)})"


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
