"""The engine pages: their generated parts are current, and true of each engine's samples."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.engines.pages import (
    COMMON,
    HELP,
    common_settings,
    own_settings,
    pages,
    phrases,
    renewed,
)
from physics_crosscheck.harness.engines.protocol import Engine, EngineError, ModelSpec
from physics_crosscheck.harness.engines.registry import BUILT_IN

FOLDER = Path(__file__).parents[2] / "docs" / "engines"
ENGINES = [kind() for kind in BUILT_IN]


def test_the_generated_parts_are_current() -> None:
    found = pages(FOLDER)
    assert {path.stem for path in found} == {"index", *(engine.name for engine in ENGINES)}
    for path, text in found.items():
        assert path.read_text() == text, "python -m physics_crosscheck.harness.engines.pages ..."


def test_a_page_without_markers_is_refused() -> None:
    with pytest.raises(ValueError, match="no part between"):
        renewed("# Engine\n", "| fact | value |\n")


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.name)
def test_phrases_are_short_and_every_setting_is_explained(engine: Engine) -> None:
    for phrase in phrases(engine).values():
        assert 0 < len(phrase.split()) <= 15
    settings = own_settings(engine)
    assert set(settings) <= set(HELP)
    for setting in (*settings, *common_settings(engine)):
        assert len((HELP.get(setting) or COMMON[setting]).split()) <= 15


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.name)
def test_an_engine_does_what_its_page_says(engine: Engine, tmp_path: Path) -> None:
    if engine.version() is None:
        pytest.skip(f"{engine.name} is not installed")
    said = phrases(engine)
    for sample in engine.samples():
        path = tmp_path / sample.file
        path.write_text(sample.text)
        model = engine.load(ModelSpec(path, sample.springs, sample.settings))
        still = 0 * model.home[None]
        told = model.accelerations(model.home[None], still, still) is not None
        assert told == (said["accelerations"] != "no")
        assert (model.step_rule is not None) == (said["next state"] != "no")
        order = model.exponents(varying_input=False)[0]
        assert f"order {order}" in said["steps"]


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.name)
def test_the_listed_settings_are_those_that_an_engine_takes(engine: Engine, tmp_path: Path) -> None:
    if engine.version() is None:
        pytest.skip(f"{engine.name} is not installed")
    sample = engine.samples()[0]
    path = tmp_path / sample.file
    path.write_text(sample.text)
    for setting, default in own_settings(engine).items():
        if default == "of the file":
            continue
        engine.load(ModelSpec(path, sample.springs, {**sample.settings, setting: default}))
    with pytest.raises(EngineError, match="no setting nonsense"):
        engine.load(ModelSpec(path, sample.springs, {**sample.settings, "nonsense": True}))
