"""The numbers that the layers of a stage state, and the tree for other values."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.documents.usd import overlay_path, stage_of
from physics_crosscheck.reference.mechanism.assemble import assemble
from physics_crosscheck.reference.mechanism.tree import Tree
from ..numbers import SMALL, UNSIZED, ModelFile
from .read import read_stage

_RELEVANT = re.compile(
    r".*@(physics:(mass|density|centerOfMass|diagonalInertia|principalAxes|localPos\d|localRot\d"
    r"|gravity\w+)|newton:(inertia|damping|armature|mimic\w+)"
    r"|drive:\w+:physics:(stiffness|damping|target\w+)|xformOp:.*|size|radius|height)"
)
"""Numbers that may affect a tree."""


class UsdNumbers(ModelFile):
    """The numbers of a stage that has a tree.

    Args:
        path: of the root layer.
        settings: `variants` and `allow_outside` of `UsdStage`; `held` names joints that are fixed.
    """

    def __init__(self, path: Path, settings: Mapping[str, object]) -> None:
        super().__init__([])
        self._stage, self._settings = stage_of(path, settings), settings
        self._path = path
        held = settings.get("held")
        self._held = held if isinstance(held, list) else []
        self.numerals = tuple(
            replace(one, scale=one.scale if one.scale > SMALL else UNSIZED)
            for one in self._stage.numbers
        )

    @cached_property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the tree."""
        return tuple(i for i, one in enumerate(self.numerals) if _RELEVANT.fullmatch(one.path))

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""
        stage = self._stage
        stage.change(stage.changed_values(self._by_number(values)))
        count = len(stage.obstacles)
        try:
            robot = read_stage(stage, self._settings)
        finally:
            stage.change({})
            del stage.obstacles[count:]
        if not self._held or robot.tree is None or robot.body_model is None:
            return robot.tree
        return assemble(robot.body_model.without(self._held)).tree

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """Return a layer over the file, by its path beside it."""
        return {overlay_path(self._path): self._stage.overlay(self._by_number(values))}

    def _by_number(self, values: Mapping[int, float]) -> dict[Number, float]:
        return {self.numerals[i]: value for i, value in values.items()}
