"""One model file in one engine: as it was run, its linearizations, audit and diagnosis."""

from __future__ import annotations

from physics_crosscheck.harness.records.base import Number, Numbers, Record, Rows, one_length
from physics_crosscheck.harness.records.case import ModelId, ModelKey
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis
from physics_crosscheck.harness.records.poses import Poses


class EnginePole(Record, frozen=True, kw_only=True):
    """An eigenvalue.

    Attributes:
        real, imaginary: 1/s.
        frequency: its magnitude, rad/s.
        damping: ratio; None at zero.
    """

    real: Number
    imaginary: Number
    frequency: Number
    damping: Number


class DiscreteLinearization(Record, frozen=True, kw_only=True):
    """One step of an engine, linearized about an equilibrium: x' = A x + B u, from it to it.

    Attributes:
        step: the shipped one, seconds.
        a, b: the matrices, states in the order of the components.
        error, bound: the largest difference in any entry from the engine's own rule on the
            equations, and what is uncertain there, relative to the largest entry of what a step
            changes; None where no rule is known.
        differs: whether an entry differs by more than is uncertain, and than the resolution asked.
        radius, exact_radius: the largest magnitude of the eigenvalues of `a`, and of the exact
            motion's over the same time.
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
    """An engine's own linearization about an equilibrium, beside Taylor's.

    Attributes:
        equilibrium: its name.
        a, b: the engine's matrices, states in the order of the components.
        a_error, b_error: largest difference from Taylor's in any entry, relative to the largest.
        a_bound, b_bound: largest uncertainty of any entry, likewise; None where there is no limit.
        differs: whether what the engine makes of a state over a short segment differs from what
            Taylor's matrices make of it, by more than is uncertain, and than the resolution asked.
        poles, taylor_poles: paired.
        transfer_error: largest difference of the transfer functions, relative to the largest value;
            None without inputs.
        mode_similarity: smallest modal assurance criterion between paired eigenvectors; 1 is equal.
        frequencies: rad/s, of the responses.
        response, taylor_response: magnitudes by frequency, output and input.
        one_step: at the shipped step; None where it has no finite end.
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
        system, model, engine: its name, as in `ModelId`.
        folder: of the system.
        text, sidecar: the file and its sidecar as they were run.
        linearizations: about every equilibrium; empty where they were not asked for, or failed.
        linearization_failure: why there are none; empty otherwise.
        audit: what was found without motion; None where it was not asked for, or failed.
        audit_failure: why there is none; empty otherwise.
        poses: where its bodies are, as the audit found; None where there is none.
        diagnosis: None where no case of the model differs, or none was asked for.
        coverage: which numbers of its files had a say; None where it was not asked for.
        accepted: the reason for which what was found is accepted; empty where it is not.
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
    poses: Poses | None = None
    diagnosis: Diagnosis | None = None
    coverage: Coverage | None = None
    accepted: str = ""

    @property
    def id(self) -> ModelId:
        """Its name."""
        return ModelId(system=self.system, model=self.model, engine=self.engine)

    @property
    def key(self) -> ModelKey:
        """What tells the model in its engine from all others of a run."""
        return self.folder, self.model, self.engine

    @property
    def findings(self) -> tuple[AuditFinding, ...]:
        """What is wrong without any motion; notes are left out.

        What the audit found, and each linearization that is not Taylor's.
        """
        audit = (one for one in self.audit or () if one.severity == "finding")
        return (*audit, *(_other_linearization(one) for one in self.linearization_differs))

    @property
    def unexplained_findings(self) -> tuple[AuditFinding, ...]:
        """What the audit finds wrong, where no one or two causes explain the motions.

        Several numbers that are wrong at once are more than a diagnosis tries together; the cause
        that leaves least is then none, and what reading finds is the better word.
        """
        if self.diagnosis is None or self.diagnosis.explained or not self.diagnosis.explanations:
            return ()
        return tuple(one for one in self.audit or () if one.severity == "finding")

    @property
    def linearization_differs(self) -> tuple[EngineLinearization, ...]:
        """The linearizations that are not Taylor's."""
        return tuple(one for one in self.linearizations if one.differs)

    @property
    def failures(self) -> tuple[tuple[str, str], ...]:
        """What could not be done, and why: it can't have found anything."""
        diagnosis = "" if self.diagnosis is None else self.diagnosis.failure
        parts = (
            ("audit", self.audit_failure),
            ("linearization", self.linearization_failure),
            ("diagnosis", diagnosis),
        )
        return tuple((what, why) for what, why in parts if why)

    @property
    def passes(self) -> bool:
        """Whether all was done, and nothing was found, or what was found is accepted."""
        return not self.failures and (bool(self.accepted) or not self.findings)


def _other_linearization(one: EngineLinearization) -> AuditFinding:
    parts = [
        f"{name} by {error:.1e} of its largest entry"
        + ("" if bound is None else f" (uncertainty {bound:.0e})")
        for name, error, bound in (("A", one.a_error, one.a_bound), ("B", one.b_error, one.b_bound))
        if error
    ]
    return AuditFinding(
        kind="linearization",
        subject=(one.equilibrium,),
        message=f"the engine's own linearization about {one.equilibrium!r} is not Taylor's: it"
        f" differs in {' and in '.join(parts)}",
        location=None,
        expected=None,
        found=None,
        severity="finding",
    )
