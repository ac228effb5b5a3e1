"""Arcs that stay arcs: the circle that fits a bent path, how far it leaves it, and where an arc is cut."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from cases.toy import Toy, arc, constant_backlash, feed, linear, rapid, toolpath

from olp.compensation import arcs
from olp.compensation.arcs import (
    Bend,
    Pieces,
    departure,
    fit,
    fit_pieces,
    sample_groups,
    sampled,
    subdivide_arcs,
)
from olp.core.errors import CannotCompute
from olp.core.toolpath import Frame, Toolpath

PLANES = (0, 1, 2)
#: First, second and third axis of each plane.
ORDER = ((0, 1, 2), (2, 0, 1), (1, 2, 0))
NO_TOOL = np.zeros(3)
COUNT = 16


def in_plane(plane: int, first: np.ndarray, second: np.ndarray, third: np.ndarray) -> np.ndarray:
    points = np.empty((*np.shape(first), 3))
    for axis, values in zip(ORDER[plane], (first, second, third), strict=True):
        points[..., axis] = values
    return points


def circle(
    plane: int,
    centre: tuple[float, float, float],
    radius: tuple[float, float],
    begin: float,
    sweep: float,
    rise: float,
) -> np.ndarray:
    """(COUNT + 1, 3) samples of an arc whose radius goes from one to another, and which rises."""
    share = np.linspace(0.0, 1.0, COUNT + 1)
    r = radius[0] + (radius[1] - radius[0]) * share
    angle = begin + share * sweep
    return in_plane(
        plane, centre[0] + r * np.cos(angle), centre[1] + r * np.sin(angle), centre[2] + rise * share
    )


def bend(
    point: np.ndarray, command: np.ndarray, centre: np.ndarray, mismatch: float, rigid: bool = False
) -> Bend:
    share = np.linspace(0.0, 1.0, COUNT + 1)
    return Bend(point[None], command[None], share, centre[None], np.array([mismatch]), np.array([rigid]))


def fitted(b: Bend, plane: int, sweep: float) -> tuple[np.ndarray, float]:
    ends = np.array([plane], np.int8), b.command[:, 0], b.command[:, -1], np.array([sweep])
    centre = fit(b, *ends)
    away = departure(b, *ends, centre)
    return centre[0], float(away[0])


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("sweep", (0.3, -1.5, 2.9, 3.1, -5.0, 6.2, 2 * math.pi, -9.0))
@pytest.mark.parametrize(("ends", "rise"), [((20.0, 20.0), 0.0), ((20.0, 20.5), 7.0)])
def test_a_circle_is_found_wherever_it_lies(
    plane: int, sweep: float, ends: tuple[float, float], rise: float
) -> None:
    """Commands on a circle of another centre and radius than the program's, also where the radius grows."""
    nominal = circle(plane, (5.0, -3.0, 1.0), ends, 0.7, sweep, rise)
    grown = (ends[0] + 0.02, ends[1] + 0.02)
    command = circle(plane, (5.03, -3.04, 1.5), grown, 0.701, sweep, rise)
    b = bend(nominal, command, in_plane(plane, *np.array([5.0, -3.0, 1.0])), ends[1] - ends[0])
    centre, away = fitted(b, plane, sweep)
    first, second, third = ORDER[plane]
    assert (centre[first], centre[second]) == pytest.approx((5.03, -3.04), abs=2e-5)
    assert away < 1e-5
    # along the third axis the centre goes with the ends
    assert centre[third] == pytest.approx(1.0 + 0.5)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize(("sweep", "rise"), [(2.0, 0.0), (2.0, 40.0), (-2.0, 40.0), (-5.0, 12.0)])
