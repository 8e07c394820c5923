"""A folder of rows: Parquet files written whole, one every so often, and the plan beside them.

A Parquet file can't be appended to, so rows come in parts, each written beside its place and
renamed: what is in the folder is always whole. Every reader of Parquet data sets reads the folder
`rows` as one table.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from harness.records.hold import hold
from harness.records.outcome import Outcome
from harness.records.sweep import SweepPlan, SweepRow
from harness.records.write import encoded, write_whole
from harness.sweep.factors import SweepError

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
        raise SweepError(f"{path}: is no plan of a sweep ({error}); choose another --out") from None


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
        return f"{before.cases} cases, now {now.cases}"
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


def done(out: Path, cases: int) -> bytearray:
    """A byte a case, 1 where its row is there.

    Raises:
        SweepError: for a part that can't be read.
    """
    found = bytearray(cases)
    for table in _tables(out, ["index"]):
        for index in table.column("index").to_pylist():
            found[index] = 1
    return found


def read_rows(out: Path) -> Iterator[SweepRow]:
    """Every row, a part of them in memory at a time.

    Raises:
        SweepError: for a part that can't be read.
    """
    for table in _tables(out, None):
        for flat in table.to_pylist():
            yield _row(flat)


def _tables(out: Path, columns: list[str] | None) -> Iterator[Any]:
    known = arrow()
    for path in parts(out):
        try:
            yield known.parquet.read_table(path, columns=columns)
        except (OSError, known.ArrowException) as error:
            said = " ".join(str(error).split())
            remedy = "remove it to run its cases again"
            raise SweepError(f"{path}: can't be read ({said}); {remedy}") from None


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
    values["outcome"] = Outcome(values["outcome"])
    return SweepRow(**values, constants=constants)


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
