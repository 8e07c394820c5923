"""The shared base of adapters whose engines' own parsers read a subset of MJCF."""

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import place_names, rotation_names
from .mjcf_declared import declared_mjcf
from .mjcf_defaults import body_names
from .mjcf_refused import unread
from .mjcf_source import option_remarks
from .protocol import Array, Engine, EngineError, ModelSpec, Sample, Spring, clip_ranges
from .remark import Remark, friction_remark, limit_remarks
from .tree_model import TreeModel, Weight

ADDED: Mapping[str, bool] = MappingProxyType({
    # Whether elements that the engine leaves out are added: springs of joints, springs and dampers
    # of fixed tendons, and joint equalities.
    "springs": True, "tendons": True, "equalities": True,
    # Whether gravity compensation of bodies is added, as forces at their centres of mass.
    "gravcomp": True,
    # Whether actuators act, at held controls, under the setting `smooth`.
    "actuators": True,
    # Whether defaults are written into each element before the engine reads it; it loses some.
    "resolved": False,
})  # fmt: skip

NAMES = {
    "springs": "joints' springs",
    "tendons": "fixed tendons",
    "equalities": "joint equalities",
    "gravcomp": "gravity compensation",
}

URDF_ONLY = ("floating", "hold_mimics", "trimmed_numbers", "weightless_links", "rotors")
"""Settings for facts that an MJCF states itself."""

MJCF_NON_PHYSICAL: Mapping[str, str] = MappingProxyType(
    {
        r".*/keyframe/.*": "keyframes",
        r".*/sensor/.*": "sensors",
        r".*/(light|camera)@.*|.*@(rgba|group)|mujoco/(visual|statistic)[/@].*": "visual geometry",
        r".*/asset/(texture|material|skin)[/@].*|.*/material@.*": "visual geometry",
        r".*/(spatial|fixed|tendon|default)@width": "visual geometry",
        r".*/joint@(range|margin|solreflimit|solimplimit)": "joint limits",
        r".*/(spatial|fixed|tendon)@(range|margin|solreflimit|solimplimit)": "tendon limits",
        r".*@(frictionloss|solreffriction|solimpfriction)": "dry friction",
        r".*@(ctrl|force|act|actuatorfrc|inherit|length)range": "actuator limits",
        r".*/geom@(friction|solref|solimp|solmix|margin|gap|condim|contype|conaffinity|priority)"
        r"|.*/contact/.*|.*/(pair|exclude)@.*": "contact parameters",
        r".*/geom@.*|.*/asset/.*|.*/(mesh|hfield)@.*": "collision and visual shapes",
        r".*/replicate@.*": "replicated elements",
        r".*/site@(size|fromto)": "sites",
        r".*/equality@.*|.*/equality/.*@(solref|solimp)": "softness of equalities",
        r".*/equality/(connect|weld|flex\w*)@.*": "loops",
        r".*/equality/.*": "equalities",
        r".*/(muscle|adhesion)@.*": "muscles and adhesion",
        r".*/plugin[/@].*": "plugins",
        r".*/option@timestep": "time step",
        r".*/option@(.*iterations|.*tolerance|impratio|o_.*)": "solver settings",
        r".*/size@.*": "memory sizes",
        r".*@user|.*/custom/.*": "user data",
    }
)
"""Numbers of an MJCF that need not affect a smooth motion, by purpose."""

_SAMPLE = """<mujoco><option timestep="0.004"{options}/><compiler angle="radian"/><worldbody>
<body><joint name="q1" type="slide" axis="1 0 0" stiffness="50" damping="1.5"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
<body><joint name="q2" type="hinge" axis="0 -1 0" damping="0.1"{armature}/>
<inertial pos="0 0 -0.5" mass="0.7" diaginertia="0.01 0.01 0.01"/></body>
</worldbody><tendon><fixed stiffness="30" damping="0.4" springlength="0">
<joint joint="q1" coef="-1"/><joint joint="q2" coef="1"/></fixed></tendon></mujoco>
"""


def sample_mjcf(
    name: str = "sample", options: str = "", armature: str = ' armature="0.02"'
) -> Sample:
    """Return two bodies on the ground, with a spring and a damper between them."""
    return Sample(file=f"{name}.xml", text=_SAMPLE.format(options=options, armature=armature))


