"""Which moves belong to which: programs whose moves are split in a known way."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import paths
from cases.acceptance import TRUE_ZERO, machine
from cases.paths import (
    CONTROL,
    CYCLE,
    NAN,
    OF_MACHINE,
    PASS,
    Known,
    Move,
    arc,
    drawn,
    hole,
    line,
    rapid,
    toolpath,
)

from olp.core.arrays import Array
from olp.core.errors import ProgramError
from olp.core.toolpath import Kind, Toolpath
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.files.config import load_setup
from olp.program.holes import Hole
from olp.program.program import Program
from olp.program.registry import DIALECTS, read
from olp.proof import alignment, matching
from olp.proof.matching import match

BOX = np.tile([-1000.0, 2000.0], (3, 1))
MODEL = build(Calibration("exact", BOX), "FXYZ")
NEAR_MM = 0.05
START = "G21 G90 G17 G54 G61\nG0 X0 Y0 Z0\n"
#: Number of parts of a move; more than a window allows at first among them.
PARTS = (1, 1, 1, 2, 3, 7, 90)
#: mm; by how much a correction moves the ends of parts.
OFF_MM = 0.003


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machine(tmp_path_factory.mktemp("matching"), tables=TRUE_ZERO)


def program(text: str, folder: Path) -> Program:
    return read((START + text).encode(), load_setup(folder, None), DIALECTS["linuxcnc"])


def groups(nominal: Program, corrected: Program) -> list[int]:
    return match(nominal, nominal.toolpath.end_mm, corrected, MODEL, NEAR_MM).tolist()


def split_at_random(seed: int, moves: int) -> tuple[str, str, list[int]]:
    """A nominal program, one whose moves are split, and the last move of each; behind the move to the
    start."""
    rng = np.random.default_rng(seed)
    here = np.zeros(3)
    nominal, corrected, last = [], [], [0]
    for _ in range(moves):
        kind = rng.choice(["G0", "G1", "G1", "G3"])
        count = 1 if kind == "G0" else int(rng.choice(PARTS))
        there = here + rng.uniform(5.0, 60.0, 3) * rng.choice([-1.0, 1.0], 3)
        shares = np.arange(1, count + 1) / count
        if kind == "G3":
            # half a turn from here about a centre on the way, with a rise
            centre = (here + there)[:2] / 2
            arm = here[:2] - centre
            nominal.append(word("G3", there) + f" I{-arm[0]:.6f} J{-arm[1]:.6f}")
            before = here
            for share in shares:
                c, s = math.cos(math.pi * share), math.sin(math.pi * share)
                turned = centre + np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
                end = np.array([*turned, here[2] + share * (there - here)[2]])
                corrected.append(
                    word("G3", end) + f" I{centre[0] - before[0]:.6f} J{centre[1] - before[1]:.6f}"
                )
                before = end
        else:
            nominal.append(word(kind, there))
            ends = here + shares[:, None] * (there - here)
            corrected += [word(kind, end + rng.uniform(-OFF_MM, OFF_MM, 3)) for end in ends]
        last.append(last[-1] + count)
        here = there
    return "\n".join(nominal) + "\n", "\n".join(corrected) + "\n", last


def word(code: str, end: np.ndarray) -> str:
    feed = "" if code == "G0" else " F500"
    return f"{code} X{end[0]:.6f} Y{end[1]:.6f} Z{end[2]:.6f}{feed}"


@pytest.mark.parametrize("seed", range(8))
def test_parts_belong_to_their_move(seed: int, folder: Path) -> None:
    nominal, corrected, last = split_at_random(seed, 25)
    assert groups(program(nominal, folder), program(corrected, folder)) == last


@pytest.mark.parametrize("seed", range(4))
def test_one_wrong_coordinate_shifts_no_other(seed: int, folder: Path) -> None:
    nominal, corrected, last = split_at_random(seed, 25)
    lines = corrected.splitlines()
    for wrong in (last[9] - 1, last[10] - 1):
        lines[wrong] = lines[wrong].replace(" Z", " Z1", 1) if " Z-" not in lines[wrong] else lines[wrong]
    straight = [k for k in (9, 10) if "I" not in lines[last[k] - 1]]
    if len(straight) == 2:
        assert groups(program(nominal, folder), program("\n".join(lines) + "\n", folder)) == last


def test_steps_before_a_move_belong_to_it(folder: Path) -> None:
    """Backlash is taken up beside the waypoint before the move."""
    nominal = "G1 X10 F500\nX20\nX30\nG0 Z9\n"
    corrected = "G1 X10 F500\nX10.004\nX20\nX20.004\nX30\nG0 Z9\n"
    assert groups(program(nominal, folder), program(corrected, folder)) == [0, 1, 3, 5, 6]


def test_whole_circles_on_a_shifted_zero_leave_no_doubt(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each passes its end as it begins, and has a step before each half; only doubts are searched."""
    nominal = program("G0 X0\n" + 30 * "G2 I9 F500\n", folder)
    half = "G1 X1.003 F500\nG2 X19 I9\nG1 X18.997\nG2 X1 I-9\n"
    corrected = program("G0 X1\n" + 30 * half, folder)
    monkeypatch.setattr("olp.proof.alignment.Alignment._window", None)
    target = nominal.toolpath.end_mm.copy()
    target[1:, 0] += 1.0
    ends = match(nominal, target, corrected, MODEL, NEAR_MM)
    assert ends.tolist() == [0, 1, *range(5, 125, 4)]


