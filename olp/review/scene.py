"""A job as plain data: all that its page shows, not packed yet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Mask
from olp.core.machine import Vector
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass
from olp.program.program import Program
from olp.proof.judgement import Judgements
from olp.review.knots import Curve
from olp.review.listing import Listing
from olp.review.measured import Matched
from olp.review.meshes import Body, Node
from olp.review.motion import MotionTable
from olp.review.samples import Samples, away_mm

Single = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Frame:
    """The frame of shown positions: `label` for people, `offset` the work offset or "machine", `origin_mm`
    its zero on the machine, without tool length."""

    label: str
    offset: str
    origin_mm: tuple[float, float, float]

    @staticmethod
    def of(path: Toolpath) -> Frame:
        """The work offset of a program with only one, unrotated, else the machine."""
        used = [path.frames[k] for k in np.unique(path.frame).tolist()]
        origins = {(f.work_offset, *np.round(f.origin_mm(), 9).tolist()) for f in used}
        if len(origins) == 1 and all(f.turn is None for f in used):
            name, x, y, z = origins.pop()
            return Frame(f"{name}, as programmed", str(name), (x, y, z))
        return Frame("machine, without tool lengths", "machine", (0.0, 0.0, 0.0))

    def positions(self, path: Toolpath, move: npt.NDArray[np.int64], axis_mm: Array) -> Array:
        """(n, 3) the tip at axis positions (n, 3), reached in moves (n,)."""
        length = path.per_frame([f.length_mm for f in path.frames])
        tip = np.asarray(axis_mm - (length if length.ndim == 1 else length[move]), float)
        tip -= self.origin_mm
        return tip


@dataclass(frozen=True, slots=True, eq=False)
class TipUncertainty:
    """Uncertainty of samples: (n,) `band_mm`, expanded uncertainty (k = 2) in the worst direction. Where a
    part tolerance `within_mm` is stated also, by layer, the probability (n,) that the tip is farther than
    that from its nominal point."""

    within_mm: float | None
    band_mm: Single
    beyond: Mapping[str, Single]


@dataclass(frozen=True, slots=True)
class Figures:
    """What the report says of a layer, None where nothing counts: rms deviation, and the largest one at
    waypoints, in um. `turn_urad` is the largest angle of the tool, None where nothing turns it."""

    rms_um: float | None
    waypoints_um: float | None
    turn_urad: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """`position_mm` (n, 3) are the samples in `frame`; `waypoint` (n,) are those which count by their
    distance from the nominal point. `axes` (n, k) are axis values, less which bodies are drawn `drawn_at`
    (k,), `limits` the limits of motion by axis, whose `units` are mm where none are given. `time_s` (n,) are
    times on the motion, where it is `planned`, else at the feed. `sources` are (name, (n,) um) by size;
    `report` is that of the correction or verification, `figures` what it says by layer, `table` judgements
    with lines of the nominal text as shown. `turn_urad` are (n,) angles of the tool by layer, where they are
    corrected. Where moves are `straight` in the frame, features are found in them. `digit_mm` is the last
    digit of coordinates. `tool_radii_mm` has the tools of the program that have a radius; `uncertainty` is
    None where the calibration states none."""

    name: str
    corrected_name: str
    digest: str
    machine: str
    nominal: Program
    frame: Frame
    samples: Samples
    position_mm: Array
    waypoint: Mask
    axes: Array
    drawn_at: Array
    nodes: tuple[Node, ...]
    limits: Mapping[str, Vector]
    time_s: Array
    motion: MotionTable | None
    duration_s: float
    sources: tuple[tuple[str, Curve], ...]
    listing: Listing
    bodies: tuple[Body, ...]
    measured: tuple[Matched, ...]
    report: Mapping[str, Any]
    figures: Mapping[str, Figures]
    table: Judgements
    tolerance_um: float
    tool_radius_mm: float
    tool_radii_mm: Mapping[int, float]
    digit_mm: float
    uncertainty: TipUncertainty | None = None
    turn_urad: Mapping[str, Array] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    straight: bool = True
    planned: bool = False

    def worst_sample(self, layer: str, move: int) -> int | None:
        """The sample of a move where a layer ("uncorrected" or "corrected") is off by what the table states
        of the move, as nearly as it is sampled; None where the move has no sample."""
        samples = self.samples
        a, b = np.searchsorted(samples.move, [move, move + 1]).tolist()
        if a == b:
            return None
        rows = slice(max(a - 1, 0), b + 1)
        ends = self.waypoint[rows]
        size = away_mm(self.position_mm[rows], samples.share[rows], ends, getattr(samples, layer)[rows])
        size = size[a - rows.start :][: b - a]
        stated = float(getattr(self.table, layer)[move])
        return int(a) + int(np.abs(size - stated).argmin())

    def place(self, line: int) -> str:
        """A line of the nominal text in words: the line that it was unrolled from, where it was."""
        origin = self.nominal.origin
        return str(line) if origin is None else origin.place(origin.line_of(line))

    def places(self, lines: npt.NDArray[Any]) -> str:
        """Lines (k,) of the nominal text in words, from the first to the last of those that they were
        unrolled from: "4", "4 to 9", or "4 to 9 of FILE"."""
        origin = self.nominal.origin
        if origin is None:
            first, last = str(lines.min()), str(lines.max())
            return first if first == last else f"{first} to {last}"
        written = origin.lines_of(lines)
        (file, first_line), (other, last_line) = (
            origin.file_of(int(line)) for line in (written.min(), written.max())
        )
        last = origin.place(int(written.max()))
        if (file, first_line) == (other, last_line):
            return last
        return f"{first_line if file == other else origin.place(int(written.min()))} to {last}"
