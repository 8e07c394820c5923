"""USD files that are wrong, or would fetch or grow without an end: refused by prim and line."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.usd import read
from tests.robots.files import tree_of
from tests.robots.usd import crate, edited

pytest.importorskip("pxr")

EXTRA = """PhysicsRevoluteJoint "extra"
    {
        rel physics:body0 = </arm/base>
        rel physics:body1 = </arm/lower>
    }
    def PhysicsFixedJoint "mount\""""
ELBOW, UP, MASS = 'PhysicsRevoluteJoint "elbow"', 'upAxis = "Z"', "float physics:mass = 1.5"
LAYER = 'upAxis = "Z"\n    subLayers = [@{}@]'.format
NO_LAYER, NAMED = "does not compose", "@no.usda@ of layer @arm.usda@"
MASS_LINE = "arm.usda:22: /arm/upper.physics:mass: "
EDITS = {
    "loop": ('PhysicsFixedJoint "mount"', EXTRA, "arm.usda:53: /arm/elbow: joint 'elbow' closes"),
    "wrong body": ("body1 = </arm/lower>", "body1 = </a>", "/arm/elbow.physics:body1: /a does not"),
    "one body": ("body1 = </arm/lower>", "body1 = </arm/upper>", "both ends are on the same body"),
    "two axes": (ELBOW, 'PhysicsJoint "elbow"', "/arm/elbow: a PhysicsJoint of these axes is not"),
    "distance": (ELBOW, 'PhysicsDistanceJoint "elbow"', "is not covered"),
    "URL": (UP, LAYER("https://h/a"), "arm.usda:7: refused: it names 'https://h/a', and nothing"),
    "outside": (UP, LAYER("../o.usda"), "arm.usda:7: refused: it names '../o.usda', outside of"),
    "missing layer": (UP, LAYER("no.usda"), f"{NO_LAYER}: Could not load sublayer {NAMED}"),
    "syntax": (MASS, "float physics:mass = ", "arm.usda:22: not a USD layer"),
    "cycle": ('Xform "arm" (', 'Xform "arm" (\n    references = @arm.usda@</arm>', NO_LAYER),
    "no body": ("PhysicsRigidBodyAPI", "NoAPI", "it has no rigid body"),
    "nan": (MASS, "float physics:mass = nan", MASS_LINE + "it is not a number"),
    "inf": (MASS, "float physics:mass = inf", MASS_LINE + "it is infinite"),
    "text": (MASS, 'string physics:mass = "1"', MASS_LINE + "it is a str, not a number"),
    "two": (MASS, "double[] physics:mass = [1, 2]", MASS_LINE + "it has 2 numbers"),
    "place": ("Pos0 = (0, 0, 0.25)", "Pos0 = (0, nan, 1)", "elbow.physics:localPos0: it is not a"),
    "axis": ('axis = "Y"', 'axis = "XY"', "it is 'XY', not X or Y or Z"),
}  # fmt: skip
LEVEL = 'def "l{}" {{' + "".join(
    f'def "c{k}" (references = </l{{}}>) {{{{}}}}\n' for k in range(10)
)
GROWS = "".join((LEVEL + "}}\n").format(i, *[i + 1] * 10) for i in range(9)) + 'def "l9" { }'
TEXTS = {
    "payload": ('def "a" (\n payload = @../o.usda@\n) { }', "arm.usda:3: refused: it names '../o."),
    "circle": ('def "a" (\n references = </a> ) { }', NO_LAYER),
    "units": ("(\n metersPerUnit = 0 )", "arm.usda: metersPerUnit is 0, and kilogramsPerUnit 1"),
    "growth": (GROWS, "arm.usda: refused: /l0 has more than 1000000 prims"),
    "bytes": ('def "a" { string x = "\xff" }', "not a USD layer: it has bytes that are not UTF-8"),
}  # fmt: skip
REFUSED = {name: (edited((old, new)), words) for name, (old, new, words) in EDITS.items()}
REFUSED |= {name: (f"#usda 1.0\n{text}", words) for name, (text, words) in TEXTS.items()}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_a_wrong_or_hostile_file_is_refused_by_its_place(
    text: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / "o.usda").write_text('#usda 1.0\ndef Xform "a"\n{\n}\n')
    (tmp_path / "in").mkdir()
    file = tmp_path / "in" / "arm.usda"
    file.write_bytes(text.encode("latin-1"))
    robot = read(file, {})
    assert robot.tree is None
    assert message in " ".join(map(str, robot.obstacles))
    if text == REFUSED["outside"][0]:
        assert read(file, {"allow_outside": True}).tree is not None


@pytest.mark.parametrize("size", [0, 8, 60, 500, 2000])
def test_a_crate_cut_short_is_refused(size: int, tmp_path: Path) -> None:
    whole, short = crate(tmp_path), tmp_path / "short.usdc"
    assert tree_of(read(whole, {})).dof == 2
    short.write_bytes(whole.read_bytes()[:size])
    assert read(short, {}).tree is None
