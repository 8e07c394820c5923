"""Comparison of two models, without equations."""

import msgspec

from .base import Number, Numbers, Record, SourceLine
from .case import Case, CaseKind
from .codes import comparison_code
from .finding import Diagnosis
from .outcome import Outcome
from .scene import Scene


class ComparedModel(Record, frozen=True, kw_only=True):
    """One of the two models.

    Attributes:
        model: Path of the file.
        engine: Name of the engine.
        version: Version of the engine; None if it is not installed.
        notes: What the engine adds to the model or ignores.
        coordinates: Names of the joints; None if the model did not load.
        integrator: Name of the integrator; None if the model did not load.
        step: Time step, seconds; None if the model did not load.
        gravity: Gravity, m/s^2; empty if the engine reports none, None if the model did not load.
        case: The engine against its own file, without constraints; None without equations.
        diagnosis: Causes if the engine differs from its file; None otherwise.
    """

    model: str
    engine: str
    version: str | None
    notes: tuple[str, ...]
    coordinates: tuple[str, ...] | None = None
    integrator: str | None = None
    step: Number = None
    gravity: Numbers | None = None
    case: Case | None = None
    diagnosis: Diagnosis | None = None


class ComparedRuns(Record, frozen=True, kw_only=True):
    """The runs of a comparison.

    Attributes:
        count: Number of runs.
        length: Length of each run, seconds.
        driven: Number of runs with known forces.
        lost: Number of states that could not be used.
    """

    count: int
    length: float
    driven: int
    lost: int


class ComparedTerm(Record, frozen=True, kw_only=True):
    """A term of the equations of motion that differs.

    Attributes:
        kind: Type of the term, such as `inertia`.
        joints: Affected joints.
        message: Explanation in one sentence.
        a: Value of model A.
        b: Value of model B.
        uncertainty: Uncertainty of the difference.
        effect: Difference as a share of the forces of the compared motions.
    """

    kind: str
    joints: tuple[str, ...]
    message: str
    a: Number
    b: Number
    uncertainty: Number
    effect: Number


class ComparedProperty(Record, frozen=True, kw_only=True):
    """A difference that the files state, found without a motion.

    Attributes:
        kind: Type: `mass`, `centre`, `inertia`, `axis`, `anchor`, `damping` and others, or `left
            out`.
        about: Joint, link or frame; empty for the whole model.
        message: Explanation in one sentence.
        a: Value of model A, for a single number.
        b: Value of model B, for a single number.
        where_a: Line in file A, if known.
        where_b: Line in file B, if known.
        moves: Whether the equations of motion contain this property.
        relative: Relative difference; 1 for a difference without a size.
        effect: Change of A's motions by B's value, relative to their size; None if unknown.
        remedy: How to edit a file, if the message does not show it; empty otherwise.
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
    effect: Number = None
    remedy: str = ""


class ComparedActing(Record, frozen=True, kw_only=True):
    """A quantity that the numbers of both files act as, with different values.

    Attributes:
        subject, quantity, unit: As in `ActingQuantity`.
        a: Value of model A; None if it is not finite, or if A has none.
        b: Value of model B, likewise.
        cause: Probable cause of the difference; empty if unknown.
    """

    subject: str
    quantity: str
    unit: str
    a: Number
    b: Number
    cause: str = ""


class FileEdit(Record, frozen=True, kw_only=True):
    """A place where the files differ.

    Attributes:
        what: Number or setting.
        a: Text in A.
        b: Text in B.
        where_a: Line in A, or the file.
        where_b: Line in B, or the file.
    """

    what: str
    a: str
    b: str
    where_a: SourceLine
    where_b: SourceLine


class FileDifference(Record, frozen=True, kw_only=True):
    """Differences of the files, applied together or one alone.

    Attributes:
        edits: Changes that make A like B.
        moved: Relative change of the motions.
        explained: Share of the discrepancy that the changes explain.
        not_tried: Reason if they were not applied; empty otherwise.
    """

    edits: tuple[FileEdit, ...]
    moved: Number
    explained: Number
    not_tried: str


class Compared(Record, frozen=True, kw_only=True):
    """The result of a comparison that ran.

    Attributes:
        discrepancy: Discrepancy of `component`, relative to its movement.
        uncertainty: Uncertainty of `discrepancy`.
        component: The deciding component, such as `hip_dot`.
        joints: Paired joints.
        by_component: Largest discrepancy of each component. If the models differ, insignificant
            discrepancies are zero.
        map: Pairs of joints, one sentence each.
        left_out: Joints without a partner that are fixed or follow other joints.
        states_of: Model that supplied the states.
        runs: The runs of the comparison.
        turned: Joints that turn the other way in B.
        left_when_turned: Discrepancy after reversing these joints; None without any.
        properties: Differences of the files; those that change the motion come first.
        explained: Share of the discrepancy that the two files' equations explain; None if unknown.
        off: Relative deviation of each engine from its file's equations; None if `explained` is.
        terms: Measured differences of the equations; empty if another cause explains the
            discrepancy.
        differences: Textual differences of the files.
        untried: Number of textual differences that were not tried alone.
        untested: Actual or possible differences that do not change the outcome.
        impossible: Inertias that no rigid body can have, with lines and remedies.
        notes: Remarks on the comparison.
        seconds: Duration, seconds.
        acting: Quantities that the numbers of the files act as, where they differ.
        laws: Differing limits, friction, contacts and drives, by effect on a step; None without
            laws.
        decisive: The difference that decides, if the motions agree; None if they decide.
        rounding: Largest relative difference if all are rounding, of six digits or a format; None
            otherwise.
        scenes: Both models at equal positions of their paired joints, A first; empty unless
            requested.
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
    acting: tuple[ComparedActing, ...] = ()
    laws: tuple[ComparedProperty, ...] | None = None
    decisive: ComparedProperty | None = None
    rounding: Number = None
    scenes: tuple[Scene, ...] = ()


class ComparisonResult(Record, frozen=True, kw_only=True):
    """A comparison of two models of one mechanism.

    Attributes:
        created: Time of the comparison, UTC, ISO 8601.
        resolution: Requested resolution: the smallest relative difference that counts.
        models: Models A and B.
        outcome: DIFFERS if the models move differently.
        reason: One sentence that explains the outcome; empty for AGREES.
        kind: Type of the reason of an outcome other than AGREES and DIFFERS, as in `Case`.
        code: Message code of the outcome and its kind; empty for AGREES.
        stdout: Output of a comparison that failed.
        compared: The comparison itself; None if it could not run.
        strict: Whether an entry of `untested` counts as a difference.
        schema: Version of this format.
    """

    created: str
    resolution: float
    models: tuple[ComparedModel, ...]
    outcome: Outcome
    reason: str = ""
    kind: CaseKind = ""
    code: str = ""
    stdout: str = ""
    compared: Compared | None = None
    strict: bool = False
    schema: int = 2

    def __post_init__(self) -> None:
        code = comparison_code(self.outcome, self.kind)
        msgspec.structs.force_setattr(self, "code", code)

    @property
    def passes(self) -> bool:
        """True if they move alike and, with `strict`, nothing was left untested."""
        untested = self.compared.untested if self.compared is not None else ()
        return self.outcome is Outcome.AGREES and not (self.strict and untested)
