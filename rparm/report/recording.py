"""Records the animation of a run as a moving picture, for pages without scripts.

    build/venv/bin/python -m rparm.report.recording NAME FILE.png

The player of the report draws the frames in headless Chromium, so that the picture is what the page
shows. The file is an animated PNG: a program that knows none shows its first frame. It needs what
`./setup.sh --platforms` installs, and the packages of requirements/dev.txt.
"""

import argparse
import base64
import io
import json
import shutil
import sys
from collections.abc import Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from rparm import project
from rparm.errors import UserError, did_you_mean, one_line
from rparm.files import whole, written
from rparm.fmi.fmu_file import Fmu
from rparm.report import motion
from rparm.runs import scenario as scenarios
from rparm.runs.comparison import Runs
from rparm.systems import comparison, ssp

if TYPE_CHECKING:
    from collections.abc import Iterator

    from PIL.Image import Image
    from selenium.webdriver import Chrome

ASSETS = Path(__file__).parent / "assets"
STYLES = ("page.css", "player.css")
SCRIPTS = ("shapes.js", "legend.js", "arm.js", "player.js")
PROGRAMS = ("chromium", "chromedriver")
OPTIONS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu")

LARGEST = 1_000_000  # bytes
COLOURS = 64  # in all frames together
PLAYS = 3  # then it stops: readers who dislike motion need not wait for long
REST = 1.5  # s, of the last frame

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Recording</title><style>{style}</style></head>
<body><div id="player" style="width: {width}px; max-width: none"></div><script>{script}</script>
<script>
  const player = new Player(document.getElementById('player'), {motion});
  function frame(time) {{
    player.seek(time);
    return player.canvas.toDataURL('image/png').split(',')[1];
  }}
</script></body></html>
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 written, 2 a user's mistake."""
    parser = argparse.ArgumentParser(
        prog="python -m rparm.report.recording",
        description="Runs a scenario, or a variant of a system, and records its animation.",
    )
    parser.add_argument("name", metavar="NAME", help="of the scenario or variant")
    parser.add_argument("file", metavar="FILE", type=Path, help="the picture, .png")
    parser.add_argument("--speed", type=float, default=1.0, help="1: as fast as the arm (default)")
    parser.add_argument("--rate", type=float, default=15.0, help="frames a second (default: 15)")
    parser.add_argument("--width", type=int, default=600, help="in pixels (default: 600)")
    options = parser.parse_args(arguments)
    try:
        if not (options.speed > 0 and options.rate > 0 and options.width > 0):
            raise UserError("--speed, --rate and --width: expected numbers above 0")
        if options.file.suffix != ".png":
            raise UserError(f"{options.file}: expected a name that ends with .png")
        if not options.file.absolute().parent.is_dir():
            raise UserError(f"{options.file}: its folder does not exist")
        data = data_of(options.name)
        drawn = frames(data, options.speed / options.rate, options.width)
        with written(options.file):
            size = write(options.file, drawn, 1 / options.rate)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{options.file}: {len(drawn)} frames, {size / 1000:.0f} kB")
    return 0


def data_of(name: str) -> dict[str, Any]:
    """Run a scenario or variant for its player; UserError if it fails or has no animation."""
    files = project.scenario_files()
    data = _of_scenario(files[name]) if name in files else _of_variant(name, list(files))
    if data is None:
        raise UserError(f"{name}: nothing to animate")
    return data


def _of_scenario(file: Path) -> dict[str, Any] | None:
    folder = project.model_folder(file)
    with Fmu(project.built(folder, ".fmu")) as fmu:
        scenario = scenarios.load(file, fmu.model)
        return motion.of_run(Runs({folder.name: fmu}).run(scenario, scenario.tolerance))


def _of_variant(name: str, others: list[str]) -> dict[str, Any] | None:
    known = others
    for system, folder in project.systems().items():
        with ssp.unpacked(project.built(folder, ".ssp")) as opened:
            if name in opened.system.parameters:
                experiment = comparison.load_study(folder).EXPERIMENT
                expected = comparison.load_reference(opened, name, folder, experiment)
                outcome = comparison.simulate(opened, name, expected)
                return motion.of_outcome(system, opened, outcome)
            known = [*known, *opened.system.parameters]
    raise UserError(f"no scenario or variant {name!r}{did_you_mean(name, known)}")


