"""USD files that would fetch, grow without an end, or state no numbers: named by line."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.readers import read_robot
from tests.robots.usd import edited

pytest.importorskip("pxr")

LEVEL = 'def "l{}" {{' + "".join(
    f'def "c{k}" (references = </l{{}}>) {{{{}}}}\n' for k in range(10)
)
LEVEL += "}}\n"
GROWS = "".join(LEVEL.format(i, *[i + 1] * 10) for i in range(9)) + 'def "l9" { }'


def refusal(folder: Path, data: bytes) -> str:
    (folder / "asset").mkdir()
    (folder / "secret.usda").write_text('#usda 1.0\ndef "secret" { }\n')
    file = folder / "asset" / "arm.usda"
    file.write_bytes(data)
    robot = read_robot(file)
    assert robot.tree is None
    return str(robot.obstacles[0]).replace(str(file.parent) + "/", "")


@pytest.mark.parametrize(("text", "words"), [
    ('def "a" (\n references = @https://h/x@\n) { }', "arm.usda:3: refused: it names 'https:"),
    ('def "a" (\n payload = @../secret.usda@\n) { }', "arm.usda:3: refused: it names '../secret."),
    ('def "a" ( references = @arm.usda@</a> ) { }', "arm.usda: does not compose: "),
    ('def "a" (\n references = </a> ) { }', "arm.usda: does not compose: "),
    ("(\n metersPerUnit = 0 )", "arm.usda: metersPerUnit is 0, and kilogramsPerUnit 1"),
    (GROWS, "arm.usda: refused: /l0 has more than 1000000 prims"),
    ('def "a" {\n  float x = \n}', "arm.usda:3: not a USD layer: "),
    ('def "a" { string x = "\xff" }', "arm.usda: not a USD layer: it has bytes that are not UTF-8"),
])  # fmt: skip
def test_refuses_a_layer_before_it_composes(tmp_path: Path, text: str, words: str) -> None:
    assert refusal(tmp_path, b"#usda 1.0\n" + text.encode("latin-1")).startswith(words)


@pytest.mark.parametrize(("old", "new", "words"), [
    ("mass = 1.5", "mass = nan", "it is not a number"),
    ("mass = 1.5", "mass = inf", "it is infinite"),
    ("float physics:mass = 1.5", 'string physics:mass = "1"', "it is a str, not a number"),
    ("float physics:mass = 1.5", "double[] physics:mass = [1, 2]", "it has 2 numbers"),
    ("Pos0 = (0, 0, 0.25)", "Pos0 = (0, nan, 0.25)", "it is not a number"),
    ('axis = "Y"', 'axis = "XY"', "it is 'XY', not X or Y or Z"),
])  # fmt: skip
def test_names_the_prim_and_line_of_a_wrong_value(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    text = edited((old, new))
    line = text[: text.index(new)].count("\n") + 1
    message = refusal(tmp_path, text.encode())
    assert message.startswith(f"arm.usda:{line}: /arm/")
    assert words in message
