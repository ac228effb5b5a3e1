"""One linear Gaussian adjustment of all readings of a machine.

theta holds the 18 curves, their half differences of directions, cyclic terms and squareness; every reading
is a linear functional of it and of nuisances (zeros, slopes, squares, drift, scale). The result carries the
covariance of all of it, so that what was not measured is known as unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from olp.calibration.estimator.basis import CurveSpace, Spline, Step, Wave, slope_grid, slope_weights
from olp.calibration.estimator.normal import Block, Normal, Solved, residuals_of, solve
from olp.calibration.estimator.parameters import CROSS, LEVER_MM, Parameters, Place, frame_columns
from olp.calibration.estimator.prior import POSE, Prior
from olp.calibration.estimator.screening import Outlier, screened, slips_of, without
from olp.calibration.estimator.smoothing import Shape, shape_of
from olp.calibration.iso230.separation import aliased
from olp.calibration.observations.circles import Circles, circle_block, circle_places
from olp.calibration.observations.diagonals import (
    Diagonal,
    diagonal_block,
    diagonal_places,
    noise_of_diagonal,
)
from olp.calibration.observations.lengths import STILL_MM, Lengths, Station, first_station, lengths_block
from olp.calibration.observations.lines import Line, Noise, line_block, square_names, targets_of
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.pods import STILL_MM as POD_STILL_MM
from olp.calibration.observations.pods import Pods, Pose, first_poses, pods_block
from olp.calibration.observations.points import Points, points_block
from olp.calibration.observations.squareness import squareness_block
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.progress import Progress, silent
from olp.core.units import AXES

#: Cells of the spline of a curve: as many as a line has targets between these.
FEWEST, MOST = 6, 48
HALF_CELLS = 5
#: Cells where no lines but points or lengths tell of an axis, to begin with; they double as long as
#: chi-square is off by more than MISFIT standard deviations and becomes BETTER by it.
POINT_CELLS, MISFIT, BETTER = 12, 5.0, 0.8
#: The adjustment is made anew after cyclic terms or points were left out, so often at most.
PASSES = 8
#: A cyclic term below so many standard deviations is noise.
CYCLIC_SEEN = 4.0
#: A line shorter than this share of its axis' longest one is a sweep: it makes the box no smaller.
SWEEP = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class LineResult:
    """A line after the fit: residuals (n,) in mm or rad, noise, sum of squares of standardised residuals."""

    line: Line
    noise: Noise
    residual: Array
    chi_square: float


@dataclass(frozen=True, slots=True, eq=False)
class PointsResult:
    """Points after the fit: residuals in mm in the machine's frame, x, y, z of each point by turns, and the
    sum of squares of standardised residuals."""

    points: Points
    residual: Array
    chi_square: float


@dataclass(frozen=True, slots=True, eq=False)
class LengthsResult:
    """Lengths after the fit: where their station is, residuals (n,) in mm, sum of squares of standardised
    residuals."""

    lengths: Lengths
    station: Station
    residual: Array
    chi_square: float


@dataclass(frozen=True, slots=True, eq=False)
class PodsResult:
    """Directions after the fit: the poses of their pods, residuals in rad (and mm of baselines, last), sum of
    squares of standardised residuals."""

    pods: Pods
    poses: tuple[Pose, ...]
    residual: Array
    chi_square: float


@dataclass(frozen=True, slots=True, eq=False)
class RadialResult:
    """A diagonal or circles after the fit: residuals (n,) in mm of the readings used, noise, sum of squares
    of standardised residuals."""

    taken: Diagonal | Circles
    noise: Noise
    residual: Array
    chi_square: float


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """theta with its covariance and layout; see `error`, `sigma`, `design`.

    `slopes` are the mean slopes of the straightness curves on lines through the datum, as functionals of
    theta: the gauge takes them as squareness. `box_mm` (3, 2) is what the lines covered. `cyclic_unseen` says
    by component why a period was not fitted.
    """

    measurements: Measurements
    parameters: Parameters
    theta: Array
    covariance: Array
    prior: Prior
    lines: tuple[LineResult, ...]
    points: tuple[PointsResult, ...]
    lengths: tuple[LengthsResult, ...]
    pods: tuple[PodsResult, ...]
    outliers: tuple[Outlier, ...]
    box_mm: Array
    slopes: Mapping[str, Array]
    chi_square: float
    freedom: float
    cyclic_unseen: Mapping[tuple[str, float], str]
    radial: tuple[RadialResult, ...] = ()

    def design(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        """(n, 3, size) dependence of the error on theta, in the frame of the machine where some points were
        seen in it, else in the gauge of the datum: on lines through it X has no mean slope, nor has Y towards
        Z."""
        position = np.atleast_2d(np.asarray(axis_mm, float))
        out = self.parameters.design(position, np.asarray(tool_mm, float), play)
        if self.parameters.framed:
            return out
        turn = self.turn
        arm = position - np.array(self.parameters.datum_mm)
        for row in range(3):
            k, m = (row + 1) % 3, (row + 2) % 3
            out[:, row] += arm[:, m, None] * turn[k] - arm[:, k, None] * turn[m]
        return out

    @property
    def turn(self) -> Array:
        """(3, size) rotation of the frame that the gauge asks for, as functionals of theta."""
        return np.stack([-self.slopes["EZY"], self.slopes["EZX"], -self.slopes["EYX"]])

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        """(n, 3) estimated error in mm, to first order."""
        return np.asarray(self.design(axis_mm, tool_mm, play) @ self.theta)

    def sigma(self, axis_mm: Array, tool_mm: Array) -> Array:
        """(n, 3) standard uncertainty of `error` in mm."""
        position, tool = np.atleast_2d(np.asarray(axis_mm, float)), np.asarray(tool_mm, float)
        rows = self.design(position, tool)
        variance = np.einsum("nik,kl,nil->ni", rows, self.covariance, rows, optimize=True)
        for name in self.parameters.spaces:
            axis = AXES.index(name[2])
            between = self.between_targets(name, position[:, axis])
            if not between.any():
                continue
            if name[1] in AXES:
                variance[:, AXES.index(name[1])] += between
                continue
            for i, a, k, _ in CROSS:
                if "ABC"[a] == name[1]:
                    variance[:, i] += between * self.parameters.lever(i, axis, k, position, tool) ** 2
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def between_targets(self, name: str, q: Array) -> Array:
        """(n,) variance of a component at q (n,) because nobody knows where between two targets a step is:
        with probability u it lies before q, so J^2 u (1 - u)."""
        space = self.parameters.spaces[name]
        raw = space.gauge @ self.theta[self.parameters.slices[name]]
        total = np.zeros(len(q))
        for feature, jump in zip(space.features, raw[space.spline.count :], strict=True):
            if isinstance(feature, Step):
                u = feature.values(q)
                total += jump**2 * u * (1.0 - u)
        return total

    def curve(self, name: str, q: Array) -> Array:
        """(n, size) mean of a component at q (n,) on its own line, in the gauge of the datum, without cyclic
        terms, as functionals of theta."""
        out = np.zeros((len(q), self.parameters.size))
        out[:, self.parameters.slices[name]] = self.parameters.spaces[name].values(q)
        if name in self.slopes:
            axis = AXES.index(name[2])
            out -= (q - self.parameters.datum_mm[axis])[:, None] * self.slopes[name]
        if self.parameters.framed:
            out += self._of_frame(name, q)
        return out

    def _of_frame(self, name: str, q: Array) -> Array:
        """(n, size) what the frame adds to a component: its shift to X, its turn to straightness, and that
        of the tool to the angles of the axis that bears it."""
        out = np.zeros((len(q), self.parameters.size))
        start, axis = self.parameters.slices["frame"].start, AXES.index(name[2])
        if name[1] not in AXES:
            if not self.parameters.after(axis):
                out[:, start + 6 + "ABC".index(name[1])] = 1.0 / LEVER_MM
            return out
        row = AXES.index(name[1])
        if not self.parameters.after(axis):
            # its angles count from the tool of its line
            tool = np.array([self.parameters.places[name].tool_mm])
            out[:, start + 6 : start + 9] = frame_columns(tool)[0, row, 3:]
        if axis == 0:
            out[:, start + row] = 1.0
        if row != axis:
            # the turn that the gauge took out comes back
            k = 3 - row - axis
            sign = 1.0 if (axis - k) % 3 == 1 else -1.0
            turn = -self.turn[k]
            turn[start + 3 + k] += 1.0 / LEVER_MM
            out += sign * (q - self.parameters.datum_mm[axis])[:, None] * turn
        return out

    def squareness(self, name: str) -> Array:
        """(size,) a squareness in the gauge of the datum, as functional of theta."""
        out = np.zeros(self.parameters.size)
        out[self.parameters.slices[name]] = 1.0
        first, second, sign = {
            "C0Y": ("EXY", "EYX", -1.0),
            "B0Z": ("EXZ", "EZX", 1.0),
            "A0Z": ("EYZ", "EZY", -1.0),
        }[name]
        return np.asarray(out + sign * (self.slopes[first] + self.slopes[second]))


def fit(
    measurements: Measurements,
    chain: str,
    *,
    travel_mm: Sequence[tuple[float, float]] | None = None,
    datum_mm: Vector | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Estimate the errors of a machine from all its readings.

    `travel_mm` bounds the box; the datum is the place in the box nearest to zero if left out. Where points or
    lengths alone tell of an axis and do not fit, its curves are given more freedom. Raises ConfigError where
    a line cannot be used, CannotCompute where nothing tells of an axis.
    """
    cells = POINT_CELLS
    found = _fit(measurements, chain, travel_mm, datum_mm, progress or silent, cells)
    alone = {line.component[2] for line in measurements.lines} != set(AXES)
    while alone and misfit(found) > MISFIT and cells < MOST:
        cells *= 2
        finer = _fit(measurements, chain, travel_mm, datum_mm, progress or silent, cells)
        if finer.chi_square / finer.freedom > BETTER * found.chi_square / found.freedom:
            break
        found = finer
    return found


