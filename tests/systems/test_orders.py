"""Systems in each order of steps, with rates, subsystems and algebraic loops.

100 random systems of linear parts follow recursions by matrix exponentials, written from the page
docs/systems.md.
"""

import math
import re
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import rparm
from rparm import building
from rparm.fmi.fmu_file import Fmu
from rparm.systems.feedthrough import sequence
from rparm.systems.master import Master
from rparm.systems.structure import WAYS, Connection
from tests.support.rparm_project import repacked

STEP, STEPS = 0.1, 12
ORDERS = ("jacobi", "gauss_seidel", "extrapolated")
NUMBERS = [f"{m}{i}" for m in "abcd" for i in range(1, 5)]
# y1 follows both inputs at once, y2 only u2; of the other part no output follows
PART = """
name = "NAME"
experiment = {{ tolerance = 1e-12 }}
[parameters]
{numbers}
[inputs]
u1 = {{}}
u2 = {{}}
[states]
x1 = {{ start = 1, derivative = "a1 * x1 + a2 * x2 + b1 * u1 + b2 * u2" }}
x2 = {{ start = -0.5, derivative = "a3 * x1 + a4 * x2 + b3 * u1 + b4 * u2" }}
[outputs]
y1 = {{ value = "c1 * x1 + c2 * x2 {first}" }}
y2 = {{ value = "c3 * x1 + c4 * x2 {second}" }}
"""


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with both parts, of FMI 2.0 and, in fmi3, of FMI 3.0."""
    folder = tmp_path_factory.mktemp("parts")
    numbers = "\n".join(f"{name} = {{ start = 0 }}" for name in NUMBERS)
    ends = {"Direct": ("+ d1 * u1 + d2 * u2", "+ d4 * u2"), "Lagging": ("", "")}
    for name, (first, second) in ends.items():
        text = PART.format(numbers=numbers, first=first, second=second)
        (folder / f"{name}.toml").write_text(text.replace("NAME", name), encoding="utf-8")
        building.build(folder / f"{name}.toml", output=folder, lock=False)
        (folder / "plain").mkdir(exist_ok=True)
        repacked(folder / f"{name}.fmu", folder / "plain" / f"{name}.fmu", without_slopes)
    return folder


def without_slopes(description: str) -> str:
    """Take the derivatives away that an FMU may give and take."""
    for name in ("canInterpolateInputs", "providesDirectionalDerivative"):
        description = description.replace(f'{name}="true"', "")
    return re.sub(r'maxOutputDerivativeOrder="\d"', "", description)


# ---- Random systems ------------------------------------------------------------------------------
@dataclass
class Part:
    """A component: x' = A x + B u, y = C x + D u."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    direct: np.ndarray  # (2, 2): which outputs follow which inputs at once
    fmu: str
    every: float | None
    x: np.ndarray = field(default_factory=lambda: np.array([1.0, -0.5]))
    y: np.ndarray = field(default_factory=lambda: np.zeros(2))
    dy: np.ndarray = field(default_factory=lambda: np.zeros(2))
    u: np.ndarray = field(default_factory=lambda: np.zeros(2))
    kept: tuple = ()  # what feeds it, with slopes, when its step began
    time: float = 0.0
    ticks: int = 0


