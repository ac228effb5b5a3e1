"""CSV tables over a grid of axis positions: deviation maps, and component errors per kg."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.machine import COMPONENTS
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.files.columns import Row, names, read_sheet
from olp.files.fields import nearest
from olp.files.problems import Problem, config_error
from olp.files.tables import unit_columns
from olp.files.write import PathLike, Reader, read_bytes

#: The errors of a deviation map.
MAP_COLUMNS = ("DX_um", "DY_um", "DZ_um")
SIGMA_COLUMNS = tuple(f"sigma_{name}" for name in MAP_COLUMNS)
#: In mm: positions this close are one level.
LEVEL_MM = 1e-6
#: Missing nodes that are named one by one; further ones are counted.
_NAMED = 6


@dataclass(frozen=True, slots=True, eq=False)
class GridTable:
    """`arguments` such as ("Y", "Z") with their ascending levels `knots_mm`, and the columns by name, each of
    the shape of the grid, in mm or rad."""

    arguments: tuple[str, ...]
    knots_mm: tuple[Array, ...]
    columns: Mapping[str, Array]


def read_map(path: PathLike, read: Reader = read_bytes) -> GridTable:
    """Read a deviation map: `X_mm, Y_mm, Z_mm, DX_um, DY_um, DZ_um`, one row per node in any order. Standard
    uncertainties `sigma_DX_um, sigma_DY_um, sigma_DZ_um` are optional.

    The columns DX, sigma_DX ... of the result are in mm. Raises InputError where the file cannot be read,
    ConfigError with every problem and its line.
    """
    table = _parse(read(path), str(path), _map_problems)
    return GridTable(
        table.arguments, table.knots_mm, {n.removesuffix("_um"): v for n, v in table.columns.items()}
    )


def read_component_grid(path: PathLike, read: Reader = read_bytes) -> GridTable:
    """Read component errors of one axis per kg: one to three columns of axis positions (`Y_mm`, `Z_mm`), then
    `EZY_um_kg`, `EAY_urad_kg` and similar.

    The columns of the result are in mm/kg and rad/kg by ISO 230-1 name. Raises as `read_map`.
    """
    table = _parse(read(path), str(path), _component_problems)
    return GridTable(table.arguments, table.knots_mm, {n[:3]: v for n, v in table.columns.items()})


def _parse(data: bytes, file: str, problems_of: Callable[[int, Sequence[str]], list[Problem]]) -> GridTable:
    wanted = unit_columns("holds no header; expected columns such as X_mm", problems_of)
    sheet = read_sheet(data, file, wanted)
    header, rows = sheet.header, sheet.rows
    if sheet.problems or not rows:
        nothing = (sheet.line, "no rows follow the header; expected one row per node")
        raise config_error(sheet.problems or [nothing], file)
    arguments = tuple(name[0] for name in header if name in _POSITIONS)
    position_mm = np.array([[row[header.index(f"{a}_mm")] for a in arguments] for _, row in rows])
    knots, index = _levels(position_mm)
    problems = _node_problems(arguments, knots, index, rows)
    if problems:
        raise config_error(problems, file)
    shape = tuple(len(k) for k in knots)
    columns = {}
    for column, name in enumerate(header):
        if name not in _POSITIONS:
            values = np.empty(shape)
            values[tuple(index.T)] = [row[column] for _, row in rows]
            columns[name] = values
    return GridTable(arguments, knots, columns)


_POSITIONS = tuple(f"{axis}_mm" for axis in AXES)


def _map_problems(line: int, header: Sequence[str]) -> list[Problem]:
    known = (*_POSITIONS, *MAP_COLUMNS)
    problems = _header_problems(line, header, (*known, *SIGMA_COLUMNS))
    missing = [name for name in known if name not in header]
    sigmas = [name for name in SIGMA_COLUMNS if name in header]
    if sigmas and len(sigmas) < 3:
        missing += [name for name in SIGMA_COLUMNS if name not in header]
        known = (*known, *SIGMA_COLUMNS)
    if not problems and missing:
        problems.append(
            (line, f"there is no column {', '.join(missing)}; expected {', '.join(known)}, one row per node")
        )
    return problems


def _component_problems(line: int, header: Sequence[str]) -> list[Problem]:
    known = [*_POSITIONS, *(f"{n}_um_kg" if n[1] in AXES else f"{n}_urad_kg" for n in COMPONENTS)]
    problems = _header_problems(line, header, known)
    if problems:
        return problems
    if header[0] not in _POSITIONS:
        return [(line, f'column 1 is "{header[0]}"; expected X_mm, Y_mm or Z_mm, the position of an axis')]
    axes = sorted({name[2] for name in header if name not in _POSITIONS})
    if not axes:
        problems.append((line, "there is no error column; expected one such as EZX_um_kg or EBX_urad_kg"))
    if len(axes) > 1:
        problems.append(
            (line, f"errors of the axes {' and '.join(axes)}; expected those of one axis: one file per axis")
        )
    return problems


def _header_problems(line: int, header: Sequence[str], known: Sequence[str]) -> list[Problem]:
    def wrong(_: int, name: str) -> str | None:
        if name in known:
            return None
        near = nearest(name, [n for n in known if n not in header])
        return f"did you mean {near}?" if near else f"expected one of {', '.join(known[:6])} ..."

    return names(line, header, wrong)


def _levels(position_mm: Array) -> tuple[tuple[Array, ...], Index]:
    """Ascending levels along each argument, and the (rows, arguments) number of each row's level."""
    knots = []
    index = np.zeros(position_mm.shape, np.int64)
    for k in range(position_mm.shape[1]):
        values = np.unique(position_mm[:, k])
        first = np.concatenate([[True], np.diff(values) > LEVEL_MM])
        knots.append(values[first])
        index[:, k] = (np.cumsum(first) - 1)[np.searchsorted(values, position_mm[:, k])]
    return tuple(knots), index


