"""Run comparisons in this process, on edited copies of the built-in models."""

import io
import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest
from rich.console import Console

from physics_crosscheck.harness.commands.compare.acting import compare_acting
from physics_crosscheck.harness.commands.compare.candidate import candidates
from physics_crosscheck.harness.commands.compare.compare import UNCHECKED, CompareOptions, compare
from physics_crosscheck.harness.commands.compare.laws import compare_laws
from physics_crosscheck.harness.commands.compare.match import declared, pairs_of
from physics_crosscheck.harness.commands.compare.prepared import prepare
from physics_crosscheck.harness.commands.compare.states import (
    SampledStates,
    sampled_states,
    start_range,
)
from physics_crosscheck.harness.jobs.executor import InThisProcess
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.records.comparison import Compared, ComparedActing, ComparedProperty
from physics_crosscheck.harness.render.terminal.comparison import print_comparison
from physics_crosscheck.records import ComparisonResult
from tests.standing import keep_default_engines


def compared(
    a: Path | str,
    b: Path | str,
    engine_a: str | None = None,
    engine_b: str | None = None,
    joints: str = "",
    table: Path | None = None,
    resolution: float = 1e-9,
    starts: tuple[Mapping[str, float], ...] = (),
    include_constraints: bool = False,
    floating: bool | None = None,
    own_files: bool = False,
    pictured: bool = False,
) -> ComparisonResult:
    """Compare two files as the command does; `own_files`: each engine with its own file too."""
    model_a, model_b = candidates((Path(a), Path(b)), (engine_a, engine_b), floating=floating)
    options = CompareOptions(
        a=model_a,
        b=model_b,
        joints=declared(joints, table),
        resolution=resolution,
        starts=starts,
        include_constraints=include_constraints,
        pictured=pictured,
    )
    with pytest.MonkeyPatch.context() as patch:
        if not own_files:
            name = f"{compare.__module__}.check_own_files"
            patch.setattr(name, lambda *_: (UNCHECKED, UNCHECKED))
        return compare(options, InThisProcess())


def result(comparison: ComparisonResult) -> Compared:
    assert comparison.compared is not None, comparison.reason
    return comparison.compared


def sampled(
    a: Path,
    b: Path,
    engine_a: str | None = None,
    engine_b: str | None = None,
    starts: tuple[Mapping[str, float], ...] = (),
) -> SampledStates:
    """Return the states from which the comparison of two files starts its runs."""
    model_a, model_b = candidates((a, b), (engine_a, engine_b))
    options = CompareOptions(a=model_a, b=model_b, starts=starts)
    prepared = prepare(InThisProcess(), options.a, options.b, ({}, {}), include_constraints=False)
    source, target = prepared.source_first(prepared.facts)
    return sampled_states(
        source, prepared.match, start_range(source, target, prepared.match), options.starts
    )


def laws(
    a: Path,
    b: Path,
    engine_a: str | None = None,
    engine_b: str | None = None,
    floating: bool | None = None,
) -> list[ComparedProperty]:
    """Compare the laws of two files alone, without the motions."""
    models = candidates((a, b), (engine_a, engine_b), floating=floating)
    prepared = prepare(InThisProcess(), *models, ({}, {}), include_constraints=False)
    source = prepared.source_first(prepared.facts)[0]
    pairs = pairs_of(prepared.match, source.coordinates)
    rows = compare_laws(prepared.facts, pairs)
    assert rows is not None
    return list(rows)


def acting(
    a: Path, b: Path, engine_a: str = "mujoco", engine_b: str = "mujoco"
) -> tuple[ComparedActing, ...]:
    """Compare how the numbers of two files act, without the motions."""
    models = candidates((a, b), (engine_a, engine_b))
    prepared = prepare(InThisProcess(), *models, ({}, {}), include_constraints=False)
    return compare_acting(prepared.facts)


def printed(comparison: ComparisonResult, width: int = 300) -> str:
    text = io.StringIO()
    print_comparison(Console(file=text, width=width, highlight=False, emoji=False), comparison)
    return " ".join(text.getvalue().split())


def model(system: str, name: str) -> Path:
    return builtin() / system / name


def changed(folder: Path, path: Path, *replacements: tuple[str, str]) -> Path:
    """Copy a model file and its sidecar, with some text replaced in either."""
    folder.mkdir(parents=True, exist_ok=True)
    sidecar = path.with_name(f"{path.name}.toml")
    for file in filter(Path.is_file, (path, sidecar)):
        shutil.copy(file, folder)
    keep_default_engines(folder)
    for old, new in replacements:
        matches = [
            f
            for f in (folder / path.name, folder / sidecar.name)
            if f.is_file() and old in f.read_text()
        ]
        assert matches, f"{old!r} is in no file"
        matches[0].write_text(matches[0].read_text().replace(old, new, 1))
    return folder / path.name
