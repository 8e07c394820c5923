"""Drives of an MJCF: shortcuts such as `<position>` as gain, bias and dynamics.

All shortcuts of a class overwrite one drive, in the order of the file. Source: MuJoCo's
documentation, XML reference, actuator.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.mjcf_defaults import Chain, Values, is_limit, overwrite

PARAMETERS = 10
"""Numbers of a gain, a bias or a state's dynamics."""

WORDS = ("dyntype", "gaintype", "biastype")
RANGES = ("ctrl", "act", "force")
"""Prefixes of `range` and `limited`."""

MUSCLE_CONSTANTS = (0.01, 0.04)
MUSCLE_CURVE: Mapping[str, float] = MappingProxyType({
    "force": -1.0, "scale": 200.0, "lmin": 0.5, "lmax": 1.6, "vmax": 1.5, "fpmax": 1.3,
    "fvmax": 1.2,
})  # fmt: skip
MUSCLE_RANGE = (0.75, 1.05)


def _single(value: float) -> list[float]:
    return [value, *[0.0] * (PARAMETERS - 1)]


@dataclass(kw_only=True)
class StatedDrive:
    """A drive while its elements overwrite it.

    Attributes:
        kinds: of dynamics, gain and bias, by attribute.
        numbers: of these, likewise.
        inherited: share of the target's range that limits the control; 0 for none.
        limited: words that switch ranges on, by prefix.
    """

    kinds: dict[str, str] = field(
        default_factory=lambda: {"dyntype": "none", "gaintype": "fixed", "biastype": "none"}
    )
    dynamics: list[float] = field(default_factory=lambda: _single(1.0))
    gain: list[float] = field(default_factory=lambda: _single(1.0))
    bias: list[float] = field(default_factory=lambda: _single(0.0))
    inherited: float = 0.0
    limited: dict[str, str] = field(default_factory=dict)

    def apply(self, element: XmlElement) -> None:
        """Overwrite it with the numbers of an element.

        Raises:
            KeyError: for a tag that is not in `SHORTCUTS`.
        """
        for prefix in RANGES:
            if f"{prefix}limited" in element.attributes:
                self.limited[prefix] = element.get(f"{prefix}limited")
        SHORTCUTS[element.tag](self, element)

    def set_kinds(self, dynamics: str, gain: str, bias: str) -> None:
        """Set the kinds of dynamics, gain and bias."""
        self.kinds = dict(zip(WORDS, (dynamics, gain, bias), strict=True))

    @property
    def is_servo(self) -> bool:
        """True for a servo of position: then a positive bias by velocity is a damping ratio."""
        kinds = self.kinds["gaintype"], self.kinds["biastype"]
        return kinds == ("fixed", "affine") and self.gain[0] == -self.bias[1]


def _number(element: XmlElement, key: str, default: float) -> float:
    values = [default]
    overwrite(values, element, key)
    return values[0]


def _general(drive: StatedDrive, element: XmlElement) -> None:
    for key in WORDS:
        drive.kinds[key] = element.get(key, drive.kinds[key])
    for key, values in (
        ("dynprm", drive.dynamics), ("gainprm", drive.gain), ("biasprm", drive.bias)
    ):  # fmt: skip
        overwrite(values, element, key)


def _motor(drive: StatedDrive, element: XmlElement) -> None:
    drive.gain = _single(1.0)
    drive.set_kinds("none", "fixed", "none")


def _servo(drive: StatedDrive, element: XmlElement) -> None:
    drive.gain[0] = _number(element, "kp", drive.gain[0])
    drive.bias[1] = -drive.gain[0]
    if "kv" in element.attributes:
        drive.bias[2] = -_number(element, "kv", 0.0)
    elif "dampratio" in element.attributes:
        drive.bias[2] = _number(element, "dampratio", 0.0)
    drive.inherited = _number(element, "inheritrange", drive.inherited)
    drive.kinds |= {"gaintype": "fixed", "biastype": "affine"}


def _position(drive: StatedDrive, element: XmlElement) -> None:
    _servo(drive, element)
    if "timeconst" in element.attributes:
        drive.dynamics[0] = _number(element, "timeconst", 0.0)
        drive.kinds["dyntype"] = "filterexact" if drive.dynamics[0] else "none"


def _integrated(drive: StatedDrive, element: XmlElement) -> None:
    _servo(drive, element)
    drive.kinds["dyntype"], drive.limited["act"] = "integrator", "true"


def _velocity(drive: StatedDrive, element: XmlElement) -> None:
    gain = _number(element, "kv", drive.gain[0])
    drive.gain[0], drive.bias = gain, [0.0, 0.0, -gain, *[0.0] * (PARAMETERS - 3)]
    drive.set_kinds("none", "fixed", "affine")


def _damper(drive: StatedDrive, element: XmlElement) -> None:
    drive.gain = [0.0, 0.0, -_number(element, "kv", 0.0), *[0.0] * (PARAMETERS - 3)]
    drive.limited["ctrl"] = "true"
    drive.set_kinds("none", "affine", "none")


