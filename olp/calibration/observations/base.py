"""What every instrument provides so that the adjustment can use its readings.

An `Observation` is what was read, as a value. In an adjustment it is a `State`: the readings that are used,
and the present values of its own unknowns (a zero, the position of a station). The estimator, the report and
the prediction of a plan use these two only, and no specific instrument.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from olp.calibration.estimator.normal import Block, Normal, residuals_of
from olp.calibration.estimator.parameters import Parameters, Unknowns
from olp.core.arrays import Array, Index
from olp.core.machine import Vector
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass

#: A reading is left out where its residual is more than so many standard deviations.
OUTLIER = 6.0
#: At most this share of a set is left out.
SHARE = 0.05
#: Standard deviation of a scale of its own that readings may have by mistake: 5 K of steel.
OWN_SCALE = 6e-5
#: Runs may spread by at most this factor more than stated.
SCATTER = 1.5


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviation of a reading about its drift, and that of the drift over one run; mm or rad.
    `spread` is what the runs themselves show, None without repeated readings."""

    sigma: float
    drift: float
    spread: float | None


@dataclass(frozen=True, slots=True)
class Outlier:
    """A reading left out: its file, the line there, and how many standard deviations it is off. `value` is in
    rad where `component` is an angular error, else in mm."""

    source: str
    row: int
    component: str
    value: float
    deviations: float


