"""Hostile sidecars."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from soak.corpus.entry import Build, CorpusEntry, append_text, replace_text, write_file
from soak.corpus.odd_files import odd_files

FILE = "mujoco.xml.toml"
_NAMED = r"mujoco\.xml\.toml"
_ENGINES = 'engines = ["mujoco"]'

TEXTS: dict[str, str | bytes] = {
    "no TOML": "engines = [",
    "a merge's marks": "<<<<<<< HEAD\nengines = ['mujoco']\n",
    "engines twice": 'engines = ["mujoco"]\nengines = ["mujoco"]\n',
    "engines missing": "[bindings]\n",
    "engines empty": "engines = []\n",
    "engines a text": 'engines = "mujoco"\n',
    "engines numbers": "engines = [1]\n",
    "engines tables": "engines = [{}]\n",
    "engines nested": 'engines = [["mujoco"]]\n',
    "an unknown engine": 'engines = ["havok"]\n',
    "an engine with a path": 'engines = ["../mujoco"]\n',
    "an engine with a newline": 'engines = ["mu\\njoco"]\n',
    "an engine without a name": 'engines = [""]\n',
    "an unknown key": 'engines = ["mujoco"]\nmotors = 1\n',
    "an unknown key that is long": f'engines = ["mujoco"]\n{"x" * 100_000} = 1\n',
    "a key with a newline": 'engines = ["mujoco"]\n"a\\nb" = 1\n',
    "an integer of 400 digits": f'engines = ["mujoco"]\n[settings]\nstep = {"9" * 400}\n',
    "an integer of 5000 digits": f'engines = ["mujoco"]\n[settings]\nstep = {"9" * 5000}\n',
    "a hexadecimal of 5000 digits": f'engines = ["mujoco"]\n[settings]\nstep = 0x{"f" * 5000}\n',
    "nested 5000 deep": f'engines = ["mujoco"]\n[settings]\nstep = {"[" * 5000}{"]" * 5000}\n',
    "tables nested 5000 deep": 'engines = ["mujoco"]\n[settings]\nstep = ' + "{a=" * 5000,
    "a key of 5000 parts": f'engines = ["mujoco"]\n[settings.{".".join("a" * 5000)}]\nb = 1\n',
    "half a character": b'engines = ["\xed\xa0\x80"]\n',
    "no UTF-8": b'engines = ["\xff"]\n',
    "a null byte": b'engines = ["mujoco"]\0\n',
    "frames a number": 'engines = ["mujoco"]\nframes = 1\n',
    "frames a list": 'engines = ["mujoco"]\nframes = ["body:block"]\n',
    "settings a number": 'engines = ["mujoco"]\nsettings = 1\n',
    "settings of another engine": 'engines = ["mujoco"]\n[settings.pymunk]\nstep = 0.1\n',
    "a spring that is a table": 'engines = ["mujoco"]\n[spring]\nstiffness = 1\n',
    "a spring that is a number": 'engines = ["mujoco"]\nspring = [1]\n',
}  # fmt: skip

SETTINGS = {
    "a step of 0": "step = 0",
    "a negative step": "step = -0.002",
    "a step of nan": "step = nan",
    "a step of inf": "step = inf",
    "a step of 1e30": "step = 1e30",
    "a step of 1e-30": "step = 1e-30",
    "a step longer than the motion": "step = 3.0",
    "a step that is a text": 'step = "0.002"',
    "a step that is true": "step = true",
    "a step that is a date": "step = 1979-05-27",
    "a step that is a list": "step = [0.002]",
    "gravity of nan": "gravity = [0, 0, nan]",
    "gravity of inf": "gravity = [0, 0, inf]",
    "gravity of two numbers": "gravity = [0, 0]",
    "gravity of texts": 'gravity = ["0", "0", "-9.81"]',
    "gravity of 400 digits": f"gravity = [0, 0, -{'9' * 400}]",
    "an unknown integrator": 'integrator = "Verlet"',
    "an integrator that is a number": "integrator = 4",
    "an integrator that is code": "integrator = \"__import__('os')\"",
    "an unknown setting": "colour = 1",
    "a setting that is code": '"__class__" = 1',
}

SPRINGS = {
    "without joints": "joints = {}\nstiffness = 1\ndamping = 0\nrest = 0",
    "of a field too few": "joints = {x = 1}\nstiffness = 1\ndamping = 0",
    "of a field too many": "joints = {x = 1}\nstiffness = 1\ndamping = 0\nrest = 0\nmass = 1",
    "of nan": "joints = {x = 1}\nstiffness = nan\ndamping = 0\nrest = 0",
    "of inf": "joints = {x = inf}\nstiffness = 1\ndamping = 0\nrest = 0",
    "of texts": 'joints = {x = "1"}\nstiffness = 1\ndamping = 0\nrest = 0',
    "of 400 digits": f"joints = {{x = 1}}\nstiffness = {'9' * 400}\ndamping = 0\nrest = 0",
    "on no joint": "joints = {y = 1}\nstiffness = 1\ndamping = 0\nrest = 0",
    "beside an MJCF": "joints = {x = 1}\nstiffness = 1\ndamping = 0\nrest = 0",
}

HOSTILE_EXPRESSIONS = {
    "code": "__import__('os').system('touch PWNED')",
    "code that opens": "open('PWNED', 'w')",
    "an attribute": "x.__class__",
    "a lambda": "(lambda: 0)()",
    "a comprehension": "[0 for _ in (0,)][0]",
    "a string": "'x'",
    "a walrus": "(y := 1)",
    "an f-string": "f'{x}'",
    "a tower of powers": "9**9**9",
    "a negative tower": "x * 2**-9**9**9",
    "x over nothing": "x / 0",
    "nothing over nothing": "0 / 0",
    "the logarithm of nothing": "x + log(0)",
    "an arcsine beyond 1": "x + asin(2)",
    "the root of -1": "x * sqrt(-1)",
    "an unknown name": "y",
    "an unknown function": "sinh(x)",
    "a function of too many": "sin(x, x)",
    "a function of none": "x + sin()",
    "a keyword": "sin(x, evaluate=False)",
    "empty": "",
    "blank": "   ",
    "two lines": "x\\nx",
    "a null byte": "x\\u0000",
    "brackets without end": "(" * 3000,
    "brackets 3000 deep": "(" * 3000 + "x" + ")" * 3000,
    "signs 5000 deep": "-" * 5000 + "x",
    "a sum of 20000": "+".join(["x"] * 20_000),
    "an exponent of 400 digits": "x * 1e" + "9" * 400,
    "an integer of 5000 digits": "x * " + "9" * 5000,
    "a complex number": "x + 1j",
    "True": "True",
    "an ellipsis": "...",
    "a power of the wrong sign": "x ^ 2",
    "a comparison": "x < 1",
    "a digit of another script": "x * \u0663",
    "an infinite number": "x * 1e999",
}
"""Invalid expressions for a coordinate, the readback or a binding."""

ADDRESSES = {
    "of nothing": "",
    "of no element": "joint[y]@stiffness",
    "of no attribute": "joint[x]@colour",
    "of no number": "joint[x]@type",
    "of no component": "body[block]/inertial@pos[9]",
    "of a component of 400 digits": f"option@gravity[{'9' * 400}]",
    "of a component of 5000 digits": f"option@gravity[{'9' * 5000}]",
    "of several": "body[block]/inertial@pos",
    "of no grammar": "]][[@@",
    "with a newline": "joint[x\\n]@stiffness",
    "of 100000 characters": "a" * 100_000,
    "of the sidecar's nothing": "sidecar:settings.step",
    "of the sidecar's text": "sidecar:engines[0]",
    "of the sidecar's 400 digits": f"sidecar:engines[{'9' * 400}]",
    "twice the same": "mujoco/worldbody/body[block]/joint[x]@stiffness",
}


_entry = partial(CorpusEntry, match=r"mujoco\.xml", codes=(1, 3))


def sidecar_entries() -> Iterator[CorpusEntry]:
    """Yield the sidecar entries."""
    for name, text in TEXTS.items():
        yield CorpusEntry(f"sidecar/{name}", write_file(FILE, text), match=_NAMED)
    for name, line in SETTINGS.items():
        build = replace_text(FILE, (_ENGINES, f"{_ENGINES}\n[settings]\n{line}"))
        yield _entry(f"sidecar/settings/{name}", build)
    for name, text in SPRINGS.items():
        build = append_text(FILE, f"\n[[spring]]\n{text}\n")
        yield CorpusEntry(f"sidecar/spring/{name}", build, match=_NAMED)
    for name, text in HOSTILE_EXPRESSIONS.items():
        for table in ("coordinates", "readback", "bindings"):
            yield _entry(f"sidecar/{table}/{name}", _write_expression(name, text, table))
    for name, text in ADDRESSES.items():
        yield _entry(f"sidecar/address/{name}", append_text(FILE, f'"{text}" = "k"\n'))
    bindings = "".join(f'"joint[x{i}]@stiffness" = "k"\n' for i in range(3000))
    yield _entry("sidecar/3000 meaningless bindings", append_text(FILE, bindings))
    for name, build in odd_files(FILE):
        # The first half is a valid sidecar with fewer bindings.
        codes = (0, 3) if name == "half of it" else (3,)
        yield CorpusEntry(f"sidecar/{name}", build, match=_NAMED, codes=codes)
    yield CorpusEntry("sidecar/lines of 3 MB", append_text(FILE, f"# {'x' * 3_000_000}\n"))
    keys = "".join(f"k{i} = {i}\n" for i in range(50_000))
    yield CorpusEntry("sidecar/keys of 50000", append_text(FILE, keys), codes=(1, 3))


def _write_expression(name: str, text: str, table: str) -> Build:
    spelled = text.replace('"', '\\"')
    if table == "bindings":
        # Bindings may use constants only.
        spelled = spelled.replace("x", "m") if "x" in spelled and "exp" not in name else spelled
        return replace_text(FILE, ('"k"', f'"{spelled}"'))
    if table == "coordinates":
        return replace_text(FILE, (_ENGINES, f'{_ENGINES}\n[coordinates]\nx = "{spelled}"'))
    tables = f'[coordinates]\nx = "x"\n[readback]\nx = "{spelled}"'
    return replace_text(FILE, (_ENGINES, f"{_ENGINES}\n{tables}"))
