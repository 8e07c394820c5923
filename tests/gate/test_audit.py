"""The gate audits what it runs: a wrong number that no motion depends on is no pass."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import pytest

from physics_crosscheck.harness.baseline.store import read_baseline
from physics_crosscheck.harness.commands.gate.accept import AcceptError
from physics_crosscheck.harness.commands.gate.notes import notes
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.interfaces.cli.exit_codes import DIFFER
from physics_crosscheck.harness.interfaces.cli.gate import code
from physics_crosscheck.harness.planning.model_checks import AUDIT, ModelCheck
from physics_crosscheck.harness.planning.prepared import Arguments, TargetFacts
from physics_crosscheck.harness.records.case import ModelId
from physics_crosscheck.harness.records.diff import Status
from physics_crosscheck.harness.run import Options, run
from tests.gate.conftest import SYSTEM, Repository, nothing

MODEL = ModelId(system=SYSTEM, model="space.py", engine="pymunk")


@pytest.fixture(scope="module")
def wrong(pristine: Repository, tmp_path_factory: pytest.TempPathFactory) -> Repository:
    """A repository in which a number is bound that no motion depends on, and is wrong."""
    repository = Repository(tmp_path_factory.mktemp("wrong"))
    shutil.copytree(pristine.root, repository.root, dirs_exist_ok=True)
    repository.edit("space.py", "MASS = 1.3", "SPARE = 1.4\nMASS = 1.3")
    repository.edit("space.py.toml", "[bindings]", '[bindings]\n"SPARE" = "m"')
    return repository


@pytest.fixture(scope="module")
def found(wrong: Repository) -> GateResult:
    """What the gate says of it."""
    return wrong.gate("pymunk")


def test_a_number_on_which_no_motion_depends_is_a_change_with_its_line(
    wrong: Repository, found: GateResult
) -> None:
    assert code(found) == DIFFER
    line = (wrong.folder / "space.py").read_text().split("SPARE")[0].count("\n") + 1
    file = wrong.folder / "space.py"
    for change in found.changes:
        assert change.status is Status.CHANGED
        assert change.kinds == ("audit",)
        (said,) = change.messages
        assert said.startswith(f"the audit finds {file}:{line}: SPARE is 1.4, but m = 1.3")
    (note,) = notes(found)
    assert (note.file, note.line, note.level) == (file, line, "error")


@pytest.mark.slow
def test_what_was_accepted_of_an_audit_passes_until_it_is_another(
    wrong: Repository, tmp_path_factory: pytest.TempPathFactory, found: GateResult
) -> None:
    repository = Repository(tmp_path_factory.mktemp("accepted"))
    shutil.copytree(wrong.root, repository.root, dirs_exist_ok=True)
    repository.accept("a spare part, ordered so", found=repository.gate("pymunk"))
    audit = read_baseline(repository.baseline)[SYSTEM].audits[MODEL]
    assert audit.reason == "a spare part, ordered so"
    (kept,) = audit.findings
    assert kept.message.startswith("SPARE is 1.4, but m = 1.3")
    assert str(repository.root) not in repository.file.read_text()
    assert repository.gate("pymunk").passes
    # Run again, it is what was accepted; in a run of all too.
    assert repository.gate("pymunk", every=True).passes
    options = Options(engines=("pymunk",), baseline=repository.baseline, jobs=2)
    (model,) = run([repository.folder], options, nothing).results.models
    assert model.findings
    assert (model.accepted, model.passes) == ("a spare part, ordered so", True)
    # Another number is another finding.
    repository.edit("space.py", "SPARE = 1.4", "SPARE = 1.5")
    assert [c.kinds for c in repository.gate("pymunk").changes] == [("audit",)] * 2
    # Mended, there is nothing to accept any more.
    repository.edit("space.py", "SPARE = 1.5", "SPARE = 1.3")
    mended = repository.gate("pymunk")
    assert mended.passes
    repository.accept("mended", found=mended)
    assert not read_baseline(repository.baseline)[SYSTEM].audits


def _broken(_: object) -> None:
    raise RuntimeError("no audit today")


TASK = ModelCheck.task


def _broken_audit(check: ModelCheck, facts: TargetFacts, given: Arguments) -> Callable[..., object]:
    return _broken if check is AUDIT else TASK(check, facts, given)


def test_an_audit_that_fails_is_no_pass_and_can_t_be_accepted(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ModelCheck, "task", _broken_audit)
    found = repository.gate("pymunk", every=True)
    assert {change.status for change in found.changes} == {Status.NOT_RUN}
    assert "its audit failed: RuntimeError: no audit today" in found.changes[0].messages[0]
    with pytest.raises(AcceptError, match="its audit failed"):
        repository.accept("never mind", found=found)