def test_how_far_a_helix_is_left_along_its_axis(plane: int, sweep: float, rise: float) -> None:
    """A sample that is 10 um too high leaves a helix of slope p = rise / length by 10 um / sqrt(1 + p^2)."""
    nominal = circle(plane, (0.0, 0.0, 0.0), (20.0, 20.0), 0.2, sweep, rise)
    command = nominal.copy()
    command[5, ORDER[plane][2]] += 0.01
    centre, away = fitted(bend(nominal, command, np.zeros(3), 0.0), plane, sweep)
    assert centre == pytest.approx(np.zeros(3), abs=1e-9)
    assert away == pytest.approx(0.01 / math.hypot(1.0, rise / (20.0 * sweep)), rel=1e-6)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("sweep", (1.0, -2.5))
def test_how_far_an_arc_is_left_across_it(plane: int, sweep: float) -> None:
    """One wave of the radius along the arc: out in its first half as in in its second, so the circle that
    leaves it least is where it was."""
    nominal = circle(plane, (1.0, 2.0, 3.0), (20.0, 20.0), 0.2, sweep, 0.0)
    centre = in_plane(plane, *np.array([1.0, 2.0, 3.0]))
    wave = 0.01 * np.sin(2 * np.pi * np.linspace(0.0, 1.0, COUNT + 1))[:, None]
    command = nominal + wave * (nominal - centre) / 20.0
    got, away = fitted(bend(nominal, command, centre, 0.0), plane, sweep)
    assert got == pytest.approx(centre, abs=1e-3)
    assert away == pytest.approx(0.01, rel=0.02)


def test_the_largest_departure_counts_in_or_out() -> None:
    nominal = circle(0, (0.0, 0.0, 0.0), (20.0, 20.0), 0.0, 2.0, 0.0)
    for sign in (1, -1):
        command = nominal.copy()
        command[8, 2] += sign * 0.03
        command[4, 2] -= sign * 0.02
        assert fitted(bend(nominal, command, np.zeros(3), 0.0), 0, 2.0)[1] == pytest.approx(0.03)


def test_across_and_along_the_axis_count_together() -> None:
    nominal = circle(0, (0.0, 0.0, 0.0), (20.0, 20.0), 0.0, 2.0, 0.0)
    wave = np.sin(2 * np.pi * np.linspace(0.0, 1.0, COUNT + 1))
    command = nominal * (1 + 0.003 / 20 * wave[:, None]) + np.outer(0.004 * wave, [0, 0, 1.0])
    assert fitted(bend(nominal, command, np.zeros(3), 0.0), 0, 2.0)[1] == pytest.approx(0.005, rel=0.02)


def test_what_is_only_shifted_keeps_its_centre() -> None:
    """Least squares would draw the centre to the wave; the shift is told from its ends."""
    nominal = circle(0, (1.0, 2.0, 0.0), (20.0, 20.0), 0.2, 3.1, 0.0)
    command = nominal + np.array([0.1, 0.2, 0.0])
    command[8] += (0.001, 0.004, 0.0)
    b = bend(nominal, command, np.array([1.0, 2.0, 0.0]), 0.0, rigid=True)
    assert fitted(b, 0, 3.1)[0] == pytest.approx([1.1, 2.2, 0.0], abs=1e-12)
    assert abs(fitted(replace(b, rigid=np.array([False])), 0, 3.1)[0] - (1.1, 2.2, 0.0)).max() > 1e-5


def test_the_centre_lies_between_the_shifts_of_both_ends() -> None:
    """A tiny arc says little of its centre: it goes by the mean of what its ends do."""
    nominal = circle(0, (0.0, 0.0, 0.0), (20.0, 20.0), 0.0, 1e-4, 0.0)
    command = nominal + np.array([0.3, -0.2, 0.0])
    assert fitted(bend(nominal, command, np.zeros(3), 0.0), 0, 1e-4)[0] == pytest.approx(
        [0.3, -0.2, 0.0], abs=1e-6
    )


# -- samples ------------------------------------------------------------------------------------------

