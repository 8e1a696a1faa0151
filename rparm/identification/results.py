"""Results as tables and for programs."""

from collections.abc import Mapping
from math import ceil, isfinite, log10

from rparm.identification.identify import Estimate, Identification

DIGITS = 6


def document(found: Identification) -> dict[str, object]:
    """What --json prints."""
    validation = None
    if found.validation is not None:
        outputs = list(found.checked.outputs)
        validation = {
            "log": found.validation.recording.path,
            "chi2": found.validation.chi2,
            "rms": dict(zip(outputs, found.validation.rms.tolist(), strict=True)),
            "follows": dict(zip(outputs, found.validation.follows.tolist(), strict=True)),
        }
    return {
        "parameters": {
            name: _estimate(x) | {"start": start}
            for (name, x), start in zip(
                found.estimates.items(),
                (p.start for p in found.checked.parameters.every),
                strict=True,
            )
        },  # fmt: skip
        "sums": {name: _estimate(x) for name, x in found.sums.items()},
        "unidentifiable": [list(each.names) for each in found.combinations],
        "at_limit": list(found.at_limit),
        "chi2": found.chi2,
        "scatter_to_classical": found.covariances.ratio,
        "whiteness": {
            name: {"p": test.p, "statistic": test.statistic, "white": test.is_white}
            for name, test in found.whiteness.items()
        },
        "validation": validation,
        "segments": len(found.segments),
        "steps": found.steps,
        "converged": found.has_converged,
        "passed": found.passed,
        "warnings": found.warnings,
    }


def _estimate(x: Estimate) -> dict[str, object]:
    classical = None if x.classical is None else list(x.classical)
    return {"value": x.value, "low": x.low, "high": x.high, "classical": classical}


def rows(found: Identification, true: Mapping[str, float]) -> list[tuple[str, list[str], str]]:
    """Name, cells and unit of each parameter, then of the sums that are known.

    Cells are the value and its interval, and the true value if some are known.
    """
    units = {p.name: p.unit or "" for p in found.checked.parameters.every}
    every = [(name, x, units[name]) for name, x in found.estimates.items()]
    for each in found.combinations:
        if str(each) in found.sums:
            every.append((str(each), found.sums[str(each)], units[each.names[0]]))
    known = [text(true.get(name)) for name, _, _ in every]
    return [
        (name, [*texts(x)[:3], *([cell] if true else [])], unit)
        for (name, x, unit), cell in zip(every, known, strict=True)
    ]


def texts(x: Estimate) -> list[str]:
    """Value, interval and classical interval, with digits that show how wide these are."""
    digits = DIGITS
    if x.low is not None and x.high is not None and x.value and isfinite(x.high - x.low):
        half = max((x.high - x.low) / 2, 1e-12 * abs(x.value))
        digits = min(max(ceil(log10(abs(x.value) / half)) + 2, 3), 12)
    return [text(each, digits) for each in (x.value, x.low, x.high, *(x.classical or (None, None)))]


def text(number: float | None, digits: int = DIGITS) -> str:
    """A number of a table; "–" if there is none."""
    return "–" if number is None or not isfinite(number) else f"{number:.{digits}g}"
