"""The example of each source: its values as read, and what it writes, states, shows and stamps."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.core.schema import Position
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.errormodel.gridded import ComponentTable, cover_problems
from olp.errormodel.sensitivity import Expansion
from olp.errormodel.sources.base import (
    ErrorSource,
    Frame,
    digits,
    files_of_tables,
    floats,
    line_at,
    line_key,
    vector,
)
from olp.errormodel.sources.beams import Beam
from olp.errormodel.sources.maps import DeviationMap
from olp.errormodel.sources.registry import NUMBERS, SOURCES
from olp.errormodel.sources.structure import Distortion, Sensor, Structure, structure_tables
from olp.errormodel.uncertainty import Uncertainty, fingerprint
from olp.files.calibration.covariance import load_uncertainty
from olp.files.calibration.reader import load_calibration

NAMES = {source.key: source for source in SOURCES}
BOX = np.array([[0.0, 400.0], [0.0, 300.0], [-200.0, 0.0]])
DATUM = (1.0, 2.0, -3.0)
ZERO = (0.0, 0.0, 0.0)
HEAD = """schema = "olp-calibration-1"
machine = "example"
measured = 2026-05-14
temperature_degC = 21.0
sign = "actual-minus-commanded"
model = "rigid-body"
datum_mm = [1.0, 2.0, -3.0]
box_mm = [[0, 400], [0, 300], [-200, 0]]
"""
NAN = float("nan")


def plain(value: Any) -> Any:
    """Values without arrays and without keys that are left out (None)."""
    if dataclasses.is_dataclass(value):
        return plain({f.name: getattr(value, f.name) for f in dataclasses.fields(value)})
    if isinstance(value, Mapping):
        return {name: plain(part) for name, part in value.items() if part is not None}
    if isinstance(value, tuple | list):
        return [plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


def read(folder: Path, tables: str, files: Mapping[str, str], now: Mapping[str, float] | None = None) -> Any:
    for name, text in files.items():
        (folder / name).write_text(text)
    (folder / "calibration.toml").write_text(HEAD + tables)
    return load_calibration(folder / "calibration.toml", None, now)


def of_example(folder: Path, key: str) -> Calibration:
    example = NAMES[key].example(1.0)
    calibration: Calibration = read(folder, example.tables, example.files)
    return calibration


def values_of(calibration: Calibration, key: str) -> Any:
    return {source.key: values for source, values in calibration.sources()}[key]


class Written:
    """A `Writing` that keeps what it is given."""

    machine = "example"

    def __init__(self, **sigma: Any) -> None:
        self.sigmas = sigma
        self.tables: list[tuple[str, dict[str, object]]] = []
        self.files: dict[str, Any] = {}

    def sigma(self, component: str) -> Any:
        return self.sigmas.get(component)

    def table(self, header: str, values: Mapping[str, object]) -> None:
        self.tables.append((header, dict(values)))

    def find(self, header: str) -> dict[str, object] | None:
        return next((values for name, values in self.tables if name == header), None)

    def csv(self, what: str, text: str) -> str:
        self.files[what] = text
        return f"{what}.csv"

    def document(self, what: str, tables: Iterable[tuple[str, Mapping[str, object]]]) -> str:
        self.files[what] = [(header, plain(values)) for header, values in tables]
        return f"{what}.toml"


def grid(values: Any, *shape: int) -> Any:
    return np.reshape(np.array(values, float), shape).tolist()


def flat(value: Any, path: str = "") -> dict[str, Any]:
    """Numbers and texts by their place; an empty table or list too."""
    if isinstance(value, dict) and value:
        return {k: v for name, part in value.items() for k, v in flat(part, f"{path}.{name}").items()}
    if isinstance(value, list) and value:
        return {k: v for i, part in enumerate(value) for k, v in flat(part, f"{path}[{i}]").items()}
    return {path: value}


def same(found: Any, expected: Any) -> None:
    """The same but for the last bits of its numbers."""
    one, two = flat(found), flat(expected)
    assert one.keys() == two.keys()
    for path, value in two.items():
        close = pytest.approx(value, rel=1e-12, abs=1e-18) if isinstance(value, float) else value
        assert one[path] == close, path


#: A tube of 40 x 60 x 5 mm: (40 * 60^3 - 30 * 50^3) / 12 mm4.
TUBE_MM4 = 407500.0
NODES = range(12)
VALUES: dict[str, Any] = {
    "curves": [
        {
            "axis": "X", "position_mm": [0.0, 200.0, 400.0], "forward": {}, "backward": {},
            "columns": {"EXX": [3e-3, 8e-3, 5e-3], "EYX": [1e-3, 2e-3, 6e-3], "ECX": [2e-5, 4.5e-5, 3e-5]},
            "line_mm": [1.0, 50.0, -20.0], "tool_mm": [0.0, 0.0, 0.0], "reference": "functional-point",
            "interpolation": "linear",
        },
        {
            "axis": "Y", "position_mm": [0.0, 300.0], "columns": {},
            "forward": {"EYY": [3e-3, 3e-3], "EAY": [1e-5, 1e-5]},
            "backward": {"EYY": [1e-3, 1e-3], "EAY": [1e-5, 1e-5]},
            "line_mm": [1.0, 2.0, -3.0], "tool_mm": [0.0, 0.0, 0.0], "reference": "table",
            "interpolation": "linear",
        },
    ],
    "squareness": {"C0Y": 4e-5, "B0Z": 2.5e-5, "A0Z": 6e-5},
    "backlash": [6e-3, 0.0, 9e-3],
    "repeatability": [8e-4, 5e-4, 0.0],
    "cyclic": [
        {"component": "EXX", "period_mm": 10.0, "amplitude": 2e-3, "phase_rad": 0.0},
        {
            "component": "EAZ", "period_mm": 40.0, "amplitude": 1.5e-5, "phase_rad": 0.7,
            "line_mm": [50.0, 20.0, -3.0], "tool_mm": [0.0, 10.0, -60.0], "reference": "table",
        },
    ],
    "maps": [
        {
            "knots_mm": [[0.0, 150.0, 400.0], [0.0, 300.0], [-200.0, 0.0]],
            "values": grid([[n * 1e-3, n % 5 * 1e-3, (7 - n) * 1e-3] for n in NODES], 3, 2, 2, 3),
            "kind": "residual", "tool_mm": [0.0, 0.0, 0.0], "interpolation": "cubic", "holds_along": [],
            "name": "map calibration-map.csv",
        }
    ],
    "compliance": [
        {
            "axis": "Y", "arguments": ["Y", "Z"], "knots_mm": [[0.0, 100.0, 300.0], [-200.0, 0.0]],
            "columns": {
                "EZY": [[-5e-4, -6e-4], [-7e-4, -8e-4], [-9e-4, -1e-3]],
                "EAY": [[1e-6, 2e-6], [3e-6, 4e-6], [5e-6, 6e-6]],
            },
            "line_mm": [200.0, 2.0, -3.0], "tool_mm": [0.0, 0.0, 0.0], "reference": "functional-point",
            "interpolation": "cubic", "name": "compliance calibration-load.csv",
        }
    ],
    "compliance_beam": [
        {
            "axis": "X", "support": "simple", "span_mm": [-100.0, 500.0], "youngs_modulus_GPa": 210.0,
            "second_moment_mm4": TUBE_MM4, "direction": "-Z", "line_mm": [1.0, 2.0, -3.0],
            "tool_mm": [0.0, 0.0, -80.0],
        }
    ],
    "thermal": {
        "scale_per_K": [11e-6, 0.0, 8e-6], "fixed_at_mm": [0.0, 0.0, 0.0], "workpiece_per_K": 23e-6,
        "clamped_at_mm": [0.0, 10.0, -50.0], "calibrated_at_degC": 21.0, "scale_degC": [21.0, 21.0, 21.0],
        "workpiece_degC": 20.0,
    },
    "structure": {
        "sensors": [{"name": "beam", "reference_degC": 20.0, "range_degC": [15.0, 30.0], "lag_s": 600.0}],
        "distortions": [
            {
                "component": "EYY", "sensor": "beam", "span_mm": [0.0, 300.0], "offset": 1.5e-3,
                "growth": 8e-6, "bow": 0.0, "tool_mm": [0.0, 0.0, 0.0],
            },
            {
                "component": "EBX", "sensor": "beam", "span_mm": [0.0, 400.0], "offset": 5e-7,
                "growth": 0.0, "bow": 4e-6, "tool_mm": [0.0, 0.0, 0.0],
            },
        ],
    },
}  # fmt: skip


@pytest.mark.parametrize("key", NAMES)
def test_its_example_is_read_into_base_units(key: str, tmp_path: Path) -> None:
    calibration = of_example(tmp_path, key)
    same(plain(values_of(calibration, key)), VALUES[key])
    assert NAMES[key].example(1.0).sensors_degC == ({"beam": 24.0} if key == "structure" else {})


@pytest.mark.parametrize("key", NAMES)
def test_its_example_grows_with_the_factor(key: str, tmp_path: Path) -> None:
    """Three times the error; a beam is a third as stiff."""
    example = NAMES[key].example(3.0)
    kept = (
        "position", "line", "tool", "knots", "period", "phase", "span", "second_moment", "fixed", "clamped",
        "lag", "calibrated_at", "scale_degC", "workpiece_degC", "reference_degC", "range",
    )  # fmt: skip

    def grown(path: str, value: Any) -> Any:
        if not isinstance(value, float) or path.rsplit(".", 1)[-1].startswith(kept):
            return value
        return value / 3.0 if "youngs" in path else 3.0 * value

    found = flat(plain(values_of(read(tmp_path, example.tables, example.files), key)))
    same(found, {path: grown(path, value) for path, value in flat(VALUES[key]).items()})


#: Tables with their keys, without those that are left out; and the files beside them.
WRITTEN: dict[str, tuple[list[tuple[str, dict[str, Any]]], dict[str, Any]]] = {
    "curves": (
        [
            ("[[curves]]", {"file": "x.csv", "line_mm": {"Y": 50.0, "Z": -20.0}, "tool_mm": [0.0] * 3,
                            "interpolation": "linear"}),
            ("[[curves]]", {"file": "y.csv", "line_mm": {"X": 1.0, "Z": -3.0}, "tool_mm": [0.0] * 3,
                            "reference": "table", "interpolation": "linear"}),
        ],
        {
            "x": "X_mm,EXX_um,EYX_um,ECX_urad,sigma_EXX_um\n0,3,1,20,0.3\n200,8,2,45,0\n400,5,6,30,1\n",
            "y": "Y_mm,direction,EYY_um,EAY_urad,sigma_EAY_urad\n"
            "0,+1,3,10,1\n300,+1,3,10,2\n0,-1,1,10,1\n300,-1,1,10,2\n",
        },
    ),
    "squareness": ([("[squareness]", {"C0Y_urad": 40.0, "B0Z_urad": 25.0, "A0Z_urad": 60.0})], {}),
    "backlash": ([("[backlash]", {"X_um": 6.0, "Y_um": 0.0, "Z_um": 9.0})], {}),
    "repeatability": ([("[repeatability]", {"X_um": 0.8, "Y_um": 0.5, "Z_um": 0.0})], {}),
    "cyclic": (
        [
            ("[[cyclic]]", {"component": "EXX", "period_mm": 10.0, "amplitude_um": 2.0, "phase_rad": 0.0}),
            ("[[cyclic]]", {"component": "EAZ", "period_mm": 40.0, "amplitude_urad": 15.0, "phase_rad": 0.7,
                            "line_mm": {"X": 50.0, "Y": 20.0}, "tool_mm": [0.0, 10.0, -60.0],
                            "reference": "table"}),
        ],
        {},
    ),
    "maps": (
        [("[[maps]]", {"file": "map.csv", "kind": "residual", "tool_mm": [0.0] * 3,
                       "interpolation": "cubic"})],
        {
            "map": "X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um\n0,0,-200,0,0,7\n0,0,0,1,1,6\n0,300,-200,2,2,5\n"
            "0,300,0,3,3,4\n150,0,-200,4,4,3\n150,0,0,5,0,2\n150,300,-200,6,1,1\n150,300,0,7,2,0\n"
            "400,0,-200,8,3,-1\n400,0,0,9,4,-2\n400,300,-200,10,0,-3\n400,300,0,11,1,-4\n",
        },
    ),
    "compliance": (
        [("[[compliance]]", {"file": "load.csv", "line_mm": {"X": 200.0, "Z": -3.0}, "tool_mm": [0.0] * 3,
                             "interpolation": "cubic"})],
        {
            "load": "Y_mm,Z_mm,EZY_um_kg,EAY_urad_kg\n0,-200,-0.5,1\n0,0,-0.6,2\n100,-200,-0.7,3\n"
            "100,0,-0.8,4\n300,-200,-0.9,5\n300,0,-1,6\n",
        },
    ),
    "compliance_beam": (
        [("[[compliance_beam]]", {"axis": "X", "support": "simple", "span_mm": [-100.0, 500.0],
                                  "youngs_modulus_GPa": 210.0, "second_moment_mm4": TUBE_MM4,
                                  "direction": "-Z", "line_mm": {"Y": 2.0, "Z": -3.0},
                                  "tool_mm": [0.0, 0.0, -80.0]})],
        {},
    ),
    "thermal": (
        [("[thermal]", {"X_scale_um_m_K": 11.0, "Y_scale_um_m_K": 0.0, "Z_scale_um_m_K": 8.0,
                        "workpiece_um_m_K": 23.0, "clamped_at_mm": [0.0, 10.0, -50.0]})],
        {},
    ),
    "structure": (
        [("[thermal]", {"X_scale_um_m_K": 0.0, "Y_scale_um_m_K": 0.0, "Z_scale_um_m_K": 0.0,
                        "workpiece_um_m_K": 0.0, "structure": "thermal.toml"})],
        {
            "thermal": [
                ("", {"schema": "olp-thermal-1", "machine": "example"}),
                ("[[sensors]]", {"name": "beam", "reference_degC": 20.0, "range_degC": [15.0, 30.0],
                                 "lag_s": 600.0}),
                ("[[distortions]]", {"component": "EYY", "sensor": "beam", "span_mm": [0.0, 300.0],
                                     "offset_um_K": 1.5, "growth_um_m_K": 8.0, "bow_um_K": 0.0}),
                ("[[distortions]]", {"component": "EBX", "sensor": "beam", "span_mm": [0.0, 400.0],
                                     "offset_urad_K": 0.5, "growth_urad_m_K": 0.0, "bow_urad_K": 4.0}),
            ]
        },
    ),
}  # fmt: skip


@pytest.mark.parametrize("key", NAMES)
def test_it_writes_these_keys_and_files(key: str, tmp_path: Path) -> None:
    calibration = of_example(tmp_path, key)
    writing = Written(EXX=np.array([3e-4, 0.0, 1e-3]), EAY=np.array([1e-6, 2e-6]))
    NAMES[key].write(values_of(calibration, key), writing)
    assert plain(writing.tables) == plain(WRITTEN[key][0])
    assert writing.files == WRITTEN[key][1]


def test_what_differs_from_the_examples_is_written_too() -> None:
    """Keys that the examples leave out, and those left out at their default."""

    def written(key: str, *values: Any) -> list[tuple[str, dict[str, Any]]]:
        writing = Written()
        for value in values:
            NAMES[key].write(value, writing)
        tables = [plain(table) for table in writing.tables]
        return [(header, table) for header, table in tables]

    knots = (np.array([0.0, 400.0]), np.array([0.0, 300.0]), np.array([-100.0]))
    described = DeviationMap(
        knots, np.zeros((2, 2, 1, 3)), "total", (1.0, 2.0, 3.0), "linear", ("Z",),
        sigma=np.full((2, 2, 1, 3), 1e-3),
    )  # fmt: skip
    writing = Written()
    NAMES["maps"].write((described,), writing)
    table = {"file": "map.csv", "kind": "total", "tool_mm": [1.0, 2.0, 3.0], "interpolation": "linear"}
    assert plain(writing.tables) == [["[[maps]]", table | {"holds_along": ["Z"]}]]
    header, first, *_ = writing.files["map"].split("\n")
    assert header == "X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um,sigma_DX_um,sigma_DY_um,sigma_DZ_um"
    assert first == "0,0,-100,0,0,0,1,1,1"
    fixed = Thermal(workpiece_per_K=23e-6, fixed_at_mm=(4.0, 5.0, 6.0))
    (_, table) = written("thermal", fixed)[0]
    assert table["fixed_at_mm"] == [4.0, 5.0, 6.0] and "clamped_at_mm" not in table
    assert "structure" not in table
    # a structure is named in the table that the expansion has written
    sensors = (Sensor("beam", 20.0, (15.0, 30.0)),)
    measured = Distortion("EXX", "beam", (0.0, 400.0), 1e-3, 0.0, 0.0, (0.0, 1.0, 2.0), (0.0, 0.0, -5.0))
    writing = Written()
    NAMES["thermal"].write(fixed, writing)
    NAMES["structure"].write(Structure(sensors, (measured,)), writing)
    assert [header for header, _ in writing.tables] == ["[thermal]"]
    assert writing.tables[0][1]["structure"] == "thermal.toml"
    assert writing.tables[0][1]["workpiece_um_m_K"] == 23.0
    last = writing.files["thermal"][-1][1]
    assert (last["offset_um_K"], last["growth_um_m_K"], last["bow_um_K"]) == (1.0, 0.0, 0.0)
    shown = NAMES["structure"].inspect(Structure(sensors, (measured,)), FRAME)["distortions"]
    same(shown, [{"name": "EXX by beam", "offset_um_K": 1.0, "growth_um_m_K": 0.0, "bow_um_K": 0.0}])
    assert (last["line_mm"], last["tool_mm"]) == ({"X": 0.0, "Y": 1.0, "Z": 2.0}, [0.0, 0.0, -5.0])
    # lengths come before angles
    table = ComponentTable("Y", ("Y",), (BOX[1],), {"EAY": [1e-6, 2e-6], "EZY": [3e-3, 4e-3]})
    writing = Written()
    NAMES["compliance"].write((table,), writing)
    assert writing.files["load"] == "Y_mm,EZY_um_kg,EAY_urad_kg\n0,3,1\n300,4,2\n"
    for key, nothing in (("backlash", ZERO), ("repeatability", None), ("thermal", None), ("structure", None)):
        assert written(key, nothing) == []


def test_a_standard_uncertainty_that_fits_no_curve_is_refused() -> None:
    curve = Curve("X", [0.0, 400.0], {"EXX": [0.0, 1e-3]})
    for wrong in ([1e-3], [1e-3, -1e-9], [1e-3, NAN]):
        with pytest.raises(ConfigError, match=r"EXX has shape \(\d,\); expected a number of 0 or above"):
            NAMES["curves"].write((curve,), Written(EXX=np.array(wrong)))


#: A load, so that the table of compliance has what it is measured with.
FRAME = Frame("FXYZ", DATUM, BOX, hold=False, payload_kg=7.5, tool_terms=True)
SHOWN: dict[str, Any] = {
    "squareness": {"squareness": {"C0Y_urad": 40.0, "B0Z_urad": 25.0, "A0Z_urad": 60.0}},
    "backlash": {},
    "repeatability": {"repeatability": {"X_um": 0.8, "Y_um": 0.5, "Z_um": 0.0}},
    "cyclic": {
        "cyclic_position_errors": [{"name": "EXX", "period_mm": 10.0, "amplitude_um": 2.0}],
        "cyclic_angular_errors": [{"name": "EAZ", "period_mm": 40.0, "amplitude_urad": 15.0}],
    },
    "maps": {
        "maps": [
            {"name": "map calibration-map.csv", "kind": "residual", "interpolation": "cubic",
             "nodes": "3 x 2 x 2", "tool_mm": [0.0, 0.0, 0.0],
             # at the last node, 11, 1 and -4 um
             "max_um": 138.0**0.5}
        ]
    },
    "compliance": {
        "load": [
            {"name": "compliance calibration-load.csv: EZY", "by_position_of": "Y and Z", "max_um_kg": 1.0},
            {"name": "compliance calibration-load.csv: EAY", "by_position_of": "Y and Z", "max_urad_kg": 6.0},
        ],
        "load_measured_with": {"payload_kg": 7.5},
    },
    "compliance_beam": {},
    "thermal": {},
    "structure": {
        "sensors": [
            {"name": "beam", "reference_degC": 20.0, "lowest_degC": 15.0, "highest_degC": 30.0,
             "lag_s": 600.0}
        ],
        "distortions": [
            {"name": "EYY by beam", "offset_um_K": 1.5, "growth_um_m_K": 8.0, "bow_um_K": 0.0},
            {"name": "EBX by beam", "offset_urad_K": 0.5, "growth_urad_m_K": 0.0, "bow_urad_K": 4.0},
        ],
    },
}  # fmt: skip


@pytest.mark.parametrize("key", SHOWN)
def test_inspect_shows_these_keys_of_it(key: str, tmp_path: Path) -> None:
    calibration = of_example(tmp_path, key)
    shown = plain(NAMES[key].inspect(values_of(calibration, key), FRAME))
    same(shown, SHOWN[key])


def test_inspect_shows_size_and_range_of_each_component() -> None:
    """From the points, in both directions; a component that no curve holds is 0."""
    curves = (
        Curve("X", [0.0, 400.0], {"EXX": [-3e-3, 1e-3], "EBX": [2e-5, 5e-5]}),
        Curve("Y", [0.0, 300.0], forward={"EYY": [2e-3, 0.0]}, backward={"EYY": [4e-3, 0.0]}),
    )
    shown = NAMES["curves"].inspect(curves, FRAME)
    sizes = {row["name"]: row for rows in shown.values() for row in rows}
    assert {title: [row["name"] for row in rows] for title, rows in shown.items()} == {
        "position_errors": ["EXX", "EYX", "EZX", "EXY", "EYY", "EZY", "EXZ", "EYZ", "EZZ"],
        "angular_errors": ["EAX", "EBX", "ECX", "EAY", "EBY", "ECY", "EAZ", "EBZ", "ECZ"],
    }
    for name, unit, largest, span in (
        ("EXX", "um", 3.0, 4.0), ("EYY", "um", 3.0, 3.0), ("EZZ", "um", 0.0, 0.0),
        ("EBX", "urad", 50.0, 30.0), ("EAZ", "urad", 0.0, 0.0),
    ):  # fmt: skip
        same(sizes[name], {"name": name, f"max_{unit}": largest, f"range_{unit}": span})


def test_inspect_shows_nothing_where_nothing_is_stated_and_loads_of_beams_with_the_tables() -> None:
    for key, nothing in (("repeatability", None), ("structure", None), ("maps", ()), ("compliance", ())):
        assert NAMES[key].inspect(nothing, FRAME) == {}
    beam = Beam("X", "cantilever", (0.0, 400.0), 210.0, 1e6)
    shown = NAMES["compliance"].inspect((), Calibration("m", BOX, beams=(beam,)).frame("FXYZ"))
    deflection = 9.80665 * 400.0**3 / (3.0 * 210e3 * 1e6)
    slope = 9.80665 * 400.0**2 / (2.0 * 210e3 * 1e6)
    assert [row["name"] for row in shown["load"]] == ["beam of axis X: EZX", "beam of axis X: EBX"]
    assert shown["load"][0]["max_um_kg"] == pytest.approx(1e3 * deflection)
    assert shown["load"][1]["max_urad_kg"] == pytest.approx(1e6 * slope)
    assert shown["load_measured_with"] == {"payload_kg": 0.0}
    for key in ("squareness", "cyclic", "curves", "maps"):
        assert NAMES[key].inspect_axis(VALUES[key], "X") == {}
    for axis, lost_um in (("X", 6.0), ("Y", 0.0), ("Z", 9.0)):
        shown = NAMES["backlash"].inspect_axis((6e-3, 0.0, 9e-3), axis)
        assert shown == pytest.approx({"lost_motion_um": lost_um})


SIGMAS = {
    "curves": {
        ("mean", "EXX"): [3e-4, 8e-4, 5e-4], ("mean", "EYX"): [1e-4, 2e-4, 6e-4],
        ("mean", "ECX"): [2e-6, 4.5e-6, 3e-6], ("mean", "EYY"): [2e-4] * 2, ("mean", "EAY"): [1e-6] * 2,
    },
    "squareness": {
        ("squareness", "C0Y"): [4e-6], ("squareness", "B0Z"): [2.5e-6], ("squareness", "A0Z"): [6e-6],
    },
    "backlash": {("backlash", "X"): [6e-4], ("backlash", "Z"): [9e-4]},
}  # fmt: skip


@pytest.mark.parametrize("key", NAMES)
def test_the_standard_uncertainties_of_its_example(key: str, tmp_path: Path) -> None:
    calibration = of_example(tmp_path, key)
    known = load_uncertainty(tmp_path / "calibration.toml", calibration)
    if key not in SIGMAS:
        assert known is None or not known.entries
        return
    assert known is not None
    found = {(entry.kind, entry.name): entry for entry in known.entries}
    assert found.keys() == SIGMAS[key].keys()
    for name, sigma in SIGMAS[key].items():
        assert found[name].rest == pytest.approx(sigma, rel=1e-12)
        assert found[name].sigma == pytest.approx(sigma, rel=1e-12)
        assert found[name].factor.shape == (len(sigma), 0)
        positions = {"X": [0.0, 200.0, 400.0], "Y": [0.0, 300.0]}[name[1][2]] if key == "curves" else []
        assert found[name].position_mm.tolist() == positions
    assert known.fingerprint == fingerprint(calibration)
    assert known.rank == 0 and known.dropped == 0.0


#: Lines of the stamp that ties a covariance to its calibration: files that were written keep theirs.
STAMPED = {
    "curves": [
        "X functional-point linear 5.000000000e+01 -2.000000000e+01 "
        "0.000000000e+00 0.000000000e+00 0.000000000e+00",
        "0.000000000e+00 2.000000000e+02 4.000000000e+02",
        "ECX 2.000000000e-05 4.500000000e-05 3.000000000e-05",
        "EXX 3.000000000e-03 8.000000000e-03 5.000000000e-03",
        "EYX 1.000000000e-03 2.000000000e-03 6.000000000e-03",
        "Y table linear 1.000000000e+00 -3.000000000e+00 0.000000000e+00 0.000000000e+00 0.000000000e+00",
        "0.000000000e+00 3.000000000e+02",
        "EAY 1.000000000e-05 1.000000000e-05",
        "EYY 3.000000000e-03 3.000000000e-03",
        "EAY 1.000000000e-05 1.000000000e-05",
        "EYY 1.000000000e-03 1.000000000e-03",
    ],
    "squareness": ["C0Y 4.000000000e-05 B0Z 2.500000000e-05 A0Z 6.000000000e-05"],
    "backlash": ["6.000000000e-03 0.000000000e+00 9.000000000e-03"],
    "cyclic": [
        "EXX 1.000000000e+01 2.000000000e-03 0.000000000e+00",
        "EAZ 4.000000000e+01 1.500000000e-05 7.000000000e-01",
        "line_mm 5.000000000e+01 2.000000000e+01 -3.000000000e+00",
        "tool_mm 0.000000000e+00 1.000000000e+01 -6.000000000e+01",
        "reference table",
    ],
}


@pytest.mark.parametrize("key", NAMES)
def test_the_lines_of_its_stamp(key: str, tmp_path: Path) -> None:
    values = values_of(of_example(tmp_path, key), key)
    assert list(NAMES[key].fingerprint(values, DATUM)) == STAMPED.get(key, [])
    assert NAMES[key].covered == (key in STAMPED)


def test_a_stamp_takes_the_datum_for_a_line_that_is_not_stated_and_minus_zero_for_zero() -> None:
    curve = Curve("Y", [0.0, 300.0], {"EYY": [-0.0, 0.0]})
    first, _, last = NAMES["curves"].fingerprint((curve,), DATUM)
    assert first.startswith("Y functional-point pchip 1.000000000e+00 -3.000000000e+00 0.0")
    assert last == "EYY 0.000000000e+00 0.000000000e+00"
    assert list(NAMES["squareness"].fingerprint({}, DATUM)) == [
        "C0Y 0.000000000e+00 B0Z 0.000000000e+00 A0Z 0.000000000e+00"
    ]


def test_the_stamp_of_a_calibration_stays_what_it_was() -> None:
    """A covariance file of an earlier version holds this stamp."""
    calibration = Calibration(
        "m", BOX, datum_mm=DATUM, curves=(Curve("X", [0.0, 400.0], {"EXX": [0.0, 1e-3]}),),
        squareness={"C0Y": 4e-5}, backlash_mm=(6e-3, 0.0, 0.0), cyclic=(Cyclic("EXX", 10.0, 2e-3),),
    )  # fmt: skip
    zero = "0.000000000e+00"
    lines = [
        "m rigid-body None",
        f"1.000000000e+00 2.000000000e+00 -3.000000000e+00 {zero} 4.000000000e+02 {zero} 3.000000000e+02 "
        f"-2.000000000e+02 {zero}",
        f"X functional-point pchip 2.000000000e+00 -3.000000000e+00 {zero} {zero} {zero}",
        f"{zero} 4.000000000e+02",
        f"EXX {zero} 1.000000000e-03",
        f"C0Y 4.000000000e-05 B0Z {zero} A0Z {zero}",
        f"6.000000000e-03 {zero} {zero}",
        f"EXX 1.000000000e+01 2.000000000e-03 {zero}",
    ]
    assert fingerprint(calibration) == hashlib.sha256("".join(f"{n}\n" for n in lines).encode()).hexdigest()


def test_an_uncertainty_of_zero_is_none_that_is_stated(tmp_path: Path) -> None:
    rows = "X_mm,EXX_um,EYX_um,sigma_EXX_um,sigma_EYX_um\n0,1,1,0,0\n400,2,2,0,0.5\n"
    tables = "[backlash]\nsigma_X_um = 0.0\nsigma_Y_um = 2.0\n[squareness]\nsigma_B0Z_urad = 3.0\n"
    calibration = read(tmp_path, f'[[curves]]\nfile = "a.csv"\n{tables}', {"a.csv": rows})
    known = load_uncertainty(tmp_path / "calibration.toml", calibration)
    assert known is not None
    found = [(entry.name, entry.rest.tolist()) for entry in known.entries]
    assert found == [("EYX", [0.0, 5e-4]), ("B0Z", [3e-6]), ("Y", [2e-3])]


@pytest.mark.parametrize(
    ("tables", "key", "expected"),
    [
        ("[squareness]\n", "squareness", {"C0Y": 0.0, "B0Z": 0.0, "A0Z": 0.0}),
        ("[squareness]\nB0Z_urad = 7\n", "squareness", {"C0Y": 0.0, "B0Z": 7e-6, "A0Z": 0.0}),
        ("[backlash]\n", "backlash", [0.0, 0.0, 0.0]),
        ("[backlash]\nY_um = 7\n", "backlash", [0.0, 7e-3, 0.0]),
        ("[repeatability]\n", "repeatability", [0.0, 0.0, 0.0]),
        ("[repeatability]\nZ_um = 0.7\n", "repeatability", [0.0, 0.0, 7e-4]),
        (
            "[thermal]\n", "thermal",
            {"scale_per_K": [0.0] * 3, "fixed_at_mm": [0.0] * 3, "workpiece_per_K": 0.0,
             "clamped_at_mm": [0.0] * 3, "calibrated_at_degC": 21.0, "scale_degC": [21.0] * 3,
             "workpiece_degC": 20.0},
        ),
        ("", "squareness", {"C0Y": 0.0, "B0Z": 0.0, "A0Z": 0.0}),
        ("", "backlash", [0.0, 0.0, 0.0]),
        ("", "repeatability", None),
        ("", "thermal", None),
        ("", "structure", None),
        ("", "curves", []),
        ("", "cyclic", []),
        ("", "maps", []),
        ("", "compliance", []),
        ("", "compliance_beam", []),
    ],
)  # fmt: skip
def test_what_a_table_leaves_out_is_zero(tables: str, key: str, expected: Any, tmp_path: Path) -> None:
    calibration = read(tmp_path, tables, {})
    assert plain(values_of(calibration, key)) == expected
    known = load_uncertainty(tmp_path / "calibration.toml", calibration)
    assert known is None or not known.entries


def test_temperatures_of_the_job_are_of_scales_and_workpiece(tmp_path: Path) -> None:
    tables = "[thermal]\nY_scale_um_m_K = 9\nfixed_at_mm = [1, 2, 3]\n"
    now = {"X_scale": 22.0, "Z_scale": 18.5, "workpiece": 24.0}
    thermal = read(tmp_path, tables, {}, now).thermal
    assert thermal.scale_degC == (22.0, 21.0, 18.5) and thermal.workpiece_degC == 24.0
    assert thermal.scale_per_K == (0.0, 9e-6, 0.0) and thermal.fixed_at_mm == (1.0, 2.0, 3.0)


CURVE = '[[curves]]\nfile = "a.csv"\n'
ROWS = "X_mm,EXX_um\n0,1\n400,2\n"
LOAD = "X_mm,EZX_um_kg\n0,1\n400,2\n"
BEAM = '[[compliance_beam]]\naxis = "X"\nsupport = "fixed"\nspan_mm = [-100, 500]\nyoungs_modulus_GPa = 210\n'


def test_defaults_of_tables_with_a_file(tmp_path: Path) -> None:
    (curve,) = read(tmp_path, CURVE, {"a.csv": ROWS}).curves
    assert (curve.line_mm, curve.tool_mm) == (DATUM, ZERO)
    assert (curve.reference, curve.interpolation) == ("functional-point", "pchip")
    (load,) = read(tmp_path, '[[compliance]]\nfile = "a.csv"\n', {"a.csv": LOAD}).compliance
    assert (load.line_mm, load.tool_mm) == (DATUM, ZERO)
    assert (load.reference, load.interpolation) == ("functional-point", "cubic")
    nodes = "X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um\n" + "".join(
        f"{x},{y},{z},0,0,0\n" for x in (0, 400) for y in (0, 300) for z in (-200, 0)
    )
    (described,) = read(tmp_path, '[[maps]]\nfile = "a.csv"\nkind = "residual"\n', {"a.csv": nodes}).maps
    assert (described.tool_mm, described.interpolation, described.holds_along) == (ZERO, "linear", ())
    assert described.sigma is None
    (beam,) = read(tmp_path, f"{BEAM}second_moment_mm4 = 1e6\n", {}).beams
    assert (beam.line_mm, beam.tool_mm, beam.direction) == (DATUM, ZERO, "-Z")
    assert beam.second_moment_mm4 == 1e6


def test_keys_of_tables_with_a_file(tmp_path: Path) -> None:
    stated = 'line_mm = { Y = 5 }\ntool_mm = [1, 2, 3]\nreference = "table"\ninterpolation = "linear"\n'
    (curve,) = read(tmp_path, CURVE + stated, {"a.csv": ROWS}).curves
    (load,) = read(tmp_path, f'[[compliance]]\nfile = "a.csv"\n{stated}', {"a.csv": LOAD}).compliance
    for one in (curve, load):
        assert (one.line_mm, one.tool_mm) == ((1.0, 5.0, -3.0), (1.0, 2.0, 3.0))
        assert (one.reference, one.interpolation) == ("table", "linear")
    # columns and rows of a map in another order, one level along Z
    nodes = "Z_mm,X_mm,Y_mm,DX_um,DY_um,DZ_um,sigma_DX_um,sigma_DY_um,sigma_DZ_um\n" + "".join(
        f"-5,{x},{y},{x},{y},3,1,2,{x / 100}\n" for y in (0, 300) for x in (0, 400)
    )
    stated = 'kind = "total"\nholds_along = ["Z"]\ntool_mm = [1, 2, 3]\n'
    (described,) = read(tmp_path, f'[[maps]]\nfile = "a.csv"\n{stated}', {"a.csv": nodes}).maps
    assert [k.tolist() for k in described.knots_mm] == [[0.0, 400.0], [0.0, 300.0], [-5.0]]
    assert described.values[1, 0, 0].tolist() == pytest.approx([0.4, 0.0, 3e-3])
    assert described.values[0, 1, 0].tolist() == pytest.approx([0.0, 0.3, 3e-3])
    assert described.sigma[1, 0, 0].tolist() == pytest.approx([1e-3, 2e-3, 4e-3])
    assert (described.kind, described.holds_along) == ("total", ("Z",))
    assert described.tool_mm == (1.0, 2.0, 3.0)
    stated = 'section_mm = [40, 60, 5]\ndirection = "+Y"\nline_mm = { Z = 9 }\ntool_mm = [1, 2, 3]\n'
    (beam,) = read(tmp_path, BEAM + stated, {}).beams
    assert beam == Beam(
        "X", "fixed", (-100.0, 500.0), 210.0, TUBE_MM4, "+Y", (1.0, 2.0, 9.0), (1.0, 2.0, 3.0)
    )


SCREW = '[[cyclic]]\ncomponent = "EXX"\nperiod_mm = 10\n'
TURN = '[[cyclic]]\ncomponent = "EAX"\nperiod_mm = 10\n'


@pytest.mark.parametrize(
    ("tables", "sentence"),
    [
        (SCREW, "component EXX; expected exactly one amplitude: amplitude_um, in um"),
        (
            f"{SCREW}amplitude_urad = 1\n",
            "component EXX; expected exactly one amplitude: amplitude_um, in um",
        ),
        (f"{SCREW}amplitude_um = 1\namplitude_urad = 1\n", "component EXX; expected exactly one amplitude"),
        (TURN, "component EAX; expected exactly one amplitude: amplitude_urad, in urad"),
        (f"{TURN}amplitude_um = 1\n", "component EAX; expected exactly one amplitude: amplitude_urad"),
        (f"{TURN}amplitude_um = 1\namplitude_urad = 1\n", "component EAX; expected exactly one amplitude"),
        (f"{SCREW}amplitude_um = 1\nline_mm = {{ Y = 1 }}\n", "line_mm does not fit component EXX"),
        (f'{SCREW}amplitude_um = 1\nreference = "table"\n', "reference does not fit component EXX"),
        ('[[cyclic]]\ncomponent = "EXX"\nperiod_mm = 0\namplitude_um = 1\n', "period_mm"),
        (f"{BEAM}", "section_mm or second_moment_mm4: expected exactly one of the two"),
        (f"{BEAM}second_moment_mm4 = 1\nsection_mm = [4, 6, 1]\n", "expected exactly one of the two"),
        (f"{BEAM}section_mm = [4, 6, 2.1]\n", "has a wall of 2.1 mm; expected at most half of width"),
        (f"{BEAM}section_mm = [6, 4, 2.1]\n", "has a wall of 2.1 mm; expected at most half of width"),
        (f'{BEAM}section_mm = [4, 6, 1]\ndirection = "+X"\n', '"+X" is along the beam'),
        # a key that is wrong itself is one problem, not also one of the keys beside it
        (f"{SCREW.replace('EXX', 'EXQ')}line_mm = {{ Y = 1 }}\n", "component"),
        (f'{SCREW}amplitude_um = "a"\n', "amplitude_um"),
        (f'{TURN}amplitude_um = "a"\namplitude_urad = 1\n', "amplitude_um"),
        (f"{BEAM}second_moment_mm4 = 0\n", "second_moment_mm4"),
        (BEAM.replace('"X"', '"A"') + "section_mm = [4, 6, 1]\n", "axis"),
        (BEAM.replace("[-100, 500]", "[5, 5]") + "section_mm = [4, 6, 1]\n", "span_mm = is empty"),
        (BEAM.replace("[-100, 500]", "[10, 500]") + "section_mm = [4, 6, 1]\n", "spans 10 to 500 mm"),
    ],
)
def test_a_table_that_contradicts_itself_is_refused(tables: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, tables, {})
    assert sentence in "\n".join(caught.value.problems)
    assert len(caught.value.problems) == 1


def test_an_amplitude_of_zero_is_zero(tmp_path: Path) -> None:
    for table in (f"{TURN}amplitude_urad = 0\n", f"{SCREW}amplitude_um = 0\n"):
        (term,) = read(tmp_path, table, {}).cyclic
        assert term.amplitude == 0.0 and term.phase_rad == 0.0


def test_a_wall_of_half_the_width_is_a_full_bar(tmp_path: Path) -> None:
    for section in ("[40, 60, 20]", "[60, 40, 20]"):
        (beam,) = read(tmp_path, f"{BEAM}section_mm = {section}\n", {}).beams
        width, height, _ = map(float, section.strip("[]").split(","))
        assert beam.second_moment_mm4 == width * height**3 / 12.0


BEAM_SENSOR = Sensor("beam", 20.0, (15.0, 30.0))
THERMAL = """schema = "olp-thermal-1"
machine = "example"
[[sensors]]
name = "beam"
reference_degC = 20
range_degC = [15, 30]
[[distortions]]
component = "{}"
sensor = "beam"
span_mm = [0, 400]
"""


def test_keys_of_a_thermal_file(tmp_path: Path) -> None:
    def one(component: str, stated: str) -> Distortion:
        files = {"t.toml": THERMAL.format(component) + stated}
        structure = read(tmp_path, '[thermal]\nstructure = "t.toml"\n', files).structure
        assert structure.sensors == (Sensor("beam", 20.0, (15.0, 30.0), 0.0),)
        assert structure.temperatures_degC is None
        distortion: Distortion = structure.distortions[0]
        return distortion

    span = (0.0, 400.0)
    assert one("EXX", "") == Distortion("EXX", "beam", span)
    stated = "growth_urad_m_K = 2\nbow_urad_K = -3\nline_mm = { Y = 5, Z = 6 }\ntool_mm = [0, 0, -7]\n"
    expected = Distortion("EBX", "beam", span, 0.0, 2e-9, -3e-6, (0.0, 5.0, 6.0), (0.0, 0.0, -7.0))
    assert one("EBX", stated) == expected
    stated = "offset_um_K = 1\ngrowth_um_m_K = 2\nbow_um_K = -3\n"
    assert one("EXX", stated) == Distortion("EXX", "beam", span, 1e-3, 2e-6, -3e-3)
    assert one("EZX", stated) == Distortion("EZX", "beam", span, 1e-3, 2e-6, -3e-3)


@pytest.mark.parametrize(
    ("component", "stated", "sentence"),
    [
        ("EXQ", "offset_urad_K = 1\n", "component"),
        ("EXX", "offset_urad_K = 1\n", "(offset_urad_K) is of the wrong unit for EXX; expected keys in um"),
        ("EXX", "bow_urad_K = 1\n", "(bow_urad_K) is of the wrong unit for EXX; expected keys in um"),
        ("EBX", "growth_um_m_K = 1\n", "(growth_um_m_K) is of the wrong unit for EBX; expected keys in urad"),
        ("EXX", "line_mm = { Y = 1 }\n", "line_mm of EXX names no Z; expected the position of each other"),
        ("EXX", "line_mm = { X = 1, Z = 2 }\n", "line_mm of EXX names no Y; expected the position of each"),
    ],
)
def test_a_wrong_distortion_is_refused(component: str, stated: str, sentence: str, tmp_path: Path) -> None:
    files = {"t.toml": THERMAL.format(component) + stated}
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, '[thermal]\nstructure = "t.toml"\n', files)
    assert sentence in "\n".join(caught.value.problems)
    assert len(caught.value.problems) == 1


def test_numbers_are_known_by_their_kind() -> None:
    assert sorted(NUMBERS) == ["backlash", "half", "mean", "squareness", "wave"]
    assert {source.key for source in SOURCES if not source.correctable} == {"repeatability"}


TWO: Any = (1e-3, 2e-3)


@pytest.mark.parametrize(
    "call",
    {
        "backlash is written": lambda: NAMES["backlash"].write(TWO, Written()),
        "repeatability is written": lambda: NAMES["repeatability"].write(TWO, Written()),
        "repeatability is shown": lambda: NAMES["repeatability"].inspect(TWO, FRAME),
        "expansion is written": lambda: NAMES["thermal"].write(Thermal(scale_per_K=TWO), Written()),
        "expansion is uncertain": lambda: Expansion.of(
            Calibration("m", BOX, thermal=Thermal(scale_per_K=TWO)), Uncertainty((), "", ""), {}
        ),
        "a scale counts twice": lambda: Calibration(
            "m", BOX, structure=Structure((), ()), thermal=Thermal(scale_per_K=TWO)
        ),
        "a line is read": lambda: line_at(Position(X=1.0), TWO),
        "a line is written": lambda: line_key(TWO),
        "the line of a distortion is written": lambda: list(
            structure_tables(Structure((BEAM_SENSOR,), (Distortion("EXX", "beam", TWO, line_mm=TWO),)), "m")
        ),
        "levels of a table": lambda: ComponentTable("X", ("X", "Y"), (BOX[0],), {"EXX": BOX[0]}),
        "levels reach the box": lambda: cover_problems("", ("X", "Y"), (BOX[0],), BOX),
    }.items(),
    ids=lambda item: item[0],
)
def test_where_a_vector_has_too_few_numbers_none_is_left_out_in_silence(call: tuple[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"shorter|unpack"):
        call[1]()


def test_keys_of_lines() -> None:
    """An axis that is left out was at the datum; the own axis has no key."""
    assert line_at(Position(Y=5.0), DATUM) == (1.0, 5.0, -3.0)
    assert line_at(Position(X=0.0, Z=0.0), DATUM) == (0.0, 2.0, 0.0)
    assert line_key((4.0, 5.0, 6.0)) == {"X": 4.0, "Y": 5.0, "Z": 6.0}
    assert line_key((4.0, 5.0, 6.0), "Y") == {"X": 4.0, "Z": 6.0}
    assert line_key(None, "Y") is None
    assert floats([1, 2]) == [1.0, 2.0] and vector([1, 2, 3]) == (1, 2, 3)
    assert digits(-0.0) == "0.000000000e+00" and digits([1.0, 2e-9]) == "1.000000000e+00 2.000000000e-09"
    named = {"a": [{"file": "x"}, {"file": "y"}], "b": []}
    assert [files_of_tables(named, key) for key in "abc"] == [["x", "y"], [], []]


@pytest.mark.parametrize(
    ("tables", "sentence"),
    [
        ('[[curves]]\nfile = "no.csv"\n', 'line 10: curves[0].file = "no.csv": no such file; check the path'),
        (
            '[[maps]]\nkind = "total"\nfile = "no.csv"\n',
            'line 11: maps[0].file = "no.csv": no such file; check the path',
        ),
        ('[[compliance]]\nfile = "no.csv"\n', 'line 10: compliance[0].file = "no.csv": no such file;'),
        ('[thermal]\nstructure = "no.toml"\n', 'line 10: thermal.structure = "no.toml": no such file;'),
    ],
)
def test_a_file_that_is_not_there_is_named_with_its_key(tables: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, tables, {})
    (problem,) = caught.value.problems
    assert problem.startswith(sentence)


def test_files_that_a_calibration_names_before_it_is_read() -> None:
    named = {"a": [{"file": "x"}], "thermal": {"structure": "t"}}
    for key in ("curves", "maps", "compliance"):
        assert list(NAMES[key].named({key: [{"file": "x"}, {"file": "y"}]})) == ["x", "y"]
        assert list(NAMES[key].named(named)) == []
    assert NAMES["structure"].named(named) == ["t"]
    assert NAMES["structure"].named({"thermal": {}}) == NAMES["structure"].named({}) == []
    for key in ("squareness", "backlash", "repeatability", "cyclic", "compliance_beam", "thermal"):
        assert NAMES[key].named(named) == []


def test_a_source_that_leaves_methods_out_says_nothing() -> None:
    """What is not written, shown, modelled or uncertain of any source."""
    source: Any = ErrorSource()
    assert (source.field, source.schema, source.numbers) == ("", None, ())
    assert source.correctable is True and source.covered is True
    assert source.named({}) == source.problems(None, BOX) == source.loads(None, FRAME) == []
    assert source.models(None, FRAME) == source.entries(None, {}) == []
    assert source.sigmas(None, None) == source.inspect(None, FRAME) == source.inspect_axis(None, "X") == {}
    assert list(source.fingerprint(None, DATUM)) == []
    for call in (
        lambda: source.example(1.0),
        lambda: source.read(None, None),
        lambda: source.write(None, None),
    ):
        with pytest.raises(NotImplementedError):
            call()
