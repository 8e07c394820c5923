"""An engine whose answer is known, and which is wrong on demand: a third party's distribution.

A `.known` file is TOML: names, M, C, K and the weights W of M a = F - C v - K q - W sin q, the
step, the method and the order it claims, and under [fault] what is to be wrong.
"""

import os
import signal
import sys
import time
import tomllib

import numpy as np

from harness.engines.protocol import EngineError


class OddError(Exception):
    """Can't be rebuilt from its arguments, nor sent: as third parties' errors may be."""

    def __init__(self, first, second):
        super().__init__(f"{first} {second}")
        self.unsendable = lambda: None


class KnownModel:
    """A linear system, or pendulums, stepped by semi-implicit Euler or by Heun's method."""

    def __init__(self, path):
        try:
            self.file = tomllib.loads(path.read_text())
        except (OSError, tomllib.TOMLDecodeError) as error:
            raise EngineError(f"{path}: can't be read: {error}; see known_answer.py") from None
        self.coordinates = tuple(self.file["names"])
        self.step, self.integrator = self.file["step"], self.file["method"]
        self.fault, self.calls = self.file.get("fault", {}), 0
        parts = (np.array(self.file[name], dtype=float) for name in ("M", "C", "K", "W"))
        self.mass, self.damper, self.spring, self.weight = parts
        self.inverse = np.linalg.inv(self.mass)
        self.spring = self.spring * (1 + self.fault.get("off", 0.0))

    def exponents(self, varying_input):
        return self.file["claims"], 1

    def acceleration(self, q, v, force):
        pull = force - times(self.damper, v) - times(self.spring, q) - np.sin(q) * self.weight
        return times(self.inverse, pull)

    @np.errstate(all="ignore")
    def rollout(self, q, v, h, n, force, every):
        self.misbehave()
        shift = self.fault.get("remembers", 0.0) * self.calls
        q, v, qs, vs = q + shift, v.copy(), [], []
        for i in range(n):
            held = np.zeros_like(q) if force is None else self.held(force, q, i)
            a = self.acceleration(q, v, held)
            if self.integrator == "heun":
                later = self.acceleration(q + h * v, v + h * a, held)
                q, v = q + h * v + h * h * a / 2, v + h * (a + later) / 2
            else:
                v = v + h * a
                q = q + h * v
            q, v = self.disturb(q, v, h, i + 1)
            if (i + 1) % every == 0:
                qs.append(q)
                vs.append(v)
        return np.stack(qs, axis=1), np.stack(vs, axis=1)

    def held(self, force, q, i):
        if isinstance(force, np.ndarray):
            return force[:, i]
        return np.array([force.at(z, u) for z, u in zip(q, force.inputs[:, i], strict=True)])

    def misbehave(self):
        """What ends a process, or a call."""
        self.calls += 1
        if "hang" in self.fault:
            time.sleep(self.fault["hang"])
        if "segfault" in self.fault:
            os.kill(os.getpid(), signal.SIGSEGV)
        if "exits" in self.fault:
            sys.exit(self.fault["exits"])
        if "odd" in self.fault:
            raise OddError("two", "arguments")
        if "raises" in self.fault:
            raise RuntimeError(self.fault["raises"])

    def disturb(self, q, v, h, steps):
        """What a step does beside the equations."""
        if steps > self.fault.get("drags_after_steps", np.inf):
            v = v * (1 - self.fault.get("drag", 0.05) * h)
        if "limit" in self.fault:
            v = np.where(np.abs(q) > self.fault["limit"], 0.0, v)
            q = np.clip(q, -self.fault["limit"], self.fault["limit"])
        if "friction" in self.fault:
            lost = h * self.fault["friction"] / np.diag(self.mass)
            v = np.sign(v) * np.maximum(np.abs(v) - lost, 0.0)
        if steps * h > self.fault.get("nan_after_seconds", np.inf):
            v = v * np.nan
        return q, v


def times(matrix, rows):
    """Matrix times each row, in the same order of sums for one row as for many."""
    return (matrix * rows[:, None, :]).sum(axis=-1)


class KnownEngine:
    """The adapter that the entry point names."""

    name, formats, capabilities = "known", (".known",), ("answers that are known",)

    def version(self):
        return "1.0"

    def load(self, spec):
        if spec.settings:
            raise EngineError(f"{spec.path}.toml: no setting {', '.join(spec.settings)} is known")
        return KnownModel(spec.path)
