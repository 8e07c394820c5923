"""The gate audits what it runs, and fails on a wrong number that no motion depends on."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import pytest

from physics_crosscheck.command import DIFFER
from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.commands.gate.accept import AcceptError
from physics_crosscheck.harness.commands.gate.notes import notes
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.interfaces.cli.gate import code
from physics_crosscheck.harness.planning.model_checks import AUDIT, ModelCheck
from physics_crosscheck.harness.planning.prepared import Arguments, TargetFacts
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.records import ModelId
from tests.gate.conftest import SYSTEM, Repository, ignore_progress

MODEL = ModelId(system=SYSTEM, model="space.py", engine="pymunk")


@pytest.fixture(scope="module")
def wrong(pristine: Repository, tmp_path_factory: pytest.TempPathFactory) -> Repository:
    """Create a repository that binds a wrong number on which no motion depends."""
    repository = Repository(tmp_path_factory.mktemp("wrong"))
    shutil.copytree(pristine.root, repository.root, dirs_exist_ok=True)
    repository.edit("space.py", "MASS = 1.3", "SPARE = 1.4\nMASS = 1.3")
    repository.edit("space.py.toml", "[bindings]", '[bindings]\n"SPARE" = "m"')
    return repository


@pytest.fixture(scope="module")
def result(wrong: Repository) -> GateResult:
    """Return the result of its gate."""
    return wrong.gate("pymunk")


def test_number_without_effect_on_motion_is_a_change_with_its_line(
    wrong: Repository, result: GateResult
) -> None:
    assert code(result) == DIFFER
    line = (wrong.folder / "space.py").read_text().split("SPARE")[0].count("\n") + 1
    file = wrong.folder / "space.py"
    for change in result.changes:
        assert change.status is Status.CHANGED
        assert change.kinds == ("audit",)
        (message,) = change.messages
        assert message.startswith(f"the audit finds {file}:{line}: SPARE is 1.4, but m = 1.3")
    (note,) = notes(result)
    assert (note.file, note.line, note.level) == (file, line, "error")


@pytest.mark.slow
def test_accepted_audit_finding_passes_until_it_changes(
    wrong: Repository, tmp_path_factory: pytest.TempPathFactory, result: GateResult
) -> None:
    repository = Repository(tmp_path_factory.mktemp("accepted"))
    shutil.copytree(wrong.root, repository.root, dirs_exist_ok=True)
    repository.accept("a spare part, ordered so", result=repository.gate("pymunk"))
    audit = read_baseline(repository.baseline)[SYSTEM].audits[MODEL]
    assert audit.reason == "a spare part, ordered so"
    (finding,) = audit.findings
    assert finding.message.startswith("SPARE is 1.4, but m = 1.3")
    assert str(repository.root) not in repository.file.read_text()
    assert repository.gate("pymunk").passes
    # Repeated, it is the accepted finding; so it is in a run of all cases.
    assert repository.gate("pymunk", every=True).passes
    options = Options(engines=("pymunk",), baseline=repository.baseline, jobs=2)
    (model,) = run([repository.folder], options, ignore_progress).results.models
    assert model.findings
    assert (model.accepted, model.passes) == ("a spare part, ordered so", True)
    # Another number is another finding.
    repository.edit("space.py", "SPARE = 1.4", "SPARE = 1.5")
    assert [c.kinds for c in repository.gate("pymunk").changes] == [("audit",)] * 2
    # After the fix, there is nothing to accept.
    repository.edit("space.py", "SPARE = 1.5", "SPARE = 1.3")
    fixed = repository.gate("pymunk")
    assert fixed.passes
    repository.accept("repaired", result=fixed)
    assert not read_baseline(repository.baseline)[SYSTEM].audits


def _broken(_: object) -> None:
    raise RuntimeError("no audit today")


TASK = ModelCheck.task


def _broken_audit(check: ModelCheck, facts: TargetFacts, given: Arguments) -> Callable[..., object]:
    return _broken if check is AUDIT else TASK(check, facts, given)


def test_failed_audit_does_not_pass_and_cannot_be_accepted(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ModelCheck, "task", _broken_audit)
    result = repository.gate("pymunk", every=True)
    assert {change.status for change in result.changes} == {Status.NOT_RUN}
    assert "its audit failed: RuntimeError: no audit today" in result.changes[0].messages[0]
    with pytest.raises(AcceptError, match="its audit failed"):
        repository.accept("never mind", result=result)
