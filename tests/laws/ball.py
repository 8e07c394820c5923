"""A ball on a plane that may be tilted, as bodies and numbers."""

from collections.abc import Sequence

import numpy as np

from physics_crosscheck import Joint, RigidBody
from physics_crosscheck.reference.laws.mechanics import LawTree
from physics_crosscheck.reference.laws.step import LawModel, LawStep
from physics_crosscheck.reference.mechanism.assemble import assembled
from physics_crosscheck.reference.mechanism.laws import ContactPoint, Laws, Softness, Surface
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.spatial_inertia import IDENTITY
from physics_crosscheck.reference.mechanism.tree import WORLD

MASS, RADIUS, GRAVITY = 2.0, 0.1, 9.81
INERTIA = 0.4 * MASS * RADIUS**2
NOTHING = np.zeros(0)


def surface(body: int, softness: Softness, **changes: object) -> Surface:
    numbers = dict[str, object](
        body=body, dimension=3, friction=(0.6, 0.005, 0.0001), priority=0, mix=1.0, margin=0.0,
        softness=softness,
    )  # fmt: skip
    return Surface(**{**numbers, **changes})  # type: ignore[arg-type]


AXES = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SLIDES = tuple(
    Joint(name=axis, kind="slide", axis=row) for axis, row in zip("xyz", AXES, strict=True)
)
"""Joints of a body that does not turn."""


def ball(
    softness: Softness,
    tilt: float = 0.0,
    joints: tuple[Joint, ...] = (Joint(name="free", kind="free"),),
    **laws: object,
) -> LawModel:
    """Return a ball on a plane through the origin, which gravity meets at an angle."""
    free = RigidBody(
        name="ball",
        parent=None,
        joints=joints,
        mass=MASS,
        inertia=(INERTIA, INERTIA, INERTIA, 0.0, 0.0, 0.0),
    )
    down = (GRAVITY * float(np.sin(tilt)), 0.0, -GRAVITY * float(np.cos(tilt)))
    tree = assembled([free], down).tree
    numbers: dict[str, object] = {
        "step": 0.002,
        "integrator": "euler",
        "elliptic": True,
        "surfaces": (surface(0, softness), surface(1, softness)),
        **laws,
    }
    return LawModel(
        laws=Laws(**numbers),  # type: ignore[arg-type]
        tree=LawTree(
            tree=tree,
            paths=(),
            bodies=((WORLD, IDENTITY), tree.frames["ball"]),
            masses=np.array([0.0, MASS]),
            centers=np.zeros((2, 3)),
        ),
        home=np.array([0, 0, 0, 0, 0, RADIUS])[-tree.nv :],
    )


def on_plane(
    model: LawModel, depth: float, velocity: Sequence[float] | Array
) -> tuple[LawStep, Array]:
    """Return the law's problem at a depth and a velocity (angular, linear), and its solution."""
    y = np.array([[0, 0, 0, 0, 0, RADIUS - depth]])[:, -len(velocity) :]
    posture = next(model.tree.postures(y, np.array([velocity], dtype=float)))
    touching = ContactPoint(
        surfaces=(0, 1),
        distance=-depth,
        position=np.array([0.0, 0.0, -depth / 2]),
        frame=np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    )
    law = model.evaluate(posture, NOTHING, NOTHING, [touching])
    return law, law.problem.solve(law.problem.free)
