"""What an engine or a format does on its own, one thing at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

RemarkKind = Literal[
    "default", "inertial", "ignored", "dry friction", "joint limit", "reach", "empty limit",
    "contact", "constraint", "setting", "warning", "replaced",
]  # fmt: skip
"""Subject of a remark: each kind has a message code and a page (`harness.records.codes`)."""


@dataclass(frozen=True, kw_only=True)
class Remark:
    """Something an engine or a format adds to a model, or drops from it, on its own.

    Attributes:
        message: a sentence.
        kind: what it is about; `default` is a value that the engine assumes, or a force it adds.
        subject: what it is about, where its message has numbers that are computed rather than of
            the file: two remarks of one subject are the same; empty where the message says it all.
        fault: whether it is wrong in itself.
        address: the number or element, as `harness.modelfiles.locations` spells them:
            `body/joint[x]@damping`, `option@gravity`, `robot/link[rod]`, in Python `MASS`,
            `PinJoint()` for a call, `Space().damping` for an attribute of what it makes. With
            `sidecar:settings.` before it, a setting of the sidecar. Where nothing in the file is
            so called, the file is meant; empty: the file as a whole; None: nothing in it.
        beside: another such number, whose line is told in the message.
        value: the number, where it is about one.
        cause: what a diagnosis calls it, as in `Model.remedies` and `CompiledTree.taken`.
        shows_in: kinds of compiled terms that it enters; where one of these differs from the
            equations it is to blame, otherwise it is as it should be.
        undone_by: settings that undo it, where it is a loss of digits that no number of the file
            can mend: what of `shows_in` is right with these is the engine's own, and no fault.
    """

    message: str
    kind: RemarkKind = "default"
    subject: tuple[str, ...] = ()
    fault: bool = False
    address: str | None = None
    beside: str = ""
    value: float | None = None
    shows_in: tuple[str, ...] = ()
    undone_by: Mapping[str, object] = field(default_factory=dict)
    cause: str = ""


PULL = ("rest", "stiffness")
"""What a force that depends on positions alone shows in."""


def limit_remarks(
    name: str,
    *,
    bounds: tuple[float, float],
    reached: tuple[float, float],
    address: str,
) -> tuple[Remark, ...]:
    """A joint's limits that the motions reach, below, above; and those that they don't."""
    (lower, upper), (low, high) = bounds, reached
    if lower < low and high < upper:
        return (
            Remark(
                message=f"{name} is limited to [{lower:g}, {upper:g}], and the motions stay between"
                f" {low:.4g} and {high:.4g}",
                subject=(name, "limits"),
                address=address,
                kind="reach",
            ),
        )
    return tuple(
        Remark(
            message=(
                f"{name} is limited to [{lower:g}, {upper:g}], and the motions reach "
                f"{extreme:.4g}: the limit stops the joint"
            ),
            subject=(name, side),
            kind="joint limit",
            fault=True,
            address=address,
            value=bound,
        )
        for side, bound, extreme, beyond in (
            ("lower limit", lower, low, low <= lower),
            ("upper limit", upper, high, high >= upper),
        )
        if beyond
    )
