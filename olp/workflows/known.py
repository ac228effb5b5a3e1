"""A machine without files: its errors are a few numbers of the call, and the rest is assumed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

import numpy as np

from olp.core.machine import Axis, Machine, Sanity, Setup, Tool, WorkOffset
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration
from olp.errormodel.known import KnownErrors
from olp.program.dialect import Dialect
from olp.program.rs274.profiles.base import Profile

K = TypeVar("K")
V = TypeVar("V")

#: mm; every axis reaches so far in both directions. No machine is as long.
_REACH_MM = 1e5
#: mm; the digit of a program that no machine file states.
_INCREMENT_MM = 0.001
#: The control where neither the call nor the text names one: it has the fewest codes and refuses the rest.
_CONTROL = "grbl"


@dataclass(frozen=True, slots=True, eq=False)
class Stated:
    """A calibration that the call states in place of files, the `statement` as text, and what is assumed.
    `by_height`: its errors depend on Z, and so on the lengths of tools."""

    calibration: Calibration
    statement: str
    assumed: tuple[str, ...]
    by_height: bool


class _Every(Mapping[K, V]):
    """A table in which every key has a value of its own, and none is listed."""

    def __init__(self, make: type[V]) -> None:
        self._make = make

    def __getitem__(self, key: K) -> V:
        return self._make(key)  # type: ignore[call-arg]

    def __iter__(self) -> Iterator[K]:
        return iter(())

    def __len__(self) -> int:
        return 0


def described_by(known: KnownErrors, named: Dialect | None) -> tuple[Setup, Stated]:
    """The setup of a machine of which only these errors are known, and what is stated. Only distances count:
    every work offset is zero and touched off on this machine, every tool has the length 0, and no position in
    machine coordinates is known. `named` is the dialect that the call names."""
    control = named.name if isinstance(named, Profile) else _CONTROL
    axis = Axis((-_REACH_MM, _REACH_MM), _INCREMENT_MM)
    machine = Machine(
        name="not described",
        chain="FXYZ",
        controller=control,
        axes=dict.fromkeys(AXES, axis),
        work_offsets=_Every[str, WorkOffset](WorkOffset),
        tools=_Every[int, Tool](Tool),
        sanity=Sanity(largest_correction_mm=np.inf),
        located=False,
        assumed=True,
    )
    sentences = tuple(known.sentences())
    assumed = (
        *sentences,
        f"no machine file: a program of blocks is read as one of {control}, and positions are rounded to "
        f"{_INCREMENT_MM:g} mm at the most",
        "no machine file: the zero was touched off on this machine, so only distances from it count",
    )
    calibration = known.calibration(machine.name, np.array([axis.travel_mm] * 3))
    return Setup(machine), Stated(calibration, "; ".join(sentences), assumed, known.by_height)
