"""Earlier failures of fuzzing, and every parser on its seeds."""

from __future__ import annotations

import pytest

from physics_crosscheck import DeclarationError, PublishedEquation
from physics_crosscheck.reference.dynamics.notation import readings
from physics_crosscheck.reference.load import load_system
from soak.fuzz.minimize import minimize
from soak.fuzz.target import FuzzFinding, FuzzTarget, SlowError, attack
from soak.fuzz.targets import TARGETS

FINDS = [
    # An address of TOML whose quoted key tomllib refuses, and an index that no int() reads.
    ("toml", b"a.'''\0'''\n---\n[settings]\nstep = 1\n"),
    ("toml", b"a[" + b"9" * 5000 + b"]\n---\na = [1]\n"),
    ("xml", b"a@b[" + b"9" * 5000 + b"]\n---\n<a b='0 0 1'/>"),
    # A prefix that no namespace is bound to.
    ("new_mjcf", b'<mujoco><worldbody><m :=""/></worldbody></mujoco>'),
    # A published equation that Python's parser reads as a string.
    ("notation", b"f''"),
    ("notation", b"'x' = 0"),
    ("notation", b"[x] = x"),
    # Arithmetic that never finishes.
    ("expression", b"-m * l** 1e908"),
    ("expression", b"9**9**9"),
    ("expression", b"2**-9**9**9 * m"),
    # Names that would start a line of the generated system.py.
    ("new_urdf", b"""<robot name="a"><link name="g"/><link name="b&#10; c"><inertial>
<mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<joint name="j&#10;  k" type="continuous"><parent link="g"/><child link="b&#10; c"/></joint></robot>
"""),
    ("new_mjcf", b"""<mujoco><worldbody><body name="a&#10;   b"><joint name="c&#10; d"/>
<inertial pos="0 0 1" mass="2" diaginertia="1 1 1"/></body></worldbody></mujoco>"""),
]  # fmt: skip


@pytest.mark.parametrize(("name", "data"), FINDS)
def test_earlier_failures_are_rejected_or_read(name: str, data: bytes) -> None:
    assert attack(TARGETS[name], data) is None


@pytest.mark.parametrize("name", TARGETS)
def test_every_seed_satisfies_the_contract(name: str) -> None:
    for seed in list(TARGETS[name].seeds())[:4]:
        assert attack(TARGETS[name], seed) is None


def test_invalid_equation_is_reported_by_its_number() -> None:
    from physics_crosscheck.harness.modelfiles.folders import builtin

    system = load_system(builtin() / "simple_pendulum")
    published = PublishedEquation("3.7", "f''", "motion", of="theta", driven=False, note="")
    with pytest.raises(
        DeclarationError, match=r"Eq\. 3\.7: can't read .*is not a number, a name or"
    ):
        readings(published, system)


def raising(data: bytes) -> object:
    if b"no" in data:
        raise KeyError(data)
    if b"slow" in data:
        while True:
            pass
    raise ValueError


WRONG = FuzzTarget(name="w", parse=raising, errors=(ValueError,), seeds=lambda: iter(()), words=())


def test_broken_contract_is_detected_and_minimized() -> None:
    assert attack(WRONG, b"yes") is None
    failure = attack(WRONG, b"yes and no and so on")
    assert isinstance(failure, FuzzFinding)
    assert failure.location.startswith("KeyError")
    assert minimize(WRONG, failure.input) == b"no"


@pytest.mark.slow
def test_slow_input_is_detected() -> None:
    failure = attack(WRONG, b"slow")
    assert failure is not None
    assert failure.message.startswith(SlowError.__name__)
