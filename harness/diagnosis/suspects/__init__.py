"""What might be wrong with a model, each as a change that can be tried, alone or with others.

`everything` lists the hypotheses: literals of the file, engine settings, axes and zeros of joints,
constants and missing terms of the equations. `Bench` tries them in the engine and in the equations.
"""

from harness.diagnosis.suspects.bench import Bench
from harness.diagnosis.suspects.suspect import Change, Suspect, everything

__all__ = ["Bench", "Change", "Suspect", "everything"]
