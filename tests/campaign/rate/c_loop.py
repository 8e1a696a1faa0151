"""The runs of a campaign by c_loop.c, a plain loop in C."""

import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rparm.campaign.job import Job
from rparm.fmi.fmu_file import Fmu
from tests.support.paths import FMI_HEADERS, ROOT

KINDS = {"Real": "reals", "Integer": "integers", "Enumeration": "integers", "Boolean": "booleans"}


class CLoop:
    """The program, compiled in a folder for a job.

    Parameters
    ----------
    job : Job
        Of Real connections and FMI 2.0.
    fmus : mapping of str to Fmu
        By their hash.
    points : ndarray, shape (runs, targets)
    folder : Path
    """

    def __init__(self, job: Job, fmus: Mapping[str, Fmu], points: np.ndarray, folder: Path) -> None:
        folder.mkdir()
        self._program, self._results = folder / "c_loop", folder / "results"
        self._read = job.columns - len(job.reals.names)  # what is watched, among the outputs
        self._outputs = sum(len(c.reals.outputs) for c in job.components)
        (folder / "work.h").write_text(_header(job, fmus, points), encoding="utf-8")
        source = ROOT / "tests" / "campaign" / "rate" / "c_loop.c"
        flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror"]
        flags.append(f"-I{folder}")
        libraries = ["-lm", "-ldl", "-lpthread"]
        command = ["gcc", *flags, "-isystem", FMI_HEADERS, source, "-o", self._program, *libraries]
        subprocess.run(list(map(str, command)), check=True)

    def run(self, runs: int, threads: int) -> tuple[float, float]:
        """Make the first runs; wall time and processor time in s."""
        command = [str(self._program), str(runs), str(threads), str(self._results)]
        out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        wall, processor = map(float, out.split())
        return wall, processor

    def last_and_largest(self) -> np.ndarray:
        """Of what the job watches, (runs, 2, watched), in the runs made last."""
        results = np.fromfile(self._results).reshape(-1, 2, self._outputs)
        return results[:, :, self._read]


def _header(job: Job, fmus: Mapping[str, Fmu], points: np.ndarray) -> str:
    """What c_loop.c knows of its work."""
    used = [fmus[component.archive] for component in job.components]
    parts = [component.reals for component in job.components]
    values: dict[str, list[str]] = {kind: [] for kind in KINDS.values()}
    for i, (component, fmu) in enumerate(zip(job.components, used, strict=True)):
        for name, value in component.values.items():
            variable = fmu.model.variables[name]
            number = _number(value) if variable.type == "Real" else str(int(value))
            values[KINDS[variable.type]].append(f"{{{i}, {variable.reference}, {number}}}")
    targets = [
        f"{{{t.component}, {used[t.component].model.variables[t.variable].reference}, 0}}"
        for _, t in job.targets
    ]

    def counted(column: str) -> list[str]:
        """Where the entries of each component begin and end."""
        counts = [len(getattr(part, column)) for part in parts]
        return [str(sum(counts[:i])) for i in range(len(counts) + 1)]

    arrays = {
        "char *const libraries[]": [f'"{fmu.library}"' for fmu in used],
        "char *const guids[]": [f'"{fmu.guid}"' for fmu in used],
        "struct real reals[]": values["reals"],
        "struct integer integers[]": values["integers"],
        "struct integer booleans[]": values["booleans"],
        "struct real targets[]": targets,
        "double points[][LENGTH(targets)]": [f"{{{_numbers(point)}}}" for point in points],
        "double times[]": [_numbers(job.times)],
        "double held[]": [_numbers(job.reals.values.ravel())],
        "unsigned inputs[]": [str(x) for part in parts for x in part.inputs],
        "unsigned outputs[]": [str(x) for part in parts for x in part.outputs],
        "int sources[]": [str(x) for part in parts for x in part.sources],
        "int first_input[]": counted("inputs"),
        "int first_output[]": counted("outputs"),
    }
    lines = [f"static const {name} = {{{', '.join(rows)}}};" for name, rows in arrays.items()]
    return "\n".join([f"#define TOLERANCE {_number(job.tolerance or 0.0)}", *lines, ""])


def _number(value: float) -> str:
    return float(value).hex()


def _numbers(values: np.ndarray) -> str:
    return ", ".join(map(_number, values))
