"""Known mistakes of people who write model files, planted in copies of any model.

Each family is a module with the names of its mistakes, the places where they apply, and the causes
that a diagnosis may name for them. A family yields nothing if a model has no place for it.
"""

from .context import Edit, Mistake, Subject, defaults_left_on, literal_causes
from .registry import known_mistakes

__all__ = ["Edit", "Mistake", "Subject", "defaults_left_on", "known_mistakes", "literal_causes"]
