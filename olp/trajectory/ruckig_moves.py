"""Jerk-limited moves of one axis by Ruckig: millimetres outside, metres inside.

This is the only module that imports ruckig. It never sets `intermediate_positions`: with waypoints the
community version sends the path to a server. Every result is integrated and checked, as Ruckig can drive
backwards to reach a state that it misses by rounding, or end 1e-8 m off its target. Where a result fails, the
closed form of `olp.trajectory.scurve` replaces it.
Source: L. Berscheid, T. Kroeger, "Jerk-limited Real-time Trajectory Generation with Arbitrary Target
States", RSS 2021.
"""

from __future__ import annotations

import numpy as np
import ruckig

from olp.core.arrays import Array, Mask
from olp.core.errors import CannotCompute, UsageError
from olp.core.values import dataclass
from olp.trajectory.scurve import PHASES, rest_to_rest_s, states, through_peak

#: factor on limits: without it, Ruckig fails in up to 9 % of the cases where a state is on a limit
_WIDER = 1.0 + 1e-9
#: results slower than the closed form by more than this factor are rejected
_SLOWER = 1.0 + 1e-3
#: mm; how far from its target a result may end
_CLOSE_MM = 1e-10
#: factor on limits for the closed form where a target is out of reach only by rounding
_REACH = 1.0 + 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class Moves:
    """Phases of m moves: `duration_s` and `jerk` (mm/s^3), (m, 10) each, unused phases of 0 s; `replaced`
    (m,) marks the moves from the closed form."""

    duration_s: Array
    jerk: Array
    replaced: Mask


def solve(
    length: float, v0: float, a0: float, v1: float, a1: float, V: float, A: float, J: float
) -> tuple[Array, Array]:
    """Durations s and jerks mm/s^3, (p,) each, of the fastest move over `length` mm from speed `v0` and
    acceleration `a0` to `v1` and `a1`, within speed `V`, acceleration `A` and jerk `J` (mm, s).

    Raises UsageError for values out of range, CannotCompute if no move is within the limits.
    """
    moves = solve_all(*(np.array([value], np.float64) for value in (length, v0, a0, v1, a1, V, A, J)))
    used = moves.duration_s[0] > 0.0
    return moves.duration_s[0][used], moves.jerk[0][used]


def solve_all(
    length: Array, v0: Array, a0: Array, v1: Array, a1: Array, V: Array, A: Array, J: Array
) -> Moves:
    """The same for m moves, arrays (m,) each."""
    given = np.broadcast_arrays(*(np.asarray(x, np.float64) for x in (length, v0, a0, v1, a1, V, A, J)))
    if given[0].ndim != 1:
        raise UsageError(f"moves have shape {given[0].shape}; expected (m,)")
    _check(*given)
    duration, jerk, solved = _by_ruckig(*given)
    suspect = np.flatnonzero(~_good(duration, jerk, solved, *given))
    replaced = np.zeros(len(solved), np.bool_)
    if suspect.size:
        few = [x[suspect] for x in given]
        usable = _reaches(duration[suspect], jerk[suspect], *few) & solved[suspect]
        own, own_jerk, exists = _closed_form(*few)
        better = exists & (~usable | (own.sum(axis=1) * _SLOWER < duration[suspect].sum(axis=1)))
        if not (better | usable).all():
            k = int(suspect[~(better | usable)][0])
            raise CannotCompute(
                f"no move over {given[0][k]:g} mm from speed {given[1][k]:g} to {given[3][k]:g} mm/s within "
                f"{given[5][k]:g} mm/s, {given[6][k]:g} mm/s^2, {given[7][k]:g} mm/s^3"
            )
        rows = suspect[better]
        duration[rows], jerk[rows], replaced[rows] = own[better], own_jerk[better], True
    return Moves(duration, jerk, replaced)


def _check(length: Array, v0: Array, a0: Array, v1: Array, a1: Array, V: Array, A: Array, J: Array) -> None:
    positive = (("length", length), ("speed limit", V), ("acceleration limit", A), ("jerk limit", J))
    for name, values in positive:
        if not bool(np.all(np.isfinite(values) & (values > 0.0))):
            raise UsageError(f"{name} of a move is not a number above 0")
    for name, values in (("start speed", v0), ("end speed", v1)):
        if not bool(np.all((values >= 0.0) & (values <= V * _WIDER))):
            raise UsageError(f"{name} of a move is not between 0 and its limit")
    for name, values in (("start acceleration", a0), ("end acceleration", a1)):
        if not bool(np.all(np.abs(values) <= A * _WIDER)):
            raise UsageError(f"{name} of a move is not within its limit")


