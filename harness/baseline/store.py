"""The accepted baseline: a folder with a readable JSON file a system, and the accepted texts.

A line a quantity, in a stable order: who reviews a change sees what moved and nothing else. Every
entry carries a seal over what it says, so that a file which was damaged, badly merged or edited by
hand is told as such and never believed.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from harness.baseline.fingerprint import digest_of

FORMAT = 1
DEFAULT = Path("reports/baseline")
ACCEPTED = ".accepted"
"""What the names of accepted texts end with: no tool shall take them for models or for code."""

_FIELDS = (
    "summary", "reason", "outcome", "why", "discrepancy", "uncertainty", "component", "constants",
    "raw_error", "raw_order", "shipped_step", "integrator", "order", "claimed_order", "engine",
    "resolution", "numerics", "files", "track", "end", "end_uncertainty",
)  # fmt: skip

Entry = dict[str, Any]
"""What was accepted of a case: the fields of `_FIELDS`, as plain JSON."""


class BaselineError(ValueError):
    """A baseline that can't be read or believed; the message names file, place and remedy."""


@dataclass(frozen=True)
class SystemBaseline:
    """What was accepted of a system.

    Attributes:
        system: its name.
        folder: its folder, relative to the baseline's; `builtin:NAME` for an installed one.
        declared: hash of the declaration that `scenarios` and `constants` belong to.
        scenarios: names of its scenarios.
        constants: its constants, name to value.
        tracks: records of the tracks that cases refer to, by key.
        cases: entries by `<model file>/<scenario> [<engine>]`.
    """

    system: str
    folder: str
    declared: str
    scenarios: tuple[str, ...]
    constants: Mapping[str, float]
    tracks: Mapping[str, Mapping[str, Any]] = field(repr=False)
    cases: Mapping[str, Entry] = field(repr=False)

    @property
    def known(self) -> dict[str, Entry]:
        """Entries of known differences: accepted though they don't agree."""
        return {key: entry for key, entry in self.cases.items() if entry["outcome"] != "AGREES"}


def case_key(model: str, scenario: str, engine: str) -> str:
    """A case's name within its system."""
    return f"{model}/{scenario} [{engine}]"


def read_baseline(folder: Path) -> dict[str, SystemBaseline]:
    """Read all systems of a baseline, by name; none where the folder does not exist.

    Raises:
        BaselineError: for anything that can't be believed.
    """
    found: dict[str, SystemBaseline] = {}
    if not folder.exists():
        return found
    if not folder.is_dir():
        raise BaselineError(f"{folder}: is no folder; a baseline is one, with a file a system")
    for path in sorted(folder.glob("*.json")):
        one = _read(path)
        found[one.system] = one
    return found


def accepted_text(folder: Path, system: str, name: str, wanted: str) -> str | None:
    """The text of a file as it was accepted, if it is kept and has the hash that is wanted."""
    with suppress(OSError, UnicodeDecodeError):
        data = (folder / system / (name + ACCEPTED)).read_bytes()
        if digest_of(data) == wanted:
            return data.decode("utf-8")
    return None


def write_baseline(
    folder: Path,
    systems: Sequence[SystemBaseline],
    texts: Mapping[tuple[str, str], bytes],
) -> list[Path]:
    """Write systems, and texts by (system, file name); returns the files that changed.

    Everything is written beside its place first and then renamed, so that a full disk or a run
    that is killed leaves the old baseline. Texts that no case needs any more are removed, and so is
    the file of a system without cases.

    Raises:
        OSError: as the file system has it; nothing has changed then.
    """
    wanted: dict[Path, bytes | None] = {}
    for one in systems:
        kept = {(one.system, name) for name in _texts_of(one)}
        for path in sorted((folder / one.system).glob(f"*{ACCEPTED}")):
            if (one.system, path.name.removesuffix(ACCEPTED)) not in kept:
                wanted[path] = None
        for key in kept & set(texts):
            wanted[folder / one.system / (key[1] + ACCEPTED)] = texts[key]
    # The entries come last: their hashes tell whether a text is the one they mean.
    for one in systems:
        text = _write(one).encode() if one.cases else None
        wanted[folder / f"{one.system}.json"] = text
    changed = {path: data for path, data in wanted.items() if _bytes(path) != data}
    staged: dict[Path, str] = {}
    try:
        for path, data in changed.items():
            if data is not None:
                staged[path] = _stage(path, data)
        for path, data in changed.items():
            if data is None:
                path.unlink(missing_ok=True)
            else:
                os.replace(staged.pop(path), path)
    finally:
        for temporary in staged.values():
            os.unlink(temporary)
    return list(changed)


