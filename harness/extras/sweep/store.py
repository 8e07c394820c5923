"""A folder of rows: Parquet files written whole at intervals, and the plan.

A Parquet file can't be appended to, so rows come in parts. Each part is written to a temporary file
and renamed, so the folder never has an incomplete one. Every reader of Parquet data sets reads the
folder `rows` as one table.
"""

import contextlib
import math
import os
import time
from collections.abc import Iterator, Sequence, Set
from pathlib import Path
from typing import Any

import msgspec

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.hold import locked
from physics_crosscheck.harness.records.outcome import contradiction
from physics_crosscheck.harness.records.read import ResultsError
from physics_crosscheck.harness.records.sweep import SweepPlan, SweepRow
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.results.status import counted
from .factors import SweepError

ROWS = "rows"
PLAN = "plan.json"

PART = 500
"""Maximum number of rows per part."""

SECONDS = 20.0
"""Maximum seconds between parts, and so the most work that an abort loses."""

COLUMN = "constant_"
"""Prefix of the columns of varied constants: `constant_k`."""

_TYPES = {int: "int64", float: "float64", Number: "float64"}
"""Types of columns by those of fields; any other one is a text."""


def arrow() -> Any:
    """Import pyarrow.

    Raises:
        SweepError: if it is not installed, with the install command.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise SweepError(
            "rows are Parquet files, which pyarrow writes; pip install 'physics-crosscheck[sweep]'"
        ) from None
    return pyarrow


def read_plan(out: Path) -> SweepPlan | None:
    """Return the plan of a folder of rows; None without one.

    Raises:
        SweepError: if it can't be read.
    """
    path = out / PLAN
    try:
        return msgspec.json.decode(path.read_bytes(), type=SweepPlan)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.MsgspecError) as error:
        raise SweepError(
            f"{path}: is not a plan of a sweep ({error}); choose another --out"
        ) from None


def begin(out: Path, plan: SweepPlan) -> None:
    """Reserve a folder for a plan: an empty one, or one with the same plan.

    Raises:
        SweepError: if it has another plan, or files that are not part of a sweep.
        OSError: if it can't be written.
    """
    before = read_plan(out)
    if before is None:
        if (out / ROWS).is_dir() and any((out / ROWS).iterdir()):
            raise SweepError(f"{out}: it has rows and no {PLAN}; choose another --out")
        (out / ROWS).mkdir(parents=True, exist_ok=True)
        write_whole(out / PLAN, encoded(plan, indent=1))
        return
    if difference := _difference(before, plan):
        raise SweepError(
            f"{out}: its rows are of another plan ({difference}); choose another --out,"
            " or remove it"
        )


def _difference(before: SweepPlan, now: SweepPlan) -> str:
    """Return the difference of two plans; empty if they give the same rows."""
    for name in ("options", "folders", "versions"):
        earlier, other = getattr(before, name), getattr(now, name)
        for key in sorted({*earlier, *other}):
            if earlier.get(key) != other.get(key):
                if name == "folders":
                    return f"files of {key} have changed"
                return f"{key}: {earlier.get(key, 'none')}, now {other.get(key, 'none')}"
    if before.cases != now.cases:
        return f"{counted(before.cases, 'case')}, now {now.cases}"
    return ""


class Store:
    """Rows to be written to a folder.

    Args:
        out: folder, reserved by `begin`.
        plan: plan of the rows.
    """

    def __init__(self, out: Path, plan: SweepPlan) -> None:
        self._folder, self._arrow = out / ROWS, arrow()
        self._schema = _schema(self._arrow, plan.constants)
        self._waiting: list[SweepRow] = []
        self._since = time.monotonic()
        for part in self._folder.glob(".part-*"):  # left by a process that was killed while writing
            part.unlink()
        numbers = [int(path.stem.partition("-")[2]) for path in parts(out)]
        self._next = max(numbers, default=-1) + 1

    def add(self, rows: Sequence[SweepRow]) -> None:
        """Add rows, and write a part if enough are waiting."""
        self._waiting += rows
        is_due = time.monotonic() - self._since > SECONDS
        if len(self._waiting) >= PART or (is_due and self._waiting):
            self.close()

    def close(self) -> None:
        """Write the waiting rows."""
        if self._waiting:
            table = self._arrow.Table.from_pylist(
                [_flat(row) for row in self._waiting], schema=self._schema
            )
            path = self._folder / f"part-{self._next:06d}.parquet"
            temporary = self._folder / f".{path.name}"
            self._arrow.parquet.write_table(table, temporary, compression="zstd")
            with temporary.open("rb") as file:
                os.fsync(file.fileno())
            os.replace(temporary, path)
            self._next += 1
            self._waiting.clear()
        self._since = time.monotonic()


def parts(out: Path) -> list[Path]:
    """Return the files of rows, in the order of writing."""
    return sorted((out / ROWS).glob("part-*.parquet"))


class RowsError(SweepError):
    """An error about rows that no sweep wrote; names the file and the row."""

    def __init__(self, path: Path, why: str, row: int | None = None) -> None:
        place = str(path) if row is None else f"{path}: row {row}"
        super().__init__(f"{place}: {why}; remove the file to run its cases again")


def done(out: Path) -> bytearray:
    """Return one byte per case, 1 if its row exists.

    Raises:
        RowsError: if rows are damaged.
    """
    plan = plan_of(out)
    done_cases = bytearray(plan.cases)
    for row in read_rows(out):
        done_cases[row.index] = 1
    return done_cases


def read_rows(out: Path) -> Iterator[SweepRow]:
    """Yield every row, with one part in memory at a time.

    Raises:
        SweepError: without a plan.
        RowsError: for damaged rows: a wrong shape, a case outside the plan, a duplicate, or an
            outcome that contradicts the row's numbers.
    """
    plan = plan_of(out)
    seen = bytearray(plan.cases)
    for path in parts(out):
        for number, flat in enumerate(_flat_rows(path), start=1):
            try:
                row = _row(flat)
            except (ValueError, TypeError) as error:  # includes msgspec's errors
                raise RowsError(path, " ".join(str(error).split()), number) from None
            if why := _damage(row, flat.keys(), plan, seen):
                raise RowsError(path, why, number)
            seen[row.index] = 1
            yield row


def plan_of(out: Path) -> SweepPlan:
    """Return the plan of a folder of rows.

    Raises:
        SweepError: if it is missing or can't be read.
    """
    plan = read_plan(out)
    if plan is None:
        raise SweepError(f"{out}: there is no {PLAN} of a sweep in it")
    return plan


def _damage(row: SweepRow, columns: Set[str], plan: SweepPlan, seen: bytearray) -> str:
    """Return the evidence that no sweep wrote a row; empty for a valid row.

    Constants of other systems have a column without a value.
    """
    if not 0 <= row.index < plan.cases:
        return f"`index` is {row.index}, where the plan has the cases 0 to {plan.cases - 1}"
    if seen[row.index]:
        return f"case {row.index} has a row already"
    planned = {COLUMN + name for name in plan.constants}
    if {name for name in columns if name.startswith(COLUMN)} != planned:
        return f"it has not the constants of the plan ({', '.join(plan.constants) or 'none'})"
    for name in ("discrepancy", "uncertainty", "digits", "global_error", "order", *_SECONDS):
        value = getattr(row, name)
        if value is not None and not math.isfinite(value):
            return f"`{name}` is {value}"
    requested = float(plan.options["resolution"])
    resolution = requested if row.resolution is None else row.resolution
    return contradiction(row.outcome, row.discrepancy, row.uncertainty, resolution)


_SECONDS = ("engine_seconds", "reference_seconds", "loading_seconds", "seconds")


def _flat_rows(path: Path) -> list[dict[str, Any]]:
    pyarrow = arrow()
    try:
        # `read_table` closes the file later, in a thread of its own.
        with pyarrow.parquet.ParquetFile(path) as file:
            rows: list[dict[str, Any]] = file.read().to_pylist()
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise RowsError(path, f"can't be read ({' '.join(str(error).split())})") from None
    return rows


def _schema(pyarrow: Any, constants: Sequence[str]) -> Any:
    columns: list[tuple[str, str]] = []
    for column in msgspec.structs.fields(SweepRow):
        if column.name == "constants":
            columns += [(COLUMN + name, "float64") for name in constants]
        else:
            columns.append((column.name, _TYPES.get(column.type, "string")))
    return pyarrow.schema([(name, pyarrow.type_for_alias(kind)) for name, kind in columns])


def _flat(row: SweepRow) -> dict[str, Any]:
    values = {name: getattr(row, name) for name in row.__struct_fields__ if name != "constants"}
    values["outcome"] = row.outcome.value
    return values | {COLUMN + name: value for name, value in row.constants.items()}


def _row(flat: dict[str, Any]) -> SweepRow:
    constants = {
        name.removeprefix(COLUMN): value
        for name, value in flat.items()
        if name.startswith(COLUMN) and value is not None
    }
    values = {name: value for name, value in flat.items() if not name.startswith(COLUMN)}
    return msgspec.convert({**values, "constants": constants}, SweepRow)


@contextlib.contextmanager
def locked_rows(out: Path) -> Iterator[None]:
    """Lock a folder against other sweeps within this context.

    Raises:
        SweepError: if another sweep has locked it.
    """
    try:
        with locked(out, "sweep"):
            yield
    except ResultsError as error:
        raise SweepError(str(error)) from None