def test_what_comes_behind_the_last_waypoint_belongs_to_it(folder: Path) -> None:
    nominal, corrected = "G1 X10 F500\nG2 X10 I-5\n", "G1 X10 F500\nG2 X0 I-5\nX10 I5\n"
    assert groups(program(nominal, folder), program(corrected, folder)) == [0, 1, 3]


def test_programs_of_as_many_moves_are_matched_one_by_one(folder: Path) -> None:
    text = "G1 X10 F500\nX20\nX30\n"
    assert groups(program(text, folder), program(text, folder)) == [0, 1, 2, 3]
    assert groups(program(text, folder), program(text.replace("X20", "X25"), folder)) == [0, 1, 2, 3]


def test_another_job_is_refused(folder: Path) -> None:
    text = "G1 X10 F500\nX20\nX30\nX40\n"
    with pytest.raises(ProgramError, match="4 moves and holes, fewer than the 5 of the nominal one"):
        groups(program(text, folder), program("G1 X10 F500\nX20\nX30\n", folder))
    # three of five waypoints are farther off than 1 mm, and two of five are a wrong program of this job
    with pytest.raises(ProgramError, match=r"3 of 5 waypoints are farther than 1 mm .* at its line 4;"):
        groups(program(text, folder), program("G1 X10 F500\nX22\nX33\nX44\n", folder))
    two = program("G1 X10 F500\nX20\nX33\nX44\n", folder)
    assert groups(program(text, folder), two) == [0, 1, 2, 3, 4]
    assert groups(program("", folder), program("", folder)) == [0]


@pytest.mark.parametrize("parts", (63, 66, 200, 700))
@pytest.mark.parametrize("split", (3, 8, 13))
def test_a_move_of_many_parts_beside_a_wrong_one(split: int, parts: int, folder: Path) -> None:
    """Where a waypoint is far off, so much is in doubt that the next moves are aligned at once."""
    ends = np.array([[10.0 * k, 5.0 * (k % 2), 0.0] for k in range(1, 15)])
    nominal = "".join(word("G1", end) + "\n" for end in ends)
    lines, last = [], [0]
    for k, end in enumerate(ends):
        count = parts if k == split else 1
        begin = ends[k - 1] if k else np.zeros(3)
        for share in np.arange(1, count + 1) / count:
            lines.append(word("G1", begin + share * (end - begin)))
        last.append(last[-1] + count)
    lines[last[2] - 1] = word("G1", ends[1] + [0.0, 3.0, 0.0])
    assert groups(program(nominal, folder), program("\n".join(lines) + "\n", folder)) == last


# -- paths without a text --------------------------------------------------------------------------------


def ends(
    nominal: Toolpath,
    corrected: Toolpath,
    *,
    near_mm: float = NEAR_MM,
    shift: Array | None = None,
    model: Known | None = None,
    holes: tuple[tuple[Hole, ...], tuple[Hole, ...]] = ((), ()),
) -> list[int]:
    mine, theirs = paths.program(nominal, *holes[0]), paths.program(corrected, *holes[1])
    target = nominal.end_mm if shift is None else nominal.end_mm + shift
    return match(mine, target, theirs, model or Known(), near_mm).tolist()


def in_doubt(*_: Any) -> None:
    raise AssertionError("searched, though nothing is in doubt")


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search for the least squares fails."""
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)


@pytest.fixture
def at_once(plain: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """So does a search for the end of one move alone."""
    monkeypatch.setattr(alignment.Alignment, "_plain_split", in_doubt)


#: A step before each cut, and the last one split.
STEPS = (
    rapid(0, 0, 0), line(10, 0, 0), line(10.004, 0, 0), line(20, 0, 0), line(20, 0.004, 0), line(20, 5, 0),
    line(20, 20, 0), rapid(20, 20, 9),
)  # fmt: skip
CUTS = (rapid(0, 0, 0), line(10, 0, 0), line(20, 0, 0), line(20, 20, 0), rapid(20, 20, 9))


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("seed", range(5))
def test_parts_of_lines_and_arcs_in_all_planes_are_in_no_doubt(seed: int) -> None:
    nominal, corrected, groups = drawn(seed, 40)
    assert ends(nominal, corrected) == groups


@pytest.mark.parametrize("page", (12, 17, 100))
@pytest.mark.parametrize("seed", range(3))
def test_pages_do_not_matter(seed: int, page: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither where all is plain nor where it is searched."""
    nominal, corrected, groups = drawn(seed, 60)
    monkeypatch.setattr(matching, "_PAGE", page)
    assert ends(nominal, corrected) == groups
    doubtful, other, shift = in_doubt_at_random(seed)
    monkeypatch.setattr(matching, "_MOST_FAR", 1.0)
    got = ends(doubtful, other, shift=shift, near_mm=0.0)
    monkeypatch.setattr(matching, "_PAGE", 1 << 14)
    assert got == ends(doubtful, other, shift=shift, near_mm=0.0)


