"""Simulated machines and the readings that instruments would take of them: written from the contract, without
the project's code.

Two families. Smooth: harmonics of some waves over the travel. Rough: the same at half the size, with kinks,
steps at rail joints that all six errors of an axis share, and the pitch of a screw. Curves hold on lines
through the datum with no tool, zero there, straightness without a mean slope. Lengths in mm, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

AXES = "XYZ"
BOX = ((0.0, 3000.0), (0.0, 2000.0), (-1000.0, 0.0))
NAMES = tuple(f"E{d}{a}" for a in AXES for d in "XYZABC")
Curve = Callable[[np.ndarray], np.ndarray]


@dataclass
class Machine:
    """A machine to first order. `half` is half of forward minus backward, by component."""

    chain: str
    box: np.ndarray
    datum: np.ndarray
    curves: dict[str, Curve]
    square: dict[str, float]
    half: dict[str, float] = field(default_factory=dict)

    def after(self, axis: int) -> list[int]:
        order = self.chain.replace("F", "")
        return [AXES.index(a) for a in order[order.index(AXES[axis]) + 1 :]]

    def angles(self, axis: int, q: np.ndarray) -> np.ndarray:
        return np.stack([self.curves[f"E{d}{AXES[axis]}"](q) for d in "ABC"], axis=-1)

    def error(self, axis_mm: np.ndarray, tool: np.ndarray, play: np.ndarray | None = None) -> np.ndarray:
        """(n, 3) at axis positions (n, 3) with tool vectors (3,) or (n, 3), directions `play` (n, 3)."""
        error = np.zeros(axis_mm.shape)
        for axis in range(3):
            q = axis_mm[:, axis]
            tool_vector = np.array(np.broadcast_to(np.asarray(tool, float), axis_mm.shape))
            for k in self.after(axis):
                tool_vector[:, k] += axis_mm[:, k] - self.datum[k]
            error += np.stack([self.curves[f"E{d}{AXES[axis]}"](q) for d in AXES], axis=-1)
            error += np.cross(self.angles(axis, q), tool_vector)
            if play is not None:
                for d, letter in enumerate(AXES):
                    error[:, d] += play[:, axis] * self.half.get(f"E{letter}{AXES[axis]}", 0.0)
        y, z = axis_mm[:, 1] - self.datum[1], axis_mm[:, 2] - self.datum[2]
        error[:, 0] += -self.square["C0Y"] * y + self.square["B0Z"] * z
        error[:, 1] += -self.square["A0Z"] * z
        return error


def _waves(rng: np.random.Generator, low: float, span: float, size: float, slope: bool) -> Curve:
    phase, weight = rng.uniform(0, 2 * np.pi, 4), rng.normal(size=4) / np.arange(1, 5) ** 1.2
    tilt = 0.7 * rng.normal() if slope else 0.0

    def curve(q: np.ndarray) -> np.ndarray:
        u = (np.asarray(q, float) - low) / span
        return size * (sum(weight[m] * np.sin(np.pi * (m + 1) * u + phase[m]) for m in range(4)) + tilt * u)

    return curve


def _normal(raw: Curve, low: float, high: float, datum: float, straight: bool) -> Curve:
    grid = np.linspace(low, high, 2001)
    slope = float(np.polyfit(grid - datum, raw(grid), 1)[0]) if straight else 0.0
    zero = float(raw(np.array([datum]))[0])
    return lambda q: raw(q) - zero - slope * (np.asarray(q, float) - datum)


def machine(
    seed: int,
    family: str = "smooth",
    chain: str = "FXYZ",
    box: Any = BOX,
    datum: tuple[float, float, float] = (0.0, 0.0, 0.0),
    size: float | None = None,
) -> Machine:
    """A random machine of a family, "smooth" or "rough"; off by about 100 um rms."""
    rng = np.random.default_rng([seed, len(family)])
    size = SIZE[family] if size is None else size
    sides = np.array(box, float)
    curves: dict[str, Curve] = {}
    for axis, letter in enumerate(AXES):
        low, high = sides[axis]
        span = high - low
        joints = np.sort(rng.uniform(low + 0.1 * span, high - 0.1 * span, rng.integers(1, 3)))
        for d in "XYZABC":
            angle, own = d in "ABC", d == letter
            scale = size * (40e-6 if angle else 0.060 if own else 0.025)
            if family == "smooth":
                raw = _waves(rng, low, span, scale, own)
            else:
                raw = _rough(rng, low, span, scale, own, joints)
            curves[f"E{d}{letter}"] = _normal(raw, low, high, datum[axis], not angle and not own)
    if family == "rough":
        for axis, letter in enumerate(AXES):
            name, phase = f"E{letter}{letter}", rng.uniform(0, 2 * np.pi)
            curves[name] = _with_pitch(curves[name], size * rng.uniform(1.5e-3, 4e-3), PITCH[axis], phase)
    square = dict(zip(("C0Y", "B0Z", "A0Z"), size * 50e-6 * rng.normal(size=3), strict=True))
    half = {f"E{a}{a}": -0.5 * rng.uniform(2e-3, 8e-3) for a in AXES}
    return Machine(chain, sides, np.array(datum), curves, square, half)


PITCH = (20.0, 10.0, 5.0)
#: what makes a machine of a family off by about 100 um rms
SIZE = {"smooth": 0.6, "rough": 0.7}


def _with_pitch(base: Curve, amplitude: float, period: float, phase: float) -> Curve:
    return lambda q: base(q) + amplitude * np.sin(2 * np.pi * np.asarray(q, float) / period + phase)


def _rough(
    rng: np.random.Generator, low: float, span: float, scale: float, own: bool, joints: np.ndarray
) -> Curve:
    smooth = _waves(rng, low, span, 0.5 * scale, own)
    knots = np.sort(rng.uniform(low, low + span, 3))
    bends = rng.normal(size=3) * 1.5 * scale / span
    jumps = rng.normal(size=len(joints)) * 0.25 * scale

    def curve(q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, float)
        value = smooth(q)
        for knot, bend in zip(knots, bends, strict=True):
            value = value + bend * np.maximum(q - knot, 0.0)
        for knot, jump in zip(joints, jumps, strict=True):
            value = value + jump * (q > knot)
        return value

    return curve


@dataclass(frozen=True)
class Taken:
    """A line as taken: columns in the order of time, and how it was taken."""

    component: str
    target: np.ndarray
    value: np.ndarray
    run: np.ndarray
    direction: np.ndarray
    line: tuple[float, float, float]
    tool: tuple[float, float, float]
    square: str | None = None
    reference: str = "functional-point"
    scale_sigma: float = 0.0


def drift_of(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    """How an instrument drifts over a line, `time` from 0 to 1, in units of its size."""
    return rng.normal() * time + 0.5 * rng.normal() * np.sin(2 * np.pi * time * rng.uniform(0.3, 1.0))


LINE = (1500.0, 700.0, -600.0)
TOOL = (0.0, 0.0, -120.0)
COUNT = (31, 21, 21)
SQUARE_SIGMA = 5e-6


def take(
    m: Machine, rng: np.random.Generator, component: str, *, targets: np.ndarray, line_mm: Any = LINE,
    tool: Any = TOOL, runs: int = 5, slope: float | None = None, square: str | None = None,
    reference: str = "functional-point", drift: float = 1.0,
) -> Taken:  # fmt: skip
    """Read a component in both directions along a line through `line_mm`.

    Laser 0.5 um + 0.5 um/m: noise that grows with the distance for straightness, a scale of the line for
    positioning. Angles 1 urad, drift over some um or urad.
    """
    d, axis = "XYZABC".index(component[1]), AXES.index(component[2])
    one = np.concatenate([targets, targets[::-1]])
    side = np.concatenate([np.ones(len(targets)), -np.ones(len(targets))])
    q, direction = np.tile(one, runs), np.tile(side, runs)
    run = np.repeat(np.arange(1, runs + 1), len(one))
    position = np.tile(np.array(line_mm, float), (len(q), 1))
    position[:, axis] = q
    far = np.abs(q - targets[0]) / 1000.0
    scale = 0.0
    if d >= 3:
        value = m.angles(axis, q)[:, d - 3]
        noise = np.full(len(q), 1e-6)
    else:
        play = np.zeros((len(q), 3))
        play[:, axis] = direction
        value = m.error(position, np.array(tool, float), play)[:, d]
        if reference == "table":
            own = np.zeros((len(q), 3))
            own[:, axis] = q - m.datum[axis]
            value = value - np.cross(m.angles(axis, q), own)[:, d]
        noise = np.full(len(q), 0.5e-3)
        if d == axis:
            scale = 0.5e-6
            value = value + rng.normal(0.0, scale) * (q - targets[0])
        else:
            noise = noise + 0.5e-3 * far
            value = value + (rng.normal(0.0, 1e-4) if slope is None else slope) * q
    unit = 1e-6 if d >= 3 else 1e-3
    time = np.linspace(0.0, 1.0, len(q))
    level = drift_of(rng, time)
    value = value + drift * 2.0 * unit * level + rng.normal(0.0, 30.0) * unit + rng.normal(0.0, noise)
    return Taken(
        component, q, value, run, direction, tuple(map(float, line_mm)), tuple(map(float, tool)), square,
        reference, scale,
    )  # fmt: skip


def all_lines(
    m: Machine, seed: int, *, line_mm: Any = LINE, tool: Any = TOOL, tables: str = "", jitter: float = 5.0,
    runs: int = 5, drift: float = 1.0, count: Any = COUNT,
) -> list[Taken]:  # fmt: skip
    """The lines of a full set: positioning, eight angles (not roll of the vertical axis), straightness pairs
    that share a square, and straightness of Z with the reflector at two offsets; `count` targets an axis."""
    rng = np.random.default_rng([seed, 77])
    targets = []
    for axis in range(3):
        q = np.linspace(*m.box[axis], count[axis])
        q[1:-1] += rng.uniform(-jitter, jitter, len(q) - 2)
        targets.append(np.round(q, 3))
    lines: list[Taken] = []

    def add(name: str, **more: Any) -> None:
        axis = AXES.index(name[2])
        reference = "table" if name[2] in tables else "functional-point"
        more.setdefault("tool", tool)
        same: dict[str, Any] = {"line_mm": line_mm, "runs": runs, "drift": drift, "reference": reference}
        lines.append(take(m, rng, name, targets=targets[axis], **same, **more))

    for a in AXES:
        add(f"E{a}{a}")
        for d in "ABC":
            if (d, a) != ("C", "Z"):
                add(f"E{d}{a}")
    for a, b in ("XY", "XZ", "YZ"):
        first = rng.normal(0.0, 1e-4)
        second = -first + rng.normal(0.0, SQUARE_SIGMA)
        add(f"E{b}{a}", slope=first, square=f"S{a}{b}")
        add(f"E{a}{b}", slope=second, square=f"S{a}{b}")
    for side in (150.0, -150.0):
        # the square is not moved, only the reflector
        add("EYZ", tool=np.array(tool) + np.array([side, 0.0, 0.0]), slope=second, square="SYZ")
    return lines


def off_frame(position: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Errors (n, 3) less the rigid motion of `position` that fits them best."""
    n = len(position)
    centred = (position - position.mean(axis=0)) / 1000.0
    table = np.zeros((n, 3, 6))
    for k in range(3):
        table[:, k, k] = 1.0
        axis = np.zeros(3)
        axis[k] = 1.0
        table[:, :, 3 + k] = np.cross(axis, centred)
    flat = table.reshape(-1, 6)
    motion = np.linalg.lstsq(flat, error.ravel(), rcond=None)[0]
    return error - (flat @ motion).reshape(-1, 3)


