"""The tree of a part as plain data for the page: figures, and the verdict of the table on each node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.units import UM_PER_MM
from olp.review.features.base import Figure
from olp.review.features.layers import MODEL, Layers, spread
from olp.review.features.registry import BY_NAME, KINDS
from olp.review.features.tree import GROUP, MOST, OPERATION, REST, Node, tree_of
from olp.review.scene import Scene

#: Decimals of figures in um and of positions in mm: the rest would only make pages longer.
_DECIMALS = 4
#: What kinds of nodes that are no features are called.
_LABELS = {OPERATION: "operation", GROUP: "equal holes", REST: "not listed"}
_GROUPED = "the figure of that hole whose figure is largest in size"


def plain(scene: Scene, most: int = MOST) -> dict[str, Any]:
    """The tree: `nodes` depth first, the `tools` with the verdict of the table, what the `kinds` of nodes and
    their figures are, and how many features are `unlisted`.

    `samples` of a node are (k, 2), the first and last sample of each run of its feed moves. `spans` of tools
    and operations are the same with their rapids, as lists."""
    tops, unlisted = tree_of(scene, most)
    told = _Told(scene)
    rows: list[dict[str, Any]] = []
    for top in tops:
        told.put(rows, top, None)
    return {"nodes": rows, "unlisted": unlisted, "tools": told.tools(rows), "kinds": _kinds()}


def _kinds() -> dict[str, Any]:
    holes = BY_NAME["hole"].figures
    texts: dict[str, Mapping[str, Figure]] = {kind.name: kind.figures for kind in KINDS}
    labels = {kind.name: kind.label for kind in KINDS} | _LABELS
    texts[GROUP] = {
        name: Figure(figure.label, f"{_GROUPED}: {figure.meaning}") for name, figure in holes.items()
    }
    return {
        name: {
            "label": label,
            "figures": {key: figure.meaning for key, figure in texts.get(name, {}).items()},
        }
        for name, label in labels.items()
    }


class _Told:
    """Says of nodes what the table and the deviations say."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._layers = Layers(scene)
        self._judged, self._over = scene.table.judged, scene.table.over
        runs = scene.table.measured
        self._sizes: list[Array] = [] if runs is None else [runs.size_um(k) for k in range(len(runs.names))]
        self._measured_over = None if runs is None or runs.tolerance_um is None else runs.over

    def put(self, rows: list[dict[str, Any]], node: Node, parent: int | None) -> list[dict[str, Any]]:
        """Add a node and all below it to `rows`. Returns its figures."""
        number = len(rows)
        row: dict[str, Any] = {"id": number, "parent": parent, "kind": node.kind}
        rows.append(row)
        below = [self.put(rows, child, number) for child in node.children]
        figures = self._figures(node)
        if node.kind == GROUP and below:
            figures = _largest(below)
        row |= self._about(node) | {"figures": figures} | self.verdict(node.moves)
        return figures

    def verdict(self, moves: Index) -> dict[str, Any]:
        """The largest deviations of moves that count, where they are, and whether they hold: of the table."""
        table, judged = self._scene.table, moves[self._judged[moves]]
        sizes: dict[str, float] = {}
        lines: dict[str, str] = {}
        samples: dict[str, int | None] = {}
        for layer, values in zip(MODEL, (table.uncorrected, table.corrected), strict=True):
            if len(judged):
                worst = int(judged[np.nan_to_num(values[judged]).argmax()])
                sizes[layer] = float(np.nan_to_num(values[worst])) * UM_PER_MM
                lines[layer] = self._scene.place(int(table.line[worst]))
                samples[layer] = self._scene.worst_sample(layer, worst)
        measured = np.zeros(len(moves), bool)
        for layer, size in zip(self._layers.names[len(MODEL) :], self._sizes, strict=True):
            known = moves[np.isfinite(size[moves])]
            measured |= np.isfinite(size[moves])
            if len(known):
                worst = int(known[size[known].argmax()])
                sizes[layer] = float(size[worst])
                lines[layer] = self._scene.place(int(table.line[worst]))
        over = self._measured_over
        holds = not bool(self._over[judged].any()) if len(judged) else None
        runs = not bool(over[moves].any()) if over is not None and measured.any() else None
        answers = [answer for answer in (holds, runs) if answer is not None]
        return {
            "largest_um": sizes,
            "worst_line": lines,
            "worst_sample": samples,
            "holds": holds,
            "measured_holds": runs,
            "ok": all(answers) if answers else None,
        }

    def tools(self, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """The tools in order of appearance, with the numbers of the nodes of their operations."""
        tool = self._scene.table.tool
        nodes: dict[int | None, list[int]] = {}
        for row in rows:
            if row["kind"] == OPERATION:
                nodes.setdefault(row["tool"], []).append(row["id"])
        return [
            {
                "tool": number,
                "label": "no tool stated" if number is None else f"T{number}",
                "nodes": own,
                "spans": self._layers.ranges(moves).tolist(),
                **self.verdict(moves),
            }
            for number, own in nodes.items()
            for moves in [np.flatnonzero(tool == (-1 if number is None else number))]
        ]

    def _about(self, node: Node) -> dict[str, Any]:
        """What a node is and where it is."""
        scene, line = self._scene, self._scene.table.line
        counting = node.moves[self._judged[node.moves]]
        lines = line[counting if len(counting) else node.feeds]
        ranges = self._layers.ranges(node.feeds)
        tools = scene.table.tool[node.feeds]
        tool = int(tools.min())
        return {
            "label": node.label,
            "detail": node.detail,
            "first_line": int(lines.min()),
            "last_line": int(lines.max()),
            "lines": scene.places(lines),
            "tool": tool if tool >= 0 and tool == tools.max() else None,
            "moves": len(node.feeds),
            "samples": ranges,
            "centre_mm": self._centre(node, ranges),
        } | ({"spans": self._layers.ranges(node.moves).tolist()} if node.kind == OPERATION else {})

    def _centre(self, node: Node, ranges: Index) -> list[float] | None:
        if node.feature is not None:
            return [round(float(value), _DECIMALS) for value in node.feature.centre_mm]
        if not len(ranges):
            return None
        position = self._scene.position_mm[spread(ranges[:, 0], ranges[:, 1] - ranges[:, 0] + 1)]
        low, high = position.min(axis=0), position.max(axis=0)
        return [round(float(value), _DECIMALS) for value in (low + high) / 2.0]

    def _figures(self, node: Node) -> list[dict[str, Any]]:
        feature = node.feature
        if feature is None:
            return []
        kind = BY_NAME[node.kind]
        by_layer: dict[str, Mapping[str, float | None]] = {
            layer: {} if deviations is None else kind.measure(feature, deviations)
            for layer, deviations in self._layers.of(feature.moves)
        }
        figures = []
        for name, figure in kind.figures.items():
            values = {layer: _um(own.get(name)) for layer, own in by_layer.items()}
            if any(value is not None for value in values.values()):
                figures.append({"name": name, "label": figure.label, "unit": "um", "by_layer": values})
        return figures


def _um(value: float | None) -> float | None:
    return None if value is None else round(value * UM_PER_MM, _DECIMALS)


def _largest(below: list[list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Of several features of a kind the figures that are largest in size."""
    merged: dict[str, dict[str, Any]] = {}
    for figure in (figure for figures in below for figure in figures):
        own = merged.setdefault(figure["name"], figure | {"by_layer": dict(figure["by_layer"])})["by_layer"]
        for layer, value in figure["by_layer"].items():
            if value is not None and (own[layer] is None or abs(value) > abs(own[layer])):
                own[layer] = value
    return list(merged.values())