class Random:
    """A system with its parts, and the source (part, output) of each input (part, input)."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.parts: list[Part] = []
        for _ in range(int(rng.integers(2, 6))):
            is_direct = rng.random() < 0.6
            direct = np.array([[1, 1], [0, 1]]) * is_direct
            A, B, C, D = (rng.uniform(-1, 1, (2, 2)) for _ in range(4))
            version = rng.choice(["", "fmi3/", "plain/"])
            every = rng.choice([None, None, 1.0, 2.0, 3.0, 2.5])
            self.parts.append(
                Part(A - np.eye(2), B, C, 0.45 * D * direct, direct,
                     f"{version}{'Direct' if is_direct else 'Lagging'}.fmu",
                     None if every is None else every * STEP)
            )  # fmt: skip
        count = len(self.parts)
        self.fed = {
            (i, j): (int(rng.integers(count)), int(rng.integers(2)))
            for i in range(count)
            for j in range(2)
            if rng.random() < 0.8
        }
        self.inner = set(rng.choice(count, size=count // 2, replace=False).tolist())

    def name(self, i: int, nested: bool) -> str:
        return f"sub.p{i}" if nested and i in self.inner else f"p{i}"

    def write(self, folder: Path, order: str, nested: bool, stem: str) -> Path:
        """Write loop files into the folder of the FMUs."""

        def lines(chosen: list[int], ends: list, begin: str = "") -> str:
            components = "".join(
                f'p{i} = {{ file = "{self.parts[i].fmu}"'
                + (f", every = {self.parts[i].every!r}" if self.parts[i].every else "")
                + " }\n"
                for i in chosen
            )
            connections = "".join(
                f'"{name(i)}.u{j + 1}" = "{name(k)}.y{m + 1}"\n' for (i, j), (k, m) in ends
            )
            parameters = "".join(
                f'"p{i}.{m.lower()}{n + 1}" = {float(value)!r}\n'
                for i in chosen
                for m in "ABCD"
                for n, value in enumerate(getattr(self.parts[i], m).ravel())
            )
            return (
                f"[components]\n{begin}{components}[connections]\n{connections}"
                f"[parameters]\n{parameters}"
            )

        everything = sorted(range(len(self.parts)), key=lambda i: i not in self.inner)
        inside = [i for i in everything if i in self.inner and nested]
        ends = list(self.fed.items())
        own = [(end, s) for end, s in ends if end[0] in inside and s[0] in inside]

        name = lambda i: f"p{i}"  # noqa: E731
        begin = ""
        if inside:
            text = f'name = "Sub"\norder = "{order}"\n{lines(inside, own)}'
            (folder / f"{stem}_sub.toml").write_text(text, encoding="utf-8")
            begin = f'sub = "{stem}_sub.toml"\n'
        name = lambda i: self.name(i, nested)  # noqa: E731
        rest = lines(
            [i for i in everything if i not in inside], [x for x in ends if x not in own], begin
        )
        head = f'name = "Whole"\nstep = {STEP}\nstop = {STEPS * STEP!r}\norder = "{order}"\n'
        path = folder / f"{stem}.toml"
        path.write_text(head + rest, encoding="utf-8")
        return path

    # ---- The recursion ---------------------------------------------------------------------------

    def follows(self) -> np.ndarray:
        """Return which output (2 i + j) follows which others at once, through connections."""
        n = 2 * len(self.parts)
        found = np.zeros((n, n), bool)
        for (i, j), (k, m) in self.fed.items():
            for row in range(2):
                found[2 * i + row, 2 * k + m] |= bool(self.parts[i].direct[row, j])
        for _ in range(n):
            found |= (found.astype(int) @ found.astype(int)) > 0
        return found

    def loops(self) -> list[list[tuple[int, int]]]:
        """Return the inputs of each algebraic loop."""
        follows, found = self.follows(), {}
        for (i, j), (k, m) in self.fed.items():
            source = 2 * k + m
            rows = [2 * i + row for row in range(2) if self.parts[i].direct[row, j]]
            if any(follows[source, row] for row in rows):
                key = tuple(np.flatnonzero(follows[source] & follows[:, source]))
                found.setdefault(key, []).append((i, j))
        return [found[key] for key in sorted(found, key=lambda key: follows[key[0]].sum())]

    def groups(self, order: str) -> list[list[int]]:
        """Return which components step together, sorted by direct feedthrough."""
        everything = sorted(range(len(self.parts)), key=lambda i: i not in self.inner)
        if order != "gauss_seidel":
            return [everything]
        merged = {i: {i} for i in everything}
        for loop in self.loops():
            whole = set().union(*(merged[i] for i, _ in loop))
            merged |= dict.fromkeys(whole, whole)
        before = {i: set() for i in everything}
        for (i, j), (k, _) in self.fed.items():
            if self.parts[i].direct[:, j].any() and i != k:
                before[i].add(k)
        found, done = [], set()
        while len(done) < len(everything):
            left = [i for i in everything if i not in done]
            free = [i for i in left if all(before[k] <= merged[i] | done for k in merged[i])]
            group = [i for i in everything if i in merged[(free or left)[0]]]
            found.append(group)
            done |= set(group)
        return found

    def sources(self, i: int, of: str) -> np.ndarray:
        ends = [self.fed.get((i, j)) for j in range(2)]
        return np.array([getattr(self.parts[e[0]], of)[e[1]] if e else 0.0 for e in ends])

    def solve(self, due: set[int]) -> None:
        """Solve each loop for the parts at a communication point; their other inputs are new."""
        for loop in self.loops():
            ends = [end for end in loop if end[0] in due]
            members = sorted({i for i, _ in ends})
            inputs = {i: self.sources(i, "y") for i in members}
            matrix, right = np.eye(len(ends)), np.zeros(len(ends))
            for i in members:
                inputs[i][[j for k, j in ends if k == i]] = 0.0
            for row, end in enumerate(ends):
                k, m = self.fed[end]
                part = self.parts[k]
                if k not in members:
                    right[row] = part.y[m]
                    continue
                right[row] = part.C[m] @ part.x + part.D[m] @ inputs[k]
                for column, (i, j) in enumerate(ends):
                    if i == k:
                        matrix[row, column] -= part.D[m, j]
            for (i, j), value in zip(ends, np.linalg.solve(matrix, right), strict=True):
                inputs[i][j] = value
            for i in members:
                part = self.parts[i]
                part.u, part.y = inputs[i], part.C @ part.x + part.D @ inputs[i]

    def run(self, order: str, as_read: bool = False) -> np.ndarray:
        """Return the outputs at all points, (STEPS + 1, outputs), as steps leave them or `as_read`.

        In Jacobi order rows of a file's system are read after the next inputs have been set.
        """
        on_loop = {self.fed[end] for loop in self.loops() for end in loop}
        connected = set(self.fed.values())
        drawn = on_loop | {e for e in connected if "plain" in self.parts[e[0]].fmu}
        everyone = set(range(len(self.parts)))
        is_sloped, groups = order == "extrapolated", self.groups(order)
        for _ in range(2 * len(self.parts) + 2):  # at the start values pass on until all is settled
            for i, part in enumerate(self.parts):
                part.u = self.sources(i, "y")
                part.y = part.C @ part.x + part.D @ part.u
            self.solve(everyone)
        rows = [self.row(everyone)]
        if is_sloped:
            for _ in range(2 * len(self.parts)):
                slopes = [self.slope(i, self.sources(i, "dy")) for i in everyone]
                for i, part in enumerate(self.parts):
                    known = part.direct * ("fmi3" not in part.fmu)  # slopes of inputs at the start
                    plain = part.C @ (part.A @ part.x + part.B @ part.u)
                    slopes[i] = plain + (part.D * known) @ self.sources(i, "dy")
                    part.dy = np.array([
                        slopes[i][j] if (i, j) in connected - drawn else 0.0 for j in range(2)
                    ])  # fmt: skip
        for n in range(1, STEPS + 1):
            begin, end = (n - 1) * STEP, n * STEP
            for i, part in enumerate(self.parts):
                if part.time == begin:
                    part.kept = self.line(i, begin)
            due = {i for i in everyone if self.is_due(self.parts[i], n)}
            ahead: set[int] = set()
            for group in groups:
                stepping = [i for i in group if i in due]
                old = {i: (self.parts[i].y.copy(), self.parts[i].time) for i in stepping}
                for i in stepping:
                    self.step(i, end, ahead)
                for i in stepping:
                    part = self.parts[i]
                    part.y = part.C @ part.x + part.D @ part.u
                    part.time, part.ticks = end, part.ticks + 1
                    if is_sloped:
                        part.dy = self.slope(i, part.kept[1])
                self.solve(set(stepping))
                for i in stepping:
                    part, (y, time) = self.parts[i], old[i]
                    for j in range(2):
                        if (i, j) in drawn and is_sloped:
                            part.dy[j] = (part.y[j] - y[j]) / (end - time)
                ahead |= set(group)
            rows.append(self.row(due, rows[-1], sets=as_read and order == "jacobi"))
        return np.array(rows)

    def is_due(self, part: Part, n: int) -> bool:
        """Whether its next own point is nearest to point n, the earlier of two."""
        if part.every is None:
            return True
        ratio = (part.ticks + 1) * part.every / STEP
        return math.ceil(ratio - 0.5 - 1e-9) <= n

    def line(self, i: int, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return what feeds a part at a time, on lines, and its slopes."""
        ends = [self.fed.get((i, j)) for j in range(2)]
        slopes = self.sources(i, "dy")
        ages = np.array([time - self.parts[e[0]].time if e else 0.0 for e in ends])
        return self.sources(i, "y") + slopes * ages, slopes

    def step(self, i: int, end: float, ahead: set[int]) -> None:
        part = self.parts[i]
        values, slopes = (x.copy() for x in part.kept)
        newest = self.line(i, part.time)
        for j in range(2):
            if self.fed.get((i, j), (None,))[0] in ahead:
                values[j], slopes[j] = newest[0][j], newest[1][j]
        part.kept, length = (values, slopes), end - part.time
        if "plain" in part.fmu:  # held at the mean
            values, slopes = values + length / 2 * slopes, 0 * slopes
        whole = np.zeros((6, 6))
        whole[:2, :2], whole[:2, 2:4], whole[2:4, 4:] = part.A, part.B, np.eye(2)
        part.x = (expm(whole * length) @ np.concatenate([part.x, values, slopes]))[:2]
        part.u = part.kept[0] + length * part.kept[1]

    def slope(self, i: int, of_inputs: np.ndarray) -> np.ndarray:
        part = self.parts[i]
        return part.C @ (part.A @ part.x + part.B @ part.u) + part.D @ of_inputs

    def row(self, due: set[int], last: np.ndarray | None = None, sets: bool = True) -> np.ndarray:
        """Return what is read: in Jacobi order after the next inputs have been set."""
        found = np.zeros(2 * len(self.parts)) if last is None else last.copy()
        for i in due:
            part = self.parts[i]
            y = part.C @ part.x + part.D @ self.sources(i, "y") if sets else part.y
            found[2 * i : 2 * i + 2] = y
        return found


