"""The study as tables of text, with verdicts."""

import numpy as np
from rparm.models.closed_loop.coupling.delays import LARGEST_ERROR, Tracking, tracking_passed
from rparm.models.closed_loop.coupling.payload import Payload
from rparm.models.closed_loop.coupling.step_doubling import Doubling
from rparm.models.closed_loop.coupling.step_errors import StepErrors

from rparm.units import short, verdict


def step_error_lines(study: StepErrors) -> list[str]:
    steps = "".join(f"{1e3 * step:>5g} ms" for step in study.steps)
    width = max(len(method.name) for method in study.methods)
    blocks = (
        ("error of the arm's states", study.errors),
        ("energy from the coupling, J", study.energies),
    )
    lines = []
    for title, values in blocks:
        head = f"{'':<{width}}{steps} slope  result"
        lines += [title, head, "-" * len(head)]
        for i, (method, row) in enumerate(zip(study.methods, values, strict=True)):
            cells = "".join(f"{short(value, 1):>8}" for value in row)
            slope = study.slopes(values)[i]
            good = verdict(method.expects(slope))
            lines.append(f"{method.name:<{width}}{cells} {slope:>5.2f}  {good}")
        lines.append("")
    calls = "".join(f"{count:>8}" for count in study.calls[0])
    return [*lines, f"{'calls of DoStep':<{width}}{calls}"]


def tracking_lines(tracking: list[Tracking]) -> list[str]:
    title = f"end effector on the circle, {1e3 * tracking[0].step:g} ms"
    head = f"{title:<34}  {'measured':>11}  {'predicted':>11}  deviation  result"
    lines = [head, "-" * len(head)]
    for t in tracking:
        good = verdict(t.predicts)
        lines.append(
            f"{t.method.name:<34}  {t.largest:>9.3e} m  {t.predicted.max():>9.3e} m"
            f"  {100 * t.deviation:>7.1f} %  {good}"
        )
    passed = tracking_passed(tracking)
    text = f"Jacobi below {LARGEST_ERROR:g} m, Gauss-Seidel smaller, all as predicted"
    return [*lines, f"{text}: {verdict(passed)}"]


def payload_lines(payload: Payload) -> list[str]:
    title = "unknown payload, 1 ms, Jacobi"
    head = f"{title:<34}  {'on circle':>11}  {'held: q1':>13}  {'q2':>13}"
    lines = [head, "-" * len(head)]
    for name, largest in payload.largest.items():
        q1, q2 = payload.held[name]
        lines.append(f"{name:<34}  {largest:>9.3e} m  {q1:>9.2e} rad  {q2:>11.2e} m")
    q1, q2 = payload.theory
    lines.append(f"{'theory without integral action':<34}  {'':>11}  {q1:>9.2e} rad  {q2:>11.2e} m")
    return [*lines, f"constant as in theory, removed: {verdict(payload.passed)}"]


def doubling_lines(doubling: list[Doubling]) -> list[str]:
    head = "tolerance  accepted  rejected  calls  largest, median local error  global error"
    lines = ["step doubling; local errors in tolerances", head, "-" * len(head)]
    for d in doubling:
        local = d.local.max() / d.tolerance, np.median(d.local[~d.run.limited]) / d.tolerance
        lines.append(
            f"{short(d.tolerance):>9}  {d.run.accepted:>8}  {d.run.rejected:>8}"
            f"  {d.run.do_steps:>5}  {local[0]:>19.2f}, {local[1]:>6.2f}  {d.error:>12.2e}"
        )
    head = "tolerance  fixed steps   calls  times as many steps, calls  result"
    lines += ["", "fixed steps with the same error", head, "-" * len(head)]
    for d in doubling:
        more = d.fixed_steps / d.run.accepted, d.fixed_calls / d.run.do_steps
        lines.append(
            f"{short(d.tolerance):>9}  {d.fixed_steps:>11}  {d.fixed_calls:>6}"
            f"  {more[0]:>19.1f}, {more[1]:>5.1f}  {verdict(d.passed)}"
        )
    return lines
