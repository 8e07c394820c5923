"""Changes of a model, apart from those of its cases."""

from __future__ import annotations

import pytest

from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.versions import VersionModel
from tests.versions.samples import between, linearization, model, remark, run


def changed(now: Model, was: Model | None = None) -> VersionModel | None:
    before = run("1.0", models=(was or model(),))
    models = between(before, run("2.0", models=(now,))).models
    return models[0] if models else None


def test_unchanged_model_is_not_reported() -> None:
    assert changed(model()) is None
    assert changed(model(linearizations=(linearization(47.0 * (1 + 1e-10)),))) is None


def test_changed_linearization_is_reported_with_its_size() -> None:
    change = changed(model(linearizations=(linearization(47.0 * (1 + 1e-6)),)))
    assert change is not None
    assert change.kinds == ("linearization",)
    assert change.messages[0].startswith(
        "its linearization about 'rest' moved: A by 1.0e-06 ± 2e-10"
    )


def test_linearization_that_leaves_taylors_is_reported() -> None:
    change = changed(model(linearizations=(linearization(differs=True),)))
    assert change is not None
    assert change.messages == ("its linearization about 'rest' is not Taylor's any more",)


def test_gained_and_lost_remarks_are_reported() -> None:
    change = changed(model(audit=(remark("a limit is ignored"),)))
    assert change is not None
    assert change.kinds == ("remark gained", "remark lost")
    assert change.messages == ("a limit is ignored", "the step is 0.002 s")


@pytest.mark.parametrize(("now", "is_reported"), [(0.1, False), (0.1 + 1e-15, False), (0.2, True)])
def test_remarks_differ_by_number_but_not_by_rounding(now: float, is_reported: bool) -> None:
    was = model(audit=(remark("the damping is 0.1", 0.1, "damping"),))
    present = model(audit=(remark(f"the damping is {now}", now, "damping"),))
    assert (changed(present, was) is not None) is is_reported


def test_remarks_differ_by_link_but_not_by_count() -> None:
    """Distinguish remarks by digits of a name but not by digits of a computed count."""
    first, second = remark("link rod1 is heavy", 2.0), remark("link rod2 is heavy", 2.0)
    change = changed(model(audit=(second,)), model(audit=(first,)))
    assert change is not None
    assert change.kinds == ("remark gained", "remark lost")
    three, four = remark("3 of 24 states", subject="states"), remark("4 of 24", subject="states")
    assert changed(model(audit=(four,)), model(audit=(three,))) is None


def test_check_that_fails_under_one_version_is_reported() -> None:
    change = changed(model(linearizations=(), linearization_failure="it blew up"))
    assert change is not None
    assert change.kinds == ("fails",)
    assert change.messages == ("its linearization FAILED under 2.0: it blew up",)
    other = changed(model(), model(audit=None, audit_failure="no memory"))
    assert other is not None
    assert other.kinds == ("loads",)
