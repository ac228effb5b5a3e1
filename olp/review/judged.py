"""What the page shows of the table of judgements: lines with their states, figures, and the worst places."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index
from olp.core.units import UM_PER_MM
from olp.proof.judgement import Judgements
from olp.proof.measured import ABOVE
from olp.review.listing import pictured
from olp.review.pack import Arrays
from olp.review.scene import Scene

#: State of a line of the listing without a move.
NO_MOVE = 3
#: Step of the deviations of lines, as they are printed everywhere, in um.
_LISTED_UM = 0.01
#: What stands for a deviation that is not known.
_UNKNOWN_UM = -1.0
_NOT_JUDGED = "no point of it is on a move that counts: it is shown and not judged."


def measured_names(scene: Scene) -> list[str]:
    """Names of the layers of measured runs."""
    count = len(scene.measured)
    return ["measured"] if count == 1 else [f"measured-{k + 1}" for k in range(count)]


def measured_label(scene: Scene, k: int) -> str:
    """What measured run k is called: by its file where there are several."""
    return "measured" if len(scene.measured) == 1 else pictured(f"measured: {scene.measured[k].label}")


def judged_lines(scene: Scene, arrays: Arrays) -> dict[str, Any]:
    """The table by lines: the `state` of each, the deviations that the listing shows (uncorrected, corrected
    and, where there are runs, measured), and of each layer deviation and state."""
    table = scene.table.by_line()
    row = scene.listing.row_of(table["line"])
    columns = {
        "uncorrected": _line_column(scene, arrays, "uncorrected_um", row, table["uncorrected_um"]),
        "corrected": _line_column(scene, arrays, "corrected_um", row, table["corrected_um"]),
    }
    states = {
        "uncorrected": _line_states(scene, arrays, "uncorrected", row, table["uncorrected_state"]),
        "corrected": _line_states(scene, arrays, "corrected", row, table["corrected_state"]),
    }
    shown = {f"{name}_um": column for name, column in columns.items()} | {"measured_um": None}
    runs = scene.table.measured
    if runs is not None:
        shown["measured_um"] = _line_column(scene, arrays, "measured_um", row, table["measured_um"])
        for k, name in enumerate(measured_names(scene)):
            own = runs.by_line(k)
            on = scene.listing.row_of(own["line"])
            columns[name] = _line_column(scene, arrays, f"um_{name}", on, own["measured_um"])
            states[name] = _line_states(scene, arrays, name, on, own["state"])
    by_layer = {name: {"um": columns[name], "state": states[name], "side": None} for name in columns}
    for name in scene.table.side:
        side_um = table[f"{name}_side_um"]
        by_layer[name]["side"] = _line_column(scene, arrays, f"{name}_side_um", row, side_um)
    state = _line_states(scene, arrays, "line", row, table["state"])
    return shown | {"state": state, "by_layer": by_layer}


def _line_column(scene: Scene, arrays: Arrays, name: str, row: Index, values_um: npt.NDArray[Any]) -> str:
    """Deviations of the lines in some rows of the listing as a column of all its rows."""
    values = np.full(len(scene.listing.row_nominal), np.nan)
    values[row] = values_um
    return arrays.quantised(name, np.where(np.isfinite(values), values, _UNKNOWN_UM), _LISTED_UM)


def _line_states(scene: Scene, arrays: Arrays, name: str, row: Index, states: npt.NDArray[np.uint8]) -> str:
    """States of the lines in some rows of the listing as a column of all its rows."""
    state = np.full(len(scene.listing.row_nominal), NO_MOVE, np.uint8)
    state[row] = states
    return arrays.raw(f"{name}_state", state, "u1")


def statistics(scene: Scene) -> Iterator[dict[str, Any]]:
    """The figures of the report, of each layer and of the job."""
    table = scene.table
    largest = {
        "uncorrected": float(np.nan_to_num(table.uncorrected[table.judged]).max(initial=0.0)) * UM_PER_MM,
        "corrected": table.largest_mm() * UM_PER_MM,
    }
    for layer, figures in scene.figures.items():
        yield {"label": "largest", "value": largest[layer], "unit": "um", "layer": layer}
        for label, value, unit in (
            ("rms", figures.rms_um, "um"), ("at waypoints", figures.waypoints_um, "um"),
            ("direction of the tool", figures.turn_urad, "urad"),
        ):  # fmt: skip
            if value is not None:
                yield {"label": label, "value": value, "unit": unit, "layer": layer}
    runs = scene.report["measured"]["runs"] if scene.measured else ()
    for name, run in zip(measured_names(scene), runs, strict=bool(runs)):
        for label, key in (("largest", "max"), ("rms", "rms")):
            if run["across_um"]:
                yield {"label": label, "value": run["across_um"][key], "unit": "um", "layer": name}
    moves = scene.nominal.toolpath
    length_m = float(scene.samples.arc_mm[-1]) * 1e-3
    yield {"label": "path length", "value": length_m, "unit": "m", "layer": None}
    yield {"label": "time", "value": scene.duration_s, "unit": "s", "layer": None}
    yield {"label": "moves", "value": len(moves), "unit": "", "layer": None}
    yield {"label": "lines", "value": scene.nominal.lines, "unit": "", "layer": None}


def pictures(scene: Scene) -> Iterator[dict[str, Any]]:
    """The pictures of a page: uncorrected, corrected and each measured run. Each has its `layers`, the
    `tolerance_um` that it is judged by, the largest deviation of what counts and its rms. `flag` is the place
    of the largest, `lines_above` how many there are (None where nothing judges them), `note` a remark."""
    table = scene.table
    allowed_um = table.allowed_mm * UM_PER_MM
    for layer, values in (("uncorrected", table.uncorrected), ("corrected", table.corrected)):
        above = table.judged & (np.nan_to_num(values) > table.allowed_mm)
        yield {
            "name": layer, "label": layer, "layers": [layer], "tolerance_um": allowed_um, "basis": "allowed",
            "rms_um": scene.figures[layer].rms_um,
            "lines_above": int(np.count_nonzero(np.bincount(table.line[above]))),
            "note": _side_note(table, layer, values),
            **_largest(scene, layer, values),
        }  # fmt: skip
    runs = table.measured
    if runs is not None:
        figures = scene.report["measured"]["runs"]
        for k, (name, figure) in enumerate(zip(measured_names(scene), figures, strict=True)):
            across, state = figure["across_um"], runs.by_line(k)["state"]
            judged = runs.tolerance_um is not None and len(state) > 0
            yield {
                "name": name, "label": measured_label(scene, k), "layers": [name],
                "tolerance_um": runs.tolerance_um, "basis": "part tolerance",
                "rms_um": across["rms"] if across else None,
                "lines_above": int((state == ABOVE).sum()) if judged else None,
                "note": None if scene.measured[k].counted.any() else _NOT_JUDGED,
                **_largest_measured(scene, k),
            }  # fmt: skip


def _side_note(table: Judgements, layer: str, values: npt.NDArray[np.float32]) -> str | None:
    """What a picture says where its largest deviation has an unknown side of the backlash in it."""
    if layer not in table.side or not table.judged.any():
        return None
    worst = int(_size(values, table.judged).argmax())
    part_um = float(table.side[layer][worst]) * UM_PER_MM
    largest_um = float(values[worst]) * UM_PER_MM
    if part_um < _LISTED_UM / 2:
        return None
    return (
        f"up to {part_um:.2f} um of the largest, {largest_um:.2f} um, may be backlash, whose side is not "
        f"known there yet; the path is drawn {largest_um - part_um:.2f} um off."
    )


def removed(scene: Scene) -> dict[str, float | None]:
    """What the correction removes of the largest deviation that counts, in um and in percent of it."""
    table = scene.table
    before = _size(table.uncorrected, table.judged).max(initial=0.0) * UM_PER_MM
    after = table.largest_mm() * UM_PER_MM
    percent = 100.0 * (1.0 - after / before) if before > 0.0 else None
    return {"before_um": float(before), "after_um": float(after), "percent": percent}


def _size(values: npt.NDArray[np.float32], judged: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
    """(n,) deviations of moves that count, -1 for others."""
    return np.where(judged, np.nan_to_num(values), -1.0).astype(float)


def _largest(scene: Scene, layer: str, values: npt.NDArray[np.float32]) -> dict[str, Any]:
    """The largest deviation of the moves that count, and its place."""
    size = _size(values, scene.table.judged)
    if not len(size) or size.max() < 0.0:
        return {"largest_um": None, "flag": None}
    move = int(size.argmax())
    largest_um = float(size[move]) * UM_PER_MM
    worst = scene.worst_sample(layer, move)
    if worst is None:
        return {"largest_um": largest_um, "flag": None}
    line, delta = scene.place(int(scene.table.line[move])), getattr(scene.samples, layer)[worst]
    return {"largest_um": largest_um, "flag": _flag(worst, layer, largest_um, line, delta)}


def _largest_measured(scene: Scene, k: int) -> dict[str, Any]:
    """The largest deviation of measured run k, and its place."""
    runs, shown = scene.table.measured, scene.measured[k]
    largest_um = None if runs is None else runs.largest_um(k)
    if runs is None or largest_um is None:
        return {"largest_um": None, "flag": None}
    own = runs.by_line(k)
    line = scene.place(int(own["line"][own["measured_um"].argmax()]))
    row = int(np.where(shown.counted, np.linalg.norm(shown.delta_mm, axis=1), -1.0).argmax())
    flag = _flag(int(shown.index[row]), measured_names(scene)[k], largest_um, line, shown.delta_mm[row])
    return {"largest_um": largest_um, "flag": flag}


def _flag(sample: int, layer: str, size_um: float, line: str, delta_mm: Array) -> dict[str, Any]:
    """A flag at a sample: the stated deviation, its line, and its direction (3,) as a unit vector."""
    length = float(np.linalg.norm(delta_mm))
    direction = (delta_mm / length if length > 0.0 else np.zeros(3)).round(4).tolist()
    return {"sample": sample, "layer": layer, "um": size_um, "line": line, "direction": direction}