@pytest.mark.usefixtures("plain")
def test_a_whole_circle_of_another_length_does_not_end_as_it_begins() -> None:
    """Its parts go in both directions, so that the length of the path tells nothing."""
    whole = arc(50, 0, 0, centre=(59, 0, 0), sweep=2 * math.pi)
    parts = [
        line(59 - 9 * math.cos(angle), -9 * math.sin(angle), 0) for angle in (1, 2, 1, 2, 1, 2, 1, 2, 3, 4)
    ]
    ahead, behind = (rapid(0, 0, 0), line(50, 0, 0)), line(50, 9, 0)
    nominal = toolpath(*ahead, whole, behind)
    corrected = toolpath(*ahead, line(50.003, 0, 0), *parts, whole, behind)
    assert ends(nominal, corrected) == [0, 1, 13, 14]


@pytest.mark.usefixtures("at_once")
def test_a_move_ends_with_the_first_that_is_near() -> None:
    """Not with the step behind it, which is as near."""
    assert ends(toolpath(*CUTS), toolpath(*STEPS)) == [0, 1, 3, 6, 7]


@pytest.mark.usefixtures("plain")
def test_the_tip_is_compared_with_where_the_part_lies() -> None:
    """An error of 0.2 mm and a zero that lies 0.2 mm off: the commands are as they were."""
    model = Known(lambda axis_mm: np.tile([0.2, 0.0, -0.1], (len(axis_mm), 1)))
    shift = np.array([0.2, 0.0, -0.1])
    path, steps = toolpath(*CUTS), toolpath(*STEPS)
    assert ends(path, steps, model=model, shift=shift) == [0, 1, 3, 6, 7]
    with pytest.raises(AssertionError):
        ends(path, steps, model=model)
    with pytest.raises(AssertionError):
        ends(path, steps, shift=shift)