@dataclass(frozen=True, slots=True, eq=False)
class Screened:
    """An observation without the readings that are far from their repetitions; `noise` is None where only
    `start` determines it."""

    observation: Observation
    noise: Noise | None = None
    outliers: tuple[Outlier, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Advance:
    """By how much a solution changes the own unknowns of an observation; `small` where that is negligible."""

    values: Array
    small: bool = True


#: The step of an observation without unknowns of its own.
STILL = Advance(np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class Alternative:
    """What may be wrong with an observation: its `kind` in a word, in `words`, and the observation put right.
    `factor` is by how much its values are multiplied for that. It can be only where the axis `on_table`, if
    it names one, carries the workpiece. Some are named only `where_off`: where readings contradict all
    others, whatever the cause."""

    kind: str
    words: str
    observation: Observation
    factor: float = 1.0
    on_table: str = ""
    where_off: bool = False


class Observation(ABC):
    """Readings of one instrument in one set-up. A frozen value with the file that it came from, and the tool
    vectors (3,) or (n, 3) in mm that it was read with. `read_columns` names its fields of places and of
    readings, each with n rows, the readings last."""

    __slots__ = ()
    read_columns: ClassVar[tuple[str, ...]] = ()
    source: str
    tool_mm: Vector | Array

    @property
    def framed(self) -> bool:
        """Whether it was taken in the frame of the machine, so that it shows shift and turn of the axes."""
        return False

    def screened(self) -> Screened:
        """Without the readings that are far from their repetitions. Raises ConfigError."""
        return Screened(self)

    def alternatives(self) -> Sequence[Alternative]:
        """What may be wrong with it, each put right."""
        return ()

    def evident_mistake(self) -> str:
        """What explains readings that are far from those of any machine; "" where that is not known."""
        return ""

    @abstractmethod
    def reach(self, axis: int) -> Array:
        """(n,) positions in mm at which its readings depend on an axis; empty where they do not."""

    @abstractmethod
    def start(self, noise: Noise | None = None) -> State:
        """Where the adjustment begins, as if the machine had no errors. `noise` is that of `screened`. Raises
        ConfigError and CannotCompute where the readings cannot be used."""


class State(ABC):
    """An observation within an adjustment. A frozen value; each step of the adjustment makes a new one.

    `noun` names several of them in a sentence, "" where no sentence counts them. `tally` is the sum of the
    report that it counts in; `section` is the table of the report that holds its `row`, "" for none. Readings
    are `apart` where their positions are no neighbours: a short wave at one says nothing of the next.
    """

    __slots__ = ()
    noun: ClassVar[str] = ""
    tally: ClassVar[str] = "readings"
    apart: ClassVar[bool] = False
    observation: Observation

    @property
    def section(self) -> str:
        return ""

    @property
    def component(self) -> str:
        """The ISO 230-1 name of the error that all its readings measure, "" for several errors."""
        return ""

    @property
    def label(self) -> str:
        """Its file, or its noun where it has none."""
        return self.observation.source or self.noun

    @property
    @abstractmethod
    def count(self) -> int:
        """The number of its readings, as a report counts them."""

    @abstractmethod
    def block(self, parameters: Parameters, theta: Array) -> Block:
        """Its rows of the design matrix, linearised where the errors are `theta` (size,) and its own unknowns
        as they are here. Raises ConfigError and CannotCompute."""

    def step(self, block: Block, theta: Array) -> Advance:
        """How its own unknowns change with a solution."""
        return STILL

    def slips(self, block: Block, theta: Array, settled: bool) -> Sequence[Outlier]:
        """Readings that do not fit a solution; `settled` says that all own unknowns have converged."""
        return ()

    def moved(self, step: Advance, slips: Sequence[Outlier]) -> State:
        """After a step and without the readings of `slips`."""
        return self

    def scatter(self) -> str | None:
        """A message where runs spread by more than is stated."""
        return None

    def row(self, residual: Array, chi_square: float) -> dict[str, Any]:
        """Its row of the report from its residuals and their sum of squares, with units in the keys."""
        return {}


S = TypeVar("S", bound=State)


@dataclass(frozen=True, slots=True, eq=False)
class Result(Generic[S]):
    """An observation after the fit: residuals in the order of its rows (mm or rad), and the sum of squares of
    the standardised ones. `freedom` are its degrees of freedom: its rows less what the unknowns used up."""

    state: S
    residual: Array
    chi_square: float
    freedom: float

    @classmethod
    def of(cls, state: S, block: Block, theta: Array, covariance: Array) -> Result[S]:
        """At the solution theta (size,) with its covariance."""
        residual, chi_square = residual_and_chi_square(block, theta)
        alone = Normal.of(len(theta))
        alone.add(block)
        used = float(np.einsum("ij,ji->", covariance, alone.H))
        return cls(state, residual, chi_square, max(alone.count - used - alone.free, 0.0))

    def row(self) -> dict[str, Any]:
        return self.state.row(self.residual, self.chi_square)


class Scattered(Observation):
    """Readings at positions all over the volume: `axis_mm` (n, 3) axis positions, `tool_mm` (n, 3) the
    vectors to the reflector. The search for a smooth field beside the curves uses these."""

    __slots__ = ()
    axis_mm: Array
    tool_mm: Array

    def reach(self, axis: int) -> Array:
        return np.asarray(self.axis_mm[:, axis])

    def swapped(self) -> Iterator[Alternative]:
        """Swapped columns of axis positions or tool vectors, and tool vectors with the other sign."""
        for pair in (0, 1), (0, 2), (1, 2):
            order = [0, 1, 2]
            order[pair[0]], order[pair[1]] = pair[1], pair[0]
            letters = f"{AXES[pair[0]]} and {AXES[pair[1]]}"
            for name, what in (("axis_mm", "axis positions"), ("tool_mm", "tool vectors")):
                other = dataclasses.replace(self, **{name: getattr(self, name)[:, order]})  # type: ignore[type-var]
                yield Alternative("columns", f"{letters} of its {what} are swapped", other, where_off=True)
        turned = dataclasses.replace(self, tool_mm=-self.tool_mm)  # type: ignore[type-var]
        yield Alternative("tool", "its tool vectors have the other sign", turned, where_off=True)

    @abstractmethod
    def start(self, noise: Noise | None = None) -> ScatteredState: ...


class ScatteredState(State):
    """Scattered readings within an adjustment."""

    __slots__ = ()
    apart = True
    observation: Scattered

    @property
    def count(self) -> int:
        return len(self.observation.axis_mm)

    @abstractmethod
    def block(self, parameters: Unknowns, theta: Array) -> Block: ...

    @abstractmethod
    def spread_over_rows(self, numbers: Index) -> Index:
        """A number of each point (n,), from 1, as that of each row of the block; 0 for rows of no point."""

    def positions(self) -> Array:
        """(rows, 3) the axis position of each row; rows of no point have that of the first one."""
        numbers = self.spread_over_rows(np.arange(1, self.count + 1))
        return np.asarray(self.observation.axis_mm[np.maximum(numbers - 1, 0)])


T = TypeVar("T", bound=Scattered)


def residual_and_chi_square(block: Block, theta: Array) -> tuple[Array, float]:
    """Residuals of a block and the sum of squares of the standardised ones."""
    _, residual, standardised = residuals_of(block, theta)
    return residual, float(np.sum(standardised**2))


def slips_of(block: Block, theta: Array, source: str, rows: Index, word: str) -> list[Outlier]:
    """Points whose residual is larger than noise, the worst ones first; `rows` (n,) are their lines in the
    file, and the block has as many rows for each."""
    _, residual, standardised = residuals_of(block, theta)
    rest = residual.reshape(len(rows), -1)
    off = np.abs(standardised).reshape(rest.shape).max(axis=1)
    worst = np.argsort(-off)[: max(1, int(SHARE * len(off)))]
    return [
        Outlier(source, int(rows[k]), word, float(np.linalg.norm(rest[k])), float(off[k]))
        for k in worst.tolist()
        if off[k] > OUTLIER and off[k] > 0.3 * off.max()
    ]


def without(cloud: T, rows: Index, slips: Sequence[Outlier]) -> T:
    """The points whose lines `rows` (n,) are not those of slips."""
    use = ~np.isin(rows, [slip.row for slip in slips])
    columns = {f.name: getattr(cloud, f.name) for f in dataclasses.fields(cloud)}  # type: ignore[arg-type]
    kept = {
        name: column[use]
        for name, column in columns.items()
        if isinstance(column, np.ndarray) and len(column) == len(use)
    }
    return dataclasses.replace(cloud, **kept)  # type: ignore[type-var]


def scatter_words(label: str, noise: Noise, sigma: float, unit: str, scale: float) -> str | None:
    """A message where runs spread by more than the stated `sigma`; `scale` converts to `unit`."""
    if noise.spread is None or sigma <= 0.0 or noise.spread <= SCATTER * sigma:
        return None
    return (
        f"{label}: runs spread by {noise.spread * scale:.2g} {unit}, sigma is stated as "
        f"{sigma * scale:.2g} {unit}"
    )


def unit_of(name: str) -> tuple[str, float]:
    """The unit in which a report shows a component, and the factor to it."""
    return ("urad", 1.0 / RAD_PER_URAD) if name[1] in "ABC" else ("um", UM_PER_MM)


def rms(residual: Array) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def correlation_factor(product: float, square: float) -> float:
    """Factor on the uncertainty of a mean because neighbouring residuals are alike: sqrt((1 + r) / (1 - r)).
    The autocorrelation r of the first order is from the sums of products of neighbours and of squares."""
    correlation = min(max(product / square, 0.0), 0.99) if square > 0.0 else 0.0
    return float(np.sqrt((1.0 + correlation) / (1.0 - correlation)))
