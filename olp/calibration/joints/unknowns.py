"""The unknowns of a machine of any joints: where its lines, legs and gauge really are, and what gives way.

Of candidates that look alike the first one stays, the others are 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from olp.calibration.joints.candidates import SHIFTS, TILTS, Priors, Unknown, listed
from olp.calibration.joints.weights import TABLES, of_weight, with_weight
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.kinematics.chain import Kinematics
from olp.kinematics.errors import JointErrors, LegErrors, MachineErrors, Mass, Payload
from olp.kinematics.poses import rotation_vector
from olp.kinematics.structure import Joint, Structure

#: Steps of differences as a share of the prior: 10 um of a shift of 1 mm.
_STEP = 1e-2
#: An unknown whose effect is this small beside the ones kept before it looks like them.
_ALIKE = 1e-6
#: So many random postures decide which unknowns look alike.
_POSTURES = 40
#: So many blends of the postures that were read do so for a machine with platforms.
_BLENDED = 120
#: Share of the travel about its middle in which platforms close.
_INNER = 0.2
#: Nothing is held.
NO_PAYLOAD = Payload()


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
        numbers = list(zip(self.unknowns, np.asarray(theta, float).tolist(), strict=True))
        for unknown, value in numbers:
            if unknown.table in TABLES:
                continue
            what, place = _place(unknown.key.rpartition("_")[0])
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
        errors = MachineErrors(
            joints=joints,
            gauge_shift_mm=_sum(base.gauge_shift_mm, gauge.get("shift")),
            gauge_tilt_rad=_sum(base.gauge_tilt_rad, gauge.get("tilt")),
            legs=legs,
            yields=base.yields,
            masses=self.masses,
            payload=payload,
            gravity=base.gravity,
        )
        return with_weight(errors, numbers)

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

    @property
    def yields(self) -> bool:
        """Whether joints give way to a payload."""
        return bool(self.base.yields) or any(unknown.table == "elasticity" for unknown in self.unknowns)

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
    sagging: Sequence[str] = (),
    masses: tuple[Mass, ...] = (),
    datum_mm: Vector = ZERO,
) -> Model:
    """The model with the unknowns that the structure can show by poses of its tool in an unknown frame. All
    others would change no pose: they are 0. Those that are kept stand for them, so that they may be as large
    as all of these together. `values` (n, axes) are postures of the readings. `yielding` and `sagging` are
    the rotary joints that give way under known and unknown weights. Raises ConfigError where the latter
    follows no sum of angles."""
    candidates = tuple(listed(structure, priors))
    full = Model(structure, candidates, (), datum_mm)
    try:
        kept, usual = _kept(full, _postures(structure, values))
    except CannotCompute:
        if not structure.platforms:
            raise
        # values of readings that are not those of the machine: the fit of these says what is wrong
        kept, usual = _kept(full, _middle(structure))
    elastic = tuple(of_weight(structure, priors, yielding, sagging))
    known = np.diag([*np.zeros(len(kept)), *(unknown.prior**2 for unknown in elastic)])
    known[: len(kept), : len(kept)] = usual
    sizes = np.sqrt(np.diag(usual)).tolist()
    return replace(
        full,
        unknowns=(
            *(replace(candidates[k], prior=size) for k, size in zip(kept, sizes, strict=True)),
            *elastic,
        ),
        masses=masses,
        dropped=tuple(unknown for k, unknown in enumerate(candidates) if k not in kept),
        known=known,
    )


def _postures(structure: Structure, values: Array) -> Array:
    """Postures that decide what looks alike: random ones in the travel, or blends of the given ones where a
    platform closes in a part of it alone."""
    random = np.random.default_rng(0)
    if not structure.platforms:
        ends = _travels(structure)
        return random.uniform(ends[:, 0], ends[:, 1], (_POSTURES, len(ends)))
    first, second = random.integers(0, len(values), (2, _BLENDED))
    share = random.uniform(0.0, 1.0, (_BLENDED, 1))
    return np.asarray(share * values[first] + (1.0 - share) * values[second])


def _middle(structure: Structure) -> Array:
    """Random postures about the middle of the travel, where platforms close."""
    ends = _travels(structure)
    middle, reach = ends.mean(axis=1), _INNER * 0.5 * np.ptp(ends, axis=1)
    return np.random.default_rng(0).uniform(middle - reach, middle + reach, (_BLENDED, len(ends)))


def _travels(structure: Structure) -> Array:
    """(axes, 2) mm or deg."""
    return np.array([joint.travel for joint in structure.joints.values()])


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
    if stem in ("zero", "length"):
        return stem, 0
    if len(stem) == 1:
        return ("shift", SHIFTS.index(stem)) if stem in SHIFTS else ("tilt", TILTS.index(stem))
    end, letter = stem.split("_")
    return end, SHIFTS.index(letter)


def _sum(old: Vector, more: Array | None) -> Vector:
    x, y, z = (float(value) for value in np.array(old) + (0.0 if more is None else more))
    return (x, y, z)
