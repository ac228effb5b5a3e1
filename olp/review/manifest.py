"""From a scene to the input of the page: a manifest ("olp-review-1") and packed arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.progress import Progress, part, silent
from olp.core.toolpath import Kind
from olp.core.units import UM_PER_MM
from olp.findings.catalogue import RULES
from olp.proof.judgement import QUESTIONS
from olp.proof.proof import Counts
from olp.reports.report import place
from olp.review.features.nodes import plain
from olp.review.judged import judged_lines, measured_label, measured_names, pictures, removed, statistics
from olp.review.knots import Curve
from olp.review.listing import pictured
from olp.review.pack import ARC_MM, DEVIATION_MM, POSITION_MM, TIME_S, Arrays, resolution
from olp.review.palette import COLOURS
from olp.review.scene import Scene

#: Name, label, width in pixels and dashes (drawn, left out, in pixels) of layers: colours are for errors.
LAYERS: tuple[tuple[str, str, float, tuple[int, int]], ...] = (
    ("nominal", "nominal path", 1.2, (1, 0)),
    ("uncorrected", "uncorrected path", 2.5, (14, 4)),
    ("command", "corrected command", 1.2, (4, 4)),
    ("corrected", "corrected, predicted", 2.5, (1, 0)),
)
#: Width and dashes of measured runs.
MEASURED = (3.0, (3, 3))
#: Name, label and kind of scale of the parts of a deviation.
_PARTS = (
    ("magnitude", "distance", "sequential"),
    ("x", "X", "diverging"),
    ("y", "Y", "diverging"),
    ("z", "Z", "diverging"),
    ("along", "along the path", "diverging"),
    ("normal", "normal, to the left", "diverging"),
    ("binormal", "binormal, upwards", "diverging"),
    ("across", "across the path", "sequential"),
)
#: The part that is judged.
_JUDGED = "magnitude"
#: Fewest steps of an error source over its range: colours show no more.
_SOURCE_LEVELS = 200
#: Finest step of an error source in um.
_FINEST_UM = 0.001
#: Step of the angles of a tool in urad.
_TURN_URAD = 0.01
#: Step of a probability in %.
_PERCENT = 0.1
#: Fewest steps of a column of the motion over its range.
_MOTION_LEVELS = 20_000


def curve_um(size_mm: npt.NDArray[Any]) -> Curve:
    """(n,) sizes, in um, as finely as colours show them."""
    value = size_mm * UM_PER_MM
    return Curve.of(value, resolution(float(value.max(initial=0.0)), _FINEST_UM, _SOURCE_LEVELS))


def manifest_of(scene: Scene, tell: Progress = silent) -> tuple[dict[str, Any], Arrays]:
    """The manifest of a scene, and the arrays that it names."""
    arrays = Arrays()
    tell("pack", 0.0)
    origin = np.round(scene.position_mm.mean(axis=0))
    base = arrays.quantised("P", scene.position_mm, POSITION_MM, less=origin, keep=True)
    # three axes go as the path does
    tell("pack", 0.05)
    like = [base] if scene.axes.shape[1] == len(origin) else []
    arrays.quantised("Q", scene.axes, POSITION_MM, less=scene.drawn_at, plus=like)
    row = scene.listing.row_of(scene.nominal.toolpath.line[scene.samples.move].astype(np.int64))
    arrays.quantised("line", row, 1.0)
    tell("pack", 0.1)
    arrays.raw("rapid", rapid(scene), "u1")
    arrays.raw("waypoint", scene.waypoint.astype(np.uint8), "u1")
    arrays.along("t", scene.time_s, TIME_S, "P")
    tell("pack", 0.15)
    arrays.along("s", scene.samples.arc_mm, ARC_MM, "P")
    # long programs: about a fifth of the time each
    tell("pack", 0.2)
    layers = _layers(scene, arrays, origin)
    tell("pack", 0.3)
    metrics = _metrics(scene, arrays)
    tell("pack", 0.4)
    motion, listing = _motion(scene, arrays), _listing(scene, arrays, part(tell, 0.4, 0.8))
    manifest = {
        "schema": "olp-review-1",
        "title": pictured(f"{scene.name} on {scene.machine}"),
        "program": pictured(scene.name),
        "corrected": pictured(scene.corrected_name),
        "machine": pictured(scene.machine),
        "profile": scene.nominal.dialect.name,
        "digest": scene.digest,
        "compression": "deflate",
        "origin_mm": origin.tolist(),
        "samples": len(scene.samples),
        "tolerance_um": scene.tolerance_um,
        "part_tolerance_um": _part_tolerance_um(scene),
        "base": base,
        "line": "line",
        "rapid": "rapid",
        "waypoint": "waypoint",
        "time": "t",
        "way": "s",
        "time_source": "retimed" if scene.planned else "feed",
        "duration_s": scene.duration_s,
        "layers": layers,
        "metrics": metrics,
        "sources": [f"source:{name}" for name, _ in scene.sources],
        "motion": motion,
        "listing": listing,
        "meshes": list(_meshes(scene, arrays, origin)),
        "nodes": [asdict(node) for node in scene.nodes],
        "axes": "Q",
        "axes_origin": scene.drawn_at.tolist(),
        "statistics": list(statistics(scene)),
        "findings": _findings(scene),
        "notes": [],
        "pictures": list(pictures(scene)),
        "removed": removed(scene),
        "palette": COLOURS,
        "verdict": _verdict(scene),
        "tree": _tree(scene, arrays),
        "frame": scene.frame.label,
        "tool_radius_mm": scene.tool_radius_mm,
        "live": None,
    }
    tell("pack", 0.9)
    return manifest | {"arrays": arrays.specs}, arrays


def rapid(scene: Scene) -> npt.NDArray[np.uint8]:
    """(n,) 1 where the path does not count: rapids, and the way to a point that counts alone."""
    samples = scene.samples
    point = scene.table.counts[samples.move] == Counts.POINT
    aside = (scene.nominal.toolpath.kind[samples.move] == Kind.RAPID) | point
    aside &= ~point | (samples.share < 1.0)
    rapid = np.where(aside, np.uint8(1), np.uint8(0))
    rapid[~samples.joined] = 2
    return np.asarray(rapid)


def _layers(scene: Scene, arrays: Arrays, origin: Array) -> list[dict[str, Any]]:
    samples = scene.samples
    deltas = {
        "nominal": None,
        "uncorrected": arrays.quantised("d_uncorrected", samples.uncorrected, DEVIATION_MM, keep=True),
        "command": arrays.quantised(
            "d_command", samples.command_mm, DEVIATION_MM, less=samples.axis_mm, keep=True
        ),
        "corrected": arrays.quantised(
            "d_corrected", samples.corrected, DEVIATION_MM, plus=["d_uncorrected", "d_command"]
        ),
    }
    arrays.forget("d_uncorrected")
    layers = [
        _layer(name, label, "P", deltas[name], None, width, dashes) for name, label, width, dashes in LAYERS
    ]
    for k, (name, measured) in enumerate(zip(measured_names(scene), scene.measured, strict=True)):
        base = arrays.quantised(f"P_{name}", measured.base_mm - origin, POSITION_MM)
        delta = arrays.quantised(f"d_{name}", measured.delta_mm, DEVIATION_MM)
        index = arrays.quantised(f"i_{name}", measured.index, 1.0)
        kind = arrays.raw(f"kind_{name}", np.where(measured.counted, 0, 1).astype(np.uint8), "u1")
        layer = _layer(name, measured_label(scene, k), base, delta, index, *MEASURED)
        layers.append(layer | {"kind": kind, "judged": bool(measured.counted.any())})
    return layers


def _layer(
    name: str,
    label: str,
    base: str,
    delta: str | None,
    index: str | None,
    width: float,
    dashes: tuple[int, int],
) -> dict[str, Any]:
    return {
        "name": name, "label": label, "base": base, "delta": delta, "index": index, "width": width,
        "dashes": list(dashes),
    }  # fmt: skip


def _metrics(scene: Scene, arrays: Arrays) -> list[dict[str, Any]]:
    names = ["uncorrected", "command", "corrected", *measured_names(scene)]
    metrics: list[dict[str, Any]] = [
        {
            "name": part, "label": label, "unit": "um", "kind": kind, "of": part,
            "by_layer": dict.fromkeys(names), "judged": part == _JUDGED,
        }
        for part, label, kind in _PARTS
    ]  # fmt: skip
    if scene.turn_urad:
        turns = {
            name: arrays.bent(f"turn:{name}", Curve.of(value, _TURN_URAD))
            for name, value in scene.turn_urad.items()
        }
        metrics.append(
            {
                "name": "turn", "label": "direction of the tool", "unit": "urad", "kind": "sequential",
                "by_layer": turns, "judged": False,
            }
        )  # fmt: skip
    metrics += _uncertainty(scene, arrays)
    for name, size in scene.sources:
        array = arrays.bent(f"source:{name}", size)
        metrics.append(
            {
                "name": f"source:{name}", "label": f"share of {name}", "unit": "um", "kind": "sequential",
                "by_layer": {"uncorrected": array}, "judged": False,
            }
        )  # fmt: skip
    return metrics


def _uncertainty(scene: Scene, arrays: Arrays) -> Iterator[dict[str, Any]]:
    """The band, and the probability of being beyond the tolerance: in both, larger is worse."""
    uncertainty = scene.uncertainty
    if uncertainty is None:
        return
    array = arrays.bent("band", curve_um(uncertainty.band_mm))
    yield {
        "name": "band", "label": "uncertainty (k = 2)", "unit": "um", "kind": "sequential",
        "by_layer": dict.fromkeys(("uncorrected", "corrected"), array), "judged": False,
    }  # fmt: skip
    if uncertainty.within_mm is None:
        return
    by_layer = {
        layer: arrays.quantised(f"beyond:{layer}", 100.0 * value, _PERCENT)
        for layer, value in uncertainty.beyond.items()
    }
    yield {
        "name": "beyond", "label": f"probability beyond {uncertainty.within_mm * UM_PER_MM:g} µm",
        "unit": "%", "kind": "sequential", "by_layer": by_layer, "judged": False,
    }  # fmt: skip


def _motion(scene: Scene, arrays: Arrays) -> dict[str, Any] | None:
    table = scene.motion
    if table is None:
        return None

    def column(name: str, values: Array) -> str:
        step = resolution(float(np.abs(values).max(initial=0.0)), 1e-4, _MOTION_LEVELS)
        return arrays.quantised(f"m_{name}", values, step)

    axes = []
    for i, (axis, (most_velocity, most_acceleration, most_jerk)) in enumerate(scene.limits.items()):
        axes.append(
            {
                "name": axis,
                "unit": scene.units.get(axis, "mm"),
                "position": arrays.quantised(f"m_{axis}", table.position_mm[:, i], ARC_MM),
                "velocity": column(f"V{axis}", table.velocity[:, i]),
                "acceleration": column(f"A{axis}", table.acceleration[:, i]),
                "jerk": column(f"J{axis}", table.jerk[:, i]),
                "velocity_limit": most_velocity,
                "acceleration_limit": most_acceleration,
                "jerk_limit": most_jerk,
            }
        )
    return {
        "time": arrays.quantised("m_time", table.time_s, TIME_S),
        "line": arrays.quantised("m_line", scene.listing.row_of_corrected(table.line), 1.0),
        "speed": column("speed", table.speed_mm_s),
        "feed": arrays.raw("m_feed", table.feed_mm_s, "f4"),
        "axes": axes,
    }


def _listing(scene: Scene, arrays: Arrays, tell: Progress) -> dict[str, Any]:
    listing = scene.listing
    nominal = arrays.lines("text_nominal", listing.nominal, ["P"], listing.sample_nominal)
    tell("pack", 0.5)
    by = ["P", "d_command"]
    corrected = arrays.lines("text_corrected", listing.corrected, by, listing.sample_corrected)
    tell("pack", 0.9)
    return {
        "nominal": nominal,
        "corrected": corrected,
        "row_nominal": arrays.quantised("row_nominal", listing.row_nominal, 1.0),
        "row_corrected": arrays.quantised("row_corrected", listing.row_corrected, 1.0),
        **_names(scene, arrays),
        **judged_lines(scene, arrays),
    }


def _names(scene: Scene, arrays: Arrays) -> dict[str, Any]:
    """What the lines of the nominal text are called where it was unrolled, and the characters of the longest
    name."""
    if scene.nominal.origin is None:
        return {"names": None, "names_width": 0}
    names = [pictured(scene.place(line + 1)) for line in range(scene.nominal.lines)]
    return {"names": arrays.lines("line_names", "\n".join(names)), "names_width": max(map(len, names))}


def _meshes(scene: Scene, arrays: Arrays, origin: Array) -> Iterator[dict[str, Any]]:
    for body in scene.bodies:
        yield {
            "name": body.name,
            "label": pictured(body.label),
            "role": body.role,
            "vertices": arrays.raw(f"v_{body.name}", body.vertices - origin, "f4"),
            "faces": arrays.raw(f"f_{body.name}", body.faces, "u4"),
            "colour": body.colour,
            "opacity": body.opacity,
            "path": list(body.path),
        }


def _tree(scene: Scene, arrays: Arrays) -> dict[str, Any]:
    """The tree of features; ranges of samples are rows of one array, `samples`, from the first to before the
    last of the `ranges` of a node."""
    tree = plain(scene)
    samples = [node.pop("samples") for node in tree["nodes"]]
    ends = np.cumsum([len(ranges) for ranges in samples], dtype=np.int64).tolist()
    for node, begin, end in zip(tree["nodes"], [0, *ends], ends, strict=False):
        node["ranges"] = [begin, end]
    every = np.concatenate(samples) if samples else np.zeros((0, 2), np.int64)
    return tree | {"samples": arrays.quantised("tree", every, 1.0)}


def _findings(scene: Scene) -> list[dict[str, Any]]:
    """Findings; `place` is the line as the listing names it."""
    return [
        {
            "code": finding["code"],
            "severity": finding["severity"],
            "line": finding["line"],
            "place": None if finding["line"] is None else place(finding),
            "message": pictured(finding["message"]),
            "title": RULES[finding["code"]].title,
            "count": finding["count"],
        }
        for finding in scene.report.get("findings", ())
    ]


def _verdict(scene: Scene) -> dict[str, Any]:
    """The answer, the questions with theirs, and the sentences beside those. Without a part tolerance the
    question of the part is not asked."""
    verdict = scene.report["verdict"]
    said = " ".join(question["sentence"] for question in verdict["questions"])
    remarks = [sentence for sentence in verdict["sentences"] if sentence not in said]
    unasked = [] if verdict["part"] is not None else [QUESTIONS["part"]]
    return {
        "ok": verdict["ok"], "questions": verdict["questions"], "remarks": remarks, "unasked": unasked
    }  # fmt: skip


def _part_tolerance_um(scene: Scene) -> float | None:
    """The part tolerance that was stated."""
    part, runs = scene.report["verdict"]["part"], scene.table.measured
    if part is not None:
        return float(part["tolerance_um"])
    return None if runs is None else runs.tolerance_um
