"""The judge's error model: exact homogeneous matrix products along the chain, one 4x4 matrix a body.

Written from the contract's definitions. Going from the workpiece to the tool, a body of axis j maps
coordinates on its tool side to coordinates on its workpiece side,

    axis after F (carries the tool):       T(q + E) R(eps)
    axis before F (carries the workpiece): T(E) R(eps) T(q)

with q counted from the datum, R = Rz Ry Rx, and E reduced from the measured line to the body's own
origin, E = curve - (R - 1) L_line. error = product applied to the tool vector - (q + tool vector).
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

AXES = "XYZ"
CHUNK = 50_000
COMPONENTS = tuple(f"E{d}{a}" for a in AXES for d in "XYZABC")


def _rotation(angles: np.ndarray) -> np.ndarray:
    """(n, 3, 3) Rz Ry Rx of angles (n, 3) about X, Y, Z."""
    (sa, sb, sc), (ca, cb, cc) = np.sin(angles).T, np.cos(angles).T
    one, nil = np.ones(len(angles)), np.zeros(len(angles))

    def matrix(*entries: np.ndarray) -> np.ndarray:
        return np.stack(entries, axis=-1).reshape(-1, 3, 3)

    rx = matrix(one, nil, nil, nil, ca, -sa, nil, sa, ca)
    ry = matrix(cb, nil, sb, nil, one, nil, -sb, nil, cb)
    rz = matrix(cc, -sc, nil, sc, cc, nil, nil, nil, one)
    return np.asarray(rz @ ry @ rx)


def _homogeneous(rotation: np.ndarray | None, shift: np.ndarray) -> np.ndarray:
    matrices = np.tile(np.eye(4), (len(shift), 1, 1))
    if rotation is not None:
        matrices[:, :3, :3] = rotation
    matrices[:, :3, 3] = shift
    return matrices


@dataclass(frozen=True)
class _Table:
    """One column of a curve file, in + and in - direction: the same function without a direction column."""

    forward: Callable[[np.ndarray], np.ndarray]
    backward: Callable[[np.ndarray], np.ndarray]

    def both(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values in + and in - direction at q, held beyond the ends of the table."""
        forward = self.forward(q)
        return forward, forward if self.backward is self.forward else self.backward(q)


def _interpolator(knots: np.ndarray, values: np.ndarray, pchip: bool) -> Callable[[np.ndarray], np.ndarray]:
    if pchip and len(knots) > 1:
        smooth = PchipInterpolator(knots, values)
        return lambda q: np.asarray(smooth(np.clip(q, knots[0], knots[-1])))
    return lambda q: np.interp(q, knots, values)


@dataclass(frozen=True)
class _CurveFile:
    axis: int
    tables: dict[str, _Table]
    directed: bool
    line_mm: np.ndarray
    tool_mm: np.ndarray
    on_table: bool


def _read_curve(folder: Path, entry: dict[str, Any], datum: np.ndarray) -> _CurveFile:
    _only(entry, {"file", "line_mm", "tool_mm", "interpolation", "reference"}, "curves")
    with (folder / entry["file"]).open(newline="") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.lstrip().startswith("#")))
    columns = {name.strip(): np.array([float(row[name]) for row in rows]) for name in rows[0]}
    (argument,) = [name for name in columns if name.endswith("_mm")]
    axis, q = AXES.index(argument[0]), columns[argument]
    directed = "direction" in columns
    picks = [columns["direction"] > 0, columns["direction"] < 0] if directed else [np.ones(len(q), bool)]
    orders = [np.flatnonzero(pick)[np.argsort(q[pick])] for pick in picks]
    tables = {}
    for name, values in columns.items():
        if name in (argument, "direction") or name.startswith("sigma_"):
            continue
        component, unit = name.split("_")
        if component not in COMPONENTS or component[2] != AXES[axis] or unit not in ("um", "urad"):
            raise NotImplementedError(f"column {name} in {entry['file']}")
        scale = 1e-3 if unit == "um" else 1e-6
        pchip = entry.get("interpolation", "pchip") == "pchip"
        ways = [_interpolator(q[order], scale * values[order], pchip) for order in orders]
        tables[component] = _Table(ways[0], ways[-1])
    line = datum.copy()
    for name, value in entry.get("line_mm", {}).items():
        line[AXES.index(name)] = value
    return _CurveFile(
        axis,
        tables,
        directed,
        line - datum,
        np.array(entry.get("tool_mm", (0.0, 0.0, 0.0)), float),
        entry.get("reference") == "table",
    )


