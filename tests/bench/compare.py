"""The benchmark: the FMUs and their peers in turns, tables and a JSON file.

    cmake --build build --target benchmark

Every figure is the median of rounds, and ratios are formed within a round. Exits with 0 where
targets are missed too: the table shows them.
"""

import argparse
import json
import math
import os
import re
import statistics
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

import by_gradients
import by_models
import by_systems
from by_heyoka import Peer, Work
from solvers import MUJOCO_IMPLICITFAST, MUJOCO_RK4, PLAIN_LOOP, Solvers

from tests.equations.examples import METHODS

ROOT = Path(__file__).resolve().parents[2]
FREE = {
    bound: Work(f"one step of 2 s, free motion, error <= {text}", 2.0, 1, "zero")
    for bound, text in ((1e-8, "1e-8"), (1e-14, "1e-14"))
}
CHANGING = (
    Work("1 ms steps, inputs changing", 1e-3, 2000, "changing"),
    Work("10 ms steps, inputs changing", 1e-2, 200, "changing"),
    Work("0.1 s steps, inputs changing", 0.1, 20, "changing"),
)
OTHERS = (
    Work("1 ms steps, inputs constant", 1e-3, 2000, "constant"),
    Work("10 ms steps, inputs constant", 1e-2, 200, "constant"),
    Work("1 ms steps, inputs changing, tolerance 1e-5", 1e-3, 2000, "changing", tolerance=1e-5),
    Work("1 ms steps, inputs changing, tolerance 1e-11", 1e-3, 2000, "changing", tolerance=1e-11),
    Work("one step of 2 s, inputs constant", 2.0, 1, "constant"),
)
ROUNDING = 1e-14  # an error that no peer need stay below
PACKAGES = ("heyoka", "mujoco")  # peers
TURNS = 3  # of free motion in a round: its targets are near
LEAST = 1e-14  # tolerance that solvers of C are asked for
LIVES = 100
OF_FMI3 = ("cvode_adams", "erk", "taylor")  # methods that are compared with FMI 2.0
MUJOCO = {"MuJoCo RK4": MUJOCO_RK4, "MuJoCo implicitfast": MUJOCO_IMPLICITFAST}


