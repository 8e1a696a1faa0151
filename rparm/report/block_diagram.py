"""Draws the blocks of a system and the signals between them, from left to right, as SVG.

Signals between neighbors run straight; those that go back, or far, take a lane below all blocks.
The blocks of a subsystem have rows of their own, within a frame. Numbers are those of an order.
"""

from collections.abc import Mapping, Sequence

from rparm.systems.feedthrough import sequence
from rparm.systems.structure import OpenedSystem, System
from rparm.texts import rendered
from rparm.units import duration

HEIGHT, APART, LANE, CHANNEL, LETTER = 64, 30, 26, 12, 7  # px; the last one: width of a letter
FRAME, TITLE = 9, 22  # px around the blocks of a subsystem, and above them
CAPTIONS = {
    "gauss_seidel": "Gauss-Seidel order, as numbered",
    "extrapolated": "inputs extrapolated",
}
MOST_NAMED = 4  # signals of a line
Pair = tuple[str, str]  # components at the start and the end of signals


def draw(opened: OpenedSystem) -> str:
    """Return the picture; lines bear the names of outputs, or of inputs from outside."""
    signals: dict[Pair, dict[str, None]] = {}
    for name in opened.system.inputs:
        component, variable = opened.split(name)
        signals.setdefault(("", component), {})[variable] = None
    for c in opened.system.connections:
        signals.setdefault((c.start_component, c.end_component), {})[c.start_connector] = None
    rates = {name: f", every {duration(x)}" for name, x in opened.system.rates.items()}
    blocks = {name: model.name + rates.get(name, "") for name, model in opened.models.items()}
    order = []
    if opened.system.order == "gauss_seidel":
        order = sequence(blocks, opened.system.connections, opened.models)
    labels = {pair: _label(list(names)) for pair, names in signals.items()}
    return _Picture(blocks, labels, opened.system, order).svg()


