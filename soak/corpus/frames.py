"""Poses of bodies: wrong robots whose joint motions agree, and hostile frames.

Every folder has a frame on the block and a point next to it, in each format.
"""

from __future__ import annotations

from collections.abc import Iterator

from soak.corpus.entry import Build, CorpusEntry, chain_builds, replace_text, write_file
from soak.corpus.sound import MJCF, MJCF_SIDECAR, SPACE_SIDECAR, SYSTEM, URDF, URDF_SIDECAR

_SYSTEM = SYSTEM.replace("Output, Scenario", "Output, Pose, Scenario").replace(
    "    published=(),\n",
    """    published=(),
    frames=(
        Pose("block", (x.q, 0, 0), "the block", rotation=(1, 0, 0, 0)),
        Pose("tip", (x.q + 0.3, 0, 0.2), "a point of it"),
    ),
""",
)
_UP = "world = { origin = [0, 0, 1] }"
_MJCF = MJCF.replace("<inertial", '<site name="tip" pos="0.3 0 0.2"/>\n      <inertial', 1)
_SIDECARS = {
    "mujoco.xml": f'{MJCF_SIDECAR}\n[frames]\n{_UP}\nblock = "body:block"\ntip = "site:tip"\n',
    "robot.urdf": f'{URDF_SIDECAR}\n[frames]\n{_UP}\nblock = "link:block"\n'
    'tip = { is = "link:block", at = [0.3, 0, 0.2] }\n',
    "space.py": f'{SPACE_SIDECAR}\n[frames]\nworld = {{ axes = ["x", "z", "-y"] }}\n'
    'block = "body:block"\ntip = { is = "body:block", at = [0.3, 0.2, 0] }\n',
}
_TEXTS = {"mujoco.xml": _MJCF, "robot.urdf": URDF}
_MJCF_NAME, _URDF_NAME, _SPACE_NAME = _SIDECARS

_AXIS = ('axis="1 0 0"', 'axis="{}"')
_URDF_AXIS = ('<axis xyz="1 0 0"/>', '<axis xyz="{}"/>')
_MINUS = ("[bindings]", '[coordinates]\nx = "-x"\n[readback]\nx = "-x"\n\n[bindings]')
_QUARTER = "1.5707963267948966"

MODEL_CHANGES: dict[str, dict[str, tuple[tuple[str, str], ...]]] = {
    _MJCF_NAME: {
        "an axis turned round": ((_AXIS[0], _AXIS[1].format("-1 0 0")),),
        "the plane turned": ((_AXIS[0], _AXIS[1].format("0 1 0")),),
        "the plane tilted by 1e-6": ((_AXIS[0], _AXIS[1].format("1 0 1e-6")),),
        "the base moved": (('pos="0 0 1"', 'pos="0.5 0 1"'),),
        "the base raised by 1e-6": (('pos="0 0 1"', 'pos="0 0 1.000001"'),),
        "the body turned and its axis turned back": (
            ('pos="0 0 1"', f'pos="0 0 1" euler="0 0 {_QUARTER}"'),
            (_AXIS[0], _AXIS[1].format("0 -1 0")),
        ),
        "the site elsewhere": (('pos="0.3 0 0.2"', 'pos="0.3 0.1 0.2"'),),
        "the site off by 1e-6": (('pos="0.3 0 0.2"', 'pos="0.3 0 0.200001"'),),
    },
    _URDF_NAME: {
        "an axis turned round": ((_URDF_AXIS[0], _URDF_AXIS[1].format("-1 0 0")),),
        "the plane turned": ((_URDF_AXIS[0], _URDF_AXIS[1].format("0 1 0")),),
        "the base moved": (('<origin xyz="0 0 1"/>', '<origin xyz="0.5 0 1"/>'),),
        "the base raised by 1e-6": (('<origin xyz="0 0 1"/>', '<origin xyz="0 0 1.000001"/>'),),
        "the body turned and its axis turned back": (
            ('<origin xyz="0 0 1"/>', f'<origin xyz="0 0 1" rpy="0 0 {_QUARTER}"/>'),
            (_URDF_AXIS[0], _URDF_AXIS[1].format("0 -1 0")),
        ),
    },
    _SPACE_NAME: {},
}
"""Changes of a model file that leave every motion of the joint as it was."""

