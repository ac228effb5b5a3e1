"""The pictures of a review as plain arrays: what is drawn of each, how much enlarged, in which colours."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.toolpath import Kind
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.review import judged, palette
from olp.review.judged import measured_names
from olp.review.scene import Scene

#: Most samples of a layer, as it is one message to the browser; of longer paths every k-th is drawn.
MOST = 200_000
#: Size of the largest deviation, enlarged, as a share of the size of the job.
_SHARE = 0.03
#: Largest factor that is chosen.
_LARGEST_FACTOR = 1e5
#: Distance between whiskers, as a share of the size of the job.
_WHISKER_STEP = 0.01
#: Most whiskers of a picture, besides those where paths begin.
_MOST_WHISKERS = 20_000
#: Distance between the dots of a wide line, as a share of the size of the job: about a pixel.
_DOT_STEP = 0.0015
#: The theme of colours: the ground of the scene is light.
_THEME: palette.Theme = "light"
#: Titles of the pictures of the model.
_TITLES = {"uncorrected": "Uncorrected (predicted)", "corrected": "Corrected (predicted)"}


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One path with its deviations. (n, 3) `base_mm` on the nominal path and `delta_mm` from there. (n,)
    `drawn`: the path leads here from the sample before, in a move that counts. (n,) `shown`: samples that
    count. (n,) `arc_mm` along the path. `tolerance_um` judges it under the name `judge`; it is None where
    nothing does. `worst` is the sample that is flagged with the text `flag`, None where the table of
    judgements has none."""

    name: str
    title: str
    base_mm: Array
    delta_mm: npt.NDArray[np.floating[Any]]
    drawn: Mask
    shown: Mask
    arc_mm: Array
    judge: str
    tolerance_um: float | None
    exaggeration: float
    worst: int | None = None
    flag: str = ""

    @property
    def size_um(self) -> Array:
        """(n,) how far each sample is off."""
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", self.delta_mm, self.delta_mm)) * UM_PER_MM)

    @property
    def enlarged_mm(self) -> Array:
        """(n, 3) the samples with their deviations enlarged."""
        return np.asarray(self.base_mm + self.exaggeration * self.delta_mm)

    @property
    def edges_um(self) -> list[float]:
        """Edges of the bands of colour, from 0 to beyond the largest deviation that is drawn."""
        largest = float(self.size_um[self.shown].max(initial=0.0))
        return palette.bands(largest, self.tolerance_um)

    @property
    def colours(self) -> list[str]:
        """The colour of each band."""
        return palette.colours(self.edges_um, self.tolerance_um, _THEME)

    def bands(self, size_um: Array) -> Index:
        """(m,) the band of each deviation (m,) in um; an edge belongs to the band below it."""
        edges: Array = np.array(self.edges_um[1:])
        band: Index = np.searchsorted(edges, size_um)
        return np.minimum(band, len(edges) - 1)

    def path(self, most: int) -> tuple[Index, Index]:
        """(m, 2) the samples at both ends of each segment of the enlarged path, and (m,) its band: that of
        the largest deviation from one end to the other."""
        ends = segments(self.drawn, most)
        if not len(ends):
            return ends, np.zeros(0, np.int64)
        size = self.size_um
        between = np.maximum.reduceat(size, ends.ravel())[::2]
        return ends, self.bands(np.maximum(between, size[ends[:, 1]]))

    def dots(self, job_mm: float, most: int) -> tuple[Array, Index]:
        """(d, 3) points in mm, close enough along the enlarged path to look like a wide line, at most about
        `most`; (d,) the band of each. Samples that no segment leads to, such as probed points, are there,
        too. `job_mm` is the size of the job."""
        ends, band = self.path(most)
        begin, end = self.enlarged_mm[ends[:, 0]], self.enlarged_mm[ends[:, 1]]
        length = np.linalg.norm(end - begin, axis=1)
        step = max(_DOT_STEP * job_mm, float(length.sum()) / most)
        # dots are at multiples of the step along the whole path, as segments may be shorter than it
        before = np.concatenate(([0.0], np.cumsum(length)))
        along = np.arange(0.0, before[-1], step)
        which = np.minimum(np.searchsorted(before, along, side="right") - 1, len(length) - 1)
        share = (along - before[which]) / np.maximum(length[which], 1e-12)
        points = begin[which] + share[:, None] * (end - begin)[which]
        alone = self.shown & ~touched(self.drawn)
        own = self.bands(self.size_um[alone])
        return np.concatenate((points, self.enlarged_mm[alone])), np.concatenate((band[which], own))

    def whiskers(self, job_mm: float, most: int) -> Index:
        """(w,) the samples with a whisker from the nominal to the enlarged path: where a path begins, and
        then at equal distances along it; at most `most`. `job_mm` is the size of the job."""
        length = float(np.ptp(self.arc_mm)) if len(self.arc_mm) else 0.0
        cell = np.floor(self.arc_mm / max(_WHISKER_STEP * job_mm, length / _MOST_WHISKERS))
        which = np.flatnonzero(self.shown)
        which = which[(np.diff(cell[which], prepend=-1.0) > 0.0) | ~self.drawn[which]]
        return which[:: max(-(-len(which) // most), 1)]


def names_of(scene: Scene) -> list[str]:
    """Names of the pictures of a scene."""
    return [*_TITLES, *measured_names(scene)]


def pictures_of(scene: Scene, job_mm: float, exaggeration: float | None) -> Iterator[Picture]:
    """The pictures of a scene; without `exaggeration` each has a factor of its own."""
    samples, stated = scene.samples, list(judged.pictures(scene))
    of_layer = {name: picture for picture in stated for name in picture["layers"]}
    flags = {item["flag"]["layer"]: item for item in stated if item["flag"] is not None}
    feed = samples.joined & ~rapids(scene)

    def factor(name: str, delta_mm: npt.NDArray[np.floating[Any]], shown: Mask) -> float:
        largest = np.linalg.norm(delta_mm[shown], axis=1).max(initial=0.0)
        largest = max(largest, (of_layer[name]["largest_um"] or 0.0) / UM_PER_MM)
        return factor_of(float(largest), job_mm) if exaggeration is None else exaggeration

    shown, allowed_um = touched(feed), scene.table.allowed_mm * UM_PER_MM
    for name, delta in (("uncorrected", samples.uncorrected), ("corrected", samples.corrected)):
        worst, flag = (flags[name]["flag"]["sample"], _words(flags[name])) if name in flags else (None, "")
        yield Picture(
            name, _TITLES[name], scene.position_mm, delta, feed, shown, samples.arc_mm, "allowed",
            allowed_um, factor(name, delta, shown), worst, flag,
        )  # fmt: skip
    runs, breaks = scene.table.measured, np.cumsum(~feed)
    for name, run in zip(measured_names(scene), scene.measured, strict=True):
        size = np.where(run.counted, np.linalg.norm(run.delta_mm, axis=1), -1.0)
        # between two points there may be a rapid that was not measured
        drawn = run.counted & (np.diff(breaks[run.index], prepend=-1) == 0)
        shown = run.counted | touched(drawn)
        worst, flag = (int(size.argmax()), _words(flags[name])) if name in flags else (None, "")
        yield Picture(
            name, f"Measured: {run.label}", run.base_mm, run.delta_mm, drawn, shown,
            samples.arc_mm[run.index], "part tolerance", None if runs is None else runs.tolerance_um,
            factor(name, run.delta_mm, shown), worst, flag,
        )  # fmt: skip


def _words(picture: dict[str, Any]) -> str:
    """The flag of a picture in words."""
    flag = picture["flag"]
    return f"largest, {picture['label']}: {flag['um']:.2f} µm, line {flag['line']}"


def rapids(scene: Scene) -> Mask:
    """(n,) samples of rapids: they are shown, and count in no picture."""
    return np.asarray(scene.nominal.toolpath.kind[scene.samples.move] == Kind.RAPID)


def touched(drawn: Mask) -> Mask:
    """(n,) samples at an end of a drawn segment; `drawn` (n,) as in Picture."""
    return np.asarray(drawn | np.append(drawn[1:], False))


def factor_of(largest_mm: float, job_mm: float) -> float:
    """A round factor that enlarges a deviation to at most a small share of the size of the job; 1 to 1e5."""
    if not largest_mm > 0.0:
        return 1.0
    wanted = min(_SHARE * job_mm / largest_mm, _LARGEST_FACTOR)
    unit = 10.0 ** math.floor(math.log10(wanted))
    return max(1.0, next(m * unit for m in (5.0, 2.0, 1.0) if m * unit <= wanted * (1.0 + 1e-12)))


def segments(drawn: Mask, most: int) -> Index:
    """(m, 2) the samples at both ends of segments along a path; gaps are not bridged. Of more than `most`
    samples every k-th is used."""
    every = max(-(-len(drawn) // most), 1)
    begins = ~drawn
    keep = (np.arange(len(drawn)) % every == 0) | begins | np.append(begins[1:], True)
    kept, run = np.flatnonzero(keep), np.cumsum(begins)[keep]
    end = np.flatnonzero(np.diff(run, prepend=-1) == 0)
    return np.stack((kept[end - 1], kept[end]), axis=1)


def rgb(colours: list[str]) -> npt.NDArray[np.float32]:
    """(k, 3) parts of colours written as "#rrggbb"."""
    parts = [[int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)] for colour in colours]
    return np.array(parts, np.float32)
