"""The benchmark: the program bench and the Python peers in turns, a table, a JSON file and plots.

    cmake --build build --target benchmark

Every figure is the median of rounds, or of the repeats of bench, and ratios are formed within a
round. Exits with 0 where targets are missed too: the table shows them.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from arm import MOTIONS, Work
from peers import (
    LoadedFmu,
    Run,
    build_python_plant,
    follow,
    run_co_simulation,
    run_dop853,
    run_heyoka,
    run_model_exchange,
    run_mujoco,
)
from plots import draw
from table import markdown, summary

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
SWEPT = (*CHANGING[:2], Work("one step of 2 s, free motion", 2.0, 1, "zero"))
OTHERS = (
    Work("1 ms steps, inputs constant", 1e-3, 2000, "constant"),
    Work("10 ms steps, inputs constant", 1e-2, 200, "constant"),
    Work("1 ms steps, inputs changing, tolerance 1e-5", 1e-3, 2000, "changing"),
    Work("1 ms steps, inputs changing, tolerance 1e-11", 1e-3, 2000, "changing"),
    Work("one step of 2 s, inputs constant", 2.0, 1, "constant"),
)
METHODS = {"erk": 3, "cvode_adams": 1, "taylor": 4}
ROUNDING = 1e-14  # an error that no peer need stay below
DRIFT_TOLERANCE = 1e-14
TURNS = 5  # of free motion in a round: its targets are near, and bench and the peers take turns


@dataclass
class Peer:
    """Which solver does which work at which tolerance, and the rows for its results."""

    name: str
    run: Callable[[Work, float], Run]
    work: Work
    tolerance: float
    group: str = "steps"
    against: dict[str, float | None] = field(default_factory=dict)  # run of bench: largest ratio


def once(peer: Peer) -> tuple[float, float]:
    """Time of a communication step in us, mean of at least 2 ms, and the error."""
    seconds, states = peer.run(peer.work, peer.tolerance)
    passes = max(1, min(200, round(2e-3 / seconds)))
    for _ in range(passes - 1):
        seconds += peer.run(peer.work, peer.tolerance)[0]
    return 1e6 * seconds / passes / peer.work.steps, peer.work.error(states)


def tuned(peer: Peer, bound: float) -> Peer:
    """The peer at its largest tolerance, in quarters of decades, with an error within the bound.

    All tolerances below it, to a ten-thousandth of the bound, are within the bound, too.
    """
    best = None
    lowest = max(1e-4 * bound, sys.float_info.epsilon)
    for quarter in range(math.ceil(4.0 * math.log10(lowest) - 1e-6), -11):
        peer.tolerance = 10.0 ** (quarter / 4)
        if peer.work.error(peer.run(peer.work, peer.tolerance)[1]) > bound:
            break
        best = peer.tolerance
    if best is None:
        raise RuntimeError(f"{peer.name}: no tolerance gives an error of {bound}")
    peer.tolerance = best
    return peer


def run_bench(program: list[str], *options: str) -> dict:
    """Figures of bench."""
    output = subprocess.run([*program, *options], check=True, capture_output=True, text=True).stdout
    return json.loads(output)


def find(rows: list[dict], work: str, run: str) -> dict:
    """The row of a work and a run."""
    return next(row for row in rows if (row["work"], row["run"]) == (work, run))


def heyoka_like(run: str, work: Work, first: list[dict]) -> Peer:
    """heyoka with an error no larger than that of a run of bench, or ROUNDING."""
    peer = Peer(f"heyoka, error no larger than {run}'s", run_heyoka, work, 0.0)
    peer.against[run] = None
    return tuned(peer, max(find(first, work.name, run)["error"], ROUNDING))


def make_peers(own: LoadedFmu, plant: LoadedFmu, first: list[dict], quick: bool) -> list[Peer]:
    """All peers at their tolerances; first: rows of bench, to know how exact its runs are."""
    swept = [
        ("heyoka", run_heyoka),
        ("scipy DOP853", run_dop853),
        ("model exchange, CVode of fmpy", partial(run_model_exchange, own)),
    ]
    driven = [
        (f"{name}, by fmpy", partial(run_co_simulation, own, method=method))
        for name, method in METHODS.items()
    ]
    python_plant = ("Python plant of pythonfmu, by fmpy", partial(run_co_simulation, plant))
    bindings = ("MuJoCo RK4, by its Python bindings", run_mujoco)
    peers = []
    for bound, work in FREE.items():
        # scipy and fmpy do not come within 1e-14
        peers += [tuned(Peer(name, run, work, 0.0), bound)
                  for name, run in (swept if bound == 1e-8 else swept[:1])]  # fmt: skip
        heyoka = next(peer for peer in peers if peer.work is work and peer.name == "heyoka")
        heyoka.against = {"erk": 8.0, "taylor": 0.9} if bound == 1e-8 else {"taylor": 0.9}
        for name, method in (("erk", 3), ("taylor", 4)):
            if name in heyoka.against:
                tolerance = find(first, work.name, name)["tolerance"]
                run = partial(run_co_simulation, own, method=method)
                peers.append(Peer(f"{name}, by fmpy", run, work, tolerance))
    peers.append(heyoka_like("erk", FREE[1e-8], first))
    peers.append(heyoka_like("taylor", FREE[1e-8], first))
    peers.append(Peer(*python_plant, FREE[1e-8], 1e-8))
    for work in CHANGING:
        for name, run in (*swept, *driven, python_plant, bindings):
            peers.append(Peer(name, run, work, 1e-8))
    for work in (*CHANGING, *OTHERS):
        peers.append(heyoka_like("taylor", work, first))
    for work in SWEPT:
        for exponent in range(-4, -16, -4 if quick else -1):
            # scipy and fmpy refuse finer tolerances than 1e-12, or work no better at them
            peers += [Peer(name, run, work, 10.0**exponent, "precision")
                      for name, run in (swept if exponent >= -12 else swept[:1])]  # fmt: skip
    return peers


def take_rounds(program: list[str], peers: list[Peer], rounds: int, repeats: int) -> list[dict]:
    """Rounds of bench's communication steps and all peers; rows with medians over the turns."""
    values = defaultdict(lambda: defaultdict(list))  # of a row's key: of each figure
    rows = {}
    free = [peer for peer in peers if peer.work in FREE.values()]
    others = [peer for peer in peers if peer not in free]
    turns = [("steps", others), *[("free-motion", free)] * TURNS] * rounds
    for number, (group, group_peers) in enumerate(turns):
        print(f"turn {number + 1} of {len(turns)}", file=sys.stderr)
        c_rows = run_bench(program, "--only", group, "--repeats", str(repeats))["rows"]
        for row in c_rows:
            key = (row["group"], row["work"], row["run"])
            rows[key] = row
            for figure in ("us", "ratio"):
                if figure in row:
                    values[key][figure].append(row[figure])
        for peer in group_peers:
            us, error = once(peer)
            key = (peer.group, peer.work.name, peer.name, peer.tolerance)
            rows[key] = {
                "group": peer.group, "work": peer.work.name, "run": peer.name,
                "step": peer.work.step, "steps": peer.work.steps, "error": error,
                "tolerance": peer.tolerance,
            }  # fmt: skip
            values[key]["us"].append(us)
            if peer.group == "steps":
                first = next(row for row in c_rows if row["work"] == peer.work.name)
                values[key]["ratio"].append(us / first["us"])
            for run, limit in peer.against.items():
                of_bench = find(c_rows, peer.work.name, run)
                key = ("against", peer.work.name, f"{run} to {peer.name}")
                values[key]["ratio"].append(of_bench["us"] / us)
                rows[key] = dict(zip(("group", "work", "run"), key, strict=True))
                rows[key] |= {"error": of_bench["error"], "error_of_peer": error}
                if limit is not None:
                    rows[key] |= {"judged": "ratio", "comparison": "<=", "limit": limit}
    for key, row in rows.items():
        row |= {figure: statistics.median(list_) for figure, list_ in values[key].items()}
        if "judged" in row:
            row["met"] = row[row["judged"]] <= row["limit"]
    return list(rows.values())


