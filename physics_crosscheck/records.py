"""The types of results: runs, cases, models, systems, findings, and how to read them."""

from physics_crosscheck.harness.records.base import Record, SourceLine
from physics_crosscheck.harness.records.case import Case, CaseId, FullRun, ModelId, Series, Verdict
from physics_crosscheck.harness.records.cause import Cause, CauseId
from physics_crosscheck.harness.records.comparison import ComparisonResult
from physics_crosscheck.harness.records.finding import AuditFinding, Diagnosis, Explanation
from physics_crosscheck.harness.records.model import EngineLinearization, Model
from physics_crosscheck.harness.records.mutation import Mutation, Mutations
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import ResultsError, read_results
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.system import SystemResult

__all__ = [
    "AuditFinding", "Case", "CaseId", "Cause", "CauseId", "ComparisonResult", "Diagnosis",
    "EngineLinearization", "Explanation", "FullRun", "Model", "ModelId", "Mutation", "Mutations",
    "Outcome", "Record", "Results", "ResultsError", "Series", "SourceLine", "SystemResult",
    "Verdict", "read_results",
]  # fmt: skip
