"""What Drake's parser warns of, and what it takes in place of what it can't take."""

from __future__ import annotations

import logging
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from harness.engines.protocol import EngineError
from harness.engines.source import folded

BALL = 0.4 * (3 / (4 * np.pi * 1000)) ** (2 / 3)
"""Moments of the ball of 1 kg, as dense as water, that stands for what is no inertia, kg m^2."""


def refuse_balls(plant: Any, robot: ET.Element, path: Path) -> None:
    """Refuse links that move and for whose inertias Drake has taken those of a ball of 1 kg.

    Args:
        plant: finalized.
        robot: the file.
        path: of it.

    Raises:
        EngineError: naming file and link.
    """
    for link in robot.findall("link"):
        body = plant.GetBodyByName(link.get("name", ""))
        inertia = link.find("inertial/inertia")
        stated = 0.0 if inertia is None else float(inertia.get("ixx", "0"))
        own = body.default_spatial_inertia()
        moments = own.CalcRotationalInertia().get_moments() if own.get_mass() else np.zeros(3)
        ball = bool(np.all(np.abs(moments - BALL) < 1e-6 * BALL))
        if ball and abs(stated - BALL) > 1e-4 * BALL and not plant.IsAnchored(body):
            raise EngineError(
                f"{path}: Drake takes a ball of 1 kg for the inertia of link"
                f" {body.name()!r}, which no body can have; give it one, or none"
            )


@contextmanager
def logged(said: list[str]) -> Iterator[None]:
    """What Drake logs meanwhile, a sentence each, in place of on stderr."""

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            told = folded(record.getMessage())
            said.append(told.removeprefix("<literal-string>.urdf:"))

    logger, handler = logging.getLogger("drake"), Kept(logging.WARNING)
    others, spread = list(logger.handlers), logger.propagate
    logger.handlers, logger.propagate = [handler], False
    try:
        yield
    finally:
        logger.handlers, logger.propagate = others, spread
