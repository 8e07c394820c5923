"""What changes of a model beside its cases."""

from __future__ import annotations

import pytest

from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.versions import VersionModel
from tests.versions.samples import between, linearization, model, remark, run


def changed(now: Model, was: Model | None = None) -> VersionModel | None:
    before = run("1.0", models=(was or model(),))
    found = between(before, run("2.0", models=(now,))).models
    return found[0] if found else None


def test_a_model_of_which_nothing_changes_is_not_told() -> None:
    assert changed(model()) is None
    assert changed(model(linearizations=(linearization(47.0 * (1 + 1e-10)),))) is None


def test_a_linearization_that_moves_is_told_with_its_size() -> None:
    found = changed(model(linearizations=(linearization(47.0 * (1 + 1e-6)),)))
    assert found is not None
    assert found.kinds == ("linearization",)
    assert found.messages[0].startswith(
        "its linearization about 'rest' moved: A by 1.0e-06 ± 2e-10"
    )


def test_a_linearization_that_is_no_longer_taylors_is_told() -> None:
    found = changed(model(linearizations=(linearization(differs=True),)))
    assert found is not None
    assert found.messages == ("its linearization about 'rest' is not Taylor's any more",)


def test_remarks_are_gained_and_lost() -> None:
    found = changed(model(audit=(remark("a limit is ignored"),)))
    assert found is not None
    assert found.kinds == ("remark gained", "remark lost")
    assert found.messages == ("a limit is ignored", "the step is 0.002 s")


@pytest.mark.parametrize(("now", "is_reported"), [(0.1, False), (0.1 + 1e-15, False), (0.2, True)])
def test_a_remark_is_another_where_its_number_is_and_not_where_it_is_rounded(
    now: float, is_reported: bool
) -> None:
    was = model(audit=(remark("the damping is 0.1", 0.1, "damping"),))
    present = model(audit=(remark(f"the damping is {now}", now, "damping"),))
    assert (changed(present, was) is not None) is is_reported


def test_remarks_on_two_links_are_two_and_another_count_is_the_same_remark() -> None:
    """A digit of a name is another name; a digit of a computed count is not."""
    one, other = remark("link rod1 is heavy", 2.0), remark("link rod2 is heavy", 2.0)
    found = changed(model(audit=(other,)), model(audit=(one,)))
    assert found is not None
    assert found.kinds == ("remark gained", "remark lost")
    few, many = remark("3 of 24 states", subject="states"), remark("4 of 24", subject="states")
    assert changed(model(audit=(many,)), model(audit=(few,))) is None


def test_a_part_of_the_check_that_fails_under_one_version_is_told() -> None:
    found = changed(model(linearizations=(), linearization_failure="it blew up"))
    assert found is not None
    assert found.kinds == ("fails",)
    assert found.messages == ("its linearization FAILED under 2.0: it blew up",)
    other = changed(model(), model(audit=None, audit_failure="no memory"))
    assert other is not None
    assert other.kinds == ("loads",)
