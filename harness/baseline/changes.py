"""What became of a case since it was accepted, and why: one case at a time, numbers alone.

Limits are compared on the accepted track, within the uncertainties of both: the model's motion and
the equations' motion from the same states under the same inputs. So a model that moved, equations
that moved, and both, are told apart; and what the step costs is a matter of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

EQUATIONS = 1e-11
"""Relative movement of a segment's end, by the equations, that is none: ten times what the two
integrations of a reference may be apart."""

ROUNDING = 1e-15
RAW = 0.01
"""Relative change of a raw error that is told. A raw error e is a leading term, known to a share e
of itself; so the larger of the two counts."""

ORDER = 0.5
"""An order is another one from here on: halfway to the next."""

Record = Mapping[str, Any]
Rows = Sequence[Sequence[float | None]]


class Status(StrEnum):
    """What the gate says of a case; the value is what a person reads. Worst first."""

    NOT_RUN = "could not run"
    CHANGED = "changed"
    GONE = "gone"
    NEW = "new"
    IMPROVED = "improved"
    WITHIN = "no change in motion"
    KNOWN = "known difference"
    SAME = "as accepted"

    @property
    def passes(self) -> bool:
        """Whether the gate lets it through."""
        return self not in (Status.NOT_RUN, Status.CHANGED, Status.GONE, Status.NEW)


@dataclass(frozen=True)
class Change:
    """A case against what was accepted of it.

    Attributes:
        system, key: the system, and the case's name within it.
        status: see `Status`.
        kinds: what changed: `model`, `numbers`, `engine`, `equations`, `scenario`, `tool`, `text`
            (files alone), `outcome`, `unexplained`.
        told: sentences, the most telling first.
        size: how far a limit moved at most, relative to its movement over a segment; 0 otherwise.
        record: the case's record of this run, where there is one.
        entry: what was accepted, where there is something.
        files: hashes of what the case depends on now.
        engine: the engine that ran it, with its version.
    """

    system: str
    key: str
    status: Status
    kinds: tuple[str, ...]
    told: tuple[str, ...]
    size: float = 0.0
    record: Record | None = field(default=None, repr=False)
    entry: Record | None = field(default=None, repr=False)
    files: Mapping[str, str] = field(default_factory=dict, repr=False)
    engine: str = ""

    @property
    def case(self) -> str:
        """The case's id, as in tables and on the command line."""
        return f"{self.system}/{self.key}"


@dataclass(frozen=True)
class Moved:
    """How far segments' ends are apart, beyond the uncertainties; all zero where they are not."""

    size: float = 0.0
    uncertainty: float = 0.0
    component: str = ""
    time: float = 0.0

    def __bool__(self) -> bool:
        return self.size > 0.0


@dataclass(frozen=True)
class Now:
    """A case as it is: its record with `measured`, its files, and the label of its engine."""

    record: Record
    files: Mapping[str, str]
    engine: str
    resolution: float
    numerics: int


