"""Hostile command lines for every command."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from soak.corpus.entry import BASELINE, CorpusEntry, append_text, write_file
from soak.corpus.systems import FILE as SYSTEM_FILE

_OUT = ("--out", "@out", "--baseline", "@baseline")
_COMPARE = ("compare", "@hostile/mujoco.xml", "@sound/mujoco.xml")

WRONG: dict[str, tuple[str, ...]] = {
    "an unknown command": ("frobnicate",),
    "an empty command": ("",),
    "a command that is a module": ("exit_codes",),
    "a command that is a path": ("../run",),
    "a folder that is not there": ("run", "@nowhere", *_OUT),
    "a folder without a system": ("run", "@empty", *_OUT),
    "a folder that is a file": ("run", "@hostile/system.py", *_OUT),
    "a folder without a name": ("run", "", *_OUT),
    "a folder of 5000 characters": ("run", "x" * 5000, *_OUT),
    "a folder with half a character": ("run", "a\udcff", *_OUT),
    "an unknown engine": ("run", "@hostile", "--engine", "havok", *_OUT),
    "an engine without a name": ("run", "@hostile", "--engine", "", *_OUT),
    "a resolution of 0": ("run", "@hostile", "--resolution", "0", *_OUT),
    "a resolution of nan": ("run", "@hostile", "--resolution", "nan", *_OUT),
    "a resolution of inf": ("run", "@hostile", "--resolution", "inf", *_OUT),
    "a resolution of a text": ("run", "@hostile", "--resolution", "fine", *_OUT),
    "a negative resolution": ("run", "@hostile", "--resolution=-1e-9", *_OUT),
    "0 jobs": ("run", "@hostile", "--jobs", "0", *_OUT),
    "less than no jobs": ("run", "@hostile", "--jobs=-1", *_OUT),
    "half a job": ("run", "@hostile", "--jobs", "0.5", *_OUT),
    "jobs of 5000 digits": ("run", "@hostile", "--jobs", "9" * 5000, *_OUT),
    "a limit of 0": ("run", "@hostile", "--limit", "0", *_OUT),
    "a limit of nan": ("run", "@hostile", "--limit", "nan", *_OUT),
    "a limit of inf": ("run", "@hostile", "--limit", "inf", *_OUT),
    "a limit of a text": ("run", "@hostile", "--limit", "soon", *_OUT),
    "a memory of 0": ("run", "@hostile", "--memory", "0", *_OUT),
    "a memory of nan": ("run", "@hostile", "--memory", "nan", *_OUT),
    "an option that there is not": ("run", "@hostile", "--fast", *_OUT),
    "an option without its value": ("run", "@hostile", "--out"),
    "results that are not there": ("report", "@nothing.json"),
    "a system that is not there to derive": ("derive", "@nowhere"),
    "nothing to derive": ("derive",),
    "a system that is not there to audit": ("audit", "@nowhere"),
    "nothing to audit": ("audit",),
    "an unknown engine to audit": ("audit", "@hostile", "--engine", "havok"),
    "a system that is not there to mutate": ("mutate", "@nowhere"),
    "nothing to mutate": ("mutate",),
    "an unknown engine to mutate": ("mutate", "@hostile", "--engine", "havok"),
    "a system that is not there to gate": ("gate", "@nowhere", *_OUT),
    "a resolution to gate": ("gate", "@hostile", "--resolution", "1", *_OUT),
    "no reason": ("accept", "--baseline", "@baseline"),
    "an empty reason": ("accept", "--reason", "", "--baseline", "@baseline"),
    "a blank reason": ("accept", "--reason", " \n ", "--baseline", "@baseline"),
    "a folder that is not there to accept": (
        "accept", "--reason", "x", "--folder", "@nowhere", "--baseline", "@baseline"
    ),
    "an engine to conform that there is not": ("engines", "--conformance", "havok"),
    "an engine to conform that is empty": ("engines", "--conformance", ""),
    "one file to compare": ("compare", "@hostile/mujoco.xml"),
    "files that are not there to compare": ("compare", "@a.xml", "@b.xml"),
    "a folder of folders to compare": ("compare", "@.", "@hostile"),
    "a file to compare that no engine reads": (
        "compare", "@hostile/system.txt", "@hostile/mujoco.xml"
    ),
    "joints that are none": (*_COMPARE, "--joints", "x"),
    "a joint that there is not": (*_COMPARE, "--joints", "y=x"),
    "joints that are code": (*_COMPARE, "--joints", "x=__import__('os').getcwd()"),
    "joints that are a tower of powers": (*_COMPARE, "--joints", "x=x*9**9**9"),
    "a start of a text": (*_COMPARE, "--start", "x=far"),
    "a start of nan": (*_COMPARE, "--start", "x=nan"),
    "a start of another": (*_COMPARE, "--start", "y=1"),
    "a map that is not there": (*_COMPARE, "--map", "@nothing.toml"),
    "an engine that does not read it": (*_COMPARE, "--engine", "pymunk"),
    "a new system without a name": ("new",),
    "a new system of an empty name": ("new", ""),
    "a new system of a number": ("new", "@7up"),
    "a new system with a quote": ("new", '@a"b'),
    "a new system with a newline": ("new", "@a\nb"),
    "a new system where something is": ("new", "@hostile"),
    "a new system in no folder": ("new", "@nowhere/new"),
    "a new system of 5000 characters": ("new", "@" + "x" * 5000),
    "a new system called like a device": ("new", "/dev/null"),
}  # fmt: skip

MAPS = {
    "no TOML": "[joints",
    "no table": "joints = 1\n",
    "no texts": "[joints]\nx = [1]\n",
    "code": "[joints]\nx = \"__import__('os').getcwd()\"\n",
    "nothing": "",
    "an integer of 5000 digits": f"[joints]\nx = {'9' * 5000}\n",
    "nested": f"[joints]\nx = {'[' * 5000}\n",
    "a tower of powers": '[joints]\nx = "x * 9**9**9"\n',
    "singular": '[joints]\nx = "0 * x"\n',
    "of logarithms": '[joints]\nx = "log(0) + x"\n',
}


_entry = partial(CorpusEntry, codes=(2, 3), match="crosscheck")


def argument_entries() -> Iterator[CorpusEntry]:
    """Yield the entries that pass hostile arguments and joint maps."""
    for name, command in WRONG.items():
        yield _entry(f"arguments/{name}", _write_extra_files, command=command)
    mapped = (*_COMPARE, "--map", "@hostile/map.toml")
    for name, text in MAPS.items():
        build = write_file("map.toml", text)
        yield _entry(f"arguments/a map, {name}", build, command=mapped, codes=(1, 2, 3))
    for place, out in {"that is": "system.py", "below": "system.py/out"}.items():
        name = f"arguments/an out folder {place} a file"
        command = ("run", "@hostile", "--out", f"@hostile/{out}", *BASELINE)
        yield _entry(name, _write_extra_files, command=command, match=r"system\.py")
    sound = append_text(SYSTEM_FILE, "\n")
    twice = ("run", "@hostile", "@hostile", "--jobs", "1", *_OUT)
    yield CorpusEntry("arguments/a folder twice", sound, codes=(0,), command=twice)
    more = ("run", "@hostile", "--jobs", "24", *_OUT)
    yield CorpusEntry("arguments/more jobs than work", sound, codes=(0,), command=more)


def _write_extra_files(workspace: Path) -> None:
    """Add an empty folder and a file that no engine reads."""
    (workspace / "empty").mkdir()
    (workspace / "hostile" / "system.txt").write_text("text", "utf-8")
