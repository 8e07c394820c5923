"""A reoriented model: with a reversed axis, or another zero."""

from __future__ import annotations

from collections.abc import Sequence

from physics_crosscheck.harness.engines.protocol import Force, Model, StateForce
from physics_crosscheck.reference.mechanism.numeric import Array


class ReorientedModel(Model):
    """A model whose coordinates are sign * (the inner model's - offset), (nz,) each."""

    def __init__(self, model: Model, sign: Array, offset: Array) -> None:
        self.model, self.sign, self.offset = model, sign, offset
        self.coordinates, self.step = model.coordinates, model.step
        self.integrator, self.gravity, self.epsilon = model.integrator, model.gravity, model.epsilon

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return the inner model's exponents."""
        return self.model.exponents(varying_input)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Run the inner model, with reoriented states and forces."""
        sign, offset = self.sign, self.offset
        if isinstance(force, StateForce):
            inner = force

            def reversed_at(z: Sequence[float], u: Sequence[float]) -> Sequence[float]:
                read = [(a - o) * s for a, s, o in zip(z, sign, offset, strict=True)]
                return [f * s for f, s in zip(inner.evaluate(read, u), sign, strict=True)]

            force = StateForce(inner.inputs, reversed_at)
        elif force is not None:
            force = force * sign
        z, w = self.model.rollout(q * sign + offset, v * sign, h, n, force, every)
        return (z - offset) * sign, w * sign
