"""FMUs of files with equations: built once by the command `build`, or quickly for their values."""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from scipy.linalg import expm

from tests.equations.compiled import BUILD, building, declaration, lock, read
from tests.support.instances import Instance, LoadedFmu
from tests.support.paths import ROOT
from tests.support.programs import RPARM, python
from tests.support.tables import tables

from fmi3.model_description import model_description as fmi3_description  # isort: skip
from package import pack  # isort: skip; compiled.py knows where it is
from program import Provenance  # isort: skip

FOLDER = ROOT / "examples" / "models"
# by test module and name
MODELS = tables(str(Path(__file__).with_name("models")))
MISTAKES = tables(str(Path(__file__).with_name("mistakes")))
BUILT = TemporaryDirectory(prefix="rparm-models-")  # in it a folder for each FMU
METHODS = {"cvode_adams": 1, "cvode_bdf": 2, "erk": 3, "taylor": 4}


def build(path: Path, output: Path, *options: str) -> Path:
    """The FMU of FMI 2.0 of a file."""
    ended = python(*RPARM, "build", path, "--output", output, "--json", *options, timeout=None)
    assert ended.returncode == 0, ended.stderr
    (fmu,) = output.glob("*.fmu")
    return fmu


@cache
def runtime(level: str) -> building.Runtime:
    """What FMUs are linked to; the model's own C is compiled at this level."""
    made = building.Runtime.load(BUILD / "runtime" / "runtime.json", True)
    options = [level if option == "-O3" else option for option in made.content["options"]]
    return replace(made, content=made.content | {"options": options})


def quick(path: Path, output: Path, level: str = "-O1", by: list[str] | None = None) -> Path:
    """The FMU of FMI 2.0, and in fmi3 the one of 3.0: only what a run needs, with the same bits.

    by: what there are gradients by, in place of what the file says.
    """
    file = read(path, by)
    references = lock.references(lock.path_of(path), declaration.keys(file))
    made, versions = runtime(level), {"fmi2": output, "fmi3": output / "fmi3"}
    describe = {"fmi2": building.fmi2_description, "fmi3": fmi3_description}
    with TemporaryDirectory() as folder:
        work = Path(folder).resolve()
        declared = building.write_c(file, references, work)
        objects = made.compile([work / name for name in building.C_FILES], work)
        for version, place in versions.items():
            library = work / f"{file.name}{made.content['suffix']}"
            made.link(version, objects, library)
            description = work / "modelDescription.xml"
            description.write_text(describe[version](declared, Provenance("0")), encoding="utf-8")
            binary = f"{made.content['versions'][version]['folder']}/{library.name}"
            parts = [(binary, library), (description.name, description)]
            pack(place / f"{file.name}.fmu", [*parts, (f"resources/{file.name}.toml", path)])
    return output / f"{file.name}.fmu"


@cache
def example(name: str, make: Callable[[Path, Path], Path] = quick) -> Path:
    """The FMU of an example."""
    output, path = Path(BUILT.name) / name.replace("/", "_"), FOLDER / f"{name}.toml"
    output = output / make.__name__
    output.mkdir(parents=True)
    for file in FOLDER.glob("*.toml"):  # components of it, too
        copy(file, output)
    return make(output / path.name, output)


def axis(h: float, *values: float) -> tuple[np.ndarray, np.ndarray]:
    """A tick of this example, and a period h (s), of x, v, y, w, u, sum, last, target, load."""
    M, m, k, c, Kp, Kd, Ki = values
    tick, rates, belt = np.eye(9), np.zeros((9, 9)), np.array([k, c, -k, -c])
    tick[4, 4] = tick[6, 6] = 0
    tick[4:7, [0, 5, 6, 7]] = [[-Kp - Kd / h, 1, Kd / h, Kp], [-Ki * h, 1, 0, Ki * h], [1, 0, 0, 0]]
    rates[[0, 2], [1, 3]] = 1
    rates[1, :5], rates[3, :4], rates[3, 8] = [*-belt / M, 1 / M], belt / m, -1 / m
    return tick, expm(rates * h)


def simulated(
    fmu: Path, stop: float, step: float, start: Mapping[str, float], **options: object
) -> np.ndarray:
    """All outputs of a run, and the time."""
    description = fmpy.read_model_description(fmu)
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    return fmpy.simulate_fmu(
        str(fmu),
        fmi_type=options.pop("fmi_type", "CoSimulation"),
        stop_time=stop,
        output_interval=step,
        start_values=dict(start),
        output=[*outputs, *options.pop("also", [])],
        **options,
    )


@cache
def made(text: str, make: Callable[[Path, Path], Path] = quick) -> Path:
    """The FMU of a text, built once."""
    folder = Path(BUILT.name) / f"{zlib.crc32(text.encode()):08x}" / make.__name__
    folder.mkdir(parents=True)
    path = folder / (text.split('"')[1] + ".toml")
    path.write_text(text, encoding="utf-8")
    return make(path, folder)


@cache
def loaded(fmu: Path) -> LoadedFmu:
    """An FMU, unpacked once: its library stays where it was loaded from."""
    return LoadedFmu(fmu, fmu.parent / "unpacked" / fmu.stem)


def initializing(fmu: Path, kind: type = FMU2Slave) -> Instance:
    """An instance of an FMU of FMI 2.0 at time 0, in initialization mode."""
    return Instance(loaded(fmu), kind).begin(tolerance=1e-11)
