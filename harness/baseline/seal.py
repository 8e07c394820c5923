"""Seals: over the whole of a record, so that one that was edited or merged badly is told so."""

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
    """A record as the one JSON text that it has: names sorted, no space, shortest numbers."""
    return msgspec.json.encode(record, order="sorted")


def sealed(record: S) -> S:
    """A record with the seal over all the rest of it."""
    bare = msgspec.structs.replace(record, seal="")
    return msgspec.structs.replace(record, seal=_hash(canonical(bare), 16))


def snapshot_key(snapshot: Snapshot) -> str:
    """Name of a snapshot by what is in it, such as `free@1f0a2b3c4d5e`."""
    return f"{snapshot.scenario}@{_hash(canonical(snapshot), 12)}"


def _hash(data: bytes, digits: int) -> str:
    return hashlib.sha256(data).hexdigest()[:digits]