@pytest.fixture(scope="module")
def fmus(parts: Path) -> Iterator[dict[str, Fmu]]:
    """The FMUs of all parts, by their paths in the folder."""
    names = [f"{v}{name}.fmu" for v in ("", "fmi3/", "plain/") for name in ("Direct", "Lagging")]
    with ExitStack() as stack:
        yield {name: stack.enter_context(Fmu(parts / name)) for name in names}


def mastered(system: Random, order: str, fmus: dict[str, Fmu]) -> np.ndarray:
    """Return the outputs right after each step."""
    used = {f"p{i}": fmus[part.fmu] for i, part in enumerate(system.parts)}
    ends = [
        Connection(f"p{k}", f"y{m + 1}", f"p{i}", f"u{j + 1}")
        for (i, j), (k, m) in system.fed.items()
    ]
    names = sorted(used, key=lambda name: int(name[1:]) not in system.inner)
    if order == "gauss_seidel":
        names = sequence(names, ends, {name: fmu.model for name, fmu in used.items()})
    values = {
        f"p{i}": {f"{x.lower()}{n + 1}": float(v) for x in "ABCD"
                  for n, v in enumerate(getattr(part, x).ravel())}
        for i, part in enumerate(system.parts)
    }  # fmt: skip
    rates = {f"p{i}": part.every for i, part in enumerate(system.parts) if part.every}
    chosen = {name: used[name] for name in names}
    with Master(chosen, ends, *WAYS[order], rates=rates) as master:
        master.initialize(0.0, None, values)
        rows = master.run(STEP * np.arange(STEPS + 1))
        return rows[:, [master.names.index(f"p{i}.y{j}") for i in range(len(used)) for j in (1, 2)]]


