"""Drake with joint limits and contacts, for single steps from given states of a plant with SAP.

Read in Drake 1.51, `sap_driver.cc`: limits have a stiffness of 1e12, a dissipation time of one
step, beta = 0.1, and rows within twice the motion of a step; joint dampers act at the step's end.
Contacts are points, with the approximation `lagged`. Its numbers have no setting in a file, unlike
those of surfaces. Dry friction of joints has no effect in Drake.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import read_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.reference.mechanism.laws import (
    CompliantSurface,
    ContactPoint,
    NearRigidRules,
)
from ..protocol import Array, EngineStep, WholeState
from ..source import refused
from ..tree_model import SpringForces, UndrivenWhole
from ..urdf_copy import DEEP, has_form
from .model import DrakeModel, collect_log
from .plant import Plant, moving_joints

WHOLE_SETTINGS = {"smooth": False, "couplings": False, "stepping": "sap"}
"""Settings of the adapter: with limits."""

BETA = 0.1
"""Ratio of a limit's shortest period to the step."""

DEFAULT = CompliantSurface(friction=1.0, stiffness=1e6, dissipation=50.0)
"""Drake's surface of a file that states none, and the floor's."""

SURFACE_TAGS = (
    "drake:proximity_properties", "drake:mu_static", "drake:mu_dynamic",
    "drake:point_contact_stiffness", "drake:hunt_crossley_dissipation",
)  # fmt: skip
"""Tags of a surface, as in `NearRigidRules`."""

FORMS = ("box", "sphere", "cylinder", "drake:capsule", "drake:ellipsoid")
"""Tags of the shapes whose contacts are compared."""


def refuse_words(robot: XmlElement) -> None:
    """Check the numbers of surfaces.

    Raises:
        EngineError: if one is a word; Drake's message has no line.
    """
    parent, *tags = SURFACE_TAGS
    for number in robot.findall(f"link/collision/{parent}/*"):
        value = number.get("value", "")
        if number.tag in tags and read_numbers(value, 1) is None:
            sentence = f"value of <{number.tag}> is {quote(value)}; write a finite number"
            raise refused(number, sentence)


