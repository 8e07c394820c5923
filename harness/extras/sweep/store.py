"""A folder of rows: Parquet files written whole, one every so often, and the plan beside them.

A Parquet file can't be appended to, so rows come in parts, each written beside its place and
renamed: what is in the folder is always whole. Every reader of Parquet data sets reads the folder
`rows` as one table.
"""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from physics_crosscheck.harness.extras.sweep.factors import SweepError
from physics_crosscheck.harness.records.hold import hold
from physics_crosscheck.harness.records.outcome import contradiction
from physics_crosscheck.harness.records.sweep import SweepPlan, SweepRow
from physics_crosscheck.harness.records.write import encoded, write_whole
from physics_crosscheck.harness.results.status import counted

ROWS = "rows"
PLAN = "plan.json"

PART = 500
"""Rows of a part, at most."""

SECONDS = 20.0
"""After which a part is written however few rows it has: that much is done again at worst."""

COLUMN = "constant_"
"""What the columns of varied constants begin with: `constant_k`."""

_TEXT = ("system", "model", "engine", "scenario", "integrator", "outcome", "reason", "command")
_WHOLE = ("index", "draw", "steps")


def arrow() -> Any:
    """pyarrow, or what to do about it.

    Raises:
        SweepError: where it is not installed.
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
    """The plan of a folder of rows; None where there is none.

    Raises:
        SweepError: where it can't be read.
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
    """Take a folder for a plan: an empty one, or one that has the same.

    Raises:
        SweepError: where it has another plan, or files that are none of a sweep's.
        OSError: where it can't be written.
    """
    before = read_plan(out)
    if before is None:
        if (out / ROWS).is_dir() and any((out / ROWS).iterdir()):
            raise SweepError(f"{out}: it has rows and no {PLAN}; choose another --out")
        (out / ROWS).mkdir(parents=True, exist_ok=True)
        write_whole(out / PLAN, encoded(plan, indent=1))
        return
    if told := _difference(before, plan):
        raise SweepError(
            f"{out}: its rows are of another plan ({told}); choose another --out, or remove it"
        )


def _difference(before: SweepPlan, now: SweepPlan) -> str:
    """What tells two plans apart; empty where they are equal in all that rows follow from."""
    for name in ("options", "folders", "versions"):
        one, other = getattr(before, name), getattr(now, name)
        for key in sorted({*one, *other}):
            if one.get(key) != other.get(key):
                if name == "folders":
                    return f"files of {key} have changed"
                return f"{key}: {one.get(key, 'none')}, now {other.get(key, 'none')}"
    if before.cases != now.cases:
        return f"{counted(before.cases, 'case')}, now {now.cases}"
    return ""


class Store:
    """Rows on their way into a folder.

    Args:
        out: folder, taken by `begin`.
        plan: of the rows.
    """

    def __init__(self, out: Path, plan: SweepPlan) -> None:
        self._folder, self._arrow = out / ROWS, arrow()
        self._schema = _schema(self._arrow, plan.constants)
        self._waiting: list[SweepRow] = []
        self._since = time.monotonic()
        for left in self._folder.glob(".part-*"):  # of one that was killed as it wrote
            left.unlink()
        numbers = [int(path.stem.partition("-")[2]) for path in parts(out)]
        self._next = max(numbers, default=-1) + 1

    def add(self, rows: Sequence[SweepRow]) -> None:
        """Take rows, and write a part where enough of them wait."""
        self._waiting += rows
        late = time.monotonic() - self._since > SECONDS
        if len(self._waiting) >= PART or (late and self._waiting):
            self.flush()

    def flush(self) -> None:
        """Write what waits."""
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
    """The files of rows, in the order in which they were written."""
    return sorted((out / ROWS).glob("part-*.parquet"))


class RowsError(SweepError):
    """Rows that can't be what a sweep wrote; names the file and the row."""

    def __init__(self, path: Path, why: str, row: int | None = None) -> None:
        place = str(path) if row is None else f"{path}: row {row}"
        super().__init__(f"{place}: {why}; remove the file to run its cases again")


