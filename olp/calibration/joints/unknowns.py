"""The unknowns of a machine of any joints: where its lines, legs and gauge really are, and what gives way.

Unknowns are listed in the order in which they are kept: the first of those that look alike stays, the others
are 0. Machine tools keep squareness and the lines of rotary axes, arms the zeros that can be entered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.errors import JointErrors, LegErrors, MachineErrors, Mass, Payload, Yield
from olp.kinematics.poses import rotation_vector
from olp.kinematics.structure import FRAME, Joint, Structure

#: With so many linear axes in its chain a machine is a machine tool.
_MACHINE_TOOL = 3
#: Letters of shifts.
_SHIFTS = "XYZ"
#: Letters of tilts.
_TILTS = "ABC"
#: A direction this close to an axis of the machine is that axis.
_ALONG = 1e-9
#: Steps of differences as a share of the prior: 10 um of a shift of 1 mm.
_STEP = 1e-2
#: An unknown whose effect is this small beside the ones kept before it looks like them.
_ALIKE = 1e-6
#: So many random postures decide which unknowns look alike.
_POSTURES = 40
#: So many blends of the postures that were read do so for a machine with platforms.
_BLENDED = 120
#: Nothing is held.
NO_PAYLOAD = Payload()


@dataclass(frozen=True, slots=True)
class Priors:
    """Standard deviations of unknowns before any reading: mm, rad, rad per Nm."""

    shift_mm: float
    tilt_rad: float
    zero_rad: float
    yield_rad_Nm: float = 1e-5

    @staticmethod
    def of(structure: Structure) -> Priors:
        """Those of an arm of 1 to 3 m reach, or a platform; smaller ones of a machine tool."""
        if is_machine_tool(structure):
            return Priors(0.2, 5e-4, 1e-3)
        return Priors(1.0, 3e-3, 3e-3)


@dataclass(frozen=True, slots=True)
class Unknown:
    """One number: the table of a calibration file, the part (an axis, "gauge", a leg as platform and number),
    and its key there with its unit. `prior` is its standard deviation in mm, rad or rad per Nm."""

    table: str
    part: str
    key: str
    prior: float
    leg: int = 0

    @property
    def name(self) -> str:
        """Such as J2.zero_urad, gauge.X_um or P leg 3 length_um."""
        return f"{self.part} leg {self.leg} {self.key}" if self.leg else f"{self.part}.{self.key}"

    @property
    def scale(self) -> float:
        """mm or rad (per Nm) of the unit of the key."""
        return 1e-6 if "urad" in self.key else 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A machine with its unknowns, the weights on its bodies, and `datum_mm`, where tilted linear lines have
    no shift. Unknowns are added to `base`, what a calibration states already. `known` (k, k) is the
    covariance of them before the readings, in mm and rad; without it each is as its prior says."""

    structure: Structure
    unknowns: tuple[Unknown, ...]
    masses: tuple[Mass, ...] = ()
    datum_mm: Vector = ZERO
    dropped: tuple[Unknown, ...] = field(default=())
    base: MachineErrors = field(default_factory=MachineErrors)
    known: Array | None = None

    @property
    def precision(self) -> Array:
        """(k, k) inverse covariance of the unknowns before the readings."""
        if self.known is None:
            return np.diag(1.0 / self.prior**2)
        scale = np.sqrt(np.diag(self.known))
        return np.asarray(np.linalg.inv(self.known / np.outer(scale, scale)) / np.outer(scale, scale))

    @property
    def root(self) -> Array:
        """(k, k) what independent numbers of size 1 are times to be as likely as the unknowns are."""
        return np.asarray(np.diag(self.prior) if self.known is None else np.linalg.cholesky(self.known))

    @property
    def prior(self) -> Array:
        """(k,) standard deviations."""
        return np.array([unknown.prior for unknown in self.unknowns])

    def errors(self, theta: Array, payload: Payload = NO_PAYLOAD) -> MachineErrors:
        """The errors of a machine whose unknowns are theta (k,)."""
        vectors: dict[tuple[str, int, str], Array] = {}
        for unknown, value in zip(self.unknowns, theta, strict=True):
            stem = unknown.key.rpartition("_")[0] if unknown.table != "elasticity" else "yield"
            what, place = _place(stem)
            vectors.setdefault((unknown.part, unknown.leg, what), np.zeros(3))[place] += value
        base = self.base
        joints = {
            name: self._joint(joint, {what: v for (part, _, what), v in vectors.items() if part == name})
            for name, joint in self.structure.joints.items()
        }
        legs = dict(base.legs)
        for part, leg, _ in vectors:
            if leg:
                own = {what: v for (p, number, what), v in vectors.items() if (p, number) == (part, leg)}
                old = base.legs.get((part, leg - 1), LegErrors())
                legs[part, leg - 1] = LegErrors(
                    _sum(old.base_mm, own.get("base")),
                    _sum(old.platform_mm, own.get("platform")),
                    old.length_mm + float(own.get("length", np.zeros(3))[0]),
                )
        gauge = {what: v for (part, _, what), v in vectors.items() if part == "gauge"}
        yields = dict(base.yields)
        for (part, _, what), value in vectors.items():
            if what == "yield":
                stiff = yields.get(part, Yield())
                yields[part] = replace(stiff, own=stiff.own + float(value[0]))
        return MachineErrors(
            joints=joints,
            gauge_shift_mm=_sum(base.gauge_shift_mm, gauge.get("shift")),
            gauge_tilt_rad=_sum(base.gauge_tilt_rad, gauge.get("tilt")),
            legs=legs,
            yields=yields,
            masses=self.masses,
            payload=payload,
        )

    def _joint(self, joint: Joint, own: dict[str, Array]) -> JointErrors:
        direction = np.array(joint.direction)
        tilt = own.get("tilt", np.zeros(3))
        datum = float(direction @ np.array(self.datum_mm))
        old = self.base.joints.get(joint.name, JointErrors(point_mm=joint.point_mm, datum=datum))
        return replace(
            old,
            shift_mm=_sum(old.shift_mm, own.get("shift")),
            tilt_rad=_sum(old.tilt_rad, tilt - direction * (direction @ tilt)),
            zero=old.zero + float(own.get("zero", np.zeros(3))[0]),
        )

    def machine(self, theta: Array, payload: Payload = NO_PAYLOAD) -> Kinematics:
        """The machine to its gauge frame."""
        return Kinematics(self.structure, self.errors(theta, payload))

    def twists(self, theta: Array, values: Array, payload: Payload = NO_PAYLOAD) -> Array:
        """(n, 6, k) mm and rad of the gauge frame at axis values (n, axes) by each unknown, in workpiece
        coordinates. Raises CannotCompute where a platform does not close."""
        columns = np.zeros((len(values), 6, len(theta)))
        for column, unknown in enumerate(self.unknowns):
            step = np.zeros(len(theta))
            step[column] = _STEP * unknown.prior
            ahead = self.machine(theta + step, payload).actual(values)
            behind = self.machine(theta - step, payload).actual(values)
            turn = rotation_vector(ahead.rotation @ np.swapaxes(behind.rotation, -1, -2))
            columns[:, :3, column] = (ahead.position - behind.position) / (2.0 * step[column])
            columns[:, 3:, column] = turn / (2.0 * step[column])
        return columns


