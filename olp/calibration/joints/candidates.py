"""The numbers that a fit of a machine of any joints may find, in the order in which they are kept.

The first of those that look alike stays. Machine tools keep squareness and the lines of rotary axes, arms the
zeros that can be entered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from olp.core.values import dataclass
from olp.kinematics.structure import FRAME, Structure

#: With so many linear axes in its chain a machine is a machine tool.
_MACHINE_TOOL = 3
#: Letters of shifts.
SHIFTS = "XYZ"
#: Letters of tilts.
TILTS = "ABC"
#: A direction this close to an axis of the machine is that axis.
_ALONG = 1e-9


@dataclass(frozen=True, slots=True)
class Priors:
    """Standard deviations of unknowns before any reading: mm, rad, rad per Nm. `gravity_rad` is that of the
    turn of a joint under weights that are not known."""

    shift_mm: float
    tilt_rad: float
    zero_rad: float
    yield_rad_Nm: float = 1e-5
    gravity_rad: float = 1e-3

    @staticmethod
    def of(structure: Structure) -> Priors:
        """Those of an arm of 1 to 3 m reach, or a platform; smaller ones of a machine tool."""
        if is_machine_tool(structure):
            return Priors(0.2, 5e-4, 1e-3)
        return Priors(1.0, 3e-3, 3e-3)


@dataclass(frozen=True, slots=True)
class Unknown:
    """One number: the table of a calibration file, the part (an axis, "gauge", a leg as platform and number),
    and its key there with its unit. `prior` is its standard deviation in mm, rad or rad per Nm. Keys of
    gravity end in the axes whose values are summed, such as "sin_urad J2 J3"."""

    table: str
    part: str
    key: str
    prior: float
    leg: int = 0

    @property
    def name(self) -> str:
        """Such as J2.zero_urad, gauge.X_um, P leg 3 length_um or J2.sin_urad(J2+J3)."""
        key, *angles = self.key.split()
        if angles:
            return f"{self.part}.{key}({'+'.join(angles)})"
        return f"{self.part} leg {self.leg} {self.key}" if self.leg else f"{self.part}.{self.key}"

    @property
    def scale(self) -> float:
        """mm or rad (per Nm) of the unit of the key."""
        return 1e-6 if "urad" in self.key else 1e-3


def is_machine_tool(structure: Structure) -> bool:
    """Whether three linear axes or more are in the chain."""
    kinds = [structure.joints[name].kind for name in structure.chain if name in structure.joints]
    return kinds.count("linear") >= _MACHINE_TOOL


def listed(structure: Structure, priors: Priors) -> Iterator[Unknown]:
    """All candidates, in the order in which they are kept."""
    joints = structure.joints
    outward = [name for name in _outward(structure) if name in joints]
    outward += [name for name, joint in joints.items() if name not in outward and joint.kind != "length"]
    rotary = [name for name in outward if joints[name].kind == "rotary"]
    slides = [name for name in outward if joints[name].kind == "linear"]

    def zeros(names: Sequence[str]) -> Iterator[Unknown]:
        for name in names:
            turns = joints[name].kind == "rotary"
            key, prior = ("zero_urad", priors.zero_rad) if turns else ("zero_um", priors.shift_mm)
            yield Unknown("location", name, key, prior)

    def shifts(names: Sequence[str]) -> Iterator[Unknown]:
        for name in names:
            for k, letter in enumerate(SHIFTS):
                if abs(joints[name].direction[k]) < 1.0 - _ALONG:
                    yield Unknown("location", name, f"{letter}_um", priors.shift_mm)

    def tilts(names: Sequence[str]) -> Iterator[Unknown]:
        for name in names:
            for k, letter in enumerate(TILTS):
                if abs(joints[name].direction[k]) < 1.0 - _ALONG:
                    yield Unknown("location", name, f"{letter}_urad", priors.tilt_rad)

    gauge = [Unknown("location", "gauge", f"{letter}_um", priors.shift_mm) for letter in SHIFTS]
    gauge += [Unknown("location", "gauge", f"{letter}_urad", priors.tilt_rad) for letter in TILTS]
    if is_machine_tool(structure):
        square = [("Y", "C_urad"), ("Z", "B_urad"), ("Z", "A_urad")]
        first = [unknown for unknown in tilts(slides) if (unknown.part, unknown.key) in square]
        yield from sorted(first, key=lambda unknown: square.index((unknown.part, unknown.key)))
        for name in rotary:
            yield from (*shifts([name]), *tilts([name]), *zeros([name]))
        yield from gauge
        yield from zeros(slides)
        yield from (unknown for unknown in tilts(slides) if unknown not in first)
        return
    yield from zeros(rotary)
    yield from shifts(rotary)
    yield from tilts(rotary)
    yield from _of_legs(structure, priors)
    yield from zeros(slides)
    yield from tilts(slides)
    yield from gauge


def _of_legs(structure: Structure, priors: Priors) -> Iterator[Unknown]:
    for platform in structure.platforms.values():
        numbers = range(1, len(platform.legs) + 1)
        for number in numbers:
            yield Unknown("legs", platform.name, "length_um", priors.shift_mm, number)
        for end in ("base", "platform"):
            for number in numbers:
                for letter in SHIFTS:
                    yield Unknown("legs", platform.name, f"{end}_{letter}_um", priors.shift_mm, number)


def _outward(structure: Structure) -> list[str]:
    """The parts of the chain, the ones next to the frame first: on the side of the workpiece, then the
    tool."""
    frame = structure.chain.index(FRAME)
    return [*structure.chain[:frame][::-1], *structure.chain[frame + 1 :]]