def drift_rows(steps: int) -> list[dict]:
    """heyoka's drift of the energy, in rows as those of bench's energy.c."""
    rows = []
    for motion in MOTIONS:
        seconds, states = follow(motion, DRIFT_TOLERANCE, steps)
        total, scale = motion.energy(np.vstack((motion.start, states)))
        drift = (np.abs(total - total[0]) / np.maximum.accumulate(scale))[1:]
        ends = sorted({math.ceil(10.0 ** (k / 8)) for k in range(8 * 6)} | {steps})
        ends = [end for end in ends if end <= steps]
        for begin, end in zip([0, *ends[:-1]], ends, strict=True):
            rows.append({
                "group": "energy", "work": motion.name, "run": "heyoka", "steps": end,
                "drift": drift[begin:end].max(), "largest": drift[:end].max(),
                "at_end": drift[end - 1], "us": 1e6 * seconds / steps, "end_q1": states[end - 1, 0],
            })  # fmt: skip
    return rows


def with_figures(page: str, tables: str) -> str:
    """Replace the text under the heading Ratios of the page, up to the next heading."""
    before, heading, after = page.partition("\n## Ratios\n")
    _, following, after = after.partition("\n## ")
    return f"{before}{heading}\n{tables}{following}{after}"


def main() -> None:
    """Measure, then write what was measured."""
    build = ROOT / "build"
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bench", type=Path, default=build / "tests/bench/bench")
    parser.add_argument("--library", type=Path,
                        default=build / "fmu/RPManipulator/RPManipulator.so")  # fmt: skip
    parser.add_argument("--library-fmi3", type=Path,
                        default=build / "fmu/RPManipulator/fmi3/RPManipulator.so")  # fmt: skip
    parser.add_argument("--library-idle", type=Path,
                        default=build / "tests/bench/idle/RPManipulator.so",
                        help="the FMU with an integrator that returns at once")  # fmt: skip
    parser.add_argument("--library-plant", type=Path,
                        default=build / "fmu/RPPlant/RPPlant.so")  # fmt: skip
    parser.add_argument("--fmu", type=Path, default=build / "RPManipulator.fmu")
    parser.add_argument("--output", type=Path, default=build / "report/benchmark")
    parser.add_argument("--rounds", type=int, default=5, help="of bench and the Python peers")
    parser.add_argument("--repeats", type=int, default=11, help="within bench")
    parser.add_argument("--readme", action="store_true", help="put the ratios into the page")
    parser.add_argument("--quick", action="store_true", help="little of everything, to try it")
    options = parser.parse_args()
    libraries = (
        options.library,
        options.library_fmi3,
        options.library_idle,
        options.library_plant,
    )
    for path in (options.bench, *libraries, options.fmu):
        if not path.exists():
            sys.exit(f"{path}: no such file. Build it and run this with\n"
                     "    ./setup.sh --platforms && cmake --preset default && "
                     "cmake --build build --target benchmark")  # fmt: skip
    options.output.mkdir(parents=True, exist_ok=True)
    program = [str(path) for path in (options.bench, *libraries)]
    small = ["--quick"] if options.quick else []

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        own = LoadedFmu(options.fmu, folder / "own")
        plant = LoadedFmu(build_python_plant(folder), folder / "plant")
        first = run_bench(program, "--only", "steps,free-motion", "--repeats", "1")
        peers = make_peers(own, plant, first["rows"], options.quick)
        rows = take_rounds(program, peers, options.rounds, min(3, options.repeats))
    print("sweeps, instances, threads, energy, calls", file=sys.stderr)
    others = "precision,step-size,instances,threads,energy,instance,calls,life,plant"
    rest = run_bench(program, *small, "--only", others, "--repeats", str(options.repeats))
    machine = first["machine"] | {
        name: version(name) for name in ("fmpy", "heyoka", "scipy", "mujoco", "pythonfmu")
    }
    result = {
        "machine": machine | {"python": sys.version.split()[0]},
        "rounds": options.rounds,
        "repeats": options.repeats,
        "rows": rows + rest["rows"] + drift_rows(10_000 if options.quick else 1_000_000),
    }
    (options.output / "benchmark.json").write_text(json.dumps(result, indent=1) + "\n")
    text = markdown(result)
    (options.output / "benchmark.md").write_text(text)
    if options.readme:
        page = Path(__file__).with_name("README.md")
        page.write_text(with_figures(page.read_text(), summary(result)))
    print(text)
    for path in draw(result["rows"], options.output):
        print(path)


if __name__ == "__main__":
    main()
