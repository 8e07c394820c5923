"""One model file in one engine: as it was run, its linearizations, audit and diagnosis."""

from .base import Number, Numbers, Record, Rows, one_length
from .case import ModelId, ModelKey
from .coverage import Coverage
from .finding import AuditFinding, Diagnosis
from .poses import Poses
from .survey import ActingQuantity


class EnginePole(Record, frozen=True, kw_only=True):
    """An eigenvalue of the engine's linearization.

    Attributes:
        real: Real part, 1/s.
        imaginary: Imaginary part, 1/s.
        frequency: Magnitude, rad/s.
        damping: Damping ratio; None for a pole at zero.
    """

    real: Number
    imaginary: Number
    frequency: Number
    damping: Number


class DiscreteLinearization(Record, frozen=True, kw_only=True):
    """One engine step, linearized about an equilibrium: x' = A x + B u.

    Attributes:
        step: The model's own time step, seconds.
        a: Matrix A, states in the order of the components.
        b: Matrix B.
        error: Largest difference from the documented rule, relative to the largest entry; None
            without a rule.
        bound: Uncertainty of `error`; None without a known rule.
        differs: Whether an entry differs by more than the uncertainty and the resolution.
        radius: Largest eigenvalue magnitude of `a`.
        exact_radius: Largest eigenvalue magnitude of the exact motion over the same time.
    """

    step: Number
    a: Rows
    b: Rows
    error: Number
    bound: Number
    differs: bool
    radius: Number
    exact_radius: Number


class EngineLinearization(Record, frozen=True, kw_only=True):
    """The engine's own linearization about an equilibrium, compared with the derived one.

    Attributes:
        equilibrium: Name of the equilibrium.
        a: The engine's matrix A, states in the order of the components.
        b: The engine's matrix B.
        a_error: Largest difference of any entry of A, relative to the largest entry.
        b_error: Largest difference of any entry of B, relative to the largest entry.
        a_bound: Largest uncertainty of any entry of A, relative; None without a limit.
        b_bound: Largest uncertainty of any entry of B, relative; None without a limit.
        differs: Whether both predict different short segments, beyond the uncertainty and the
            resolution.
        poles: Poles of the engine, in the order of `taylor_poles`.
        taylor_poles: Poles of the derived linearization.
        transfer_error: Largest difference of the transfer functions, relative to the largest value;
            None without inputs.
        mode_similarity: Smallest modal assurance criterion of paired eigenvectors; 1 means equal.
        frequencies: Frequencies of the responses, rad/s.
        response: The engine's magnitudes, by frequency, output and input.
        taylor_response: Derived magnitudes, by frequency, output and input.
        one_step: Linearization of one step; None if a step ends in values that are not finite.
    """

    equilibrium: str
    a: Rows
    b: Rows
    a_error: Number
    b_error: Number
    a_bound: Number = None
    b_bound: Number = None
    differs: bool = False
    poles: tuple[EnginePole, ...]
    taylor_poles: tuple[EnginePole, ...]
    transfer_error: Number
    mode_similarity: Number
    frequencies: Numbers
    response: tuple[Rows, ...]
    taylor_response: tuple[Rows, ...]
    one_step: DiscreteLinearization | None = None

    def __post_init__(self) -> None:
        one_length("the response", self.frequencies, self.response, self.taylor_response)


class Model(Record, frozen=True, kw_only=True):
    """One model file in one engine.

    Attributes:
        system: Name of the system; the folder name if the declaration cannot be loaded.
        model: Name of the model file; `-` for an empty folder, `system.py` if the declaration
            failed.
        engine: Name of the engine; `-` if no engine was reached.
        folder: System folder.
        text: Content of the model file.
        sidecar: Content of the sidecar.
        linearizations: Linearization about every equilibrium; empty if not requested, or failed.
        linearization_failure: Reason if the linearization failed; empty otherwise.
        audit: Findings without motion; None if not requested, or failed.
        audit_failure: Reason if the audit failed; empty otherwise.
        acting: Quantities that the numbers act as, and declared ones; empty if not requested.
        poses: Comparison of frames; None if there was none.
        diagnosis: Causes of the differences; None if nothing differs or none was requested.
        coverage: Tested and untested numbers; None if not requested.
        accepted: Reason for accepting the findings; empty if they are not accepted.
    """

    system: str
    model: str
    engine: str
    folder: str
    text: str
    sidecar: str
    linearizations: tuple[EngineLinearization, ...] = ()
    linearization_failure: str = ""
    audit: tuple[AuditFinding, ...] | None = None
    audit_failure: str = ""
    acting: tuple[ActingQuantity, ...] = ()
    poses: Poses | None = None
    diagnosis: Diagnosis | None = None
    coverage: Coverage | None = None
    accepted: str = ""

    @property
    def id(self) -> ModelId:
        """Name of the model."""
        return ModelId(system=self.system, model=self.model, engine=self.engine)

    @property
    def key(self) -> ModelKey:
        """Unique key of the model in its engine within a run."""
        return self.folder, self.model, self.engine

    @property
    def declares(self) -> bool:
        """True if its system declares what its contacts, limits and friction are to act as."""
        return any(row.declared for row in self.acting)

    @property
    def findings(self) -> tuple[AuditFinding, ...]:
        """Findings without motion, except notes.

        They are the audit's findings, and each linearization that differs from the derived one.
        """
        audit = (one for one in self.audit or () if one.severity == "finding")
        return (*audit, *(_other_linearization(one) for one in self.linearization_differs))

    @property
    def advice(self) -> tuple[AuditFinding, ...]:
        """Implausible numbers that are not accepted; they change no verdict."""
        audit = self.audit or ()
        return tuple(one for one in audit if one.severity == "advice" and not one.accepted)

    @property
    def unexplained_findings(self) -> tuple[AuditFinding, ...]:
        """Behaviours of the engine and audit findings, if no cause explains the motions.

        A diagnosis tries at most two wrong numbers together. With more, the cause with the smallest
        residual is wrong, and audit findings are more reliable.
        """
        if self.diagnosis is None or self.diagnosis.explained or not self.diagnosis.explanations:
            return ()
        findings = (one for one in self.audit or () if one.severity == "finding")
        return (*self.diagnosis.behaviours, *findings)

    @property
    def linearization_differs(self) -> tuple[EngineLinearization, ...]:
        """Linearizations that differ from the derived ones."""
        return tuple(one for one in self.linearizations if one.differs)

    @property
    def failures(self) -> tuple[tuple[str, str], ...]:
        """Parts that failed with reasons; these parts can't have findings."""
        parts = (("audit", self.audit_failure), ("linearization", self.linearization_failure))
        return tuple((what, why) for what, why in parts if why)

    @property
    def passes(self) -> bool:
        """True if nothing failed, and there are no findings or they are accepted."""
        return not self.failures and (bool(self.accepted) or not self.findings)


def _other_linearization(linearization: EngineLinearization) -> AuditFinding:
    parts = [
        f"{name} by {error:.1e} of its largest entry"
        + ("" if bound is None else f" (uncertainty {bound:.0e})")
        for name, error, bound in (
            ("A", linearization.a_error, linearization.a_bound),
            ("B", linearization.b_error, linearization.b_bound),
        )
        if error
    ]
    return AuditFinding(
        kind="linearization",
        subject=(linearization.equilibrium,),
        message=f"the engine's own linearization about {linearization.equilibrium!r} differs"
        f" from the equations' in {' and in '.join(parts)}",
        location=None,
        expected=None,
        actual=None,
        severity="finding",
    )