def misfit(found: Fit) -> float:
    """By how many standard deviations chi-square is above what noise gives: by its cube root, which is nearly
    normal (E. B. Wilson and M. M. Hilferty, 1931)."""
    part = 2.0 / (9.0 * found.freedom)
    ratio = found.chi_square / found.freedom
    return float((ratio ** (1.0 / 3.0) - (1.0 - part)) / np.sqrt(part))


def _fit(
    measurements: Measurements,
    chain: str,
    travel_mm: Sequence[tuple[float, float]] | None,
    datum_mm: Vector | None,
    tell: Progress,
    cells: int,
) -> Fit:
    tell("noise", 0.0)
    lines, noises, outliers = screened(measurements.lines)
    clouds = list(measurements.points)
    radial: list[Diagonal | Circles] = [*measurements.diagonals, *measurements.circles]
    scattered: list[Points | Lengths | Pods] = [*clouds, *measurements.lengths, *measurements.pods]
    reached = [cloud.axis_mm for cloud in scattered]
    reached += [diagonal_places(d) for d in measurements.diagonals]
    reached += [circle_places(c) for c in measurements.circles]
    ranges, box = _ranges(lines, reached, travel_mm)
    datum = datum_mm or tuple(float(np.clip(0.0, *side)) for side in box)
    splines = [_spline(lines, axis, ranges[axis], cells) for axis in range(3)]
    waves, unseen = _waves(measurements, lines, scattered)
    shapes = _shapes(lines, noises, splines, waves, tell)
    lengths = list(measurements.lengths)
    stations = [first_station(rays) for rays in lengths]
    poses = [first_poses(pods) for pods in measurements.pods]
    framed = any(cloud.known_frame for cloud in clouds)
    theta = np.zeros(0)
    learnt: dict[str, tuple[float, float]] | None = None
    for _ in range(PASSES):
        parameters = _parameters(chain, (datum[0], datum[1], datum[2]), lines, splines, shapes, waves, framed)
        prior = Prior(parameters, shapes, _squares(measurements, parameters))
        if learnt is not None:
            prior.classes = learnt
        theta = theta if len(theta) == parameters.size else np.zeros(parameters.size)
        of_lines = [line_block(line, parameters, noise) for line, noise in zip(lines, noises, strict=True)]
        of_points = [points_block(cloud, parameters) for cloud in clouds]
        of_lengths = [
            lengths_block(rays, parameters, theta, station)
            for rays, station in zip(lengths, stations, strict=True)
        ]
        of_pods = [
            pods_block(pods, parameters, theta, own)
            for pods, own in zip(measurements.pods, poses, strict=True)
        ]
        others = [squareness_block(reading, parameters) for reading in measurements.squareness]
        noises_of_radial = [
            noise_of_diagonal(taken) if isinstance(taken, Diagonal) else Noise(taken.sigma, 0.0, None)
            for taken in radial
        ]
        of_radial = [
            diagonal_block(taken, parameters, noise)
            if isinstance(taken, Diagonal)
            else circle_block(taken, parameters)
            for taken, noise in zip(radial, noises_of_radial, strict=True)
        ]
        tell("adjustment", 0.5)
        normal, solved = _adjusted(
            [*of_lines, *of_points, *of_lengths, *of_pods, *of_radial, *others], prior, learnt is None
        )
        learnt = prior.classes
        theta = solved.theta
        seen = _waves_seen(parameters, solved)
        slips = [slips_of(block, cloud, solved) for block, cloud in zip(of_points, clouds, strict=True)]
        steps = [residuals_of(block, theta)[0] for block in of_lengths]
        turns = [residuals_of(block, theta)[0].reshape(-1, 6) for block in of_pods]
        still = all(np.abs(step[:3]).max() < STILL_MM for step in steps)
        still = still and all(np.abs(turn[:, :3]).max() < POD_STILL_MM for turn in turns)
        # before the stations stand still, a residual may be theirs
        pairs = zip(of_lengths if still else (), lengths, strict=False)
        slips_of_lengths = [slips_of(block, rays, solved) for block, rays in pairs]
        if seen == waves and not any(slips) and not any(slips_of_lengths) and still:
            break
        waves = seen
        outliers += [slip for some in (*slips, *slips_of_lengths) for slip in some]
        lengths = (
            [without(rays, some) for rays, some in zip(lengths, slips_of_lengths, strict=True)]
            if still
            else lengths
        )
        clouds = [without(cloud, some) for cloud, some in zip(clouds, slips, strict=True)]
        stations = [station.moved(step) for station, step in zip(stations, steps, strict=True)]
        poses = [
            [pose.moved(step) for pose, step in zip(own, turn, strict=True)]
            for own, turn in zip(poses, turns, strict=True)
        ]
    results = [
        LineResult(line, noise, *_left(block, theta))
        for line, noise, block in zip(lines, noises, of_lines, strict=True)
    ]
    points = [
        PointsResult(cloud, *_left(block, theta)) for cloud, block in zip(clouds, of_points, strict=True)
    ]
    rays_left = [
        LengthsResult(rays, station, *_left(block, theta))
        for rays, station, block in zip(lengths, stations, of_lengths, strict=True)
    ]
    pods_left = [
        PodsResult(pods, tuple(own), *_left(block, theta))
        for pods, own, block in zip(measurements.pods, poses, of_pods, strict=True)
    ]
    chi_square = sum(
        (
            _left(block, theta)[1]
            for block in (*of_lines, *of_points, *of_lengths, *of_pods, *of_radial, *others)
        ),
        0.0,
    )
    radial_left = [
        RadialResult(taken, noise, *_left(block, theta))
        for taken, noise, block in zip(radial, noises_of_radial, of_radial, strict=True)
    ]
    # readings less what the fit used up of their freedom
    freedom = max(normal.count - float(np.trace(solved.covariance @ normal.H)) - normal.free, 1.0)
    # readings that fit worse than their noise say that the model is not all there is
    covariance = solved.covariance * max(1.0, chi_square / freedom)
    return Fit(
        measurements, parameters, theta, covariance, prior, tuple(results), tuple(points),
        tuple(rays_left), tuple(pods_left), tuple(outliers), box, mean_slopes(parameters), chi_square,
        freedom, unseen, tuple(radial_left),
    )  # fmt: skip


