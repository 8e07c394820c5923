"""Diagnosed causes as sentences, the same in the terminal, the report and pytest."""

from pathlib import Path

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.cause import IN_FILE, SWITCHES, Cause, digits_known
from physics_crosscheck.harness.records.comparison import ComparedModel
from physics_crosscheck.harness.records.finding import Explanation
from physics_crosscheck.harness.records.outcome import Outcome
from .messages import with_code

BEGIN_WITH_AUDIT = (
    "no single cause or pair of causes explains the motions; start with the audit findings"
)
"""Text for a model with `unexplained_findings`, instead of the cause with the smallest residual."""


def cause_sentences(explanation: Explanation) -> list[str]:
    """Return one sentence per cause of an explanation, its residual and its alternatives."""
    tail = f"residual {explanation.remaining:.1e} of the discrepancy"
    if explanation.tied_with:
        others = ", ".join(map(str, explanation.tied_with))
        tail += f"; indistinguishable here from: {others}"
    return [*map(_sentence, explanation.causes), tail]


def brief_cause(cause: Cause) -> str:
    """Describe a cause without its place and its standard error."""
    value = _digits(cause.estimate)
    if cause.estimate is not None and cause.standard_error is not None:
        value = digits_known(cause.estimate, cause.standard_error)
    return _statement(cause, str(cause), value)


def _sentence(cause: Cause) -> str:
    places = ", ".join(dict.fromkeys(map(str, cause.locations)))
    name = f"{cause} ({places})" if places else str(cause)
    return _statement(cause, name, _fitted(cause.estimate, cause.standard_error))


def _statement(cause: Cause, name: str, fitted: str) -> str:
    nominal = _digits(cause.nominal)
    acts = ", but" if cause.is_read else "; the engine acts as if it were"
    there = " in the engine" if cause.is_read else ""
    if cause.kind == "dropped":
        return f"{name}: in the file{acts} 0{there}"
    if cause.kind == "law":
        return f"{name} explains the difference"
    if cause.kind in SWITCHES:
        return f"{name} explains the motion"
    if cause.kind == "taken":
        return f"{name} is {nominal} in the file{acts} {fitted}{there}"
    if cause.kind in IN_FILE:
        return f"{name} is {nominal}; the motion implies {fitted}"
    return f"{name} is {nominal} in the equations; the model acts as if it were {fitted}"


def _fitted(value: Number, error: Number) -> str:
    if value is None or error is None:
        return f"{_digits(value)} ± unknown"
    digits = digits_known(value, error)
    return f"{digits} ± {error:.1g}" if error else digits


def _digits(value: Number) -> str:
    return "unknown" if value is None else f"{value:.10g}"


def own_file_sentence(model: ComparedModel) -> str:
    """Return how an engine follows the equations of its own file, and why not, or "" if unknown."""
    case, diagnosis = model.case, model.diagnosis
    if case is None:
        return ""
    begin = f"{Path(model.model).name} in {model.engine}"
    verdict = case.verdict
    if case.outcome is Outcome.AGREES and verdict is not None:
        e, u = verdict.discrepancy or 0.0, verdict.uncertainty or 0.0
        return f"{begin}: difference {e:.1e}, uncertainty {u:.1e}"
    reason = with_code(case.code, case.reason)
    if diagnosis is None or not diagnosis.explained:
        return f"{begin}: {reason}"
    causes = cause_sentences(diagnosis.explanations[0])[:-1]
    coded = zip((cause.code for cause in diagnosis.explanations[0].causes), causes, strict=True)
    return f"{begin}: {'; '.join(with_code(*one) for one in coded)}"
