"""What the tests of the page in a browser share: a program, its arrays as the browser has them, pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from olp.review.job import Review
from olp.review.pack import Arrays
from olp.review.palette import COLOURS

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
GANTRY = PROGRAMS / "gantry-plate" / "machine.toml"
#: CRLF, blank lines, comments, and arcs that become several blocks
PROGRAM = """\
%
(first)

G21 G17 G90 G64 P0.01
G54
T1 M6
G43 H1
G0 X10 Y10 Z20
(down)
G1 Z-2 F600

G1 X400 Y10 F1800
G3 X450 Y60 I0 J50
G1 X450 Y300

G2 X400 Y350 I-50 J0
(back)
G1 X10
G1 Y10
G0 Z20
M2
%""".replace("\n", "\r\n").encode()


def array(page: Any, name: str, columns: int = 1) -> np.ndarray:
    values = np.array(page.evaluate("name => Array.from(olp.arrays.get(name))", name), float)
    return values.reshape(-1, columns) if columns > 1 else values


def colourful(picture: np.ndarray) -> int:
    """How many pixels are far from grey."""
    return int((picture.max(axis=2) - picture.min(axis=2) > 70).sum())


def still(page: Any) -> None:
    """Waits until the picture has caught up with the page."""
    page.evaluate("() => { olp.app.scene.refill(); olp.app.scene.viewer.render(); }")


def middle_of_moves(review: Review) -> list[int]:
    """A sample inside each feed move."""
    samples = review.scene.samples
    kind = review.scene.nominal.toolpath.kind[samples.move]
    moves = np.unique(samples.move[kind != 0])
    return [int(np.median(np.flatnonzero(samples.move == move))) for move in moves]


def _picture() -> dict[str, Any]:
    return {
        "name": "uncorrected", "label": "uncorrected", "layers": ["uncorrected"], "tolerance_um": 5,
        "basis": "allowed", "largest_um": 15.0, "rms_um": 10.0, "flag": None,
    }  # fmt: skip


def synthetic(rows: int, samples: int) -> tuple[dict[str, Any], bytes]:
    """A manifest of `rows` lines and `samples` points on a spiral, by hand."""
    arrays = Arrays()
    u = np.linspace(0, 40 * np.pi, samples)
    position = np.column_stack((200 * u / u[-1] * np.cos(u), 200 * u / u[-1] * np.sin(u), u / 10))
    arrays.quantised("P", position, 1e-4)
    arrays.quantised("d", np.column_stack((np.sin(u), np.cos(2 * u), np.sin(3 * u))) * 0.01, 1e-6)
    arrays.quantised("line", np.minimum(np.arange(samples) * rows // samples, rows - 1), 1.0)
    arrays.raw("rapid", np.zeros(samples), "u1")
    arrays.quantised("t", np.arange(samples) * 0.01, 1e-6)
    arrays.quantised("s", np.arange(samples) * 0.1, 1e-3)
    arrays.text("text", "\n".join(f"N{k} G1 X{k % 977}" for k in range(1, rows + 1)))
    arrays.quantised("number", np.arange(1, rows + 1), 1.0)
    arrays.raw("error", np.full(rows, 1.5), "f4")
    layer = {"base": "P", "index": None, "width": 2, "dashes": [1, 0]}
    manifest: dict[str, Any] = {
        "schema": "olp-review-1", "title": "made up", "program": "part.ngc", "corrected": None,
        "machine": "m",
        "digest": "0" * 12, "compression": "deflate", "origin_mm": [0, 0, 0], "samples": samples,
        "base": "P", "line": "line", "rapid": "rapid", "time": "t", "way": "s", "tolerance_um": 5,
        "motion": None, "meshes": [], "nodes": [],
        "layers": [{"name": "nominal", "label": "nominal", "delta": None, **layer},
                   {"name": "uncorrected", "label": "uncorrected", "delta": "d", **layer}],
        "metrics": [{"name": "magnitude", "label": "deviation", "unit": "um", "kind": "sequential",
                     "of": "magnitude", "by_layer": {"uncorrected": None}, "judged": True}],
        "listing": {"nominal": "text", "corrected": None, "row_nominal": "number", "row_corrected": None,
                    "uncorrected_um": "error", "corrected_um": None},
        "statistics": [], "findings": [], "notes": [], "pictures": [_picture()],
        "palette": COLOURS, "frame": "machine", "tool_radius_mm": 3,
        "arrays": arrays.specs,
    }  # fmt: skip
    return manifest, arrays.encoded()