class DrakeWhole(UndrivenWhole):
    """A URDF with its limits and shapes, and a floor under a floating root.

    Args:
        model: the loaded model, with `WHOLE_SETTINGS` and shapes of `FORMS`.
        robot: the file.
        uncovered: parts of the file that have no law here.
    """

    edits = (
        "couplings released", "contact_model=point",
        "a floor of friction 1 under a floating root",
    )  # fmt: skip
    standing_cosine = 1e-7  # FCL's `halfspaceIntersectTolerance`: tilts below 4.5e-4 rad

    def __init__(self, model: DrakeModel, robot: XmlElement, uncovered: tuple[str, ...]) -> None:
        from pydrake.systems.framework import DiagramBuilder

        super().__init__(model, uncovered)
        self._floats, self._surfaces = model.floats, dict[Any, int]()
        builder = DiagramBuilder()
        self._drake = model.build_in(builder, self._prepare)
        with collect_log([]):  # a warning that half spaces touch no deformable bodies
            self._diagram = builder.Build()
            self._root = self._diagram.CreateDefaultContext()
        context = self._drake.GetMyMutableContextFromRoot(self._root)
        self._plant = Plant(self._drake, model.layout, SpringForces((), (), ""), (), context)
        self.rules = NearRigidRules(
            step=self.step, share=(BETA / (2 * np.pi)) ** 2, stiffness=1e12,
            dissipation=self.step, window=2.0, slip=1e-3, slowest=1e-4, default=DEFAULT,
            surface_tags=SURFACE_TAGS,
            shapes=tuple(self._number_shapes(robot)),
            filters=bool(robot.findall("drake:collision_filter_group")),
        )  # fmt: skip
        self._damping = self._joint_damping()
        if self._floats:
            self.home, self.floor = self._on_floor(), 0.0

    def finds_exactly(self, first: str, other: str) -> bool:
        """Return False for pairs that are found by iteration, to 1e-6 m and worse."""
        return bool({"plane", "sphere"} & {first, other})

    def _prepare(self, plant: Any) -> None:
        from pydrake.geometry import HalfSpace
        from pydrake.math import RigidTransform
        from pydrake.multibody.plant import ContactModel, CoulombFriction

        plant.set_contact_model(ContactModel.kPoint)
        plant.SetUseSampledOutputPorts(False)
        if self._floats:
            friction = CoulombFriction(DEFAULT.friction, DEFAULT.friction)
            floor = plant.RegisterCollisionGeometry(
                plant.world_body(), RigidTransform(), HalfSpace(), "floor", friction
            )
            self._surfaces[floor] = 0

    def _number_shapes(self, robot: XmlElement) -> Iterator[tuple[str, int]]:
        """Number the shapes of each link; yield its name and the index of the element."""
        for link in robot.findall("link"):
            name = link.get("name", "")
            body = self._drake.GetBodyByName(name)
            shapes = enumerate(link.findall("collision"))
            kept = [index for index, shape in shapes if has_form(shape, FORMS)]
            numbers = self._drake.GetCollisionGeometriesForBody(body)
            numbers = [one for one in numbers if one not in self._surfaces]  # the floor
            for index, number in zip(kept, numbers, strict=True):
                self._surfaces[number] = len(self._surfaces) + (not self._floats)
                yield name, index

    def _on_floor(self) -> Array:
        """Return the drawn configuration, lifted until its lowest shape touches the floor."""
        home = self.home.copy()
        home[2] = -DEEP
        self._set(WholeState(home, np.zeros(len(home)), home[:0], home[:0]))
        depths = [-contact.distance for contact in self._contacts() if 0 in contact.surfaces]
        home[2] += max(depths, default=DEEP)
        return home

    def moved(self, state: WholeState, steps: int) -> WholeState:
        """Return the state after some steps; NaN velocities after Drake has failed."""
        self._set(state)
        try:
            for _ in range(steps):
                self._plant.update()
        except RuntimeError:
            return state._replace(m=np.full_like(state.m, np.nan))
        return self._read(state)

    def contacts(self, state: WholeState) -> tuple[ContactPoint, ...]:
        """Return the contacts at a state, without solving for their forces."""
        self._set(state)
        return tuple(self._contacts())

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return the mean acceleration of a step, its contacts, and the next state."""
        x, plant = self._set(state), self._drake
        context, before = self._plant.context, plant.GetVelocities(self._plant.context)
        try:
            update = plant.EvalUniquePeriodicDiscreteUpdate(context)
        except RuntimeError:
            lost = np.full_like(state.m, np.nan)
            return EngineStep(acceleration=lost, unbalanced=lost, contacts=(), after=state)
        after = update.get_vector(0).CopyToVector()[plant.num_positions() :]
        contacts = tuple(self._contacts())
        change = (after - before) / self.step
        residual = self._plant.stored(self._residual(change, after), x) if contacts else None
        acceleration = self._plant.stored(change, x)
        context.SetDiscreteState(update)
        return EngineStep(
            acceleration=acceleration,
            # Newton's method on pieces of a parabola, which limits are, ends at the minimum.
            unbalanced=np.zeros_like(state.m),
            contacts=contacts,
            after=self._read(state),
            solver_residual=residual,
        )

    def _joint_damping(self) -> Array:
        damping = np.zeros(self._drake.num_velocities())
        for joint in moving_joints(self._drake):
            there = slice(joint.velocity_start(), joint.velocity_start() + joint.num_velocities())
            damping[there] = joint.default_damping_vector()
        return damping

    def _residual(self, acceleration: Array, after: Array) -> Array:
        """Return the force that the solver left, and those of limits, in Drake's order."""
        from pydrake.multibody.tree import ModelInstanceIndex

        plant, context = self._drake, self._plant.context
        contact_forces = np.zeros_like(after)
        for i in range(plant.num_model_instances()):
            instance = ModelInstanceIndex(i)
            if plant.num_velocities(instance):
                port = plant.get_generalized_contact_forces_output_port(instance)
                plant.SetVelocitiesInArray(instance, port.Eval(context), contact_forces)
        inertial = plant.CalcMassMatrix(context) @ acceleration + plant.CalcBiasTerm(context)
        gravity = plant.CalcGravityGeneralizedForces(context)
        result: Array = inertial - gravity + self._damping * after - contact_forces
        return result

    def _set(self, state: WholeState) -> Array:
        x = self._plant.layout.to_state(state.z, 0 * state.z)[0]
        self._plant.set_state(x, state.m)
        return x

    def _read(self, state: WholeState) -> WholeState:
        x, m = self._plant.state()
        return state._replace(z=self._plant.layout.place(x), m=m)

    def _contacts(self) -> Iterator[ContactPoint]:
        results = self._drake.get_contact_results_output_port().Eval(self._plant.context)
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            pair = info.point_pair()
            normal = -np.array(pair.nhat_BA_W)
            frame = np.linalg.svd(normal[None])[2]
            frame[0] = normal
            yield ContactPoint(
                surfaces=(self._surfaces[pair.id_A], self._surfaces[pair.id_B]),
                distance=-pair.depth,
                position=np.array(info.contact_point()),
                frame=frame,
            )
