"""Canonical contact problems in several engines: `python -m campaigns.canonical`.

Each engine builds a ball or block on a plane through its own interface, with a friction coefficient
mu and a restitution e. It runs at its default step and at a tenth of it. Exact answers are closed
forms. The command prints the table of `docs/engines/index.md`; `--published` prints published
tables beside our figures. It needs the extras of the engines that `--engines` selects (all).
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

Track = NDArray[np.float64]
"""Motion of a body's centre along the plane and away from it: x, z, their rates, (S, 4)."""

HALF, MASS, G = 0.1, 1.0, 9.81
"""Radius of the ball and half of the block's edge, m; mass, kg; gravity, m/s^2."""

DROP, RESTITUTION = 0.5, 0.8
SPEED, MU = 2.0, 0.3
SLOPE, SLOPE_MU = math.radians(20), 0.6


@dataclass(frozen=True, kw_only=True)
class CanonicalScene:
    """A ball or block over a plane.

    Attributes:
        ball: whether the body is a ball; a block otherwise.
        gap, speed: initial height over the plane, m, and initial speed along it, m/s.
        slope: inclination of gravity, rad.
        mu, e: friction coefficient and restitution of the pair.
        duration: s.
        half, mass, g: radius or half of the edge, m; kg; gravity, m/s^2.
        settings: an engine's own settings; its default values otherwise.
    """

    ball: bool = False
    gap: float = 0.0
    speed: float = 0.0
    slope: float = 0.0
    mu: float = SLOPE_MU
    e: float = 0.0
    duration: float = 2.0
    half: float = HALF
    mass: float = MASS
    g: float = G
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Components along x, y and z."""
        return self.g * math.sin(self.slope), 0.0, -self.g * math.cos(self.slope)

    @property
    def inertia(self) -> float:
        """Principal moment of inertia, kg m^2."""
        return (0.4 if self.ball else 2 / 3) * self.mass * self.half**2


def run_mujoco(text: str, name: str, value: float, count: int) -> Track:
    """Return positions and velocities of an MJCF after each step in MuJoCo, (S, nq + nv).

    The first component of `name`, `qpos` or `qvel`, starts at a value.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    getattr(data, name)[0] = value
    rows = []
    for _ in range(count):
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([data.qpos, data.qvel]))
    return np.array(rows)


def run_mjx(text: str, name: str, value: float, count: int) -> Track:
    """Return the same in MJX."""
    import jax
    import mujoco
    from mujoco import mjx

    jax.config.update("jax_enable_x64", True)
    model = mjx.put_model(mujoco.MjModel.from_xml_string(text))
    data = mjx.make_data(model)
    data = data.replace(**{name: getattr(data, name).at[0].set(value)})

    def step(data: Any, _: None) -> tuple[Any, Any]:
        data = mjx.step(model, data)
        return data, (data.qpos, data.qvel)

    run = jax.jit(lambda data: jax.lax.scan(step, data, None, count)[1])
    return np.concatenate(run(data), axis=1)


MjcfRun = Callable[[str, str, float, int], Track]


def mjcf_track(scene: CanonicalScene, h: float, run: MjcfRun = run_mujoco) -> Track:
    """Run a scene as MJCF."""
    rows = run(mjcf(scene, h), "qvel", scene.speed, round(scene.duration / h))
    return rows[:, [0, 2, 7, 9]]


def mjcf(scene: CanonicalScene, h: float) -> str:
    """Return a scene as MJCF; settings are attributes of `option` and of both geoms (`geom`)."""
    gravity = " ".join(map(repr, scene.gravity))
    kind, size = ("sphere", 1) if scene.ball else ("box", 3)
    option, geom = scene.settings.get("option", ""), scene.settings.get("geom", "")
    return f"""<mujoco><option timestep="{h}" gravity="{gravity}" jacobian="dense" {option}/>
    <default><geom friction="{scene.mu}" {geom}/></default><worldbody>
    <geom type="plane" size="9 9 1"/>
    <body pos="0 0 {scene.half + scene.gap}"><freejoint/>
    <geom type="{kind}" size="{f"{scene.half} " * size}" mass="{scene.mass}"/></body>
    </worldbody></mujoco>"""


def bullet_world(p: Any, gravity: Sequence[float], h: float) -> int:
    """Return a new client of PyBullet."""
    client: int = p.connect(p.DIRECT)
    p.setGravity(*gravity)
    p.setTimeStep(h)
    return client


