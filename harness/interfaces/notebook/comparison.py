"""`compare`: the comparison of two models of one mechanism, as an object."""

import datetime
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from io import StringIO
from pathlib import Path
from typing import Any

import msgspec

from physics_crosscheck.harness.commands.compare.candidate import (
    CompareError,
    FailureError,
    candidates,
)
from physics_crosscheck.harness.commands.compare.compare import CompareOptions, failed_comparison
from physics_crosscheck.harness.commands.compare.compare import compare as compared
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.jobs.environment import without_main
from physics_crosscheck.harness.jobs.limits import MEMORY, SECONDS
from physics_crosscheck.harness.jobs.workers import Workers
from physics_crosscheck.harness.modelfiles.choice import named_model
from physics_crosscheck.harness.planning.options import check_limits, check_resolution, check_text
from physics_crosscheck.harness.records import comparison
from physics_crosscheck.harness.records.base import Number, SourceLine
from physics_crosscheck.harness.render.terminal.comparison import print_comparison
from physics_crosscheck.harness.results.causes import own_file_sentence
from physics_crosscheck.harness.results.places import shown_path
from .markup import badge, block, line, paper, shown, table
from .motions import is_number
from .optional import frame
from .subject import Name

_OPTION = re.compile(r"--([a-z][a-z-]*)")


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A difference between two models.

    Attributes:
        source: "file" for a property in the files, "term" for a measured term of the equations,
            "line" for a changed line in files of one format.
        kind: such as `mass` or `inertia`; of a line, the literal or the setting.
        about: name of the link, joint or frame; empty without one.
        message: one sentence.
        a, b: values in A and B, as numbers or text; None without a single value.
        where_a, where_b: lines; None if unknown.
        moves: True if motions depend on it.
        share: share of the discrepancy that it explains alone; None if unknown.
    """

    source: str
    kind: str
    about: str
    message: str
    a: float | str | None
    b: float | str | None
    where_a: SourceLine | None
    where_b: SourceLine | None
    moves: bool
    share: Number


class Comparison(comparison.ComparisonResult, frozen=True, kw_only=True):
    """Result of a comparison, as `crosscheck compare --json` writes it; true if models agree."""

    @property
    def agree(self) -> bool:
        """True if both models move alike; a failed run counts as a difference.

        With `strict=True`, differences that no run shows count too.
        """
        return self.passes

    def __bool__(self) -> bool:
        return self.agree

    @property
    def differences(self) -> tuple[Difference, ...]:
        """All differences: those in the files first, the largest first in each group."""
        return tuple(self._differences())

    def _differences(self) -> Iterator[Difference]:
        comparison_found = self.compared
        if comparison_found is None:
            return
        for row in comparison_found.properties:
            yield Difference(
                source="file", kind=row.kind, about=row.about, message=row.message,
                a=row.a, b=row.b, where_a=row.where_a, where_b=row.where_b, moves=row.moves,
                share=None,
            )  # fmt: skip
        for term in comparison_found.terms:
            yield Difference(
                source="term", kind=term.kind, about=", ".join(term.joints), message=term.message,
                a=term.a, b=term.b, where_a=None, where_b=None, moves=True, share=term.effect,
            )  # fmt: skip
        for tried in comparison_found.differences:
            if len(tried.edits) != 1:
                continue
            (edit,) = tried.edits
            edit_text = f"{edit.what}: {edit.a} -> {edit.b}"
            yield Difference(
                source="line", kind=edit.what, about="", message=edit_text,
                a=edit.a, b=edit.b, where_a=edit.where_a, where_b=edit.where_b,
                moves=bool(tried.moved), share=tried.explained,
            )  # fmt: skip

    def to_frame(self, library: str = "") -> Any:
        """Return a table with one row per difference and the fields of `Difference` as columns.

        Lines are `file:line`, or empty if unknown.

        Args:
            library: "pandas" or "polars"; empty: the first that is installed.

        Raises:
            ImportError: if none is installed; the message names what to install.
        """
        rows = self.differences
        text = ("source", "kind", "about", "message", "a", "b", "where_a", "where_b")
        columns: dict[str, list[object]] = {
            name: [_text(getattr(one, name)) for one in rows] for name in text
        }
        columns["moves"] = [one.moves for one in rows]
        columns["share"] = [float("nan") if one.share is None else one.share for one in rows]
        return frame(columns, library)

    def __str__(self) -> str:
        text = StringIO()
        print_comparison(paper(text, 160), self)
        return text.getvalue().rstrip()

    __repr__ = __str__

    def _repr_html_(self) -> str:
        a, b = (f"{shown_path(one.model)} in {one.engine}" for one in self.models)
        result = self.compared
        remark = "" if result is None else (
            f" discrepancy {shown(result.discrepancy, '{:.1e}')}, uncertainty"
            f" {shown(result.uncertainty, '{:.1e}')}, on {escape(result.component)}"
        )  # fmt: skip
        heads = ["what", "A", "B", "line in A", "line in B"]
        rows = [_cells(one) for one in self.differences]
        notes = () if result is None else (*result.notes, *result.map)
        return block(
            line(f"A  {a}"),
            line(f"B  {b}"),
            f'<div style="margin:6px 0">{badge(self.outcome)}{remark}</div>',
            line(self.reason) if self.reason else "",
            *map(line, _besides(result)),
            *(line(text) for model in self.models if (text := own_file_sentence(model))),
            table(heads, rows, text_columns=5) if rows else "",
            *(line(note, faint=True) for note in notes),
        )


def _besides(compared_models: comparison.Compared | None) -> Iterator[str]:
    """Yield remarks beyond the table: joints with opposite axes, inertias without a body."""
    if compared_models is None:
        return
    for name in compared_models.turned:
        remaining = shown(compared_models.left_when_turned, "{:.1e}")
        yield (
            f"{name} turns the other way in B (mapped so, {remaining} is left): turn its axis, or"
            f' map it with joints={{"{name}": "-..."}}'
        )
    yield from compared_models.impossible


def _cells(difference: Difference) -> list[str]:
    where = (difference.where_a, difference.where_b)
    no_effect = "" if difference.moves else " (moves nothing here)"
    what = difference.kind if difference.source == "line" else difference.message
    values = (_short(difference.a), _short(difference.b))
    return [escape(f"{what}{no_effect}"), *map(escape, values), *(escape(_name(w)) for w in where)]


def _text(value: float | str | SourceLine | None) -> str:
    return "" if value is None else str(value)


def _short(value: float | str | None) -> str:
    return f"{value:.8g}" if isinstance(value, float) else _text(value)


def _name(where: SourceLine | None) -> str:
    """Return a line with the file's name only; its path is in the header."""
    return "" if where is None else Path(str(where)).name


