"""Two models held against each other, without equations."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Number, Numbers, Record, SourceLine
from physics_crosscheck.harness.records.outcome import Outcome


class ComparedModel(Record, frozen=True, kw_only=True):
    """One of the two.

    Attributes:
        model: its file.
        engine, version: that ran it; None: not installed.
        notes: what the engine does to it on its own.
        coordinates: names of its joints.
        integrator: name of the time-stepping method.
        step: seconds.
        gravity: m/s^2, empty where the engine tells none. This and the three before it are None
            where the model could not be loaded.
    """

    model: str
    engine: str
    version: str | None
    notes: tuple[str, ...]
    coordinates: tuple[str, ...] | None = None
    integrator: str | None = None
    step: Number = None
    gravity: Numbers | None = None


class ComparedRuns(Record, frozen=True, kw_only=True):
    """The runs that the comparison stands on.

    Attributes:
        count: how many.
        length: of each, seconds.
        driven: how many of them under known forces.
        lost: states that could not be used.
    """

    count: int
    length: float
    driven: int
    lost: int


class ComparedTerm(Record, frozen=True, kw_only=True):
    """A term of the equations that differs.

    Attributes:
        kind: such as `inertia`.
        joints: that it is about.
        message: one sentence.
        a, b: its values.
        uncertainty: of their difference.
        effect: the difference, as a share of the forces of the motions compared.
    """

    kind: str
    joints: tuple[str, ...]
    message: str
    a: Number
    b: Number
    uncertainty: Number
    effect: Number


class ComparedProperty(Record, frozen=True, kw_only=True):
    """What the files say differently, read from them without a motion.

    Attributes:
        kind: `mass`, `centre`, `inertia`, `axis`, `anchor`, `zero`, `kind`, `damping`, `armature`,
            `stiffness`, `rest`, `gravity`, `frame`, `range`, `actuators`, `actuator` or `left out`.
        about: the joint, link or frame; empty for the whole.
        message: one sentence.
        a, b: its values, where it is one number.
        where_a, where_b: the lines, where they are known.
        moves: whether equations of motion have it.
        relative: by how much it differs, relative; 1 where that is no matter of size.
    """

    kind: str
    about: str
    message: str
    a: Number
    b: Number
    where_a: SourceLine | None
    where_b: SourceLine | None
    moves: bool
    relative: Number


class FileEdit(Record, frozen=True, kw_only=True):
    """A place where the files differ.

    Attributes:
        what: the literal, or the setting.
        a, b: what stands there in A and in B.
        where_a, where_b: their lines; None where there is none.
    """

    what: str
    a: str
    b: str
    where_a: SourceLine | None
    where_b: SourceLine | None


class FileDifference(Record, frozen=True, kw_only=True):
    """Differences of the files that were tried together, or one alone.

    Attributes:
        edits: what was made of A as it is in B.
        moved: by how much they move the motions, relative.
        explained: share of the discrepancy that they explain.
        not_tried: why they were not; empty where they were.
    """

    edits: tuple[FileEdit, ...]
    moved: Number
    explained: Number
    not_tried: str


class Compared(Record, frozen=True, kw_only=True):
    """What came of a comparison that could be run.

    Attributes:
        discrepancy, uncertainty: of `component`, relative to its movement.
        component: the one that decides, such as `hip_dot`.
        by_component: the largest discrepancy of each component; where the models differ, zero of
            those that do not by more than their uncertainty.
        map: how joints were paired, a sentence each.
        left_out: joints without a partner that follow from others or stay put.
        states_of: the model that the states were taken from.
        joints: that were paired.
        runs: that it stands on.
        properties: what the files say differently, of which motions depend first.
        explained: share of the discrepancy that the equations of both files make; None where they
            can't be had, or nothing differs.
        off: by how much A's engine leaves the equations of its file, and B's, relative; None where
            `explained` is.
        terms: of the equations of motion, that differ, measured; none where the properties explain
            the discrepancy.
        differences: of the files.
        notes: what is to be known of the comparison.
        seconds: that it took.
        turned: joints that turn the other way in B.
        left_when_turned: what is left of the discrepancy then; None where none does.
        untried: how many differences of the files were not tried alone.
        untested: what differs, or may differ, and does not change the outcome.
        impossible: what is said of inertias that no body can have, with lines and remedies.
    """

    discrepancy: Number
    uncertainty: Number
    component: str
    joints: tuple[str, ...]
    by_component: Numbers
    map: tuple[str, ...]
    left_out: tuple[str, ...]
    states_of: str
    runs: ComparedRuns
    turned: tuple[str, ...]
    left_when_turned: Number
    properties: tuple[ComparedProperty, ...]
    explained: Number
    off: Numbers | None
    terms: tuple[ComparedTerm, ...]
    differences: tuple[FileDifference, ...]
    untried: int
    untested: tuple[str, ...]
    impossible: tuple[str, ...]
    notes: tuple[str, ...]
    seconds: float


class Comparison(Record, frozen=True, kw_only=True):
    """Two models of one mechanism.

    Attributes:
        created: UTC, ISO 8601.
        resolution: relative discrepancy that was to be resolved.
        models: A and B.
        outcome: DIFFERS where they move differently.
        reason: a sentence for whatever is not AGREES.
        stdout: what was printed, where the comparison could not be run.
        found: None where it could not.
        strict: whether what `untested` lists counts as a difference.
        schema: version of this format.
    """

    created: str
    resolution: float
    models: tuple[ComparedModel, ...]
    outcome: Outcome
    reason: str = ""
    stdout: str = ""
    found: Compared | None = None
    strict: bool = False
    schema: int = 1

    @property
    def passes(self) -> bool:
        """Whether they move alike and, if that is asked for, nothing was left untested."""
        untested = self.found.untested if self.found is not None else ()
        return self.outcome is Outcome.AGREES and not (self.strict and untested)
