"""Hypotheses on a model, as perturbations that can be tried, alone or with others.

`everything` lists them: literals of the file, engine settings, axes and zeros of joints,
constants and missing terms of the equations. `TrialModel` tries them in the engine and in the
equations.
"""

from physics_crosscheck.harness.diagnosis.hypotheses.candidate import (
    Perturbation,
    TrialHypothesis,
    everything,
)
from physics_crosscheck.harness.diagnosis.hypotheses.trial import TrialModel

__all__ = ["Perturbation", "TrialHypothesis", "TrialModel", "everything"]
