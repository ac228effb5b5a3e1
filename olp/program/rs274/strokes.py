"""Strokes of the holes of canned cycles, in columns: the holes of one block, or of many of one series.

Lengths and positions are in program units, or in millimetres where `Levels` leads from one to the other.
Codes are integers, ten times the G number (810 is G81). How controls differ is in `cycle_rules`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, any_in_row, distinct, is_in
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.values import dataclass
from olp.program.rs274.codes import BACK_BORES
from olp.program.rs274.cycle_rules import CycleRules

_TAPPING = frozenset({740, 840})
#: pecking cycles, and whether each peck comes back to R
_PECKING = {730: False, 830: True}
#: pecks of a hole at most: a step far below the resolution of the numbers would never end
_MAX_PECKS = 100_000


class Step(IntEnum):
    """What one step of a cycle does. Those up to FEED are moves."""

    RAPID = 0
    FEED = 1
    DWELL = 2
    STOP = 3
    REVERSE = 4
    RESTORE = 5


#: The same as numbers: to read a member of an enumeration takes as long as a step on a short array.
_RAPID = np.uint8(Step.RAPID)
_FEED = np.uint8(Step.FEED)
_DWELL = np.uint8(Step.DWELL)

_Recipe = tuple[tuple[Step, str], ...]
_DRILL: _Recipe = ((Step.FEED, "z"), (Step.RAPID, "clear"))
_DRILL_DWELL: _Recipe = ((Step.FEED, "z"), (Step.DWELL, "z"), (Step.RAPID, "clear"))
_TAP: _Recipe = (
    (Step.FEED, "z"), (Step.STOP, "z"), (Step.REVERSE, "z"), (Step.DWELL, "z"), (Step.FEED, "home"),
    (Step.STOP, "home"), (Step.RESTORE, "home"), (Step.RAPID, "clear"),
)  # fmt: skip
_BORE: _Recipe = ((Step.FEED, "z"), (Step.FEED, "r"), (Step.RAPID, "clear"))
_BORE_STOP: _Recipe = (
    (Step.FEED, "z"), (Step.DWELL, "z"), (Step.STOP, "z"), (Step.RAPID, "clear"), (Step.RESTORE, "clear"),
)  # fmt: skip
_BORE_DWELL: _Recipe = ((Step.FEED, "z"), (Step.DWELL, "z"), (Step.FEED, "home"), (Step.RAPID, "clear"))

#: From the R level on, behind the pecks: each step and the level that it ends at.
_RECIPES: dict[int, _Recipe] = {
    730: _DRILL,
    740: _TAP,
    810: _DRILL,
    820: _DRILL_DWELL,
    830: _DRILL,
    840: _TAP,
    850: _BORE,
    760: _BORE_STOP,
    770: _BORE_STOP,
    860: _BORE_STOP,
    870: _BORE_STOP,
    890: _BORE_DWELL,
}

#: The cycles whose strokes are known.
CODES = frozenset(_RECIPES)


@dataclass(frozen=True, slots=True, eq=False)
class Drilling:
    """What (h,) holes have in common, and the cycle `code` and the numbers of each of them.

    `r`, `z`, `q` and `clearance` are in program units, and a level n lies at n * `unit` + `ground` of the
    positions. NaN stands for a `q` (peck) or a `p` (dwell in s) that is not there. `plane` is 0 to 2 as in
    `geometry.PLANES`. `clearance` is kept above the last peck (G83), or drawn back after it (G73).
    """

    code: Index
    plane: int
    r: Array
    z: Array
    q: Array
    p: Array
    clearance: float
    unit: float
    ground: float
    rules: CycleRules

    def pick(self, which: slice | Index) -> Drilling:
        """Some of the holes, or some of them several times."""
        return Drilling(
            self.code[which], self.plane, self.r[which], self.z[which], self.q[which], self.p[which],
            self.clearance, self.unit, self.ground, self.rules,
        )  # fmt: skip

    def level(self, number: Array) -> Array:
        """Positions along the tool axis of numbers in program units."""
        return np.asarray(number * self.unit + self.ground)

    @property
    def pecks(self) -> Array:
        """(h,) about how many pecks each hole has, or a few fewer; 0 where the cycle has none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            pecks = np.nan_to_num(np.maximum((self.r - self.z) / self.q - 2.0, 0.0))
        return np.where(self._of(_PECKING), pecks, 0.0)

    def faults(self) -> Iterator[tuple[Mask, Callable[[int], ProgramError]]]:
        """(h,) holes that have no known strokes, and why one of them has not, in the order of the checks."""
        r, z, q, p = self.r, self.z, self.q, self.p
        yield (
            ~self._of(CODES),
            lambda i: _error(
                f"{self._name(i)} has no geometry that is known offline; expected one of "
                f"{', '.join(f'G{known / 10:g}' for known in sorted(CODES))}; "
                "write the hole as plain moves",
                "OLP544",
            ),
        )
        yield (
            ~(np.isfinite(r) & np.isfinite(z)),
            lambda i: _error(
                f"{self._name(i)} without a finite R and Z; give both on the first block of the cycle"
            ),
        )
        back = self._of(BACK_BORES)
        yield (
            (r > z) & back,
            lambda i: _error(f"{self._name(i)} bores upwards, and its R {r[i]:g} is above its end {z[i]:g}"),
        )
        yield (
            (r < z) & ~back,
            lambda i: _error(
                f"{self._name(i)} has R {r[i]:g} below the bottom {z[i]:g}; R must not be below it"
            ),
        )
        pecking = self._of(_PECKING)
        yield (
            ~(q > 0) & pecking,
            lambda i: _error(
                f"{self._name(i)} needs a peck Q greater than zero, found {None if np.isnan(q[i]) else q[i]}"
            ),
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            yield (
                ((r - z) / q > _MAX_PECKS) & pecking,
                lambda i: _error(
                    f"{self._name(i)} with Q {q[i]:g} makes more than {_MAX_PECKS} pecks; give a larger Q",
                    "OLP543",
                ),
            )
        yield (
            np.isnan(p) & self._of(self.rules.dwells),
            lambda i: _error(f"{self._name(i)} needs a dwell P; give P0 for none"),
        )
        yield (
            p < 0,
            lambda i: _error(f"{self._name(i)} has a negative dwell P {p[i]:g}; expected zero or more"),
        )
        if not self.rules.taps_in_any_plane and self.plane:
            yield (
                self._of(_TAPPING),
                lambda i: _error(
                    f"{self._name(i)} in plane G{17 + self.plane}: LinuxCNC 2.9 taps along the wrong axes "
                    "outside G17; use G17"
                ),
            )

    def _of(self, codes: Collection[int]) -> Mask:
        """(h,) whether the cycle of each hole is one of some."""
        return is_in(self.code, list(codes))

    def _name(self, hole: int) -> str:
        return f"G{self.code[hole] / 10:g}"


def _error(message: str, code: str = "OLP531") -> ProgramError:
    return ProgramError(message, code=code)


@dataclass(frozen=True, slots=True, eq=False)
class Strokes:
    """(n,) steps in order: the `hole` of each, what it does, the position (n, 3) after it, and the seconds of
    dwells."""

    hole: Index
    step: npt.NDArray[np.uint8]
    point: Array
    seconds: Array

    def __len__(self) -> int:
        return len(self.hole)


def strokes(
    drilling: Drilling, start: Array, series: Index, place: Array, to_r: Mask, initial: Array,
    *, beside: bool = False,
) -> Strokes:  # fmt: skip
    """Strokes of holes of one or more series one behind the other, which have no `faults`; rapids of zero
    length are left out, a feed of zero length is not.

    `start` (k, 3) are the positions before the first hole of each series, `series` (h,) is that of each hole,
    `place` (h, 2) where it is along the first and second axis of the plane. `to_r` (h,) return to R only,
    and others to `initial` (k,), the positions on the tool axis before the series, where that is above R.
    `beside` a contour the tool is not at the start yet: the move to the first hole is one, however short,
    where the control does not rise before it. Pecks are counted in numbers of the program, as the control
    does it: the last one may hang on the last bit.
    """
    rules = drilling.rules
    first, second, third = PLANES[drilling.plane]
    r, z = drilling.level(drilling.r), drilling.level(drilling.z)
    initial, opening = initial[series], np.flatnonzero(np.diff(series, prepend=-1))
    # a bore from below always ends above the part
    clear = np.where((to_r & ~is_in(drilling.code, BACK_BORES)) | (r > initial), r, initial)
    came, before = np.roll(place, 1, axis=0), np.roll(clear, 1)
    came[opening], before[opening] = start[series[opening]][:, [first, second]], start[series[opening], third]
    owner, depth = _depths(drilling)
    # full pecks come back to R
    width = 2 + is_in(drilling.code, [code for code, full in _PECKING.items() if full])
    count = np.bincount(owner, minlength=len(r))
    size, codes = 3 + width * count, distinct(drilling.code).tolist()
    for code in codes:
        size[drilling.code == code] += len(_RECIPES[code])
    stop = np.cumsum(size)
    begin = stop - size
    hole = np.repeat(np.arange(len(r)), size)
    step = np.zeros(len(hole), np.uint8)
    level = np.empty(len(hole))
    # a level below R is left before the move to the hole, or on it
    below = initial < r if rules.rises_first else np.zeros(len(r), bool)
    rises = below | (before <= r) if rules.rises_first else below
    level[begin], level[begin + 1], level[begin + 2] = (
        np.where(below, r, before), np.where(rises, clear, before), r,
    )  # fmt: skip
    peck = begin[owner] + 3 + width[owner] * (np.arange(len(owner)) - (np.cumsum(count) - count)[owner])
    if peck.size:
        step[peck], level[peck] = _FEED, drilling.level(depth)
        # of two levels for one step the later holds
        level[peck + 1] = r[owner]
        level[peck + width[owner] - 1] = drilling.level(depth + drilling.clearance)
    ends = {"z": z, "r": r, "clear": clear, "home": clear if rules.feeds_home else r}
    for code in codes:
        mine = np.flatnonzero(drilling.code == code)
        for i, (what, where) in enumerate(reversed(_RECIPES[code]), 1):
            step[stop[mine] - i], level[stop[mine] - i] = what, ends[where][mine]
    prior = np.roll(level, 1)
    prior[begin] = before
    keep = (step != _RAPID) | (level != prior)
    keep[begin + 1] |= any_in_row(place != came)
    keep[begin[:1] + 1] |= beside & ~below[:1]
    point = np.empty((len(hole), 3))
    for axis, here, there in ((first, came[:, 0], place[:, 0]), (second, came[:, 1], place[:, 1])):
        point[:, axis] = there[hole]
        point[begin, axis] = here
    point[:, third] = level
    rests = step == _DWELL
    seconds = np.where(rests, np.nan_to_num(drilling.p)[hole], 0.0) if rests.any() else np.zeros(len(hole))
    return Strokes(hole[keep], step[keep], point[keep], seconds[keep])


def _depths(drilling: Drilling) -> tuple[Index, Array]:
    """(k,) the hole of each peck but the last of a hole, in order, and its depth as a number of the program.

    Repeated subtraction, as the control does it: a closed form may differ by one peck through rounding.
    """
    holes, depths = [], []
    hole = np.flatnonzero(is_in(drilling.code, list(_PECKING)))
    depth = drilling.r[hole] - drilling.q[hole]
    while hole.size:
        more = depth > drilling.z[hole]
        hole, depth = hole[more], depth[more]
        holes.append(hole)
        depths.append(depth)
        depth = depth - drilling.q[hole]
    owner = np.concatenate(holes) if holes else hole
    order = np.argsort(owner, kind="stable")
    return owner[order], np.concatenate(depths)[order] if depths else depth