@pytest.mark.parametrize(("off_mm", "doubt"), [(0.0499, False), (0.0501, True)])
@pytest.mark.parametrize("k", (3, 5))
def test_near_is_near_at_ends_and_along_moves(
    off_mm: float, doubt: bool, k: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the end of a move and of a part beside it."""
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)
    moves = list(STEPS)
    x, y, z = moves[k].end
    moves[k] = line(x + off_mm * (k == 5), y, z + off_mm * (k == 3))
    if not doubt:
        assert ends(toolpath(*CUTS), toolpath(*moves)) == [0, 1, 3, 6, 7]
        return
    with pytest.raises(AssertionError, match="searched"):
        ends(toolpath(*CUTS), toolpath(*moves))


@pytest.mark.parametrize("flag", (PASS, CONTROL, OF_MACHINE))
def test_a_move_that_is_left_uncorrected_is_known_by_its_command(flag: int, plain: None) -> None:
    """It ends 0.3 mm from where it is meant, as the error has it."""
    model = Known(lambda axis_mm: np.where(axis_mm[:, :1] > 25, [0.3, 0.0, 0.0], 0.0))
    left = rapid(30, 0, 9, flag=flag)
    nominal = toolpath(*CUTS, left, line(20, 0, 0), line(0, 0, 0))
    corrected = toolpath(*STEPS, left, line(20, 0, 0), line(9, 0, 0), line(0, 0, 0))
    assert ends(nominal, corrected, model=model) == [0, 1, 3, 6, 7, 8, 9, 11]


def test_a_move_that_is_corrected_is_not_known_by_its_command(plain: None) -> None:
    model = Known(lambda axis_mm: np.where(axis_mm[:, :1] > 25, [0.3, 0.0, 0.0], 0.0))
    nominal = toolpath(*CUTS, rapid(30, 0, 9), line(20, 0, 0))
    corrected = toolpath(*STEPS, rapid(30, 0, 9), line(20, 0, 0))
    with pytest.raises(AssertionError, match="searched"):
        ends(nominal, corrected, model=model)


@pytest.mark.parametrize(("error_mm", "doubt"), [(0.3, False), (0.49, False), (0.51, True)])
def test_a_rapid_with_an_unknown_axis_may_be_half_a_millimetre_off(
    error_mm: float, doubt: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)
    model = Known(lambda axis_mm: np.where(np.isnan(axis_mm[:, :1]), [0.0, 0.0, error_mm], 0.0))
    head = rapid(NAN, NAN, 40)
    if not doubt:
        assert ends(toolpath(head, *CUTS), toolpath(head, *STEPS), model=model) == [0, 1, 2, 4, 7, 8]
        return
    with pytest.raises(AssertionError, match="searched"):
        ends(toolpath(head, *CUTS), toolpath(head, *STEPS), model=model)


def test_a_place_that_is_unknown_in_both_is_as_meant(plain: None) -> None:
    none = rapid(NAN, NAN, NAN, flag=CONTROL)
    nominal = toolpath(*CUTS, none, line(5, 5, 5), line(9, 9, 9))
    corrected = toolpath(*STEPS, none, line(5, 5, 5), line(7, 7, 7), line(9, 9, 9))
    assert ends(nominal, corrected) == [0, 1, 3, 6, 7, 8, 9, 11]


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("turns", (1, 3))
@pytest.mark.parametrize("plane", (0, 1, 2))
def test_whole_circles_end_where_their_turns_end(turns: int, plane: int) -> None:
    """A helix of whole turns passes over its end as it begins; its parts pass it at every turn."""
    roll = [(0, 1, 2), (2, 0, 1), (1, 2, 0)][plane]

    def at(*values: float) -> tuple[float, ...]:
        return tuple(float(values[roll.index(axis)]) for axis in range(3))

    half = {"centre": at(5, 0, 0), "plane": plane}
    nominal = toolpath(
        rapid(*at(0, 0, 0)), arc(*at(0, 0, 0), sweep=2 * math.pi * turns, **half), line(*at(0, 3, 0))
    )
    parts = [arc(*at(10 * (k % 2 == 0), 0, 0), sweep=math.pi, **half) for k in range(2 * turns)]
    corrected = toolpath(rapid(*at(0, 0, 0)), *parts, line(*at(0, 3, 0)))
    assert ends(nominal, corrected) == [0, 2 * turns, 2 * turns + 1]


@pytest.mark.parametrize(
    ("angle", "radius", "level", "doubt"),
    [
        (0.5, 20.0, 0.0, False), (0.5, 20.049, 0.0, False), (0.5, 20.051, 0.0, True),
        (0.5, 19.949, 0.0, True), (1.5, 20.0, 0.049, False), (1.5, 20.0, 0.051, True),
        (1.5, 20.0, -0.051, True), (1.5, 20.03, 0.045, True), (-0.0004, 20.0, 0.0, False),
        (-0.001, 20.0, 0.0, True), (2.002, 20.0, 0.0, False), (2.003, 20.0, 0.0, True),
        (2.002, 20.04, 0.0, True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("plane", (0, 1, 2))
@pytest.mark.parametrize("sign", (1, -1))
def test_a_part_of_an_arc_lies_near_it(
    angle: float, radius: float, level: float, doubt: bool, plane: int, sign: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """An arc of 2 rad about (7, 3) with a radius of 20 mm from 0.7 rad on: across it, along its third axis,
    and along it before its start and beyond its end."""
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)
    roll = [(0, 1, 2), (2, 0, 1), (1, 2, 0)][plane]

    def at(turned: float, radius: float = 20.0, level: float = 0.0) -> tuple[float, ...]:
        place = np.zeros(3)
        turned = 0.7 + sign * turned
        place[list(roll)] = 7 + radius * math.cos(turned), 3 + radius * math.sin(turned), level
        return tuple(place.tolist())

    centre = np.zeros(3)
    centre[list(roll)] = 7, 3, 0
    head = rapid(*at(0.0))
    whole = arc(*at(2.0), centre=tuple(centre), sweep=2.0 * sign, plane=plane)
    nominal = toolpath(head, whole)
    corrected = toolpath(head, line(*at(angle, radius, level)), whole)
    if not doubt:
        assert ends(nominal, corrected) == [0, 2]
        return
    with pytest.raises(AssertionError, match="searched"):
        ends(nominal, corrected)


@pytest.mark.parametrize("turns", (0, 2))
@pytest.mark.parametrize(("off", "doubt"), [(0.0, False), (0.04, False), (0.06, True), (-0.06, True)])
def test_the_radius_of_an_arc_goes_linearly_from_its_start_to_its_end(
    off: float, doubt: bool, turns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As rounded words have it: here from 20 mm to 20.8 mm, and a part ends half-way."""
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)
    sweep = 2.0 + 2 * math.pi * turns

    def at(turned: float, radius: float) -> tuple[float, float, float]:
        return 7 + radius * math.cos(turned), 3 + radius * math.sin(turned), 0.0

    head = rapid(*at(0.0, 20.0))
    whole = arc(*at(sweep, 20.8), centre=(7, 3, 0), sweep=sweep)
    part = arc(*at(sweep / 2, 20.4 + off), centre=(7, 3, 0), sweep=sweep / 2)
    nominal, corrected = toolpath(head, whole), toolpath(head, part, whole)
    if not doubt:
        assert ends(nominal, corrected) == [0, 2]
        return
    with pytest.raises(AssertionError, match="searched"):
        ends(nominal, corrected)