def frames(data: dict[str, Any], step: float, width: int) -> "list[Image]":
    """Draw the motion on a page in Chromium, with a frame every `step` s, `width` px wide."""
    from PIL.PngImagePlugin import PngImageFile

    style = "".join((ASSETS / name).read_text(encoding="utf-8") for name in STYLES)
    script = "".join((ASSETS / name).read_text(encoding="utf-8") for name in SCRIPTS)
    text = PAGE.format(style=style, script=script, width=width, motion=json.dumps(data))
    start, stop = data["time"][0], data["time"][-1]
    times = [*np.arange(start, stop, step).tolist(), stop]
    with TemporaryDirectory(prefix="rparm-") as folder, _chromium() as driver:
        page = Path(folder) / "recording.html"
        page.write_text(text, encoding="utf-8", newline="\n")
        driver.get(page.as_uri())
        drawn = [driver.execute_script("return frame(arguments[0])", time) for time in times]
    return [PngImageFile(io.BytesIO(base64.b64decode(png))).convert("RGB") for png in drawn]


@contextmanager
def _chromium() -> "Iterator[Chrome]":
    try:
        from selenium import webdriver
        from selenium.common.exceptions import WebDriverException
    except ImportError:
        raise UserError("selenium is missing: ./setup.sh --dev installs it") from None
    missing = [program for program in PROGRAMS if shutil.which(program) is None]
    if missing:
        names = " and ".join(missing)
        raise UserError(f"{names} not found: ./setup.sh --platforms installs what is missing")
    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which(PROGRAMS[0]))
    for option in OPTIONS:
        options.add_argument(option)
    service = webdriver.ChromeService(shutil.which(PROGRAMS[1]))
    try:
        driver = webdriver.Chrome(options=options, service=service)
        try:
            yield driver
        finally:
            driver.quit()
    except WebDriverException as error:
        raise UserError(f"Chromium failed: {one_line(error)}") from error


def write(file: Path, drawn: "Sequence[Image]", duration: float) -> int:
    """Write frames of `duration` s as an animated PNG of at most `LARGEST` bytes; its size."""
    first, *others = _with_few_colours(drawn)
    times = [round(1000 * duration)] * len(others) + [round(1000 * REST)]
    buffer = io.BytesIO()
    more = {"append_images": others, "duration": times, "loop": PLAYS}
    first.save(buffer, "PNG", save_all=True, optimize=True, **more)
    size = buffer.tell()
    if size > LARGEST:
        raise UserError(
            f"{file}: would have {size} bytes, more than {LARGEST}: take a smaller --width or "
            "--rate, or a higher --speed"
        )
    with whole(file) as path:
        path.write_bytes(buffer.getvalue())
    return size


def _with_few_colours(drawn: "Sequence[Image]") -> "list[Image]":
    """Return the frames with one palette, which makes the file smaller by far."""
    from PIL import Image

    codes = np.stack([np.asarray(frame) @ np.array([1 << 16, 1 << 8, 1]) for frame in drawn])
    found, places, counts = np.unique(codes, return_inverse=True, return_counts=True)
    colours = np.stack([found >> 16, found >> 8 & 255, found & 255], axis=1)
    # the most frequent ones, so that areas keep their colours; smoothed edges are near to one
    kept = colours[np.argsort(-counts, kind="stable")[:COLOURS]]
    distance = ((colours[:, None] - kept) ** 2).sum(axis=2)
    indices = distance.argmin(axis=1).astype(np.uint8)[places].reshape(codes.shape)
    reduced = []
    for frame in indices:
        image = Image.fromarray(frame, "P")
        image.putpalette(kept.astype(np.uint8).tobytes())
        reduced.append(image)
    return reduced


if __name__ == "__main__":
    sys.exit(main())