def pybullet_track(scene: CanonicalScene, h: float) -> Track:
    """Run a scene in PyBullet; both coefficients are products; settings are the engine's."""
    import pybullet as p

    client = bullet_world(p, scene.gravity, h)
    p.setPhysicsEngineParameter(**scene.settings)
    floor = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
    shape = (
        p.createCollisionShape(p.GEOM_SPHERE, radius=scene.half)
        if scene.ball
        else p.createCollisionShape(p.GEOM_BOX, halfExtents=[scene.half] * 3)
    )
    body = p.createMultiBody(scene.mass, shape, basePosition=[0, 0, scene.half + scene.gap])
    p.changeDynamics(floor, -1, lateralFriction=1, restitution=1)
    p.changeDynamics(body, -1, lateralFriction=scene.mu, restitution=scene.e)
    p.changeDynamics(body, -1, linearDamping=0, angularDamping=0)
    p.resetBaseVelocity(body, [scene.speed, 0, 0])
    rows = []
    for _ in range(round(scene.duration / h)):
        p.stepSimulation()
        (x, _y, z), _ = p.getBasePositionAndOrientation(body)
        (vx, _vy, vz), _ = p.getBaseVelocity(body)
        rows.append((x, z, vx, vz))
    p.disconnect(client)
    return np.array(rows)


def pymunk_track(scene: CanonicalScene, h: float) -> Track:
    """Run a scene in pymunk, as a side view; both coefficients are products."""
    import pymunk

    space = pymunk.Space()
    space.gravity = scene.gravity[0], scene.gravity[2]
    space.collision_slop = 1e-5  # its default is a tenth of a metre
    floor = pymunk.Segment(space.static_body, (-50, 0), (50, 0), 0)
    floor.elasticity = floor.friction = 1
    body = pymunk.Body(scene.mass, scene.inertia)
    body.position, body.velocity = (0, scene.half + scene.gap), (scene.speed, 0)
    shape = (
        pymunk.Circle(body, scene.half)
        if scene.ball
        else pymunk.Poly.create_box(body, [2 * scene.half] * 2)
    )
    shape.elasticity, shape.friction = scene.e, scene.mu
    space.add(floor, body, shape)
    rows = []
    for _ in range(round(scene.duration / h)):
        space.step(h)
        rows.append((*body.position, *body.velocity))
    return np.array(rows)


def drake_track(scene: CanonicalScene, h: float) -> Track:
    """Run a scene in Drake's discrete plant with point contacts; settings are the plant's."""
    from pydrake.geometry import Box, HalfSpace, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.multibody.tree import SpatialInertia
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _graph = AddMultibodyPlantSceneGraph(builder, h)
    friction = CoulombFriction(scene.mu, scene.mu)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform(), HalfSpace(), "floor", friction
    )
    inertia = (
        SpatialInertia.SolidSphereWithMass(scene.mass, scene.half)
        if scene.ball
        else SpatialInertia.SolidBoxWithMass(scene.mass, *[2 * scene.half] * 3)
    )
    body = plant.AddRigidBody("body", inertia)
    shape = Sphere(scene.half) if scene.ball else Box(*[2 * scene.half] * 3)
    plant.RegisterCollisionGeometry(body, RigidTransform(), shape, "body", friction)
    plant.mutable_gravity_field().set_gravity_vector(list(scene.gravity))
    plant.Finalize()
    for name, value in scene.settings.items():
        getattr(plant, f"set_{name}")(value)
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    start = [1, 0, 0, 0, 0, 0, scene.half + scene.gap, 0, 0, 0, scene.speed, 0, 0]
    plant.SetPositionsAndVelocities(context, start)
    rows = []
    for k in range(round(scene.duration / h)):
        simulator.AdvanceTo((k + 1) * h)
        state = plant.GetPositionsAndVelocities(context)
        rows.append((state[4], state[6], state[10], state[12]))
    return np.array(rows)


def dart_world(gravity: Sequence[float], h: float) -> Any:
    """Return a new world of DART."""
    import dartpy as dart

    world = dart.simulation.World()
    world.setGravity(np.array(gravity))
    world.setTimeStep(h)
    return world


