"""Which cases of a run are wanted: by the names of a command line, by words, or by what failed."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from physics_crosscheck.harness.modelfiles.folders import FolderError, builtin
from physics_crosscheck.harness.records.case import CaseId

_NAME = re.compile(
    r"(?P<model>.+?\.[A-Za-z0-9]+)(?:/(?P<scenario>[^/\[\]]+?))?(?:\s*\[(?P<engine>[^\]]+)\])?"
)
_WORD = re.compile(r"\(|\)|[^\s()]+")

Match = Callable[[str], bool]


@dataclass(frozen=True, kw_only=True)
class NamedModel:
    """A model file that a name means, and of its cases those of a scenario and an engine, if any.

    `my_arm/robot.urdf/free [engine]` is the name of a case, as it is printed.
    """

    folder: Path
    model: str
    scenario: str = ""
    engine: str = ""

    def includes(self, case: CaseId) -> bool:
        """Whether a case of its folder is meant."""
        return self.includes_model(case.model, case.engine) and self.scenario in ("", case.scenario)

    def includes_model(self, model: str, engine: str = "") -> bool:
        """Whether a model of its folder is meant, be it in one scenario; in an engine or in any."""
        return model == self.model and (not engine or self.engine in ("", engine))


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Which cases are wanted; as it is, all.

    Attributes:
        models: by folder, those of which one is to be meant; folders that aren't here are whole.
        words: what a case's name is to match, as `matching` reads it; empty: anything.
        only: folders and cases; None: all.
    """

    models: Mapping[str, tuple[NamedModel, ...]] = field(default_factory=dict)
    words: str = ""
    only: Collection[tuple[str, CaseId]] | None = None

    @property
    def everything(self) -> bool:
        """Whether nothing is left out."""
        return not (self.models or self.words) and self.only is None

    def includes_model(self, folder: str, model: str, engine: str = "") -> bool:
        """Whether a model is among those that are meant, in an engine or in any."""
        named = self.models.get(folder)
        return named is None or any(one.includes_model(model, engine) for one in named)

    def includes(self, folder: str, case: CaseId) -> bool:
        """Whether a case is wanted."""
        named = self.models.get(folder)
        return (
            (named is None or any(one.includes(case) for one in named))
            and (self.only is None or (folder, case) in self.only)
            and matching(self.words)(str(case))
        )


def named_model(name: str) -> NamedModel | None:
    """The model file of a system folder that a name means, or None for any other name.

    Such a file stands beside a `system.py` and has a sidecar. Where nothing has the name, it is
    looked for among the built-in systems.
    """
    found = _NAME.fullmatch(name)
    if found is None:
        return None
    path = Path(found["model"])
    for place in (path, builtin() / path):
        declared = (place.parent / "system.py").is_file()
        if declared and place.is_file() and Path(f"{place}.toml").is_file():
            return NamedModel(
                folder=place.parent,
                model=place.name,
                scenario=found["scenario"] or "",
                engine=found["engine"] or "",
            )
    return None


def chosen_models(names: Sequence[str]) -> tuple[list[str], dict[str, tuple[NamedModel, ...]]]:
    """Names with each model's replaced by its folder's, and the models by folder.

    A folder that is named itself is wanted whole.
    """
    whole, models = list[str](), dict[str, tuple[NamedModel, ...]]()
    for name in names:
        one = named_model(name)
        if one is None:
            whole.append(name)
        else:
            models[str(one.folder)] = (*models.get(str(one.folder), ()), one)
    partly = {folder: found for folder, found in models.items() if folder not in whole}
    return [*whole, *partly], partly


@cache
def matching(words: str) -> Match:
    """Whether a name has words in it, whatever their case: `driven and not (robot or free)`.

    As pytest's `-k` has it. A word is anything without a space or a parenthesis.

    Raises:
        FolderError: for what can't be read so.
    """
    if not words.strip():
        return lambda _: True
    return _Words(words).read()


class _Words:
    """A parser by recursive descent: or, and, not, parentheses."""

    def __init__(self, text: str) -> None:
        self._text, self._left = text, _WORD.findall(text)

    def read(self) -> Match:
        found = self._either()
        if self._left:
            raise self._error()
        return found

    def _either(self) -> Match:
        parts = [self._both()]
        while self._next("or"):
            parts.append(self._both())
        return lambda name: any(part(name) for part in parts)

    def _both(self) -> Match:
        parts = [self._one()]
        while self._next("and"):
            parts.append(self._one())
        return lambda name: all(part(name) for part in parts)

    def _one(self) -> Match:
        if self._next("not"):
            inner = self._one()
            return lambda name: not inner(name)
        if self._next("("):
            inner = self._either()
            if not self._next(")"):
                raise self._error()
            return inner
        if not self._left or self._left[0].lower() in ("and", "or", ")"):
            raise self._error()
        word = self._left.pop(0).lower()
        return lambda name: word in name.lower()

    def _next(self, word: str) -> bool:
        if self._left and self._left[0].lower() == word:
            self._left.pop(0)
            return True
        return False

    def _error(self) -> FolderError:
        return FolderError(
            f"-k {self._text!r} can't be read; use words, `and`, `or`, `not` and "
            "parentheses, such as 'driven and not robot'"
        )
