"""The legend of a picture: as data, as HTML for notebooks, and as an image, as meshcat has no text."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from olp.core.optional import require_matplotlib
from olp.core.values import dataclass
from olp.review.notebook.pictures import Picture
from olp.review.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Inches of an image for a window's height.
INCHES = 10.0
#: Points of an image for a window's height: sharp in windows up to there.
_DPI = 110
#: Points of type in an inch.
_POINTS = 72.0
#: Size of letters in points, at INCHES.
_LETTERS = 14.5
#: Height of a line of text, in window heights.
_LINE = 0.0295
#: Room round the text, in window heights.
_PAD = 0.014
#: Room below the bands, in window heights.
_GAP = 0.012
#: Width of a band's colour, in window heights.
_SWATCH = 0.045
#: Widest text beside a mark, in window heights.
_WIDEST = 0.42
#: Highest legend, in window heights.
_HIGHEST = 0.96
#: Columns of a band's texts, from the left edge, in window heights.
_COLUMNS = (0.078, 0.272)
#: Comes with matplotlib.
_FONT = "DejaVu Sans"
_INK = "#17202b"
_SOFT = "#56616f"
_RULE = "#d8dee6"
#: No colour, in matplotlib and in HTML.
_NONE = "none"
#: Colour of a verdict that is not good.
_FAIL = "#b03a0a"


@dataclass(frozen=True, slots=True)
class Band:
    """The deviations of one colour: from `low_um` to `high_um`, in um; `low` and `high` in units of the
    tolerance, None where nothing judges the picture."""

    colour: str
    low_um: float
    high_um: float
    low: float | None
    high: float | None

    @property
    def text(self) -> str:
        """The band in um."""
        return f"{self.low_um:.4g} – {self.high_um:.4g} µm"

    @property
    def share(self) -> str:
        """The band in units of the tolerance; empty where nothing judges the picture."""
        return "" if self.low is None or self.high is None else f"{self.low:.3g} – {self.high:.3g}"


@dataclass(frozen=True, slots=True)
class Legend:
    """What a picture shows. `bands` are from small to large. `tolerance_um` judges the picture under the name
    `judge`, and is None where nothing does. `worst` is the largest deviation and its line in words, empty
    where none is known. `verdict` is that of the report, with `ok` as there."""

    picture: str
    title: str
    exaggeration: float
    judge: str
    tolerance_um: float | None
    bands: tuple[Band, ...]
    worst: str
    verdict: str
    ok: bool | None

    @staticmethod
    def of(picture: Picture, scene: Scene) -> Legend:
        edges, unit = picture.edges_um, picture.tolerance_um
        bands = [
            Band(colour, low, high, *((None, None) if unit is None else (low / unit, high / unit)))
            for colour, low, high in zip(picture.colours, edges[:-1], edges[1:], strict=True)
        ]
        verdict = scene.report["verdict"]
        # the report is in ASCII
        sentences = re.sub(r"\bum\b", "µm", " ".join(verdict["sentences"]))
        return Legend(
            picture.name, picture.title, picture.exaggeration, picture.judge, unit, tuple(bands),
            picture.flag, sentences, verdict["ok"],
        )  # fmt: skip

    @property
    def enlarged(self) -> str:
        """The enlargement in words."""
        whole = self.exaggeration >= 1.0 and self.exaggeration == round(self.exaggeration)
        return f"deviations × {self.exaggeration:{',.0f' if whole else 'g'}}"

    @property
    def judged(self) -> str:
        """What judges the picture, in words."""
        if self.tolerance_um is None:
            return "no tolerance is stated"
        return f"{self.judge} {self.tolerance_um:.4g} µm"

    @property
    def rows(self) -> list[tuple[str, str, str]]:
        """Rows of the table of bands: colour, deviation, and the same in tolerances. The first is the head;
        then the largest deviations come first."""
        share = "" if self.tolerance_um is None else "tolerances"
        return [(_NONE, "deviation", share), *((b.colour, b.text, b.share) for b in reversed(self.bands))]

    def _repr_html_(self) -> str:
        """The legend for a notebook."""
        said, cell = html.escape, '<td style="text-align:left">'
        band = '<td style="background:{};width:3em"></td>'
        rows = "".join(
            f"<tr>{band.format(colour)}{cell}{said(text)}</td>{cell}{said(share)}</td></tr>"
            for colour, text, share in self.rows
        )
        return (
            f"<div><b>{said(self.title)}</b>, {said(self.enlarged)}; {said(self.judged)}"
            f"<table>{rows}</table>{said(self.worst)}<br>{said(self.verdict)}</div>"
        )


@dataclass(frozen=True, slots=True)
class Image:
    """A PNG and its `width` and `height` in window heights. What it is about is in its middle."""

    png: bytes
    width: float
    height: float


def board(legend: Legend, left: float, right: float) -> Image:
    """The legend as an image, from `left` to `right` of the image's middle, in window heights; the rest of it
    is clear. So it keeps its place beside the middle, from wherever the scene is seen."""
    lines = _lines(legend, right - left - 2.0 * _PAD)
    height = _LINE * (len(lines) - 1 + len(legend.rows)) + _GAP + 2.0 * _PAD
    shrink = min(1.0, _HIGHEST / height)
    size = (2.0 * max(abs(left), abs(right)), shrink * height)

    def draw(figure: Figure) -> None:
        from matplotlib.patches import Rectangle

        def at(x: float, y: float) -> tuple[float, float]:
            return (x + size[0] / 2.0) / size[0], 1.0 - shrink * y / size[1]

        def box(x: float, y: float, wide: float, high: float, **style: Any) -> None:
            corner, end = at(x, y + high), at(x + wide, y)
            figure.add_artist(Rectangle(corner, end[0] - corner[0], end[1] - corner[1], **style))

        def write(x: float, y: float, text: str, **style: Any) -> None:
            figure.text(*at(x, y + _LINE / 2.0), text, va="center", **style)

        box(left, 0.0, right - left, height, facecolor="white", edgecolor=_RULE, alpha=0.95)
        y = _PAD
        for text, style in lines:
            if text is None:
                for colour, *words in legend.rows:
                    box(left + _PAD, y, _SWATCH, _LINE, facecolor=colour)
                    for x, word in zip(_COLUMNS, words, strict=True):
                        write(left + x, y, word, color=_SOFT if colour == _NONE else _INK)
                    y += _LINE
                y += _GAP
            else:
                write(left + _PAD, y, text, **style)
                y += _LINE

    return Image(_png(size, shrink, draw), *size)


def _lines(legend: Legend, width: float) -> list[tuple[str | None, dict[str, Any]]]:
    """Lines of text with their style; None stands for the bands."""
    soft, ink = {"color": _SOFT}, {"color": _INK}
    verdict = ink if legend.ok else {"color": _FAIL}
    bold = ink | {"weight": "bold"}
    before = (legend.title, bold), (legend.enlarged, soft), (legend.judged, soft)
    after = (legend.worst, ink), (legend.verdict, verdict)
    above, below = (
        [(part, style) for text, style in texts for part in _wrapped(text, width, "weight" in style)]
        for texts in (before, after)
    )
    return [*above, (None, {}), *below]


def callout(text: str, *, to_right: bool) -> Image:
    """A mark in the image's middle with a text above it, at its right or left."""
    parts = _wrapped(text, _WIDEST)
    wide = max(map(_width, parts)) + 0.06
    size = (2.0 * wide, 2.0 * (0.05 + _LINE * (len(parts) + 1)))

    def draw(figure: Figure) -> None:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(-wide, wide), ylim=(-size[1] / 2.0, size[1] / 2.0))
        axes.axis("off")
        side = 1.0 if to_right else -1.0
        axes.annotate(
            "\n".join(parts), (0.0, 0.0), (side * 0.035, 0.05), va="bottom", color=_INK,
            ha="left" if to_right else "right",
            bbox={"boxstyle": "round,pad=0.3", "facecolor": "white", "edgecolor": _INK, "alpha": 0.95},
            arrowprops={"arrowstyle": "-", "color": _INK, "linewidth": 1.5},
        )  # fmt: skip
        axes.plot([0.0], [0.0], marker="o", markersize=11.0, markerfacecolor="none", color=_INK, mew=2.0)

    return Image(_png(size, 1.0, draw), *size)


def _wrapped(text: str, width: float, bold: bool = False) -> list[str]:
    """A text in lines of a width in window heights, as far as its words allow."""
    lines: list[str] = []
    for word in text.split():
        if lines and _width(f"{lines[-1]} {word}", bold) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def _width(text: str, bold: bool = False) -> float:
    """The width of a line of text in window heights."""
    require_matplotlib()
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family=_FONT, size=_LETTERS, weight="bold" if bold else "normal")
    return float(text_to_path.get_text_width_height_descent(text, font, False)[0]) / _POINTS / INCHES


def _png(size: tuple[float, float], shrink: float, draw: Callable[[Figure], None]) -> bytes:
    import matplotlib
    from matplotlib.figure import Figure

    style: Any = {"font.size": shrink * _LETTERS, "font.family": _FONT, "text.parse_math": False}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=(size[0] * INCHES, size[1] * INCHES))
        draw(figure)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=_DPI, transparent=True, metadata={"Software": None})
    return buffer.getvalue()