def rms_um(error: np.ndarray) -> float:
    """Root mean square length of errors (n, 3) in mm, in um."""
    return float(np.sqrt((error**2).sum(axis=1).mean()) * 1e3)


#: tools of a planned set of points: not on one line, so that every angle acts
OFFSETS = ((0.0, 0.0, -120.0), (150.0, 0.0, -120.0), (-60.0, 130.0, -260.0))


def points(
    m: Machine, seed: int, n: int, sigma: float, tools: Any = OFFSETS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Axis positions, tool vectors and places (n, 3) in a tracker's frame: a Latin hypercube, with noise."""
    rng = np.random.default_rng([seed, n, 11])
    share = np.stack([(rng.permutation(n) + rng.uniform(0, 1, n)) / n for _ in range(3)], axis=1)
    axis_mm = m.box[:, 0] + share * np.ptp(m.box, axis=1)
    tool = np.array(tools)[np.arange(n) % len(tools)]
    return axis_mm, tool, tracked(m, rng, axis_mm, tool, sigma)


def tracked(
    m: Machine, rng: np.random.Generator, axis_mm: np.ndarray, tool: np.ndarray, sigma: float
) -> np.ndarray:
    """Places (n, 3) of the reflector at axis positions with tool vectors (n, 3), in a tracker's frame."""
    place = axis_mm + tool + rng.normal(0.0, sigma, axis_mm.shape)
    for vector in np.unique(tool, axis=0):
        own = (tool == vector).all(axis=1)
        place[own] += m.error(axis_mm[own], vector)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    return np.asarray(place @ turn.T + rng.uniform(-5000.0, 5000.0, 3))


def polar(
    m: Machine, seed: int, n: int, station: Any, tools: Any = OFFSETS
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Axis positions, tool vectors, distances, azimuths and elevations without noise, as a station at a place
    sees the tips; it stands upright and looks along +Y where its azimuth is 25 degrees."""
    rng = np.random.default_rng([seed, n, 19])
    share = np.stack([(rng.permutation(n) + rng.uniform(0, 1, n)) / n for _ in range(3)], axis=1)
    axis_mm = m.box[:, 0] + share * np.ptp(m.box, axis=1)
    tool = np.array(tools)[np.arange(n) % len(tools)]
    x, y, z = (axis_mm + tool + m.error(axis_mm, tool) - np.array(station, float)).T
    azimuth = np.arctan2(-x, y) + np.radians(25.0)
    return axis_mm, tool, np.sqrt(x * x + y * y + z * z), azimuth, np.arctan2(z, np.hypot(x, y))


def stations(m: Machine, seed: int, count: int) -> np.ndarray:
    """(count, 3) places of a tracking interferometer about the machine."""
    rng = np.random.default_rng([seed, count, 5])
    low, span = m.box[:, 0], np.ptp(m.box, axis=1)
    corners = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1), (0.5, 0, 0.2), (0.5, 1, 1)])
    outward = (corners[:count] - 0.5) * np.array([600.0, 600.0, 300.0])
    return low + corners[:count] * span + outward + rng.uniform(-100, 100, (count, 3))


def lengths(
    m: Machine, seed: int, station: np.ndarray, number: int, n: int, tools: Any = OFFSETS,
    sigma: tuple[float, float] = (0.2e-3, 0.3e-6),
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Axis positions, tool vectors, lengths less a dead length, and their uncertainty (mm + mm/mm) from a
    station."""
    rng = np.random.default_rng([seed, number, n, 13])
    share = np.stack([(rng.permutation(n) + rng.uniform(0, 1, n)) / n for _ in range(3)], axis=1)
    axis_mm = m.box[:, 0] + share * np.ptp(m.box, axis=1)
    tool = np.array(tools)[np.arange(n) % len(tools)]
    place = axis_mm + tool
    for vector in np.array(tools):
        own = (tool == vector).all(axis=1)
        place[own] += m.error(axis_mm[own], vector)
    true = np.linalg.norm(place - station, axis=1)
    noise = sigma[0] + sigma[1] * true
    return axis_mm, tool, true - 321.0 - 40.0 * number + rng.normal(0.0, noise), noise


def directions(
    m: Machine, seed: int, n: int, places: np.ndarray, sigma: float, tools: Any = OFFSETS
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Axis positions, tool vectors, azimuths and elevations (n, k) of pods at places (k, 3), each turned
    differently."""
    rng = np.random.default_rng([seed, n, 17])
    share = np.stack([(rng.permutation(n) + rng.uniform(0, 1, n)) / n for _ in range(3)], axis=1)
    axis_mm = m.box[:, 0] + share * np.ptp(m.box, axis=1)
    tool = np.array(tools)[np.arange(n) % len(tools)]
    place = axis_mm + tool
    for vector in np.array(tools):
        own = (tool == vector).all(axis=1)
        place[own] += m.error(axis_mm[own], vector)
    angles = []
    for pod in places:
        # upright, turned about the vertical, a little out of level
        heading, tilt = rng.uniform(-np.pi, np.pi), rng.normal(0.0, 0.01, 2)
        c, s = np.cos(heading), np.sin(heading)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        lean = np.array([[1.0, 0.0, tilt[0]], [0.0, 1.0, tilt[1]], [-tilt[0], -tilt[1], 1.0]])
        u, _, v = np.linalg.svd(lean @ turn)
        x, y, z = ((place - pod) @ (u @ v).T).T
        angles.append((np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))))
    azimuth, elevation = (np.stack([a[k] for a in angles], axis=1) for k in range(2))
    return (
        axis_mm,
        tool,
        azimuth + rng.normal(0.0, sigma, azimuth.shape),
        elevation + rng.normal(0.0, sigma, elevation.shape),
    )


#: two pods in front of the machine, 4 m apart
PODS = ((-500.0, -1500.0, -300.0), (3500.0, -1500.0, -100.0))


def bent(m: Machine, sag_mm: float = 0.030, twist_mm: float = 0.015) -> Machine:
    """The same machine, and what no rigid bodies make: a sag of Z in the middle of X and Y that depends on
    the ram, and X that twists with all three axes."""

    @dataclass
    class Bent(Machine):
        def error(self, axis_mm: np.ndarray, tool: np.ndarray, play: np.ndarray | None = None) -> np.ndarray:
            error = Machine.error(self, axis_mm, tool, play)
            u = (axis_mm - self.box[:, 0]) / np.ptp(self.box, axis=1)
            error[:, 2] -= sag_mm * np.sin(np.pi * u[:, 0]) * np.sin(np.pi * u[:, 1]) * (0.5 + u[:, 2])
            error[:, 0] += twist_mm * np.prod(2.0 * u - 1.0, axis=1)
            return error

    return Bent(m.chain, m.box, m.datum, m.curves, m.square, m.half)


def diagonal(
    m: Machine, seed: int, start: Any, end: Any, tool: Any, *, count: int = 21, runs: int = 3
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Distances from the start, deviations along the diagonal, runs and both directions: 0.5 um, an
    unknown zero, 8 um of backlash as a whole."""
    rng = np.random.default_rng([seed, 23, *np.abs(np.array(end, int))])
    a, b = np.array(start, float), np.array(end, float)
    length = float(np.linalg.norm(b - a))
    one = np.linspace(0.0, length, count)
    distance = np.tile(np.concatenate([one, one[::-1]]), runs)
    direction = np.tile(np.repeat([1, -1], count), runs)
    unit = (b - a) / length
    value = m.error(a + distance[:, None] * unit, np.array(tool, float)) @ unit
    value = value - 4e-3 * direction + rng.normal(0.0, 0.5e-3, len(value)) + rng.normal(0.0, 0.05)
    return distance, value, np.repeat(np.arange(1, runs + 1), 2 * count), direction


def circles(
    m: Machine, seed: int, plane: str, centre: Any, radius: float, tool: Any, *, both: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Angles, radius deviations, runs and directions of circles: 0.2 um, a bar and a centre that are off, a
    servo mismatch of 9 um and backlash of 6 and 3 um."""
    rng = np.random.default_rng([seed, 29, AXES.index(plane[0])])
    one = np.linspace(0.0, 2 * np.pi, 180, endpoint=False) + 0.01
    angle = np.concatenate([one, one[::-1]]) if both else one
    direction = np.repeat([1, -1], 180)[: len(angle)]
    i, j = AXES.index(plane[0]), AXES.index(plane[1])
    radial = np.zeros((len(angle), 3))
    radial[:, i], radial[:, j] = np.cos(angle), np.sin(angle)
    error = m.error(np.array(centre, float) + radius * radial, np.array(tool, float))
    # an axis that moves toward + lags behind by half its backlash
    for axis, lost, speed in ((i, 6e-3, -np.sin(angle)), (j, 3e-3, np.cos(angle))):
        error[:, axis] -= 0.5 * lost * direction * np.sign(speed)
    value = (error * radial).sum(axis=1) + 9e-3 * direction * np.sin(2 * angle)
    value = value + 0.03 + 0.02 * np.cos(angle) - 0.01 * np.sin(angle) + rng.normal(0.0, 0.2e-3, len(angle))
    return angle, value, np.repeat([1, 2], 180)[: len(angle)], direction