SIDECAR_CHANGES: dict[str, dict[str, tuple[tuple[str, str], ...]]] = {
    _MJCF_NAME: {
        "a sign taken back in the sidecar": (_MINUS,),
        "the world elsewhere": (("[0, 0, 1]", "[0, 0, 2]"),),
        "the world turned": (("{ origin", '{ axes = ["y", "-x", "z"], origin'),),
        "one frame for the other": (('"body:block"', '"site:tip"'),),
    },
    _URDF_NAME: {
        "a sign taken back in the sidecar": (_MINUS,),
        "the point elsewhere": (("[0.3, 0, 0.2]", "[0.3, 0, 0.200001]"),),
    },
    _SPACE_NAME: {
        "the world lies": (('["x", "z", "-y"]', '["x", "y", "z"]'),),
        "the point elsewhere": (("[0.3, 0.2, 0]", "[0.3, 0.3, 0]"),),
    },
}
"""Wrong poses in a sidecar, which leave every motion of the joint as it was."""

TABLES: dict[str, tuple[str, str]] = {
    "a frame that is not declared": ("block =", "rod ="),
    "a body that is not there": ("body:block", "body:nothing"),
    "a kind that is not there": ("body:block", "wheel:block"),
    "a body without a name": ("body:block", "body:"),
    "no kind": ("body:block", "block"),
    "a place of 100000 characters": ("body:block", f"body:{'b' * 100_000}"),
    "a place with a newline": ("body:block", "body:bl\\nock"),
    "a number": ('"body:block"', "1"),
    "a list": ('"body:block"', '["body:block"]'),
    "an empty table": ('"body:block"', "{}"),
    "an unknown key": ('"site:tip"', '{ is = "site:tip", colour = 1 }'),
    "at of two": ('"site:tip"', '{ is = "site:tip", at = [0, 0] }'),
    "at of nan": ('"site:tip"', '{ is = "site:tip", at = [0, 0, nan] }'),
    "at of inf": ('"site:tip"', '{ is = "site:tip", at = [0, 0, -inf] }'),
    "at of 400 digits": ('"site:tip"', f'{{ is = "site:tip", at = [0, 0, {"9" * 400}] }}'),
    "at of code": ('"site:tip"', "{ is = \"site:tip\", at = [0, 0, \"open('PWNED', 'w')\"] }"),
    "at of a tower of powers": ('"site:tip"', '{ is = "site:tip", at = [0, 0, "9**9**9"] }'),
    "at of a root of -1": ('"site:tip"', '{ is = "site:tip", at = [0, 0, "sqrt(-m)"] }'),
    "at of a coordinate": ('"site:tip"', '{ is = "site:tip", at = [0, 0, "x"] }'),
    "at of 100000 characters": (
        '"site:tip"',
        f'{{ is = "site:tip", at = [0, 0, "{"z" * 100_000}"] }}',
    ),
    "a world that is a text": ("{ origin = [0, 0, 1] }", '"up"'),
    "a world of nothing": ("{ origin = [0, 0, 1] }", "{}"),
    "a world of a mirror": ("{ origin", '{ axes = ["x", "y", "-z"], origin'),
    "a world of two axes": ("{ origin", '{ axes = ["x", "y"], origin'),
    "a world of one axis twice": ("{ origin", '{ axes = ["x", "x", "z"], origin'),
    "a world of axes of nan": ("{ origin", "{ axes = [[nan, 0, 0], [0, 1, 0], [0, 0, 1]], origin"),
    "a world that is stretched": ("{ origin", "{ axes = [[2, 0, 0], [0, 1, 0], [0, 0, 1]], origin"),
    "an axis of no name": ("{ origin", '{ axes = ["u", "y", "z"], origin'),
}
"""Hostile frames in the sidecar of an MJCF."""

