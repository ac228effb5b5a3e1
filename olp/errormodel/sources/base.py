"""What an error source is: all that `olp` knows of one kind of error of a machine, in one file.

A source is registered in `registry`; nothing else names it. It holds the values of the error and its keys in
calibration.toml, how it is read and written, its model and its uncertainty. It also holds its lines in
`olp inspect` and in the fingerprint. It opens no file: what its tables name comes through `Reading`, and what
it writes goes through `Writing`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.schema import Position, Table
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.entry import Entry, Numbers
from olp.errormodel.gridded import ComponentTable

#: The tables of a source in calibration.toml, and its values.
Stated = TypeVar("Stated")
Values = TypeVar("Values")
T = TypeVar("T", bound=Table)
F = TypeVar("F", bound="NamesFile")
V = TypeVar("V")
#: The type of a key of calibration.toml, and its `Field`.
Schema = tuple[Any, Any]
#: Standard uncertainties in mm or rad by name: of a component at each position, or one number.
Sigmas = Mapping[str, Array | float]


class NamesFile(Protocol):
    """A table of calibration.toml that names a file beside it."""

    @property
    def file(self) -> str: ...


class CurveColumns(Protocol):
    """A CSV file of component errors along one axis: (n,) positions in mm, and (n,) errors and standard
    uncertainties by ISO 230-1 name in mm or rad. `forward` and `backward` are None without a direction
    column."""

    @property
    def axis(self) -> str: ...
    @property
    def position_mm(self) -> Array: ...
    @property
    def columns(self) -> Mapping[str, Array]: ...
    @property
    def forward(self) -> Mapping[str, Array] | None: ...
    @property
    def backward(self) -> Mapping[str, Array] | None: ...
    @property
    def sigma(self) -> Mapping[str, Array]: ...


class GridColumns(Protocol):
    """A CSV file over a grid of axis positions: `arguments` such as ("Y", "Z") with their ascending levels in
    mm, and columns by name, each of the shape of the grid, in mm or rad."""

    @property
    def arguments(self) -> tuple[str, ...]: ...
    @property
    def knots_mm(self) -> tuple[Array, ...]: ...
    @property
    def columns(self) -> Mapping[str, Array]: ...


class Reading(Protocol):
    """What a source learns from the calibration file beside its own tables. The methods raise ConfigError
    where a file is wrong and InputError where it cannot be read. `each` and `one` gather both, so that all
    problems are reported at once."""

    @property
    def machine(self) -> str: ...
    @property
    def datum_mm(self) -> Vector: ...
    @property
    def temperature_degC(self) -> float: ...
    @property
    def temperatures_degC(self) -> Mapping[str, float]: ...
    def each(self, key: str, tables: Sequence[F], make: Callable[[F], V]) -> tuple[V, ...]:
        """What the tables [[key]] and their files hold."""
        ...

    def one(self, key: tuple[str, ...], file: str, make: Callable[[str], V]) -> V | None:
        """What the file that a key names holds; None where it is wrong."""
        ...

    def content(self, file: str) -> bytes: ...
    def curve(self, file: str) -> CurveColumns: ...
    def deviations(self, file: str) -> GridColumns:
        """Columns DX, DY, DZ, and sigma_DX .. where they are stated."""
        ...

    def components(self, file: str) -> GridColumns:
        """Component errors per kg, by ISO 230-1 name."""
        ...

    def document(self, file: str, schema: type[T]) -> T:
        """A TOML file of this machine, by its schema."""
        ...


class Writing(Protocol):
    """Where a source writes: tables of calibration.toml, and files beside it."""

    @property
    def machine(self) -> str: ...
    def sigma(self, component: str) -> Array | None:
        """(n,) standard uncertainties of a component in mm or rad, where the caller states them."""
        ...

    def table(self, header: str, values: Mapping[str, object]) -> None:
        """A table such as "[[curves]]"; keys whose value is None are left out."""
        ...

    def find(self, header: str) -> dict[str, object] | None:
        """The last table of this name, for a key that another source adds."""
        ...

    def csv(self, what: str, text: str) -> str:
        """A file `<stem>-<what>.csv`, or one of the next free number; returns its name."""
        ...

    def document(self, what: str, tables: Iterable[tuple[str, Mapping[str, object]]]) -> str:
        """A file `<stem>-<what>.toml` of tables, the first without a header; returns its name."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """What a model needs: the chain such as "FXYZ", (3, 2) calibrated axis positions, whether it holds at
    their faces, and the state of the machine while measuring. `loads` are errors per kg that are bodies of
    their own, such as those of beams."""

    chain: str
    datum_mm: Vector
    box_mm: Array
    hold: bool
    payload_kg: float
    tool_terms: bool
    loads: tuple[ComponentTable, ...] = ()


@dataclass(frozen=True, slots=True)
class Example:
    """Tables of calibration.toml, the files that they name, and temperatures of sensors that a job states."""

    tables: str
    files: Mapping[str, str] = field(default_factory=dict)
    sensors_degC: Mapping[str, float] = field(default_factory=dict)


class ErrorSource(Generic[Stated, Values]):
    """One kind of error. A method that a source leaves out does nothing.

    `key` is its key in calibration.toml and `schema` that key's type and `Field`; `field` the field of
    `Calibration` that holds its values, "" for `Calibration.more`. `correctable` is False for a random error:
    it has no model. `covered` is False where no covariance holds its numbers. Then they are no part of the
    fingerprint, and a covariance holds whatever their values are. `numbers` are the kinds of numbers that a
    covariance may hold of it.
    """

    key: str
    field: str = ""
    schema: Schema | None = None
    correctable: bool = True
    covered: bool = True
    numbers: tuple[Numbers, ...] = ()

    def example(self, by: float) -> Example:
        """What it looks like on a machine with axes X 0 to 400, Y 0 to 300 and Z -200 to 0 mm, with `by`
        times the error, 0 or above. A standard uncertainty that it states is a tenth of the value."""
        raise NotImplementedError

    def stated(self, file: Any) -> Stated:
        """Its tables in a file that has been read."""
        tables: Stated = getattr(file, self.key)
        return tables

    def named(self, values: Mapping[str, Any]) -> list[str]:
        """The files that it names, in a file as TOML gives it."""
        return []

    def read(self, stated: Stated, reading: Reading) -> Values:
        """Its values, from its tables. Raises ConfigError, InputError."""
        raise NotImplementedError

    def write(self, values: Values, writing: Writing) -> None:
        """Its tables and files, so that they read back the same. Raises ConfigError."""
        raise NotImplementedError

    def problems(self, values: Values, box_mm: Array) -> list[str]:
        """What is wrong with values in a box of calibrated axis positions (3, 2), one sentence each."""
        return []

    def loads(self, values: Values, frame: Frame) -> list[ComponentTable]:
        """Errors per kg that are bodies of their own: the model of `compliance` evaluates them."""
        return []

    def models(self, values: Values, frame: Frame) -> list[ErrorModel]:
        """Models that add to that of the bodies (`olp.errormodel.bodies`), which the curves, squareness,
        backlash and cyclic terms make together. Raises ConfigError."""
        return []

    def sigmas(self, stated: Stated, reading: Reading) -> Sigmas:
        """The standard uncertainties that its tables and files state."""
        return {}

    def entries(self, values: Values, sigmas: Sigmas) -> list[Entry]:
        """The same as numbers of a covariance that are independent of each other."""
        return []

    def fingerprint(self, values: Values, datum_mm: Vector) -> Iterator[str]:
        """Lines that change with every number that a covariance may hold."""
        return iter(())

    def inspect(self, values: Values, frame: Frame) -> dict[str, Any]:
        """What `olp inspect` shows, with units in the keys; lists of several sources add."""
        return {}

    def inspect_axis(self, values: Values, axis: str) -> dict[str, Any]:
        """What it shows beside the limits of an axis."""
        return {}


def digits(values: object) -> str:
    """Numbers for a fingerprint, to nine digits behind the point."""
    return " ".join(f"{value + 0.0:.9e}" for value in np.atleast_1d(np.asarray(values, float)).tolist())


def vector(values: Sequence[float]) -> Vector:
    x, y, z = values
    return (x, y, z)


def line_at(stated: Position, datum_mm: Vector) -> Vector:
    """The positions of the other axes; an axis left out was at the datum."""
    positions = zip(stated.values, datum_mm, strict=True)
    return vector([datum if position is None else position for position, datum in positions])


def line_key(line_mm: Vector | None, axis: str = "") -> dict[str, float] | None:
    """The key line_mm of a table: the positions of the axes other than `axis`, by whose position it is
    tabled."""
    if line_mm is None:
        return None
    return {a: float(v) for a, v in zip(AXES, line_mm, strict=True) if a != axis}


def floats(values: Sequence[float]) -> list[float]:
    return [float(value) for value in values]


def files_of_tables(values: Mapping[str, Any], key: str) -> list[str]:
    """The files that the tables [[key]] name."""
    return [table["file"] for table in values.get(key, ())]
