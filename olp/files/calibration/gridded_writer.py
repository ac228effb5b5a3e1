"""The text of deviation maps, of errors by load, and of beams, as a calibration file and its CSV files hold
them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product

from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.units import AXES
from olp.errormodel.beams import Beam
from olp.errormodel.gridded import ComponentTable, DeviationMap
from olp.files.toml_text import toml_lines

#: The text of a number of base units in a unit of ten to a power.
InUnit = Callable[[float, int], str]


def map_lines(described: DeviationMap, name: str) -> Iterator[str]:
    """The table [[maps]] with its file."""
    yield from ("", "[[maps]]")
    yield from toml_lines(
        {
            "file": name,
            "kind": described.kind,
            "tool_mm": [float(v) for v in described.tool_mm],
            "interpolation": described.interpolation,
            "holds_along": list(described.holds_along) or None,
        }
    )


def map_csv(described: DeviationMap, in_unit: InUnit) -> str:
    """X_mm, Y_mm, Z_mm, DX_um, DY_um, DZ_um, and the sigma columns where there are some."""
    columns = {f"D{axis}_um": described.values[..., i] for i, axis in enumerate(AXES)}
    if described.sigma is not None:
        columns |= {f"sigma_D{axis}_um": described.sigma[..., i] for i, axis in enumerate(AXES)}
    return _csv(AXES, described.knots_mm, columns, -3, in_unit)


def compliance_lines(table: ComponentTable, name: str) -> Iterator[str]:
    """The table [[compliance]] with its file."""
    yield from ("", "[[compliance]]")
    yield from toml_lines(
        {
            "file": name,
            "line_mm": _line(table.line_mm, table.axis),
            "tool_mm": [float(v) for v in table.tool_mm],
            "reference": None if table.reference == "functional-point" else table.reference,
            "interpolation": table.interpolation,
        }
    )


def compliance_csv(table: ComponentTable, in_unit: InUnit) -> str:
    """Positions, then columns per kg."""
    parts = [
        _csv(
            table.arguments,
            table.knots_mm,
            {
                f"{name}_{unit}_kg": values
                for name, values in table.columns.items()
                if (name[1] in AXES) == (unit == "um")
            },
            power,
            in_unit,
        )
        for unit, power in (("um", -3), ("urad", -6))
    ]
    count = len(table.arguments)
    first, second = (part.splitlines() for part in parts)
    rows = [",".join([*a.split(","), *b.split(",")[count:]]) for a, b in zip(first, second, strict=True)]
    return "\n".join(rows) + "\n"


def beam_lines(beam: Beam) -> Iterator[str]:
    """The table [[compliance_beam]]."""
    yield from ("", "[[compliance_beam]]")
    yield from toml_lines(
        {
            "axis": beam.axis,
            "support": beam.support,
            "span_mm": [float(v) for v in beam.span_mm],
            "youngs_modulus_GPa": beam.youngs_modulus_GPa,
            "second_moment_mm4": beam.second_moment_mm4,
            "direction": beam.direction,
            "line_mm": _line(beam.line_mm, beam.axis),
            "tool_mm": [float(v) for v in beam.tool_mm],
        }
    )


def _line(line_mm: Vector | None, axis: str) -> dict[str, float] | None:
    if line_mm is None:
        return None
    return {a: float(v) for a, v in zip(AXES, line_mm, strict=True) if a != axis}


def _csv(
    arguments: Sequence[str],
    knots: Sequence[Array],
    columns: Mapping[str, Array],
    power: int,
    in_unit: InUnit,
) -> str:
    rows = [",".join([*(f"{a}_mm" for a in arguments), *columns])]
    levels = [[in_unit(v, 0) for v in k.tolist()] for k in knots]
    cells = [[in_unit(v, power) for v in values.ravel().tolist()] for values in columns.values()]
    for number, place in enumerate(product(*levels)):
        rows.append(",".join([*place, *(column[number] for column in cells)]))
    return "\n".join(rows) + "\n"
