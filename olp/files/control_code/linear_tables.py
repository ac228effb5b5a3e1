"""The tables of a machine with three linear axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.grid_interpolation import Grid, Line
from olp.core.units import AXES
from olp.errormodel.bodies import Body
from olp.errormodel.components import ActingTerm, AxisColumns
from olp.errormodel.lever_arms import DIRECTIONS, LeverArms
from olp.files.control_code.carried import Carried, Expansion, Table
from olp.files.control_code.tables import NONE, Data, curve, defines, pair, real, triple


def linear_tables(kept: Carried) -> list[str]:
    """The lines that define all tables of a model."""
    data = Data()
    bodies = [_body(data, b, c) for b, c in zip(kept.bodies, kept.columns, strict=True)]
    data.array("olp_body_list", "olp_body", bodies)
    data.array("olp_table_list", "olp_table", [_table(data, t) for t in kept.tables])
    maps = [f"&{_grid(data, grid, (0, 1, 2))}" for grid in kept.maps]
    data.array("olp_map_list", "olp_grid *", maps)
    data.array("olp_expansion_list", "olp_expansion", [_expansion(e) for e in kept.expansions])
    box = ", ".join(pair(row) for row in np.asarray(kept.model.box_mm, float).tolist())
    directed = {b.axis for b, c in zip(kept.bodies, kept.columns, strict=True) if _directed(b, c)}
    return [
        defines(_sizes(kept)),
        *data.lines,
        f"static const double olp_box[3][2] = {{{box}}};",
        f"static const int olp_directed[3] = {{{', '.join(str(int(j in directed)) for j in range(3))}}};",
    ]


def _sizes(kept: Carried) -> dict[str, int]:
    return {
        "OLP_BODIES": len(kept.bodies),
        "OLP_TABLES": len(kept.tables),
        "OLP_MAPS": len(kept.maps),
        "OLP_EXPANSIONS": len(kept.expansions),
        "OLP_SENSORS": len(kept.sensors),
        "OLP_EXACT": int(kept.rigid.exact),
        "OLP_TOOL_TERMS": int(kept.rigid.tool_terms),
    }


def _directed(body: Body, columns: AxisColumns) -> bool:
    """Whether errors of the axis depend on its direction."""
    return body.components.backlash_mm != 0.0 or any(s is not None for s in columns.slots("half"))


def _body(data: Data, body: Body, columns: AxisColumns) -> str:
    parts = [NONE, NONE, NONE]
    if columns.interpolants:
        knots = columns.knots()
        parts = [str(len(knots)), data.numbers(knots), data.integers(_pieces(body, knots))]
    mean, half = (_six(data, columns, key) for key in ("mean", "half"))
    waves = [_wave(data, acting) for acting in body.components.cyclic]
    wave = NONE
    if waves:
        wave = f"olp_waves_{AXES[body.axis]}"
        data.array(wave, "olp_wave", waves)
    return (
        f"{{{body.axis}, {int(body.carries_workpiece)}, {body.sine_terms}, {triple(body.shear)}, "
        f"{real(body.datum_mm)}, {real(body.components.backlash_mm)},\n     {', '.join(parts)},\n"
        f"     {mean}, {half},\n     {len(waves)}, {wave},\n     {_arms(body.lever_arms)}}}"
    )


def _pieces(body: Body, knots: Array) -> list[int]:
    """Into how many chords the model cuts each piece of a curve."""
    table = body.components.table
    if table.nodes is None:
        return [max(1, round(float(width) / table.step)) for width in np.diff(knots)]
    places = np.searchsorted(table.nodes, knots)
    return [int(n) for n in np.diff(places)]


def _six(data: Data, columns: AxisColumns, key: str) -> str:
    names = []
    for slot in columns.slots(key):
        if slot is None:
            names.append(NONE)
            continue
        which, column = columns.of_column[slot]
        names.append(f"&{curve(data, columns.interpolants[which], column)}")
    return f"{{{', '.join(names)}}}"


def _wave(data: Data, acting: ActingTerm) -> str:
    term = acting.term
    lists = [NONE] * 3
    if acting.moved:
        rows, constants, slopes = zip(*acting.moved, strict=True)
        lists = [data.integers(rows), data.numbers(constants), data.numbers(slopes)]
    numbers = [real(v) for v in (term.amplitude, 2.0 * np.pi / term.period_mm, term.phase_rad)]
    component = DIRECTIONS.index(term.component[1])
    return f"{{{component}, {', '.join(numbers)}, {len(acting.moved)}, {', '.join(lists)}}}"


def _arms(lever_arms: LeverArms) -> str:
    by_row = {row: arm for rows, arm in lever_arms for row in rows}
    arms = (f"{{{triple(map(float, by_row[i].moves))}, {triple(by_row[i].offset_mm)}}}" for i in range(3))
    return f"{{{', '.join(arms)}}}"


def _line(data: Data, line: Line) -> str:
    powers, window = line.weights.shape[1:]
    lists = [data.numbers(line.knots), data.numbers(line.weights), data.integers(line.first.tolist())]
    return data.one("olp_line", f"{{{len(line.knots)}, {window}, {powers}, {', '.join(lists)}}}")


def _grid(data: Data, grid: Grid, axes: Sequence[int]) -> str:
    lines = [f"&{_line(data, line)}" for line in grid.lines]
    fill = [NONE] * (3 - len(lines))
    arguments = ", ".join([*map(str, axes), *fill])
    values = data.numbers(grid.values)
    head = f"{len(lines)}, {grid.values.shape[-1]}, {{{arguments}}}"
    return data.one("olp_grid", f"{{{head}, {{{', '.join([*lines, *fill])}}}, {values}}}")


def _table(data: Data, table: Table) -> str:
    grid = _grid(data, table.body.grid, table.body.axes)
    columns = ", ".join("-1" if c is None else str(c) for c in table.body.column)
    sensor = -1 if table.sensor is None else table.sensor
    numbers = ", ".join(real(v) for v in (table.zero, table.low, table.high))
    return f"{{&{grid}, {{{columns}}}, {_arms(table.lever_arms)}, {sensor}, {numbers}}}"


def _expansion(one: Expansion) -> str:
    numbers = ", ".join(real(v) for v in (one.per_K, one.zero_degC, one.fixed_mm))
    return f"{{{one.axis}, {one.sensor}, {int(one.of_tip)}, {numbers}}}"
