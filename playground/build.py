"""Writes the playground: one page with everything in it."""

import argparse
import base64
import html
import sys
from pathlib import Path

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


def element(name: str, kind: str, text: str) -> str:
    """Text for the scripts: a script element that no browser runs."""
    if "</script" in text.lower():
        raise ValueError(f"{name}: the text would end the element that holds it")
    return f'<script type="text/plain" id="{name}-{kind}">{text}</script>'


def data(fmus: dict[str, Path]) -> str:
    """Elements with module and description of each FMU; the description lies beside the module."""
    elements = []
    for name, module in fmus.items():
        description = module.with_name("modelDescription.xml").read_text()
        elements.append(element(name, "description", description))
        elements.append(element(name, "module", base64.b64encode(module.read_bytes()).decode()))
    return "\n".join(elements)


def joined(paths: tuple[Path, ...]) -> str:
    return "\n".join(path.read_text() for path in paths)


def notices(licenses: list[str]) -> str:
    """Return the licenses of the code in the modules, each given as NAME=FILE."""
    texts = []
    for name, _, path in (entry.partition("=") for entry in licenses):
        texts.append(
            f"<h3>{html.escape(name)}</h3>\n<pre>{html.escape(Path(path).read_text())}</pre>"
        )
    return "\n".join(texts)


def page(fmus: dict[str, Path], licenses: list[str]) -> str:
    text = (PAGE / "page.html").read_text()
    parts = {
        "@styles@": joined(STYLES),
        "@scripts@": joined(SCRIPTS),
        "@licenses@": notices(licenses),
        "@data@": data(fmus),
    }
    for mark, part in parts.items():
        text = text.replace(mark, part)
    return text


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("modules", nargs="+", type=Path, help="FMUs as WebAssembly, NAME.wasm")
    parser.add_argument(
        "--license", action="append", default=[], metavar="NAME=FILE", help="text to show"
    )
    parser.add_argument("--output", required=True, type=Path, help="page to write")
    arguments = parser.parse_args()
    fmus = {module.stem: module for module in arguments.modules}
    written = page(fmus, arguments.license).encode()
    if len(written) > LARGEST:
        print(f"build.py: the page has {len(written)} bytes, more than {LARGEST}", file=sys.stderr)
        return 1
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_bytes(written)
    return 0


if __name__ == "__main__":
    sys.exit(main())