@pytest.mark.parametrize("order", ORDERS)
def test_random_systems_follow_recursions(fmus: dict[str, Fmu], order: str) -> None:
    loops, late = 0, 0
    for seed in range(100):
        system = Random(seed)
        found = mastered(system, order, fmus)
        expected = Random(seed).run(order)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9, err_msg=f"seed {seed}")
        loops += bool(system.loops())
        late += any(part.every == 2.5 * STEP for part in system.parts)
    assert loops > 20 and late > 20


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("seed", [0, 4, 5, 14])
def test_a_nested_system_has_the_bits_of_a_flat_one(parts: Path, order: str, seed: int) -> None:
    """With rates, and, but for the first, with loops; rows are read as in the recursion."""
    system = Random(seed)
    flat = rparm.System(system.write(parts, order, False, f"flat{seed}")).run()
    nested = rparm.System(system.write(parts, order, True, f"nested{seed}")).run()
    names = [f"y{j}" for j in (1, 2)]
    expected = Random(seed).run(order, as_read=True).T.reshape(len(system.parts), 2, -1)
    for i, part in enumerate(expected):
        for name, values in zip(names, part, strict=True):
            found = flat[f"p{i}.{name}"]
            np.testing.assert_allclose(found, values, rtol=0, atol=1e-9)
            np.testing.assert_array_equal(nested[f"{system.name(i, True)}.{name}"], found)
