"""Published equations contain arithmetic of names, no programs and no endless work."""

from time import process_time

import pytest

from physics_crosscheck import DeclarationError, PublishedEquation
from physics_crosscheck.reference.dynamics.notation import MAX_DEGREE, MAX_SIGNS, readings
from tests.reference.mechanisms import built_in


def refused(text: str) -> str:
    published = PublishedEquation("9.9", text, "motion", of="theta", driven=False, note="")
    began = process_time()
    with pytest.raises(DeclarationError, match=r"Eq\. 9\.9") as caught:
        readings(published, built_in("simple_pendulum"))
    assert process_time() - began < 2
    assert caught.value.about == ("PublishedEquation", "9.9")
    return str(caught.value)


@pytest.mark.parametrize("text", [
    "theta'' = 9**9**9", "theta'' = (9**64)**64", "theta'' = theta^(10^9)", "theta'' = 9**(-9**9)",
    f"theta'' = {'*'.join(['theta'] * (MAX_DEGREE + 1))}",
    "theta'' = 1e999992", "theta'' = 2*1.5E-99_9992 + theta",
])  # fmt: skip
def test_powers_that_keep_a_worker_busy_are_refused(text: str) -> None:
    assert "exponent" in refused(text) or "too large to compute" in refused(text)


@pytest.mark.parametrize("text", [
    "theta'' = (lambda: 0)()", "theta'' = theta.__class__", "theta'' = [theta][0]",
    "theta'' = f'{theta}'", "theta'' = (theta if g else 0)", "theta'' = sin(*[theta])",
])  # fmt: skip
def test_program_is_rejected(text: str) -> None:
    assert "is not a number, a name or arithmetic" in refused(text)


def test_number_of_ambiguous_signs_is_limited() -> None:
    assert f"at most {MAX_SIGNS} are allowed" in refused(f"theta'' = {'± g ' * (MAX_SIGNS + 1)}")


def test_root_is_an_exponent() -> None:
    published = PublishedEquation("1", "g = (g^2)^(1/2)", "value", of="", driven=False, note="")
    (reading,) = readings(published, built_in("simple_pendulum"))
    assert reading.sides[0] == reading.sides[1]
