"""A visualizer of meshcat's without a server: it keeps what its browser would show, and projects as three.js
does."""

from __future__ import annotations

import json
from typing import Any

import numpy as np


class Window:
    """Takes meshcat's own commands, and keeps the last of each node, as its server does."""

    def __init__(self) -> None:
        self.objects: dict[str, dict[str, Any]] = {}
        self.transforms: dict[str, np.ndarray] = {}
        self.properties: dict[str, dict[str, Any]] = {}
        self.animation: dict[str, Any] = {}

    def send(self, command: Any) -> None:
        data = command.lower()
        kind, path = data["type"], data["path"]
        if kind == "delete":
            for held in (self.objects, self.transforms, self.properties):
                for name in [n for n in held if n == path or n.startswith(f"{path}/")]:
                    del held[name]
        elif kind == "set_object":
            self.objects[path] = data["object"]
            self.properties.pop(path, None)
        elif kind == "set_transform":
            self.transforms[path] = np.reshape(data["matrix"], (4, 4)).T
        elif kind == "set_property":
            json.dumps(data["value"])
            self.properties.setdefault(path, {})[data["property"]] = data["value"]
        elif kind == "set_animation":
            self.animation = data

    def under(self, path: str) -> dict[str, dict[str, Any]]:
        """Objects below a node, by the rest of their path."""
        return {n.removeprefix(f"{path}/"): v for n, v in self.objects.items() if n.startswith(f"{path}/")}


def visualizer() -> tuple[Any, Window]:
    """meshcat's own class on a window that keeps all."""
    import meshcat

    window = Window()
    return meshcat.Visualizer(window=window), window


def attribute(shape: dict[str, Any], name: str) -> np.ndarray:
    """(n, c) an attribute of the only geometry of an object, as its browser reads it."""
    held = shape["geometries"][0]["data"]["attributes"][name]
    assert held["type"] == "Float32Array"
    return np.frombuffer(held["array"].data, np.float32).reshape(-1, held["itemSize"]).astype(float)


def colour(shape: dict[str, Any]) -> str:
    """The colour of the only material."""
    return f"#{shape['materials'][0]['color']:06x}"


def hexadecimal(rgb: np.ndarray) -> list[str]:
    """Colours (n, 3) from 0 to 1 as "#rrggbb"."""
    whole = np.round(255.0 * rgb).astype(int)
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in whole.tolist()]


def windowed(camera: dict[str, Any], points: np.ndarray, aspect: float) -> np.ndarray:
    """(n, 2) points (n, 3) of meshcat's scene, z up, in a window with corners (-1, -1) and (1, 1); three.js'
    perspective of a camera that looks at the zero from its matrix."""
    data = camera["object"]
    turned = np.stack((points[:, 0], points[:, 2], -points[:, 1]), axis=1)
    eye = np.reshape(data["matrix"], (4, 4))[3, :3]
    back = eye / np.linalg.norm(eye)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    seen = (turned - eye) @ np.stack((right, up, back), axis=1)
    assert (-seen[:, 2] > data["near"]).all() and (-seen[:, 2] < data["far"]).all()
    top = np.tan(np.radians(data["fov"] / 2.0))
    skew = data["filmOffset"] / (data["filmGauge"] * min(aspect, 1.0))
    x, y = (seen[:, i] / -seen[:, 2] for i in (0, 1))
    return np.stack(((x - skew) / (top * aspect), y / top), axis=1)
