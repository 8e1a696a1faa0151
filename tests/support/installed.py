"""An environment with the wheel of ./release.sh, and nothing of the checkout."""

import subprocess
import sysconfig
import venv
import zipfile
from pathlib import Path

from tests.support.missing import missing
from tests.support.paths import ROOT

RELEASE = ROOT / "build" / "release"


def wheel_of_release() -> Path:
    """The wheel; without one the test is skipped."""
    found = sorted(RELEASE.glob("rparm-*-py3-none-any.whl"))
    if not found:
        missing(f"{RELEASE} has no wheel: ./release.sh builds it")
    return found[0]


class Installed:
    """An environment with the wheel in a folder with a blank in its name.

    What the wheel needs comes from the environment of the tests.
    """

    def __init__(self, wheel: Path, folder: Path) -> None:
        self.folder = folder / "an environment"
        self.work = folder / "somewhere else"
        self.cache = folder / "cache"
        self.work.mkdir()
        venv.create(self.folder, symlinks=True, with_pip=False)
        self.packages = Path(sysconfig.get_path("purelib", vars={"base": str(self.folder)}))
        with zipfile.ZipFile(wheel) as archive:  # what pip does with a wheel of this kind
            archive.extractall(self.packages)
        others = sysconfig.get_path("purelib")
        (self.packages / "others.pth").write_text(f"{others}\n")

    def start(self, *arguments: object, **variables: str) -> subprocess.Popen[str]:
        """Start `rparm ...` in another folder."""
        python = self.folder / "bin" / "python"
        environment = {"HOME": str(self.work), "RPARM_CACHE": str(self.cache), "PATH": "/nowhere"}
        return subprocess.Popen(
            [python, "-P", "-m", "rparm", *map(str, arguments)], cwd=self.work,
            env=environment | variables, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def run(self, *arguments: object, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run it to its end."""
        with self.start(*arguments, **variables) as process:
            output, errors = process.communicate()
        return subprocess.CompletedProcess(process.args, process.returncode, output, errors)
