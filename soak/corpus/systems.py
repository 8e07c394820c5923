"""Hostile `system.py` files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from soak.corpus.entry import RUN, Build, CorpusEntry, append_text, prepend_text, replace_text
from soak.corpus.odd_files import odd_files

FILE = "system.py"
_NAMED = r"system\.py"

_V = "V=k * x.q**2 / 2"
_T = "T=m * x.v**2 / 2"
_D = "D=c * x.v**2 / 2"
_START = "q={x: 0.1}"
_FORCE = "1.5 * sin(5.9 * t)"

CODE = {
    "raises BaseException": "raise BaseException('no')",
    "raises KeyboardInterrupt": "raise KeyboardInterrupt",
    "raises GeneratorExit": "raise GeneratorExit",
    "raises SystemExit(0)": "raise SystemExit(0)",
    "raises SystemExit of a text": "raise SystemExit('done')",
    "raises StopIteration": "raise StopIteration",
    "raises MemoryError": "raise MemoryError",
    "raises RecursionError": "def f(): f()\nf()",
    "raises an error of several lines": "raise ValueError('one\\ntwo\\nthree')",
    "raises an error of a megabyte": "raise ValueError('x' * 1000000)",
    "raises an error without words": "raise ValueError",
    "raises an error that can't be told": (
        "class E(Exception):\n    def __str__(self): raise RuntimeError('no words')\nraise E"
    ),
    "raises an error that can't be sent": (
        "class E(Exception):\n    def __init__(self, a, b): self.f = lambda: 0\nraise E(1, 2)"
    ),
    "raises an error with terminal codes": "raise ValueError('\\x1b[2J\\x1b[31mAGREES')",
    "raises an error with half a character": "raise ValueError('\\ud800')",
    "a group of errors": "raise BaseExceptionGroup('a', [KeyboardInterrupt()])",
    "ends the process with 0": "import os\nos._exit(0)",
    "ends the process with 7": "import os\nos._exit(7)",
    "aborts": "import os\nos.abort()",
    "segfaults": "import ctypes\nctypes.string_at(0)",
    "kills itself": "import os, signal\nos.kill(os.getpid(), signal.SIGKILL)",
    "terminates itself": "import os, signal\nos.kill(os.getpid(), signal.SIGTERM)",
    "imports what is not there": "import no_such_package",
    "imports itself": "import system",
    "divides by nothing": "1 / 0",
    "no Python": "def def def",
    "no Python, nested": "(" * 5000,
    "no Python, a long sum": "+".join("1" for _ in range(200_000)),
    "tabs and spaces": "if True:\n\tx = 1\n        x = 2",
    "an unknown encoding": "# coding: no-such-codec",
    "a null byte": "x = '\0'",
    "deletes what it has declared": "del system",
    "declares nothing": "system = None",
    "declares a text": "system = 'system'",
    "declares the class": "from physics_crosscheck import System\nsystem = System",
}  # fmt: skip
"""Code for the end of the file. No run may pass with any of it."""

HARMLESS = {
    "prints a lot": "print('x' * 3_000_000)",
    "warns": "import warnings\nwarnings.warn('no', UserWarning)",
    "goes to another folder": "import os\nos.chdir('/')",
    "takes the terminal away": "import sys\nsys.stdout = sys.stderr = None",
    "closes the terminal": "import os\nos.close(1); os.close(2)",
    "shadows names": "str = int = len = print = open = None",
    "empties the path": "import sys\nsys.path[:] = []",
    # The program handles Ctrl-C and ends its workers, which ignore the signal.
    "interrupts itself": "import os, signal\nos.kill(os.getpid(), signal.SIGINT)",
    "forks": "import os\nif os.fork() == 0: os._exit(0)",
    "starts a thread": "import threading\nthreading.Thread(target=lambda: None).start()",
}
"""Code for the end of the file that does not prevent a run from passing."""

EXPRESSIONS = {
    "V of an unknown name": (_V, "V=k * y.q**2 / 2"),
    "V of an unknown symbol": (_V, "V=k * __import__('sympy').Symbol('z')"),
    "V is None": (_V, "V=None"),
    "V is a text": (_V, "V='k * x**'"),
    "V is a text that is code": (_V, "V=\"open('PWNED', 'w')\""),
    "V is a list": (_V, "V=[k * x.q]"),
    "V is complex": (_V, "V=k * x.q**2 / 2 * __import__('sympy').I"),
    "V is nan": (_V, "V=k * x.q**2 * float('nan')"),
    "V is inf": (_V, "V=k * x.q**2 * float('inf')"),
    "V is zoo": (_V, "V=k * x.q**2 + __import__('sympy').zoo"),
    "V has an impulse": (_V, "V=k * x.q**2 / 2 * __import__('sympy').DiracDelta(x.q)"),
    "V has a step": (_V, "V=k * x.q**2 / 2 * __import__('sympy').Heaviside(x.q)"),
    "V has Abs": (_V, "V=k * x.q * abs(x.q) / 2"),
    "V has an unknown function": (_V, "V=k * x.q**2 * __import__('sympy').Function('h')(1)"),
    "V has the velocity": (_V, "V=k * x.q**2 / 2 + c * x.q * x.v"),
    "V has another unit": (_V, "V=k * x.q / 2"),
    "V is singular at the start": (_V, "V=k * x.q**3 / (2 * x.q - 0.2 * x.q / x.q)"),
    "V's root is complex at the start": (_V, "V=k * x.q * __import__('sympy').sqrt(-x.q**2) / 2"),
    "V is a tower of powers": (_V, "V=k * x.q**2 * 9**9**9"),
    "T is nothing": (_T, "T=0"),
    "T is linear": (_T, "T=m * x.v / 2"),
    "T is negative": (_T, "T=-m * x.v**2 / 2"),
    "T's mass vanishes where x is 0": (_T, "T=m * x.q**2 * x.v**2 / 2"),
    "T's mass vanishes within the motion": (_T, "T=(m * x.q / x.q - 13 * m * x.q) * x.v**2 / 2"),
    "T of another power": (_T, "T=m * x.v**4"),
    "T is complex": (_T, "T=m * x.v**2 / 2 * (1 + 1j)"),
    "T is nan": (_T, "T=m * x.v**2 * float('nan')"),
    "D is not quadratic": (_D, "D=c * x.v**3"),
    "D is complex": (_D, "D=c * x.v**2 * 1j"),
    "D is nan": (_D, "D=c * x.v**2 * float('nan')"),
    "starts at nan": (_START, "q={x: float('nan')}"),
    "starts at inf": (_START, "q={x: float('inf')}"),
    "starts at a text": (_START, "q={x: 'here'}"),
    "starts at a complex number": (_START, "q={x: 1j}"),
    "starts at a symbol": (_START, "q={x: t}"),
    "starts nowhere": (_START, "q={}"),
    "starts as another": (_START, "q={'x': 0.1}"),
    "starts at the square root of -1": (_START, "q={x: __import__('sympy').sqrt(-1)}"),
    "its velocity is nan": ("v={x: 0.2}", "v={x: float('nan')}"),
    "its velocity is missing": ("v={x: 0.2}", "v={}"),
    "its force is nan": (_FORCE, "float('nan')"),
    "its force is infinite": (_FORCE, "float('inf')"),
    "its force is complex": (_FORCE, "(1 + 1j) * sin(5.9 * t)"),
    "its force grows complex": (_FORCE, "__import__('sympy').sqrt(0.5 - t)"),
    "its force has a pole at 0": (_FORCE, "1 / t"),
    "its force has a pole within": (_FORCE, "1 / (t - 0.5)"),
    "its force is a logarithm": (_FORCE, "__import__('sympy').log(t)"),
    "its force is an impulse": (_FORCE, "__import__('sympy').DiracDelta(t - 0.5)"),
    "its force has Abs": (_FORCE, "abs(sin(t))"),
    "its force is the position": (_FORCE, "x.q"),
    "its force is an unknown symbol": (_FORCE, "__import__('sympy').Symbol('z')"),
    "its force is a text": (_FORCE, "'sin('"),
    "its force overflows": (_FORCE, "__import__('sympy').exp(1e6 * t)"),
    "its force is None": (_FORCE, "None"),
    "lasts 0": ("duration=1.0", "duration=0"),
    "lasts less than nothing": ("duration=1.0", "duration=-1.0"),
    "lasts nan": ("duration=1.0", "duration=float('nan')"),
    "lasts for ever": ("duration=1.0", "duration=float('inf')"),
    "lasts 1e300": ("duration=1.0", "duration=1e300"),
    "lasts 1e-300": ("duration=1.0", "duration=1e-300"),
    "lasts a text": ("duration=1.0", "duration='1'"),
    "lasts a complex time": ("duration=1.0", "duration=1 + 1j"),
    "the mass is nan": ('"m", 1.3', '"m", float("nan")'),
    "the mass is inf": ('"m", 1.3', '"m", float("inf")'),
    "the mass is nothing": ('"m", 1.3', '"m", 0.0'),
    "the mass is negative": ('"m", 1.3', '"m", -1.3'),
    "the mass is True": ('"m", 1.3', '"m", True'),
    "the mass is a text": ('"m", 1.3', '"m", "1.3"'),
    "the mass is None": ('"m", 1.3', '"m", None'),
    "the mass has 400 digits": ('"m", 1.3', '"m", 10**400'),
    "the mass has 5000 digits": ('"m", 1.3', '"m", 10**5000'),
    "the mass is complex": ('"m", 1.3', '"m", 1.3 + 0j'),
    "the mass is denormal": ('"m", 1.3', '"m", 5e-324'),
    "the mass has no unit": ('1.3, "kg"', '1.3, ""'),
    "a unit that nobody knows": ('1.3, "kg"', '1.3, "furlong"'),
    "a unit over nothing": ('1.3, "kg"', '1.3, "kg/0"'),
    "a unit of a huge power": ('1.3, "kg"', '1.3, "kg^999999999"'),
    "a unit that is code": ('1.3, "kg"', '1.3, "__import__(\'os\')"'),
    "a unit that is None": ('1.3, "kg"', "1.3, None"),
    "a constant without a source": ('"mass", "chosen"', '"mass", ""'),
    "a name that is no identifier": ('Constant("m"', 'Constant("m n"'),
    "a name that is empty": ('Constant("m"', 'Constant(""'),
    "a name that is taken": ('Constant("m"', 'Constant("x"'),
    "the name of the time": ('Constant("m"', 'Constant("t"'),
    "the name of a velocity": ('Constant("m"', 'Constant("x_dot"'),
    "a name that is no text": ('Constant("m"', "Constant(7"),
    "a coordinate that is None": ("coordinates=(x,)", "coordinates=(None,)"),
    "no coordinates": ("coordinates=(x,)", "coordinates=()"),
    "a coordinate twice": ("coordinates=(x,)", "coordinates=(x, x)"),
    "coordinates that are none": ("coordinates=(x,)", "coordinates=None"),
    "a constant that is missing": ("constants=(m, c, k)", "constants=(m, c)"),
    "no outputs": ('outputs=(Output("x", x.q, "m", "displacement"),)', "outputs=()"),
    "an output of nan": ('Output("x", x.q,', 'Output("x", x.q * float("nan"),'),
    "an output of another unit": ('Output("x", x.q, "m"', 'Output("x", x.q, "s"'),
    "no scenario": ("scenarios=(", "scenarios=() and ("),
    "an equilibrium that is none": ("{x: 0}, False", "{x: 1}, False"),
    "an equilibrium at nan": ("{x: 0}, False", "{x: float('nan')}, False"),
    "an equilibrium that is not found": (
        'equilibria=(Equilibrium("rest", {x: 0}, False',
        'equilibria=(Equilibrium("rest", {x: __import__("sympy").oo}, True',
    ),
    "no equilibria": ('(Equilibrium("rest", {x: 0}, False, "relaxed"),)', "()"),
    "a force by a complex number": ("on={x: 1}", "on={x: 1j}"),
    "a complex output": ('Output("x", x.q,', 'Output("x", x.q * 1j,'),
    "a force on nothing": ("on={x: 1}", "on={}"),
    "a force by nan": ("on={x: 1}", "on={x: float('nan')}"),
    "a force by its own velocity": ("on={x: 1}", "on={x: x.v}"),
    "a field too few": ('title="Oscillator",', ""),
    "a field too many": ('title="Oscillator",', 'title="Oscillator", colour="red",'),
    "a sketch of nothing": ("published=()", "published=(), sketch=(1,)"),
}  # fmt: skip
"""(old, new) texts of replacements, none of which describes a mechanism."""

_PUBLISHED = "published=()"
EQUATIONS = {
    "no equation": "k",
    "two signs": "x'' = = 0",
    "code": "__import__('os').system('touch PWNED') = 0",
    "code in a name": "open('PWNED', 'w') = x",
    "a tower of powers": "x'' = 9**9**9",
    "brackets without an end": "x'' = " + "(" * 2000,
    "an unknown name": "x'' = z",
    "nothing": "",
    "a null byte": "x'' = \\0",
    "attributes": "x'' = x.__class__.__mro__",
    "a lambda": "x'' = (lambda: 0)()",
    "signs without end": "x'' = " + "±" * 40 + "x",
}
"""Texts of published equations."""


def _publish_equation(text: str) -> Build:
    published = (
        f'published=(__import__("physics_crosscheck").PublishedEquation("1", {text!r}, "motion",'
        ' of="x", driven=False, note=""),)'
    )
    return replace_text(FILE, (_PUBLISHED, published.replace("\\\\0", "\\0")))


NAMES = ("a/b", "../../PWNED", "a\\nb", "<script>alert(1)</script>", "{{ 7 * 7 }}", "-", "\\ud800")
"""Names of a scenario, which are printed but never interpreted."""


_entry = partial(CorpusEntry, match=_NAMED)


def system_entries() -> Iterator[CorpusEntry]:
    """Yield the `system.py` entries."""
    for name, code in CODE.items():
        is_first_line = name == "an unknown encoding"  # a file declares it there
        build = (
            prepend_text(FILE, f"{code}\n") if is_first_line else append_text(FILE, f"\n{code}\n")
        )
        yield _entry(f"system.py/{name}", build)
    for name, code in HARMLESS.items():
        build = append_text(FILE, f"\n{code}\n")
        yield CorpusEntry(f"system.py/{name}", build, codes=(0,))
    for name, change in EXPRESSIONS.items():
        yield _entry(f"system.py/{name}", replace_text(FILE, change), codes=(1, 3))
    for name, build in odd_files(FILE):
        yield _entry(f"system.py/{name}", build, codes=(2, 3))
    for name, code in ENDLESS.items():
        build = append_text(FILE, f"\n{code}\n")
        yield _entry(f"system.py/{name}", build, command=LIMITED, slow=True)
    for name, text in EQUATIONS.items():
        yield _entry(f"system.py/published/{name}", _publish_equation(text))
    for name in NAMES:
        build = replace_text(FILE, ('Scenario("driven"', f'Scenario("{name}"'))
        yield CorpusEntry(f"system.py/scenario called {name}", build, codes=(0, 3))
    for command in EXTRA:
        yield from _command_entries(command)


def _command_entries(command: str) -> Iterator[CorpusEntry]:
    """Yield some of the `system.py` entries for another command than `run`."""
    line = (command, "@hostile", *EXTRA[command])
    for name in ("raises BaseException", "raises KeyboardInterrupt", "segfaults", "no Python",
                 "ends the process with 0", "declares nothing"):  # fmt: skip
        build = append_text(FILE, f"\n{CODE[name]}\n")
        yield _entry(f"{command}/system.py {name}", build, command=line)
    for name in ("V is nan", "T is nothing", "starts at nan", "its force is complex",
                 "the mass has 400 digits", "V is a tower of powers"):  # fmt: skip
        build = replace_text(FILE, EXPRESSIONS[name])
        yield _entry(f"{command}/system.py {name}", build, command=line, codes=(1, 3))


EXTRA = {
    "derive": ("--limit", "20"),
    "audit": ("--limit", "20"),
    "gate": ("--baseline", "@baseline", "--out", "@out", "--jobs", "1", "--limit", "20"),
    "mutate": ("--jobs", "1", "--limit", "20"),
}

LIMITED = (*RUN, "--limit", "4", "--memory", "1")

ENDLESS = {
    "never ends": "while True: pass",
    "sleeps": "import time\ntime.sleep(1e6)",
    "grows": "a = []\nwhile True: a.append(bytearray(10**7))",
    "takes all memory at once": "a = bytearray(10**12)",
    "computes a tower of powers": "9**9**9",
    "simplifies without end": "import re\nre.match('(a*)*b', 'a' * 50)",
}
