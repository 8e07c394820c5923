"""An SDFormat file for engines: one model, its links and joints, and remarks about it."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.sdf.read import SdfFile, read_sdf
from .protocol import Array, EngineError, Sample
from .remark import Remark, friction_remark, limit_remarks
from .source import read_document, refuse_problems
from .urdf import UrdfReader


def load_sdf(path: Path, model: object = "") -> SdfFile:
    """Read an SDFormat file, as tolerantly as engines do.

    Args:
        path: of the file.
        model: the setting that selects one of several moving models; empty for a single one.

    Raises:
        EngineError: for an invalid, ambiguous or unsupported file; names file, line and remedy.
    """
    if not isinstance(model, str):
        raise EngineError(f"{path}.toml: [settings] model is {model!r}; expected a name")
    document = read_document(path)
    file = read_sdf(document, model)
    refuse_problems(document, unsupported=True)
    assert file is not None  # without a model there is a problem
    return file


def number(element: XmlElement, tag: str, default: float) -> float:
    """Return the number of a child that has been checked."""
    text = element.findtext(tag)
    return float(text) if text.strip() else default


def sdf_remarks(
    file: SdfFile, reader: UrdfReader, joints: Sequence[str], z: Array, w: Array
) -> Iterator[Remark]:
    """Yield remarks about an SDFormat file along the states (z, w) of its joints."""
    for name, link in file.links.items():
        if link.element.find("inertial") is None:
            yield Remark(
                kind="inertial",
                message=(
                    f"link {name} has no <inertial>: the format, and {reader.name}, use "
                    "1 kg and 1 kg m^2"
                ),
                address=f"model/link[{name}]",
            )
    for i, name in enumerate(joints):
        joint = file.joints.get(name)
        if joint is None:
            continue
        limits = None if joint.joint is None else joint.joint.limits
        if limits and limits[0] < limits[1] and not reader.no_stops:
            yield from limit_remarks(
                name,
                bounds=limits,
                reached=(float(z[:, i].min()), float(z[:, i].max())),
                address=f"model/joint[{name}]",
            )
        if joint.friction and reader.no_friction:
            place = f"joint[{name}]/axis/dynamics/friction"
            yield friction_remark("<friction>", name, joint.friction, reader.no_friction, place)


SDF_NON_PHYSICAL: Mapping[str, str] = MappingProxyType(
    {
        r".*/(visual|material|light|scene|gui)/.*": "visual geometry",
        r".*/collision/(.*/)?surface/.*": "contact parameters",
        r".*/collision/.*": "collision shapes",
        r".*/limit/(lower|upper)": "joint limits",
        r".*/limit/velocity": "velocity limits",
        r".*/limit/effort": "actuator limits",
        r".*/limit/.*": "softness of joint limits",
        r".*/dynamics/friction": "dry friction",
        r".*/sensor/.*": "sensors",
        r".*/plugin/.*": "plugins",
        r"sdf@version": "format version",
        r".*/physics/(max_step_size|real_time.*)": "time step",
        r".*/physics/.*": "solver settings",
    }
)
"""Numbers of an SDFormat file that need not affect a smooth motion, by purpose."""

_INERTIA = "<inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia>"
_SAMPLE = f"""<sdf version="1.6"><world name="here"><gravity>0 0 -9.81</gravity>
<physics name="slow" type="ode"><max_step_size>0.004</max_step_size></physics>
<model name="sample">
<link name="a"><inertial><mass>2</mass>{_INERTIA}</inertial></link>
<link name="b"><pose>0 0 0.1 0 0 0</pose><inertial><pose>0 0 -0.5 0 0 0</pose><mass>0.7</mass>
{_INERTIA}</inertial></link>
<joint name="q1" type="prismatic"><parent>world</parent><child>a</child><axis><xyz>1 0 0</xyz>
<limit><lower>-1e16</lower><upper>1e16</upper></limit><dynamics><damping>1.5</damping></dynamics>
</axis></joint>
<joint name="q2" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 -1 0</xyz>
<limit><lower>-1e16</lower><upper>1e16</upper></limit><dynamics><damping>0.1</damping></dynamics>
</axis></joint></model></world></sdf>
"""


def sample_sdf() -> Sample:
    """Return a pendulum on a damped slide, with its own step and gravity."""
    return Sample(file="sample.sdf", text=_SAMPLE)
