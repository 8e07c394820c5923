"""Remarks: single effects of an engine or a format on a model."""

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
    """A change that an engine or a format makes to a model.

    Attributes:
        message: a sentence.
        kind: the topic; `default` is a value that the engine assumes, or a force that it adds.
        subject: the topic in detail, for messages with computed numbers: two remarks of one subject
            are equal; empty if the message identifies the remark.
        fault: whether it is an error in itself.
        address: the number or element, in the syntax of `harness.modelfiles.locations`:
            `body/joint[x]@damping`, `option@gravity`, `robot/link[rod]`, in Python `MASS`,
            `PinJoint()` for a call, `Space().damping` for an attribute of its result. The prefix
            `sidecar:settings.` marks a setting of the sidecar. An unknown or empty address stands
            for the whole file; None for no place in it.
        related_address: another such number, whose line the message reports.
        value: the number, if there is one.
        cause: the name that a diagnosis reports, as in `Model.corrective_settings` and
            `CompiledTree.engine_variants`.
        shows_in: kinds of compiled terms that it affects; if one of these differs from the
            equations, this remark explains it, otherwise it is correct.
        undone_by: settings that undo a loss of precision which no number of the file can fix. A
            difference in `shows_in` that they remove is the engine's and not a fault of the file.
    """

    message: str
    kind: RemarkKind = "default"
    subject: tuple[str, ...] = ()
    fault: bool = False
    address: str | None = None
    related_address: str = ""
    value: float | None = None
    shows_in: tuple[str, ...] = ()
    undone_by: Mapping[str, object] = field(default_factory=dict)
    cause: str = ""


POSITION_FORCE_TERMS = ("rest", "stiffness")
"""Compiled terms of a force that depends on positions only."""


def friction_remark(
    attribute: str, joint: str, friction: float, engine: str, address: str
) -> Remark:
    """Return the remark that an engine ignores the dry friction of a joint, N or N m."""
    return Remark(
        kind="dry friction",
        message=f"{attribute} of {joint} is {friction:g}; {engine} ignores it",
        subject=(joint, engine, "friction"),
        fault=True,
        address=address,
        value=friction,
    )


def limit_remarks(
    name: str, *, bounds: tuple[float, float], reached: tuple[float, float], address: str
) -> tuple[Remark, ...]:
    """Return remarks for a joint's limits that the motions reach, and for those that they do
    not.
    """
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