def _adjusted(blocks: Iterable[Block], prior: Prior, learn: bool) -> tuple[Normal, Solved]:
    """The readings' normal equations and their solution, with what the prior is to learn from them."""
    normal = Normal.of(prior.parameters.size)
    for block in blocks:
        normal.add(block)
    prior.push(normal)
    if learn:
        prior.learn(normal)
    solved = solve(normal, *prior.precision())
    if learn and prior.size_from(solved.theta):
        solved = solve(normal, *prior.precision())
    return normal, solved


def _waves_seen(parameters: Parameters, solved: Solved) -> dict[str, tuple[Wave, ...]]:
    """Cyclic terms that stand out of their noise."""
    seen: dict[str, tuple[Wave, ...]] = {}
    for name, waves in parameters.waves.items():
        start = parameters.slices[f"wave {name}"].start
        for k, wave in enumerate(waves):
            at = slice(start + 2 * k, start + 2 * k + 2)
            sigma = float(np.sqrt(np.trace(solved.covariance[at, at]) / 2.0))
            if float(np.hypot(*solved.theta[at])) > CYCLIC_SEEN * sigma:
                seen[name] = (*seen.get(name, ()), wave)
    return seen


def _left(block: Block, theta: Array) -> tuple[Array, float]:
    """Residuals of a block and the sum of squares of the standardised ones."""
    _, residual, sigma = residuals_of(block, theta)
    return residual, float(np.sum((residual / sigma) ** 2))