def _node_problems(
    arguments: Sequence[str], knots: Sequence[Array], index: Index, rows: Sequence[Row]
) -> list[Problem]:
    shape = tuple(len(k) for k in knots)
    flat = np.ravel_multi_index(tuple(index.T), shape)
    problems: list[Problem] = []

    def node(number: int) -> str:
        levels = np.unravel_index(number, shape)
        return ", ".join(f"{a} = {k[int(i)]:g}" for a, k, i in zip(arguments, knots, levels, strict=True))

    first: dict[int, int] = {}
    for (line, _), number in zip(rows, flat.tolist(), strict=True):
        if number in first:
            problems.append(
                (line, f"the node {node(number)} mm is in line {first[number]} already; expected it once")
            )
        first.setdefault(number, line)
    missing = np.setdiff1d(np.arange(int(np.prod(shape))), flat)
    if not missing.size:
        return problems
    size = " x ".join(map(str, shape))
    stray = _stray(arguments, knots, index, rows)
    if stray:
        return [*problems, *stray]
    for number in missing[:_NAMED].tolist():
        beside = flat[np.argmin(np.abs(flat - number))]
        problems.append(
            (
                first[int(beside)],
                f"the node {node(number)} mm is missing beside this one; expected one row per node "
                f"of the {size} grid",
            )
        )
    if len(missing) > _NAMED:
        problems.append((None, f"{len(missing)} of the {size} nodes are missing; expected one row per node"))
    return problems


def _stray(
    arguments: Sequence[str], knots: Sequence[Array], index: Index, rows: Sequence[Row]
) -> list[Problem]:
    """Rows at a level that few others share: they are not on a grid."""
    problems: list[Problem] = []
    for k, axis in enumerate(arguments):
        counts = np.bincount(index[:, k])
        usual = int(np.bincount(counts).argmax())
        rare = np.flatnonzero(2 * counts <= usual)
        if usual == 1 and len(rows) > 1 and len(counts) == len(rows) and len(arguments) > 1:
            problems.append((rows[0][0], f"every row has another {axis}_mm; expected positions on a grid"))
            continue
        for level in rare.tolist():
            line = rows[int(np.flatnonzero(index[:, k] == level)[0])][0]
            problems.append(
                (
                    line,
                    f"{axis}_mm = {knots[k][level]:g} is in {counts[level]} rows and other levels are in "
                    f"{usual}, so it is not on a grid; expected one row per combination of levels",
                )
            )
    return problems
