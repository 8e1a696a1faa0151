"""Hook of hatchling: what the wheel carries besides the Python package, below rparm/share.

models/                    scenarios, references, campaigns, systems and the modules that study them
pieces, files.json         all FMUs and systems of the release, as `rparm.shipped` reads them
plotly/, playground/       the library that draws on pages; the plant for a browser

RPARM_RELEASE names the folder of a release that is there; without it, one is built here.
"""

from __future__ import annotations

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
OF_MODELS = (".csv", ".json", ".py", ".ssd", ".svg", ".toml")


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
        for file in sorted((root / "models").rglob("*")):
            if file.suffix in OF_MODELS and not file.stem.endswith("_in"):
                include[str(file)] = f"{SHARE}/{file.relative_to(root).as_posix()}"
        write_pieces(release, staging)
        _add_plotly(root, staging)
        for file in sorted(path for path in staging.rglob("*") if path.is_file()):
            include[str(file)] = f"{SHARE}/{file.relative_to(staging).as_posix()}"
        include[str(root / "build/playground/index.html")] = f"{SHARE}/playground/index.html"

    def finalize(self, *_: object) -> None:
        """Remove what was only made for the wheel."""
        if self.target_name == "wheel":
            shutil.rmtree(self.folder, ignore_errors=True)


def _built(root: Path) -> Path:
    """Build the release and the playground from the sources."""
    subprocess.run([root / "setup.sh", "--release"], check=True)
    for command in (
        ["-S", ".", "-B", "build", "-DBUILD_TESTING=OFF"],
        ["--build", "build", "--target", "release_files", "playground", "--parallel", "2"],
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
    shutil.copy(package / "package_data" / "plotly.min.js", folder)
    (license_file,) = sorted(package.parent.glob("plotly-*.dist-info/**/LICENSE.txt"))
    shutil.copy(license_file, folder)