def compare(system: str, key: str, entry: Record, track: Record, now: Now) -> Change:
    """Say what became of a case that was run and measured, and why."""
    record, measured = now.record, now.record["measured"]
    kinds: list[str] = []
    told: list[str] = []
    causes = _causes(entry, now)
    then = measured["then"]
    was, outcome = entry["outcome"], record["outcome"]
    moved = Moved()
    equations = Moved()
    worse = better = False
    if then is None:
        worse = True
        kinds.append("equations")
        told.append("the system has other coordinates or inputs; nothing can be compared")
    else:
        moved = _moved(entry["end"], entry["end_uncertainty"], then, track)
        nothing = [[EQUATIONS * s for s in track["scale"]]] * len(track["end"])
        by_equations = {"end": then["equations"], "uncertainty": nothing}
        equations = _moved(track["end"], nothing, by_equations, track)
    if moved:
        kinds += _blamed(causes)
        better = was != "AGREES" and outcome == "AGREES" and not equations
        worse = not better
        told.append(f"the model's motion moved by {_apart(moved)}")
    if equations:
        worse = True
        kinds.append("equations")
        told.append(f"the equations' motion moved by {equations.size:.1e} of {equations.component}")
        if moved and outcome == "AGREES":
            told.append("model and equations changed alike: they agree")
    elif then is not None and "tool" not in causes:
        scenario = _scenario(track, measured["track"])
        if scenario:
            worse = True
            kinds.append("scenario")
            told += scenario
    settled = not (moved or equations or then is None)
    if outcome != was:
        told.insert(0, f"{outcome} where it was {was}")
        if settled:
            kinds += _blamed(causes) if "numbers" not in _numbers_kind(entry, record) else []
            kinds = kinds or ["outcome"]
            better, worse = (True, worse) if outcome == "AGREES" else (better, True)
    elif settled and outcome != "AGREES" and _discrepancy_moved(entry, record):
        worse = True
        kinds += _blamed(causes)
        told.append(f"the discrepancy is {_known_to(record)} where {_known_to(entry)} was accepted")
    worse_numbers, better_numbers, sentences = _numbers(entry, record, settled)
    if sentences:
        kinds.append("numbers")
        told += sentences
        worse, better = worse or worse_numbers, better or better_numbers
    told += _constants(entry["constants"], measured["constants"])
    told += [sentence for cause, sentence in causes.items() if cause in ("engine", "tool")]
    status = (
        Status.CHANGED
        if worse
        else Status.IMPROVED
        if better
        else Status.KNOWN
        if was != "AGREES"
        else Status.WITHIN
        if causes
        else Status.SAME
    )
    if status in (Status.WITHIN, Status.KNOWN) and not kinds:
        kinds = [cause if cause in ("engine", "tool") else "text" for cause in causes]
    return Change(
        system,
        key,
        status,
        tuple(dict.fromkeys(kinds)),
        tuple(told),
        max(moved.size, equations.size),
        record,
        entry,
        now.files,
        now.engine,
    )


def is_known(entry: Record, track: Record, record: Record) -> str:
    """Why a case that does not agree is not the difference that was accepted; "" where it is."""
    then = record["measured"].get("then")
    if record["outcome"] != entry["outcome"]:
        return f"it is {record['outcome']} where {entry['outcome']} was accepted"
    if then is None:
        failed: str = record["measured"].get("failed", "the system has other coordinates or inputs")
        return failed
    moved = _moved(entry["end"], entry["end_uncertainty"], then, track)
    if moved:
        return f"the model's motion moved by {_apart(moved)}"
    nothing = [[EQUATIONS * s for s in track["scale"]]] * len(track["end"])
    by_equations = {"end": then["equations"], "uncertainty": nothing}
    if _moved(track["end"], nothing, by_equations, track):
        return "the equations' motion moved"
    if _discrepancy_moved(entry, record):
        return f"its discrepancy was {_known_to(entry)}"
    return ""


def _causes(entry: Record, now: Now) -> dict[str, str]:
    """What differs of all that the case depends on: kind -> sentence."""
    names = sorted({*entry["files"], *now.files})
    changed = [name for name in names if entry["files"].get(name) != now.files.get(name)]
    causes = {}
    models = [name for name in changed if name != "system.py"]
    if models:
        causes["model"] = f"changed: {', '.join(models)}"
    if "system.py" in changed:
        causes["declaration"] = "changed: system.py"
    if entry["engine"] != now.engine:
        causes["engine"] = f"another engine: {now.engine} where it was {entry['engine']}"
    if entry["numerics"] != now.numerics:
        causes["tool"] = (
            f"crosscheck's own numerics are version {now.numerics} where they were"
            f" {entry['numerics']}"
        )
    if entry["resolution"] != now.resolution:
        causes["resolution"] = f"resolution {now.resolution:g} where it was {entry['resolution']:g}"
    return causes


def _blamed(causes: Mapping[str, str]) -> list[str]:
    """What may have moved a limit, of all that changed."""
    if not causes:
        return ["unexplained"]
    blamed = [kind for kind in ("model", "engine", "tool") if kind in causes]
    # The declaration alone can move a model's motion by what it calls its coordinates.
    return blamed or ["equations" if "declaration" in causes else "numbers"]


def _moved(end: Rows, uncertainty: Rows, now: Record, track: Record) -> Moved:
    """The largest movement of an end that exceeds both uncertainties, relative to its scale."""
    worst = Moved()
    for k, (row, bound) in enumerate(zip(end, uncertainty, strict=True)):
        columns = zip(row, bound, now["end"][k], now["uncertainty"][k], strict=True)
        for c, (a, ua, b, ub) in enumerate(columns):
            if a is None or b is None or ua is None or ub is None:
                continue
            allowed = ua + ub + ROUNDING * (abs(a) + abs(b))
            size = abs(b - a) / track["scale"][c]
            if abs(b - a) > allowed and size > worst.size:
                worst = Moved(
                    size, allowed / track["scale"][c], track["components"][c], track["t"][k]
                )
    return worst


