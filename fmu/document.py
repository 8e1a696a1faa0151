"""Makes the page documentation/index.html of an FMU.

The page is the model's README.md and further pages as HTML with a list of their contents, followed
by tables of the variables that modelDescription.xml declares. It is one file with its style sheet
inside, without scripts, and needs no network: formulas become MathML, local images are copied next
to the page, and links to files that are not in the FMU become plain text. Equal input gives equal
bytes.
"""

import argparse
import html
import re
import shutil
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from itertools import chain, pairwise
from pathlib import Path
from urllib.parse import unquote, urlsplit

from jinja2 import Environment, FileSystemLoader
from latex2mathml.converter import convert
from markdown_it import MarkdownIt
from markdown_it.token import Token
from mdit_py_plugins.anchors import anchors_plugin
from mdit_py_plugins.dollarmath import dollarmath_plugin
from program import WrongInputError, atomic_write, program, read_text

NAMESPACE = "http://www.w3.org/1998/Math/MathML"
# elements that need an exact number of children: with fewer of them the LaTeX was incomplete
CHILDREN = dict.fromkeys(("mfrac", "mroot", "msub", "msup", "munder", "mover"), 2)
CHILDREN |= dict.fromkeys(("msubsup", "munderover"), 3)
DOTS = ("\u02d9", "\u00a8")  # of \dot and \ddot
MINUS = "\u2212"
CLOSING = (")", "]", "}", "|", "!")
STYLE_SHEET = Path(__file__).with_suffix(".css")
TEMPLATE = Path(__file__).with_suffix(".html")
# headings of the tables of variables by causality, in the order of the page
GROUPS = {
    "parameter": "Parameters", "calculatedParameter": "Calculated parameters", "input": "Inputs",
    "output": "Outputs", "local": "Local variables", "independent": "Independent variable",
}  # fmt: skip
# their columns, attributes of a ScalarVariable and of its type element, with their headings
COLUMNS = ("valueReference", "name", "type", "causality", "variability", "initial", "unit")
COLUMNS += ("start", "min", "max", "description")
HEADINGS = {key: key.capitalize() for key in COLUMNS} | {"valueReference": "VR"}
NUMBERS = ("valueReference", "start", "min", "max")
SECONDS = ("startTime", "stopTime", "stepSize")  # of the default experiment


class FormulaError(Exception):
    """Why a formula does not convert."""


def mathml(latex: str, display: str) -> str:
    """Convert a formula without dollar signs to a math element, "inline" or "block" (`display`).

    The converter passes on unknown commands and misses no argument: FormulaError if its result has
    signs of either.
    """
    try:
        root = ET.fromstring(convert(latex, display=display))
    except Exception as error:  # noqa: BLE001 (the converter's errors have no common base)
        raise FormulaError(str(error) or type(error).__name__) from None
    for element in root.iter():
        element.tag = element.tag.removeprefix(f"{{{NAMESPACE}}}")
    for element in root.iter():
        check(element)
        improve(element)
    root.set("xmlns", NAMESPACE)
    return ET.tostring(root, encoding="unicode")


def check(element: ET.Element) -> None:
    """Refuse LaTeX that the converter did not understand."""
    text = element.text or ""
    if element.tag == "mi" and text.startswith("\\"):
        raise FormulaError(f"{text} is unknown")
    if element.tag == "mi" and text in ("&", "{", "}"):
        raise FormulaError(f"{text} is out of place")
    if len(element) != CHILDREN.get(element.tag, len(element)):
        raise FormulaError("an argument is missing")


def improve(element: ET.Element) -> None:
    """Set what the converter leaves out: dots are accents, and a sign is not a difference."""
    if element.tag == "mover" and element[1].text in DOTS:
        element.set("accent", "true")
    for before, child in pairwise(element):
        after_operator = before.tag == "mo" and before.text not in CLOSING
        if child.text == MINUS and after_operator:
            child.set("form", "prefix")


def is_remote(address: str) -> bool:
    """Return whether a link leads out of the folder of the page."""
    parts = urlsplit(address)
    return bool(parts.scheme or parts.netloc)


def without_local_links(tokens: Iterable[Token]) -> list[Token]:
    """Drop links to files, keep their text, and keep links to the web and within the page."""
    kept: list[Token] = []
    dropping = False
    for token in tokens:
        if token.type == "link_open":
            address = str(token.attrs["href"])
            dropping = not (is_remote(address) or address.startswith("#"))
        if not (dropping and token.type in ("link_open", "link_close")):
            kept.append(token)
        if token.type == "link_close":
            dropping = False
    return kept


def scroller(kind: str, name: str) -> str:
    """Write the opening tag of a box that scrolls, also by keys, if it is wider than the page."""
    return f'<div class="{kind}" tabindex="0" role="group" aria-label="{html.escape(name)}">'


def prepare_tables(tokens: Iterable[Token]) -> None:
    """Name each table by its heading; its cells without a text are no headers."""
    heading, header, opened = "", None, None
    for token in tokens:
        if token.type == "inline" and opened == "heading_open":
            heading = token.content
        elif token.type == "table_open":
            token.meta["heading"] = heading
        elif token.type == "th_open":
            header = token
            token.attrs["scope"] = "col"
        elif token.type == "inline" and opened == "th_open" and not token.content:
            header.attrs.clear()
            header.tag = "td"
        elif token.type == "th_close":
            token.tag = header.tag
        opened = token.type