@pytest.mark.parametrize(
    ("level", "doubt"), [(0.0, False), (3.0, False), (6.04, False), (6.06, True), (-0.06, True)]
)
def test_a_part_of_a_helix_lies_between_its_levels(
    level: float, doubt: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)
    for low, high in ((0.0, 6.0), (6.0, 0.0)):
        head = rapid(10, 0, low)
        whole = arc(-10, 0, high, centre=(0, 0, 0), sweep=math.pi)
        nominal, corrected = toolpath(head, whole), toolpath(head, line(0, 10, level), whole)
        if not doubt:
            assert ends(nominal, corrected) == [0, 2]
            continue
        with pytest.raises(AssertionError, match="searched"):
            ends(nominal, corrected)


def test_a_part_of_a_rapid_is_a_rapid_and_of_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)
    for move, other in ((rapid, line), (line, rapid)):
        nominal = toolpath(rapid(0, 0, 0), move(30, 0, 0), line(30, 9, 0))
        same = toolpath(rapid(0, 0, 0), move(10, 0, 0), move(30, 0, 0), line(30, 9, 0))
        assert ends(nominal, same) == [0, 2, 3]
        wrong = toolpath(rapid(0, 0, 0), other(10, 0, 0), move(30, 0, 0), line(30, 9, 0))
        with pytest.raises(AssertionError, match="searched"):
            ends(nominal, wrong)


@pytest.mark.usefixtures("plain")
def test_parts_beyond_the_guess_by_length_are_found_one_by_one() -> None:
    """The corrected path goes 30 mm astray along its own line and returns, so lengths do not agree."""
    nominal = toolpath(rapid(0, 0, 0), line(50, 0, 0), line(50, 50, 0), line(0, 50, 0))
    along = [line(x, 0, 0) for x in (10, 40, 10, 40, 10, 40, 10, 40, 50)]
    corrected = toolpath(rapid(0, 0, 0), *along, line(50, 20, 0), line(50, 50, 0), line(0, 50, 0))
    assert ends(nominal, corrected) == [0, 9, 11, 12]


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("plane", (0, 1, 2))
@pytest.mark.parametrize(("low", "high"), [(500.0, 503.0), (-500.0, -440.0), (0.0, 60.0)])
def test_the_length_of_a_helix_is_that_of_its_turn_and_its_rise(plane: int, low: float, high: float) -> None:
    """In 20 parts, behind one and before two lines in 20 parts."""
    roll = [(0, 1, 2), (2, 0, 1), (1, 2, 0)][plane]

    def at(*values: float) -> tuple[float, ...]:
        return tuple(float(values[roll.index(axis)]) for axis in range(3))

    def turned(share: float) -> tuple[float, ...]:
        angle = 1.5 * math.pi * share
        return at(20 * math.sin(angle), 20 - 20 * math.cos(angle), low + share * (high - low))

    def lines(begin: tuple[float, ...], end: tuple[float, ...]) -> list[Move]:
        ends = np.array(begin) + np.outer(np.arange(1, 21) / 20, np.subtract(end, begin))
        return [line(*one) for one in ends.tolist()]

    corners = at(-40, 0, low), at(0, 0, low), turned(1.0), at(0, 90, high), at(0, 90, low)
    more = {"centre": at(0, 20, 0), "plane": plane}
    nominal = toolpath(
        rapid(*corners[0]), line(*corners[1]), arc(*corners[2], sweep=1.5 * math.pi, **more),
        line(*corners[3]), line(*corners[4]), start=corners[0],
    )  # fmt: skip
    parts = [arc(*turned(k / 20), sweep=0.075 * math.pi, **more) for k in range(1, 21)]
    corrected = toolpath(
        rapid(*corners[0]), *lines(corners[0], corners[1]), *parts, *lines(corners[2], corners[3]),
        *lines(corners[3], corners[4]), start=corners[0],
    )  # fmt: skip
    assert ends(nominal, corrected) == [0, 20, 40, 60, 80]


@pytest.mark.parametrize("written", (rapid(10, 5, 0), rapid(10, 0, NAN), rapid(NAN, NAN, 0)))
def test_an_axis_that_is_unknown_in_one_of_them_is_far_off(
    written: Move, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)
    meant = rapid(10, NAN, 0)
    tail = rapid(0, 0, 0), line(5, 0, 0), line(9, 0, 0)
    nominal = toolpath(meant, tail[0], tail[2])
    assert ends(nominal, toolpath(meant, *tail)) == [0, 1, 3]
    with pytest.raises(AssertionError, match="searched"):
        ends(nominal, toolpath(written, *tail))


