"""The errors of joints and bodies as values: lengths in mm, angles in rad, actual minus commanded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np

from olp.core.arrays import Array
from olp.core.interpolation import Interpolant
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass

#: The components of an error motion in the order of columns; the last is the own motion along or about the
#: direction of the joint.
COMPONENTS = (*"XYZABC", "own")
#: The column of the own motion.
OWN = 6
#: Degrees of a full turn.
TURN_DEG = 360.0
#: A number of waves in a turn is whole within this.
_WHOLE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class MotionCurve:
    """Error motions of one joint, read at a functional point. `values` has the columns `COMPONENTS` over
    axis values in mm or deg. `point_mm` lies on the stator of a rotary joint, on the carriage of a linear
    one; where `follows` it moves with the axis value, as a reading at the tool of a moving table does."""

    values: Interpolant
    point_mm: Vector
    follows: bool = False
    periodic: bool = False

    def at(self, value: Array) -> Array:
        """(n, 7) components at axis values (n,)."""
        if self.periodic:
            low = float(self.values.x[0])
            value = low + np.mod(value - low, TURN_DEG)
        return np.asarray(self.values(value))


@dataclass(frozen=True, slots=True)
class Harmonic:
    """amplitude * sin(2 pi q / period + phase) on one of `COMPONENTS`, q and the period in mm or deg."""

    component: int
    period: float
    amplitude: float
    phase_rad: float = 0.0

    def at(self, value: Array) -> Array:
        """(n,) in mm or rad."""
        return np.asarray(self.amplitude * np.sin(value * (2.0 * np.pi / self.period) + self.phase_rad))


@dataclass(frozen=True, slots=True, eq=False)
class JointErrors:
    """All errors of one joint. `shift_mm` and `tilt_rad` say where its line really is, with no part along the
    line; `zero` (mm or rad) is added to its value. Harmonics and curves without one act at `point_mm`.
    `datum` is the value at which a tilted linear line has no shift. `backlash` is the whole play."""

    point_mm: Vector
    curves: tuple[MotionCurve, ...] = ()
    harmonics: tuple[Harmonic, ...] = ()
    shift_mm: Vector = ZERO
    tilt_rad: Vector = ZERO
    zero: float = 0.0
    datum: float = 0.0
    backlash: float = 0.0

    @property
    def repeats(self) -> bool:
        """Whether a rotary joint has the same errors after a whole turn, either way round."""
        turns = [TURN_DEG / wave.period for wave in self.harmonics]
        whole = all(abs(number - round(number)) < _WHOLE for number in turns)
        return whole and all(curve.periodic for curve in self.curves) and self.backlash == 0.0


@dataclass(frozen=True, slots=True)
class LegErrors:
    """What a leg is off its nominal anchors and length."""

    base_mm: Vector = ZERO
    platform_mm: Vector = ZERO
    length_mm: float = 0.0


@dataclass(frozen=True, slots=True)
class Yield:
    """How a joint gives way in directions of its stator. Own motion and tilts are in rad per Nm of the torque
    about its point, shifts in mm per N; `own` of a linear joint is in mm per N along its direction."""

    own: float = 0.0
    tilt: Vector = ZERO
    shift: Vector = ZERO


@dataclass(frozen=True, slots=True)
class Gravity:
    """The own turn of a rotary joint under unknown weights in rad: sine * sin(s) + cosine * cos(s).

    s is the sum of the values of the joints `angles`, each with the sign of its turn about the direction of
    `joint`."""

    joint: str
    angles: tuple[str, ...]
    sine: float = 0.0
    cosine: float = 0.0


@dataclass(frozen=True, slots=True)
class Mass:
    """A weight on the body that joint `on` moves, with its centre at axis zero."""

    on: str
    kg: float
    centre_mm: Vector


@dataclass(frozen=True, slots=True)
class Payload:
    """What the gauge frame holds; the centre counts from the gauge point, in the gauge frame."""

    kg: float = 0.0
    centre_mm: Vector = ZERO


@dataclass(frozen=True, slots=True, eq=False)
class MachineErrors:
    """The errors of a machine of any joints. Parts that are left out are without error. Legs are by platform
    and number, counted from 0."""

    joints: Mapping[str, JointErrors] = field(default_factory=dict)
    gauge_shift_mm: Vector = ZERO
    gauge_tilt_rad: Vector = ZERO
    legs: Mapping[tuple[str, int], LegErrors] = field(default_factory=dict)
    yields: Mapping[str, Yield] = field(default_factory=dict)
    masses: tuple[Mass, ...] = ()
    payload: Payload = Payload()
    gravity: tuple[Gravity, ...] = ()
