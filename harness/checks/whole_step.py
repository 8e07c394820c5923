"""Steps of a robot file with all its forces, compared with the law that the engine documents.

The positions of contacts are the engine's, and compared with the file's shapes; all other numbers
are those of the file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace as replace_fields

from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.engines.protocol import (
    ARMATURES,
    EngineError,
    LoadedModel,
    ModelSpec,
    ShapeError,
    WholeModel,
)
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.misread import (
    MisreadNumber,
    ReadingCheck,
    check_reading,
)
from physics_crosscheck.harness.modelfiles.mjcf.read import compiler, law_model, placed_shapes
from physics_crosscheck.harness.modelfiles.readers import read_as_it_runs
from physics_crosscheck.harness.modelfiles.robot import Omission
from physics_crosscheck.harness.modelfiles.urdf.laws import ruled_model
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.judgement import LimitVerdict
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.case import CaseKind, LawTerm, WholeStep
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.scene import ActingState
from physics_crosscheck.harness.results.status import counted, listed
from physics_crosscheck.reference.mechanism.laws import ImpulseRules, Rules, SoftRules
from physics_crosscheck.reference.mechanism.rotations import SpatialInertia
from physics_crosscheck.reference.mechanism.tree import TreeError
from .contacts import TouchingShapes, check_contacts, shapes_of_laws, shapes_of_urdf
from .findings import format_omission
from .law_comparison import Evaluated, LawComparison
from .law_states import KeptSteps
from .prepare import Prepared, PreparedTree
from .scene import acting_state, compiled_inertias, inertia_differences
from .shared_contacts import shared_contacts
from .task import ModelTask
from .verdict import CaseJudgement, decided, motions_in_words


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeStepCheck:
    """The comparison of whole steps.

    Attributes:
        record: for the results.
        judgement: of accelerations and the next state; None if nothing was compared.
        resolution: relative discrepancy that it resolves.
        misread: numbers that the compiler of the file resolves otherwise than its text.
        contacts: those that the engine finds otherwise than the file's shapes touch.
    """

    record: WholeStep
    judgement: LimitVerdict | None = None
    resolution: float = 0.0
    misread: tuple[MisreadNumber, ...] = ()
    contacts: tuple[MisreadNumber, ...] = ()

    @classmethod
    def skipped(cls, uncovered: Iterable[str] = ()) -> WholeStepCheck:
        """Return a check that compared nothing, with the parts of the file that have no law."""
        return cls(record=WholeStep(uncovered=tuple(dict.fromkeys(uncovered))))

    @classmethod
    def compared(
        cls, judged: LimitVerdict, resolution: float, acted: Mapping[str, int], **fields: Any
    ) -> WholeStepCheck:
        """Return a check of drawn states.

        Args:
            judged: discrepancy and uncertainty.
            resolution: relative discrepancy to resolve.
            acted: how often forces of each kind acted.
            fields: further fields of the record.
        """
        record = WholeStep(
            outcome=judged.outcome,
            discrepancy=number(judged.discrepancy),
            uncertainty=number(judged.uncertainty),
            acted=tuple(LawTerm(name=name, count=count) for name, count in acted.items() if count),
            **fields,
        )
        return cls(record=record, judgement=judged, resolution=resolution)

    @property
    def _differs(self) -> bool:
        """Steps differ from the law."""
        return self.judgement is not None and self.judgement.outcome is Outcome.DIFFERS

    @property
    def kind(self) -> CaseKind:
        """Kind of a case that differs by it."""
        if self._differs or not (self.misread or self.contacts):
            return "whole step"
        return "compiled number" if self.misread else "contact"

    @property
    def locations(self) -> tuple[SourceLine, ...]:
        """Lines of misread numbers and of shapes; a law has no single line."""
        faults = (*self.misread, *self.contacts)
        places = dict.fromkeys((one.file, one.line) for one in faults if one.line)
        return tuple(SourceLine(file=str(file), line=line) for file, line in places)

    def combined(self, verdict: CaseJudgement) -> CaseJudgement:
        """Combine the verdict on a motion with this one: a difference in either counts."""
        judged, record = self.judgement, self.record
        if verdict.outcome is Outcome.DIFFERS:
            return replace(verdict, reason=f"{verdict.reason}{self._besides}")
        if self.misread or (self.contacts and not self._differs):
            return self._misread(verdict)
        if judged is None or not self._differs:
            return verdict
        return decided(
            verdict,
            judged,
            by="whole steps",
            kind=self.kind,
            component=record.component,
            reason=(
                f"with limits, friction, contacts and drives, {record.component} is off by"
                f" {judged.discrepancy:.2e} of its largest value at"
                f" {counted(record.states, 'state')}; the uncertainty is"
                f" {judged.uncertainty:.1e}; {motions_in_words(verdict)}"
            ),
            resolution=self.resolution,
        )

    @property
    def _besides(self) -> str:
        """The difference of whole steps beside one of the motion, as the end of a sentence."""
        judged = self.judgement
        if judged is None or not self._differs:
            return ""
        off = f"{self.record.component} is off by {judged.discrepancy:.2e} of its largest value"
        return f"; with limits, friction, contacts and drives, {off}"

    def _misread(self, verdict: CaseJudgement) -> CaseJudgement:
        """Return the verdict of numbers and contacts that the engine has otherwise."""
        faults = (*self.misread, *self.contacts)
        first, unsure = faults[0], np.finfo(float).eps
        off = max(one.discrepancy for one in faults)
        more = f", and {len(faults) - 1} more" if len(faults) > 1 else ""
        return decided(
            verdict,
            LimitVerdict(
                outcome=Outcome.DIFFERS, unresolved_reason=None, segment=0, component=0,
                discrepancy=off, uncertainty=unsure, below_resolution=False,
                largest_discrepancy=off, largest_uncertainty=unsure,
            ),
            by="whole steps",
            kind=self.kind,
            component=first.subject,
            reason=f"{first.file.name}:{first.line}: {first.sentence}{more};"
            f" {motions_in_words(verdict)}",
            resolution=self.resolution,
        )  # fmt: skip


def case_whole_step(
    task: ModelTask[Prepared], model: LoadedModel, _coordinates: CoordinateMap
) -> WholeStepCheck | None:
    """Compare whole steps of a robot file, unless only its smooth forces are asked for."""
    target = task.target
    if not isinstance(target, PreparedTree) or not compares_steps(task):
        return None
    steps = target.steps if task.spec.path == target.place else None
    check = check_whole_step(target.place, task.spec, task.engine, task.resolution, steps)
    if not (misread := tuple(_misread_inertias(target, model, task.resolution))):
        return check
    check = check or WholeStepCheck.skipped()
    sentences = (*check.record.misread, *(one.sentence for one in misread))
    record = replace_fields(check.record, misread=sentences)
    return replace(check, record=record, misread=(*check.misread, *misread))


def compares_steps(task: ModelTask[Any]) -> bool:
    """Return whether whole steps of a robot file are compared: it acts as it is shipped."""
    target, engine = task.target, engines()[task.engine]
    if task.sidecar is not None or target.smooth:
        return False
    usual = {*engine.switches, *engine.settings_for(target.place.suffix)}
    return not set(task.spec.settings) - usual - {"floating", "model", ARMATURES}


PRINCIPAL_AXES = 1e-5
"""Relative difference of tensors that an engine's own principal axes leave."""


