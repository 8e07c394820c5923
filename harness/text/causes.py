"""What a diagnosis found, in sentences: the same in the terminal, the report and pytest."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def cause_sentences(finding: Mapping[str, Any]) -> list[str]:
    """A finding in words: a sentence a cause, then what it leaves and what it is tied with."""
    names = finding["cause"].split(" and ")
    kinds = finding["kind"].split(" and ")
    columns = (names, kinds, finding["nominal"], finding["estimate"], finding["standard_error"])
    sentences = []
    for (name, kind, now, wanted, error), place in zip(
        zip(*columns, strict=True), finding["where"], strict=True
    ):
        at = f" ({place})" if place else ""
        fitted = f"{_to_its_error(wanted, error)} ± {error:.1g}"
        if "literal" in kind or kind == "setting":
            said = f"is {now:.10g}, the motion wants {fitted}"
        elif kind in ("axis", "default", "exchange"):
            said = "explains the motion"
        else:
            said = f"is {fitted} in the model, {now:.10g} in the equations"
        sentences.append(f"{name}{at} {said}")
    tail = f"leaves {finding['remaining']:.1e} of the discrepancy"
    if finding["tied_with"]:
        tail += f"; no motion here tells it from: {', '.join(finding['tied_with'])}"
    return [*sentences, tail]


def _to_its_error(value: float, error: float) -> str:
    """A fitted value with ten digits, but none below its standard error."""
    places = 15 if error == 0 else max(0, -math.floor(math.log10(error)))
    return f"{round(value, places) + 0.0:.10g}"
