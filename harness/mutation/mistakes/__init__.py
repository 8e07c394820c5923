"""The known mistakes of people who write model files, made in copies of any model.

A family is a module: what its mistakes are called, where they apply, and which causes a diagnosis
may name for them. One that a model has no place for makes none there.
"""

from physics_crosscheck.harness.mutation.mistakes.context import Subject
from physics_crosscheck.harness.mutation.mistakes.mistake import Edit, Mistake, literal_causes
from physics_crosscheck.harness.mutation.mistakes.registry import known_mistakes

__all__ = ["Edit", "Mistake", "Subject", "known_mistakes", "literal_causes"]