QUARTER = arc(0.0, 20.0, 6.0, centre=(0.0, 0.0, 0.0), degrees=90.0)
SPIRAL = arc(0.0, 22.0, 0.0, centre=(0.0, 0.0, 0.0), degrees=90.0)
STRETCH = linear([[1e-3, 0, 0], [0, 0, 0], [0, 0, 0]], bound=lambda d, t: 0 * d[:, 0])


def pieces(*rows: tuple[int, float, float]) -> Pieces:
    arc_, begin, end = zip(*rows, strict=True)
    return Pieces(np.array(arc_), np.array(begin, float), np.array(end, float))


def test_samples_lie_on_the_part_of_the_arc_and_are_commanded_against_the_error() -> None:
    path = toolpath(feed(20.0, 0.0, 0.0), QUARTER)
    got = sampled(path, STRETCH, path.end_mm, pieces((0, 0.0, 1.0), (0, 0.5, 1.0)), NO_TOOL, 2)
    for row, angles in ((0, (0.0, 45.0, 90.0)), (1, (45.0, 67.5, 90.0))):
        a = np.radians(angles)
        points = np.column_stack([20 * np.cos(a), 20 * np.sin(a), 6 * a / (np.pi / 2)])
        assert got.point[row] == pytest.approx(points, abs=1e-12)
        assert got.command[row] == pytest.approx(points * (0.999, 1.0, 1.0), abs=1e-12)
    assert got.share.tolist() == [0.0, 0.5, 1.0]
    assert got.centre.tolist() == [[0.0, 0.0, 0.0]] * 2
    assert got.mismatch == pytest.approx([0.0, 0.0], abs=1e-12)
    assert got.rigid.tolist() == [False, False]


def test_samples_know_the_growth_of_the_radius_and_what_is_only_shifted() -> None:
    path = toolpath(feed(20.0, 0.0, 0.0), SPIRAL)
    both = pieces((0, 0.0, 1.0), (0, 0.0, 0.25))
    shift = linear(np.zeros((3, 3)), (0.5, 0.6, 0.7))
    got = sampled(path, shift, path.end_mm, both, NO_TOOL, 8)
    assert got.mismatch == pytest.approx([2.0, 0.5])
    assert got.rigid.tolist() == [True, True]
    for plane in (1, 2):
        turned = replace(
            path,
            end_mm=in_plane(plane, *path.end_mm.T),
            arcs=replace(path.arcs, plane=np.array([plane], np.int8)),
        )
        assert sampled(turned, shift, turned.end_mm, both, NO_TOOL, 8).mismatch == pytest.approx([2.0, 0.5])


def test_a_shift_that_changes_by_a_nanometre_is_none() -> None:
    path = toolpath(feed(20.0, 0.0, 0.0), QUARTER)
    for gain, rigid in ((0.9e-9, True), (1.1e-9, False)):
        model = linear(np.diag([gain / 20.0, 0.0, 0.0]))
        assert sampled(path, model, path.end_mm, pieces((0, 0.0, 1.0)), NO_TOOL, 8).rigid.tolist() == [rigid]


def test_targets_move_the_whole_arc() -> None:
    path = toolpath(feed(20.0, 0.0, 0.0), QUARTER)
    away = np.array([3.0, -4.0, 5.0])
    got = sampled(path, STRETCH, path.end_mm + away, pieces((0, 0.0, 1.0)), NO_TOOL, 2)
    assert got.centre.tolist() == [away.tolist()]
    assert got.point[0, 0] == pytest.approx([23.0, -4.0, 5.0])
    assert got.point[0, 2] == pytest.approx([3.0, 16.0, 11.0])
    assert got.mismatch == pytest.approx([0.0], abs=1e-12)