def _misread_inertias(
    target: PreparedTree, model: LoadedModel, resolution: float
) -> Iterator[MisreadNumber]:
    """Yield numbers of moving links that the engine holds otherwise: no motion may show them."""
    names = {link: name for name, (link, _) in [*target.tree.frames.items()][::-1]}
    for i, body in compiled_inertias(target.tree, model.inertias).items():
        link, name = target.tree.links[i], names[i]
        stated = SpatialInertia(link.mass, link.center, link.inertia)
        for what, first, other, off in inertia_differences(stated, body):
            if off > (PRINCIPAL_AXES if what.startswith("inertia") else resolution):
                yield MisreadNumber(
                    subject=name,
                    sentence=f"{what} of {name} is {first:.12g} by the file, and {other:.12g} as"
                    " compiled",
                    discrepancy=off,
                    file=target.place,
                    line=target.lines.get(name, 0),
                )


def check_whole_step(
    file: Path, spec: ModelSpec, engine: str, resolution: float, steps: KeptSteps | None = None
) -> WholeStepCheck | None:
    """Compare whole steps of a file; None if the engine has no documented law for it.

    Args:
        file: whose numbers the law takes.
        spec: what the engine loads: the same file, or a changed copy, with its settings.
        engine: name of the engine.
        resolution: relative discrepancy to resolve.
        steps: keeps what other checks need too.
    """
    steps = steps or KeptSteps()
    try:
        # With its shapes for contacts, whose files the smooth forces do not need.
        model = steps.model(engine, spec)
        if model is None:
            return None
        if model.rules is not None:
            return _check_rules(file, spec, model, model.rules, resolution, steps)
        return _check_laws(file, model, resolution, steps)
    except ShapeError as error:
        fault = MisreadNumber(
            subject="shape",
            sentence=error.sentence,
            discrepancy=1.0,
            file=error.file or file,
            line=error.line or 0,
        )
        return WholeStepCheck(record=WholeStep(misread=(error.sentence,)), misread=(fault,))
    except (TreeError, EngineError) as error:
        return WholeStepCheck.skipped([str(error)])