def test_what_is_exactly_so_far_off_is_in_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alignment.Alignment, "_window", in_doubt)
    nominal = toolpath(rapid(0, 0, 0), line(16, 0, 0), line(16, 16, 0))
    for part, end in ((line(8, 0.0625, 0), line(16, 0, 0)), (line(8, 0, 0), line(16, 0, 0.0625))):
        corrected = toolpath(rapid(0, 0, 0), part, end, line(16, 16, 0))
        assert ends(nominal, corrected, near_mm=0.0626) == [0, 2, 3]
        with pytest.raises(AssertionError, match="searched"):
            ends(nominal, corrected, near_mm=0.0625)


# -- what is looked at in one go -------------------------------------------------------------------------


def test_blocks_double_while_nothing_is_in_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int, int]] = []
    stretch = alignment.Alignment._stretch

    def noted(self: Any, i: int, j: int, size: int) -> Any:
        asked.append((i, j, size))
        return stretch(self, i, j, size)

    monkeypatch.setattr(alignment.Alignment, "_stretch", noted)
    zigzag = [line(10.0 * k, 5.0 * (k % 2), 0) for k in range(1, 300)]
    split = [
        move
        for k, move in enumerate(zigzag)
        for move in ((line(10.0 * k + 5, 2.5, 0), move) if k == 99 else (move,))
    ]
    assert ends(toolpath(rapid(0, 0, 0), *zigzag), toolpath(rapid(0, 0, 0), *split)) == [
        *range(100),
        *range(101, 301),
    ]
    assert asked == [(0, 0, 16), (16, 16, 32), (48, 48, 64), (112, 113, 128), (240, 241, 256)]
    # behind one in doubt at 60, about twice as many as were in none before it
    asked.clear()
    split[60] = line(*np.add(split[60].end, (0, 0, 0.2)).tolist())
    ends(toolpath(rapid(0, 0, 0), *zigzag), toolpath(rapid(0, 0, 0), *split))
    assert asked[:5] == [(0, 0, 16), (16, 16, 32), (48, 48, 64), (61, 61, 26), (67, 67, 16)]


# -- the least squares -----------------------------------------------------------------------------------


def cost(nominal: Toolpath, corrected: Toolpath, shift: Array, ends: tuple[int, ...]) -> float:
    """mm2, of an alignment: distances of the ends of moves and of parts from their move, none of more than 1
    mm, and 4 for another kind."""
    target = nominal.end_mm + shift
    begin = np.vstack((nominal.start_mm, target[:-1]))
    total, first = 0.0, 0
    for i, last in enumerate(ends):
        left = nominal.flag[i] & (PASS | CONTROL | OF_MACHINE)
        away = corrected.end_mm[last] - (nominal.end_mm[i] if left else target[i])
        total += min(float(away @ away), 1.0) + 4.0 * (nominal.kind[i] != corrected.kind[last])
        piece = np.array([begin[i], target[i]])
        if i in nominal.arcs.move:
            piece = paths.points_of(nominal, shift, i, 4000)
        for j in range(first, last):
            far = float(paths._from_line(corrected.end_mm[j : j + 1], piece)[0])
            total += min(far, 1.0) ** 2
            total += 4.0 * ((nominal.kind[i] == Kind.RAPID) != (corrected.kind[j] == Kind.RAPID))
        first = last + 1
    return total


def in_doubt_at_random(seed: int) -> tuple[Toolpath, Toolpath, Array]:
    """Four moves, and nine that lie about along them."""
    rng = np.random.default_rng(seed)
    mine: list[Move] = []
    theirs: list[Move] = []
    here = np.zeros(3)
    for k in range(4):
        there = here + rng.uniform(-2, 2, 3)
        move = rapid if rng.random() < 0.3 else line
        flag = int(rng.choice([0, 0, 0, PASS, OF_MACHINE]))
        mine.append(move(*there, flag=flag))
        parts = 3 if k == 2 else 2
        for share in np.arange(1, parts + 1) / parts:
            other = rapid if rng.random() < 0.3 else line
            theirs.append(other(*(here + share * (there - here) + rng.normal(0, 0.4, 3))))
        here = there
    return toolpath(*mine), toolpath(*theirs), rng.uniform(-0.5, 0.5, 3)


@pytest.mark.parametrize("seed", range(12))
def test_what_is_in_doubt_has_the_least_squares(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matching, "_MOST_FAR", 1.0)
    nominal, corrected, shift = in_doubt_at_random(seed)
    got = tuple(ends(nominal, corrected, shift=shift, near_mm=0.0))
    last = len(corrected) - 1
    least = min(
        (cost(nominal, corrected, shift, (*some, last)), (*some, last))
        for some in itertools.combinations(range(last), len(nominal) - 1)
    )
    assert (cost(nominal, corrected, shift, got), got) == (pytest.approx(least[0]), least[1])