def dart_body(
    world: Any, shape: Any, place: Sequence[float], mass: float, mu: float, e: float = 0.0
) -> Any:
    """Return a new body with a shape; without mass it is fixed."""
    import dartpy as dart

    skeleton = dart.dynamics.Skeleton(f"body {world.getNumSkeletons()}")
    pair = (
        skeleton.createFreeJointAndBodyNodePair if mass else skeleton.createWeldJointAndBodyNodePair
    )
    joint, body = pair()
    node = body.createShapeNode(shape)
    node.createCollisionAspect()
    aspect = node.createDynamicsAspect()
    aspect.setFrictionCoeff(mu)
    aspect.setRestitutionCoeff(e)
    if mass:
        body.setInertia(dart.dynamics.Inertia(mass, np.zeros(3), shape.computeInertia(mass)))
    frame = dart.math.Isometry3()
    frame.set_translation(place)
    joint.setTransformFromParentBodyNode(frame)
    world.addSkeleton(skeleton)
    return body


def dart_track(scene: CanonicalScene, h: float) -> Track:
    """Run a scene in DART; friction is the smaller one, restitution the product."""
    import dartpy as dart

    world = dart_world(scene.gravity, h)
    dart_body(world, dart.dynamics.BoxShape([40, 40, 1]), (0, 0, -0.5), 0, scene.mu, 1.0)
    sphere, box = dart.dynamics.SphereShape, dart.dynamics.BoxShape
    shape = sphere(scene.half) if scene.ball else box([2 * scene.half] * 3)
    place = 0, 0, scene.half + scene.gap
    node = dart_body(world, shape, place, scene.mass, scene.mu, scene.e)
    node.getSkeleton().setVelocities([0, 0, 0, scene.speed, 0, 0])
    rows = []
    for _ in range(round(scene.duration / h)):
        world.step()
        x, _y, z = node.getWorldTransform().translation()
        vx, _vy, vz = node.getLinearVelocity()
        rows.append((x, z, vx, vz))
    return np.array(rows)


def sapien_world(gravity: Sequence[float], h: float) -> Any:
    """Return a new scene of SAPIEN."""
    import sapien

    config = sapien.physx.PhysxSceneConfig()
    config.gravity = np.array(gravity)
    sapien.physx.set_scene_config(config)
    world = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    world.set_timestep(h)
    return world


def sapien_track(scene: CanonicalScene, h: float) -> Track:
    """Run a scene in SAPIEN; both coefficients are means."""
    import sapien

    world = sapien_world(scene.gravity, h)
    material = sapien.physx.PhysxMaterial(scene.mu, scene.mu, scene.e)
    world.add_ground(0, render=False, material=material)
    builder = world.create_actor_builder()
    density = scene.mass / ((4 / 3 * math.pi if scene.ball else 8) * scene.half**3)
    if scene.ball:
        builder.add_sphere_collision(radius=scene.half, material=material, density=density)
    else:
        builder.add_box_collision(half_size=[scene.half] * 3, material=material, density=density)
    actor = builder.build()
    actor.set_pose(sapien.Pose([0, 0, scene.half + scene.gap]))
    body = actor.find_component_by_type(sapien.physx.PhysxRigidDynamicComponent)
    body.set_linear_velocity([scene.speed, 0, 0])
    body.linear_damping = body.angular_damping = 0.0
    rows = []
    for _ in range(round(scene.duration / h)):
        world.step()
        x, _y, z = actor.get_pose().p
        vx, _vy, vz = body.get_linear_velocity()
        rows.append((x, z, vx, vz))
    return np.array(rows, dtype=float)


def newton_track(scene: CanonicalScene, h: float) -> Track:
    """Run a scene in Newton with its XPBD solver; settings are the solver's."""
    import newton
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    with wp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder()
        config = newton.ModelBuilder.ShapeConfig(density=0, mu=scene.mu, restitution=scene.e)
        builder.add_ground_plane(cfg=config)
        inertia = wp.mat33(*(scene.inertia * np.eye(3)).ravel().tolist())
        body = builder.add_body(
            xform=wp.transform((0.0, 0.0, scene.half + scene.gap), wp.quat_identity()),
            mass=scene.mass,
            inertia=inertia,
        )
        if scene.ball:
            builder.add_shape_sphere(body, radius=scene.half, cfg=config)
        else:
            builder.add_shape_box(body, hx=scene.half, hy=scene.half, hz=scene.half, cfg=config)
        model = builder.finalize()
        model.set_gravity(scene.gravity)
        restitution = scene.e > 0
        solver = newton.solvers.SolverXPBD(model, enable_restitution=restitution, **scene.settings)
        state, next_state = model.state(), model.state()
        speed = np.zeros((1, 6), dtype=np.float32)
        speed[0, 0] = scene.speed
        state.body_qd.assign(speed)
        pipeline = newton.CollisionPipeline(model)
        contacts = pipeline.contacts()
        rows = []
        for _ in range(round(scene.duration / h)):
            state.clear_forces()
            pipeline.collide(state, contacts)
            solver.step(state, next_state, None, contacts, h)
            state, next_state = next_state, state
            q, v = state.body_q.numpy()[0], state.body_qd.numpy()[0]
            rows.append((q[0], q[2], v[0], v[2]))
    return np.array(rows, dtype=float)


