"""Faults of literals: three small sizes and four factors."""

from collections.abc import Iterator, Sequence

from physics_crosscheck.harness.modelfiles.bindings import Binding
from physics_crosscheck.harness.records.cause import CauseId
from .mistakes import Edit, Mistake, literal_causes

SIZES = {"1e-6": 1 + 1e-6, "1e-3": 1 + 1e-3, "5 %": 1.05}
FACTORS = {"left out": 0.0, "sign": -1.0, "double": 2.0, "half": 0.5}
"""Factors for a literal: the small faults, and typical human mistakes."""

FAULTS = SIZES | FACTORS


def literal_faults(literals: Sequence[Binding], joints: Sequence[str]) -> Iterator[Mistake]:
    """Yield every nonzero bound literal, multiplied by each factor.

    Args:
        literals: the bound literals.
        joints: names of the engine's coordinates.
    """
    # A number with the opposite sign may be equivalent to a reversed axis.
    mirrored = frozenset(CauseId(kind="axis", subject=(name,)) for name in joints)
    for b in literals:
        for label, factor in FAULTS.items() if b.value else ():
            causes = literal_causes(b.address) | (mirrored if factor < 0 else frozenset())
            yield Mistake(label, b.address, Edit({b.address: b.value * factor}), causes)
