"""What might be wrong with a model, each as a change that can be tried, alone or with others.

`everything` lists the hypotheses: literals of the file, engine settings, axes and zeros of joints,
constants and missing terms of the equations. `Bench` tries them in the engine and in the equations.
"""

from harness.diagnosis.hypotheses.candidate import Change, Suspect, everything
from harness.diagnosis.hypotheses.trial import Bench

__all__ = ["Bench", "Change", "Suspect", "everything"]
