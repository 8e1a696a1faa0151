"""Results of a campaign as files: a Parquet file per block, trajectories, and a manifest.

Each file is written to a temporary name and renamed: a file that is there is complete.
"""

import hashlib
import json
import os
import platform
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import numpy as np
import psutil
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from cosim.campaign.campaign_file import Campaign
from cosim.campaign.job import Job
from cosim.campaign.planning import FAILURE, RUN, columns_of
from cosim.campaign.runs import Rows
from cosim.errors import UserError, reason
from cosim.output_files import whole

MANIFEST, BLOCKS, TRAJECTORIES = "manifest.json", "blocks", "trajectories"
PACKAGES = ("dask", "distributed", "fmpy", "numba", "numpy", "pyarrow", "SALib", "scipy")
WORKERS = ".{}.workers"  # with the number of the process
ROOM = 1.1  # of the room that is needed: what Parquet adds
FILE, COLUMN = 4000, 400  # bytes of a file, and of each of its columns, besides the rows
ROW_TEXT = 8  # bytes of a row besides its numbers


class Results:
    """The folder of a campaign's results."""

    def __init__(self, folder: Path, campaign: Campaign, job: Job, text: str) -> None:
        self.folder, self._campaign, self._job, self._text = folder, campaign, job, text
        self.columns = columns_of(campaign, job.measures)
        numbers = [(name, pa.float64()) for name in self.columns]
        self._schema = pa.schema([(RUN, pa.int64()), *numbers, (FAILURE, pa.string())])

    # ---- The folder ------------------------------------------------------------------------------

    def check(self) -> None:
        """Refuse a folder that holds results of another campaign, by a UserError."""
        path = self.folder / MANIFEST
        if path.exists():
            self._check_manifest(path, self._manifest())

    def begin(self) -> None:
        """Make the folder, or check that it holds results of the same campaign.

        Raises
        ------
        UserError
            If it holds those of another one, or has no room for these.
        """
        wanted = self._manifest()
        path = self.folder / MANIFEST
        self.check()
        self._check_room()
        try:
            for name in (BLOCKS, TRAJECTORIES):
                (self.folder / name).mkdir(parents=True, exist_ok=True)
            self._remove_left()
            if not path.exists():
                with whole(path) as temporary:
                    text = json.dumps(wanted, indent=1) + "\n"
                    temporary.write_text(text, encoding="utf-8", newline="\n")
        except OSError as error:
            raise self._unwritable(error) from error

    @contextmanager
    def workers_folder(self) -> Iterator[Path]:
        """Folder for the files of workers on this machine, which is removed at the end."""
        folder = self.folder / WORKERS.format(os.getpid())
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _remove_left(self) -> None:
        """Remove temporary files and folders of processes that were killed."""
        for left in [*self.folder.glob(".*"), *self.folder.glob("*/.*")]:
            number = left.name.split(".")[1]
            if not number.isdecimal() or psutil.pid_exists(int(number)):
                continue
            if left.is_dir():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)

    def _manifest(self) -> dict[str, object]:
        return {
            "campaign": self._text,
            "seed": self._campaign.seed,
            "runs": self._campaign.count,
            "blocks": self._campaign.blocks,
            "fmu_sha256": self._job.hashes,
            "versions": {
                "python": platform.python_version(),
                **{name: version(name) for name in PACKAGES},
            },
        }

    def _check_manifest(self, path: Path, wanted: dict[str, object]) -> None:
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise UserError(f"{path}: cannot be read: {reason(error)}") from None
        for key, value in wanted.items():
            if not isinstance(found, dict) or found.get(key) != value:
                raise UserError(
                    f"{path}: has another {key}: the folder holds the results of another "
                    f"campaign, give another one by --output, or remove it"
                )

    def _check_room(self) -> None:
        there = self.folder.absolute()
        while not there.exists():
            there = there.parent
        rows = self._campaign.count * (8 * (len(self.columns) + 1) + ROW_TEXT)
        recorded = 8 * len(self._job.times) * (len(self._job.watched) + 1)
        files = self._campaign.blocks * (FILE + COLUMN * len(self._schema))
        needed = ROOM * (rows + files + recorded * len(self._job.trajectories))
        free = shutil.disk_usage(there).free
        if needed > free:
            raise UserError(
                f"{self.folder}: {self._campaign.count} runs need about {needed / 1e9:.3g} GB, "
                f"the disk has {free / 1e9:.3g} GB"
            )

    # ---- Blocks ----------------------------------------------------------------------------------

    def block_path(self, block: int) -> Path:
        """File of a block."""
        return self.folder / BLOCKS / f"block_{block:07d}.parquet"

    def missing(self) -> list[int]:
        """Blocks that are still to be run."""
        return [block for block in range(self._campaign.blocks) if not self._is_there(block)]

    def _is_there(self, block: int) -> bool:
        path = self.block_path(block)
        if not path.exists():
            return False
        try:
            rows = pq.read_metadata(path).num_rows
        except (OSError, pa.ArrowException):  # the machine went down before the disk had it
            return False
        return rows == len(self._campaign.block_range(block))

    def write(self, block: int, points: np.ndarray, rows: Rows) -> None:
        """Keep a block: parameters and derived values (rows, columns), and its runs.

        Raises
        ------
        UserError
            If the disk does not take it.
        """
        numbers = np.column_stack([points, rows.measures])
        columns = [pa.array(rows.runs), *(pa.array(column) for column in numbers.T)]
        columns.append(pa.array(rows.failures, pa.string()))
        try:
            for run, record in rows.trajectories.items():
                self._write_trajectory(run, record)
            self._write(self.block_path(block), pa.table(columns, schema=self._schema))
        except (OSError, pa.ArrowException) as error:
            raise self._unwritable(error) from error

    def _write_trajectory(self, run: int, record: np.ndarray) -> None:
        names = ["time", *self._job.watched]
        columns = [pa.array(column) for column in (self._job.times, *record.T)]
        self._write(self.trajectory_path(run), pa.table(columns, names=names))

    def trajectory_path(self, run: int) -> Path:
        """File of a run of which everything is kept."""
        return self.folder / TRAJECTORIES / f"run_{run:010d}.parquet"

    def _write(self, path: Path, table: pa.Table) -> None:
        with whole(path) as temporary, temporary.open("wb") as file:
            pq.write_table(table, file, compression="zstd")
            file.flush()
            os.fsync(file.fileno())

    def _unwritable(self, error: Exception) -> UserError:
        return UserError(
            f"{self.folder}: the results cannot be written: {reason(error)}; "
            "the same command goes on from what is there"
        )

    # ---- The table -------------------------------------------------------------------------------

    def block(self, block: int) -> pa.Table:
        """One block."""
        return pq.read_table(self.block_path(block), schema=self._schema)

    def table(self, columns: Sequence[str]) -> dict[str, np.ndarray]:
        """Columns of all runs, (runs,) each, in the order of the runs."""
        files = [self.block_path(block) for block in range(self._campaign.blocks)]
        parts = [pq.read_table(path, columns=list(columns)) for path in files]
        whole_table = pa.concat_tables(parts)
        return {name: whole_table[name].to_numpy() for name in columns}

    def failed(self) -> int:
        """Number of runs that failed."""
        reasons = (self.block(block)[FAILURE] for block in range(self._campaign.blocks))
        return sum(pc.sum(pc.not_equal(texts, "")).as_py() for texts in reasons)

    def digest(self) -> str:
        """SHA-256 of all numbers and texts of the table, block by block."""
        total = hashlib.sha256(json.dumps([str(field) for field in self._schema]).encode())
        for block in range(self._campaign.blocks):
            table = self.block(block)
            for name in (RUN, *self.columns):
                total.update(table[name].to_numpy().tobytes())
            total.update("\0".join(table[FAILURE].to_pylist()).encode())
        return total.hexdigest()
