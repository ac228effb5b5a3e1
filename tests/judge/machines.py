"""Writes machine folders for tests: seeded smooth errors, or errors simple enough to know by heart."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .model import JudgeModel

AXES = "XYZ"
CHAINS = tuple("".join(order) for order in itertools.permutations("FXYZ"))
TRAVEL = ((0.0, 800.0), (0.0, 600.0), (-400.0, 0.0))
WORK_OFFSETS: dict[str, dict[str, Any]] = {
    "G54": {"X_mm": 250.0, "Y_mm": 200.0, "Z_mm": -300.0, "set_by": "true"},
    "G55": {"X_mm": 420.0, "Y_mm": 310.0, "Z_mm": -280.0, "set_by": "true"},
}
TOOLS: dict[int, dict[str, Any]] = {
    1: {"Z_mm": 120.0, "radius_mm": 5.0},
    2: {"Z_mm": 85.5, "radius_mm": 3.0, "gauge_to_tip_mm": [40.0, -60.0, -85.5]},  # else no E_CZ is ever seen
}
#: Controls on which a decimal point decides.
POINTED = ("fanuc", "haas")
Curve = tuple[int, np.ndarray, dict[str, np.ndarray], np.ndarray | None]


@dataclass(frozen=True, slots=True)
class Recipe:
    """What a machine folder shall hold; lengths in mm unless the name says otherwise."""

    chain: str = "FXYZ"
    controller: str = "linuxcnc"
    travel: tuple[tuple[float, float], ...] = TRAVEL
    peak_um: tuple[float, float] = (50.0, 150.0)  # largest error anywhere, drawn from this interval
    waves: float = 1.5  # most waves of a curve per travel
    samples: int = 41
    interpolation: str = "pchip"
    squareness: bool = True
    angular: bool = True
    off_datum: bool = False
    on_table: str = ""  # axes measured with the reflector fixed on the table
    cyclic: bool = False
    backlash_um: Mapping[str, float] = field(default_factory=dict)
    directed: str = ""  # axes whose curves have a direction column
    increment_mm: float = 0.001
    tools: Mapping[int, Mapping[str, Any]] = field(default_factory=lambda: TOOLS)
    work_offsets: Mapping[str, Mapping[str, Any]] = field(default_factory=lambda: WORK_OFFSETS)
    job_defaults: Mapping[str, Any] = field(default_factory=lambda: {"tool": 1, "work_offset": "G54"})


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, str):
        return f'"{value}"'
    return repr(value.item() if isinstance(value, np.generic) else value)


def _table(header: str, values: Mapping[str, Any]) -> str:
    return "\n".join([header, *(f"{key} = {_value(value)}" for key, value in values.items())]) + "\n"


def _machine_text(recipe: Recipe, name: str) -> str:
    parts = [
        _table(
            'schema = "olp-machine-1"',
            {
                "name": name,
                "chain": recipe.chain,
                "controller": recipe.controller,
                **({"decimal_point": "increment"} if recipe.controller in POINTED else {}),
                "calibration": "calibration.toml",
                "compensated_by_controller": [],
            },
        )
    ]
    for axis, travel in zip(AXES, recipe.travel, strict=True):
        limits = {
            "travel_mm": travel,
            "least_increment_mm": recipe.increment_mm,
            "velocity_mm_s": 500.0,
            "acceleration_mm_s2": 2000.0,
            "jerk_mm_s3": 20000.0,
        }
        parts.append(_table(f"[axes.{axis}]", limits))
    parts += [_table(f'[work_offsets."{key}"]', entry) for key, entry in recipe.work_offsets.items()]
    parts += [_table(f"[tools.{number}]", entry) for number, entry in recipe.tools.items()]
    parts.append(_table("[job_defaults]", recipe.job_defaults))
    return "".join(parts)


def _write(
    folder: Path,
    recipe: Recipe,
    datum: Sequence[float],
    curves: Sequence[tuple[Mapping[str, Any], Curve]],
    extra: Mapping[str, Any],
) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "machine.toml").write_text(_machine_text(recipe, folder.name))
    parts = [
        _table(
            'schema = "olp-calibration-1"',
            {
                "machine": folder.name,
                "sign": "actual-minus-commanded",
                "model": "rigid-body",
                "temperature_degC": 20.0,
                "datum_mm": [float(value) for value in datum],
                "box_mm": recipe.travel,
                "active_during_measurement": [],
            },
        )
        + "measured = 2026-01-15\nvalid_until = 2099-01-01\n"
    ]
    for entry, (axis, q, columns, direction) in curves:
        parts.append(_table("[[curves]]", entry))
        names = [f"{AXES[axis]}_mm", *(["direction"] if direction is not None else []), *columns]
        rows = [q, *([direction] if direction is not None else []), *columns.values()]
        lines = [",".join(f"{value:.9g}" for value in row) for row in zip(*rows, strict=True)]
        (folder / entry["file"]).write_text("\n".join([",".join(names), *lines]) + "\n")
    for header, values in extra.items():
        if isinstance(values, list):
            parts += [_table(f"[[{header}]]", value) for value in values]
        elif values:
            parts.append(_table(f"[{header}]", values))
    (folder / "calibration.toml").write_text("".join(parts))
    return folder / "machine.toml"


def random_machine(folder: Path, seed: int, recipe: Recipe | None = None) -> Path:
    """Write machine.toml, calibration.toml and smooth random curves; returns the path of machine.toml."""
    recipe = recipe or Recipe()
    rng = np.random.default_rng(seed)
    low, high = np.array(recipe.travel).T
    place = rng.uniform(0.2, 0.8, 3) if recipe.off_datum else np.full(3, 0.5)
    datum = np.round(low + (high - low) * place, 1)
    curves: list[tuple[dict[str, Any], Curve]] = []
    for axis in range(3):
        letter = AXES[axis]
        q = np.linspace(low[axis], high[axis], recipe.samples)
        columns = {}
        for error in "XYZABC" if recipe.angular else "XYZ":
            waves, phase = rng.uniform(0.1, recipe.waves, 3), rng.uniform(0, 2 * np.pi, 3)
            weight = rng.normal(size=3) * (15.0 if error in "XYZ" else 25.0)
            share = (np.append(q, datum[axis]) - low[axis]) / (high[axis] - low[axis])
            values = np.sin(2 * np.pi * waves * share[:, None] + phase) @ weight
            columns[f"E{error}{letter}_{'um' if error in 'XYZ' else 'urad'}"] = values[:-1] - values[-1]
        direction = None
        if letter in recipe.directed:
            half = rng.uniform(1.0, 3.0) + 0.3 * np.sin(q / 70.0)
            for name, values in columns.items():
                part = half if name == f"E{letter}{letter}_um" else 0.3 * half
                columns[name] = np.concatenate([values - part, values + part])
            direction, q = np.repeat([1, -1], len(q)), np.tile(q, 2)
        entry: dict[str, Any] = {"file": f"{letter.lower()}.csv", "interpolation": recipe.interpolation}
        if recipe.off_datum:
            line = np.round(rng.uniform(low, high), 1)
            entry["line_mm"] = {AXES[other]: float(line[other]) for other in range(3) if other != axis}
            entry["tool_mm"] = [0.0, 0.0, -60.0]
        if letter in recipe.on_table:
            entry["reference"] = "table"
        curves.append((entry, (axis, q, columns, direction)))
    square = dict(zip(("C0Y_urad", "B0Z_urad", "A0Z_urad"), rng.normal(size=3) * 30.0, strict=True))
    square = square if recipe.squareness else {}
    cyclic = [
        {"component": f"E{a}{a}", "period_mm": period, "amplitude_um": 1.5, "phase_rad": 0.3}
        for a, period in (("X", 10.0), ("Y", 8.0))
    ]
    extra: dict[str, Any] = {"cyclic": cyclic if recipe.cyclic else []}
    extra["backlash"] = {f"{axis}_um": float(value) for axis, value in recipe.backlash_um.items()}
    path = _write(folder, recipe, datum, curves, {"squareness": square, **extra})
    points = rng.uniform(low, high, (2000, 3))
    model = JudgeModel(path)
    tools = [model.tool_vector_mm(int(number)) for number in recipe.tools] or [np.zeros(3)]
    peak = max(float(np.linalg.norm(model.error_mm(points, tool), axis=1).max()) for tool in tools)
    scale = rng.uniform(*recipe.peak_um) / (1e3 * peak)
    scaled = [
        (entry, (axis, q, {name: scale * value for name, value in columns.items()}, direction))
        for entry, (axis, q, columns, direction) in curves
    ]
    square = {name: round(float(scale * value), 6) for name, value in square.items()}
    return _write(folder, recipe, datum, scaled, {"squareness": square, **extra})


def add_map_and_load(machine: Path, rng: np.random.Generator) -> None:
    """Give a random machine a residual map, loads of all axes over one and two arguments, and a payload."""
    folder = machine.parent
    levels = [np.linspace(low, high, int(rng.integers(2, 6))) for low, high in TRAVEL]

    def rows(header: str, axes: list[int], count: int, size: float) -> str:
        lines = [header]
        for place in itertools.product(*(levels[a].tolist() for a in axes)):
            values = rng.normal(0.0, size, count)
            lines.append(",".join([*(f"{v:.6f}" for v in place), *(f"{v:.6f}" for v in values)]))
        return "\n".join(lines) + "\n"

    (folder / "map.csv").write_text(rows("X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um", [0, 1, 2], 3, 12.0))
    text = '[[maps]]\nfile = "map.csv"\nkind = "residual"\n'
    for number, (axis, axes) in enumerate((("X", [0]), ("Y", [1, 2]), ("Z", [2]))):
        header = ",".join([*(f"{AXES[a]}_mm" for a in axes), f"EX{axis}_um_kg,EZ{axis}_um_kg"])
        header += f",EA{axis}_urad_kg,EB{axis}_urad_kg"
        (folder / f"load{number}.csv").write_text(rows(header, axes, 4, 0.3))
        text += f'[[compliance]]\nfile = "load{number}.csv"\ninterpolation = "linear"\n'
        text += "tool_mm = [0.0, 0.0, -120.0]\nline_mm = { X = 300.0, Y = 100.0 }\n"
    calibration = folder / "calibration.toml"
    calibration.write_text(f"payload_kg = 5.0\n{calibration.read_text()}\n{text}")
    (folder / "job.toml").write_text('schema = "olp-job-1"\npayload_kg = 30.0\n')


def _constant(folder: Path, recipe: Recipe, shift_um: Sequence[float]) -> Path:
    curves: list[tuple[dict[str, Any], Curve]] = []
    for axis, letter in enumerate(AXES):
        q = np.array(recipe.travel[axis])
        columns = {f"E{letter}{letter}_um": np.full(2, float(shift_um[axis]))}
        entry = {"file": f"{letter.lower()}.csv", "interpolation": "linear"}
        curves.append((entry, (axis, q, columns, None)))
    return _write(folder, recipe, (0.0, 0.0, 0.0), curves, {})


def shift_machine(
    folder: Path, shift_um: Sequence[float] = (100.0, 100.0, 100.0), recipe: Recipe | None = None
) -> Path:
    """A machine that is off by the same vector everywhere."""
    return _constant(folder, recipe or Recipe(), shift_um)


def zero_machine(folder: Path, recipe: Recipe | None = None) -> Path:
    """A machine without any error: its calibration has no curves, as curves of zeros are doubted."""
    return _write(folder, recipe or Recipe(), (0.0, 0.0, 0.0), [], {})
