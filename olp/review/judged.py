"""What the page shows of the table of judgements: lines with their states, figures, and the worst places."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.units import UM_PER_MM
from olp.review.pack import Arrays
from olp.review.scene import Scene

#: State of a line of the listing without a move.
NO_MOVE = 3
#: Step of the deviations of lines, as they are printed everywhere, in um.
_LISTED_UM = 0.01
#: What stands for a deviation that is not known.
_UNKNOWN_UM = -1.0


def measured_names(scene: Scene) -> list[str]:
    """Names of the layers of measured runs."""
    count = len(scene.measured)
    return ["measured"] if count == 1 else [f"measured-{k + 1}" for k in range(count)]


def judged_lines(scene: Scene, arrays: Arrays) -> dict[str, Any]:
    """The table by lines: the `state` of each, the deviations that the listing shows (uncorrected, corrected
    and, where there are runs, measured), and of each layer deviation and state."""
    table = scene.table.by_line()
    columns = {
        "uncorrected": _line_column(scene, arrays, "uncorrected_um", table["line"], table["uncorrected_um"]),
        "corrected": _line_column(scene, arrays, "corrected_um", table["line"], table["corrected_um"]),
    }
    states = {
        "uncorrected": _line_states(scene, arrays, "uncorrected", table["line"], table["uncorrected_state"]),
        "corrected": _line_states(scene, arrays, "corrected", table["line"], table["corrected_state"]),
    }
    shown = {f"{name}_um": column for name, column in columns.items()} | {"measured_um": None}
    runs = scene.table.measured
    if runs is not None:
        shown["measured_um"] = _line_column(scene, arrays, "measured_um", table["line"], table["measured_um"])
        for k, name in enumerate(measured_names(scene)):
            own = runs.by_line(k)
            columns[name] = _line_column(scene, arrays, f"um_{name}", own["line"], own["measured_um"])
            states[name] = _line_states(scene, arrays, name, own["line"], own["state"])
    by_layer = {name: {"um": columns[name], "state": states[name]} for name in columns}
    state = _line_states(scene, arrays, "line", table["line"], table["state"])
    return shown | {"state": state, "by_layer": by_layer}


def _line_column(
    scene: Scene, arrays: Arrays, name: str, line: npt.NDArray[np.int64], values_um: npt.NDArray[Any]
) -> str:
    """Deviations of lines as a column of the rows of the listing."""
    values = np.full(len(scene.listing.row_nominal), np.nan)
    values[scene.listing.row_of(line)] = values_um
    return arrays.quantised(name, np.where(np.isfinite(values), values, _UNKNOWN_UM), _LISTED_UM)


def _line_states(
    scene: Scene, arrays: Arrays, name: str, line: npt.NDArray[np.int64], states: npt.NDArray[np.uint8]
) -> str:
    """States of lines as a column of the rows of the listing."""
    state = np.full(len(scene.listing.row_nominal), NO_MOVE, np.uint8)
    state[scene.listing.row_of(line)] = states
    return arrays.raw(f"{name}_state", state, "u1")


def statistics(scene: Scene) -> Iterator[dict[str, Any]]:
    """The figures of the report, of each layer and of the job."""
    deviation, table = scene.report["deviation"], scene.table
    largest = {
        "uncorrected": float(np.nan_to_num(table.uncorrected[table.judged]).max(initial=0.0)) * UM_PER_MM,
        "corrected": table.largest_mm() * UM_PER_MM,
    }
    for side, layer in (("before", "uncorrected"), ("after", "corrected")):
        yield {"label": "largest", "value": largest[layer], "unit": "um", "layer": layer}
        rms, waypoints = deviation[side]["between"]["rms_um"], deviation[side]["waypoints"]["max_um"]
        yield {"label": "rms", "value": float(rms), "unit": "um", "layer": layer}
        yield {"label": "at waypoints", "value": float(waypoints), "unit": "um", "layer": layer}
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


def callouts(scene: Scene) -> Iterator[dict[str, Any]]:
    """The worst line, uncorrected and corrected, of the moves that count."""
    table = scene.table
    for layer, words, values in (
        ("uncorrected", "uncorrected", table.uncorrected), ("corrected", "corrected", table.corrected),
    ):  # fmt: skip
        size = np.where(table.judged, np.nan_to_num(values), -1.0)
        if not len(size) or size.max() < 0.0:
            continue
        move = int(size.argmax())
        own = np.flatnonzero(scene.samples.move == move)
        if not own.size:
            continue
        away = np.linalg.norm(getattr(scene.samples, layer)[own], axis=1)
        text = f"largest, {words}: {size[move] * UM_PER_MM:.2f} µm, line {scene.place(int(table.line[move]))}"
        yield {"sample": int(own[away.argmax()]), "text": text, "layer": layer}
    yield from _measured_callout(scene)


def _measured_callout(scene: Scene) -> Iterator[dict[str, Any]]:
    """The worst line of the measured runs."""
    runs = scene.table.measured
    sizes = [] if runs is None else [runs.largest_um(k) or -1.0 for k in range(len(runs.names))]
    if runs is None or max(sizes) < 0.0:
        return
    k = int(np.argmax(sizes))
    shown = scene.measured[k]
    away = np.where(shown.counted, np.linalg.norm(shown.delta_mm, axis=1), -1.0)
    worst = runs.worst(1)[0]
    text = f"largest, measured: {worst['max_um']:.2f} µm, line {scene.place(worst['line'])}"
    yield {"sample": int(shown.index[away.argmax()]), "text": text, "layer": measured_names(scene)[k]}