def _check_laws(
    file: Path, model: WholeModel, resolution: float, steps: KeptSteps
) -> WholeStepCheck:
    """Compare steps by convex laws, and the numbers of these with the text of the file."""
    reader = compiler(file.suffix)
    assert reader is not None  # it read the file before
    compiled = reader.compiled(file)
    laws = law_model(compiled)
    if laws is None:
        return WholeStepCheck.skipped()
    reading = check_reading(file, compiled, laws)
    if laws.laws.uncovered:
        check = WholeStepCheck.skipped(laws.laws.uncovered)
    else:
        besides = [Omission(what=what, count=count, where=()) for what, count in compiled.besides]
        names = {
            "drives": [one.name for one in compiled.actuators],
            "shapes": [place for one in compiled.placed if (place := one.name).startswith("geom:")],
        }
        touching = shapes_of_laws(tuple(placed_shapes(compiled, file)), laws)
        comparison = LawComparison(laws, model, **names)
        check = _check(file, comparison, touching, besides, resolution, steps)
    return _with_reading(check, reading)


def _with_reading(check: WholeStepCheck, reading: ReadingCheck) -> WholeStepCheck:
    record = replace_fields(
        check.record,
        stated=reading.compared,
        misread=tuple(one.sentence for one in reading.misread),
        unread=reading.unread,
    )
    return replace(check, record=record, misread=reading.misread)


def _check_rules(
    file: Path,
    spec: ModelSpec,
    model: WholeModel,
    rules: Rules,
    resolution: float,
    steps: KeptSteps,
) -> WholeStepCheck:
    """Compare steps by impulses or by convex laws, with the settings of an engine."""
    robot = read_as_it_runs(file, {**spec.settings, "couplings": False})
    parts = _parts_of(rules, floats=robot.floats)
    omissions = [one for one in robot.left_out if one.what in parts]
    laws = ruled_model(robot, rules)
    if laws is None:
        return WholeStepCheck.skipped()
    touching = shapes_of_urdf(robot, laws.tree.tree, rules, model.floor)
    comparison = LawComparison(laws, model, shapes=_shapes_of(rules))
    return _check(file, comparison, touching, omissions, resolution, steps)


def _shapes_of(rules: Rules) -> tuple[str, ...]:
    """Return the names of the links whose surfaces touch, by the surface."""
    if isinstance(rules, SoftRules):
        return tuple(rules.bodies[surface.body] for surface in rules.laws.surfaces)
    if isinstance(rules, ImpulseRules):
        return rules.bodies
    return ("ground", *(link for link, _ in rules.shapes))


