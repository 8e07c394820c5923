"""The size of the project: `size.toml` has a budget of lines for each room, which only falls."""

import ast
import subprocess
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
SIZES = Path(__file__).with_name("size.toml")
SLACK = 0.02  # a budget is lowered when its room is this far below it

ROOMS = {
    "harness": ("harness/**/*.py", "physics_crosscheck/*.py"),
    "reference": ("reference/**/*.py",),
    "page": ("harness/**/*.html", "harness/**/*.css", "harness/**/*.js"),
    "tests": ("tests/**/*.py", "conftest.py"),
    "campaigns": ("campaigns/**/*.py", "gallery/**/*.py", "soak/**/*.py", "benchmarks/**/*.py"),
    "docs": ("docs/**/*.md", "README.md", "CONTRIBUTING.md"),
}
CLASSES = ("harness", "reference")  # the rooms whose classes are counted
INTERNAL = ("physics_crosscheck.harness.", "physics_crosscheck.reference.")


def files(room: str) -> list[Path]:
    paths = {path for pattern in ROOMS[room] for path in ROOT.glob(pattern)}
    return sorted(paths)


def internal_names(text: str) -> set[tuple[str, str]]:
    """Return the names that a test imports from modules inside the package."""
    nodes = ast.walk(ast.parse(text))
    return {
        (node.module, name.name)
        for node in nodes
        if isinstance(node, ast.ImportFrom)
        and node.module
        and f"{node.module}.".startswith(INTERNAL)
        for name in node.names
    }


def sizes() -> dict[str, dict[str, int]]:
    texts = {room: [path.read_text(encoding="utf-8") for path in files(room)] for room in ROOMS}
    code = [node for room in CLASSES for t in texts[room] for node in ast.walk(ast.parse(t))]
    return {
        "lines": {room: sum(len(t.splitlines()) for t in texts[room]) for room in ROOMS},
        "counts": {
            "classes": sum(isinstance(node, ast.ClassDef) for node in code),
            "internal_names": len(set().union(*map(internal_names, texts["tests"]))),
        },
    }


def problems(budget: dict[str, Any], measured: dict[str, dict[str, int]]) -> list[str]:
    """Return what exceeds its budget, what is far below it, and a wrong total."""
    given = {**budget["lines"], **budget["counts"]}
    lines = [
        f"{name}: {count} exceeds {given[name]}; free what this change adds"
        if count > given[name]
        else f"{name}: lower {given[name]} to {count}"
        for name, count in {**measured["lines"], **measured["counts"]}.items()
        if not given[name] * (1 - SLACK) <= count <= given[name]
    ]
    total = sum(budget["lines"].values())
    return lines + [f"total: {budget['total']} is not the sum {total}"] * (total != budget["total"])


def grown(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Return what one version of the file raises without a reason in `[[raised]]`."""
    raised = after.get("raised", [])[len(before.get("raised", [])) :]
    old, new = ({"total": toml["total"], **toml["counts"]} for toml in (before, after))
    return [
        f"{name}: {new[name]} was {count}"
        for name, count in old.items()
        if new[name] > count + sum(entry.get(name, 0) for entry in raised if entry["reason"])
    ]


def versions() -> list[dict[str, Any]]:
    """Return the file's versions in git, the oldest first, then the one that is here."""
    git = ["git", "-C", str(ROOT)]
    log = subprocess.run(
        [*git, "log", "--reverse", "--format=%H", "--", "tests/size.toml"],
        capture_output=True,
        text=True,
    )
    shown = [
        subprocess.run([*git, "show", f"{commit}:tests/size.toml"], capture_output=True, text=True)
        for commit in log.stdout.split()
    ]
    return [tomllib.loads(s.stdout) for s in shown if s.stdout] + [
        tomllib.loads(SIZES.read_text(encoding="utf-8"))
    ]


def test_every_room_fits_its_budget() -> None:
    messages = problems(tomllib.loads(SIZES.read_text(encoding="utf-8")), sizes())
    assert not messages, "\n".join(messages)


def test_budgets_only_fall() -> None:
    messages = [line for before, after in pairwise(versions()) for line in grown(before, after)]
    assert not messages, "\n".join(messages)


BUDGET: dict[str, Any] = {"total": 1100, "lines": {"a": 1000, "b": 100}, "counts": {"classes": 50}}


@pytest.mark.parametrize(
    ("measured", "message"),
    [
        ({"lines": {"a": 1000, "b": 99}, "counts": {"classes": 49}}, None),
        ({"lines": {"a": 1001, "b": 99}, "counts": {"classes": 50}}, "a: 1001 exceeds 1000"),
        ({"lines": {"a": 970, "b": 100}, "counts": {"classes": 50}}, "a: lower 1000 to 970"),
        ({"lines": {"a": 990, "b": 100}, "counts": {"classes": 51}}, "classes: 51 exceeds 50"),
    ],
)
def test_growth_and_slack_are_problems(measured: dict[str, Any], message: str | None) -> None:
    messages = problems(BUDGET, measured)
    assert len(messages) == (message is not None)
    assert all(line.startswith(str(message)) for line in messages)


def test_a_raise_needs_a_reason() -> None:
    more = {**BUDGET, "total": 1150, "counts": {"classes": 51}}
    reason = {"total": 50, "classes": 1, "reason": "USD robots"}
    assert grown(BUDGET, {**BUDGET, "lines": {"a": 990, "b": 110}}) == []
    assert grown(BUDGET, more) == ["total: 1150 was 1100", "classes: 51 was 50"]
    assert grown(BUDGET, {**more, "raised": [reason]}) == []
    assert len(grown({**BUDGET, "raised": [reason]}, {**more, "raised": [reason]})) == 2
    assert problems({**BUDGET, "total": 1000}, {"lines": {}, "counts": {}}) != []


def test_only_names_from_inside_the_package_count() -> None:
    text = (
        "from physics_crosscheck.harness.records import case, file\n"
        "from physics_crosscheck import run\nfrom tests.models import arm\n"
    )
    assert internal_names(text) == {
        ("physics_crosscheck.harness.records", "case"),
        ("physics_crosscheck.harness.records", "file"),
    }
