"""A linearization that is not Taylor's is what is wrong with a model, though every case agrees."""

from msgspec.structs import replace

from physics_crosscheck.harness.interfaces.cli.run import exit_code
from physics_crosscheck.harness.records.model import Model
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.status import status_of
from tests.records.made import case
from tests.report.samples import model


def with_misfit(differs: bool) -> Model:
    sound = model("oscillator", "arm.xml", "mujoco", 1)
    (one,) = sound.linearizations
    return replace(sound, linearizations=(replace(one, a_error=13.0, differs=differs),))


def test_it_is_a_finding_a_failing_test_and_an_exit_code_of_one() -> None:
    wrong, sound = with_misfit(True), with_misfit(False)
    assert sound.passes
    assert not wrong.passes
    assert [one.kind for one in wrong.findings] == ["linearization"]
    assert "equations' in A by 1.3e+01 of its largest entry" in wrong.findings[0].message
    assert status_of(wrong, require_engines=True).status == "fail"
    for one, code in ((wrong, 1), (sound, 0)):
        results = Results(
            created="now", versions={}, resolution=1e-9, seconds=0.0, systems=(), models=(one,),
            cases=(case(),), baseline=None,
        )  # fmt: skip
        assert exit_code(results, require_engines=False) == code