C1, C10, C100 = (work.name for work in CHANGING)
K1, K10 = (work.name for work in OTHERS[:2])
# of two runs: the largest ratio of their times that meets the target; None: no target
RATIOS = [
    (C1, "cvode_adams", "plain loop", 0.5),
    (C1, "erk", "plain loop", 0.15),
    (C1, "taylor", "plain loop", 0.04),
    (C1, "taylor", "erk", 0.42),
    (C1, "taylor", "MuJoCo RK4", 0.13),
    (C10, "cvode_adams", "plain loop", 0.5),
    (C10, "erk", "plain loop", 0.2),
    (C10, "taylor", "erk", 0.42),
    (C100, "taylor", "erk", 0.2),
    (K1, "cvode_adams", "plain loop", 0.6),
    (K1, "taylor", "cvode_adams", 0.95),
    (K10, "taylor", "cvode_adams", 0.45),
    (FREE[1e-8].name, "erk", "heyoka", 8.0),
    (FREE[1e-8].name, "taylor", "heyoka", 0.9),
    (FREE[1e-14].name, "taylor", "heyoka", 0.9),
    (FREE[1e-8].name, "erk", "heyoka, error no larger than erk's", None),
]
RATIOS += [
    (work, f"{method}, FMI 3.0", method, 1.05)
    for work in (C1, C10, C100, K1, K10)
    for method in ("cvode_adams", "erk", "taylor")
]
RATIOS += [
    (work.name, "taylor", "heyoka, error no larger than taylor's", None)
    for work in (FREE[1e-8], *CHANGING, *OTHERS)
]
PLAIN = "plain loop"
LARGEST_ERROR_OF_TAYLOR = 1e-12  # in steps of 1 ms
# by group: title, figures
GROUPS = {
    "steps": ("Communication steps", ("us", "ratio", "error")),
    "against": ("One against another", ("ratio", "error", "error_of_peer")),
    "models": ("Models in equations", ("us", "ratio", "error", "error_of_peer")),
    "gradients": ("Gradients, 10 masses, in runs without", ("us", "ratio")),
    "loop": ("The loop of rparm", ("us", "ratio")),
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


def tuned(peer: Peer, bound: float) -> Peer:
    """The peer at its largest tolerance, in quarters of decades, with an error within the bound.

    All tolerances below it, to a ten-thousandth of the bound, are within the bound, too.
    """
    best = None
    lowest = max(1e-4 * bound, peer.least)
    for quarter in range(math.ceil(4.0 * math.log10(lowest) - 1e-6), -11):
        peer.tolerance = 10.0 ** (quarter / 4)
        if peer.error() > bound:
            break
        best = peer.tolerance
    if best is None:
        raise RuntimeError(f"{peer.name}: no tolerance gives an error of {bound}")
    peer.tolerance = best
    return peer


def with_substeps(peer: Peer, bound: float) -> Peer:
    """MuJoCo at its largest step with an error within the bound."""
    peer.tolerance = 10
    while peer.error() > bound:
        peer.tolerance += peer.tolerance // 4 + 1
    return peer


def find(rows: list[dict], work: str, run: str) -> dict:
    """The row of a work and a run."""
    return next(row for row in rows if (row["work"], row["run"]) == (work, run))


# ---- Who takes part


def usual(solvers: Solvers, work: Work) -> list[Peer]:
    """The plain loop at the tolerance at which the FMU runs CVODE, and the FMU with each method."""
    one_step = Work("a step", 1e-3, 1, "zero")
    effective = solvers.fmu("cvode_adams")(one_step, work.tolerance, 1)[2]["effective_tolerance"]
    loop = Peer(PLAIN, work, effective, solvers.plain(PLAIN_LOOP), LEAST)
    return [loop, *(by_method(solvers, method, work) for method in METHODS)]


def by_method(solvers: Solvers, method: str, work: Work) -> Peer:
    """The FMU of FMI 2.0 with a method."""
    return Peer(method, work, work.tolerance, solvers.fmu(method), LEAST)


def in_steps(solvers: Solvers) -> list[Peer]:
    """All that do communication steps, but for heyoka."""
    peers = []
    for work in (*CHANGING, *OTHERS):
        peers += usual(solvers, work)
        if work in CHANGING and solvers.mujoco_version:
            peers += [Peer(name, work, 1, solvers.plain(kind)) for name, kind in MUJOCO.items()]
        if work.tolerance == 1e-8 and work.steps > 1:
            peers += [
                Peer(f"{method}, FMI 3.0", work, 1e-8, solvers.fmu(method, 3)) for method in OF_FMI3
            ]
    return peers


def in_free_motion(solvers: Solvers) -> list[Peer]:
    """Each at its largest tolerance or step with the error; heyoka is left out."""
    peers = [tuned(peer, 1e-8) for peer in usual(solvers, FREE[1e-8])]
    if solvers.mujoco_version:  # the other method, of first order, needs millions of steps
        mujoco = Peer("MuJoCo RK4", FREE[1e-8], 1, solvers.plain(MUJOCO_RK4))
        peers.append(with_substeps(mujoco, 1e-8))
    # the others here do not come so near
    return [*peers, tuned(by_method(solvers, "taylor", FREE[1e-14]), 1e-14)]


def rows_of(peers: Iterable[Peer]) -> list[dict]:
    """One turn."""
    return [peer.row() for peer in peers]


def heyoka_like(run: str, work: Work, first: list[dict]) -> Peer:
    """Return heyoka with an error no larger than another run has, or ROUNDING."""
    peer = Peer(f"heyoka, error no larger than {run}'s", work, 0.0)
    return tuned(peer, max(find(first, work.name, run)["error"], ROUNDING))


def make_peers(first: list[dict]) -> list[Peer]:
    """Return heyoka for all works; first: rows of the others, for their errors."""
    free = [tuned(Peer("heyoka", work, 0.0), bound) for bound, work in FREE.items()]
    free += [heyoka_like(run, FREE[1e-8], first) for run in ("erk", "taylor")]
    changing = [Peer("heyoka", work, 1e-8) for work in CHANGING]
    return free + changing + [heyoka_like("taylor", work, first) for work in (*CHANGING, *OTHERS)]


def judged(row: dict, figure: str, limit: float | None) -> dict:
    """The row with the largest value that its figure may have, if there is one."""
    target = {"judged": figure, "limit": limit}
    return row | (target if limit is not None else {})


def compared(rows: list[dict]) -> list[dict]:
    """Rows of one turn with their ratios to the plain loop, and those of all other comparisons."""
    steps = {(row["work"], row["run"]): row for row in rows if row["group"] == "steps"}
    first = {work: row["us"] for (work, _), row in reversed(steps.items())}
    for (work, _), row in steps.items():
        row["ratio"] = row["us"] / first[work]
    more = []
    for work, run, peer, limit in RATIOS:
        one, other = steps.get((work, run)), steps.get((work, peer))
        if one and other and peer == PLAIN:
            one |= judged({}, "ratio", limit)
        elif one and other:
            row = {"group": "against", "work": work, "run": f"{run} to {peer}"}
            row |= {"error": one["error"], "error_of_peer": other["error"]}
            more.append(judged(row | {"ratio": one["us"] / other["us"]}, "ratio", limit))
    for work in (C1, C10, C100) if (C1, PLAIN) in steps else ():
        for method in ("erk", "taylor"):
            row = {"group": "against", "work": work}
            row["run"] = f"error of {method} over the plain loop's"
            row["ratio"] = steps[work, method]["error"] / steps[work, PLAIN]["error"]
            more.append(judged(row, "ratio", 1.0))
    if (C1, "taylor") in steps:
        row = {"group": "against", "work": C1, "run": "error of taylor"}
        row["error"] = steps[C1, "taylor"]["error"]
        more.append(judged(row, "error", LARGEST_ERROR_OF_TAYLOR))
    return rows + more


def judge(rows: list[dict]) -> list[dict]:
    """The rows, with whether they meet their targets."""
    for row in rows:
        if "judged" in row:
            row["met"] = row[row["judged"]] <= row["limit"]
    return rows


def take_rounds(peers: list[Peer], rounds: int) -> list[dict]:
    """Let all take turns; return rows with medians of turns."""
    found = defaultdict(list)  # rows of all turns, by key
    free = [peer for peer in peers if peer.work in FREE.values()]
    others = [peer for peer in peers if peer not in free]
    turns = [others, *[free] * TURNS] * rounds
    for number, of_turn in enumerate(turns):
        print(f"turn {number + 1} of {len(turns)}", file=sys.stderr)
        for row in compared(rows_of(of_turn)):
            found[row["group"], row["work"], row["run"]].append(row)
    return [
        of_turns[-1]
        | {figure: statistics.median(row[figure] for row in of_turns)
           for figure in ("us", "ratio") if figure in of_turns[-1]}
        for of_turns in found.values()
    ]  # fmt: skip


# ---- Friction and stops, the life of an instance


def motions(coulomb: tuple[float, float], **more: float | int) -> dict[str, float | int]:
    """Parameters of RPPlant with this friction in the joints, N.m and N."""
    return {"coulomb_friction1": coulomb[0], "coulomb_friction2": coulomb[1], **more}


MOVING = Work("", 1e-3, 1000, "changing", (0.3, 0.2, 3.0, 2.0))
HELD = Work("", 1e-3, 1000, "changing")
STRIBECK = {"breakaway_friction1": 0.6, "breakaway_friction2": 0.5}
STRIBECK |= {"stribeck_velocity1": 0.1, "stribeck_velocity2": 0.1}
# Joint 1 is held, the slide points upwards. From the vertex of a flight that takes one step, it
# bounces in the middle of each on a stop that gives all of its speed back; or it is pushed above
# the stop. The arm has no offset: impacts would move joint 1.
BOUNCING = motions((100.0, 0.0), a=0.0, lower2=0.0, upper2=5.0, restitution2=1.0, stops2=2)
BOUNCE = Work("", 1e-3, 1000, "zero", (math.pi / 2, (9.81 * 1e-3 / 2) ** 2 / (2 * 9.81), 0.0, 0.0))
PUSH = Work("", 1e-3, 1000, "push", (math.pi / 2, 0.3, 0.0, 0.0))
# by work: the plant's parameters and motion; its peer's (None: RPManipulator); the largest ratio
# for each method
PLANT = {
    "without friction and stops": ({}, MOVING, None, MOVING, [None] * 4),
    "Coulomb friction": (motions((0.4, 0.3)), MOVING, None, MOVING, [1.6, 1.7, 1.7, 1.7]),
    "Stribeck friction": (
        motions((0.4, 0.3), **STRIBECK), MOVING, None, MOVING, [1.6, 1.7, 1.6, 1.6],
    ),
    "held by friction": (
        motions((100.0, 100.0), breakaway_friction1=100.0, breakaway_friction2=100.0),
        HELD, None, HELD, [0.55, 0.55, 0.55, 0.45],
    ),
    "a bounce in each step": (BOUNCING, BOUNCE, BOUNCING, PUSH, [1.5, 1.5, 2.0, 2.0]),
}  # fmt: skip


def plant_rows(solvers: Solvers, repeats: int) -> list[dict]:
    """RPPlant against the arm without friction and stops, or against itself without a bounce."""
    found = []
    for work, (values, motion, other, other_motion, limits) in PLANT.items():
        for method, limit in zip(METHODS, limits, strict=True):
            plant = solvers.fmu(method, name="RPPlant", **values)
            peer = (
                solvers.fmu(method)
                if other is None
                else solvers.fmu(method, name="RPPlant", **other)
            )
            turns = [
                (plant(motion, 1e-8, 1), peer(other_motion, 1e-8, 1)[0]) for _ in range(repeats)
            ]
            row = {"group": "plant", "work": work, "run": method}
            row["us"] = 1e6 * statistics.median(own[0] for own, _ in turns)
            row["events"] = turns[0][0][2]["events"] * motion.steps
            row["ratio"] = statistics.median(own[0] / peers for own, peers in turns)
            found.append(judged(row, "ratio", limit))
    return found


def life_rows(solvers: Solvers, repeats: int) -> list[dict]:
    """An instance of the arm: its life without a step, and its memory after one."""
    found = []
    for method in METHODS:
        lives = [solvers.life(method, LIVES) for _ in range(repeats)]
        row = {"group": "life", "work": "instantiate to free", "run": method}
        found.append(judged(row | {"us": 1e6 * statistics.median(x for x, _ in lives)}, "us", 30.0))
        row = {"group": "life", "work": "memory of an instance after a step", "run": method}
        found.append(judged(row | {"kib": lives[0][1]}, "kib", 32.0))
    return found


# ---- Tables


def result(row: dict) -> str:
    """Say what a row must reach and whether it does."""
    if "judged" not in row:
        return ""
    return f"≤ {row['limit']:g}: {'ok' if row['met'] else '**MISSED**'}"


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
    """Return the Markdown table of a group."""
    title, figures = GROUPS[group]
    mine = [row for row in rows if row["group"] == group]
    cells = [
        [f"{row['work']}: {row['run']}", *(number(row.get(name)) for name in figures), result(row)]
        for row in mine
    ]
    return [f"**{title}**", "", *lines(["", *figures, "must be"], cells)]


def markdown(report: dict) -> str:
    """Return all tables, from the contents of benchmark.json."""
    rows = report["rows"]
    about = ", ".join(f"{name} {value}" for name, value in report["machine"].items())
    missed = sum(not row["met"] for row in rows if "judged" in row)
    head = [f"{about}. {missed} of the targets missed.", ""]
    return "\n".join(head + [line for group in GROUPS for line in of_group(rows, group)])


def miss(row: dict) -> str:
    """Name a target that is missed, with what was measured."""
    return f"- {row['work']}, {row['run']}: {number(row[row['judged']])} ({result(row)})"


def summary(report: dict) -> str:
    """Return the table of ratios to the plain loop, and a list of the targets that are missed."""
    rows = [
        row
        for row in report["rows"]
        if row["group"] in ("steps", "models", "loop") and "ratio" in row
    ]
    ratios = {(row["run"], row.get("column", row["work"])): row["ratio"] for row in rows}
    cells = [
        [run, *(number(ratios.get((run, work))) for work in WORKS.values())]
        for run in dict.fromkeys(run for run, _ in ratios)
    ]
    missed = [miss(row) for row in report["rows"] if "judged" in row and not row["met"]]
    head = f"{len(missed)} targets are missed:"
    return "\n".join([*lines(["", *WORKS], cells), head, "", *missed, ""])


def with_figures(page: str, tables: str) -> str:
    """Replace the text under the heading Ratios of the page, up to the next heading."""
    before, heading, after = page.partition("\n## Ratios\n")
    _, following, after = after.partition("\n## ")
    return f"{before}{heading}\n{tables}{following}{after}"


def machine() -> dict:
    """What the figures were measured on."""
    names = re.findall(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    return {
        "processor": names[0] if names else "unknown", "cores": os.cpu_count(),
        "load": os.getloadavg()[0], "python": sys.version.split()[0],
    } | {name: version(name) for name in PACKAGES}  # fmt: skip


def main() -> None:
    """Measure, then write what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build", help="where it was built")
    parser.add_argument("--output", type=Path, help="default: report/benchmark there")
    parser.add_argument("--rounds", type=int, default=15, help="of communication steps")
    parser.add_argument("--repeats", type=int, default=11, help="of all others")
    parser.add_argument("--readme", action="store_true", help="put the ratios into the page")
    options = parser.parse_args()
    output = options.output or options.build / "report/benchmark"
    if not (options.build / "tests/bench/libbench.so").exists():
        sys.exit(f"{options.build} has no libbench.so. Build it and run this with\n"
                 "    ./setup.sh --platforms && cmake --preset default && "
                 "cmake --build build --target benchmark")  # fmt: skip
    output.mkdir(parents=True, exist_ok=True)
    about = machine()  # with the load before
    solvers = Solvers(options.build)
    peers = [*in_steps(solvers), *in_free_motion(solvers)]
    rows = take_rounds([*peers, *make_peers(rows_of(peers))], options.rounds)
    print("an instance, friction and stops, models in equations", file=sys.stderr)
    rows += by_models.rows(options.repeats, solvers.library)
    rows += by_gradients.rows(options.repeats)
    with tempfile.TemporaryDirectory() as folder:
        rows += by_systems.rows(options.repeats, options.build, Path(folder), solvers)
    rows += plant_rows(solvers, options.repeats) + life_rows(solvers, options.repeats)
    result = {
        "machine": about | {"loops": solvers.made_by, "MuJoCo": solvers.mujoco_version},
        "rounds": options.rounds,
        "repeats": options.repeats,
        "rows": judge(rows),
    }
    (output / "benchmark.json").write_text(
        json.dumps(result, indent=1) + "\n", encoding="utf-8", newline="\n"
    )
    text = markdown(result)
    (output / "benchmark.md").write_text(text, encoding="utf-8", newline="\n")
    if options.readme:
        page = Path(__file__).with_name("README.md")
        figures = with_figures(page.read_text(encoding="utf-8"), summary(result))
        page.write_text(figures, encoding="utf-8", newline="\n")
    print(text)


if __name__ == "__main__":
    main()