@pytest.mark.parametrize("seed", range(4))
def test_parts_of_arcs_in_doubt_have_the_least_squares(seed: int) -> None:
    """The end of the arc is split off by nothing but distances of its parts."""
    rng = np.random.default_rng(seed)
    angle = np.array([0.5, 1.0, 1.5, 2.0])
    ring = np.stack((20 * np.cos(angle), 20 * np.sin(angle), 0 * angle), axis=1)
    nominal = toolpath(
        rapid(20, 0, 0), arc(*ring[-1], centre=(0, 0, 0), sweep=2.0), line(*(ring[-1] + (0, 0, 1)))
    )
    off = rng.normal(0, 0.2, (4, 3))
    rise = [line(*(ring[-1] + (0, 0, z) + rng.normal(0, 0.2, 3))) for z in (0.3, 0.6, 1.0)]
    corrected = toolpath(rapid(20, 0, 0), *(line(*end) for end in ring + off), *rise)
    got = tuple(ends(nominal, corrected, near_mm=0.0))
    costs = {some: cost(nominal, corrected, np.zeros(3), (0, some, 7)) for some in range(1, 7)}
    assert got[:1] + got[2:] == (0, 7)
    assert costs[got[1]] <= min(costs.values()) + 4.0 * (nominal.kind[1] != corrected.kind[1])


def cut_at_random(seed: int) -> tuple[Toolpath, Toolpath]:
    """Lines, some of which return to where they were or stay there, and the same with some of them split,
    some of the parts near an end."""
    rng = np.random.default_rng(seed)
    near = 0.4 * NEAR_MM
    mine: list[Move] = [rapid(0, 0, 0)]
    theirs: list[Move] = [rapid(0, 0, 0)]
    places = [np.zeros(3)]
    for _ in range(150):
        here = places[-1]
        there = (here, places[-2:][0], *(here + rng.uniform(-2, 2, 3) for _ in range(6)))[rng.integers(8)]
        places.append(there)
        mine.append(line(*there))
        if rng.random() < 0.1:
            part = (0.5 * (here + there), there + rng.uniform(-near, near, 3) / 2)[rng.integers(2)]
            theirs.append(line(*part))
        theirs.append(line(*(there + rng.uniform(-near, near, 3))))
    return toolpath(*mine), toolpath(*theirs)


