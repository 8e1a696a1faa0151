"""Results of a campaign as files: a Parquet file per block, trajectories, and a manifest.

Each file is written to a temporary name and renamed: a file that is there is complete, unless the
disk has lost something. The metadata of each Parquet file name its campaign and its part, and
have the hash of its values, which every reading checks.
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

from rparm.campaign.campaign_file import MAX_RUNS, Campaign
from rparm.campaign.job import Job
from rparm.campaign.planning import FAILURE, RUN, columns_of
from rparm.campaign.runs import Rows
from rparm.errors import UserError, reason
from rparm.files import check_writable, whole, written
from rparm.interruption import temporary_folder

MANIFEST, BLOCKS, TRAJECTORIES = "manifest.json", "blocks", "trajectories"
PACKAGES = ("dask", "distributed", "fmpy", "numpy", "pyarrow", "SALib", "scipy")
WORKERS = ".{}.workers"  # with the number of the process
DIGITS = len(str(MAX_RUNS))  # of numbers in names: names sort like runs
CAMPAIGN, PART, SHA256 = b"campaign", b"part", b"sha256"  # keys of metadata
RESUMES = "the same command resumes it"
ROOM = 1.1  # of the room for the numbers: Parquet adds the rest
FILE, COLUMN = 4000, 400  # bytes of a file, and of each of its columns, besides the rows
ROW_TEXT = 8  # bytes of a row besides its numbers
DAMAGE = (OSError, ValueError, pa.ArrowException)  # raised by damaged Parquet files


class Results:
    """The folder of a campaign's results."""

    def __init__(self, folder: Path, campaign: Campaign, job: Job, text: str) -> None:
        self.folder, self._campaign, self._job, self._text = folder, campaign, job, text
        self.columns = columns_of(campaign, job.measures)
        numbers = [(name, pa.float64()) for name in self.columns]
        self._schema = pa.schema([(RUN, pa.int64()), *numbers, (FAILURE, pa.string())])
        recorded = [(name, pa.float64()) for name in ("time", *job.watched)]
        self._recorded = pa.schema(recorded)  # of a trajectory
        self._manifest = _manifest(campaign, job, text)
        self._hash = hashlib.sha256(_as_text(self._manifest)).hexdigest().encode()

    # ---- The folder ------------------------------------------------------------------------------

    def check(self) -> None:
        """Refuse a folder that holds results of another campaign, by a UserError."""
        path = self.folder / MANIFEST
        if path.exists():
            self._check_manifest(path)
        self._check_blocks()

    def begin(self) -> None:
        """Make the folder; UserError if it has another campaign, or no room for this one."""
        check_writable(self.folder)
        path = self.folder / MANIFEST
        self.check()
        self._check_room()
        with written(self.folder):
            for name in (BLOCKS, TRAJECTORIES):
                (self.folder / name).mkdir(parents=True, exist_ok=True)
            self._remove_left()
            self._write_manifest(path)
        self._check_manifest(path)

    @contextmanager
    def workers_folder(self) -> Iterator[Path]:
        """Make a folder for the files of workers on this machine; it is removed at the end."""
        folder = self.folder.absolute() / WORKERS.format(os.getpid())
        try:
            str(folder).encode()
        except UnicodeEncodeError:  # Dask cannot send its name to the workers
            with temporary_folder() as elsewhere:
                yield elsewhere
            return
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

    def _write_manifest(self, path: Path) -> None:
        """Make the manifest unless there is one: another campaign may begin at the same time."""
        temporary = path.with_name(f".{os.getpid()}.{path.name}")
        try:
            temporary.write_bytes(_as_text(self._manifest))
            try:
                os.link(temporary, path)
            except FileExistsError:
                pass
            except OSError:  # a file system without links
                temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)

    def _check_manifest(self, path: Path) -> None:
        other = "give another folder by --output, or remove this one"
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise UserError(f"{path}: cannot be read: {reason(error)}; {other}") from None
        for key, value in self._manifest.items():
            if not isinstance(found, dict) or found.get(key) != value:
                campaign = f"the folder holds the results of another campaign, {other}"
                raise UserError(f"{path}: has another {key}: {campaign}")

    def _check_blocks(self) -> None:
        """Refuse blocks of another campaign, whose manifest has been lost."""
        for path in sorted(self.folder.glob(f"{BLOCKS}/block_*.parquet")):
            try:
                with path.open("rb") as file:  # Parquet opens no name that is not UTF-8
                    found = (pq.read_schema(file).metadata or {}).get(CAMPAIGN)
            except DAMAGE:  # is run again
                continue
            if found != self._hash:
                raise UserError(
                    f"{path}: is a block of another campaign, give another folder by --output, "
                    f"or remove this file"
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
            runs = f"{self._campaign.count} runs need about {_size(needed)}"
            raise UserError(f"{self.folder}: {runs}, the disk has {_size(free)}")

    # ---- Blocks ----------------------------------------------------------------------------------

    def block_path(self, block: int) -> Path:
        return self.folder / BLOCKS / f"block_{block:0{DIGITS}d}.parquet"

    def missing(self) -> list[int]:
        """Return the blocks that are missing or damaged, trajectories included."""
        return [block for block in range(self._campaign.blocks) if not self._is_there(block)]

    def _is_there(self, block: int) -> bool:
        table = self._block(block)
        if table is None:
            return False
        rows = zip(self._campaign.block_range(block), table[FAILURE].to_pylist(), strict=True)
        chosen = (run for run, why in rows if run in self._job.trajectories and not why)
        return all(self._trajectory(run) is not None for run in chosen)

    def _block(self, block: int) -> pa.Table | None:
        return self._read(self.block_path(block), self._schema, f"block {block}")

    def _trajectory(self, run: int) -> pa.Table | None:
        return self._read(self.trajectory_path(run), self._recorded, f"run {run}")

    def _read(self, path: Path, schema: pa.Schema, part: str) -> pa.Table | None:
        """Read a part of the results; None if it is missing or damaged."""
        try:
            with path.open("rb") as source:  # Parquet opens no name that is not UTF-8
                table = pq.ParquetFile(source, page_checksum_verification=True).read()
            if not table.schema.equals(schema):
                return None
            right = self._marked(table, part).schema
            return table if table.schema.equals(right, check_metadata=True) else None
        except FileNotFoundError:
            return None
        except DAMAGE as error:
            if getattr(error, "errno", None):  # of the system, Parquet's have none
                raise UserError(f"{path}: cannot be read: {reason(error)}") from None
            return None

    def _marked(self, table: pa.Table, part: str) -> pa.Table:
        """Mark a table with what it belongs to."""
        marks = {CAMPAIGN: self._hash, PART: part.encode(), SHA256: _sha256(table).encode()}
        return table.replace_schema_metadata(marks)

    def write(self, block: int, points: np.ndarray, rows: Rows) -> None:
        """Keep a block, with its points (rows, columns); UserError if the disk does not take it."""
        numbers = np.column_stack([points, rows.measures])
        columns = [pa.array(rows.runs), *(pa.array(column) for column in numbers.T)]
        columns.append(pa.array(rows.failures, pa.string()))
        try:
            for run, record in rows.trajectories.items():
                columns_of_run = [pa.array(column) for column in (self._job.times, *record.T)]
                table = pa.table(columns_of_run, schema=self._recorded)
                self._write(self.trajectory_path(run), table, f"run {run}")
            table = pa.table(columns, schema=self._schema)
            self._write(self.block_path(block), table, f"block {block}")
        except (OSError, pa.ArrowException) as error:
            text = f"the results cannot be written: {reason(error)}; {RESUMES}"
            raise UserError(f"{self.folder}: {text}") from error

    def trajectory_path(self, run: int) -> Path:
        """Return the file of a run of which everything is kept."""
        return self.folder / TRAJECTORIES / f"run_{run:0{DIGITS}d}.parquet"

    def _write(self, path: Path, table: pa.Table, part: str) -> None:
        marked = self._marked(table, part)
        with whole(path) as temporary, temporary.open("wb") as file:
            pq.write_table(marked, file, compression="zstd", write_page_checksum=True)
            file.flush()
            os.fsync(file.fileno())

    # ---- The table -------------------------------------------------------------------------------

    def block(self, block: int) -> pa.Table:
        """Read one block; UserError if it is missing or damaged."""
        table = self._block(block)
        if table is None:
            raise UserError(f"{self.block_path(block)}: is missing or damaged; {RESUMES}")
        return table

    def table(self, columns: Sequence[str]) -> dict[str, np.ndarray]:
        """Read the columns of all runs, (runs,) each, in the order of the runs."""
        parts = [self.block(block).select(columns) for block in range(self._campaign.blocks)]
        whole_table = pa.concat_tables(parts)
        return {name: whole_table[name].to_numpy() for name in columns}

    def failed(self) -> int:
        reasons = (self.block(block)[FAILURE] for block in range(self._campaign.blocks))
        return sum(pc.sum(pc.not_equal(texts, "")).as_py() for texts in reasons)

    def digest(self) -> str:
        """Return the SHA-256 of all numbers and texts of the table, block by block."""
        total = hashlib.sha256(json.dumps([str(field) for field in self._schema]).encode())
        for block in range(self._campaign.blocks):
            table = self.block(block)
            for name in (RUN, *self.columns):
                total.update(table[name].to_numpy().tobytes())
            total.update("\0".join(table[FAILURE].to_pylist()).encode())
        return total.hexdigest()


def _manifest(campaign: Campaign, job: Job, text: str) -> dict[str, object]:
    return {
        "campaign": text,
        "seed": campaign.seed,
        "runs": campaign.count,
        "blocks": campaign.blocks,
        "sha256": job.hashes,
        "versions": {"python": platform.python_version()} | {x: version(x) for x in PACKAGES},
    }


def _as_text(manifest: dict[str, object]) -> bytes:
    return (json.dumps(manifest, indent=1) + "\n").encode()


def _sha256(table: pa.Table) -> str:
    total = hashlib.sha256()
    for column in table.columns:
        is_text = column.type == pa.string()
        total.update(repr(column.to_pylist()).encode() if is_text else column.to_numpy().tobytes())
    return total.hexdigest()


def _size(count: float) -> str:
    return f"{count / 1e9:.3g} GB" if count >= 1e9 else f"{count / 1e6:.3g} MB"