def readme_page(readme: Path) -> tuple[str, list[Path], list[tuple[str, str]]]:
    """Write README.md as an HTML body; also images, and (id, HTML text) of level-2 headings."""

    def formula(latex: str, options: dict[str, bool]) -> str:
        try:
            return mathml(latex, "block" if options["display_mode"] else "inline")
        except FormulaError as error:
            line = " ".join(latex.split())
            raise WrongInputError(f"{readme}: formula ${line}$ does not convert: {error}") from None

    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    markdown.use(dollarmath_plugin, allow_space=False, allow_labels=False, renderer=formula)
    markdown.use(anchors_plugin, max_level=3)
    renderers = markdown.renderer.rules
    formula_block, code = renderers["math_block"], renderers["fence"]
    renderers["math_block"] = lambda *parts: formula_block(*parts).replace(
        '<div class="math block">', scroller("math block", "Formula")
    )
    renderers["fence"] = lambda *parts: code(*parts).replace("<pre>", '<pre tabindex="0">')
    renderers["table_open"] = lambda tokens, i, *_: (
        scroller("table", f"Table: {tokens[i].meta['heading']}") + "<table>\n"
    )
    renderers["table_close"] = lambda *_: "</table></div>\n"

    tokens = markdown.parse(read_text(readme))
    prepare_tables(tokens)
    images: list[Path] = []
    for block in tokens:
        block.children = without_local_links(block.children or [])
        for token in block.children:
            address = str(token.attrs.get("src", ""))
            if token.type != "image" or is_remote(address):
                continue
            image = readme.parent / unquote(address)
            if not image.is_file():
                raise WrongInputError(f"{readme}: the image {address} does not exist")
            token.attrs["src"] = image.name
            images.append(image)
    headings = [
        (str(token.attrs["id"]), markdown.renderer.render([text], markdown.options, {}))
        for token, text in pairwise(tokens)
        if token.type == "heading_open" and token.tag == "h2"
    ]
    return markdown.renderer.render(tokens, markdown.options, {}), images, headings


def read_model_description(path: Path) -> ET.Element:
    try:
        root = ET.fromstring(read_text(path))
    except ET.ParseError as error:
        raise WrongInputError(f"{path}: is not valid XML: {error}") from None
    if root.tag != "fmiModelDescription" or root.get("fmiVersion") != "2.0":
        raise WrongInputError(f"{path}: is not a model description of FMI 2.0")
    for variable in root.iterfind("ModelVariables/ScalarVariable"):
        for key in ("name", "valueReference"):
            if key not in variable.attrib:
                raise WrongInputError(f"{path}: a ScalarVariable lacks {key}")
    return root


def variable_row(variable: ET.Element) -> dict[str, str]:
    """Collect what a ScalarVariable and its type element say."""
    row = {"causality": "local", "variability": "continuous", **variable.attrib}
    for kind in variable:
        if kind.tag != "Annotations":
            row = {**kind.attrib, **row, "type": kind.tag}
    return row


def variable_groups(root: ET.Element) -> Iterator[tuple[str, list[dict[str, str]]]]:
    """Yield heading and rows of a table per causality."""
    rows = [variable_row(v) for v in root.iterfind("ModelVariables/ScalarVariable")]
    for causality, heading in GROUPS.items():
        group = [row for row in rows if row["causality"] == causality]
        if group:
            yield heading, group


def document(pages: list[Path], model_description: Path, output: Path) -> None:
    """Write output/index.html and copy the images of the pages next to it."""
    contents, images, headings = zip(*map(readme_page, pages), strict=True)
    root = read_model_description(model_description)
    experiment = root.find("DefaultExperiment")
    values = {} if experiment is None else experiment.attrib
    templates = Environment(
        loader=FileSystemLoader(TEMPLATE.parent),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    templates.filters["text"] = lambda text: html.escape(re.sub(r"(?<=\de-)0+(?=\d)", "", text))
    page = templates.get_template(TEMPLATE.name).render(
        title=": ".join(root.attrib[k] for k in ("modelName", "description") if k in root.attrib),
        style=read_text(STYLE_SHEET),
        headings=chain(*headings, [("all-variables", "Variables of the FMU")]),
        contents="".join(contents),
        experiment=", ".join(f"{k} {v}{' s' if k in SECONDS else ''}" for k, v in values.items()),
        groups=variable_groups(root),
        columns=HEADINGS,
        numbers=NUMBERS,
        scroller=scroller,
    )
    output.mkdir(parents=True, exist_ok=True)
    for image in chain(*images):
        with atomic_write(output / image.name) as temporary:
            shutil.copyfile(image, temporary)
    with atomic_write(output / "index.html") as temporary:
        temporary.write_text(page, encoding="utf-8", newline="\n")


@program()
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--readme", type=Path, nargs="+", required=True, help="pages of the model")
    parser.add_argument("--model-description", type=Path, required=True)
    parser.add_argument("--output", type=Path, required=True, help="folder for the page")
    arguments = parser.parse_args()
    document(arguments.readme, arguments.model_description, arguments.output)


if __name__ == "__main__":
    sys.exit(main())