def test_an_arc_may_be_the_first_move_and_have_its_own_tool() -> None:
    frames = (Frame(), Frame(tool_mm=(0.0, 0.0, 50.0)))
    back = arc(20.0, 0.0, 0.0, centre=(0.0, 0.0, 0.0), degrees=-90.0, frame=1)
    path = toolpath(QUARTER, back, start=(20.0, 0.0, 0.0), frames=frames)
    model = Toy(lambda p, tool: 1e-4 * tool[:, :3])
    got = sampled(path, model, path.end_mm, pieces((0, 0.0, 1.0), (1, 0.0, 1.0)), path.tool_mm(), 4)
    assert got.point[0, 0] == pytest.approx([20.0, 0.0, 0.0])
    assert (got.command - got.point)[:, :, 2] == pytest.approx(np.outer([0.0, -5e-3], np.ones(5)))


def test_a_piece_has_the_play_of_its_inside_at_its_ends_too() -> None:
    """Along the first quarter X goes down and Y up: with 6 um of backlash they lead by 3 um."""
    path = toolpath(feed(20.0, 0.0, 0.0), QUARTER)
    model = Toy(backlash=constant_backlash(0.006, 0.006, 0.006))
    got = sampled(path, model, path.end_mm, pieces((0, 0.0, 1.0)), NO_TOOL, 4)
    assert got.command - got.point == pytest.approx(np.tile([-0.003, 0.003, 0.003], (1, 5, 1)))
    assert got.rigid.all()


def test_samples_are_as_many_as_the_error_needs() -> None:
    """In each plane by the length of the arc and its rise; at least 8, at most 256 a turn."""
    for plane in PLANES:
        ends = [in_plane(plane, *np.array(p)) for p in ((20.0, 0.0, 0.0), (0.0, 20.0, 60.0))]
        path = toolpath(feed(*ends[0]), arc(*ends[1], centre=(0.0, 0.0, 0.0), degrees=90.0, plane=plane))
        # the quarter is 10 pi long, and moves along its axis by 60
        for axis, size in zip(ORDER[plane], (10 * math.pi, 10 * math.pi, 60.0), strict=True):
            for factor, expected in ((1.001, 16), (0.999, 8)):
                gain = 0.001 / 4 * 8 / size * factor
                model = Toy(bound=lambda d, t, axis=axis, gain=gain: d[:, axis] * gain)  # type: ignore[misc]
                groups = list(sample_groups(path, model, path.end_mm, pieces((0, 0.0, 1.0)), NO_TOOL, 0.001))
                assert [(part.tolist(), count) for part, count in groups] == [([0], expected)], (plane, axis)
        model = Toy(bound=lambda d, t: np.ones(len(d)))
        assert [
            n for _, n in sample_groups(path, model, path.end_mm, pieces((0, 0.0, 1.0)), NO_TOOL, 0.001)
        ] == [256]


def test_half_a_piece_needs_half_the_samples_and_each_turn_has_its_own() -> None:
    circle_ = arc(20.0, 0.0, 0.0, centre=(0.0, 0.0, 0.0), degrees=720.0)
    path = toolpath(
        feed(20.0, 0.0, 0.0), circle_, replace(QUARTER, frame=1), frames=(Frame(), Frame(tool_mm=(0, 0, 9.0)))
    )
    # a bound that is reached at 40 mm of width, 8 steps
    model = Toy(bound=lambda d, t: d[:, 0] * 0.001 / 4 * 8 / 40.001 * np.where(t[:, 2] > 0, 4.0, 1.0))
    both = pieces((0, 0.0, 1.0), (0, 0.0, 0.5), (1, 0.0, 1.0), (1, 0.0, 0.25))
    groups = list(sample_groups(path, model, path.end_mm, both, path.tool_mm(), 0.001))
    assert [(part.tolist(), count) for part, count in groups] == [([1, 3], 8), ([0], 16), ([2], 32)]


def test_pieces_are_sampled_in_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arcs, "_BATCH", 17)
    path = toolpath(feed(20.0, 0.0, 0.0), QUARTER)
    five = pieces(*((0, k / 5, (k + 1) / 5) for k in range(5)))
    groups = list(sample_groups(path, STRETCH, path.end_mm, five, NO_TOOL, 0.001))
    assert [(part.tolist(), count) for part, count in groups] == [([0, 1], 8), ([2, 3], 8), ([4], 8)]


