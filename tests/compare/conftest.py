"""Put the known-answer engine on the path: its entry point registers it."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from physics_crosscheck.harness.commands.compare import states
from physics_crosscheck.harness.commands.compare.states import SAMPLED

sys.path.insert(0, str(Path(__file__).parents[1] / "known_answer"))


@pytest.fixture(autouse=True, scope="package")
def few_states() -> Iterator[None]:
    """Compare fewer motions: here each one shows what differs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(states, "SAMPLED", 12)
        patch.setattr(states, "PUSHES", 4)
        yield


@pytest.fixture
def usual_states(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compare as many motions as the command."""
    monkeypatch.setattr(states, "SAMPLED", SAMPLED)
