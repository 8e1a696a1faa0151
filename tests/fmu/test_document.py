"""The model's README.md, its drawing, and the page that fmu/document.py makes of them."""

import math
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import lxml.html
import pytest
from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin

from tests.support.generator import ARM, generated
from tests.support.tables import tables

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "models" / "rp_manipulator"
PAGES = (MODEL / "README.md", MODEL / "derivation.md")
MISTAKES = tables(str(Path(__file__).with_name("mistakes")))
SVG = "{http://www.w3.org/2000/svg}"

sys.path.insert(0, str(ROOT / "fmu"))
from document import FormulaError, mathml


def run_document(
    pages: Iterable[Path], model_description: Path, output: Path
) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, ROOT / "fmu" / "document.py", "--readme", *pages]
    command += ["--model-description", model_description, "--output", output]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def model_description(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """modelDescription.xml, made from the model's file."""
    output = tmp_path_factory.mktemp("generated")
    generated(ARM, output)
    return output / "modelDescription.xml"


@pytest.fixture(scope="module")
def folder(model_description: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the page of the model."""
    output = tmp_path_factory.mktemp("page") / "documentation"
    done = run_document(PAGES, model_description, output)
    assert (done.returncode, done.stderr) == (0, "")
    return output


@pytest.fixture(scope="module")
def page(folder: Path) -> lxml.html.HtmlElement:
    return lxml.html.fromstring((folder / "index.html").read_bytes())


def table_after(page: lxml.html.HtmlElement, heading: str) -> list[dict[str, str]]:
    """Rows of the first table below a heading, by column title."""
    found = page.xpath(f'.//*[self::h2 or self::h3][text()="{heading}"]/following::table[1]')
    assert found, f"no table below {heading}"
    titles = [cell.text_content() for cell in found[0].xpath(".//th")]
    rows = [
        [cell.text_content() for cell in row.xpath("td")] for row in found[0].xpath(".//tr[td]")
    ]
    return [dict(zip(titles, row, strict=True)) for row in rows]


def formulas() -> list[str]:
    markdown = MarkdownIt("commonmark").enable("table")
    markdown.use(dollarmath_plugin, allow_space=False, allow_labels=False)
    blocks = markdown.parse("\n".join(page.read_text(encoding="utf-8") for page in PAGES))
    tokens = [token for block in blocks for token in [block, *(block.children or [])]]
    return [token.content for token in tokens if token.type.startswith("math_")]


def test_every_formula_converts(page: lxml.html.HtmlElement) -> None:
    for latex in formulas():
        assert mathml(latex, "block").startswith("<math")
    assert len(page.xpath("//*[local-name()='math']")) == len(formulas()) > 100


@pytest.mark.parametrize("latex", MISTAKES["formulas"]["rows"])
def test_incomplete_formulas_are_refused(latex: str) -> None:
    with pytest.raises(FormulaError):
        mathml(latex, "inline")


def test_every_variable_is_listed_as_declared(
    page: lxml.html.HtmlElement, model_description: Path
) -> None:
    headings = ("Parameters", "Inputs", "Outputs", "Local variables", "Independent variable")
    section = page.xpath('//section[@class="variables"]')[0]
    rows = [row for heading in headings for row in table_after(section, heading)]
    listed = {row["Name"]: row for row in rows}
    declared = ET.parse(model_description).findall("ModelVariables/ScalarVariable")
    assert len(rows) == len(declared)
    for variable in declared:
        row = listed[variable.attrib["name"]]
        kind = variable[0]
        assert row["VR"] == variable.get("valueReference")
        assert row["Type"] == kind.tag
        for key in ("causality", "variability", "initial", "description"):
            assert row[key.capitalize()] == variable.get(key, "")
        for key in ("unit", "start", "min", "max"):
            assert row[key.capitalize()] == kind.get(key, "").replace("e-0", "e-")


def test_parameter_table_is_that_of_the_file(page: lxml.html.HtmlElement) -> None:
    parameters = tomllib.loads((MODEL / "arm.toml").read_text(encoding="utf-8"))["parameters"]
    rows = table_after(page, "Parameters")
    assert [row["Parameter"] for row in rows] == list(parameters)
    for row in rows:
        parameter = parameters[row["Parameter"]]
        assert "max" not in parameter
        assert row["Unit"] == parameter["unit"]
        assert float(row["Default"]) == parameter["start"]
        if "min" in parameter:
            assert float(row["Range"].removeprefix("≥ ")) == parameter["min"]
        else:
            assert row["Range"] == "any"


def test_the_contents_lead_to_every_chapter(page: lxml.html.HtmlElement) -> None:
    headings = page.xpath("//h2")
    links = page.xpath("//nav//a")
    assert [link.get("href") for link in links] == [f"#{heading.get('id')}" for heading in headings]
    assert [x.text_content() for x in links] == [x.text_content() for x in headings]
    assert len(links) > 10


def test_page_needs_no_script_and_no_network(page: lxml.html.HtmlElement) -> None:
    assert page.xpath("//script | //link | //a[not(starts-with(@href, '#'))]") == []
    drawing = (MODEL / "model.svg").read_text(encoding="utf-8")
    assert re.findall(r"<script|<image|@import|href=|url\((?!#)", drawing) == []


def test_only_links_that_work_in_the_fmu_are_kept(model_description: Path, tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text("# A\n[code](../code.c) [site](https://fmi-standard.org) [up](#a)\n")
    assert run_document([readme], model_description, tmp_path / "out").returncode == 0
    page = lxml.html.fromstring((tmp_path / "out" / "index.html").read_bytes())
    assert page.xpath("//main/p//a/@href") == ["https://fmi-standard.org", "#a"]
    assert page.xpath("//h1/@id") == ["a"]
    assert "code site up" in page.text_content()


@pytest.mark.parametrize(("readme", "xml", "message"), MISTAKES["document"]["rows"])
def test_bad_input_is_named_in_one_line(
    readme: str, xml: str, message: str, tmp_path: Path
) -> None:
    for text, name in ((readme, "README.md"), (xml, "modelDescription.xml")):
        if text:
            (tmp_path / name).write_text(text, encoding="utf-8")
    done = run_document(
        [tmp_path / "README.md"], tmp_path / "modelDescription.xml", tmp_path / "out"
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.startswith("document.py: ")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def numbers(text: str | None) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+\.?\d*", text or "")]


def test_drawing_has_the_geometry_of_the_equations() -> None:
    drawing = ET.parse(MODEL / "model.svg")
    comment = (MODEL / "model.svg").read_text(encoding="utf-8")
    l1, lc1, a, q2 = (
        float(re.search(rf"\b{name} = (\d+)", comment)[1]) for name in ("l1", "lc1", "a", "q2")
    )
    groups = {group.get("id"): group.get("transform") for group in drawing.iter(f"{SVG}g")}
    (minus_q1,) = numbers(groups["arm"])
    u, v = numbers(groups["frame-2"])
    assert (minus_q1, u, v) == (-30.0, l1 + q2, -a)
    assert numbers(groups["frame-1"]) == [0.0, -a]
    assert numbers(groups["center-of-mass-1"])[:2] == [lc1, 0.0]

    # SVG's y axis points down: the end effector as drawn, and as calculated
    s1, c1 = math.sin(math.radians(-minus_q1)), math.cos(math.radians(-minus_q1))
    x, y = c1 * u + s1 * v, -(-s1 * u + c1 * v)
    L = l1 + q2
    assert (x, y) == pytest.approx((L * c1 - a * s1, L * s1 + a * c1), rel=1e-15)
