"""A tree in Drake, from any format: a discrete plant per step, or a continuous one.

Drake warns about inertias that it substitutes for impossible ones, in its log.
"""

import logging
import re
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.document import Mimic
from ..protocol import Array, EngineError, Force, StepRule, UnsupportedError
from ..remark import Remark
from ..runge_kutta import FREE, RungeKutta, each_alone
from ..source import load_failure, one_line
from ..tree_model import TreeModel, constrained_accelerations, leader_matrix
from .plant import SIZES, DiscreteSteps, Plant, moving_joints

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


SAP, TAMSI, CONTINUOUS = "sap", "tamsi", "continuous"


class DrakeModel(TreeModel):
    """A tree of slides, hinges and balls, with roots that are fixed or free.

    Attributes:
        coupled: whether couplings are added to discrete plants, or are in the text.
        stepping: the integration method.
    """

    coupled: bool = False
    stepping: str = SAP

    def take(self, text: str, kind: str, hold: Sequence[Mimic], free: str = "") -> None:
        """Build the plant from the file's text.

        Args:
            text: the file's text as Drake reads it.
            kind: its format, as Drake names it.
            hold: mimic joints that a continuous plant must constrain.
            free: the text without mimic joints, which continuous plants refuse; empty: `text`.
        """
        self._text, self._kind, self._messages = text, kind, list[str]()
        self._free_text = free or text
        self._continuous = self.stepping == CONTINUOUS
        self.integrator = "Runge-Kutta 4" if self._continuous else "semi-implicit euler"
        plant = self._plant = self._build(0.0 if self._continuous else self.step)
        joints = moving_joints(plant)
        sizes, names = [SIZES.get(joint.type_name(), 1) for joint in joints], list[str]()
        for joint, size in zip(joints, sizes, strict=True):
            name = joint.name()
            if joint.num_velocities() != size:
                raise EngineError(f"{self.path}: joint {name!r} is neither a slide nor a hinge")
            names.append(self.free_name(joint) if size == FREE else name)
        self._springs = self.name(names, sizes=sizes)
        damping = [one for joint in joints for one in joint.default_damping_vector()]
        self._damping = np.diag(damping)
        # SAP's soft couplers are in no continuous plant, so accelerations hold them exactly.
        held = self.mimics if self.stepping == SAP else hold
        self._along = leader_matrix(held, self.coordinates, self.path) if held else None
        self.ignores_mimics = bool(self.mimics) and self._along is None
        self._discrete = lru_cache(maxsize=32)(self._discrete_of)
        forward = each_alone(self._accelerations)
        if self._continuous:
            self.stepper = RungeKutta(forward, self.layout)
        self.forward = forward

    @abstractmethod
    def free_name(self, joint: Any) -> str:
        """Return the file's name of one of Drake's free joints."""

    @abstractmethod
    def complete(self, plant: Any) -> None:
        """Add elements that Drake's parser ignores, before the plant is finalized."""

    def build_in(self, builder: Any, prepare: Callable[[Any], None]) -> Any:
        """Build a plant of the file's step in a diagram, with shapes.

        Args:
            builder: of the diagram.
            prepare: changes the plant before it is finalized.
        """
        from pydrake.multibody.plant import AddMultibodyPlantSceneGraph

        plant, _ = AddMultibodyPlantSceneGraph(builder, self.step)
        return self._parsed(plant, self.step, prepare)

    def _build(self, h: float) -> Any:
        from pydrake.multibody.plant import MultibodyPlant

        return self._parsed(MultibodyPlant(h), h)

    def _parsed(self, plant: Any, h: float, prepare: Callable[[Any], None] | None = None) -> Any:
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import DiscreteContactApproximation

        if h and self.stepping == TAMSI:
            plant.set_discrete_contact_approximation(DiscreteContactApproximation.kTamsi)
        if h:
            plant.SetUseSampledOutputPorts(False)
        try:
            with collect_log(self._messages):
                Parser(plant).AddModelsFromString(self._text if h else self._free_text, self._kind)
                self.complete(plant)
                if prepare is not None:
                    prepare(plant)
                plant.mutable_gravity_field().set_gravity_vector(self.gravity)
                plant.Finalize()
        except RuntimeError as error:
            message = re.sub(
                r"<(literal|data)-string>(\.\w+)?(:\d+)*", self.path.name, one_line(error)
            )
            raise load_failure("Drake", self.path, message, UnsupportedError) from None
        return plant

    @cached_property
    def _continuous_plant(self) -> Plant:
        return self._wrap(self._plant if self._continuous else self._build(0.0))

    def _wrap(self, plant: Any) -> Plant:
        return Plant(plant, self.layout, self._springs, self.lifts)

    def _discrete_of(self, h: float) -> DiscreteSteps:
        plant = self._plant if h == self.step else self._build(h)
        wrapped = self._wrap(plant)
        return DiscreteSteps(wrapped, wrapped.pulled)

    def _accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations of one state and its forces, in `RungeKutta`'s convention."""
        a = self._continuous_plant.accelerations(x, m, f)
        if self._along is None:
            return a
        mass = self._continuous_plant.mass(x)
        return constrained_accelerations(mass, mass @ a, self._along)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step through a rollout, in the plant of that step."""
        if not self._continuous:
            self.stepper = self._discrete(h)
        return super().rollout(q, v, h, n, force, every)

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 1 for discrete plants, and 4 for RK4 unless an input is held over the
        step.
        """
        return (4 if self._continuous and not varying_input else 1), 1

    @property
    def step_rule(self) -> StepRule | None:
        """The step rule: SAP evaluates dampers at the step's end; rotations have no rule."""
        if self._continuous:
            return StepRule(scheme="Runge-Kutta 4")
        if self.layout.turns:
            return None
        damping = self._damping if self.stepping == SAP and self._damping.any() else None
        soft = "couplings, which are soft" if self.mimics and not self.ignores_mimics else ""
        return StepRule(scheme="semi-implicit Euler", damping=damping, besides=soft)

    @property
    def integrators(self) -> Mapping[str, Mapping[str, object]]:
        """RK4, for models without constraints."""
        is_available = not self._continuous and not self.mimics
        return {"Runge-Kutta 4": {"stepping": CONTINUOUS}} if is_available else {}

    @property
    def limits(self) -> Array:
        """Limits of joints that discrete plants enforce, (nz, 2)."""
        stopped = not (self._continuous or self.settings["smooth"])
        return self.stated_limits if stopped else super().limits

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of Drake's parser."""
        return tuple(dict.fromkeys(self._messages))

    def warning_remarks(self) -> Iterator[Remark]:
        """Yield Drake's warnings about the file."""
        yield from (
            Remark(kind="warning", message=f"Drake: {word}", address="") for word in self.warnings
        )

    @property
    @abstractmethod
    def places(self) -> tuple[str, ...]:
        """Bodies and their centres of mass."""

    def poses(self, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        """Return poses by Drake's forward kinematics."""
        wrapped = self._wrap(self._plant)
        origins, turns = np.empty((len(z), len(places), 3)), np.empty((len(z), len(places), 3, 3))
        for k, row in enumerate(z):
            wrapped.set_state(*self.layout.to_state(row, 0 * row))
            for f, place in enumerate(places):
                kind, _, name = place.partition(":")
                body = self._plant.GetBodyByName(name)
                pose = body.EvalPoseInWorld(wrapped.context)
                inward = body.default_com() if kind == "centre" else np.zeros(3)
                origins[k, f] = pose.multiply(inward)
                turns[k, f] = pose.rotation().matrix()
        return origins, turns
