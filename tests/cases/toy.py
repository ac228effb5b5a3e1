"""Paths and error models that are small enough to be worked by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from olp.core.toolpath import Arcs, Frame, Kind, Toolpath

WIDE_BOX = np.tile([-1000.0, 1000.0], (3, 1))


@dataclass(frozen=True)
class Toy:
    """An error model from functions: `error_mm` of points (n, 3) and tools (n, 3 or 4), `bound` of moves by
    (n, 3) with such tools, and `backlash` of points, where there is any."""

    error_mm: Callable[[np.ndarray, np.ndarray], np.ndarray] = lambda p, tool: np.zeros((len(p), 3))
    bound: Callable[[np.ndarray, np.ndarray], np.ndarray] = lambda delta, tool: np.zeros(len(delta))
    backlash: Callable[[np.ndarray], np.ndarray] | None = None
    box_mm: np.ndarray = field(default_factory=lambda: WIDE_BOX)
    depends_on: np.ndarray = field(default_factory=lambda: np.eye(3, dtype=bool))

    def error(self, axis_mm: np.ndarray, tool_mm: np.ndarray, play: np.ndarray | None = None) -> np.ndarray:
        tools = np.broadcast_to(tool_mm, (len(axis_mm), np.shape(tool_mm)[-1]))
        error = np.array(self.error_mm(np.asarray(axis_mm, float), tools), float)
        if play is None or self.backlash is None:
            return error
        return error - self.backlash(np.asarray(axis_mm, float)) / 2 * play

    def rotation(self, axis_mm: np.ndarray, play: object = None, payload_kg: object = 0.0) -> np.ndarray:
        return np.zeros((len(axis_mm), 3))

    def contributions(self, *_: object) -> Iterator[tuple[str, np.ndarray]]:
        return iter(())

    def inside(self, axis_mm: np.ndarray) -> np.ndarray:
        return np.asarray((axis_mm >= self.box_mm[:, 0]) & (axis_mm <= self.box_mm[:, 1]))

    def backlash_at(self, axis_mm: np.ndarray) -> np.ndarray | None:
        return None if self.backlash is None else self.backlash(np.asarray(axis_mm, float))

    def chord_bound(self, delta_mm: np.ndarray, tool_mm: np.ndarray) -> np.ndarray:
        tools = np.broadcast_to(tool_mm, (len(delta_mm), np.shape(tool_mm)[-1]))
        return np.asarray(self.bound(np.abs(delta_mm), tools), float)


def constant_backlash(*backlash_mm: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda point: np.tile(backlash_mm, (len(point), 1))


def parabola(bend: float, of: int = 0, into: int = 1) -> Toy:
    """Axis `into` is off by `bend` times the square of axis `of`, times the tool's Z where that is not 0."""

    def gain(tool: np.ndarray) -> np.ndarray:
        return np.asarray(bend * np.where(tool[:, 2] != 0.0, tool[:, 2], 1.0))

    def error(point: np.ndarray, tool: np.ndarray) -> np.ndarray:
        values = np.zeros((len(point), 3))
        values[:, into] = gain(tool) * point[:, of] ** 2
        return values

    # a chord of length d leaves a parabola a x^2 by a d^2 / 4
    return Toy(error, lambda delta, tool: np.abs(gain(tool)) * delta[:, of] ** 2 / 4)


def linear(
    matrix: Sequence[Sequence[float]], constant: Sequence[float] = (0.0, 0.0, 0.0), **more: object
) -> Toy:
    """The error is a matrix times the position, and a constant. An axis that is not known makes that unknown
    which needs it."""
    m, c = np.array(matrix, float), np.array(constant, float)
    return Toy(lambda p, tool: np.where(m != 0, p[:, None] * m, 0.0).sum(axis=2) + c, **more)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Move:
    """One move of a path; `centre_mm` and `sweep_rad` those of an arc."""

    kind: Kind
    end_mm: tuple[float, float, float]
    flag: int = 0
    frame: int = 0
    line: int | None = None
    centre_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sweep_rad: float = 0.0
    plane: int = 0


def rapid(*end_mm: float, **more: object) -> Move:
    return Move(Kind.RAPID, tuple(end_mm), **more)  # type: ignore[arg-type]


def feed(*end_mm: float, **more: object) -> Move:
    return Move(Kind.LINE, tuple(end_mm), **more)  # type: ignore[arg-type]


def arc(*end_mm: float, centre: Sequence[float], degrees: float, **more: object) -> Move:
    kind = Kind.ARC_CCW if degrees > 0 else Kind.ARC_CW
    return Move(kind, tuple(end_mm), centre_mm=tuple(centre), sweep_rad=math.radians(degrees), **more)  # type: ignore[arg-type]


def toolpath(
    *moves: Move,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    frames: tuple[Frame, ...] = (Frame(),),
) -> Toolpath:
    """A path; lines count from 1 where a move states none."""
    arcs = [(i, move) for i, move in enumerate(moves) if move.sweep_rad]
    return Toolpath(
        kind=np.array([move.kind for move in moves], np.uint8),
        flag=np.array([move.flag for move in moves], np.uint8),
        line=np.array([i + 1 if m.line is None else m.line for i, m in enumerate(moves)], np.int32),
        frame=np.array([move.frame for move in moves], np.int32),
        end_mm=np.array([move.end_mm for move in moves], float).reshape(-1, 3),
        frames=frames,
        arcs=Arcs(
            np.array([i for i, _ in arcs], np.int64),
            np.array([move.centre_mm for _, move in arcs], float).reshape(-1, 3),
            np.array([move.plane for _, move in arcs], np.int8),
            np.array([move.sweep_rad for _, move in arcs], float),
        ),
        start_mm=start,
    )
