"""The state of a control that carries out RS-274: the model that both reader and unroller follow.

`State` holds what is in force: modal codes, units, the position, the series of canned cycles. It has two
kinds. The reader uses axis positions in mm, with all offsets known (`axis_state`). The unroller uses program
coordinates in program units, which need no offsets (`flatten.state`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field

from olp.core.turns import Turn
from olp.core.units import MM_PER_INCH
from olp.core.values import dataclass
from olp.program.rs274.codes import ABSOLUTE, GROUPS, INCH, INVERSE_TIME, RETRACT_TO_R
from olp.program.rs274.profiles.base import Profile

NAN = float("nan")
_GROUP_OF = tuple((code, group) for group, codes in GROUPS.items() for code in codes)


def _none(code: int | None) -> int:
    """A code in force, -1 where there is none or a setting of the control decides."""
    return -1 if code is None else code


@dataclass(frozen=True, slots=True)
class Capture:
    """A word that stores the present position (G92, G10 L20): `axis`, its `word`, the unit it is in, and
    the number of moves before it. `turn` is how words lie to the axes, None where alike."""

    word: int
    axis: int
    unit_mm: float
    moves: int
    line: int
    turn: Turn | None = None


@dataclass(frozen=True, slots=True)
class PathMode:
    """A change of path mode: its words, and the path tolerance in mm (None: not stated). Moves that are
    within `merge_mm` of one line become one."""

    line: int
    name: str
    tolerance_mm: float | None = None
    merge_mm: float = 0.0


#: Why a broken series is refused.
BROKEN_SERIES = (
    "an offset, the tool length, the unit or another move comes within a series of canned cycles; what this "
    "control keeps then is not known; end the series with G80"
)


#: Why blocks of a series of cycles are refused.
TURNED_SERIES = "G90 and G91 change within a series of cycles; give R and the depth again"
#: Why a cycle is refused where it may end at two levels.
OPEN_RETRACT = (
    "whether this cycle returns to its initial level or to R is a setting of the control; give G98 or G99 "
    'before it, or state cycle_return = "initial" or "r" in the machine file'
)


#: What to do where a position is not known; where a block took it, `departures` names that block.
KNOWN_BY = "command X, Y and Z first, or give a machine file and a job file with start_mm"


@dataclass(slots=True)
class Series:
    """Canned cycles that follow one another, until another motion code is in force.

    `count` is how many series there were, `initial` the program coordinate of the tool axis before this one
    (None: not needed yet), `held` the words that later blocks inherit, by upper-case letter. All are
    numbers in program units, as controls keep them. `incremental`: they are those of G91. `broken`: an
    offset, the unit or another move came between, and not every control keeps them then
    (`CycleRules.keeps_numbers`).
    """

    count: int = 0
    initial: float | None = None
    held: dict[str, float | None] = field(default_factory=dict)
    incremental: bool = False
    broken: bool = False

    def begin(self, initial: float | None) -> None:
        self.count += 1
        self.initial = initial
        self.held = {}
        self.broken = False

    def go_on(self, further: int, initial: float) -> None:
        """Count further series, if any, the last of which begins at this number."""
        if further:
            self.count += further
            self.initial, self.broken = initial, False

    def hold(self, words: Mapping[str, float | None], depth: str) -> None:
        """Keep the words of a block that later blocks inherit; `depth` is the letter of the tool axis."""
        self.held |= {letter: words[letter] for letter in (depth, "R", "Q", "P") if letter in words}


@dataclass(slots=True)
class State:
    """Mutable while one program is followed; one instance per program.

    `motion` to `feed_mode` are codes (`codes`), `motion` None where none is in force. `unit` is G20 or G21,
    None before either. `position` (3,) is NaN where it is not known.
    """

    profile: Profile
    position: list[float] = field(default_factory=lambda: [NAN] * 3)
    motion: int | None = None
    plane: int = 170
    distance: int = ABSOLUTE
    arc_distance: int = 911
    feed_mode: int = 940
    retract: int = field(init=False)
    unit: int | None = None
    series: Series = field(default_factory=Series)
    #: program coordinate of the tool axis that cycles return to, where the control has a code for that
    return_level: float | None = None

    def __post_init__(self) -> None:
        self.retract = _none(self.profile.initial_retract)

    @property
    def absolute(self) -> bool:
        return self.distance == ABSOLUTE

    @property
    def inverse_time(self) -> bool:
        return self.feed_mode == INVERSE_TIME

    @property
    def retract_to_r(self) -> bool:
        return self.retract == RETRACT_TO_R

    @property
    def unit_mm(self) -> float:
        """mm per program unit; mm before any G20 or G21."""
        return MM_PER_INCH if self.unit == INCH else 1.0

    def take(self, codes: Iterable[int]) -> None:
        """Put the modal codes of a block into force, except its motion and its unit."""
        for code, group in _GROUP_OF:
            if code in codes:
                setattr(self, group, code)

    def in_force(self) -> set[int]:
        """The modal codes in force, except motion and unit; `take` restores them."""
        return {getattr(self, group) for group in GROUPS}

    def forget(self, axes: Iterable[int] = (0, 1, 2)) -> None:
        """The position of these axes is not known from here on."""
        for axis in axes:
            self.position[axis] = NAN
