"""Hook of hatchling: what the wheel carries besides the Python package, below rparm/share.

models/                    scenarios, references, campaigns, systems and their modules; tables as
                           .csv.xz, which `rparm.files` reads like .csv
fmu/, src/                 what makes FMUs of own equations: Python, and what it reads
pieces, files.json.xz      all FMUs and systems of the release, as `rparm.shipped` reads them
loop/PLATFORM/             the library that rparm steps FMUs by
built.tar.xz               what else is built for each platform: built.py
plotly/                    the library that draws on pages

RPARM_RELEASE names the folder of a release that is there; without it, one is built here.
"""

import lzma
import os
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).resolve().parent))
from pieces import write_pieces  # noqa: E402

SHARE = "rparm/share"
# bytes of text have no positions in words
TEXT = {"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "pb": 0}
OF_MODELS = (".csv", ".h", ".json", ".py", ".svg", ".toml")
OF_FMU = ("fmu/**/*.py", "fmu/**/*.toml", "fmu/**/*.in", "fmu/*.css", "fmu/*.html")
OF_FMU += ("src/instance/*.toml",)
# modules that are not for a model
OF_RELEASES = ("bill_of_materials", "built", "pieces", "references", "wheel")
# the FMUs are there, with their pictures
OF_DEVELOPERS = ("model.svg", "make_references.py", "reference_files.py")
FOR_TESTS = ("_in", "sampled", "tightest")  # ends of names of tables that no command reads
FOR_TESTS += tuple(f"{name}/monolithic" for name in ("payload", "integral", "plane", "effort"))


class CustomBuildHook(BuildHookInterface):
    """Adds the files to the wheel; sdists have the sources that they are made of."""

    def initialize(self, _: str, build_data: dict) -> None:
        """Collect the files."""
        if self.target_name != "wheel":
            return
        root = Path(self.root)
        release = Path(os.environ.get("RPARM_RELEASE") or _built(root))
        self.folder = tempfile.mkdtemp()
        staging = Path(self.folder)
        include = build_data["force_include"]
        for file in filter(_is_used, sorted((root / "models").rglob("*"))):
            if file.suffix == ".csv":
                packed = staging / f"{file.relative_to(root).as_posix()}.xz"
                packed.parent.mkdir(parents=True, exist_ok=True)
                packed.write_bytes(_packed(file.read_bytes()))
            else:
                include[str(file)] = f"{SHARE}/{file.relative_to(root).as_posix()}"
        for file in sorted(file for pattern in OF_FMU for file in root.glob(pattern)):
            if file.stem not in OF_RELEASES:
                include[str(file)] = f"{SHARE}/{file.relative_to(root).as_posix()}"
        for page in ("examples/models/README.md", "docs/tutorial.md"):
            include[str(root / page)] = f"{SHARE}/{page}"
        write_pieces(release, staging)
        shutil.copy(release / "built.tar.xz", staging)
        shutil.copytree(release / "loop", staging / "loop")
        _add_plotly(root, staging)
        for file in sorted(path for path in staging.rglob("*") if path.is_file()):
            include[str(file)] = f"{SHARE}/{file.relative_to(staging).as_posix()}"

    def finalize(self, *_: object) -> None:
        """Remove what was only made for the wheel."""
        if self.target_name == "wheel":
            shutil.rmtree(self.folder, ignore_errors=True)


def _packed(text: bytes) -> bytes:
    return lzma.compress(text, filters=[TEXT])


def _is_used(file: Path) -> bool:
    """Whether a file of a model is of use where there are no tests and no references are made."""
    makes_references = file.suffix == ".py" and file.parent.name == "references"
    only_tested = file.suffix == ".csv" and file.with_suffix("").as_posix().endswith(FOR_TESTS)
    is_used = file.suffix in OF_MODELS and file.name not in OF_DEVELOPERS
    return is_used and not makes_references and not only_tested


def _built(root: Path) -> Path:
    """Build the release from the sources."""
    subprocess.run([root / "setup.sh", "--release"], check=True)
    for command in (
        ["-S", ".", "-B", "build", "-DBUILD_TESTING=OFF"],
        ["--build", "build", "--target", "release_files", "--parallel", "2"],
    ):
        subprocess.run(["cmake", *command], cwd=root, check=True)
    return root / "build" / "release"


def _add_plotly(root: Path, staging: Path) -> None:
    """Copy the script and the license of the package plotly, of build/venv or of this Python."""
    found = sorted(root.glob("build/venv/lib/python3*/site-packages/plotly"))
    spec = find_spec("plotly")
    if not found and spec is not None and spec.origin is not None:
        found = [Path(spec.origin).parent]
    package = found[0]
    folder = staging / "plotly"
    folder.mkdir()
    script = (package / "package_data" / "plotly.min.js").read_bytes()
    (folder / "plotly.min.js.xz").write_bytes(_packed(script))
    (license_file,) = sorted(package.parent.glob("plotly-*.dist-info/**/LICENSE.txt"))
    shutil.copy(license_file, folder)
