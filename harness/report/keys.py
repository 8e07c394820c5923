"""By what records of a report belong together."""

from __future__ import annotations

from harness.records.case import Case
from harness.records.model import Model

ModelKey = tuple[str, str, str]
"""Folder, model file and engine: two folders may hold systems of the same name."""


def model_key(record: Case | Model) -> ModelKey:
    """The key of a model, or of a case's."""
    return record.folder, record.model, record.engine
