"""Trials of changed numbers, in groups as long as none of them has an effect."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from pathlib import Path

from physics_crosscheck.harness.diagnosis.behaviour import Behaviour, Probe
from physics_crosscheck.harness.documents.location import replace_numbers
from physics_crosscheck.harness.modelfiles.bindings import with_texts
from physics_crosscheck.harness.modelfiles.locations import Literal
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError

NUDGE = 1e-3
"""Relative change of a number, or absolute change of zero."""

PATIENCE = 2.0
"""Processor seconds after which the remaining numbers are not tried."""

_GOLDEN = 0.6180339887498949
"""Spreads the sizes of changes, so that two of them do not cancel."""


class NumberEffect(Enum):
    """Effect of a number."""

    MOTION = "motion"
    FRAMES = "frames"
    FAINT = "effect below the resolution"
    NONE = "no effect on motion"
    FIXED = "links that do not move"
    REFUSED = "not counted: no other value can be tried"
    CHOICE = "switches and counts"
    UNTRIED = "not counted: out of time"


class Trials:
    """Copies of a model with changed numbers.

    Args:
        numbers: of the model's files.
        base: behaviour of the unmodified model.
        folder: for the copies.

    Attributes:
        effects: effect of each tried number, by its index.
    """

    def __init__(
        self,
        sidecar: Sidecar,
        numbers: Sequence[Literal],
        probe: Probe,
        base: Behaviour,
        folder: Path,
    ) -> None:
        self.effects: dict[int, NumberEffect] = {}
        self._sidecar, self._numbers, self._probe = sidecar, numbers, probe
        self._base, self._folder = base, folder
        parts = (one.location.file for one in numbers)
        files = dict.fromkeys((sidecar.model, Path(f"{sidecar.model}.toml"), *parts))
        self._texts = {file: file.read_bytes() for file in files}
        self._end = time.process_time() + PATIENCE

    def nudge(self, numbers: Sequence[int], together: int) -> None:
        """Nudge numbers; change those that the engine rejects to the next whole number.

        Args:
            together: how many to nudge first in one copy.
        """
        for first in range(0, len(numbers), together):
            group = numbers[first : first + together]
            self._halve(group, lambda i: _moved(self._numbers[i], i))

    def flip(self, group: Iterable[int]) -> None:
        """Change the signs of numbers whose nudge had no effect."""
        quiet = [i for i in group if self.effects.get(i) is NumberEffect.NONE]
        self._halve(quiet, lambda i: (repr(-self._numbers[i].location.value),))

    def _halve(
        self, group: Sequence[int], words: Callable[[int], Sequence[str]], acts: bool = False
    ) -> None:
        """Try numbers together, and by halves if they have an effect; `acts` if they have one."""
        if not group or time.process_time() > self._end:
            return
        if acts and len(group) > 1:
            effect = NumberEffect.MOTION
        else:
            effect = self._tried({i: words(i)[0] for i in group})
        if effect is NumberEffect.NONE:
            self.effects.update(dict.fromkeys(group, NumberEffect.NONE))
        elif len(group) > 1:
            first, second = group[: len(group) // 2], group[len(group) // 2 :]
            self._halve(first, words)
            still = all(self.effects.get(i) is NumberEffect.NONE for i in first)
            self._halve(second, words, acts=still)
        else:
            for other in words(group[0])[1:]:
                if effect is not NumberEffect.REFUSED:
                    break
                effect = self._tried({group[0]: other})
            self.effects[group[0]] = effect

    def _tried(self, words: Mapping[int, str]) -> NumberEffect:
        """Return the effect of some numbers with new text."""
        places = ((self._numbers[i].location, word) for i, word in words.items())
        texts = replace_numbers(self._texts, places)
        try:
            model = self._probe.loaded(with_texts(self._sidecar, texts, self._folder))
        except SidecarError:
            model = None
        if model is None:
            return NumberEffect.REFUSED
        done = self._probe.evaluate(model)
        if not done.moves_as(self._base, self._probe.resolution):
            return NumberEffect.MOTION
        return (
            NumberEffect.NONE
            if done.poses_as(self._base, self._probe.resolution)
            else NumberEffect.FRAMES
        )


def _moved(literal: Literal, i: int) -> tuple[str, ...]:
    """Return new texts for a number, in the order of trials."""
    value = literal.location.value
    step = NUDGE * (1 + (i * _GOLDEN) % 1)
    up, down = (value * (1 + step), value * (1 - step)) if value else (step, -step)
    whole: tuple[str, ...] = () if value else ("1e-15",)
    if literal.location.text.lstrip("+-").isdigit():
        whole = (*whole, str(int(value) + 1), str(int(value) - 1))
    return (repr(up), repr(down), *whole)
