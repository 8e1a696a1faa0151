"""Draws the blocks of a system and the signals between them, from left to right, as SVG.

Signals between neighbors run straight; those that go back, or far, take a lane below all blocks.
"""

from collections.abc import Mapping, Sequence

from rparm.systems.structure import OpenedSystem
from rparm.texts import rendered

HEIGHT, APART, LANE, CHANNEL, LETTER = 64, 30, 26, 12, 7  # px; the last one: width of a letter
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
    blocks = {name: model.name for name, model in opened.models.items()}
    return _Picture(blocks, {pair: _label(list(names)) for pair, names in signals.items()}).svg()


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
    def __init__(self, blocks: Mapping[str, str], labels: Mapping[Pair, str]) -> None:
        self.blocks, self.labels = blocks, labels
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
        rows = {name: j for column in columns for j, name in enumerate(column)}
        self.y = {name: 20 + j * (HEIGHT + APART) for name, j in rows.items()}
        self.bottom = 20 + (max(rows.values()) + 1) * (HEIGHT + APART)

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
            {"name": name, "unit": unit, "x": self.x[name], "y": self.y[name],
             "width": self.wide[name], "height": HEIGHT}
            for name, unit in self.blocks.items()
        ]  # fmt: skip
        lines = [(*self._line(pair), text) for pair, text in self.labels.items()]
        height = self.bottom + LANE * len(self.lanes) + 10
        return rendered("blocks.svg", width=self.width, height=height, blocks=blocks, lines=lines)

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