LENGTH, RELEASE, LIMIT = 0.75, -1.1, 0.4
"""Length of a pendulum of `MASS`, m; release angle and joint limit, rad."""

LIMIT_SECONDS = 1.0
"""Duration of its swing to the limit and back."""

POINT = 0.01
"""Moment of inertia of the bob about its centre, kg m^2."""

LIMIT_SPEED = math.sqrt(
    2 * MASS * G * LENGTH / (MASS * LENGTH**2 + POINT) * (math.cos(LIMIT) - math.cos(RELEASE))
)
"""Exact speed at the limit, rad/s."""


def _rows(step: Callable[[], tuple[float, float]], h: float) -> Track:
    """Return angle and rate after each step, (S, 2)."""
    return np.array([step() for _ in range(round(LIMIT_SECONDS / h))], dtype=float)


def mjcf_pendulum(h: float, run: MjcfRun = run_mujoco) -> Track:
    """Swing to the limit as MJCF."""
    text = f"""<mujoco><option timestep="{h}" jacobian="dense"/><compiler angle="radian"/>
    <worldbody><body><joint axis="0 -1 0" limited="true" range="-3 {LIMIT}"/>
    <inertial pos="0 0 {-LENGTH}" mass="{MASS}" diaginertia="{POINT} {POINT} {POINT}"/>
    </body></worldbody></mujoco>"""
    return run(text, "qpos", RELEASE, round(LIMIT_SECONDS / h))


def pybullet_pendulum(h: float) -> Track:
    """Swing to the limit in PyBullet."""
    import pybullet as p

    client = bullet_world(p, (0, 0, -G), h)
    body = p.createMultiBody(
        0,
        linkMasses=[MASS],
        linkCollisionShapeIndices=[-1],
        linkVisualShapeIndices=[-1],
        linkPositions=[[0, 0, 0]],
        linkOrientations=[[0, 0, 0, 1]],
        linkInertialFramePositions=[[0, 0, -LENGTH]],
        linkInertialFrameOrientations=[[0, 0, 0, 1]],
        linkParentIndices=[0],
        linkJointTypes=[p.JOINT_REVOLUTE],
        linkJointAxis=[[0, -1, 0]],
    )
    p.changeDynamics(body, 0, localInertiaDiagonal=[POINT] * 3, jointDamping=0)
    p.changeDynamics(body, 0, linearDamping=0, angularDamping=0)
    p.changeDynamics(body, 0, jointLowerLimit=-3, jointUpperLimit=LIMIT)
    p.setJointMotorControl2(body, 0, p.VELOCITY_CONTROL, force=0)
    p.resetJointState(body, 0, RELEASE)

    def step() -> tuple[float, float]:
        p.stepSimulation()
        angle, rate, *_ = p.getJointState(body, 0)
        return angle, rate

    track = _rows(step, h)
    p.disconnect(client)
    return track


def pymunk_pendulum(h: float) -> Track:
    """Swing to the limit in pymunk."""
    import pymunk

    space = pymunk.Space()
    space.gravity = 0, -G
    body = pymunk.Body(MASS, POINT)
    body.angle = RELEASE
    body.position = LENGTH * math.sin(RELEASE), -LENGTH * math.cos(RELEASE)
    pivot = pymunk.PivotJoint(space.static_body, body, (0, 0))
    space.add(body, pivot, pymunk.RotaryLimitJoint(space.static_body, body, -3, LIMIT))

    def step() -> tuple[float, float]:
        space.step(h)
        return body.angle, body.angular_velocity

    return _rows(step, h)