def compare(
    a: Name,
    b: Name,
    *,
    engine: str | None = None,
    engine_a: str | None = None,
    engine_b: str | None = None,
    joints: Mapping[str, str] | None = None,
    starts: Sequence[Mapping[str, float]] = (),
    resolution: float = 1e-9,
    include_constraints: bool = False,
    floating: bool | None = None,
    strict: bool = False,
    limit: float = SECONDS,
    memory: float = MEMORY,
) -> Comparison:
    """Compare two model files without equations, as `crosscheck compare` does.

    Args:
        a: model file, also of a built-in system, such as `"simple_pendulum/robot.urdf"`.
        b: the other model file.
        engine: engine of both; None: the first installed engine that reads each file.
        engine_a: engine of A.
        engine_b: engine of B.
        joints: joints of B by joints of A, such as `{"hip": "j1", "knee": "-j2"}`; None: match
            by name, order or place.
        starts: start states, such as `{"hip": 1.0, "hip_dot": 0}`; none: random states.
        resolution: smallest relative discrepancy to detect.
        include_constraints: True keeps contacts, joint limits, dry friction and couplings.
        floating: True lets the root links of URDFs without a sidecar move freely. Next to an MJCF
            with a free root, a URDF's root is free too.
        strict: True makes `agree` false if the files differ in something that no run shows. It is
            listed in `found.untested`.
        limit: processor seconds per task.
        memory: GiB per worker.

    Returns:
        The comparison; its outcome is FAILED, with the reason, if an engine failed.

    Raises:
        CompareError: if a file is missing, an engine does not read it, or joints have no partner;
            the message gives the remedy.
        NotInstalledError: if no suitable engine is installed.
        SidecarError: if a sidecar cannot be read.
        TypeError: if an argument has the wrong type.
        ValueError: if a number is out of bounds.
    """
    for key, file in {"a": a, "b": b}.items():
        check_text(file, key, path=True)
    for key, value in {"engine": engine, "engine_a": engine_a, "engine_b": engine_b}.items():
        if value is not None:
            check_text(value, key)
    _check_joints(joints)
    _check_starts(starts)
    resolution = check_resolution(resolution)
    created = datetime.datetime.now(datetime.UTC)
    limits = check_limits(limit, memory, "compare's ")
    try:
        requested = engine_a or engine, engine_b or engine
        model_a, model_b = candidates((_path(a), _path(b)), requested, floating=floating)
        options = CompareOptions(
            a=model_a,
            b=model_b,
            joints=(dict(joints or {}), {}),
            starts=tuple({key: float(q) for key, q in value.items()} for value in starts),
            resolution=resolution,
            include_constraints=include_constraints,
            strict=strict,
        )
        with without_main(), Workers(1, limits) as workers:
            record = compared(options, workers, created)
    except CompareError as error:
        raise CompareError(_as_argument(str(error))) from None
    except FailureError as error:
        record = failed_comparison(options, error.failure, created)
    return Comparison(**msgspec.structs.asdict(record))


def _check_joints(joints: object) -> None:
    pairs = {} if joints is None else joints
    if not isinstance(pairs, Mapping) or not all(
        isinstance(one, str) for pair in pairs.items() for one in pair
    ):
        raise TypeError(
            f"joints is {quote(joints)}, expected joints of A by those of B, such as"
            ' {"hip": "j1", "knee": "-j2"}'
        )


def _check_starts(starts: object) -> None:
    if not isinstance(starts, Sequence) or not all(isinstance(one, Mapping) for one in starts):
        raise TypeError(
            f"starts is {quote(starts)}, expected a list of states, such as"
            ' [{"hip": 1.0, "hip_dot": 0.0}]'
        )
    for start in starts:
        for name, value in start.items():
            if not is_number(value) or not math.isfinite(value):
                raise CompareError(f"{name} starts at {value!r}, expected a finite number")


def _path(name: Name) -> Path:
    """Return the path of a file, or of a file of a built-in system."""
    path = Path(name)
    built_in = None if path.exists() else named_model(str(name))
    return path if built_in is None else built_in.folder / built_in.model


def _as_argument(text: str) -> str:
    """Replace a command-line option in a message by the Python argument."""
    return _OPTION.sub(lambda found: f"{found[1].replace('-', '_')}=", text)