def _ranges(
    lines: Sequence[Line],
    places: Sequence[Array],
    travel_mm: Sequence[tuple[float, float]] | None,
) -> tuple[list[tuple[float, float]], Array]:
    """What the readings of each axis reach together, and the box: what every component with lines covers, or
    the points where an axis has no lines."""
    ranges, box = [], np.zeros((3, 2))
    for axis in range(3):
        own = [line for line in lines if line.axis == axis]
        reached = [line.target_mm for line in own] + [place[:, axis] for place in places]
        if not reached:
            raise CannotCompute(
                f"no line along {AXES[axis]}; expected at least the positioning E{AXES[axis]}{AXES[axis]} of "
                "every axis, or points"
            )
        low = min(float(q.min()) for q in reached)
        high = max(float(q.max()) for q in reached)
        ranges.append((low, high))
        sides = [] if own else [(low, high)]
        for name in {line.component for line in own}:
            same = [line for line in own if line.component == name]
            side = (
                min(float(line.target_mm.min()) for line in same),
                max(float(line.target_mm.max()) for line in same),
            )
            if side[1] - side[0] > SWEEP * (high - low):
                sides.append(side)
        limits = travel_mm[axis] if travel_mm is not None else (-np.inf, np.inf)
        box[axis] = max(*(s[0] for s in sides), limits[0]), min(*(s[1] for s in sides), limits[1])
        if box[axis, 0] >= box[axis, 1]:
            raise CannotCompute(
                f"the readings along {AXES[axis]} have no length in common in the travel; expected them over "
                "the same length"
            )
    return ranges, box