DECLARED: dict[str, tuple[str, str]] = {
    "a position of nan": ("(x.q, 0, 0)", '(x.q, 0, float("nan"))'),
    "a position of inf": ("(x.q, 0, 0)", '(x.q, 0, float("inf"))'),
    "a complex position": ("(x.q, 0, 0)", "(x.q, 1j * m, 0)"),
    "a position of two": ("(x.q, 0, 0)", "(x.q, 0)"),
    "a position that is None": ("(x.q, 0, 0)", "None"),
    "a position of texts": ("(x.q, 0, 0)", "(\"open('PWNED', 'w')\", 0, 0)"),
    "a position by the velocity": ("(x.q, 0, 0)", "(x.v, 0, 0)"),
    "a position by the time": ("(x.q, 0, 0)", "(x.q * t, 0, 0)"),
    "a position of another unit": ("(x.q, 0, 0)", "(x.q * m, 0, 0)"),
    "a position with a pole": ("(x.q, 0, 0)", "(x.q, 0, x.q**2 / (x.q - x.q))"),
    "a rotation that stretches": ("(1, 0, 0, 0)", "(1, 1, 0, 0)"),
    "a rotation that mirrors": ("(1, 0, 0, 0)", "((1, 0, 0), (0, 1, 0), (0, 0, -1))"),
    "a rotation of nan": ("(1, 0, 0, 0)", '(float("nan"), 0, 0, 0)'),
    "a rotation of nothing": ("(1, 0, 0, 0)", "(0, 0, 0, 0)"),
    "a rotation of two rows": ("(1, 0, 0, 0)", "((1, 0, 0), (0, 1, 0))"),
    "a rotation that is a text": ("(1, 0, 0, 0)", "'up'"),
    "a name that is taken": ('Pose("tip"', 'Pose("block"'),
    "a name that is empty": ('Pose("tip"', 'Pose(""'),
    "a name that is no text": ('Pose("tip"', "Pose(7"),
    "the name of the world": ('Pose("tip"', 'Pose("world"'),
    "no description": ('"a point of it"', '""'),
    "no pose": ('Pose("tip", (x.q + 0.3, 0, 0.2), "a point of it")', "7"),
    "frames that are None": ("frames=(", "frames=None and ("),
}
"""Hostile frames in `system.py`."""


def with_frames(model: str, *changes: Build) -> Build:
    """Return a build that adds frames to the sound folder and then applies changes."""
    texts = [write_file("system.py", _SYSTEM), write_file(f"{model}.toml", _SIDECARS[model])]
    if model in _TEXTS:
        texts.append(write_file(model, _TEXTS[model]))
    return chain_builds(*texts, *changes)


def frame_entries() -> Iterator[CorpusEntry]:
    """Yield the entries on frames."""
    for model in _SIDECARS:
        yield CorpusEntry(f"right/frames in {model}", with_frames(model), model=model, codes=(0,))
        for file, changes in ((model, MODEL_CHANGES), (f"{model}.toml", SIDECAR_CHANGES)):
            for name, pairs in changes[model].items():
                build = with_frames(model, replace_text(file, *pairs))
                yield CorpusEntry(f"frames/{model}, {name}", build, model=model, codes=(1,))
    # Without frames, no joint motion distinguishes the axes.
    turned = replace_text(_MJCF_NAME, (_AXIS[0], _AXIS[1].format("-1 0 0")))
    both_signs = with_frames(_MJCF_NAME, turned, replace_text(f"{_MJCF_NAME}.toml", _MINUS))
    yield CorpusEntry("right/an axis and its sign turned round", both_signs, codes=(0,))
    yield CorpusEntry("right/an axis turned round, without frames", turned, codes=(0,))
    for name, change in TABLES.items():
        build = with_frames(_MJCF_NAME, replace_text(f"{_MJCF_NAME}.toml", change))
        yield CorpusEntry(f"frames/{name}", build, match=r"mujoco\.xml", codes=(1, 3))
    for name, change in DECLARED.items():
        build = with_frames(_MJCF_NAME, replace_text("system.py", change))
        yield CorpusEntry(f"frames/declared, {name}", build, match=r"system\.py")