def model_of(
    structure: Structure,
    values: Array,
    priors: Priors,
    *,
    yielding: Sequence[str] = (),
    masses: tuple[Mass, ...] = (),
    datum_mm: Vector = ZERO,
) -> Model:
    """The model with the unknowns that the structure can show by poses of its tool in an unknown frame. All
    others would change no pose: they are 0. Those that are kept stand for them, so that they may be as large
    as all of these together. `values` (n, axes) are postures of the readings."""
    listed = tuple(_listed(structure, priors))
    full = Model(structure, listed, (), datum_mm)
    kept, usual = _kept(full, _postures(structure, values))
    elastic = tuple(Unknown("elasticity", name, "own_urad_Nm", priors.yield_rad_Nm) for name in yielding)
    known = np.diag([priors.yield_rad_Nm**2] * (len(kept) + len(elastic)))
    known[: len(kept), : len(kept)] = usual
    sizes = np.sqrt(np.diag(usual)).tolist()
    return replace(
        full,
        unknowns=(*(replace(listed[k], prior=size) for k, size in zip(kept, sizes, strict=True)), *elastic),
        masses=masses,
        dropped=tuple(unknown for k, unknown in enumerate(listed) if k not in kept),
        known=known,
    )


def is_machine_tool(structure: Structure) -> bool:
    """Whether three linear axes or more are in the chain."""
    kinds = [structure.joints[name].kind for name in structure.chain if name in structure.joints]
    return kinds.count("linear") >= _MACHINE_TOOL