@dataclass(frozen=True)
class _LoadFile:
    """Errors per kg of one axis over the positions of `arguments`, linear between nodes."""

    axis: int
    arguments: list[int]
    tables: dict[str, RegularGridInterpolator]
    line_mm: np.ndarray
    tool_mm: np.ndarray
    on_table: bool


def _read_nodes(path: Path) -> tuple[list[int], list[np.ndarray], dict[str, np.ndarray]]:
    """Arguments, their levels, and the other columns as arrays over the grid."""
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.lstrip().startswith("#")))
    arguments = [AXES.index(n[0]) for n in rows[0] if n in ("X_mm", "Y_mm", "Z_mm")]
    levels = [np.array(sorted({float(row[f"{AXES[a]}_mm"]) for row in rows})) for a in arguments]
    columns = {n: np.full([len(x) for x in levels], np.nan) for n in rows[0] if not n.endswith("_mm")}
    for row in rows:
        place = tuple(
            int(np.searchsorted(x, float(row[f"{AXES[a]}_mm"])))
            for a, x in zip(arguments, levels, strict=True)
        )
        for name, values in columns.items():
            values[place] = float(row[name])
    return arguments, levels, columns


def _read_load(folder: Path, entry: dict[str, Any], datum: np.ndarray) -> _LoadFile:
    _only(entry, {"file", "line_mm", "tool_mm", "interpolation", "reference"}, "compliance")
    if entry.get("interpolation") != "linear":
        raise NotImplementedError("the judge knows linear tables of load")
    arguments, levels, columns = _read_nodes(folder / entry["file"])
    tables = {}
    for name, values in columns.items():
        scale = 1e-3 if name.endswith("_um_kg") else 1e-6
        tables[name[:3]] = RegularGridInterpolator(
            levels, scale * values, bounds_error=False, fill_value=None
        )
    line = datum.copy()
    for name, value in entry.get("line_mm", {}).items():
        line[AXES.index(name)] = value
    tool = np.array(entry.get("tool_mm", (0.0, 0.0, 0.0)), float)
    axis = AXES.index(next(iter(tables))[2])
    return _LoadFile(axis, arguments, tables, line - datum, tool, entry.get("reference") == "table")


def _read_map(folder: Path, entry: dict[str, Any]) -> RegularGridInterpolator:
    _only(entry, {"file", "kind", "tool_mm", "interpolation"}, "maps")
    if entry.get("interpolation", "linear") != "linear":
        raise NotImplementedError("the judge knows linear maps")
    arguments, levels, columns = _read_nodes(folder / entry["file"])
    assert arguments == [0, 1, 2]
    values = np.stack([1e-3 * columns[f"D{a}_um"] for a in AXES], axis=-1)
    return RegularGridInterpolator(levels, values)


def _read_warm(folder: Path, entry: dict[str, Any]) -> list[tuple[dict[str, Any], float]]:
    _only(entry, {"structure"}, "thermal")
    file = tomllib.loads((folder / entry["structure"]).read_text())
    reference = {sensor["name"]: float(sensor["reference_degC"]) for sensor in file["sensors"]}
    for one in file["distortions"]:
        shapes = {f"{shape}_K" for shape in ("offset_um", "offset_urad", "growth_um_m", "growth_urad_m")}
        _only(one, {"component", "sensor", "span_mm"} | shapes, "distortions")
    return [(one, reference[one["sensor"]]) for one in file["distortions"]]


