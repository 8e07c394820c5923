"""Built-in systems, prepared once, and what an audit of a model says."""

from functools import cache
from pathlib import Path

from harness.cases.prepare import prepare

MODELS = Path(__file__).parents[2] / "models"


@cache
def prepared(system):
    return prepare(MODELS / system)


def said(found, kind, severity="finding"):
    """The messages of one kind, as one text."""
    return "\n".join(f.message for f in found if f.kind == kind and f.severity == severity)


def grave(found):
    return [f for f in found if f.severity == "finding"]