def _label(names: Sequence[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f", {more} more" if more > 0 else "")


def _layers(names: Sequence[str], pairs: Sequence[Pair]) -> dict[str, int]:
    """Return the column of each block: behind those before it in the file that feed it."""
    found: dict[str, int] = {}
    for name in names:
        feeding = [found[start] for start, end in pairs if end == name and start in found]
        found[name] = max(feeding, default=-1) + 1
    return found


class _Picture:
    def __init__(
        self, blocks: Mapping[str, str], labels: Mapping[Pair, str], system: System,
        order: Sequence[str],
    ) -> None:  # fmt: skip
        self.blocks, self.labels, self.order = blocks, labels, order
        self.caption = CAPTIONS.get(system.order, "")
        # of each block, the last subsystem that it is in; each is before those in it
        inner = {"": "", **{name: name for name in system.subsystems}}
        self.within = {n: [s for s in inner if not s or n.startswith(f"{s}.")][-1] for n in blocks}
        layer = _layers(list(blocks), list(labels))
        self.layer = layer | {"": -1}  # outside: to the left of all
        columns = [[n for n in blocks if layer[n] == i] for i in range(max(layer.values()) + 1)]
        self.wide = {n: 24 + LETTER * max(len(n), len(unit)) for n, unit in blocks.items()}
        # gaps to the left of each column, and behind the last one: names, then vertical lines
        self.verticals: list[list[Pair]] = [[] for _ in range(len(columns) + 1)]
        far = [pair for pair in labels if not self._is_next(pair)]
        self.lanes = sorted(far, key=lambda pair: abs(self.layer[pair[1]] - self.layer[pair[0]]))
        for pair in labels:
            if pair in self.lanes:
                self.verticals[self.layer[pair[0]] + 1].append(pair)
            self.verticals[self.layer[pair[1]]].append(pair)
        x, self.x, self.begin = 10, {}, []
        for i, gap in enumerate(self.verticals):
            texts = [len(labels[p]) for p in labels if self._is_next(p) and self.layer[p[1]] == i]
            self.begin.append(x + LETTER * max(texts, default=0) + 12)
            x = self.begin[-1] + CHANNEL * (len(gap) + 1)
            if i < len(columns):
                width = max(self.wide[name] for name in columns[i])
                self.x |= {name: x + (width - self.wide[name]) // 2 for name in columns[i]}
                x += width
        self.width = max(x, 700)  # pages stretch smaller pictures
        self._place_rows(columns, list(inner))

    def _place_rows(self, columns: Sequence[Sequence[str]], bands: Sequence[str]) -> None:
        """Place blocks and frames; `bands`: each subsystem, before those in it."""
        self.y: dict[str, int] = {}
        self.frames: dict[str, list[int]] = {}  # top and bottom
        y, open_frames = 20, list[str]()
        for band in bands:
            while open_frames and not band.startswith(f"{open_frames[-1]}."):
                self.frames[open_frames.pop()].append(y - APART + FRAME)
                y += FRAME
            if band:
                self.frames[band] = [y]
                open_frames.append(band)
                y += TITLE
            rows = [[n for n in column if self.within[n] == band] for column in columns]
            for own in rows:
                self.y |= {n: y + j * (HEIGHT + APART) for j, n in enumerate(own)}
            y += max(map(len, rows)) * (HEIGHT + APART)
        while open_frames:
            self.frames[open_frames.pop()].append(y - APART + FRAME)
            y += FRAME
        self.bottom = y

    def _frame(self, name: str) -> dict[str, object]:
        """Return the rectangle around the blocks of a subsystem."""
        top, bottom = self.frames[name]
        inside = [n for n in self.blocks if n.startswith(f"{name}.")]
        deeper = [s.count(".") for s in self.frames if s.startswith(f"{name}.")]
        around = FRAME * (1 + max(deeper, default=name.count(".")) - name.count("."))
        left = min(self.x[n] for n in inside) - around
        right = max(self.x[n] + self.wide[n] for n in inside) + around
        return {"name": name, "x": left, "y": top, "width": right - left, "height": bottom - top}

    def _is_next(self, pair: Pair) -> bool:
        return self.layer[pair[1]] == self.layer[pair[0]] + 1

    def _port(self, pair: Pair, end: int) -> int:
        """Return the height at which signals leave (0) or enter (1) a block."""
        if not pair[end]:  # from outside
            return self._port(pair, 1)
        ports = [p for p in self.labels if p[end] == pair[end]]
        return self.y[pair[end]] + HEIGHT * (ports.index(pair) + 1) // (len(ports) + 1)

    def _vertical(self, pair: Pair, gap: int, last: bool) -> int:
        lines = self.verticals[gap]
        place = len(lines) - 1 - lines[::-1].index(pair) if last else lines.index(pair)
        return self.begin[gap] + CHANNEL * (place + 1)

    def svg(self) -> str:
        blocks = [
            {"name": name[len(self.within[name]) :].lstrip("."), "unit": unit,
             "x": self.x[name], "y": self.y[name], "width": self.wide[name], "height": HEIGHT,
             "number": self.order.index(name) + 1 if self.order else ""}
            for name, unit in self.blocks.items()
        ]  # fmt: skip
        lines = [(*self._line(pair), text) for pair, text in self.labels.items()]
        height = self.bottom + LANE * (len(self.lanes) + bool(self.caption)) + 10
        given = {"blocks": blocks, "lines": lines, "frames": [*map(self._frame, self.frames)]}
        size = {"width": self.width, "height": height}
        return rendered("blocks.svg", **size, **given, caption=self.caption)

    def _line(self, pair: Pair) -> tuple[str, tuple[int, int]]:
        """Return the path of a line, and where its text begins."""
        start, end = pair
        left, right = self.x[end], self.x[start] + self.wide[start] if start else 10
        leaves, enters = self._port(pair, 0), self._port(pair, 1)
        x = self._vertical(pair, self.layer[end], last=True)
        if pair in self.lanes:
            y = self.bottom + LANE * (self.lanes.index(pair) + 1) - 8
            first = self._vertical(pair, self.layer[start] + 1, last=False)
            verticals = min(self.layer[start] + 1, self.layer[end])
            place = self.begin[verticals] + CHANNEL * (len(self.verticals[verticals]) + 1), y - 5
            return f"M{right} {leaves} H{first} V{y} H{x} V{enters} H{left}", place
        return f"M{right} {leaves} H{x} V{enters} H{left}", (right + 6, leaves - 5)
