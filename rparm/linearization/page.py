"""The page of a linear model."""

from pathlib import Path

from rparm.linearization import explained, figures
from rparm.linearization.margins import closed
from rparm.linearization.study import Study
from rparm.report import pages
from rparm.report.pages import INDEX, Table, save_figure, write_page

Picture = tuple[str, str]  # file without its suffix, and what it shows
Part = tuple[Table, str, list[Picture]]


def write(folder: Path, found: Study, step: float | None, again: str) -> Path:
    """Write page and pictures into a folder; return the page. `again` makes them again."""
    pages.write_assets(folder)
    linear = found.linear
    parts: list[Part] = []
    if found.trimmed:
        parts.append((explained.equilibrium(found), explained.EQUILIBRIUM, []))
    if found.margins is not None:
        parts.append((explained.margins(found.margins), explained.MARGINS, []))
    if found.largest:
        parts.append((explained.largest(list(found.largest)), explained.STEPS, []))
    if len(linear.states):
        save_figure(figures.poles(linear, step, found.loop), folder / "poles.png")
        parts.append((explained.poles(found), explained.POLES, [("poles", "Poles")]))
    pictures = _pictures(folder, found, step)
    if pictures:
        shown = Table("Answers", [], [])
        parts.append((shown, explained.PICTURES, pictures))
    parts.append((explained.point(found), explained.POINT, []))
    parts.append((explained.matrices(found), explained.MATRICES, []))
    name = f"{found.path.stem}, {found.variant}" if found.variant else found.path.stem
    return write_page(
        folder / INDEX,
        "linearization.html",
        root="",
        title=f"{name}: linear model",
        again=again,
        notes=[*explained.notes(found), *_not_drawn(found)],
        parts=parts,
    )


def _pictures(folder: Path, found: Study, step: float | None) -> list[Picture]:
    """Bode, Nyquist and steps: of the loop where it is broken, else of inputs and outputs."""
    if found.loop is not None:
        save_figure(figures.bode(found.loop, step, found.margins), folder / "bode.png")
        save_figure(figures.nyquist(found.loop, step), folder / "nyquist.png")
        save_figure(figures.steps(closed(found.loop), None), folder / "steps.png")
        return [
            ("bode", "Bode diagram of the loop"),
            ("nyquist", "Nyquist diagram of the loop"),
            ("steps", "The closed loop after a step"),
        ]
    shown = figures.drawn(found.linear)
    if not shown.inputs or not shown.outputs:
        return []
    save_figure(figures.bode(shown, step), folder / "bode.png")
    save_figure(figures.steps(shown, step), folder / "steps.png")
    return [("bode", "Bode diagram"), ("steps", "Answers to steps")]


def _not_drawn(found: Study) -> list[str]:
    linear = found.linear
    if found.loop is not None or max(len(linear.inputs), len(linear.outputs)) <= figures.MOST:
        return []
    return [
        f"Pictures show the first {figures.MOST} outputs that respond, and inputs; --inputs and "
        "--outputs choose."
    ]