def _by_ruckig(
    length: Array, v0: Array, a0: Array, v1: Array, a1: Array, V: Array, A: Array, J: Array
) -> tuple[Array, Array, Mask]:
    """Durations and jerks (m, 10) in mm, and which moves Ruckig solved."""
    solver = ruckig.Ruckig(1)
    ask = ruckig.InputParameter(1)
    trajectory = ruckig.Trajectory(1)
    calculate = solver.calculate
    ask.current_position = [0.0]
    times: list[float] = []
    jerks: list[float] = []
    failed: list[int] = []
    nothing = [0.0] * 7
    working = (ruckig.Result.Working, ruckig.Result.Finished)
    metre = [(x * scale).tolist() for x, scale in zip(
        (length, v0, a0, v1, a1, V, A, J), (1e-3,) * 5 + (1e-3 * _WIDER,) * 2 + (1e-3,), strict=True
    )]  # fmt: skip
    for k, (d, w0, b0, w1, b1, v, a, j) in enumerate(zip(*metre, strict=True)):
        ask.target_position = [d]
        ask.current_velocity = [w0]
        ask.current_acceleration = [b0]
        ask.target_velocity = [w1]
        ask.target_acceleration = [b1]
        ask.max_velocity = [v]
        ask.max_acceleration = [a]
        ask.max_jerk = [j]
        try:
            if calculate(ask, trajectory) not in working:
                raise ValueError("no trajectory")
            profile = trajectory.profiles[0][0]
            brake = profile.brake
            t, s = profile.t, profile.j
            first, rates = (brake.t, brake.j) if brake.duration > 0.0 else (nothing[:2], nothing[:2])
        except (ruckig.RuckigError, ArithmeticError, RuntimeError, ValueError):
            failed.append(k)
            t = s = nothing
            first = rates = nothing[:2]
        times += first
        times += t
        times.append(0.0)
        jerks += rates
        jerks += s
        jerks.append(0.0)
    solved = np.ones(len(length), np.bool_)
    solved[failed] = False
    shape = (len(length), PHASES)
    return np.array(times).reshape(shape), np.array(jerks).reshape(shape) * 1e3, solved


def _good(
    duration: Array, jerk: Array, solved: Mask,
    length: Array, v0: Array, a0: Array, v1: Array, a1: Array, V: Array, A: Array, J: Array,
) -> Mask:  # fmt: skip
    """Which results reach their target, no later than a move from rest to rest would."""
    given = (length, v0, a0, v1, a1, V, A, J)
    in_time = duration.sum(axis=1) <= _SLOWER * rest_to_rest_s(length, V, A, J)
    result: Mask = solved & in_time & _reaches(duration, jerk, *given)
    return result


def _reaches(
    duration: Array, jerk: Array,
    length: Array, v0: Array, a0: Array, v1: Array, a1: Array, V: Array, A: Array, J: Array,
) -> Mask:  # fmt: skip
    """Which phases end at the target, never turn back, and stay within the limits."""
    with np.errstate(all="ignore"):
        state = states(duration, jerk, length, v0, a0, v1, a1)
        used = duration > 0.0
        v = np.where(used, state.velocity, 0.0)
        start = np.where(used, state.acceleration, 0.0)
        end = start + duration * jerk
        # within a phase the speed is least where the acceleration rises through zero
        dip = np.where((start < 0.0) & (end > 0.0), start * start / (2.0 * jerk), 0.0)
        least = (v - dip).min(axis=1)
        top = np.maximum(v.max(axis=1), v1)
        small = 1e-9 * np.maximum(top, 1e-3 * V)
        close = np.minimum(_CLOSE_MM, 1e-6 * length) + 1e-14 * length
        fine: Mask = np.asarray((np.isfinite(duration) & np.isfinite(jerk) & (duration >= 0.0)).all(axis=1))
        fine &= state.missing[0] <= close
        fine &= state.missing[1] <= small
        fine &= state.missing[2] <= 1e-9 * np.minimum(A, J * duration.sum(axis=1))
        fine &= (least >= -small) & (top <= V * (1.0 + 1e-7))
        fine &= np.maximum(np.abs(start), np.abs(end)).max(axis=1) <= A * (1.0 + 1e-7)
        fine &= np.abs(jerk).max(axis=1) <= J * (1.0 + 1e-9)
    return fine


def _closed_form(
    length: Array, v0: Array, a0: Array, v1: Array, a1: Array, V: Array, A: Array, J: Array
) -> tuple[Array, Array, Mask]:
    duration, jerk, exists = through_peak(length, v0, a0, v1, a1, V, A, J)
    exists &= _reaches(duration, jerk, length, v0, a0, v1, a1, V, A, J)
    again = np.flatnonzero(~exists)
    if again.size:
        few = [x[again] for x in (length, v0, a0, v1, a1, V, A, J)]
        wide = [*few[:6], few[6] * _REACH, few[7] * _REACH]
        duration[again], jerk[again], solved = through_peak(*wide)
        exists[again] = solved & _reaches(duration[again], jerk[again], *wide)
    return duration, jerk, exists