def _spline(lines: Sequence[Line], axis: int, span: tuple[float, float], cells: int) -> Spline:
    own = [len(targets_of(line)) for line in lines if line.axis == axis]
    long = [
        len(targets_of(line))
        for line in lines
        if line.axis == axis and np.ptp(line.target_mm) > SWEEP * (span[1] - span[0])
    ]
    if not own:
        return Spline(*span, cells)
    return Spline(*span, int(np.clip(max(long or own) - 1, FEWEST, MOST)))


def _half(spline: Spline) -> Spline:
    return Spline(spline.low_mm, spline.high_mm, HALF_CELLS)


def _shapes(
    lines: Sequence[Line],
    noises: Sequence[Noise],
    splines: Sequence[Spline],
    waves: Mapping[str, tuple[Wave, ...]],
    tell: Progress,
) -> dict[str, Shape]:
    """The shape of every component with lines: each by itself, then again where others have their steps."""
    shapes: dict[str, Shape] = {}
    for again in (False, True):
        for k, name in enumerate(COMPONENTS):
            tell("shapes of curves", (k + again * len(COMPONENTS)) / (2 * len(COMPONENTS)))
            own = _own_lines(name, lines, noises)
            others = [s for other, s in shapes.items() if other[2] == name[2] and other != name]
            joints = sorted(
                {f for shape in others for f in shape.features if isinstance(f, Step)},
                key=lambda step: step.low_mm,
            )
            if own and (joints or not again):
                spline = splines[AXES.index(name[2])]
                shapes[name] = shape_of(
                    own, spline, _half(spline), waves.get(name, ()), joints if again else ()
                )
    return shapes


