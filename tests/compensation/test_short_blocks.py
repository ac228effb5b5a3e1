"""Digits of short blocks along contours, chosen together."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

import olp
from olp.compensation.plan import Limits
from olp.compensation.short_blocks import Grid, together
from olp.program.contours.elements import Elements

STEP = 1e-4
LIMITS = Limits(0.001, STEP)
#: no two digits of an end may be farther off than rounding and a quarter of the tolerance
MOST = 0.71 * STEP + 0.25e-3


def chain(points: np.ndarray, radius: float = 5.0, arc: tuple[int, ...] = ()) -> Elements:
    """Straight parts between points, and arcs."""
    begin, end = points[:-1], points[1:]
    count = len(end)
    way = end - begin
    angle = np.arctan2(way[:, 1], way[:, 0])
    first = np.arange(count) == 0
    return Elements(
        np.arange(count), first, ~first, np.ones(count), np.full(count, radius), np.zeros(count, np.int8),
        begin, end, angle, angle, np.isin(np.arange(count), arc), begin, np.zeros(count), np.ones(count),
        np.ones(count),
    )  # fmt: skip


def grid(count: int, free: tuple[int, ...] | None = None, step: float = STEP) -> Grid:
    which = np.ones(count, bool) if free is None else np.isin(np.arange(count), free)
    return Grid(np.full((count, 2), step), np.full((count, 2), 0.3 * STEP), which)


def turned_mm(elements: Elements, points: np.ndarray) -> np.ndarray:
    """How far other ends of parts turn the tool, but for the first part."""
    ends = np.vstack((elements.begin[:1], points))
    now, then = np.diff(ends, axis=0)[1:], (elements.end - elements.begin)[1:]
    cross = now[:, 0] * then[:, 1] - now[:, 1] * then[:, 0]
    return np.asarray(np.abs(cross) / np.square(then).sum(axis=1) * elements.radius[1:])


def rounded(elements: Elements, some: Grid) -> np.ndarray:
    return np.asarray(np.rint((elements.end - some.zero) / some.step) * some.step + some.zero)


def random_chain(seed: int, count: int = 6) -> Elements:
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.normal(size=count) * 0.2)
    way = 10 ** rng.uniform(-1.5, -0.5, (count, 1)) * np.column_stack((np.cos(angle), np.sin(angle)))
    way[0] = 20.0
    return chain(np.vstack((np.zeros((1, 2)), np.cumsum(way, axis=0))))


@pytest.mark.parametrize("seed", range(5))
def test_short_blocks_turn_far_less_than_with_the_nearest_digits(seed: int) -> None:
    elements, some = random_chain(seed, 90), grid(90)
    found = together(elements, some, LIMITS)
    off = np.hypot(*(found - elements.end).T)
    assert off.max() <= MOST + 1e-9
    number = (found - some.zero) / STEP
    assert np.abs(number - np.rint(number)).max() < 1e-6
    nearest = turned_mm(elements, rounded(elements, some))
    assert turned_mm(elements, found).mean() < 0.3 * nearest.mean()


@pytest.mark.parametrize("seed", range(3))
def test_of_all_digits_about_two_ends_those_are_taken_that_cost_least(seed: int) -> None:
    """Compared with all of them, one by one."""
    elements = random_chain(seed, 4)
    some = grid(4, free=(1, 2))

    def cost(points: np.ndarray) -> float:
        off = np.square(points[1:3] - elements.end[1:3]).sum()
        return float(off + np.square(turned_mm(elements, points)).sum())

    nearest, least = rounded(elements, some), np.inf
    for steps in product(range(-2, 3), repeat=4):
        points = nearest.copy()
        points[1:3] += np.array(steps).reshape(2, 2) * STEP
        if np.hypot(*(points[1:3] - elements.end[1:3]).T).max() <= MOST:
            least = min(least, cost(points))
    found = together(elements, some, LIMITS)
    # the last end is not a number of the grid that can be chosen, and keeps the nearest one
    assert found[3] == pytest.approx(elements.end[3], abs=0)
    found[3], found[0] = nearest[3], nearest[0]
    assert cost(found) <= least * (1 + 1e-9)


def test_an_end_with_more_digits_follows_the_one_with_less() -> None:
    elements = random_chain(1, 4)
    some = grid(4, free=(1, 2))
    some.step.flags.writeable = True
    some.step[2] = STEP / 100
    found = together(elements, some, LIMITS)
    found[3] = rounded(elements, some)[3]
    assert turned_mm(elements, found)[1] < 0.02 * turned_mm(elements, rounded(elements, some))[1]


def test_what_is_on_the_grid_long_or_not_free_stays() -> None:
    elements, some = random_chain(2, 8), grid(8)
    exact = rounded(elements, some)
    straight = chain(np.vstack((np.zeros((1, 2)), exact)))
    assert together(straight, some, LIMITS) == pytest.approx(exact, abs=1e-12)
    long = chain(1000 * np.vstack((np.zeros((1, 2)), elements.end)))
    assert (together(long, some, LIMITS) == long.end).all()
    bound = grid(8, free=())
    assert (together(elements, bound, LIMITS) == elements.end).all()
    arcs = chain(np.vstack((np.zeros((1, 2)), elements.end)), arc=tuple(range(8)))
    assert (together(arcs, some, LIMITS) == arcs.end).all()


def test_contours_are_apart() -> None:
    """The first part of a contour does not follow the last one of the contour before."""
    elements = random_chain(3, 6)
    elements.first.flags.writeable = True
    elements.first[3] = True
    both = together(elements, grid(6), LIMITS)
    alone = chain(np.vstack((elements.begin[:1], elements.end[:3])))
    assert both[:3] == pytest.approx(together(alone, grid(3), LIMITS), abs=1e-12)


#: X and Y are off by what no digit states
BENT = {"y.csv": "Y_mm,EXY_um,EYY_um\n-1000,-137,-71\n2000,263,190\n"}


@pytest.mark.parametrize("unit", ["G21", "G20", "G91"])
def test_a_short_block_keeps_its_direction_as_written(tmp_path: Path, unit: str) -> None:
    """A block of 0.06 mm at a cutter of 5 mm. In G91 digits count from the block before, and stay."""
    tables = f"{TRUE_ZERO}[tools.1]\nZ_mm = 0.0\nradius_mm = 5.0\n[job_defaults]\ntool = 1\n"
    curve = '[[curves]]\nfile = "y.csv"\ninterpolation = "linear"\n'
    path = machine(tmp_path, curve, BENT, tables=tables)
    body = {
        "G21": "G41 D1 G1 X34.013 Y25.013\nX34.061 Y25.049\nZ-2\nX74.061 Y55.049\nG40 X99",
        "G20": "G20\nG41 D1 G1 X1.3391 Y0.9848\nX1.3410 Y0.9862\nZ-0.1\nX3.3410 Y2.4862\nG40 X4",
        "G91": "G91\nG41 D1 G1 X24.013 Y18.013\nX0.048 Y0.036\nZ-2\nX40 Y30\nG40 X30\nG90",
    }[unit]
    text = f"G21 G90 G54\nG0 X0 Y0 Z10\nG1 X10 Y7 Z0 F600\n{body}\nM2\n".encode()
    deviation = olp.correct(text, path).report["deviation"]
    assert deviation["holds"] == (unit != "G91")
