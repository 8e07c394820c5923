"""Mistakes that users make, as edits of the built-in model files, with their causes."""

from dataclasses import dataclass

Edits = tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes:
        name: what the user did.
        system: the built-in folder.
        model: model file.
        engine: the engine that runs the model.
        edits: (file, old text, new text); each old text occurs, and is replaced everywhere.
        causes: phrases of causes; any of them is correct.
        needs: edits before the mistake; with them alone the model is correct.
    """

    name: str
    system: str
    model: str
    engine: str
    edits: Edits
    causes: tuple[str, ...]
    needs: Edits = ()


XML, URDF, SPACE = "mujoco.xml", "robot.urdf", "space.py"
SETTINGS = "[settings]\n"


def xml(
    name: str, system: str, old: str, new: str, *causes: str, needs: Edits = (), model: str = XML
) -> Mistake:
    return Mistake(name, system, model, "mujoco", ((model, old, new),), causes, needs)


def urdf(
    name: str, system: str, old: str, new: str, *causes: str, engine: str = "pybullet"
) -> Mistake:
    return Mistake(name, system, URDF, engine, ((URDF, old, new),), causes)


def setting(name: str, system: str, line: str, *causes: str) -> Mistake:
    edit = (f"{URDF}.toml", SETTINGS, f"{SETTINGS}{line}\n")
    return Mistake(name, system, URDF, "pybullet", (edit,), causes)


def space(name: str, system: str, old: str, new: str, *causes: str) -> Mistake:
    return Mistake(name, system, SPACE, "pymunk", ((SPACE, old, new),), causes)


MSD, DISC = "mass_spring_damper", "torsional_disc"
FREE, DRUM, PENDULUM = "free_pair", "drum_pendulum", "simple_pendulum"

# The same pendulum with its frame drawn at 0.5 rad.
ROTATED_ZERO = (
    (XML, '<body name="pendulum" pos="0 0 1">',
     '<body name="pendulum" pos="0 0 1" quat="0.9689124217106447 0 -0.24740395925452294 0">'),
    (XML, 'axis="0 -1 0"', 'axis="0 -1 0" ref="0.5"'),
)  # fmt: skip
MISTAKES = (
    xml("damping left out", MSD, ' damping="0.9"', "", "c", "damping on x"),
    urdf("damping left out", MSD, 'damping="0.9"', 'damping="0"', "joint[x]/dynamics@damping"),
    xml("a rod's inertia about its end where its centre is meant", DRUM,
        '0.024 0.024', '0.096 0.096',
        "body[rod]/inertial@diaginertia[0], body[rod]/inertial@diaginertia[1]"),
    space("gravity off", DRUM, "space.gravity = (0, -GRAVITY)\n", "", "gravity along y"),
    xml("ref in degrees, for want of angle=radian", PENDULUM, 'angle="radian" ', "",
        "zero of theta", needs=ROTATED_ZERO),
    xml("a rest offset", MSD, 'springref="0"', 'springref="0.02"', "offset force on x"),
    xml("a soft equality with the default solref", DRUM,
        '\n           solref="1e-6 0.5" solimp="0.9999 0.9999 0.001 0.5 2"', "",
        "soft equality (solref, solimp)", model="mujoco_rolling.xml"),
    setting("PyBullet's damping left on", MSD, "link_damping = 0.04",
            "PyBullet's own damping of links"),
    setting("PyBullet's motors left on", MSD, "motors = true", "PyBullet's own motors"),
    space("Space.damping", MSD, "space.gravity = (0, 0)",
          "space.gravity = (0, 0)\n    space.damping = 0.9", "Space.damping"),
    Mistake("two constants exchanged", FREE, SPACE, "pymunk",
            ((SPACE, "MASS_1 = 1.1", "MASS_1 = 0.7"), (SPACE, "MASS_2 = 0.7", "MASS_2 = 1.1")),
            ("m1, m2 exchanged",)),
)  # fmt: skip

# A change of the error of a step, but not of the mechanism.
OTHER_STEP = space("error_bias left as it is", PENDULUM, "    rod.error_bias = 1e-10\n", "")

# Changes without effect.
NO_MISTAKES = (
    # The equations of a file for PyBullet leave out friction, as the engine does.
    urdf("friction, which PyBullet leaves out", MSD, 'friction="0"', 'friction="0.3"'),
)

# Mistakes that an engine would repair silently, with words of the error message.
REFUSED = (
    urdf("a rod's inertia about its end where its centre is meant", DRUM,
         'iyy="0.024"', 'iyy="0.096"', "'rod'", "violate the triangle inequality"),
    urdf("a moment of inertia left out", DISC, 'izz="0.021"', 'izz="0"', "'theta'",
         "moves nothing with inertia"),
    urdf("a mass left out", MSD, '<mass value="1.3"/>', '<mass value="0"/>', "'x'",
         "moves nothing with inertia"),
    urdf("the sign of a mass", MSD, '<mass value="1.3"/>', '<mass value="-1.3"/>',
         "mass of link 'mass' is below zero"),
)  # fmt: skip
