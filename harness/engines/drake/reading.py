"""What Drake's parser warns of, and what it takes in place of what it can't take."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.source import folded

BALL = 0.4 * (3 / (4 * np.pi * 1000)) ** (2 / 3)
"""Moments of the ball as dense as water that stands for what is no inertia: of 1 kg, kg m^2."""


def refuse_balls(plant: Any, moments_of: Mapping[str, float], path: Path) -> None:
    """Refuse links that move and for whose inertias Drake has taken those of a ball.

    Args:
        plant: finalized.
        moments_of: what its links state for ixx, kg m^2.
        path: of it.

    Raises:
        EngineError: naming file and link.
    """
    for name, stated in moments_of.items():
        body = plant.GetBodyByName(name)
        own = body.default_spatial_inertia()
        central = own.Shift(own.get_com()) if own.get_mass() else own  # it is put at the centre
        moments = central.CalcRotationalInertia().get_moments() if own.get_mass() else np.zeros(3)
        ball = BALL * own.get_mass() ** (5 / 3)
        taken = ball > 0 and bool(np.all(np.abs(moments - ball) < 1e-6 * ball))
        if taken and abs(stated - ball) > 1e-4 * ball and not plant.IsAnchored(body):
            raise EngineError(
                f"{path}: Drake takes a ball of {own.get_mass():.4g} kg for the "
                f"impossible inertia of link {body.name()!r}; correct the inertia, "
                "or remove it"
            )


@contextmanager
def logged(said: list[str]) -> Iterator[None]:
    """What Drake logs meanwhile, a sentence each, in place of on stderr."""

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            told = folded(record.getMessage())
            said.append(re.sub(r"^<(literal|data)-string>(\.\w+)?:", "", told))

    logger, handler = logging.getLogger("drake"), Kept(logging.WARNING)
    others, spread = list(logger.handlers), logger.propagate
    logger.handlers, logger.propagate = [handler], False
    try:
        yield
    finally:
        logger.handlers, logger.propagate = others, spread
