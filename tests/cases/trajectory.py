"""Routes to plan, the nasty ones among them, and judges that know nothing of how paths are made."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from olp.core.arrays import Array, Index
from olp.trajectory.critical import best_profile, driven
from olp.trajectory.motion import Motion
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.same import groups_of_same
from olp.trajectory.smooth import SmoothPath

#: samples in one block, and segments that a search looks ahead
_BLOCK = 1 << 14
_AHEAD = 64
#: (mm) distances below are none
_EVEN_MM = 1e-8
_TINY = float(np.finfo(np.float64).tiny)

LIMITS = AxisLimits(np.array([500.0, 500, 300]), np.array([5e3, 5e3, 3e3]), np.array([1e5, 1e5, 6e4]))


def critical(path: SmoothPath, limits: AxisLimits) -> Motion:
    """The motion along `path` from rest to rest; no axis limit and no feed is exceeded."""
    if not len(path):
        return Motion(np.zeros(1), np.zeros((0, 4)), np.zeros((0, 4, 3)), np.zeros(0, np.int64), path.line)
    return driven(path, best_profile(path, limits))


def route(point: Array, feed: float | Array, tolerance: float) -> Route:
    n = len(point)
    band = np.full(n, tolerance)
    band[[0, -1]] = 0.0
    feeds = np.broadcast_to(np.asarray(feed, float), (max(n - 1, 0),)).copy()
    return Route(np.asarray(point, float), feeds, np.arange(max(n - 1, 0)), band, np.zeros(n))


def random_route(seed: int) -> tuple[Route, AxisLimits]:
    """Lengths over decades, turns from none to right round, feeds, tolerances and limits of all sizes."""
    r = np.random.default_rng(seed)
    n = int(r.integers(2, 60))
    step = r.normal(size=(n - 1, 3))
    if r.random() < 0.4:
        step = np.cumsum(0.2 * step, axis=0)
    if r.random() < 0.3:
        step[:, r.integers(0, 3)] = 0.0
    step /= np.linalg.norm(step, axis=1)[:, None] + 1e-300
    length = 10.0 ** r.uniform(*sorted(r.uniform(-9, 3, 2)), size=n - 1)
    if r.random() < 0.3:
        length[r.random(n - 1) < 0.2] = 0.0
    way = np.cumsum(step * length[:, None], axis=0)
    point = r.normal(size=3) * 100 + np.concatenate((np.zeros((1, 3)), way))
    if r.random() < 0.2:
        point = np.round(point, 3)
    feed = 10.0 ** (r.uniform(-2, 4, size=n - 1) if r.random() < 0.5 else np.full(n - 1, r.uniform(-1, 4)))
    feed[r.random(n - 1) < 0.1] = np.inf
    given = route(point, feed, 10.0 ** r.uniform(-4, 1))
    given.tolerance_mm[1:-1] *= 10.0 ** r.uniform(0, 2, n)[1:-1]
    scale = 10.0 ** r.uniform(-1, 1, size=(3, 3))
    limits = AxisLimits(LIMITS.velocity * scale[0], LIMITS.acceleration * scale[1], LIMITS.jerk * scale[2])
    return given, limits


def far_from(point: Array, q: Array, source: Index, around: int = 60) -> Array:
    """(n,) distance of places to the polyline, looked for around the segment they come from."""
    best = np.full(len(q), np.inf)
    a, d = point[:-1], np.diff(point, axis=0)
    square = np.maximum((d * d).sum(axis=1), 1e-300)
    for shift in range(-around, around + 1):
        k = np.clip(source + shift, 0, len(d) - 1)
        share = np.clip(((q - a[k]) * d[k]).sum(axis=1) / square[k], 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(a[k] + share[:, None] * d[k] - q, axis=1))
    return best


def _line(*points: tuple[float, float, float]) -> Array:
    return np.array(points, float)


def _noise(spacing: float) -> Array:
    x = np.arange(0.0, 30.0, spacing)
    return np.round(np.stack((x, np.sin(x), 0.2 * np.cos(3 * x)), axis=1), 3)


def _circle(radius: float, chords: int, turns: int = 1) -> Array:
    t = np.linspace(0, 2 * np.pi * turns, chords * turns + 1)
    return np.stack((radius * np.cos(t), radius * np.sin(t), 0 * t), axis=1)


def _tiny() -> Array:
    r = np.random.default_rng(1)
    x = np.concatenate(([0.0, 10_000.0], 10_000.0 + np.cumsum(10.0 ** r.uniform(-9, -3, 300)), [20_000.0]))
    return np.stack((x, np.where(np.arange(len(x)) % 2, 1e-6, 0.0), 0 * x), axis=1)


def _spiral() -> Array:
    t = np.linspace(0, 40, 2000)
    return np.round(np.stack(((0.5 + 0.16 * t) * np.cos(t), (0.5 + 0.16 * t) * np.sin(t), 0 * t), axis=1), 3)


def _stair(step: float) -> Array:
    k = np.arange(80)
    return np.stack((step * ((k + 1) // 2), step * (k // 2), 0.0 * k), axis=1)


def _walk(n: int, step: float) -> Array:
    r = np.random.default_rng(3)
    turn = np.cumsum(r.normal(0, 1.0, n))
    return np.cumsum(step * np.stack((np.cos(turn), np.sin(turn), 0 * turn), axis=1), axis=0)


_LIMITED = {
    "gentle jerk": AxisLimits(LIMITS.velocity, LIMITS.acceleration, np.full(3, 10.0)),
    "huge jerk": AxisLimits(LIMITS.velocity, LIMITS.acceleration, np.full(3, 1e9)),
    "one axis slow": AxisLimits(*(np.array([1.0, 0.01, 1.0]) * e for e in (500.0, 5e3, 1e5))),
}
_FEEDS = np.tile([5.0, 100.0, np.inf, 1e-2], 25)

CASES: dict[str, Callable[[], tuple[Route, AxisLimits]]] = {
    "one line": lambda: (route(_line((0, 0, 0), (100, 50, 3)), 100.0, 0.1), LIMITS),
    "one short line": lambda: (route(_line((0, 0, 0), (1e-7, 0, 0)), 100.0, 0.1), LIMITS),
    "right angle": lambda: (route(_line((0, 0, 0), (50, 0, 0), (50, 50, 0)), 100.0, 0.02), LIMITS),
    "rapid corner": lambda: (route(_line((0, 0, 0), (50, 0, 0), (50, 50, 0)), np.inf, 0.5), LIMITS),
    "collinear": lambda: (route(np.linspace(0, 1, 101)[:, None] * [200.0, 10, 0], _FEEDS, 0.01), LIMITS),
    "duplicates": lambda: (route(np.repeat(_walk(50, 1.0), 3, axis=0), 50.0, 0.01), LIMITS),
    "tiny beside long": lambda: (route(_tiny(), 200.0, 0.01), LIMITS),
    "reversal": lambda: (route(_line((0, 0, 0), (10, 0, 0), (0, 0, 0), (0, 5, 0)), 50.0, 0.05), LIMITS),
    "spike": lambda: (route(np.insert(_noise(0.1), 150, [500, 300, 0], axis=0), 100.0, 0.01), LIMITS),
    "stair at the tolerance": lambda: (route(_stair(0.01), 100.0, 0.01), LIMITS),
    "tolerance above the segments": lambda: (route(_walk(300, 0.05), 100.0, 5.0), LIMITS),
    "noise 0.05": lambda: (route(_noise(0.05), 100.0, 0.005), LIMITS),
    "noise 0.2": lambda: (route(_noise(0.2), 100.0, 0.01), LIMITS),
    "circle": lambda: (route(_circle(50, 500, 2), 200.0, 0.01), LIMITS),
    "fine circle": lambda: (route(_circle(10, 6000), 200.0, 0.01), LIMITS),
    "closed square": lambda: (route(_circle(10, 4), 200.0, 0.01), LIMITS),
    "spiral": lambda: (route(_spiral(), 200.0, 0.005), LIMITS),
    "zigzag": lambda: (route(_walk(1000, 0.05), 100.0, 0.005), LIMITS),
    "slow feed": lambda: (route(_walk(60, 1.0), 1e-2, 0.01), LIMITS),
    "feed changes in a curve": lambda: (route(_circle(50, 100), _FEEDS, 0.01), LIMITS),
    "corner near the end": lambda: (route(_line((0, 0, 0), (90, 0, 0), (90, 1e-3, 0)), 100.0, 1.0), LIMITS),
    "single axis": lambda: (route(np.arange(50.0)[:, None] * [0.0, 0, 1], 100.0, 0.01), LIMITS),
    **{
        name: (lambda limits=limits: (route(_walk(200, 1.0), 100.0, 0.02), limits))
        for name, limits in _LIMITED.items()
    },
}  # fmt: skip


def excess(motion: Motion, limits: AxisLimits, feed: Array) -> float:
    """The largest ratio of a velocity, acceleration, jerk or speed to its limit: at five places of each
    piece, both sides of every break, and by differences of positions at 1 kHz."""
    lasts = np.diff(motion.start_s)
    piece = np.arange(len(motion))
    worst = 0.0
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        _, v, a, j = motion.of(piece, share * lasts)
        for values, most in ((v, limits.velocity), (a, limits.acceleration), (j, limits.jerk)):
            worst = max(worst, float((np.abs(values) / most).max()))
        worst = max(worst, float((np.linalg.norm(v, axis=1) / feed).max()))
    times = np.arange(0.0, min(motion.duration_s, 20.0), 1e-3)
    q = motion.at(times)[0]
    rounding = 8 * np.abs(q).max(initial=0.0) * 2.0**-52
    for order, most in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk)):
        steps = np.abs(np.diff(q, n=order, axis=0)) - 2.0**order * rounding
        worst = max(worst, float((steps / (most * 1e-3**order)).max(initial=0.0)))
    return worst


def path_deviation(motion: Motion, route: Route, places: int = 5) -> Array:
    """(k,) largest distance mm of each piece, at `places` times, from the polyline: samples are matched to
    segments that never go back, nearest by least squares. A wrong match can make the distance
    too large, never too small."""
    polyline = _polyline(route)
    largest = np.zeros(len(motion))
    known = 0
    for part, point in _samples(motion, places):
        flat, known = _in_order(point.reshape(-1, 3), polyline, known)
        largest[part] = flat.reshape(point.shape[:2]).max(axis=1)
    return largest


def _samples(motion: Motion, places: int) -> Iterator[tuple[Index, Array]]:
    """Blocks of pieces (n,) and their positions (n, places, 3) in order of time."""
    block = max(_BLOCK // places, 1)
    share = np.linspace(0.0, 1.0, places)
    for a in range(0, len(motion), block):
        piece = np.arange(a, min(a + block, len(motion)))
        seconds = np.diff(motion.start_s[a : a + len(piece) + 1])
        u = (seconds[:, None] * share).ravel()
        yield piece, motion.of(np.repeat(piece, places), u)[0].reshape(len(piece), places, 3)


def _to_segments(point: Array, begin: Array, end: Array) -> Array:
    """(n, m) distances of points (n, 3) from segments (m, 3) to (m, 3)."""
    delta = (end - begin)[None]
    offset = point[:, None, :] - begin[None]
    size = np.maximum((delta * delta).sum(axis=2), _TINY)
    share = np.clip((offset * delta).sum(axis=2) / size, 0.0, 1.0)
    result: Array = np.sqrt(((offset - share[:, :, None] * delta) ** 2).sum(axis=2))
    return result


def _in_order(point: Array, polyline: Array, first: int) -> tuple[Array, int]:
    """(n,) distances of points in order from segments that never go back, the first not before `first`;
    and the segment reached. Dynamic programming over a window that slides along."""
    away = np.zeros(len(point))
    done = 0
    while done < len(point):
        take = point[done : done + _AHEAD]
        last = min(first + 2 * _AHEAD, len(polyline) - 1)
        begin, end = polyline[first:last], polyline[first + 1 : last + 1]
        table = _to_segments(take, begin, end)
        # rounding decides nothing: of segments that are as near the earliest is the one
        cost = np.where(table > _EVEN_MM, table, 0.0) ** 2
        for i in range(1, len(cost)):
            cost[i] += np.minimum.accumulate(cost[i - 1])
        # back from the best end; of equals the earliest, so that a path driven back later is not skipped
        column = int(np.argmin(cost[-1]))
        picks = [column]
        for i in range(len(cost) - 2, -1, -1):
            column = int(np.argmin(cost[i, : column + 1]))
            picks.append(column)
        picks.reverse()
        # the later half of a block is decided with what comes after it
        keep = len(take) if done + len(take) >= len(point) else max(len(take) // 2, 1)
        away[done : done + keep] = table[np.arange(keep), picks[:keep]]
        first += picks[keep - 1]
        done += keep
    return away, first


def _polyline(route: Route) -> Array:
    """(m, 3) waypoints, those that are the same as the one before left out."""
    group = groups_of_same(route.point_mm)
    polyline = route.point_mm[np.flatnonzero(np.diff(group, prepend=-1))]
    return np.repeat(polyline, 2, axis=0) if len(polyline) == 1 else polyline
