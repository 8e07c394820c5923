"""Segments of trees with other numbers, found from those that are known."""

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
def known() -> tuple[TreeSystem, Segments]:
    system = tree_system(name="arm", title="", source="", tree=tree(("hinge", "slide", "hinge"), 5))
    limits = np.array([[-1.0, 1.0]] * 3)
    return system, samples(TreeEquations(system), limits, np.zeros(3), 6, 1)


def heavier(one: Tree, factor: float) -> Tree:
    last = one.links[-1]
    return replace(one, links=(*one.links[:-1], replace(last, mass=last.mass * factor)))


def damped(one: Tree, damping: float) -> Tree:
    return replace(one, links=(*one.links[:-1], replace(one.links[-1], damping=damping)))


def by_two_methods(system: TreeSystem, one: Segments) -> Segments:
    return solved(TreeEquations(system), one.start, one.start_inputs, one.length, one.fastest)


@pytest.mark.parametrize("factor", [0.4, 1.001])
def test_a_draw_ends_where_two_methods_from_scratch_end(factor: float) -> None:
    system, one = known()
    drawn = replace(system, tree=heavier(system.tree, factor))
    found = ReusedSegments(system, one).for_tree(drawn.tree)
    expected = by_two_methods(drawn, one)
    assert np.all(np.abs(found.end - expected.end) <= found.bound + expected.bound)
    # A thousandth of the mass is seen: no bound covers what a draw does.
    assert np.max(np.abs(found.end - one.end) / found.bound) > 1e4
    assert np.all(found.bound < 1e-10 * np.max(np.abs(one.end - one.start), axis=0))


def test_no_change_ends_where_the_known_ones_end() -> None:
    system, one = known()
    found = ReusedSegments(system, one).for_tree(system.tree)
    assert np.all(np.abs(found.end - one.end) <= one.bound)


def test_a_quicker_tree_has_shorter_segments() -> None:
    system, one = known()
    quick = replace(system, tree=damped(system.tree, 400.0))
    found = ReusedSegments(system, one).for_tree(quick.tree)
    assert found.length < one.length / 2
    assert found.fastest > 2 * one.fastest
    expected = by_two_methods(quick, found)
    assert np.array_equal(found.end, expected.end)


def test_what_is_not_near_is_solved_from_scratch(monkeypatch: pytest.MonkeyPatch) -> None:
    system, one = known()
    near = ReusedSegments(system, one)

    def refused(*_: object) -> Segments:
        raise ReferenceError("it does not converge")

    monkeypatch.setattr(resolved.ReusedSegments, "_near", refused)
    drawn = replace(system, tree=heavier(system.tree, 2.0))
    assert np.array_equal(near.for_tree(drawn.tree).end, by_two_methods(drawn, one).end)
