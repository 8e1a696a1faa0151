"""The benchmark: the program bench and the Python peers in turns, a table, a JSON file and plots.

    cmake --build build --target benchmark

Every figure is the median of rounds, or of the repeats of bench, and ratios are formed within a
round. Exits with 0 where targets are missed too: the table shows them.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path

from arm import Work
from peers import (
    LoadedFmu,
    Run,
    build_python_plant,
    run_co_simulation,
    run_dop853,
    run_heyoka,
    run_model_exchange,
    run_mujoco,
)
from plots import draw
from table import markdown

ROOT = Path(__file__).resolve().parents[2]
BOUND = 1e-8  # of the error in free motion
FREE = Work(f"one step of 2 s, free motion, error <= {BOUND:.0e}".replace("-0", "-"), 2.0, 1, False)
CHANGING = (
    Work("1 ms steps, inputs changing", 1e-3, 2000, True),
    Work("10 ms steps, inputs changing", 1e-2, 200, True),
)
SWEPT = "one step of 2 s, free motion"  # the name that bench gives its sweep


@dataclass
class Peer:
    """Which solver does which work at which tolerance, and the rows for its results."""

    name: str
    run: Callable[[Work, float], Run]
    work: Work
    tolerance: float
    group: str = "steps"


def once(peer: Peer) -> tuple[float, float]:
    """Time of a communication step in us, mean of at least 2 ms, and the error."""
    seconds, states = peer.run(peer.work, peer.tolerance)
    passes = max(1, min(200, round(2e-3 / seconds)))
    for _ in range(passes - 1):
        seconds += peer.run(peer.work, peer.tolerance)[0]
    return 1e6 * seconds / passes / peer.work.steps, peer.work.error(states)


def tuned(peer: Peer, bound: float) -> Peer:
    """The peer at its largest tolerance, in quarters of decades, with an error within the bound."""
    best = None
    for quarter in range(-52, -11):
        peer.tolerance = 10.0 ** (quarter / 4)
        if peer.work.error(peer.run(peer.work, peer.tolerance)[1]) > bound:
            break
        best = peer.tolerance
    if best is None:
        raise RuntimeError(f"{peer.name}: no tolerance gives an error of {bound}")
    peer.tolerance = best
    return peer


def run_bench(program: list[str], *options: str) -> dict:
    """Run bench; its JSON."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.json"
        subprocess.run([*program, *options, "--json", path], check=True, stdout=subprocess.DEVNULL)
        return json.loads(path.read_text())


def find(rows: list[dict], work: str, run: str) -> dict:
    """The row of a work and a run."""
    return next(row for row in rows if (row["work"], row["run"]) == (work, run))


def make_peers(own: LoadedFmu, plant: LoadedFmu, first: list[dict], quick: bool) -> list[Peer]:
    """All peers at their tolerances; first: rows of bench, to know how exact erk is."""
    model_exchange = partial(run_model_exchange, own)
    swept = [
        ("heyoka", run_heyoka),
        ("scipy DOP853", run_dop853),
        ("model exchange, CVode of fmpy", model_exchange),
    ]
    driven = [
        ("erk, by fmpy", partial(run_co_simulation, own, method=3)),
        ("cvode_adams, by fmpy", partial(run_co_simulation, own, method=1)),
        ("Python plant of pythonfmu, by fmpy", partial(run_co_simulation, plant)),
    ]
    peers = []
    for work in CHANGING:
        for name, run in [*swept, *driven, ("MuJoCo RK4, by its Python bindings", run_mujoco)]:
            peers.append(Peer(name, run, work, 1e-8))
    peers += [tuned(Peer(name, run, FREE, 0.0), BOUND) for name, run in swept]
    erk = find(first, FREE.name, "erk")
    peers.append(tuned(Peer("heyoka, error no larger than erk's", run_heyoka, FREE, 0.0),
                       erk["error"]))  # fmt: skip
    peers.append(Peer(driven[0][0], driven[0][1], FREE, erk["tolerance"]))
    peers.append(Peer(driven[2][0], driven[2][1], FREE, 1e-8))
    for work in (*CHANGING, Work(SWEPT, FREE.step, FREE.steps, FREE.changing)):
        for exponent in range(-4, -13, -4 if quick else -1):
            peers += [Peer(name, run, work, 10.0**exponent, "precision") for name, run in swept]
    return peers


