"""A wrong linearization is a finding of its model even though every case agrees."""

from msgspec.structs import replace

from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.results.status import status_of
from physics_crosscheck.records import Model, Results
from tests.records.made import case
from tests.report.samples import model


def with_misfit(differs: bool) -> Model:
    sound = model("oscillator", "arm.xml", "mujoco", 1)
    (linearization,) = sound.linearizations
    return replace(sound, linearizations=(replace(linearization, a_error=13.0, differs=differs),))


def test_wrong_linearization_fails_test_and_run() -> None:
    wrong, sound = with_misfit(True), with_misfit(False)
    assert sound.passes
    assert not wrong.passes
    assert [finding.kind for finding in wrong.findings] == ["linearization"]
    assert "equations' in A by 1.3e+01 of its largest entry" in wrong.findings[0].message
    assert status_of(wrong, require_engines=True).status == "fail"
    for checked, code in ((wrong, 1), (sound, 0)):
        results = Results(
            created="now", versions={}, resolution=1e-9, seconds=0.0, systems=(), models=(checked,),
            cases=(case(),), baseline=None,
        )  # fmt: skip
        assert exit_code(results, require_engines=False) == code
