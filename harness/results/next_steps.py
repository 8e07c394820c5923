"""Proposed changes of files, and the command that checks them."""

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.engines.urdf_copy import NO_INERTIAL
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results
from .places import lines_listed, shown_line

DEFAULT_OUT = Path("reports")


@dataclass(frozen=True, kw_only=True)
class ProposedChange:
    """A proposed change of a number in a file, or of its copies.

    Attributes:
        subject: address of the number or of its copies.
        locations: locations of the copies, with paths relative to the working folder.
        old: current number.
        new: text to write at each location.
    """

    subject: tuple[str, ...]
    locations: tuple[SourceLine, ...]
    old: float
    new: str

    @property
    def places(self) -> str:
        """Different lines of its locations."""
        return ", ".join(dict.fromkeys(map(str, self.locations)))

    def __str__(self) -> str:
        return f"{self.places} from {self.old:.10g} to {self.new}"


def run_again(results: Results, out: Path) -> str:
    """Return the command that checks a change; empty if everything passes."""
    if not results.failed:
        return ""
    there = "" if out == DEFAULT_OUT else f" --out {shlex.quote(str(out))}"
    return f"crosscheck run --last-failed{there}"


def changes_of(model: Model) -> list[ProposedChange]:
    """Return the changes of numbers in files that explain a model's motions, if any."""
    if model.diagnosis is None or not model.diagnosis.explained:
        return []
    return [
        ProposedChange(
            subject=cause.subject,
            locations=tuple(shown_line(model.folder, one) for one in cause.locations),
            old=cause.nominal,
            new=cause.replacement,
        )
        for cause in model.diagnosis.explanations[0].causes
        if cause.replacement and cause.locations and cause.nominal is not None
    ]


def stated_changes(
    model: Model, findings: Iterable[AuditFinding] | None = None
) -> list[ProposedChange]:
    """Return changes of numbers that differ from their bindings, found without motion.

    Args:
        model: record of the model.
        findings: findings to use; None: all findings of the model.
    """
    return [
        ProposedChange(
            subject=one.subject,
            locations=(shown_line(model.folder, one.location),),
            old=one.actual,
            new=one.replacement,
        )
        for one in (model.findings if findings is None else findings)
        if one.replacement and one.location is not None and one.actual is not None
    ]


DROPS_MASSLESS = "drops the inertia of massless links"

_MASSLESS = "massless"


def massless_links(cause: Cause, model: Model) -> list[AuditFinding]:
    """Return the findings about links without mass whose inertia an engine drops."""
    if cause.kind != "dropped":
        return []
    massless = [one for one in model.findings if _MASSLESS in one.subject[1:]]
    named = [
        one for one in massless if any(f"[{one.subject[0]}]" in each for each in cause.subject)
    ]
    return named or massless


def massless_places(massless: Iterable[AuditFinding], model: Model) -> str:
    """Return the lines and names of links without mass."""
    return lines_listed([(one.location, one.subject[0]) for one in massless], model.folder)


def advice_of(model: Model, causes: Iterable[Cause]) -> list[str]:
    """Return what to do about causes other than single numbers, each an imperative."""
    advice = []
    for cause in causes:
        if massless := massless_links(cause, model):
            what = "the link a mass" if len(massless) == 1 else "each link a mass"
            whose = "its inertia" if len(massless) == 1 else "their inertia"
            advice.append(f"give {what}, or remove {whose}")
        elif cause.kind == "default" and any(NO_INERTIAL in one for one in cause.subject):
            out = f"leave {model.engine} out where it is not used"
            how = "--engine, or engines under [tool.crosscheck] in pyproject.toml"
            advice.append(f"give each link an <inertial>, or {out}: {how}")
        elif cause.kind == "axis":
            advice.append(f"reverse the axis of {', '.join(cause.subject)}")
        elif cause.kind == "exchange":
            advice.append(f"exchange {' and '.join(cause.subject)}")
    return advice
