"""Blunders that change the curves of one axis as a whole: exchanged columns, positions counted from the other
end, a reflector that was on the table."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from itertools import combinations

import numpy as np

from olp.core.arrays import Array
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration, Curve


@dataclass(frozen=True, slots=True)
class Arrangement:
    """One meaning of the curves of `axis` (0, 1, 2) other than as stated. `renames` maps the names of curves
    to those that they have then."""

    axis: int
    words: str
    apply: Callable[[Calibration], Calibration]
    renames: Mapping[str, str] = field(default_factory=dict)


def arrangements(calibration: Calibration, chain: str) -> Iterator[Arrangement]:
    """What may be wrong with the curves of each axis as a whole."""
    for axis, letter in enumerate(AXES):
        own = calibration.curves_of(letter)
        names = [name for curve in own for name in curve.names]
        for group in ("ABC", "".join(a for a in AXES if a != letter)):
            for a, b in combinations([f"E{d}{letter}" for d in group], 2):
                if a in names or b in names:
                    words = f"{a} and {b} exchanged"
                    yield Arrangement(axis, words, _swap(a, b), {a: b, b: a})
        if own:
            yield Arrangement(axis, f"positions of {letter} counted from the other end", _mirror(letter))
        if own and chain.index(letter) < chain.index("F"):
            on_table = all(curve.reference == "table" for curve in own)
            place = "at the tool, not on the table" if on_table else "on the table, not at the tool"
            yield Arrangement(axis, f"the reflector of the lines of {letter} was {place}", _refer(letter))


def scaled(calibration: Calibration, factors: Mapping[str, float]) -> Calibration:
    """The calibration with curves and squareness times these factors; cyclic terms like their curve."""

    def times(columns: Mapping[str, Array]) -> dict[str, Array]:
        return {name: _times(values, factors.get(name, 1.0)) for name, values in columns.items()}

    curves = [
        dataclasses.replace(
            curve, columns=times(curve.columns), forward=times(curve.forward), backward=times(curve.backward)
        )
        for curve in calibration.curves
    ]
    square = {name: float(_times(v, factors.get(name, 1.0))) for name, v in calibration.squareness.items()}
    cyclic = [
        dataclasses.replace(c, amplitude=float(_times(c.amplitude, factors.get(c.component, 1.0))))
        for c in calibration.cyclic
    ]
    return dataclasses.replace(calibration, curves=tuple(curves), squareness=square, cyclic=tuple(cyclic))


def _times(values: Array | float, factor: float) -> Array:
    """Exact for a sign, else to twelve decimals of mm or rad."""
    values = np.asarray(values, float)
    return values * factor + 0.0 if abs(factor) == 1.0 else np.round(values * factor, 12) + 0.0


def _with(calibration: Calibration, letter: str, change: Callable[[Curve], Curve]) -> Calibration:
    curves = [change(curve) if curve.axis == letter else curve for curve in calibration.curves]
    return dataclasses.replace(calibration, curves=tuple(curves))


def _swap(a: str, b: str) -> Callable[[Calibration], Calibration]:
    other = {a: b, b: a}

    def apply(calibration: Calibration) -> Calibration:
        def change(curve: Curve) -> Curve:
            return dataclasses.replace(
                curve,
                columns={other.get(n, n): v for n, v in curve.columns.items()},
                forward={other.get(n, n): v for n, v in curve.forward.items()},
                backward={other.get(n, n): v for n, v in curve.backward.items()},
            )

        cyclic = [dataclasses.replace(c, component=other.get(c.component, c.component))
                  for c in calibration.cyclic]  # fmt: skip
        return dataclasses.replace(_with(calibration, a[2], change), cyclic=tuple(cyclic))

    return apply


def _mirror(letter: str) -> Callable[[Calibration], Calibration]:
    def change(curve: Curve) -> Curve:
        q = curve.position_mm
        # to the digits of a file, so that the faces of the box are still covered
        turned = np.round(q[0] + q[-1] - q[::-1], 9)
        return dataclasses.replace(
            curve,
            position_mm=turned,
            columns={n: v[::-1] for n, v in curve.columns.items()},
            forward={n: v[::-1] for n, v in curve.backward.items()},
            backward={n: v[::-1] for n, v in curve.forward.items()},
        )

    return lambda calibration: _with(calibration, letter, change)


def _refer(letter: str) -> Callable[[Calibration], Calibration]:
    def change(curve: Curve) -> Curve:
        other = "functional-point" if curve.reference == "table" else "table"
        return dataclasses.replace(curve, reference=other)  # type: ignore[arg-type]

    return lambda calibration: _with(calibration, letter, change)