def _apart(moved: Moved) -> str:
    return (
        f"{moved.size:.1e} ± {moved.uncertainty:.0e} of its movement, in {moved.component} near"
        f" t = {moved.time:.4g} s"
    )


def _scenario(was: Record, now: Record) -> list[str]:
    """How the scenario is another one, where the present track is not the accepted one."""
    if was == now:
        return []
    told = []
    if was["duration"] != now["duration"]:
        told.append(f"duration {was['duration']:g} s -> {now['duration']:g} s")
    for old, new in zip(was["drive"], now["drive"], strict=False):
        if old != new:
            told.append(f"input {old} -> {new}")
    if was["components"] != now["components"]:
        told.append(
            f"components are called {', '.join(now['components'])}, not"
            f" {', '.join(was['components'])}"
        )
    told = told or ["its start, or what the system's other scenarios move, is another"]
    return [f"the scenario is another: {'; '.join(told)}"]


def _discrepancy_moved(entry: Record, record: Record) -> bool:
    values = [entry["discrepancy"], record["discrepancy"]]
    bounds = [entry["uncertainty"], record["uncertainty"]]
    if any(value is None for value in (*values, *bounds)):
        # No digit is claimed of a case whose uncertainty is infinite, before and after alike.
        return [value is None for value in bounds] not in ([True, True], [False, False])
    return bool(abs(values[0] - values[1]) > sum(bounds) + ROUNDING)


def _known_to(record: Record) -> str:
    """A discrepancy with its uncertainty, either of which may have no finite value."""
    size, bound = record["discrepancy"], record["uncertainty"]
    return " ± ".join("unknown" if x is None else f"{x:.3e}" for x in (size, bound))


def _numbers_kind(entry: Record, record: Record) -> list[str]:
    names = ("shipped_step", "integrator", "claimed_order")
    return ["numbers"] if any(entry[name] != record[name] for name in names) else []


def _numbers(entry: Record, record: Record, settled: bool) -> tuple[bool, bool, list[str]]:
    """What the step costs: (worse, better, sentences); judged where the limit is the same."""
    told = []
    if entry["shipped_step"] != record["shipped_step"]:
        told.append(f"step {entry['shipped_step']:g} s -> {record['shipped_step']:g} s")
    if entry["integrator"] != record["integrator"]:
        told.append(f"integrator {entry['integrator']} -> {record['integrator']}")
    worse = better = False
    was, now = entry["raw_error"], record["raw_error"]
    if was is not None and now is not None:
        tolerance = max(RAW, min(1.0, was)) * was + 1e-12
        if abs(now - was) > tolerance and (settled or told):
            told.append(f"raw error {_percent(was)} -> {_percent(now)}")
            worse, better = now > was, now < was
    elif was != now:
        told.append("the raw error is not finite" if now is None else "the raw error is finite now")
        worse, better = now is None, was is None
    for name, what in (("claimed_order", "claimed order"), ("order", "order on the segments")):
        was, now = entry[name], record[name]
        if was is None or now is None:
            continue
        if abs(now - was) > ORDER:
            told.append(f"{what} {was:.2g} -> {now:.2g}")
            # A higher order at a higher error is no improvement, nor the other way round.
            worse = worse or (now < was and not better)
            better = better or (now > was and not worse)
    if not settled:
        worse = better = False
    return worse, better and not worse, told


def _percent(value: float) -> str:
    return f"{value * 100:.3g} %"


def _constants(was: Record, now: Record) -> list[str]:
    """Constants that the motion identifies, then and now, where they moved."""
    told = []
    for name, (new, error) in now.items():
        if name not in was:
            continue
        old, before = was[name]
        if abs(new - old) > 3 * (error + before) + 1e-12 * abs(old):
            digits = 2 - math.floor(math.log10(max(error, 1e-300) / max(abs(new), 1e-300)))
            digits = min(max(digits, 3), 10)
            told.append(f"the motion says {name} {old:.{digits}g} -> {new:.{digits}g}")
    return told
