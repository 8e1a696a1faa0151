"""Linear models as documents for programs, and as files of them."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rparm.errors import UserError, reason
from rparm.files import whole
from rparm.linearization.linear import Linear
from rparm.linearization.study import Study

Document = dict[str, Any]


def document(found: Study, step: float | None) -> Document:
    """All that is found, of names, numbers and lists; with a `step` (s) also the sampled model."""
    linear = found.linear
    result: Document = {
        "states": list(linear.states),
        "inputs": list(linear.inputs),
        "outputs": list(linear.outputs),
        **{name: getattr(linear, name).tolist() for name in "ABCD"},
        "at": dict(linear.at),
        "held": list(linear.held),
        "poles": pairs(linear.poles),
        "left_out": list(linear.left_out),
        "intervals": {
            name: [finite(end) for end in ends] for name, ends in linear.intervals.items()
        },
    }
    if step is not None:
        transition, forced = linear.sampled(step)
        result["zoh"] = {
            "step": step,
            "A": transition.tolist(),
            "B": forced.tolist(),
            "poles": pairs(np.linalg.eigvals(transition)),
        }
    if found.variant:
        result["variant"] = found.variant
    if found.largest:
        result["largest_steps"] = [
            {
                "order": x.order,
                "inputs": x.inputs,
                "step": finite(x.step),
                "frequency": finite(x.frequency),
            }
            for x in found.largest
        ]
    if found.margins is not None:
        names = ("gain_up", "gain_down", "phase", "delay")
        numbers = {name: finite(getattr(found.margins, name)) for name in names}
        dropped = list(found.loop.dropped) if found.loop is not None else []
        result["margins"] = {"stable": found.margins.stable, **numbers, "dropped": dropped}
    return result


def pairs(poles: np.ndarray) -> list[list[float]]:
    """Real and imaginary part of each."""
    return [[float(pole.real), float(pole.imag)] for pole in poles]


def finite(number: float) -> float | None:
    """A number that JSON has; None for what is not finite."""
    return number if np.isfinite(number) else None


def check(path: Path) -> None:
    """Refuse a name that does not say what to write."""
    if path.suffix.lower() not in WRITERS:
        raise UserError(f"--save: {path}: expected a name that ends with {', '.join(WRITERS)}")


def save(path: Path, found: Study, step: float | None) -> None:
    """Write a file, whose suffix says what: .json, .mat of MATLAB and scipy, or .csv."""
    write = WRITERS[path.suffix.lower()]
    try:
        with whole(path) as temporary:
            write(temporary, document(found, step), found.linear)
    except OSError as error:
        raise UserError(f"--save: {path}: cannot be written: {reason(error)}") from error


def _json(path: Path, found: Document, _linear: Linear) -> None:
    path.write_text(
        json.dumps(found, indent=1, allow_nan=False) + "\n", encoding="utf-8", newline="\n"
    )


def _mat(path: Path, found: Document, linear: Linear) -> None:
    from scipy.io import savemat

    names = ("states", "inputs", "outputs", "held")
    values = {name: np.array(found[name], dtype=object) for name in names}
    values |= {name: getattr(linear, name) for name in "ABCD"}
    values["poles"] = linear.poles
    if "zoh" in found:
        values["zoh"] = {name: np.array(value) for name, value in found["zoh"].items()}
    with path.open("wb") as file:
        savemat(file, values)


def _csv(path: Path, found: Document, linear: Linear) -> None:
    """One table, [A B; C D]: a column for each state and input, a row for each x' and output."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["", *linear.states, *linear.inputs])
        for name, a, b in zip(linear.states, linear.A, linear.B, strict=True):
            writer.writerow([f"der({name})", *map(repr, [*a.tolist(), *b.tolist()])])
        for name, c, d in zip(linear.outputs, linear.C, linear.D, strict=True):
            writer.writerow([name, *map(repr, [*c.tolist(), *d.tolist()])])


WRITERS: dict[str, Callable[[Path, Document, Linear], None]] = {
    ".json": _json,
    ".mat": _mat,
    ".csv": _csv,
}