class MjcfModel(TreeModel):
    """An MJCF in an engine; a subclass loads it and creates the `stepper`.

    Args:
        spec: the file, with step and gravity among its settings.
        title: of the engine.
        defaults: of its settings.
        ignored_options: attributes of `<option>` that its parser ignores.
        compiler: another engine, for inertias that its parser can't compute, or None.

    Attributes:
        declared: the parsed file.
        resolved: whether defaults are written into each element before the engine reads it.
        lifts: gravity compensation that is added: body's name, centre (m), mass (kg).
        misread: whether the engine loses some of the file's defaults; set by a subclass.
        drawn: coordinates of floating bodies in the drawn configuration, (6,) each, by joint.
        no_fromto: shapes whose `fromto` its parser ignores.
    """

    no_fromto: frozenset[str] = frozenset()

    def __init__(
        self,
        spec: ModelSpec,
        title: str,
        defaults: Mapping[str, float | bool | str],
        ignored_options: frozenset[str],
        compiler: Engine | None,
    ) -> None:
        super().__init__(spec, title, {**defaults, **spec.settings})
        for key in URDF_ONLY:
            if spec.settings.get(key):
                raise EngineError(f"{spec.path}.toml: {title}'s adapter takes {key} only for URDFs")
        self._ignored_options, self.misread = ignored_options, False
        self.declared = declared_mjcf(spec, title, compiler, self.no_fromto)
        self._compiler = compiler.title if compiler and self.declared.inertias else ""
        several = len(self.declared.source.root.findall("default")) > 1
        self.resolved = several or bool(self.settings["resolved"])
        self.floats = bool(self.declared.frees)
        self.drawn: dict[str, Array] = {}
        there = {
            "springs": self.declared.springs or any(one.stiffness for one in self.declared.frees),
            "tendons": self.declared.tendons,
            "equalities": self.declared.mimics,
            "gravcomp": self.declared.lifts,
        }
        self.lost = {
            f"{title}'s leaving out of {NAMES[key]}": key
            for key, things in there.items()
            if things and not self.settings[key]
        }
        self.mimics = self.declared.mimics if self.settings["equalities"] else ()
        names = body_names(self.declared.source)
        self.lifts = tuple(
            Weight(body=names[actuator.body], centre=actuator.centre, mass=actuator.mass)
            for actuator in (self.declared.lifts if self.settings["gravcomp"] else ())
        )
        self.springs = (
            *(self.declared.springs if self.settings["springs"] else ()),
            *(self.declared.tendons if self.settings["tendons"] else ()),
            *(
                Spring(actuator.joints, actuator.stiffness, actuator.damping, 0.0)
                for actuator in self.declared.actuators
                if actuator.stiffness or actuator.damping
            ),
        )
        pushes: dict[str, float] = {}
        for actuator in self.declared.actuators:
            for name, by in actuator.joints.items():
                pushes[name] = pushes.get(name, 0.0) + by * actuator.force
        self.pushes = pushes

    @property
    def home(self) -> Array:
        """Positions of the drawn configuration."""
        refs = {one.name: one.ref for one in self.declared.singles}
        for name, drawn in self.drawn.items():
            refs.update(zip((*place_names(name), *rotation_names(name)), drawn, strict=True))
        return np.array([refs[name] for name in self.coordinates])

    @property
    def frees(self) -> tuple[str, ...]:
        """Names of free joints."""
        return tuple(one.name for one in self.declared.frees)

    @property
    def stated_limits(self) -> Array:
        """Position limits of the file, (nz, 2); infinite for joints without one."""
        bounds = np.tile([-np.inf, np.inf], (len(self.coordinates), 1))
        for joint in self.declared.singles:
            bounds[self.coordinates.index(joint.name)] = joint.limits
        return bounds

    @property
    def sampling_range(self) -> Array:
        """Sampling range around home, within the file's limits."""
        return clip_ranges(super().sampling_range + self.home[:, None], self.stated_limits)

    @property
    def lost_settings(self) -> dict[str, Mapping[str, object]]:
        """Elements that the engine leaves out under the current settings, with corrections."""
        settings = {cause: {key: True} for cause, key in self.lost.items()}
        return (
            {**settings, self._defaults_cause: {"resolved": True}} if self.misread else {**settings}
        )

    @property
    def reservations(self) -> tuple[str, ...]:
        """Notes on inertias that another engine has computed."""
        count = len(self.declared.inertias)
        if not count:
            return ()
        bodies = "1 body is" if count == 1 else f"{count} bodies are"
        return (f"the inertia of {bodies} as {self._compiler} compiles the file",)

    @property
    def _defaults_cause(self) -> str:
        """The cause that a diagnosis reports."""
        return f"{self.title}'s own reading of defaults"

    def _merged_elements(self) -> Iterator[str]:
        """Yield how elements are combined in the copy."""
        for tag, how in (("compiler", "are merged"), ("default", "are written into each element")):
            count = len(self.declared.source.root.findall(tag))
            if count > 1:
                yield f"{count} <{tag}> elements {how} before it reads the file"

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield elements that the engine ignores or leaves out, and limits that the motion
        reaches.
        """
        yield from option_remarks(self.declared.source, self.title, self._ignored_options)
        yield from (Remark(message=f"{self.title}: {joint}") for joint in self.reservations)
        yield from (Remark(message=f"{self.title}: {joint}") for joint in self._merged_elements())
        for element, what in unread(self.declared.source):
            file, line = element.place
            yield Remark(kind="ignored", message=f"{file}:{line}: {self.title} ignores {what}")
        for cause, key in self.lost.items():
            address = f"sidecar:settings.{key}"
            yield Remark(
                kind="setting", message=f"{cause}, by a setting", fault=True, address=address
            )
        if self.misread:
            message = f"{self._defaults_cause}: it loses numbers that classes give joints or geoms"
            yield Remark(kind="ignored", message=message, fault=True, address="mujoco/default")
        stops = self.limits
        for joint in self.declared.singles:
            i, address = self.coordinates.index(joint.name), f"body/joint[{joint.name}]"
            if joint.friction and not self.settings["smooth"]:
                place = f"{address}@frictionloss"
                yield friction_remark("frictionloss", joint.name, joint.friction, self.title, place)
            if np.isfinite(stops[i]).any():
                yield from limit_remarks(
                    joint.name,
                    bounds=(float(stops[i, 0]), float(stops[i, 1])),
                    reached=(float(z[:, i].min()), float(z[:, i].max())),
                    address=f"{address}@range",
                )