def _texts_of(one: SystemBaseline) -> set[str]:
    """Files whose accepted text is worth keeping: models, their sidecars, the declaration."""
    models = {key.split("/", 1)[0] for key in one.cases}
    return {"system.py", *models, *(f"{model}.toml" for model in models)} if models else set()


def _bytes(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None


def _stage(path: Path, data: bytes) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
    except BaseException:
        os.unlink(temporary)
        raise
    return temporary


def _seal(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _line(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _table(content: Mapping[str, Any], indent: str) -> str:
    """An object with a line a key, sealed."""
    lines = [f"{indent}  {_line(key)}: {_line(value)}" for key, value in content.items()]
    lines.append(f'{indent}  "seal": {_line(_seal(content))}')
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def _tables(tables: Mapping[str, Mapping[str, Any]]) -> str:
    if not tables:
        return "{}"
    lines = [f"    {_line(key)}: {_table(tables[key], '    ')}" for key in sorted(tables)]
    return "{\n" + ",\n".join(lines) + "\n  }"


def _head(one: SystemBaseline) -> dict[str, Any]:
    return {
        "system": one.system,
        "folder": one.folder,
        "declared": one.declared,
        "scenarios": list(one.scenarios),
        "constants": dict(one.constants),
    }


def _write(one: SystemBaseline) -> str:
    used = {entry["track"] for entry in one.cases.values()}
    cases = {key: {name: entry[name] for name in _FIELDS} for key, entry in one.cases.items()}
    return (
        "{\n"
        f'  "format": {FORMAT},\n'
        f'  "head": {_table(_head(one), "  ")},\n'
        f'  "cases": {_tables(cases)},\n'
        f'  "tracks": {_tables({key: one.tracks[key] for key in used})}\n'
        "}\n"
    )


def _read(path: Path) -> SystemBaseline:
    remedy = "restore it from version control, or remove it and accept anew"
    try:
        data = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_constant)
    except OSError as error:
        raise BaselineError(f"{path}: can't be read: {error.strerror}; {remedy}") from None
    except (ValueError, RecursionError) as error:
        raise BaselineError(f"{path}: no JSON: {error}; {remedy}") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise BaselineError(
            f"{path}: no baseline of format {FORMAT}; use the version of crosscheck that wrote it,"
            " or remove it and accept anew"
        )
    try:
        head = _unsealed(data["head"], f"{path}: head")
        tables = {}
        for name in ("cases", "tracks"):
            tables[name] = {
                key: _unsealed(value, f"{path}: {key}") for key, value in data[name].items()
            }
        for key, entry in tables["cases"].items():
            if set(entry) != set(_FIELDS) or entry["track"] not in tables["tracks"]:
                raise BaselineError(f"{path}: {key}: is not whole; {remedy}")
        if head["system"] != path.stem:
            raise BaselineError(f"{path}: is of the system {head['system']!r}; {remedy}")
        return SystemBaseline(
            head["system"],
            head["folder"],
            head["declared"],
            tuple(head["scenarios"]),
            head["constants"],
            tables["tracks"],
            tables["cases"],
        )
    except (KeyError, TypeError, AttributeError):
        raise BaselineError(f"{path}: is not whole; {remedy}") from None


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no number")


def _unsealed(table: Mapping[str, Any], place: str) -> dict[str, Any]:
    content = {key: value for key, value in table.items() if key != "seal"}
    if table.get("seal") != _seal(content):
        raise BaselineError(
            f"{place}: does not say what was accepted (damaged, badly merged, or edited by hand);"
            " restore it from version control, or remove this entry and accept it anew"
        )
    return content
