"""Segments of trees with other numbers, computed from solved segments."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.multibody import TreeSystem, tree_system
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving import resolved
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.resolved import ReusedSegments
from physics_crosscheck.reference.solving.samples import samples, solved
from physics_crosscheck.reference.solving.segments import Segments
from tests.reference.multibody.trees import tree


@cache
def solved_samples() -> tuple[TreeSystem, Segments]:
    system = tree_system(name="arm", title="", source="", tree=tree(("hinge", "slide", "hinge"), 5))
    limits = np.array([[-1.0, 1.0]] * 3)
    return system, samples(TreeEquations(system), limits, np.zeros(3), 6, 1)


def heavier(segments: Tree, factor: float) -> Tree:
    last = segments.links[-1]
    return replace(segments, links=(*segments.links[:-1], replace(last, mass=last.mass * factor)))


def damped(segments: Tree, damping: float) -> Tree:
    return replace(
        segments, links=(*segments.links[:-1], replace(segments.links[-1], damping=damping))
    )


def by_two_methods(system: TreeSystem, segments: Segments) -> Segments:
    return solved(
        TreeEquations(system),
        segments.start,
        segments.start_inputs,
        segments.length,
        segments.fastest,
    )


@pytest.mark.parametrize("factor", [0.4, 1.001])
def test_changed_tree_matches_new_solutions(factor: float) -> None:
    system, segments = solved_samples()
    drawn = replace(system, tree=heavier(system.tree, factor))
    actual = ReusedSegments(system, segments).for_tree(drawn.tree)
    expected = by_two_methods(drawn, segments)
    assert np.all(np.abs(actual.end - expected.end) <= actual.bound + expected.bound)
    # A mass change of 0.1 % exceeds every bound.
    assert np.max(np.abs(actual.end - segments.end) / actual.bound) > 1e4
    assert np.all(actual.bound < 1e-10 * np.max(np.abs(segments.end - segments.start), axis=0))


def test_unchanged_tree_matches_the_solved_segments() -> None:
    system, segments = solved_samples()
    actual = ReusedSegments(system, segments).for_tree(system.tree)
    assert np.all(np.abs(actual.end - segments.end) <= segments.bound)


def test_quicker_tree_has_shorter_segments() -> None:
    system, segments = solved_samples()
    quick = replace(system, tree=damped(system.tree, 400.0))
    actual = ReusedSegments(system, segments).for_tree(quick.tree)
    assert actual.length < segments.length / 2
    assert actual.fastest > 2 * segments.fastest
    expected = by_two_methods(quick, actual)
    assert np.array_equal(actual.end, expected.end)


def test_distant_tree_is_solved_again(monkeypatch: pytest.MonkeyPatch) -> None:
    system, segments = solved_samples()
    near = ReusedSegments(system, segments)

    def refused(*_: object) -> Segments:
        raise ReferenceError("it does not converge")

    monkeypatch.setattr(resolved.ReusedSegments, "_near", refused)
    drawn = replace(system, tree=heavier(system.tree, 2.0))
    assert np.array_equal(near.for_tree(drawn.tree).end, by_two_methods(drawn, segments).end)
