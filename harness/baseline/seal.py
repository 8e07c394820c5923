"""Seals over whole records, which reveal manual edits and bad merges."""

from __future__ import annotations

import hashlib
from typing import TypeVar

import msgspec

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.baseline import (
    AcceptedAudit,
    AcceptedCase,
    Declared,
    Snapshot,
)

S = TypeVar("S", AcceptedCase, AcceptedAudit, Declared)


def canonical(record: Record) -> bytes:
    """Return the canonical JSON text of a record: sorted names, no spaces, shortest numbers."""
    return msgspec.json.encode(record, order="sorted")


def sealed(record: S) -> S:
    """Return a record with a seal over its other fields."""
    bare = msgspec.structs.replace(record, seal="")
    return msgspec.structs.replace(record, seal=_hash(canonical(bare), 16))


def snapshot_key(snapshot: Snapshot) -> str:
    """Return the name of a snapshot, derived from its content, such as `free@1f0a2b3c4d5e`."""
    return f"{snapshot.scenario}@{_hash(canonical(snapshot), 12)}"


def _hash(data: bytes, digits: int) -> str:
    return hashlib.sha256(data).hexdigest()[:digits]