def done(out: Path) -> bytearray:
    """Return a byte a case, 1 where its row is there.

    Raises:
        RowsError: for rows that are damaged.
    """
    plan = plan_of(out)
    found = bytearray(plan.cases)
    for row in read_rows(out):
        found[row.index] = 1
    return found


def read_rows(out: Path) -> Iterator[SweepRow]:
    """Return every row, a part of them in memory at a time.

    Raises:
        SweepError: where there is no plan.
        RowsError: for rows that are damaged: of another shape, of no case of the plan or of one
            that has a row already, or of an outcome that contradicts their own numbers.
    """
    plan = plan_of(out)
    found = bytearray(plan.cases)
    for path in parts(out):
        for number, flat in enumerate(_flat_rows(path), start=1):
            try:
                row = _row(flat)
            except (ValueError, TypeError) as error:  # msgspec's own among these
                raise RowsError(path, " ".join(str(error).split()), number) from None
            if why := _damage(row, plan, found):
                raise RowsError(path, why, number)
            found[row.index] = 1
            yield row


def plan_of(out: Path) -> SweepPlan:
    """Return the plan of a folder of rows.

    Raises:
        SweepError: where there is none, or it can't be read.
    """
    plan = read_plan(out)
    if plan is None:
        raise SweepError(f"{out}: there is no {PLAN} of a sweep in it")
    return plan


def _damage(row: SweepRow, plan: SweepPlan, found: bytearray) -> str:
    """Return what shows that a row is not what a sweep wrote; empty: nothing does."""
    if not 0 <= row.index < plan.cases:
        return f"`index` is {row.index}, where the plan has the cases 0 to {plan.cases - 1}"
    if found[row.index]:
        return f"case {row.index} has a row already"
    if set(row.constants) != set(plan.constants):
        return f"it has not the constants of the plan ({', '.join(plan.constants) or 'none'})"
    for name in ("discrepancy", "uncertainty", "digits", "global_error", "order", *_SECONDS):
        value = getattr(row, name)
        if value is not None and not math.isfinite(value):
            return f"`{name}` is {value}"
    asked = float(plan.options["resolution"])
    at = asked if row.resolution is None else row.resolution
    return contradiction(row.outcome, row.discrepancy, row.uncertainty, at)


_SECONDS = ("engine_seconds", "reference_seconds", "loading_seconds", "seconds")


def _flat_rows(path: Path) -> list[dict[str, Any]]:
    known = arrow()
    try:
        rows: list[dict[str, Any]] = known.parquet.read_table(path).to_pylist()
    except (OSError, ValueError, known.ArrowException) as error:
        raise RowsError(path, f"can't be read ({' '.join(str(error).split())})") from None
    return rows


def _schema(known: Any, constants: Sequence[str]) -> Any:
    fields = []
    for name in SweepRow.__struct_fields__:
        if name == "constants":
            fields += [known.field(COLUMN + one, known.float64()) for one in constants]
        elif name in _TEXT:
            fields.append(known.field(name, known.string()))
        elif name in _WHOLE:
            fields.append(known.field(name, known.int64()))
        else:
            fields.append(known.field(name, known.float64()))
    return known.schema(fields)


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
def taken(out: Path) -> Iterator[None]:
    """Meanwhile no other sweep writes into a folder.

    Raises:
        SweepError: where one does.
    """
    out.mkdir(parents=True, exist_ok=True)
    with (out / ".lock").open("w") as file:
        if not hold(file.fileno()):
            raise SweepError(
                f"{out}: another sweep is writing there; wait for it, or choose another --out"
            )
        yield


@contextlib.contextmanager
def kept(store: Store) -> Iterator[Store]:
    """A store whose last rows are written however the work ends."""
    try:
        yield store
    finally:
        store.flush()
