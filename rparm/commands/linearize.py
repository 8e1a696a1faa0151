"""`linearize`: the linear model of an FMU or a system at a point."""

import argparse

from rparm import console, project
from rparm.command_line import (
    Ended,
    file_or_name,
    names,
    pairs,
    retyped,
)
from rparm.errors import UserError
from rparm.files import check_writable, from_here, written
from rparm.report import overview, pages
from rparm.report.overview import RAN, Entry, crosses

PART = overview.LINEAR
MOST_COLUMNS, MOST_ROWS = 6, 12  # of matrices in the terminal
SUFFIXES = (".fmu", ".ssp", ".toml")


def do_linearize(options: argparse.Namespace) -> Ended:
    """Linearize, print the tables, write page and files."""
    from rparm.linearization import page, study

    for path in options.save:
        study.check_file(path)
    check_writable(options.report)
    console.stage(f"linearizing {options.what}")
    if options.variant and options.given_variant:
        raise UserError("--variant: a variant is given already")
    options.variant = options.variant or options.given_variant
    request = study.Request(
        options.what, pairs("--at", options.at), options.time, free=names(options.trim or ()),
        inputs=options.inputs and names(options.inputs), variant=options.variant, cut=options.cut,
        outputs=options.outputs and names(options.outputs), without=names(options.without or ()),
        version=options.fmi,
    )  # fmt: skip
    found = study.study(request)
    if options.step is not None:
        found.linear.sampled(options.step)  # a step that is too long is refused before the tables
    n, m, p = (len(getattr(found.linear, key)) for key in ("states", "inputs", "outputs"))
    tables, is_sampled = [], found.linear.dt > 0
    if found.trimmed:
        tables.append((page.equilibrium_table(found), page.EQUILIBRIUM))
    if is_small := n + m <= MOST_COLUMNS and n + p <= MOST_ROWS:
        tables.append((page.matrices_table(found), page.MATRICES[is_sampled]))
    if n:
        tables.append((page.poles_table(found), page.POLES[is_sampled]))
    if found.margins is not None:
        tables.append((page.margins_table(found.margins), page.MARGINS))
    if found.largest:
        tables.append((page.steps_table(list(found.largest)), page.STEPS))
    for table, text in tables:
        console.plain_table(table.title, table.head, table.rows)
        console.remark(text)
    hint = "Matrices: --json, --save and the page; --inputs and --outputs choose."
    for text in [*page.notes(found), *([] if is_small else [hint])]:
        console.remark(text)
    for path in options.save:
        study.save(path, found, options.step)
        print(f"saved: {from_here(path)}")
    report, again = project.results_folder(options.report), _command(options)
    poles = found.linear.poles
    with written(report):
        entry = Entry(
            "_".join(filter(None, (found.path.stem, found.variant))),
            f"{n} states, {m} inputs, {p} outputs", found.path.stem, pages.INDEX, RAN,
            line_text=f"{len(poles)} poles", shapes=crosses(poles), command=again,
        )  # fmt: skip
        index = overview.add(
            report, PART, entry, lambda to, root: page.write(to, found, options.step, again, root)
        )
    document = study.document(found, options.step) | {"page": index.absolute()}
    verdict = f"linear: {n} states, {m} inputs, {p} outputs"
    return Ended(0, verdict, document, page=index)


def _command(options: argparse.Namespace) -> str:
    given = {"fmi": options.fmi if options.fmi != project.VERSIONS[0] else None}
    for name in ("variant", "at", "time", "trim", "inputs", "outputs", "without", "cut", "step"):
        given["break" if name == "cut" else name] = getattr(options, name)
    return retyped("linearize", [file_or_name(options.what, SUFFIXES)], given)
