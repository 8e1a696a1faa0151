"""The program that writes the page."""

import base64
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT

PROGRAM = ROOT / "playground" / "build.py"


@pytest.fixture
def module(tmp_path: Path) -> Path:
    """A module of a few bytes, with a description beside it."""
    path = tmp_path / "Small.wasm"
    path.write_bytes(b"\x00asm\x01\x00\x00\x00")
    path.with_name("modelDescription.xml").write_text("<fmiModelDescription/>")
    return path


def build(module: Path) -> subprocess.CompletedProcess[str]:
    license_file = module.with_name("LICENSE")
    license_file.write_text("Copyright <someone>")
    command = [sys.executable, PROGRAM, module, "--license", f"Small & Co={license_file}"]
    command += ["--output", written(module)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def written(module: Path) -> Path:
    return module.parent / "out" / "index.html"


def test_the_page_holds_all_it_needs(module: Path) -> None:
    done = build(module)
    assert done.returncode == 0, done.stderr
    page = written(module).read_text()
    encoded = base64.b64encode(module.read_bytes()).decode()
    assert f'<script type="text/plain" id="Small-module">{encoded}</script>' in page
    assert "<fmiModelDescription/>" in page
    assert "<h3>Small &amp; Co</h3>\n<pre>Copyright &lt;someone&gt;</pre>" in page
    for script in (PROGRAM.parent / "page").glob("*.js"):
        assert script.read_text() in page, script.name
    assert not any(mark in page for mark in ("@styles@", "@scripts@", "@data@", "@licenses@"))
    assert "src=" not in page


def test_a_text_that_ends_its_element_is_refused(module: Path) -> None:
    module.with_name("modelDescription.xml").write_text("<a></Script></a>")
    done = build(module)
    assert done.returncode != 0
    assert "Small: the text would end the element" in done.stderr
    assert not written(module).exists()


def test_a_page_that_is_too_large_is_refused(module: Path) -> None:
    module.write_bytes(bytes(1_500_000))
    done = build(module)
    assert done.returncode == 1
    assert "more than 1500000" in done.stderr
    assert not written(module).exists()
