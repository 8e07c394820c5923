"""The engine pages: generated parts are current and match each engine's samples."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.engine import Engine, EngineError, ModelSpec
from physics_crosscheck.harness.engines.pages import (
    COMMON,
    HELP,
    common_settings,
    own_settings,
    pages,
    phrases,
    renewed,
)
from physics_crosscheck.harness.engines.registry import BUILT_IN
from tests.models import written

FOLDER = Path(__file__).parents[2] / "docs" / "engines"
ENGINES = [kind() for kind in BUILT_IN]


def test_generated_parts_are_current() -> None:
    rendered = pages(FOLDER)
    assert {path.stem for path in rendered} == {"index", *(engine.name for engine in ENGINES)}
    for path, text in rendered.items():
        assert path.read_text() == text, "python -m physics_crosscheck.harness.engines.pages ..."


def test_page_without_markers_is_rejected() -> None:
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
def test_engine_matches_its_page(engine: Engine, tmp_path: Path) -> None:
    if engine.version() is None:
        pytest.skip(f"{engine.name} is not installed")
    page = phrases(engine)
    for sample in engine.samples():
        path = written(tmp_path, sample.file, sample.text)
        model = engine.load(ModelSpec(path, sample.springs, sample.settings))
        still = 0 * model.home[None]
        has_accelerations = model.accelerations(model.home[None], still, still) is not None
        assert has_accelerations == (page["accelerations"] != "no")
        assert (model.step_rule is not None) == (page["next state"] != "no")
        order = model.exponents(varying_input=False)[0]
        assert f"order {order}" in page["steps"]


@pytest.mark.parametrize("engine", ENGINES, ids=lambda engine: engine.name)
def test_engine_accepts_the_listed_settings(engine: Engine, tmp_path: Path) -> None:
    if engine.version() is None:
        pytest.skip(f"{engine.name} is not installed")
    sample = engine.samples()[0]
    path = written(tmp_path, sample.file, sample.text)
    for setting, default in own_settings(engine).items():
        if default == "of the file":
            continue
        engine.load(ModelSpec(path, sample.springs, {**sample.settings, setting: default}))
    with pytest.raises(EngineError, match="no setting nonsense"):
        engine.load(ModelSpec(path, sample.springs, {**sample.settings, "nonsense": True}))
