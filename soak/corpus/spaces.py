"""Hostile `space.py` files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from soak.corpus.entry import CorpusEntry, append_text, replace_text
from soak.corpus.odd_files import odd_files
from soak.corpus.systems import CODE, ENDLESS, HARMLESS, LIMITED

FILE = "space.py"
_NAMED = r"space\.py"
_BODY = 'block = pymunk.Body(MASS, float("inf"))'
_RETURN = 'return space, {"block": block}'

WITHIN = {
    "returns nothing": (_RETURN, "return None"),
    "returns the space alone": (_RETURN, "return space"),
    "returns bodies that are none": (_RETURN, 'return space, {"block": 1}'),
    "returns bodies of no name": (_RETURN, "return space, {1: block}"),
    "returns a body that is not in the space": (_RETURN, 'return space, {"block": pymunk.Body()}'),
    "returns another name": (_RETURN, 'return space, {"mass": block}'),
    "returns a list": (_RETURN, "return [space, block]"),
    "returns a space that is none": (_RETURN, 'return object(), {"block": block}'),
    "returns no body": (_RETURN, "return space, {}"),
    "wants an argument": ("def build():", "def build(space):"),
    "has no build": ("def build():", "def built():"),
    "a build that is a number": ("def build():", "build = 1\n\n\ndef built():"),
    "a build that yields": (_RETURN, 'yield space, {"block": block}'),
    "a build that waits": ("def build():", "async def build():"),
    "a mass of nan": (_BODY, 'block = pymunk.Body(float("nan"), float("inf"))'),
    "a mass of nothing": (_BODY, 'block = pymunk.Body(0, float("inf"))'),
    "a negative mass": (_BODY, 'block = pymunk.Body(-MASS, float("inf"))'),
    "a moment of nan": (_BODY, 'block = pymunk.Body(MASS, float("nan"))'),
    "a moment of nothing": (_BODY, "block = pymunk.Body(MASS, 0)"),
    "a body that stands": (_BODY, "block = pymunk.Body(body_type=pymunk.Body.STATIC)"),
    "a body on rails": (_BODY, "block = pymunk.Body(body_type=pymunk.Body.KINEMATIC)"),
    "starts at nan": (_RETURN, f'block.position = (float("nan"), 0)\n    {_RETURN}'),
    "gravity of nan": ("space.gravity = (0, 0)", 'space.gravity = (0, float("nan"))'),
    "gravity across": ("space.gravity = (0, 0)", "space.gravity = (0, -9.81)"),
    "a step of its own": (
        "space = pymunk.Space()",
        "class Own(pymunk.Space):\n        def step(self, dt):\n            super().step(dt)\n"
        "            self.bodies[0].velocity *= 0.999\n    space = Own()",
    ),
    "a callback after each step": (
        _RETURN,
        "space.add_post_step_callback(lambda s, k: None, 1)\n    " + _RETURN,
    ),
    "a velocity function": (
        _RETURN,
        "def own(body, gravity, damping, dt):\n"
        "        pymunk.Body.update_velocity(body, gravity, damping * 0.999, dt)\n"
        f"    block.velocity_func = own\n    {_RETURN}",
    ),
    "a velocity function that raises": (
        _RETURN,
        "def own(body, gravity, damping, dt):\n        raise KeyboardInterrupt\n"
        f"    block.velocity_func = own\n    {_RETURN}",
    ),
    "another body at each call": (
        "def build():\n",
        "CALLS = []\n\n\ndef build():\n    CALLS.append(0)\n    global STIFFNESS\n"
        "    STIFFNESS = 47.0 + len(CALLS)\n",
    ),
    "a shape in the way": (
        "space.add(block, spring)",
        "space.add(block, spring, pymunk.Circle(block, 1),"
        " pymunk.Segment(ground, (0, 0.5), (1, 0.5), 1))",
    ),
    "a damped space": ("space.gravity = (0, 0)", "space.gravity = (0, 0)\n    space.damping = 0.5"),
}  # fmt: skip


_entry = partial(CorpusEntry, model=FILE, match=_NAMED)


def space_entries() -> Iterator[CorpusEntry]:
    """Yield the `space.py` entries."""
    for name, code in CODE.items():
        if name.startswith(("deletes", "declares", "an unknown encoding")):
            continue
        yield _entry(f"space.py/{name}", append_text(FILE, f"\n{code}\n"))
        if not name.startswith(("no Python", "tabs", "a null")):
            inner = "\n".join(f"    {line}" for line in code.splitlines())
            start = "    space = pymunk.Space()"
            build = replace_text(FILE, (start, f"{inner}\n{start}"))
            yield _entry(f"space.py/build {name}", build)
    for name, code in HARMLESS.items():
        build = append_text(FILE, f"\n{code}\n")
        yield _entry(f"space.py/{name}", build, codes=(0,), match="")
    for name, change in WITHIN.items():
        may_agree = name in ("a callback after each step", "a body on rails", "a shape in the way")
        match, codes = ("", (0, 1, 3)) if may_agree else (_NAMED, (1, 3))
        yield _entry(f"space.py/{name}", replace_text(FILE, change), match=match, codes=codes)
    for name, code in ENDLESS.items():
        build = append_text(FILE, f"\n{code}\n")
        yield _entry(f"space.py/{name}", build, command=LIMITED, slow=True)
    for name, build in odd_files(FILE):
        yield _entry(f"space.py/{name}", build, codes=(1, 3))