def test_of_a_stretched_circle_a_short_piece_is_left_less() -> None:
    path = toolpath(feed(20.0, 0.0, 0.0), arc(20.0, 0.0, 0.0, centre=(0.0, 0.0, 0.0), degrees=360.0))
    away = fit_pieces(
        path, STRETCH, path.end_mm, pieces((0, 0.0, 1.0), (0, 0.0, 0.5), (0, 0.0, 0.125)), NO_TOOL, 64
    )
    # the whole one becomes an ellipse, whose half axes differ by 20 um: a circle through its end leaves it
    assert 0.008 < away[0] < 0.021 and 0.001 < away[1] < away[0] and away[2] < away[1] / 15
    shift = linear(np.zeros((3, 3)), (0.5, 0.6, 0.7))
    assert fit_pieces(path, shift, path.end_mm, pieces((0, 0.0, 1.0)), NO_TOOL, 8).tolist() == [0.0]


# -- cuts ---------------------------------------------------------------------------------------------


def cuts(path: Toolpath, model: Toy, tolerance: float = 0.001, **more: object) -> dict[int, list[float]]:
    """The shares of the cuts of each move; they lie on the arc."""
    options = {"free": np.ones(len(path), bool), "turning": None, "band": 0.0, **more}
    move, share, target = subdivide_arcs(path, model, path.end_mm, tolerance=tolerance, **options)  # type: ignore[arg-type]
    assert target.shape == (len(move), 3)
    return {int(m): sorted(share[move == m].tolist()) for m in np.unique(move)}


def left(stretch: float, a: float, b: float) -> float:
    """How far the best arc between two points of an ellipse leaves it: many centres on the bisector are
    tried."""
    turn = np.linspace(a, b, 65) * 2 * np.pi
    points = 20.0 * np.column_stack([np.cos(turn) * (1 - stretch), np.sin(turn)])
    middle, chord = (points[0] + points[-1]) / 2, points[-1] - points[0]
    across = np.array([-chord[1], chord[0]]) / np.hypot(*chord)
    offset = -20.0 * math.cos(math.pi * (b - a)) + np.linspace(-0.1, 0.1, 2001)
    centre = middle - offset[:, None] * across
    away = np.hypot(*np.moveaxis(points - centre[:, None], 2, 0)) - np.hypot(*(points[0] - centre).T)[:, None]
    return float(np.abs(away).max(axis=1).min())


CIRCLE = (feed(20.0, 0.0, 0.0), arc(20.0, 0.0, 0.0, centre=(0.0, 0.0, 0.0), degrees=360.0))


@pytest.mark.parametrize("tolerance", (0.0002, 0.001))
def test_an_arc_is_cut_into_few_parts_that_all_fit(tolerance: float) -> None:
    path = toolpath(*CIRCLE)
    shares = cuts(path, STRETCH, tolerance)[1]
    edges = [0.0, *shares, 1.0]
    assert 3 <= len(shares) <= (9 if tolerance == 0.001 else 17)
    for a, b in pairwise(edges):
        assert left(1e-3, a, b) < 1.2 * tolerance
    # half as many would not do
    assert max(left(1e-3, a, b) for a, b in pairwise(edges[::2])) > tolerance


def test_parts_of_one_round_are_equal_and_lie_on_the_arc() -> None:
    path = toolpath(*CIRCLE)
    move, share, target = subdivide_arcs(path, STRETCH, path.end_mm, np.ones(2, bool), 0.001, None, 0.0)
    assert set(move.tolist()) == {1}
    angle = 2 * np.pi * share
    assert target == pytest.approx(
        20.0 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), abs=1e-9
    )
    moved = subdivide_arcs(
        path, STRETCH, path.end_mm + np.array([1.0, 2.0, 3.0]), np.ones(2, bool), 0.001, None, 0.0
    )
    assert moved[2] == pytest.approx(target + np.array([1.0, 2.0, 3.0]))