def drake_pendulum(h: float) -> Track:
    """Swing to the limit in Drake's discrete plant."""
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import RevoluteJoint, SpatialInertia, UnitInertia
    from pydrake.systems.analysis import Simulator

    plant = MultibodyPlant(h)
    about = POINT / MASS + LENGTH**2
    unit = UnitInertia(about, about, POINT / MASS)
    body = plant.AddRigidBody("bob", SpatialInertia(MASS, [0, 0, -LENGTH], unit))
    axis = [0, -1, 0]
    joint = plant.AddJoint(
        RevoluteJoint("hinge", plant.world_frame(), body.body_frame(), axis, -3, LIMIT, 0)
    )
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -G])
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    joint.set_angle(context, RELEASE)

    def step() -> tuple[float, float]:
        simulator.AdvanceTo(context.get_time() + h)
        return joint.get_angle(context), joint.get_angular_rate(context)

    return _rows(step, h)


def dart_pendulum(h: float) -> Track:
    """Swing to the limit in DART."""
    import dartpy as dart

    world = dart_world((0, 0, -G), h)
    skeleton = dart.dynamics.Skeleton("pendulum")
    joint, body = skeleton.createRevoluteJointAndBodyNodePair()
    joint.setAxis([0, -1, 0])
    joint.setPositionLowerLimit(0, -3)
    joint.setPositionUpperLimit(0, LIMIT)
    joint.setLimitEnforcement(True)
    body.setInertia(dart.dynamics.Inertia(MASS, [0, 0, -LENGTH], POINT * np.eye(3)))
    skeleton.setPositions([RELEASE])
    world.addSkeleton(skeleton)

    def step() -> tuple[float, float]:
        world.step()
        return float(skeleton.getPositions()[0]), float(skeleton.getVelocities()[0])

    return _rows(step, h)


def sapien_pendulum(h: float) -> Track:
    """Swing to the limit in SAPIEN; its revolute joints turn about x."""
    import sapien

    scene = sapien_world((0, 0, -G), h)
    builder = scene.create_articulation_builder()
    root = builder.create_link_builder()
    root.set_mass_and_inertia(1.0, sapien.Pose(), [1.0, 1.0, 1.0])
    link = builder.create_link_builder(root)
    turned = sapien.Pose(q=[math.sqrt(0.5), 0, 0, -math.sqrt(0.5)])
    link.set_joint_properties("revolute", [[-3, LIMIT]], turned, turned, 0, 0)
    link.set_mass_and_inertia(MASS, sapien.Pose([0, 0, -LENGTH]), [POINT] * 3)
    pendulum = builder.build(fix_root_link=True)
    pendulum.set_qpos([RELEASE])
    for part in pendulum.get_links():
        part.linear_damping = part.angular_damping = 0.0

    def step() -> tuple[float, float]:
        scene.step()
        return float(pendulum.get_qpos()[0]), float(pendulum.get_qvel()[0])

    return _rows(step, h)


def newton_pendulum(h: float) -> Track:
    """Swing to the limit in Newton with its XPBD solver."""
    import newton
    import warp as wp

    with wp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder()
        inertia = wp.mat33(*(POINT * np.eye(3)).ravel().tolist())
        link = builder.add_link(mass=MASS, com=(0.0, 0.0, -LENGTH), inertia=inertia)
        joint = builder.add_joint_revolute(
            -1, link, axis=(0.0, -1.0, 0.0), limit_lower=-3.0, limit_upper=LIMIT
        )
        builder.add_articulation([joint])
        builder.joint_q[0] = RELEASE
        model = builder.finalize()
        solver = newton.solvers.SolverXPBD(model)
        states = [model.state(), model.state()]
        newton.eval_fk(model, model.joint_q, model.joint_qd, states[0])

        def step() -> tuple[float, float]:
            states[0].clear_forces()
            solver.step(*states, None, None, h)
            states.reverse()
            q, v = states[0].body_q.numpy()[0], states[0].body_qd.numpy()[0]
            return -2 * math.atan2(q[4], q[6]), -v[4]

        return _rows(step, h)


ENGINES: Mapping[str, tuple[Callable[[CanonicalScene, float], Track], float]] = {
    "mujoco": (mjcf_track, 1 / 500),
    "mjx": (partial(mjcf_track, run=run_mjx), 1 / 500),
    "newton": (newton_track, 1 / 600),
    "drake": (drake_track, 1 / 1000),
    "dart": (dart_track, 1 / 1000),
    "sapien": (sapien_track, 1 / 100),
    "pybullet": (pybullet_track, 1 / 240),
    "pymunk": (pymunk_track, 1 / 60),
}
"""Each engine with its default step, s, or the step of its own examples."""


