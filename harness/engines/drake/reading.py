"""Warnings of Drake's parser, and the inertias that it substitutes for impossible ones."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.source import one_line

BALL = 0.4 * (3 / (4 * np.pi * 1000)) ** (2 / 3)
"""Moments of inertia, kg m^2, of a 1 kg ball of water: Drake's substitute for an impossible
inertia.
"""


def refuse_balls(plant: Any, moments_of: Mapping[str, float], path: Path) -> None:
    """Refuse moving links whose inertias Drake has replaced by those of a ball.

    Args:
        plant: finalized.
        moments_of: the links' stated ixx, kg m^2.
        path: of the file.

    Raises:
        EngineError: naming file and link.
    """
    for name, stated in moments_of.items():
        body = plant.GetBodyByName(name)
        inertia = body.default_spatial_inertia()
        central = (
            inertia.Shift(inertia.get_com()) if inertia.get_mass() else inertia
        )  # at the centre
        moments = (
            central.CalcRotationalInertia().get_moments() if inertia.get_mass() else np.zeros(3)
        )
        ball = BALL * inertia.get_mass() ** (5 / 3)
        is_ball = ball > 0 and bool(np.all(np.abs(moments - ball) < 1e-6 * ball))
        if is_ball and abs(stated - ball) > 1e-4 * ball and not plant.IsAnchored(body):
            raise EngineError(
                f"{path}: Drake takes a ball of {inertia.get_mass():.4g} kg for the "
                f"impossible inertia of link {body.name()!r}; correct the inertia, "
                "or remove it"
            )


@contextmanager
def collect_log(messages: list[str]) -> Iterator[None]:
    """Collect Drake's log messages in a list instead of on stderr."""

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            message = one_line(record.getMessage())
            messages.append(re.sub(r"^<(literal|data)-string>(\.\w+)?:", "", message))

    logger, handler = logging.getLogger("drake"), Kept(logging.WARNING)
    others, spread = list(logger.handlers), logger.propagate
    logger.handlers, logger.propagate = [handler], False
    try:
        yield
    finally:
        logger.handlers, logger.propagate = others, spread
