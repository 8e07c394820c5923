"""The selection of cases to run: by names on the command line, by words, or by earlier failures."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from physics_crosscheck.harness.records.case import CaseId
from .folders import FolderError, builtin

_NAME = re.compile(
    r"(?P<model>.+?\.[A-Za-z0-9]+)(?:/(?P<scenario>[^/\[\]]+?))?(?:\s*\[(?P<engine>[^\]]+)\])?"
)
_WORD = re.compile(r"\(|\)|[^\s()]+")

Match = Callable[[str], bool]


@dataclass(frozen=True, kw_only=True)
class NamedModel:
    """A model file that a name refers to, optionally with one scenario and engine.

    `my_arm/robot.urdf/free [engine]` is the printed name of a case.
    """

    folder: Path
    model: str
    scenario: str = ""
    engine: str = ""

    def includes(self, case: CaseId) -> bool:
        """Return whether a case of its folder is selected."""
        return self.includes_model(case.model, case.engine) and self.scenario in ("", case.scenario)

    def includes_model(self, model: str, engine: str = "") -> bool:
        """Return whether a model of its folder is selected, in any scenario; in one engine or in
        any.
        """
        return model == self.model and (not engine or self.engine in ("", engine))


@dataclass(frozen=True, kw_only=True)
class CaseSelection:
    """The selected cases; by default all.

    Attributes:
        models: selected models by folder; all models of other folders are selected.
        words: an expression that a case's name must match, as in `matching`; empty selects all.
        only: folders and cases, or None for all.
    """

    models: Mapping[str, tuple[NamedModel, ...]] = field(default_factory=dict)
    words: str = ""
    only: Collection[tuple[str, CaseId]] | None = None

    @property
    def everything(self) -> bool:
        """True if all cases are selected."""
        return not (self.models or self.words) and self.only is None

    def includes_model(self, folder: str, model: str, engine: str = "") -> bool:
        """Return whether a model is selected, in one engine or in any."""
        named = self.models.get(folder)
        return named is None or any(one.includes_model(model, engine) for one in named)

    def includes(self, folder: str, case: CaseId) -> bool:
        """Return whether a case is selected."""
        named = self.models.get(folder)
        return (
            (named is None or any(one.includes(case) for one in named))
            and (self.only is None or (folder, case) in self.only)
            and matching(self.words)(str(case))
        )


def named_model(name: str) -> NamedModel | None:
    """Return the model file of a system folder that a name refers to, or None.

    Such a file is in the folder of a `system.py` and has a sidecar. If no file has the name, search
    the built-in systems.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    path = Path(match["model"])
    for place in (path, builtin() / path):
        declared = (place.parent / "system.py").is_file()
        if declared and place.is_file() and Path(f"{place}.toml").is_file():
            return NamedModel(
                folder=place.parent,
                model=place.name,
                scenario=match["scenario"] or "",
                engine=match["engine"] or "",
            )
    return None


def chosen_models(names: Sequence[str]) -> tuple[list[str], dict[str, tuple[NamedModel, ...]]]:
    """Return the names with each model's replaced by its folder's, and the models by folder.

    A folder that is named itself is selected as a whole.
    """
    whole, models = list[str](), dict[str, tuple[NamedModel, ...]]()
    for name in names:
        named = named_model(name)
        if named is None:
            whole.append(name)
        else:
            models[str(named.folder)] = (*models.get(str(named.folder), ()), named)
    partly = {folder: found for folder, found in models.items() if folder not in whole}
    return [*whole, *partly], partly


@cache
def matching(words: str) -> Match:
    """Return a function that matches a name, ignoring case: `driven and not (robot or free)`.

    The syntax is that of pytest's `-k`. A word is text without spaces and parentheses.

    Raises:
        FolderError: for an expression that can't be parsed.
    """
    if not words.strip():
        return lambda _: True
    return _Words(words).read()


class _Words:
    """A parser by recursive descent: or, and, not, parentheses."""

    def __init__(self, text: str) -> None:
        self._text, self._remaining = text, _WORD.findall(text)

    def read(self) -> Match:
        match = self._either()
        if self._remaining:
            raise self._error()
        return match

    def _either(self) -> Match:
        parts = [self._both()]
        while self._next("or"):
            parts.append(self._both())
        return lambda name: any(part(name) for part in parts)

    def _both(self) -> Match:
        parts = [self._term()]
        while self._next("and"):
            parts.append(self._term())
        return lambda name: all(part(name) for part in parts)

    def _term(self) -> Match:
        if self._next("not"):
            inner = self._term()
            return lambda name: not inner(name)
        if self._next("("):
            inner = self._either()
            if not self._next(")"):
                raise self._error()
            return inner
        if not self._remaining or self._remaining[0].lower() in ("and", "or", ")"):
            raise self._error()
        word = self._remaining.pop(0).lower()
        return lambda name: word in name.lower()

    def _next(self, word: str) -> bool:
        if self._remaining and self._remaining[0].lower() == word:
            self._remaining.pop(0)
            return True
        return False

    def _error(self) -> FolderError:
        return FolderError(
            f"-k {self._text!r} can't be read; use words, `and`, `or`, `not` and "
            "parentheses, such as 'driven and not robot'"
        )