def _cylinder(drive: StatedDrive, element: XmlElement) -> None:
    drive.dynamics[0] = _number(element, "timeconst", drive.dynamics[0])
    overwrite(drive.bias, element, "bias")
    drive.gain[0] = _number(element, "area", drive.gain[0])
    diameter = _number(element, "diameter", -1.0)
    if diameter >= 0:
        drive.gain[0] = math.pi / 4 * diameter**2
    drive.set_kinds("filter", "fixed", "affine")


def _muscle(drive: StatedDrive, element: XmlElement) -> None:
    """Set a muscle; numbers that still have the values of another drive get those of a muscle."""
    others = StatedDrive()
    usual = [*MUSCLE_RANGE, *MUSCLE_CURVE.values()]
    for values, before, defaults in (
        (drive.dynamics, others.dynamics, MUSCLE_CONSTANTS),
        (drive.gain, others.gain, usual),
    ):
        for i, value in enumerate(defaults):
            values[i] = value if values[i] == before[i] else values[i]
    overwrite(drive.dynamics, element, "timeconst")
    drive.dynamics[2] = _number(element, "tausmooth", drive.dynamics[2])
    span = drive.gain[:2]
    overwrite(span, element, "range")
    curve = (
        _number(element, key, value)
        for key, value in zip(MUSCLE_CURVE, drive.gain[2:], strict=False)
    )
    drive.gain = [*span, *curve, *drive.gain[2 + len(MUSCLE_CURVE) :]]
    drive.bias = list(drive.gain)
    drive.set_kinds("muscle", "muscle", "muscle")


SHORTCUTS: Mapping[str, Callable[[StatedDrive, XmlElement], None]] = MappingProxyType({
    "general": _general, "motor": _motor, "position": _position, "intvelocity": _integrated,
    "velocity": _velocity, "damper": _damper, "cylinder": _cylinder, "muscle": _muscle,
})  # fmt: skip
"""Functions that overwrite a drive with an element, by its tag."""

PARAMETER_KEYS = ("dynprm", "gainprm", "biasprm")

SHORTCUT_KEYS = (
    "kp", "kv", "dampratio", "timeconst", "inheritrange", "area", "diameter", "bias", "tausmooth",
    "range", *MUSCLE_CURVE,
)  # fmt: skip
"""Attributes that only shortcuts have."""

_COUNTS = {"none": 0, "fixed": 1, "affine": 3, "muscle": 9}
"""Numbers that a gain or a bias depends on, by its kind."""

_CONSTANTS = {"filter": 1, "filterexact": 1, "muscle": 3}
"""Numbers that the dynamics of a state depend on, by their kind."""

KINDS = frozenset({*_COUNTS, *_CONSTANTS, "integrator"})
"""Dynamics, gains and biases that have a law."""


def read_drive(
    chain: Chain, *, automatic: bool, target: tuple[float, float] | None
) -> Mapping[str, Values]:
    """Return the numbers of a drive by attribute; `dampratio` if its damping follows from it.

    Args:
        chain: its element after its defaults.
        automatic: whether a range alone limits.
        target: range of its joint or tendon, or None.
    """
    drive = StatedDrive()
    for element in chain.elements:
        drive.apply(element)
    values: dict[str, Values] = {"actearly": (float(chain.word("actearly", "false") == "true"),)}
    holder = "act" if drive.kinds["dyntype"] == "integrator" else "ctrl"
    for prefix in RANGES:
        low, high = chain.numbers(f"{prefix}range", (0.0, 0.0))
        if prefix == holder and drive.inherited and target is not None:
            middle, half = sum(target) / 2, (target[1] - target[0]) / 2 * drive.inherited
            low, high = middle - half, middle + half
        word = drive.limited.get(prefix, "auto")
        values[f"{prefix}range"] = is_limit(word, (low, high), automatic=automatic) or ()
    kinds = [drive.kinds[key] for key in WORDS]
    values |= drive_values(kinds, drive.dynamics, drive.gain, drive.bias)
    if drive.is_servo and drive.bias[2] > 0:
        values |= {"biasprm": (drive.bias[0], drive.bias[1]), "dampratio": (drive.bias[2],)}
    return values


def drive_values(
    kinds: Sequence[str], dynamics: Sequence[float], gain: Sequence[float], bias: Sequence[float]
) -> Mapping[str, Values]:
    """Return kinds and numbers of a drive, by attribute, without those that have no effect.

    Args:
        kinds: of dynamics, gain and bias.
        dynamics, gain, bias: their numbers.
    """
    return {
        **{key: (kind,) for key, kind in zip(WORDS, kinds, strict=True)},
        "dynprm": tuple(dynamics[: _CONSTANTS.get(kinds[0], 0)]),
        "gainprm": tuple(gain[: _COUNTS.get(kinds[1], 0)]),
        "biasprm": tuple(bias[: _COUNTS.get(kinds[2], 0)]),
    }