def test_a_whole_turn_that_does_not_come_back_is_cut_half_a_turn_before_its_end() -> None:
    climb = linear(np.array([[0.0, 0.0, 1e-4], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    for degrees in (360.0, -360.0, 3 * 360.0):
        helix = arc(20.0, 0.0, 10.0, centre=(0.0, 0.0, 0.0), degrees=degrees)
        path = toolpath(feed(20.0, 0.0, 0.0), helix)
        assert cuts(path, climb) == {1: pytest.approx([1 - 180 / abs(degrees)])}
        # nothing leads its ends apart
        assert cuts(path, linear(np.diag([1e-4, 1e-4, 1e-4]))) == {}
    most = arc(*(20 * np.array([math.cos(-0.2), math.sin(-0.2)])), 10.0, centre=(0.0, 0.0, 0.0),
               degrees=360.0 - math.degrees(0.2))  # fmt: skip
    assert cuts(toolpath(feed(20.0, 0.0, 0.0), most), climb) == {}


@pytest.mark.parametrize("turns", (1, 2, 5))
def test_both_parts_of_a_turn_that_does_not_come_back_fit(turns: int) -> None:
    """An ellipse that climbs: a circle about the whole may leave it less than those through the ends of its
    parts."""
    path = toolpath(feed(20.0, 0.0, 0.0), arc(20.0, 0.0, 10.0, centre=(0.0, 0.0, 0.0), degrees=360.0 * turns))
    model = linear(np.array([[1e-3, 0.0, 1e-4], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    tolerance = 1.01 * fit_pieces(path, model, path.end_mm, pieces((0, 0.0, 1.0)), NO_TOOL, 64 * turns)[0]
    edges = [0.0, *cuts(path, model, tolerance)[1], 1.0]
    assert len(edges) > 2
    parts = pieces(*((0, a, b) for a, b in pairwise(edges)))
    assert fit_pieces(path, model, path.end_mm, parts, NO_TOOL, 64 * turns).max() <= tolerance


def test_an_arc_that_stays_an_arc_is_not_cut() -> None:
    path = toolpath(*CIRCLE, QUARTER)
    assert cuts(path, linear(np.diag([1e-3, 1e-3, 5e-3]))) == {}
    assert cuts(path, STRETCH, 0.03) == {}
    assert cuts(toolpath(feed(1.0, 0.0, 0.0)), STRETCH) == {}


def test_only_free_arcs_are_cut() -> None:
    path = toolpath(*CIRCLE, replace(CIRCLE[1]), rapid(0.0, 0.0, 0.0))
    got = cuts(path, STRETCH)
    assert got[1] == got[2]
    assert cuts(path, STRETCH, free=np.array([True, False, True, True])) == {2: got[2]}
    assert cuts(path, STRETCH, free=np.zeros(4, bool)) == {}


def test_what_no_arc_fits_is_refused_with_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """One part after no division, a few after one; the next round has those that still do not fit."""
    monkeypatch.setattr(arcs, "_DEEPEST", 1)
    path = toolpath(replace(CIRCLE[0], line=4), replace(QUARTER, line=7), replace(CIRCLE[1], line=9))
    with pytest.raises(CannotCompute, match="however finely it is divided into arcs") as caught:
        cuts(path, STRETCH, 0.01)
    assert caught.value.line == 9
    assert cuts(path, STRETCH, 0.03) == {}


def test_arcs_that_need_very_many_parts_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    path = toolpath(*CIRCLE, CIRCLE[1])
    needed = sum(len(s) + 1 for s in cuts(path, STRETCH, 1e-5).values())
    monkeypatch.setattr(arcs, "_PIECES", 1)
    assert needed > 2 * 16
    with pytest.raises(CannotCompute):
        cuts(path, STRETCH, 1e-5)
    monkeypatch.setattr(arcs, "_PIECES_PER_ARC", needed)
    assert cuts(path, STRETCH, 1e-5)


@pytest.mark.parametrize(("count", "rounds"), [(1, 14), (2, 14), (3, 13)])
def test_arcs_are_divided_in_at_most_14_rounds(
    count: int, rounds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What never fits is halved: 2^13 pieces of one arc, and 3 times 2^13 are more than 20000."""
    seen = []

    def never(*rest: object) -> np.ndarray:
        seen.append(len(rest[3]))  # type: ignore[arg-type]
        return np.full(len(rest[3]), 0.0012)  # type: ignore[arg-type]

    monkeypatch.setattr(arcs, "fit_pieces", never)
    path = toolpath(CIRCLE[0], *(CIRCLE[1] for _ in range(count)))
    with pytest.raises(CannotCompute):
        cuts(path, NONE)
    assert sum(seen) == count * (2**rounds - 1)


@pytest.mark.parametrize(
    ("times", "parts"), [(1.01, 2), (6.9, 2), (7.0, 3), (1000.0, 11), (3400.0, 16), (1e6, 16)]
)
def test_an_arc_is_divided_by_the_third_root_of_what_it_exceeds(
    times: float, parts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And 5 % more, from 2 to 16."""
    departures = iter([0.001 * times, 0.0])
    monkeypatch.setattr(arcs, "fit_pieces", lambda *rest: np.full(len(rest[3]), next(departures)))
    got = cuts(toolpath(*CIRCLE), NONE)[1]
    assert got == pytest.approx(np.arange(1, parts) / parts)


X, Y, Z = (np.arange(3) == axis for axis in range(3))
#: without an error every part fits
NONE = Toy()


@pytest.mark.parametrize("sign", (1.0, -1.0))
@pytest.mark.parametrize(
    ("turning", "expected"),
    [(X, [0.5]), (Y, [0.25, 0.75]), (X | Y, [0.25, 0.5, 0.75]), (Z, []), (X & Y, [])],
)
def test_an_arc_is_cut_where_an_axis_turns_round(
    sign: float, turning: np.ndarray, expected: list[float]
) -> None:
    path = toolpath(CIRCLE[0], arc(20.0, 0.0, 0.0, centre=(0.0, 0.0, 0.0), degrees=sign * 360.0))
    got = cuts(path, NONE, turning=turning)
    assert got.get(1, []) == pytest.approx(expected)
    # the first axis of the other planes is Z, then Y
    for plane in (1, 2):
        arcs_ = replace(path.arcs, plane=np.array([plane], np.int8))
        order = list(ORDER[plane])
        turned = replace(path, end_mm=in_plane(plane, *path.end_mm.T), arcs=arcs_)
        chosen = np.zeros(3, bool)
        chosen[order] = turning
        assert cuts(turned, NONE, turning=chosen).get(1, []) == pytest.approx(expected)


def test_turns_of_many_circles_and_of_a_part_of_one() -> None:
    """From -30 to 420 degrees X turns at 0, 180, 360 and Y at 90, 270."""
    c, s = 20 * math.cos(math.pi / 6), 20 * math.sin(math.pi / 6)
    turns = arc(
        20 * math.cos(math.radians(420)),
        20 * math.sin(math.radians(420)),
        0.0,
        centre=(0, 0, 0),
        degrees=450.0,
    )
    path = toolpath(feed(c, -s, 0.0), turns)
    assert cuts(path, NONE, turning=X)[1] == pytest.approx([30 / 450, 210 / 450, 390 / 450])
    assert cuts(path, NONE, turning=Y)[1] == pytest.approx([120 / 450, 300 / 450])
    short = arc(
        20 * math.cos(math.radians(80)), 20 * math.sin(math.radians(80)), 0.0, centre=(0, 0, 0), degrees=70.0
    )
    path = toolpath(feed(20 * math.cos(math.radians(10)), 20 * math.sin(math.radians(10)), 0.0), short)
    assert cuts(path, NONE, turning=X | Y) == {}


@pytest.mark.parametrize(("degrees", "cut"), [(1.80, False), (1.82, True)])
def test_an_axis_that_goes_on_by_less_than_the_band_does_not_turn(degrees: float, cut: bool) -> None:
    """A band of 10 um at a radius of 20 mm: acos(1 - 0.0005), or 1.812 degrees."""
    a = math.radians(-degrees)
    from_below = toolpath(
        feed(20 * math.cos(a), 20 * math.sin(a), 0.0),
        arc(0.0, 20.0, 0.0, centre=(0, 0, 0), degrees=90.0 + degrees),
    )
    assert bool(cuts(from_below, NONE, turning=X, band=0.01)) == cut
    end = (20 * math.cos(-a), 20 * math.sin(-a), 0.0)
    beyond = toolpath(feed(0.0, -20.0, 0.0), arc(*end, centre=(0, 0, 0), degrees=90.0 + degrees))
    assert bool(cuts(beyond, NONE, turning=X, band=0.01)) == cut


def test_a_quarter_of_a_tiny_arc_is_a_turn_whatever_the_band() -> None:
    for ends, expected in ((-30.0, []), (-40.0, [40 / 140])):
        a, b = math.radians(ends), math.radians(100.0)
        path = toolpath(
            feed(0.01 * math.cos(a), 0.01 * math.sin(a), 0.0),
            arc(0.01 * math.cos(b), 0.01 * math.sin(b), 0.0, centre=(0, 0, 0), degrees=100.0 - ends),
        )
        got = cuts(path, NONE, turning=X, band=0.01)
        assert got.get(1, []) == pytest.approx(expected)


def cut_one_by_one(path: Toolpath, turning: np.ndarray, band: float) -> list[tuple[int, float, float]]:
    """Arcs cut where an axis turns round, the plain way: index, begin and end of each piece."""
    cut = []
    start = path.starts_mm()
    for i, move in enumerate(path.arcs.move.tolist()):
        first, second, _ = ORDER[path.arcs.plane[i]]
        arm = start[move] - path.arcs.centre_mm[i]
        angle, radius = math.atan2(arm[second], arm[first]), math.hypot(arm[first], arm[second])
        sweep = float(path.arcs.sweep_rad[i])
        inner = []
        for axis, phase in ((first, 0.0), (second, math.pi / 2)):
            shares = [(phase + k * math.pi - angle) / sweep for k in range(-20, 21)]
            inner += [share for share in shares if turning[axis]]
        least = min(math.sqrt(2 * band / radius) / abs(sweep), 0.25)
        edges = [0.0, *sorted(share for share in inner if least < share < 1 - least), 1.0]
        cut += [(i, low, high) for low, high in pairwise(edges)]
    return cut


@pytest.mark.parametrize("seed", range(6))
def test_quadrants_are_those_of_the_plain_way(seed: int) -> None:
    rng = np.random.default_rng(seed)
    moves = [rapid(0, 0, 0)]
    for _ in range(20):
        end, centre = rng.uniform(-50, 50, 3), rng.uniform(-50, 50, 3)
        degrees, plane = float(rng.uniform(-900, 900)), int(rng.integers(3))
        moves.append(arc(*end.tolist(), centre=tuple(centre.tolist()), degrees=degrees, plane=plane))
    path = toolpath(*moves)
    count = len(path.arcs)
    whole = Pieces(np.arange(count), np.zeros(count), np.ones(count))
    turning = rng.random(3) < 0.6
    pieces = arcs._at_quadrants(path, whole, turning, 0.02)
    expected = cut_one_by_one(path, turning, 0.02)
    assert pieces.arc.tolist() == [i for i, _, _ in expected]
    assert pieces.begin == pytest.approx([low for _, low, _ in expected], abs=1e-12)
    assert pieces.end == pytest.approx([high for _, _, high in expected], abs=1e-12)
