"""Linear models of connected components: one of all, and the loops that signals go around."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rparm.errors import UserError
from rparm.linearization.linear import Linear
from rparm.linearization.matrices import cleared, closure
from rparm.systems.ssp import Connection

NEGLIGIBLE = 1e-14  # of the largest entries of row and column: rounding


def connected(parts: Mapping[str, Linear], connections: Iterable[Connection]) -> Linear:
    """The linear model of components whose outputs feed inputs.

    Its inputs are those of all components, each added to what its connection brings; names are
    "component.variable". UserError if connections form an algebraic loop, with its path.
    """
    inputs = [f"{name}.{u}" for name, part in parts.items() for u in part.inputs]
    outputs = [f"{name}.{y}" for name, part in parts.items() for y in part.outputs]
    fed = _feeding(inputs, outputs, connections)
    A, B, C, D = map(_diagonal, zip(*map(_clear, parts.values()), strict=True))
    _refuse_algebraic_loop(outputs, D @ fed)
    solved, terms = _solved(D @ fed), _solved(np.abs(D) @ fed)
    back, back_terms = B @ fed @ solved, np.abs(B) @ fed @ terms
    return Linear(
        states=tuple(f"{name}.{x}" for name, part in parts.items() for x in part.states),
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        A=cleared(A + back @ C, np.abs(A) + back_terms @ np.abs(C)),
        B=cleared(B + back @ D, np.abs(B) + back_terms @ np.abs(D)),
        C=cleared(solved @ C, terms @ np.abs(C)),
        D=cleared(solved @ D, terms @ np.abs(D)),
        **{
            key: np.concatenate([getattr(part, key) for part in parts.values()])
            for key in ("x", "u", "y", "rates")
        },
        at={f"{name}.{v}": value for name, part in parts.items() for v, value in part.at.items()},
        held=tuple(f"{name}.{x}" for name, part in parts.items() for x in part.held),
        left_out=tuple(f"{name}.{y}" for name, part in parts.items() for y in part.left_out),
    )


def _feeding(
    inputs: Sequence[str], outputs: Sequence[str], connections: Iterable[Connection]
) -> np.ndarray:
    """1 where an output feeds an input, (inputs, outputs); others are constant."""
    fed = np.zeros((len(inputs), len(outputs)))
    for c in connections:
        start = f"{c.start_component}.{c.start_connector}"
        end = f"{c.end_component}.{c.end_connector}"
        if start in outputs and end in inputs:
            fed[inputs.index(end), outputs.index(start)] = 1.0
    return fed


def _clear(part: Linear) -> tuple[np.ndarray, ...]:
    """A, B, C and D of a component with 0 for rounding.

    An entry is compared with its row and its column, as units may make a whole row or column small.
    """
    n = len(part.A)
    whole = np.block([[part.A, part.B], [part.C, part.D]])
    size = np.abs(whole)
    largest = [size.max(axis=i, keepdims=True, initial=0.0) for i in (0, 1)]
    whole = np.where(size > NEGLIGIBLE * np.minimum(*largest), whole, 0.0)
    return whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]


def _solved(direct: np.ndarray) -> np.ndarray:
    """The inverse of 1 - direct, which has no loops: 1 + direct + direct^2 + ..."""
    solved = term = np.eye(len(direct))
    while (term := term @ direct).any():
        solved = solved + term
    return solved


def _diagonal(blocks: Sequence[np.ndarray]) -> np.ndarray:
    whole = np.zeros(np.sum([block.shape for block in blocks], axis=0))
    row, column = 0, 0
    for block in blocks:
        rows, columns = block.shape
        whole[row : row + rows, column : column + columns] = block
        row, column = row + rows, column + columns
    return whole


def _refuse_algebraic_loop(outputs: Sequence[str], direct: np.ndarray) -> None:
    """`direct[i, j]`: output i follows output j at once."""
    following = [np.flatnonzero(row).tolist() for row in direct]
    path: list[int] = []
    done: set[int] = set()

    def visit(i: int) -> None:
        if i in path:
            circle = [outputs[k] for k in reversed([*path[path.index(i) :], i])]
            raise UserError(f"the connections form an algebraic loop: {' -> '.join(circle)}")
        if i in done:
            return
        path.append(i)
        for j in following[i]:
            visit(j)
        done.add(path.pop())

    for i in range(len(outputs)):
        visit(i)


# ---- Loops ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Looped:
    """What of a system lies on loops through its connections: the rest cannot be unstable by them.

    `parts` have only states, inputs and outputs on loops; components that have none are left out.
    """

    parts: Mapping[str, Linear]
    connections: Sequence[Connection]


def looped(parts: Mapping[str, Linear], connections: Iterable[Connection]) -> Looped:
    """The part of a system that signals come back to through a connection."""
    nodes = [
        (name, kind, variable)
        for name, part in parts.items()
        for kind in ("inputs", "states", "outputs")
        for variable in getattr(part, kind)
    ]
    index = {node: i for i, node in enumerate(nodes)}
    arrows = np.zeros((len(nodes), len(nodes)), bool)
    for name, part in parts.items():
        A, B, C, D = _clear(part)
        for cause, effect, matrix in (
            ("states", "states", A),
            ("inputs", "states", B),
            ("states", "outputs", C),
            ("inputs", "outputs", D),
        ):
            for i, j in np.argwhere(matrix).tolist():
                start = index[name, cause, getattr(part, cause)[j]]
                arrows[start, index[name, effect, getattr(part, effect)[i]]] = True
    kept = []
    for c in connections:
        start = index.get((c.start_component, "outputs", c.start_connector))
        end = index.get((c.end_component, "inputs", c.end_connector))
        if start is not None and end is not None:
            arrows[start, end] = True
            kept.append((c, start, end))
    reached = closure(arrows)
    on_loop = [(c, start) for c, start, end in kept if reached[end, start]]
    on_some = [start for _, start in on_loop]
    both = reached & reached.T
    inside = {node for node, ways in zip(nodes, both, strict=True) if ways[on_some].any()}
    reduced = {}
    for name, part in parts.items():
        chosen = {
            kind: [v for v in getattr(part, kind) if (name, kind, v) in inside]
            for kind in ("states", "inputs", "outputs")
        }
        if chosen["outputs"]:
            others = [state for state in part.states if state not in chosen["states"]]
            reduced[name] = part.without(others).select(chosen["inputs"], chosen["outputs"])
    return Looped(reduced, [c for c, _ in on_loop])