def _only(table: dict[str, Any], known: set[str], where: str) -> None:
    """Refuse what the judge does not model, so that it never passes a program it cannot judge."""
    unknown = set(table) - known
    if unknown:
        raise NotImplementedError(f"the judge does not model {sorted(unknown)} in {where}")


def _position(value: Any, default: np.ndarray) -> np.ndarray:
    """A point written as a list or as a table with some of the axes."""
    if isinstance(value, dict):
        return np.array([value.get(a, value.get(f"{a}_mm", default[i])) for i, a in enumerate(AXES)], float)
    return np.array(value, float)


class JudgeModel:
    """Error of one machine folder. Lengths in mm, rows X, Y, Z; error = actual - commanded."""

    def __init__(self, machine: str | Path) -> None:
        path = Path(machine)
        path = path / "machine.toml" if path.is_dir() else path
        self.machine: dict[str, Any] = tomllib.loads(path.read_text())
        cal_path = path.parent / self.machine["calibration"]
        cal: dict[str, Any] = tomllib.loads(cal_path.read_text())
        described = {"schema", "machine", "measured", "valid_until", "temperature_degC", "sign", "box_mm"}
        # how well it is known changes nothing of what it says
        described |= {"covariance", "repeatability", "quality"}
        modelled = {"model", "datum_mm", "curves", "squareness", "backlash", "cyclic"}
        _only(
            cal,
            described
            | modelled
            | {"active_during_measurement", "maps", "compliance", "payload_kg", "thermal"},
            "calibration.toml",
        )
        #: (distortion, reference) of the file of distortions, and the temperatures that hold now, by sensor
        self.warm = _read_warm(cal_path.parent, cal["thermal"]) if "thermal" in cal else []
        self.temperature_degC: dict[str, float] = {}
        self.maps = [_read_map(cal_path.parent, entry) for entry in cal.get("maps", [])]
        job_path = path.with_name("job.toml")
        job: dict[str, Any] = tomllib.loads(job_path.read_text()) if job_path.exists() else {}
        #: beyond what was on the machine while measuring
        self.load_kg = float(job.get("payload_kg", 0.0)) - float(cal.get("payload_kg", 0.0))
        self.chain: str = self.machine["chain"]
        self.first_order = cal.get("model", "rigid-body") == "huddersfield"
        if self.first_order and self.chain != "FXYZ":
            raise ValueError("the equation (1) needs the chain FXYZ")
        self.datum = np.array(cal.get("datum_mm", (0.0, 0.0, 0.0)), float)
        self.box = np.array(cal["box_mm"], float)
        self.curves = [_read_curve(cal_path.parent, entry, self.datum) for entry in cal.get("curves", [])]
        self.loads = [_read_load(cal_path.parent, entry, self.datum) for entry in cal.get("compliance", [])]
        corrected_by_control = set(self.machine.get("compensated_by_controller", []))
        self.silent = corrected_by_control - set(cal.get("active_during_measurement", []))
        squareness = cal.get("squareness", {})
        squares = {"C0Y_urad", "B0Z_urad", "A0Z_urad"}
        _only(squareness, squares | {f"sigma_{name}" for name in squares}, "squareness")
        self.square = {
            name: 0.0 if name in self.silent else 1e-6 * squareness.get(f"{name}_urad", 0.0)
            for name in ("C0Y", "B0Z", "A0Z")
        }
        self.backlash_mm = np.array([1e-3 * cal.get("backlash", {}).get(f"{a}_um", 0.0) for a in AXES])
        self.cyclic = [
            (
                entry["component"],
                float(entry["period_mm"]),
                1e-3 * entry["amplitude_um"] if "amplitude_um" in entry else 1e-6 * entry["amplitude_urad"],
                float(entry.get("phase_rad", 0.0)),
                self._cyclic_line(entry),
            )
            for entry in cal.get("cyclic", [])
        ]
        if self.silent & {entry[0] for entry in self.cyclic}:
            raise NotImplementedError("a cyclic term of a component that the control corrects")

    def _cyclic_line(self, entry: dict[str, Any]) -> _CurveFile:
        """Where a cyclic angle was measured: as it says; what it leaves out is as of the curve file of its
        axis, or at the datum without a tool where there is no file."""
        _only(
            entry,
            {"component", "period_mm", "amplitude_um", "amplitude_urad", "phase_rad"}
            | {"line_mm", "tool_mm", "reference"},
            "cyclic",
        )
        axis = AXES.index(entry["component"][2])
        files = [curve for curve in self.curves if curve.axis == axis]
        angular = entry["component"][1] in "ABC"
        if angular and len(files) > 1:
            raise NotImplementedError("a cyclic angle of an axis with several curve files")
        line = files[0].line_mm if files else np.zeros(3)
        tool = files[0].tool_mm if files else np.zeros(3)
        on_table = files[0].on_table if files else False
        if "line_mm" in entry:
            line = np.array([entry["line_mm"].get(a, self.datum[i]) for i, a in enumerate(AXES)]) - self.datum
        if "tool_mm" in entry:
            tool = np.array(entry["tool_mm"], float)
        if "reference" in entry:
            on_table = entry["reference"] == "table"
        return _CurveFile(axis, {}, False, line, tool, on_table)

    # -- the error ---------------------------------------------------------------------------------

    def error_mm(self, axis_mm: np.ndarray, tool_mm: Any, play: np.ndarray | None = None) -> np.ndarray:
        """(n, 3) error at axis positions (n, 3), tool vectors (3,) or (n, 3), play (n, 3) in [-1, 1].

        `play` is +1 where the axis last moved in + and has taken up its backlash; without it the mean
        of both directions holds. Outside the box the model is evaluated at the box face.
        """
        points = np.atleast_2d(np.asarray(axis_mm, float))
        tools = np.broadcast_to(np.asarray(tool_mm, float), points.shape)
        states = np.zeros(points.shape) if play is None else np.broadcast_to(play, points.shape)
        error = np.zeros(points.shape)
        for start in range(0, len(points), CHUNK):
            part = slice(start, start + CHUNK)
            held = np.clip(points[part], self.box[:, 0], self.box[:, 1])
            error[part] = (
                self._first_order(held, states[part])
                if self.first_order
                else self._exact(held, tools[part], states[part])
            )
            for described in self.maps:
                error[part] += described(held)
        return error

    def inside(self, axis_mm: np.ndarray) -> np.ndarray:
        """(n,) True in the calibrated box."""
        return np.asarray(np.all((axis_mm >= self.box[:, 0]) & (axis_mm <= self.box[:, 1]), axis=1))

    def command_for(self, target_mm: np.ndarray, tool_mm: Any, play: np.ndarray | None = None) -> np.ndarray:
        """(n, 3) commands c with c + error(c) = target within 1e-10 mm."""
        command = np.array(np.atleast_2d(target_mm), float)
        for _ in range(60):
            step = target_mm - command - self.error_mm(command, tool_mm, play)
            command += step
            if np.abs(step).max(initial=0.0) < 1e-10:
                return command
        raise ValueError("no command found for a target")

    def _components(
        self, axis: int, points: np.ndarray, play: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Translation (n, 3), angles (n, 3) of one axis, and the translation due to its measuring lines."""
        q = points[:, axis]
        shift, angle, tool_vector = np.zeros((len(q), 3)), np.zeros((len(q), 3)), np.zeros((len(q), 3))
        for curve in self.curves:
            if curve.axis != axis:
                continue
            own = np.zeros((len(q), 3))
            for name, table in curve.tables.items():
                if name in self.silent:
                    continue
                forward, backward = table.both(q)
                value = 0.5 * (forward + backward) + 0.5 * play * (forward - backward)
                target, column = (shift, "XYZ") if name[1] in "XYZ" else (own, "ABC")
                target[:, column.index(name[1])] += value
            angle += own
            line = self._line_arm(curve, q)
            if self.first_order:
                tool_vector -= np.cross(own, line)
            else:
                tool_vector -= np.einsum("nij,nj->ni", _rotation(own) - np.eye(3), line)
        for load in self.loads:
            if load.axis != axis:
                continue
            own = np.zeros((len(q), 3))
            for name, table in load.tables.items():
                value = self.load_kg * table(points[:, load.arguments])
                target, column = (shift, "XYZ") if name[1] in "XYZ" else (own, "ABC")
                target[:, column.index(name[1])] += value
            angle += own
            arm = self._node_arm(load, points)
            tool_vector -= np.einsum("nij,nj->ni", _rotation(own) - np.eye(3), arm)
        for distortion, reference in self.warm:
            name = distortion["component"]
            if name[2] != AXES[axis]:
                continue
            unit = "um" if name[1] in "XYZ" else "urad"
            rise = self.temperature_degC.get(distortion["sensor"], reference) - reference
            per_mm = 1e-3 * distortion.get(f"growth_{unit}_m_K", 0.0)
            shape = distortion.get(f"offset_{unit}_K", 0.0) + per_mm * (q - np.mean(distortion["span_mm"]))
            value = (1e-3 if unit == "um" else 1e-6) * rise * shape
            if unit == "um":
                shift[:, "XYZ".index(name[1])] += value
                continue
            own = np.zeros((len(q), 3))
            own[:, "ABC".index(name[1])] = value
            angle += own
            line = self._line_arm(_CurveFile(axis, {}, False, np.zeros(3), np.zeros(3), False), q)
            tool_vector -= np.einsum("nij,nj->ni", _rotation(own) - np.eye(3), line)
        for name, period, amplitude, phase, measured in self.cyclic:
            if name[2] != AXES[axis]:
                continue
            value = amplitude * np.sin(2.0 * np.pi * q / period + phase)
            if name[1] in "XYZ":
                shift[:, "XYZ".index(name[1])] += value
                continue
            own = np.zeros((len(q), 3))
            own[:, "ABC".index(name[1])] = value
            angle += own
            line = self._line_arm(measured, q)
            if self.first_order:
                tool_vector -= np.cross(own, line)
            else:
                tool_vector -= np.einsum("nij,nj->ni", _rotation(own) - np.eye(3), line)
        shift[:, axis] -= 0.5 * self.backlash_mm[axis] * play
        return shift, angle, tool_vector

    def _node_arm(self, load: _LoadFile, points: np.ndarray) -> np.ndarray:
        """(n, 3) lever arm at which the load was read: each point counts as a node of the table, so there the
        axes of the table stand as at the point, and the others on the line."""
        position = np.tile(load.line_mm, (len(points), 1))
        for argument in load.arguments:
            position[:, argument] = points[:, argument] - self.datum[argument]
        if load.on_table:
            position[:, load.axis] = 0.0
        return np.asarray(position * self._reach(load.axis) + load.tool_mm)

    def _line_arm(self, curve: _CurveFile, q: np.ndarray) -> np.ndarray:
        """(n, 3) lever arm of the measured line: tool vector + axes toward the tool (+ own axis)."""
        position = np.tile(curve.line_mm, (len(q), 1))
        position[:, curve.axis] = 0.0 if curve.on_table else q - self.datum[curve.axis]
        tool = np.zeros(3) if self.first_order else curve.tool_mm
        return np.asarray(position * self._reach(curve.axis) + tool)

    def _reach(self, axis: int) -> np.ndarray:
        """(3,) 1 for the axes in the lever arm of this one."""
        place = self.chain.index(AXES[axis])
        reach = np.array([float(self.chain.index(other) > place) for other in AXES])
        reach[axis] = float(place < self.chain.index("F"))
        return reach

    def _tilt(self, axis: int, z: np.ndarray) -> np.ndarray:
        """(n, 3) shift of a tilted axis line at the distance z from the datum."""
        slope = {
            0: (0.0, 0.0, 0.0),
            1: (-self.square["C0Y"], 0.0, 0.0),
            2: (self.square["B0Z"], -self.square["A0Z"], 0.0),
        }[axis]
        return np.outer(z, slope)

    def _exact(self, points: np.ndarray, tools: np.ndarray, play: np.ndarray) -> np.ndarray:
        product = np.tile(np.eye(4), (len(points), 1, 1))
        base = self.chain.index("F")
        for place, letter in enumerate(self.chain):
            if letter == "F":
                continue
            axis = AXES.index(letter)
            shift, angle, tool_vector = self._components(axis, points, play[:, axis])
            own = points[:, axis] - self.datum[axis]
            travel = np.zeros(points.shape)
            travel[:, axis] = own
            shift = shift + tool_vector + self._tilt(axis, own)
            rotation = _rotation(angle)
            if place > base:
                product = product @ _homogeneous(rotation, travel + shift)
            else:
                product = product @ _homogeneous(rotation, shift) @ _homogeneous(None, travel)
        tip = np.concatenate([tools, np.ones((len(points), 1))], axis=1)
        actual = np.einsum("nij,nj->ni", product, tip)[:, :3]
        return np.asarray(actual - (points - self.datum + tools))

    def _first_order(self, points: np.ndarray, play: np.ndarray) -> np.ndarray:
        """Equation (1) with ISO names: first order, no tool terms."""
        total = np.zeros(points.shape)
        for axis in range(3):
            shift, angle, tool_vector = self._components(axis, points, play[:, axis])
            own = points[:, axis] - self.datum[axis]
            reach = (points - self.datum) * self._reach(axis)
            total += shift + tool_vector + np.cross(angle, reach) + self._tilt(axis, own)
        return total

    # -- backlash ----------------------------------------------------------------------------------

    @property
    def has_play(self) -> np.ndarray:
        """(3,) True for the axes whose error depends on the direction of motion."""
        directed = {curve.axis for curve in self.curves if curve.directed}
        return np.array([self.backlash_mm[a] != 0.0 or a in directed for a in range(3)])

    def play(self, axis_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Play states (n, 3) in [-1, 1] along commanded positions, and (n, 3) where they are known.

        Per axis e <- clip(e - change of command, -b/2, +b/2), from the interval [-b/2, b/2]; state = -2 e/b.
        An over-compensated or vanishing b follows the sign of the last motion.
        """
        states, known = np.zeros(axis_mm.shape), np.ones(axis_mm.shape, bool)
        for axis in np.flatnonzero(self.has_play):
            states[:, axis], known[:, axis] = self._axis_play(int(axis), np.asarray(axis_mm[:, axis], float))
        return states, known

    def backlash_at(self, axis: int, q: np.ndarray) -> np.ndarray:
        """(n,) backlash b of one axis: error moving in - less error moving in +."""
        total = np.full(len(q), self.backlash_mm[axis])
        for curve in self.curves:
            name = f"E{AXES[axis]}{AXES[axis]}"
            if curve.axis == axis and curve.directed and name in curve.tables and name not in self.silent:
                forward, backward = curve.tables[name].both(q)
                total = total + backward - forward
        return total

    def _axis_play(self, axis: int, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        half = 0.5 * self.backlash_at(axis, np.clip(q, *self.box[axis]))
        state, known = np.zeros(len(q)), np.zeros(len(q), bool)
        low, high, sign = -max(half[0], 0.0), max(half[0], 0.0), 0.0
        moves = np.diff(q, prepend=q[:1])
        for i, (b, step) in enumerate(zip(half.tolist(), moves.tolist(), strict=True)):
            if step:
                sign = 1.0 if step > 0 else -1.0
            if b > 1e-12:
                low, high = max(-b, min(b, low - step)), max(-b, min(b, high - step))
                state[i], known[i] = -0.5 * (low + high) / b, high - low < 1e-12
            else:
                low, high = (-0.0, 0.0) if sign else (low, high)
                state[i], known[i] = sign, sign != 0.0
        return state, known

    # -- zero setting ------------------------------------------------------------------------------

    def tool_vector_mm(self, tool: int | None) -> np.ndarray:
        """(3,) gauge point to tip of a tool; zero without a tool."""
        entry = self.machine.get("tools", {}).get(str(tool))
        if entry is None:
            return np.zeros(3)
        if "gauge_to_tip_mm" in entry:
            return np.array(entry["gauge_to_tip_mm"], float)
        if entry.get("Z_mm", 0.0) < 0:
            raise ValueError(f"tool {tool}: a touch-off value gives no tool vector")
        return -self.length_mm(tool)

    def length_mm(self, tool: int | None) -> np.ndarray:
        """(3,) length of a tool as in the control's table."""
        entry = self.machine.get("tools", {}).get(str(tool), {})
        return np.array([entry.get(f"{a}_mm", 0.0) for a in AXES], float)

    def zero_shift(self, work_offset: str) -> np.ndarray:
        """(3,) target - nominal for a work offset: its zero was touched off on the uncompensated machine."""
        entry = self.machine.get("work_offsets", {}).get(work_offset, {})
        if not entry or entry.get("set_by", "touch") == "true":
            return np.zeros(3)
        tool = entry.get("touch_tool")
        default = np.array([entry.get(f"{a}_mm", 0.0) for a in AXES]) + self.length_mm(tool)
        position = _position(entry.get("touched_at_mm", {}), default)
        return np.asarray(self.error_mm(position[None], self.tool_vector_mm(tool))[0])

    def length_error_mm(self, tool: int | None) -> tuple[float, str | None, float | None]:
        """How much longer a tool is than its stored length, but for the constant of its setter; the setter,
        None where the length is true; and its constant, None where it is not known.

        Stored = true - error along the tool where it was set + constant, along Z.
        """
        entry = self.machine.get("tools", {}).get(str(tool), {})
        touched = entry.get("set_by", "true") == "touch"
        if not touched and "setter" not in entry:
            return 0.0, None, 0.0
        setter = entry.get("setter", "")
        known = [
            1e-3 * other["k_um"]
            for other in self.machine["tools"].values()
            if "k_um" in other and other.get("setter", "") == setter
        ]
        longer = 0.0
        if touched:
            position = _position(entry["touched_at_mm"], np.zeros(3))
            longer = float(self.error_mm(position[None], self.tool_vector_mm(tool))[0, 2])
        return longer, setter, known[0] if known else None

    def tool_shift(self, tool: int | None, work_offset: str) -> np.ndarray:
        """(3,) target - nominal where the length of `tool` is active: its tip hangs lower by what it is
        longer, and the tip that touched the work offset did so by what its own tool was longer."""
        offset = self.machine.get("work_offsets", {}).get(work_offset, {})
        by_touch = offset.get("set_by", "touch") == "touch" and "touch_tool" in offset
        own, setter, constant = self.length_error_mm(tool)
        other, other_setter, other_constant = 0.0, None, 0.0
        if by_touch:
            if offset["touch_tool"] == tool:
                return np.zeros(3)
            other, other_setter, other_constant = self.length_error_mm(offset["touch_tool"])
        if by_touch and setter == other_setter:
            return np.array([0.0, 0.0, own - other])
        if constant is None or other_constant is None:
            raise ValueError(f"tool {tool}: the constant of a setter does not cancel and is not stated")
        return np.array([0.0, 0.0, own - constant - other + other_constant])
