"""Engines of other distributions are registered by the entry point `crosscheck.engines`."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.engines.registry import engines


def distribution(place: Path, name: str, module: str, text: str) -> None:
    """Create a distribution with one module and one engine."""
    (place / f"{module}.py").write_text(text)
    info = place / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[crosscheck.engines]\n{name} = {module}:Engine\n")


def test_installed_engine_is_registered_by_name() -> None:
    engine = engines()["known"]
    assert engine.version() == "1.0"
    assert engine.formats == (".known",)
    assert list(engines())[:3] == ["mujoco", "pybullet", "pymunk"]


def test_engine_that_is_installed_later_is_registered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    assert "later" not in engines()
    text = "from physics_crosscheck.harness.engines.known_answer import KnownEngine\n\n\n"
    text += "class Engine(KnownEngine):\n    name = 'later'\n"
    distribution(tmp_path, "later", "later_engine", text)
    assert "later" in engines()


def test_entry_point_cannot_replace_a_built_in_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "from physics_crosscheck.harness.engines.known_answer import KnownEngine\n\n\n"
    text += "class Engine(KnownEngine):\n    name = 'mujoco'\n"
    distribution(tmp_path, "usurper", "usurper_engine", text)
    monkeypatch.syspath_prepend(tmp_path)
    assert type(engines()["mujoco"]).__name__ == "MujocoEngine"


def test_entry_point_without_an_engine_is_reported_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distribution(tmp_path, "duck", "duck_engine", "class Engine:\n    name = 'duck'\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(
        UserWarning, match="'duck'.*not a subclass of harness.engines.protocol.Engine"
    ):
        registered = engines()
    assert "duck" not in registered


@pytest.mark.parametrize(("name", "text", "reason"), [
    ("broken", "import no_such_module_at_all\n", "no_such_module_at_all"),
    ("leaving", "raise SystemExit('good bye')\n", "good bye"),
    ("base", "raise BaseException('no')\n", "no"),
])  # fmt: skip
def test_entry_point_that_cannot_be_loaded_is_reported_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, reason: str
) -> None:
    distribution(tmp_path, name, f"{name}_engine", text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(UserWarning, match=f"{name}.*{reason}"):
        registered = engines()
    assert "known" in registered
