"""Writes the playground: one page with everything in it."""

import argparse
import base64
import sys
from pathlib import Path

from jinja2 import Environment, FileSystemLoader

PAGE = Path(__file__).parent / "page"
SHARED = Path(__file__).parents[1] / "rparm" / "report" / "assets"  # of the report, too
STYLES = (SHARED / "page.css", PAGE / "playground.css")
SCRIPTS = (
    SHARED / "shapes.js",
    SHARED / "legend.js",
    SHARED / "arm.js",
    *(
        PAGE / f"{name}.js"
        for name in (
            "model_description", "fmu", "simulation", "settings", "controls", "numbers", "stage",
            "chart", "own", "playground",
        )
    ),
)  # fmt: skip
LARGEST = 1_500_000  # bytes


def parts(module: Path) -> tuple[str, str, str]:
    """Return name, description and code of an FMU; the description lies beside the module.

    They are the texts of script elements that no browser runs.
    """
    description = module.with_name("modelDescription.xml").read_text()
    if "</script" in description.lower():
        raise ValueError(f"{module.stem}: the text would end the element that holds it")
    return module.stem, description, base64.b64encode(module.read_bytes()).decode()


def page(modules: list[Path], licenses: list[str]) -> str:
    """Return the page; licenses, of the code in the modules, are each given as NAME=FILE."""
    templates = Environment(
        loader=FileSystemLoader(PAGE),
        autoescape=True,
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    named = [entry.split("=", 1) for entry in licenses]
    return templates.get_template("page.html").render(
        styles=[path.read_text() for path in STYLES],
        scripts=[path.read_text() for path in SCRIPTS],
        licenses=[(name, Path(path).read_text()) for name, path in named],
        fmus=[parts(module) for module in modules],
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("modules", nargs="+", type=Path, help="FMUs as WebAssembly, NAME.wasm")
    parser.add_argument(
        "--license", action="append", default=[], metavar="NAME=FILE", help="text to show"
    )
    parser.add_argument("--output", required=True, type=Path, help="page to write")
    arguments = parser.parse_args()
    written = page(arguments.modules, arguments.license).encode()
    if len(written) > LARGEST:
        print(f"build.py: the page has {len(written)} bytes, more than {LARGEST}", file=sys.stderr)
        return 1
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_bytes(written)
    return 0


if __name__ == "__main__":
    sys.exit(main())
