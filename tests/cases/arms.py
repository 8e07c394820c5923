"""A robot arm with two joints, written by hand, whose equations are long."""

from physics_crosscheck import (
    Constant,
    Coordinate,
    Equilibrium,
    Input,
    Output,
    Scenario,
    System,
    ground,
)


def _constant(name: str, value: float, unit: str) -> Constant:
    return Constant(name, value, unit, f"{name} of a test", "chosen for the test")


def arm() -> System:
    """Declare a turning shoulder and a link on a slanted hinge, each with a full inertia."""
    pan = Coordinate("pan", "rad", "angle of the shoulder")
    lift = Coordinate("lift", "rad", "angle of the link")
    names = ("xx", "yy", "zz", "xy", "xz", "yz")
    sizes = (0.021, 0.018, 0.009, 0.001, -0.002, 0.0015)
    first, second = (
        tuple(_constant(f"{body}_i{n}", v, "kg*m^2") for n, v in zip(names, sizes, strict=True))
        for body in ("shoulder", "link")
    )
    masses = _constant("shoulder_mass", 2.1, "kg"), _constant("link_mass", 1.3, "kg")
    x, y, z = (_constant(f"link_{n}", v, "m") for n, v in (("x", 0.03), ("y", 0.02), ("z", -0.2)))
    offset, slant = _constant("reach", 0.05, "m"), _constant("slant", 0.25, "rad")
    stiffness, g = _constant("stiffness", 3.5, "N*m/rad"), _constant("g", 9.81, "m/s^2")
    friction = _constant("friction", 0.4, "N*m*s/rad")
    turned = ground.hinge(pan, about=(0, 0, 1))
    hung = turned.at(offset, 0, 0).turned((0, 1, 0), slant).hinge(lift, about=(1, 0, 0)).at(x, y, z)
    torque = Input("torque", "N*m", "drives the link", on={lift: 1})
    return System(
        name="arm",
        title="Arm of two joints",
        source="a test",
        coordinates=(pan, lift),
        constants=(*first, *second, *masses, x, y, z, offset, slant, stiffness, g, friction),
        inputs=(torque,),
        outputs=(Output("lift", lift.q, "rad", "angle of the link"),),
        T=turned.kinetic(masses[0], first[:3], first[3:])
        + hung.kinetic(masses[1], second[:3], second[3:]),
        V=hung.weight(masses[1], (0, 0, -g)) + stiffness * pan.q**2 / 2,
        D=friction * (pan.v**2 + lift.v**2) / 2,
        equilibria=(Equilibrium("rest", {pan: 0, lift: 0.1}, True, "where it hangs"),),
        scenarios=(
            Scenario(
                "free",
                "released",
                q={pan: 0.3, lift: 0.4},
                v={pan: 0, lift: 0},
                inputs={torque: 0},
                duration=2.0,
            ),
        ),
        published=(),
    )
