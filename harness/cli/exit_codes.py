"""What the commands end with."""

from __future__ import annotations

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results

AGREE, DIFFER, USAGE, FAIL = 0, 1, 2, 3
"""Exit codes: all agree; a difference or nothing certain; wrong usage; something could not run."""

SIGNALLED = 128
"""With the number of a signal added: stopped by it, as shells have it; 130 is Ctrl-C."""


def exit_code(results: Results, require_engines: bool) -> int:
    """The exit code of results; nothing run at all is a failure, a known difference none.

    An audit, a linearization or a diagnosis that could not be done is one too. What an engine
    refuses of robots' files is none where another engine has a verdict.
    """
    refused = {(case.folder, case.id) for case in results.refusals}
    counting = [case for case in results.cases if (case.folder, case.id) not in refused]
    outcomes = {case.outcome for case in counting if not case.accepted}
    if outcomes & {Outcome.FAILED, Outcome.REFUSED} or not results.cases or results.untested:
        return FAIL
    if any(model.failures for model in results.models):
        return FAIL
    if require_engines and Outcome.ABSENT in outcomes:
        return FAIL
    if outcomes & {Outcome.DIFFERS, Outcome.UNRESOLVED}:
        return DIFFER
    # What the audit finds in a model whose difference was accepted is what was accepted.
    accepted = {(case.folder, case.id.of_model) for case in results.cases if case.accepted}
    models = [model for model in results.models if (model.folder, model.id) not in accepted]
    return AGREE if all(model.passes for model in models) else DIFFER
