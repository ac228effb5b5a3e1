"""Scenes whose deviations are known by heart, and their features as plain rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import olp
from olp.review.features.nodes import plain
from olp.review.scene import Scene

HEAD = "G21 G17 G90 G94 G40 G49 G80 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z20\nF1000\n"
Error = Callable[[np.ndarray], np.ndarray]
Node = dict[str, Any]


def scene_of(text: str, machine: Path, step_mm: float = 0.25, **options: Any) -> Scene:
    """The scene of a program after the usual head, with samples every `step_mm`."""
    program = f"{HEAD}{text}\nG0 Z20\nM2\n".encode()
    return olp.view(program, machine, time=False, step_mm=step_mm, **options).scene


def bent(scene: Scene, uncorrected: Error, corrected: Error | None = None) -> Scene:
    """The scene with deviations that are functions of the position (n, 3) in mm, as programmed."""
    after = corrected or np.zeros_like
    samples = replace(
        scene.samples, uncorrected=uncorrected(scene.position_mm), corrected=after(scene.position_mm)
    )
    return replace(scene, samples=samples)


def nodes_of(scene: Scene, kind: str = "") -> list[Node]:
    """The nodes of a scene, of one kind or all but operations."""
    return [n for n in plain(scene)["nodes"] if (n["kind"] == kind if kind else n["kind"] != "operation")]


def one(scene: Scene, kind: str) -> Node:
    (node,) = nodes_of(scene, kind)
    return node


def figures(node: Node, layer: str = "uncorrected") -> dict[str, float]:
    """The figures of a node in um by name."""
    return {f["name"]: f["by_layer"][layer] for f in node["figures"]}


def rotated(x: float, y: float, angle_deg: float) -> tuple[float, float]:
    turn = np.radians(angle_deg)
    return float(x * np.cos(turn) - y * np.sin(turn)), float(x * np.sin(turn) + y * np.cos(turn))