@pytest.mark.parametrize("seed", range(6))
def test_units_in_step_end_where_they_do_without_that_short_cut(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    nominal, corrected = cut_at_random(seed)
    got = ends(nominal, corrected)
    monkeypatch.setattr(alignment.Alignment, "_in_step", lambda *_: False)
    assert ends(nominal, corrected) == got


def test_the_last_in_step_goes_on_where_what_comes_behind_it_is_no_part_of_the_next() -> None:
    """The last unit of the second block has a part that ends where it does."""
    zigzag = [line(10.0 * k, 5.0 * (k % 2), 0) for k in range(1, 48)]
    behind = [rapid(500, 0, 0), *(line(500 + 10.0 * k, 5.0 * (k % 2), 0) for k in range(1, 30))]
    nominal = toolpath(rapid(0, 0, 0), *zigzag, *behind)
    corrected = toolpath(rapid(0, 0, 0), *zigzag, zigzag[-1], *behind)
    assert ends(nominal, corrected) == [*range(47), *range(48, 79)]


def test_circles_at_one_place_are_not_taken_for_their_parts() -> None:
    """Each of two turns is split into two of one turn, which all end in one place."""
    turn = 2 * math.pi
    nominal = [arc(10, 0, 0, centre=(0, 0, 0), sweep=2 * turn) for _ in range(30)]
    corrected = [arc(10, 0, 0, centre=(0, 0, 0), sweep=turn) for _ in range(60)]
    got = ends(toolpath(rapid(10, 0, 0), *nominal), toolpath(rapid(10, 0, 0), *corrected))
    assert got == [0, *range(2, 61, 2)]


# -- other jobs ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off_mm", "refused"), [(0.999, False), (1.0, True)])
@pytest.mark.parametrize(("wrong", "most"), [(2, 4), (3, 5)])
def test_more_than_half_of_the_waypoints_may_not_be_a_millimetre_off(
    off_mm: float, refused: bool, wrong: int, most: int
) -> None:
    nominal = [line(16.0 * k, 0, 0, line=10 + k) for k in range(most)]
    other = [line(16.0 * k + off_mm * (k and k <= wrong), 0, 0) for k in range(most)]
    if not refused or 2 * wrong <= most:
        assert ends(toolpath(*nominal), toolpath(*other)) == list(range(most))
        return
    with pytest.raises(ProgramError) as caught:
        ends(toolpath(*nominal), toolpath(*other))
    assert str(caught.value) == (
        f"{wrong} of {most} waypoints are farther than 1 mm from those of the nominal program, the first at "
        "its line 11; it is not a correction of this program for this machine"
    )
    assert caught.value.code == "OLP562"


@pytest.mark.parametrize("flag", (PASS, CONTROL, OF_MACHINE))
def test_moves_left_uncorrected_and_unknown_places_do_not_say_what_job_it_is(flag: int) -> None:
    """One of three waypoints is off; counted with the moves left uncorrected, it would be most of them."""
    none = rapid(NAN, NAN, NAN)
    cuts = [line(16.0 * k, 0, 0) for k in range(3)]
    nominal = toolpath(*cuts, *(line(9, 9, 9, flag=flag),) * 3, none, none)
    corrected = toolpath(*cuts[:2], line(50, 0, 0), *(line(5, 9, 9, flag=flag),) * 3, none, none)
    assert ends(nominal, corrected) == list(range(8))
    # and where two are off they are not counted either
    corrected = toolpath(cuts[0], *(line(50, 0, 0),) * 2, *(line(9, 9, 9, flag=flag),) * 3, none, none)
    with pytest.raises(ProgramError, match="2 of 3 waypoints"):
        ends(nominal, corrected)


@pytest.mark.parametrize(
    ("mine", "theirs", "words"),
    [
        (2, 1, "has 1 moves and holes, fewer than the 2 of the nominal one"),
        (0, 3, "has 3 moves and holes, not the 0 of the nominal one"),
        (1, 0, "has 0 moves and holes, fewer than the 1 of the nominal one"),
    ],
)
def test_fewer_moves_are_another_job(mine: int, theirs: int, words: str) -> None:
    nominal, other = (toolpath(*(line(k, 0, 0) for k in range(count))) for count in (mine, theirs))
    with pytest.raises(ProgramError) as caught:
        ends(nominal, other)
    assert str(caught.value) == (
        f"the corrected program {words}, so it is not a correction of it; give the two programs of one job"
    )
    assert caught.value.code == "OLP562"
    assert ends(toolpath(), toolpath()) == []


# -- holes -----------------------------------------------------------------------------------------------


def drilled(*depths: float, x: float = 0.0) -> list[Move]:
    """The moves of a hole: to it, down to each depth and up again."""
    moves = [rapid(x, 0, 5, flag=CYCLE)]
    for depth in depths:
        moves += [line(x, 0, depth, flag=CYCLE), rapid(x, 0, 5, flag=CYCLE)]
    return moves


def hole_at(first: int, moves: list[Move]) -> Hole:
    return hole(first, first + len(moves), r=5.0, z=moves[-2].end[2])


@pytest.mark.parametrize(
    ("theirs", "expected"),
    [
        ((-4, -8, -10), [1, 2, 3, 4, 5, 6, 7, 8]),
        ((-4, -8, -9.9, -10), [1, 2, 3, 4, 5, 6, 9, 10]),
        ((-4, -10), [1, 2, 3, 4, 5, 5, 5, 6]),
        ((-10,), [1, 2, 3, 3, 3, 3, 3, 4]),
    ],
)  # fmt: skip
def test_a_hole_is_one_whatever_its_pecks(theirs: tuple[float, ...], expected: list[int]) -> None:
    """Its moves are taken one by one; those that it has no more end with it, and more of them belong to its
    last."""
    mine, other = drilled(-4, -8, -10), drilled(*theirs)
    nominal = toolpath(rapid(9, 9, 9), *mine, line(0, 30, 5))
    corrected = toolpath(rapid(9, 9, 9), *other, line(0, 30, 5))
    assert ends(nominal, corrected, holes=((hole_at(1, mine),), (hole_at(1, other),))) == [0, *expected]


def test_a_rapid_to_a_hole_that_the_nominal_one_does_not_need_comes_before_it() -> None:
    mine = drilled(-4, -10)
    first, second = mine[:], drilled(-4, -10)[1:]
    nominal = toolpath(*first, *second)
    again = drilled(-4, -10)
    corrected = toolpath(*first, *again)
    holes = (
        (hole_at(0, first), hole_at(5, second)),
        (hole_at(0, first), hole_at(5, again)),
    )
    assert ends(nominal, corrected, holes=holes) == [0, 1, 2, 3, 4, 6, 7, 8, 9]


def test_holes_of_another_number_are_taken_move_by_move() -> None:
    mine = drilled(-4, -10)
    other = [rapid(0, 0, 5), line(0, 0, -4), rapid(0, 0, 5), line(0, 0, -7), line(0, 0, -10), rapid(0, 0, 5)]
    nominal, corrected = toolpath(*mine), toolpath(*other)
    assert ends(nominal, corrected, holes=((hole_at(0, mine),), ())) == [0, 1, 2, 4, 5]