def _check(
    file: Path,
    comparison: LawComparison,
    touching: TouchingShapes,
    omissions: Sequence[Omission],
    resolution: float,
    steps: KeptSteps,
) -> WholeStepCheck:
    """Compare steps at drawn states, or at those that are evaluated already.

    Forces of contacts are not judged in a file whose masses are stand-ins.

    Raises:
        EngineError: if no state is comparable.
    """
    evaluated = steps.evaluated(comparison)
    if has_stand_ins(file):
        evaluated = [one for one in evaluated if not one.engine.contacts]
    if not evaluated:
        raise EngineError("no drawn state has a finite step that converges, with few contacts")
    compared, model = comparison.compare(evaluated), comparison.model
    judged = comparison.judge(compared, resolution)
    kept = compared.resolved(resolution)
    rows = [sample for sample, keep in zip(evaluated, kept, strict=True) if keep]
    covered, inactive = _covered(comparison, rows, omissions)
    contacts = check_contacts(touching, comparison, evaluated)
    postures, touches = shared_contacts(touching, comparison)
    check = WholeStepCheck.compared(
        judged, resolution, _acted(rows), component=comparison.components[judged.component],
        states=len(rows), unresolved=len(evaluated) - len(rows), step=number(model.step),
        next_state=comparison.laws.has_next_state, edits=model.edits, covered=covered,
        inactive=inactive, uncovered=model.uncovered, acting=_shown(comparison, rows, judged),
        contacts=contacts.judged, contact_faults=tuple(one.sentence for one in contacts.faults),
        unjudged=tuple(f"{count} {what}" for what, count in contacts.unjudged.items()),
        contact_counts=contacts.counts, postures=postures, touches=touches,
    )  # fmt: skip
    return replace(check, contacts=contacts.faults)


_KINDS: Mapping[str, str] = {
    "limits of position": "limit", "dry friction": "dry friction",
    "collision geometry": "contact", "contact geometry": "contact",
    "<contact> of <link>": "contact", "limits of effort": "clamp",
    "saturation of actuators": "clamp", "equality constraints": "equality",
    "actuators of other laws or transmissions": "drive",
}  # fmt: skip
"""Kinds of elements by the part of a file that they are; others act at every state."""

NAMED = 4
"""Number of elements that did not act which are named."""


def _covered(
    comparison: LawComparison, samples: Sequence[Evaluated], omissions: Sequence[Omission]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the parts of a file that acted at judged states, and what of them never did."""
    acted = {one for sample in samples for one in comparison.acting_elements(sample)}
    elements = tuple(dict.fromkeys(comparison.elements()))
    covered, inactive = [], []
    for omission in omissions:
        kind = _KINDS.get(omission.what, "")
        names = tuple(name for other, name in elements if other == kind)
        if omission.where and not (names and kind == "contact"):  # links may be fused with others
            names = omission.where
        silent = [name for name in names if (kind, name) not in acted]
        if kind and len(silent) == len(names):
            continue
        covered.append(format_omission(omission))
        if silent:
            which = listed([name.removeprefix("geom:") for name in silent], NAMED)
            inactive.append(f"{omission.what} ({len(silent)} of {len(names)} never acted: {which})")
    return tuple(covered), tuple(inactive)


def _shown(
    comparison: LawComparison, rows: Sequence[Evaluated], judged: LimitVerdict
) -> ActingState:
    """Return the worst state, or for steps that agree the one where most forces act."""
    if judged.outcome is Outcome.DIFFERS:
        return acting_state(comparison, rows[judged.segment], differs=True)
    return acting_state(comparison, max(rows, key=_acting_forces), differs=False)


def _acting_forces(sample: Evaluated) -> int:
    """Return how many contacts, limits and saturated drives act, each kind up to eight."""
    acted = sample.solution.law.acted(sample.acceleration)
    return sum(min(count, 8) for name, count in acted if name in SHOWN)


SHOWN = ("contacts", "limits", "drives at a limit", "motors at a limit")
"""Forces that a picture marks."""


def _parts_of(rules: Rules, *, floats: bool) -> tuple[str, ...]:
    """Return the parts of a URDF that only whole steps compare; a fixed root meets no floor."""
    if isinstance(rules, SoftRules):
        shapes = ("collision geometry",) if rules.laws.surfaces else ()
        return ("limits of position", "dry friction", *shapes)
    if isinstance(rules, ImpulseRules):
        contacts = ("collision geometry", "<contact> of <link>") if floats else ()
        return ("limits of position", "limits of effort", *contacts)
    acts = {
        "limits of position": rules.has_limits,
        "dry friction": rules.dry_friction_share > 0,
        "collision geometry": floats and bool(rules.shapes),
    }
    return tuple(part for part, act in acts.items() if act)


def _acted(evaluated: Sequence[Evaluated]) -> Mapping[str, int]:
    """Return how often forces of each kind acted."""
    count: Counter[str] = Counter()
    for sample in evaluated:
        count.update(dict(sample.solution.law.acted(sample.acceleration)))
    return count
