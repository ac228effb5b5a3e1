"""Splines of RS-274 (G5, G5.1) and NURBS (G5.2, G5.3) as chords.

All are B-splines in XY with weights, over an open uniform row of knots, as LinuxCNC's documentation of G5 to
G5.3 has them and its interpreter makes them.
G5 has four points, G5.1 three, and G5.2 to G5.3 list theirs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ProgramError
from olp.core.units import MM_PER_INCH
from olp.core.values import dataclass
from olp.program.rs274.codes import INCH, SPLINES
from olp.program.rs274.flatten.expressions import filled, whole
from olp.program.rs274.flatten.state import MOTIONS, NO_AXES, ProgramState, Value

#: Largest distance of a chord from its spline, mm: less than the last digit of most programs.
CHORD_MM = 0.0005
#: Order of a NURBS that states none, and the least one.
_ORDER = 3
#: Chords between two knots, at most.
_MOST_PIECES = 1 << 14
# ten times the codes
_CUBIC = 50
_QUADRATIC = 51
_POINTS = 52
_END = 53
#: Words that belong to a spline.
SPLINE_WORDS = frozenset("xyijpql")
#: M codes that stop behind the move of their block.
_STOPS = frozenset({0, 1, 2, 30, 60})


@dataclass(slots=True)
class Nurbs:
    """The control points of an open NURBS, with weights, and its order."""

    points: list[tuple[float, float]]
    weights: list[float]
    order: int = _ORDER


class Splines:
    """Follows the splines of a program, whose blocks are given in the order of the run."""

    def __init__(self, state: ProgramState) -> None:
        self._state = state
        self._open: Nurbs | None = None
        # direction in which a G5 goes on that states no I and J; None where the block before is no G5
        self._onward: tuple[float, float] | None = None

    def takes(self, words: Sequence[Value]) -> bool:
        """Whether a block is of a spline. Raises ProgramError for one that depends on what is in force behind
        a spline."""
        state = self._state
        codes = state.codes(words)
        if codes & SPLINES:
            return True
        bare = not codes & (MOTIONS | NO_AXES) and any(letter in "xyz" for letter, _ in words)
        if self._open is not None:
            if codes & MOTIONS:
                raise ProgramError(
                    "another motion begins before the G5.3 of a NURBS; give G5.3 first", code="OLP518"
                )
            return bare
        if codes & MOTIONS:
            self._onward = None
        elif bare and state.motion in SPLINES:
            raise ProgramError(
                "a block behind a spline states no motion code, and which one is in force depends on the "
                "control; give G0 or G1",
                code="OLP517",
            )
        return False

    def chords(self, words: Sequence[Value]) -> list[tuple[float, float]]:
        """The ends of the chords of a block, none where it only states points.

        Its modes are in force. Positions are in program units. Raises ProgramError for what the control
        refuses.
        """
        codes = self._state.codes(words) & SPLINES
        given = {letter: value for letter, value in words if letter in SPLINE_WORDS}
        code = next(iter(codes), _POINTS)
        self._check(words)
        if code in (_CUBIC, _QUADRATIC):
            return self._bezier(code, given)
        return self._nurbs(code, given)

    def _check(self, words: Sequence[Value]) -> None:
        state = self._state
        if state.plane != 170 or state.compensated:
            raise ProgramError(
                "a spline is in G17 without cutter compensation only; give G17 and G40 before it",
                code="OLP518",
            )
        if state.inverse_time:
            raise ProgramError(
                "a spline in G93 has one time for all of its chords; give G94 and a feed", code="OLP518"
            )
        other = next((letter for letter, _ in words if letter in "zabcuvw"), "")
        if other:
            raise ProgramError(
                f"a spline moves X and Y only, and its block has {other.upper()}; move {other.upper()} in a "
                "block of its own",
                code="OLP516",
            )
        if any(letter == "m" and value in _STOPS for letter, value in words):
            raise ProgramError(
                "the block of a spline ends the program or stops it; put M into its own block", code="OLP518"
            )

    def _start(self) -> tuple[float, float]:
        return self._state.position_of(0), self._state.position_of(1)

    def _target(self, given: dict[str, float | None]) -> tuple[float, float]:
        x0, y0 = self._start()
        if self._state.absolute:
            return filled(given.get("x", x0)), filled(given.get("y", y0))
        return x0 + filled(given.get("x", 0.0)), y0 + filled(given.get("y", 0.0))

    def _pair(self, given: dict[str, float | None], letters: str, what: str) -> tuple[float, float]:
        if not set(letters) <= given.keys():
            raise ProgramError(f"a {what} needs {letters[0].upper()} and {letters[1].upper()}", code="OLP516")
        return filled(given[letters[0]]), filled(given[letters[1]])

    def _bezier(self, code: int, given: dict[str, float | None]) -> list[tuple[float, float]]:
        if self._open is not None:
            raise ProgramError("a spline begins before the G5.3 of a NURBS; give G5.3 first", code="OLP518")
        (x0, y0), (x1, y1) = self._start(), self._target(given)
        if code == _QUADRATIC:
            i, j = self._pair(given, "ij", "G5.1")
            middle = [(x0 + i, y0 + j)]
            self._onward = None
        else:
            if self._onward is not None and not given.keys() & set("ij"):
                i, j = self._onward
            else:
                i, j = self._pair(given, "ij", "G5 that does not go on another G5")
            p, q = self._pair(given, "pq", "G5")
            middle = [(x0 + i, y0 + j), (x1 + p, y1 + q)]
            self._onward = -p, -q
        points = np.array([(x0, y0), *middle, (x1, y1)])
        return self._written(points, np.ones(len(points)), len(points))

    def _nurbs(self, code: int, given: dict[str, float | None]) -> list[tuple[float, float]]:
        self._onward = None
        if code == _END:
            done, self._open = self._open, None
            if done is None:
                raise ProgramError("G5.3 ends a NURBS that no G5.2 begins", code="OLP532")
            if given.keys() & SPLINE_WORDS:
                raise ProgramError("G5.3 takes no words; put the last point before it", code="OLP516")
            if len(done.points) < done.order:
                raise ProgramError(
                    f"a NURBS of order {done.order} has {len(done.points)} points; expected {done.order} "
                    "or more",
                    code="OLP516",
                )
            return self._written(np.array(done.points), np.array(done.weights), done.order)
        weight = filled(given["p"]) if "p" in given else None
        if weight is not None and weight <= 0:
            raise ProgramError("P of a NURBS is the weight of a point; expected more than 0", code="OLP516")
        if self._open is None:
            alone = not given.keys() & set("xy")
            self._open = Nurbs([self._start()], [weight if alone and weight is not None else 1.0])
        if "l" in given:
            self._open.order = max(whole(filled(given["l"]), "the order L of a NURBS"), _ORDER)
        if given.keys() & set("xy"):
            self._pair(given, "xy", "point of a NURBS")
            if weight is None:
                raise ProgramError("a point of a NURBS has no weight; give P", code="OLP516")
            self._open.points.append(self._target(given))
            self._open.weights.append(weight)
        return []

    def _written(self, points: Array, weights: Array, order: int) -> list[tuple[float, float]]:
        within = CHORD_MM / MM_PER_INCH if self._state.unit == INCH else CHORD_MM
        return [(x, y) for x, y in chords(points, weights, order, within)[1:].tolist()]


def chords(points: Array, weights: Array, order: int, within: float) -> Array:
    """(n, 2) points on the spline through the first and the last of `points` (m, 2), whose chords keep
    `within` of it. The same unit. Raises ProgramError where that takes too many."""
    spans = len(points) - order + 1
    parameters = []
    for span in range(spans):
        pieces = 2
        while True:
            # each chord is looked at in its middle and its quarters
            fine = span + np.linspace(0.0, 1.0, 4 * pieces + 1)
            on = at(points, weights, order, fine)
            if _off(on, 4) <= within:
                break
            pieces *= 2
            if pieces > _MOST_PIECES:
                raise ProgramError(
                    f"a spline needs more than {_MOST_PIECES} chords between two knots", code="OLP543"
                )
        parameters.append(fine[:-1:4])
    return at(points, weights, order, np.concatenate([*parameters, [float(spans)]]))


def _off(on: Array, step: int) -> float:
    """The largest distance of points (n, 2) from the chords between every `step`th of them."""
    a, b = on[:-1:step], on[step::step]
    along = b - a
    length = np.maximum(np.hypot(*along.T), 1e-300)
    worst = 0.0
    for k in range(1, step):
        away = on[k::step] - a
        share = np.clip((away * along).sum(axis=1) / length**2, 0.0, 1.0)
        worst = max(worst, float(np.hypot(*(away - share[:, None] * along).T).max()))
    return worst


def at(points: Array, weights: Array, order: int, parameter: Array) -> Array:
    """(n, 2) points of a NURBS with the order (degree + 1) at `parameter` (n,), from 0 to its spans."""
    count = len(points)
    spans = count - order + 1
    knots = np.clip(np.arange(count + order) - order + 1, 0, spans).astype(float)
    span = np.clip(np.floor(parameter), 0, spans - 1).astype(np.int64) + order - 1
    homogeneous = np.column_stack((points * weights[:, None], weights))
    # de Boor's scheme: the points of each span, drawn together level by level
    held = [homogeneous[span - order + 1 + k] for k in range(order)]
    for level in range(1, order):
        for k in range(order - 1, level - 1, -1):
            low, high = knots[span - order + 1 + k], knots[span + k - level + 1]
            share = ((parameter - low) / (high - low))[:, None]
            held[k] = (1 - share) * held[k - 1] + share * held[k]
    return np.asarray(held[-1][:, :2] / held[-1][:, 2:])
