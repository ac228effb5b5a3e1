"""Along programs whose words state poses serial axes keep their branch, or the program is refused."""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.posed import refused
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError, NotInvertible, ProgramError
from olp.core.values import dataclass
from olp.kinematics.pose_axes import SINGULAR
from olp.kinematics.structure import REFERENCE_RADIUS_MM

#: deg that an axis does not turn from one place of a way to the next: it went round the other way.
_ROUND_DEG = 180.0
#: Moves that are looked at at a time, so that memory is small.
_BATCH = 1 << 12
#: Places of so many moves at most, so that a short text makes no work without end.
_MOST = 1 << 20
#: Parts of a way between two places at most.
_PARTS = 64


def follow(path: JointPath) -> None:
    """Looks along the moves of serial axes that are led by poses. Raises ProgramError for one that comes to a
    singular posture or leaves the branch, or goes further than half a turn from the stated posture.
    ConfigError: for an endless axis whose errors do not repeat."""
    if not path.coordinates.poses or path.motion.structure.posture is None:
        return
    _refuse_unrepeated(path)
    known = np.isfinite(path.start).all(axis=1) & np.isfinite(path.end).all(axis=1)
    moves = path.curves.mask | (path.start != path.end).any(axis=1)
    rows = np.flatnonzero(known & ~path.kept & moves)
    for a in range(0, len(rows), _BATCH):
        _Ways.of(path, rows[a : a + _BATCH]).follow()


@dataclass(frozen=True, slots=True, eq=False)
class _Ways:
    """Places (p,) along moves in their order: the `move` of each, its `share`, its (p, axes) `words` and
    `axes`, and its (p,) `mobility`. From one to the next it goes along the move of that one, except to places
    at share 0."""

    path: JointPath
    move: Index
    share: Array
    words: Array
    axes: Array
    mobility: Array

    @staticmethod
    def of(path: JointPath, rows: Index) -> _Ways:
        """The ends of moves, places along arcs, and starts where no move before ends there."""
        before = rows - 1
        fresh = np.append(True, rows[:-1] != before[1:])[: len(rows)] | (path.tool[rows] != path.tool[before])
        fresh |= (path.start[rows] != path.end[before]).any(axis=1)
        count = path.curves.samples(rows, 1.0) + 1
        owner, step = spread(count)
        share = np.append(np.zeros(int(fresh.sum())), (step + 1) / count[owner])
        move = np.append(rows[fresh], rows[owner])
        order = np.lexsort((share, move))
        return _Ways.at(path, move[order], share[order])

    @staticmethod
    def at(path: JointPath, move: Index, share: Array) -> _Ways:
        """Raises ProgramError where no axis values in the branch reach a place."""
        words, tool = path.at(move, share), path.tool[move]
        try:
            axes = path.motion.axes(words, tool, path.tip[move])
        except NotInvertible as error:
            raise refused(
                "a place along this move is out of reach in the branch of kinematics.posture; lead it "
                "around, or place the part elsewhere",
                int(path.line[move[error.rows[0]]]),
            ) from None
        return _Ways(path, move, share, words, axes, path.motion.stated_mobility(axes, tool))

    def follow(self) -> None:
        """Looks closer and closer where the axes may turn fast. The way to the next singular posture, of the
        tip and as arcs of the tool, is at least as the square of the mobility. Raises ProgramError."""
        ways, rotary = self, self.path.coordinates.rotary
        scale = np.where(rotary, np.radians(REFERENCE_RADIUS_MM), 1.0)
        while True:
            ways.refuse_singular()
            least = np.minimum(ways.mobility[1:], ways.mobility[:-1])
            way = np.linalg.norm(np.diff(ways.words, axis=0) * scale, axis=1)
            parts = np.ceil(way / (REFERENCE_RADIUS_MM * least**2)).clip(1, _PARTS).astype(np.int64)
            parts[ways.share[1:] == 0.0] = 1
            if (parts == 1).all():
                break
            if parts.sum() > _MOST:
                raise _singular(ways.path, ways.move[np.argmin(ways.mobility)])
            ways = ways.closer(parts)
        ways.refuse_round()

    def closer(self, parts: Index) -> _Ways:
        """With the ways between neighbours in parts (p - 1,)."""
        owner, step = spread(parts - 1)
        begin = np.where(self.move[1:] == self.move[:-1], self.share[:-1], 0.0)[owner]
        share = begin + (step + 1) / parts[owner] * (self.share[1:][owner] - begin)
        more = _Ways.at(self.path, self.move[1:][owner], share)
        order = np.lexsort((np.append(self.share, share), np.append(self.move, more.move)))
        names = ("move", "share", "words", "axes", "mobility")
        both = [np.concatenate((getattr(self, name), getattr(more, name)))[order] for name in names]
        return _Ways(self.path, *both)

    def refuse_singular(self) -> None:
        low = np.flatnonzero(self.mobility < SINGULAR)
        if low.size:
            raise _singular(self.path, self.move[low[0]])

    def refuse_round(self) -> None:
        """Axis values are within half a turn of the posture: one that goes round goes by a whole turn."""
        structure = self.path.motion.structure
        assert structure.posture is not None
        turning = np.array([unit == "deg" for unit in structure.units])
        far = np.abs(np.diff(self.axes, axis=0)) * turning > _ROUND_DEG
        far[self.share[1:] == 0.0] = False
        far[:, [structure.order.index(name) for name in structure.endless]] = False
        if far.any():
            row = int(np.argmax(far.any(axis=1)))
            column = int(np.argmax(far[row]))
            raise refused(
                f"along this move {structure.order[column]} goes further than half a turn from its "
                f"{structure.posture[column]:g} deg in kinematics.posture; state a posture in the middle of "
                "the program, or place the part elsewhere",
                int(self.path.line[self.move[row + 1]]),
            )


def _refuse_unrepeated(path: JointPath) -> None:
    errors, structure = path.motion.machines[0].errors.joints, path.motion.structure
    for name in sorted(structure.endless):
        if name in errors and not errors[name].repeats:
            raise ConfigError(
                f"kinematics.endless names {name}, whose errors are others in the next turn; expected curves "
                "that are periodic, harmonics of whole parts of a turn, and no backlash"
            )


def _singular(path: JointPath, move: int) -> ProgramError:
    return refused(
        "this move comes to a singular posture, where branches meet; lead it around, or place the part "
        "elsewhere",
        int(path.line[move]),
    )