def rebound(track: Track, h: float, scene: CanonicalScene) -> float:
    """Return the effective restitution: square root of the largest height after touch over gap."""
    z = track[:, 1] - scene.half
    until = round(1.2 * math.sqrt(2 * scene.gap / scene.g) / h)
    touched = int(np.argmin(z[:until]))
    return math.sqrt(max(float(z[touched:].max()), 0.0) / scene.gap)


def depth(track: Track, h: float, scene: CanonicalScene) -> float:
    """Return the penetration at rest, m."""
    return float(scene.half - track[-1, 1])


def creep(track: Track, h: float, scene: CanonicalScene) -> float:
    """Return the mean speed over the second half, m/s."""
    half = len(track) // 2
    return float((track[-1, 0] - track[half, 0]) / ((len(track) - 1 - half) * h))


def limit_rebound(track: Track) -> float:
    """Return the speed at which a pendulum leaves its limit over the exact speed of arrival."""
    angle, rate = track.T
    reached = int(np.argmax(angle > LIMIT - 0.02))
    back = (np.arange(len(angle)) > reached) & (angle < LIMIT) & (rate < 0)
    return float(-rate[np.argmax(back)]) / LIMIT_SPEED if back.any() else math.nan


def stop_error(track: Track, h: float, scene: CanonicalScene) -> float:
    """Return the relative error of the stop distance."""
    return float(track[-1, 0]) / (scene.speed**2 / (2 * scene.mu * scene.g)) - 1


Measure = Callable[[Track, float, CanonicalScene], float]

_DROPPED = CanonicalScene(ball=True, gap=DROP, e=RESTITUTION, duration=1.0)
_PUSHED = CanonicalScene(speed=SPEED, mu=MU)


def _creep_text(value: float) -> str:
    return f"{1e3 * value:.2g} mm/s" if abs(value) >= 1e-9 else "0"


PROBLEMS: Mapping[str, tuple[CanonicalScene, Measure, Callable[[float], str]]] = {
    "rebound, e = 0.8": (_DROPPED, rebound, "{:.3f}".format),
    "depth at rest": (CanonicalScene(), depth, lambda value: f"{1e6 * value:.3g} µm"),
    "creep on 20°": (CanonicalScene(slope=SLOPE), creep, _creep_text),
    "stop distance": (_PUSHED, stop_error, lambda value: f"{100 * value:+.2g} %"),
}
"""Scene, measure and number format by column header."""

PENDULUMS: Mapping[str, Callable[[float], Track]] = {
    "mujoco": mjcf_pendulum,
    "mjx": partial(mjcf_pendulum, run=run_mjx),
    "newton": newton_pendulum,
    "drake": drake_pendulum,
    "dart": dart_pendulum,
    "sapien": sapien_pendulum,
    "pybullet": pybullet_pendulum,
    "pymunk": pymunk_pendulum,
}
"""Pendulums that swing to a joint limit, by engine."""

EXACT = ("0.800", "0", "0", "0.680 m", "0")


def cells(engine: str) -> list[str]:
    """Return the cells of an engine's row: each quantity at its step and at a tenth of it."""
    run, step = ENGINES[engine]
    steps = step, step / 10
    rows = [
        [text(measure(run(scene, h), h, scene)) for h in steps]
        for scene, measure, text in PROBLEMS.values()
    ]
    rows.append([f"{limit_rebound(PENDULUMS[engine](h)):.3f}" for h in steps])
    return [" → ".join(dict.fromkeys(row)) for row in rows]


def main(names: list[str]) -> None:
    """Print the table with a row for each named engine."""
    heads = [*PROBLEMS, "rebound at a joint limit"]
    print(f"| engine | step | {' | '.join(heads)} |\n|{'---|' * (len(heads) + 2)}")
    print(f"| exact | - | {' | '.join(EXACT)} |")
    for name in names:
        step = f"{1e3 * ENGINES[name][1]:.3g} ms"
        print(f"| {name} | {step} | {' | '.join(cells(name))} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--engines", nargs="+", default=list(ENGINES), choices=list(ENGINES))
    parser.add_argument("--published", action="store_true", help="print the published tables")
    options = parser.parse_args()
    if options.published:
        from campaigns.published import print_table

        print_table(options.engines)
    else:
        main(options.engines)