def _waves(
    measurements: Measurements, lines: Sequence[Line], scattered: Sequence[Points | Lengths | Pods]
) -> tuple[dict[str, tuple[Wave, ...]], dict[tuple[str, float], str]]:
    """Cyclic terms that the targets can see, and why others cannot be seen."""
    waves: dict[str, tuple[Wave, ...]] = {}
    unseen: dict[tuple[str, float], str] = {}
    for name in COMPONENTS:
        own = [targets_of(line) for line in lines if line.component == name]
        if name[1] == name[2]:
            own += [np.unique(part.axis_mm[:, AXES.index(name[2])]) for part in scattered]
        for period in measurements.periods_mm[AXES.index(name[2])] if own else ():
            reasons = [aliased(targets, period) for targets in own]
            if None in reasons:
                waves[name] = (*waves.get(name, ()), Wave(period))
            else:
                unseen[name, period] = str(reasons[0])
    return waves, unseen


def _own_lines(name: str, lines: Sequence[Line], noises: Sequence[Noise]) -> list[tuple[Line, Noise]]:
    """The lines of a component that were taken at its own place."""
    own = [(line, noise) for line, noise in zip(lines, noises, strict=True) if line.component == name]
    if not own:
        return []
    place = _place(own[0][0])
    return [(line, noise) for line, noise in own if name[1] in "ABC" or _place(line) == place]


def _place(line: Line) -> Place:
    at = list(line.line_mm)
    at[line.axis] = 0.0
    return Place((at[0], at[1], at[2]), line.tool_mm)


def _parameters(
    chain: str,
    datum: Vector,
    lines: Sequence[Line],
    splines: Sequence[Spline],
    shapes: Mapping[str, Shape],
    waves: Mapping[str, tuple[Wave, ...]],
    framed: bool,
) -> Parameters:
    spaces, halves, places = {}, {}, {}
    for name in COMPONENTS:
        axis = AXES.index(name[2])
        shape = shapes.get(name)
        kind = "straight" if name[1] in AXES and name[1] != name[2] else "zero"
        spaces[name] = CurveSpace.of(splines[axis], shape.features if shape else (), datum[axis], kind)
        if shape is not None and shape.half != "none":
            half = _half(splines[axis])
            gauge = np.eye(half.count) if shape.half == "curve" else np.ones((half.count, 1))
            halves[name] = CurveSpace(half, (), gauge)
        if name[1] in AXES:
            own = [line for line in lines if line.component == name]
            near = own or [line for line in lines if line.axis == axis and line.quantity != "angle"]
            place = _place(near[0]) if near else Place(datum, ZERO)
            at = list(place.line_mm)
            at[axis] = datum[axis]
            places[name] = Place((at[0], at[1], at[2]), place.tool_mm)
    shared = sorted({n for line in lines if line.square is not None for n in square_names(line)})
    return Parameters(chain, datum, spaces, places, halves, dict(waves), tuple(shared), framed)


def _squares(measurements: Measurements, parameters: Parameters) -> dict[str, tuple[float, float]]:
    known = {f"error of square {s.name}": (s.error_rad, max(s.sigma_rad, 1e-9)) for s in measurements.squares}
    return {name: known.get(name, (0.0, POSE)) for name in parameters.shared}


def mean_slopes(parameters: Parameters) -> dict[str, Array]:
    """Mean slopes of the straightness curves on lines through the datum with no tool."""
    slopes: dict[str, Array] = {}
    for name in COMPONENTS:
        if name[1] not in AXES or name[1] == name[2]:
            continue
        axis, row = AXES.index(name[2]), AXES.index(name[1])
        spline = parameters.spaces[name].spline
        position = np.tile(np.array(parameters.datum_mm), (len(slope_grid(spline)), 1))
        position[:, axis] = slope_grid(spline)
        out = np.zeros(parameters.size)
        for part, values in parameters.displacement(row, axis, position, np.zeros(3)):
            if part != parameters.slices.get(f"wave {name}"):
                out[part] += slope_weights(spline) @ values
        slopes[name] = out
    return slopes
