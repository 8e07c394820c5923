"""The types of what comes out: results, cases, models, systems, findings, and how to read them."""

from harness.records.base import Record, SourceLine
from harness.records.case import Case, CaseId, FullRun, ModelId, Series, Verdict
from harness.records.cause import Cause, CauseId
from harness.records.comparison import Comparison
from harness.records.finding import AuditFinding, Diagnosis, Explanation
from harness.records.model import EngineLinearization, Model
from harness.records.mutation import Mutation, Mutations
from harness.records.outcome import Outcome
from harness.records.read import ResultsError, read_results
from harness.records.results import Results
from harness.records.system import System

__all__ = [
    "AuditFinding", "Case", "CaseId", "Cause", "CauseId", "Comparison", "Diagnosis",
    "EngineLinearization", "Explanation", "FullRun", "Model", "ModelId", "Mutation", "Mutations",
    "Outcome", "Record", "Results", "ResultsError", "Series", "SourceLine", "System", "Verdict",
    "read_results",
]  # fmt: skip