def _listed(structure: Structure, priors: Priors) -> Iterator[Unknown]:
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
            for k, letter in enumerate(_SHIFTS):
                if abs(joints[name].direction[k]) < 1.0 - _ALONG:
                    yield Unknown("location", name, f"{letter}_um", priors.shift_mm)

    def tilts(names: Sequence[str]) -> Iterator[Unknown]:
        for name in names:
            for k, letter in enumerate(_TILTS):
                if abs(joints[name].direction[k]) < 1.0 - _ALONG:
                    yield Unknown("location", name, f"{letter}_urad", priors.tilt_rad)

    gauge = [Unknown("location", "gauge", f"{letter}_um", priors.shift_mm) for letter in _SHIFTS]
    gauge += [Unknown("location", "gauge", f"{letter}_urad", priors.tilt_rad) for letter in _TILTS]
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
                for letter in _SHIFTS:
                    yield Unknown("legs", platform.name, f"{end}_{letter}_um", priors.shift_mm, number)


def _outward(structure: Structure) -> list[str]:
    """The parts of the chain, the ones next to the frame first: on the side of the workpiece, then the
    tool."""
    frame = structure.chain.index(FRAME)
    return [*structure.chain[:frame][::-1], *structure.chain[frame + 1 :]]


def _postures(structure: Structure, values: Array) -> Array:
    """Postures that decide what looks alike: random ones in the travel, or blends of the given ones where a
    platform closes in a part of it alone."""
    random = np.random.default_rng(0)
    if not structure.platforms:
        ends = np.array([joint.travel for joint in structure.joints.values()])
        return random.uniform(ends[:, 0], ends[:, 1], (_POSTURES, len(ends)))
    first, second = random.integers(0, len(values), (2, _BLENDED))
    share = random.uniform(0.0, 1.0, (_BLENDED, 1))
    return np.asarray(share * values[first] + (1.0 - share) * values[second])


def _kept(model: Model, values: Array) -> tuple[list[int], Array]:
    """The candidates whose effect on poses is not that of an instrument frame and those before them, and the
    covariance (kept, kept) of what they are together with all that look like them. Raises CannotCompute where
    a platform does not close."""
    prior = model.prior
    twists = model.twists(np.zeros(len(prior)), values) * prior
    position = model.machine(np.zeros(len(prior))).actual(values).position
    reach = max(float(np.abs(position - position.mean(axis=0)).max()), 1.0)
    frame = np.zeros((len(values), 6, 6))
    for k in range(3):
        frame[:, k, k] = 1.0
        frame[:, :3, 3 + k] = np.cross(np.eye(3)[k], position) / reach
        frame[:, 3 + k, 3 + k] = 1.0 / reach
    table = np.concatenate((frame, twists), axis=2)
    table[:, 3:] *= reach
    table = table.reshape(-1, table.shape[2])
    basis: list[Array] = []
    kept = []
    for column in range(table.shape[1]):
        rest = table[:, column].copy()
        size = float(np.linalg.norm(rest))
        for _ in range(2):
            for one in basis:
                rest -= one * (one @ rest)
        left = float(np.linalg.norm(rest))
        if size > 0.0 and left > _ALIKE * size:
            basis.append(rest / left)
            if column >= 6:
                kept.append(column - 6)
    if not kept:
        raise CannotCompute("no unknown of this machine changes a pose of its tool; check its chain")
    others = [6 + k for k in range(len(prior)) if k not in kept]
    same = np.linalg.lstsq(table[:, [*range(6), *(6 + k for k in kept)]], table[:, others])[0][6:]
    scale = prior[kept]
    return kept, (np.eye(len(kept)) + same @ same.T) * np.outer(scale, scale)


def _place(stem: str) -> tuple[str, int]:
    """What a key states, and the place in its vector."""
    if stem in ("zero", "length", "yield"):
        return stem, 0
    if len(stem) == 1:
        return ("shift", _SHIFTS.index(stem)) if stem in _SHIFTS else ("tilt", _TILTS.index(stem))
    end, letter = stem.split("_")
    return end, _SHIFTS.index(letter)


def _sum(old: Vector, more: Array | None) -> Vector:
    x, y, z = (float(value) for value in np.array(old) + (0.0 if more is None else more))
    return (x, y, z)