def take_rounds(program: list[str], peers: list[Peer], rounds: int, repeats: int) -> list[dict]:
    """Rounds of bench's communication steps and all peers; rows with medians over the rounds."""
    values = defaultdict(lambda: defaultdict(list))  # of a row's key: of each figure
    rows = {}
    for number in range(rounds):
        print(f"round {number + 1} of {rounds}", file=sys.stderr)
        c_rows = run_bench(program, "--only", "steps", "--repeats", str(repeats))["rows"]
        for row in c_rows:
            key = (row["group"], row["work"], row["run"])
            rows[key] = row
            for figure in ("us", "ratio"):
                if figure in row:
                    values[key][figure].append(row[figure])
        for peer in peers:
            us, error = once(peer)
            key = (peer.group, peer.work.name, peer.name, peer.tolerance)
            rows[key] = {
                "group": peer.group, "work": peer.work.name, "run": peer.name,
                "step": peer.work.step, "steps": peer.work.steps, "error": error,
                "tolerance": peer.tolerance,
            }  # fmt: skip
            values[key]["us"].append(us)
            if peer.group == "steps":
                plain = find(c_rows, peer.work.name, "plain loop")["us"]
                values[key]["ratio"].append(us / plain)
                if peer.work is FREE and peer.name.startswith("heyoka"):
                    against = ("against", FREE.name, f"erk to {peer.name}")
                    erk = find(c_rows, FREE.name, "erk")
                    values[against]["ratio"].append(erk["us"] / us)
                    rows[against] = dict(zip(("group", "work", "run"), against, strict=True))
                    rows[against] |= {"error": erk["error"], "error_of_peer": error}
    for key, row in rows.items():
        row |= {figure: statistics.median(list_) for figure, list_ in values[key].items()}
    judge(rows[("against", FREE.name, "erk to heyoka")], 8.0)
    for row in rows.values():
        if "judged" in row:
            judge(row, row["limit"])
    return list(rows.values())


def judge(row: dict, limit: float) -> None:
    """Compare the row's ratio with the largest that it may be."""
    row |= {"judged": "ratio", "comparison": "<=", "limit": limit, "met": row["ratio"] <= limit}


def with_figures(page: str, tables: str) -> str:
    """Replace the text under the heading Figures of the page, up to the next heading."""
    before, heading, after = page.partition("\n## Figures\n")
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
    parser.add_argument("--fmu", type=Path, default=build / "RPManipulator.fmu")
    parser.add_argument("--output", type=Path, default=build / "report/benchmark")
    parser.add_argument("--rounds", type=int, default=5, help="of bench and the Python peers")
    parser.add_argument("--repeats", type=int, default=11, help="within bench")
    parser.add_argument("--readme", action="store_true", help="put it all into the page")
    parser.add_argument("--quick", action="store_true", help="little of everything, to try it")
    options = parser.parse_args()
    for path in (options.bench, options.library, options.library_fmi3, options.fmu):
        if not path.exists():
            sys.exit(f"{path}: no such file. Build it and run this with\n"
                     "    ./setup.sh --dev && cmake --preset default && "
                     "cmake --build build --target benchmark")  # fmt: skip
    options.output.mkdir(parents=True, exist_ok=True)
    program = [str(options.bench), str(options.library), str(options.library_fmi3)]
    small = ["--quick"] if options.quick else []

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        own = LoadedFmu(options.fmu, folder / "own")
        plant = LoadedFmu(build_python_plant(folder), folder / "plant")
        first = run_bench(program, "--only", "steps", "--repeats", "1")
        peers = make_peers(own, plant, first["rows"], options.quick)
        rows = take_rounds(program, peers, options.rounds, min(3, options.repeats))
    print("sweeps, instances, threads, calls", file=sys.stderr)
    others = "precision,step-size,instances,threads,calls,life"
    rest = run_bench(program, *small, "--only", others, "--repeats", str(options.repeats))
    machine = first["machine"] | {
        name: version(name) for name in ("fmpy", "heyoka", "scipy", "mujoco", "pythonfmu")
    }
    result = {
        "machine": machine | {"python": sys.version.split()[0]},
        "rounds": options.rounds,
        "repeats": options.repeats,
        "rows": rows + rest["rows"],
    }
    (options.output / "benchmark.json").write_text(json.dumps(result, indent=1) + "\n")
    text = markdown(result)
    (options.output / "benchmark.md").write_text(text)
    if options.readme:
        page = Path(__file__).with_name("README.md")
        page.write_text(with_figures(page.read_text(), text))
    print(text)
    for path in draw(result["rows"], options.output):
        print(path)
        if options.readme:
            shutil.copy(path, Path(__file__).parent)


if __name__ == "__main__":
    main()
