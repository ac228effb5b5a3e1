"""What holds for every registered error source; nothing here names one, but for what `olp` does not show."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from olp.cli.inspect import machine_summary
from olp.compensation.invert import invert
from olp.core.machine import CHAINS
from olp.core.schema import fields_of
from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.sensitivity import Sensitivity, value_rows
from olp.errormodel.sources.registry import SOURCES
from olp.errormodel.uncertainty import Uncertainty, fingerprint
from olp.files.calibration.covariance import load_uncertainty
from olp.files.calibration.reader import files_beside, load_calibration
from olp.files.calibration.schema import CalibrationFile
from olp.files.calibration.writer import calibration_files
from olp.files.write import write_files
from olp.workflows.session import Session

NAMES = {source.key: source for source in SOURCES}
each = pytest.mark.parametrize("key", NAMES)
BOX = np.array([[0.0, 400.0], [0.0, 300.0], [-200.0, 0.0]])
HEAD = f"""schema = "olp-calibration-1"
machine = "example"
measured = 2026-05-14
temperature_degC = 20.0
sign = "actual-minus-commanded"
model = "rigid-body"
datum_mm = [0.0, 0.0, 0.0]
box_mm = {BOX.tolist()}
"""
AXIS = """[axes.{}]
travel_mm = [{}, {}]
least_increment_mm = 0.001
velocity_mm_s = 500.0
acceleration_mm_s2 = 2000.0
jerk_mm_s3 = 20000.0
"""
MACHINE = """schema = "olp-machine-1"
name = "example"
chain = "YFXZ"
controller = "linuxcnc"
calibration = "calibration.toml"
""" + "".join(AXIS.format(a, *row) for a, row in zip("XYZ", BOX.tolist(), strict=True))
#: The job's: warmer than the calibration.
DEGC = {"X_scale": 23.0, "Z_scale": 18.5, "workpiece": 24.0}
#: Tool vector and payload in kg.
TOOL = np.array([5.0, -3.0, -90.0, 30.0])
#: What `olp inspect` says nothing of.
NOT_SHOWN = {"thermal"}
RANDOM = np.random.default_rng(20260514)
POINTS = RANDOM.uniform(BOX[:, 0], BOX[:, 1], (200, 3))
PLAY = RANDOM.uniform(-1.0, 1.0, POINTS.shape)
CHAIN = pytest.mark.parametrize("chain", ["FXYZ", "YFXZ", "ZYXF"])


def folder_of(path: Path, key: str | None, by: float = 1.0) -> Path:
    """A machine with a calibration that holds one source, or none."""
    path.mkdir(parents=True, exist_ok=True)
    (path / "machine.toml").write_text(MACHINE)
    tables = ""
    if key is not None:
        example = NAMES[key].example(by)
        tables = example.tables
        for name, text in example.files.items():
            (path / name).write_text(text)
    (path / "calibration.toml").write_text(HEAD + tables)
    return path


def loaded(path: Path, key: str) -> Calibration:
    calibration = load_calibration(path / "calibration.toml", None, DEGC)
    sensors = NAMES[key].example(1.0).sensors_degC
    if sensors:
        assert calibration.structure is not None
        calibration = dataclasses.replace(calibration, structure=calibration.structure.at(sensors))
    return calibration


def calibration_of(path: Path, key: str, by: float = 1.0) -> Calibration:
    return loaded(folder_of(path, key, by), key)


def values_of(calibration: Calibration, key: str) -> Any:
    return {source.key: values for source, values in calibration.sources()}.get(key)


def with_values(calibration: Calibration, key: str, values: Any) -> Calibration:
    field = NAMES[key].field
    if field:
        return dataclasses.replace(calibration, **{field: values})
    return dataclasses.replace(calibration, more=(*calibration.more, (key, values)))


def error_of(model: ErrorModel) -> np.ndarray:
    return model.error(POINTS, TOOL, PLAY)


def plain(value: Any) -> Any:
    """Values without arrays, to be compared."""
    if dataclasses.is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, tuple | list):
        return [plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


@each
def test_it_is_a_key_of_the_file_and_has_a_place_in_a_calibration(key: str) -> None:
    source = NAMES[key]
    assert len(NAMES) == len(SOURCES)
    assert source.schema is None or key in fields_of(CalibrationFile)
    assert not source.field or source.field in {f.name for f in dataclasses.fields(Calibration)}
    assert type(source).__doc__


@each
def test_the_files_that_it_names_are_found(key: str, tmp_path: Path) -> None:
    path = folder_of(tmp_path, key)
    wanted = sorted(path / name for name in NAMES[key].example(1.0).files)
    assert sorted(files_beside(path / "calibration.toml")) == wanted
    opened: list[Path] = []

    def read(name: Any) -> bytes:
        opened.append(Path(name))
        return Path(name).read_bytes()

    load_calibration(path / "calibration.toml", None, DEGC, read)
    assert sorted(opened) == sorted([path / "calibration.toml", *wanted])


@CHAIN
@each
def test_without_error_it_adds_nothing(key: str, chain: str, tmp_path: Path) -> None:
    none, some = (build(calibration_of(tmp_path, key, by), chain) for by in (0.0, 1.0))
    assert np.abs(error_of(none)).max() < 1e-15
    assert (np.abs(error_of(some)).max() > 1e-3) == NAMES[key].correctable
    names = [name for name, value in some.contributions(POINTS, TOOL, PLAY) if np.abs(value).max() > 1e-4]
    assert bool(names) == NAMES[key].correctable


@CHAIN
@each
def test_twice_the_error_moves_the_tip_twice_as_far(key: str, chain: str, tmp_path: Path) -> None:
    once, twice = (error_of(build(calibration_of(tmp_path, key, by), chain)) for by in (1.0, 2.0))
    # second order: 1e-4 rad turn errors of 0.02 mm
    np.testing.assert_allclose(twice, 2.0 * once, atol=4e-6)


@CHAIN
@each
def test_it_adds_to_the_curves(key: str, chain: str, tmp_path: Path) -> None:
    """Superposition; turns and contributions add as well."""
    curves = calibration_of(tmp_path / "curves", "curves")
    own = calibration_of(tmp_path / "own", key)
    both = with_values(curves, key, values_of(own, key))
    parts = [build(c, chain) for c in ((own,) if key == "curves" else (curves, own))]
    model = build(both, chain)
    np.testing.assert_allclose(error_of(model), sum(map(error_of, parts)), atol=4e-6)
    turns = [p.rotation(POINTS, PLAY, TOOL[3]) for p in (model, *parts)]
    np.testing.assert_allclose(turns[0], sum(turns[1:]), atol=1e-15)
    first = sum(value for _, value in model.contributions(POINTS, TOOL, PLAY))
    np.testing.assert_allclose(first, error_of(model), atol=4e-6)


@CHAIN
@each
def test_its_inverse_hits_the_target(key: str, chain: str, tmp_path: Path) -> None:
    model = build(calibration_of(tmp_path, key, 20.0), chain)
    command = invert(model, POINTS, TOOL, PLAY)
    reached = command + model.error(command, TOOL, PLAY)
    np.testing.assert_allclose(reached, POINTS, rtol=0.0, atol=1e-9)


@CHAIN
@each
def test_a_move_departs_from_its_chord_by_no_more_than_the_budget(
    key: str, chain: str, tmp_path: Path
) -> None:
    model = build(calibration_of(tmp_path, key), chain)
    reach = RANDOM.choice([1.0, 0.1, 0.01], (len(POINTS), 1))
    ends = POINTS + reach * (RANDOM.permutation(POINTS) - POINTS)
    bound = model.chord_bound(ends - POINTS, TOOL)
    first, last = model.error(POINTS, TOOL), model.error(ends, TOOL)
    for share in np.linspace(0.0, 1.0, 33)[1:-1]:
        inner = model.error(POINTS + share * (ends - POINTS), TOOL)
        departure = np.linalg.norm(inner - (first + share * (last - first)), axis=1)
        assert (departure <= bound * (1.0 + 1e-9) + 1e-13).all()


@CHAIN
@each
def test_the_bound_of_a_chord_is_that_of_its_own_tool(key: str, chain: str, tmp_path: Path) -> None:
    """Whatever the tools of the moves beside it."""
    model = build(calibration_of(tmp_path, key), chain)
    delta = RANDOM.permutation(POINTS) - POINTS
    tools = np.array([TOOL, [0.0, 30.0, -200.0, 5.0], [-40.0, 0.0, -80.0, 0.0]])
    alone = np.stack([model.chord_bound(delta, tool) for tool in tools])
    which = np.arange(len(delta)) % len(tools)
    mixed = model.chord_bound(delta, tools[which])
    np.testing.assert_array_equal(mixed, alone[which, np.arange(len(delta))])


@CHAIN
@each
def test_its_uncertainty_acts_as_a_difference_of_its_values_does(
    key: str, chain: str, tmp_path: Path
) -> None:
    """Finite differences; a source states a tenth of each value, here as one unknown behind all of them."""
    calibration = calibration_of(tmp_path / "one", key)
    known = load_uncertainty(tmp_path / "one" / "calibration.toml", calibration)
    entries = () if known is None else known.entries
    if not entries:
        assert not NAMES[key].entries(values_of(calibration, key), {})
        return
    together = [dataclasses.replace(e, factor=e.rest[:, None], rest=np.zeros(len(e.rest))) for e in entries]
    unknown = Uncertainty(tuple(together), fingerprint(calibration), "a test")
    rows = Sensitivity.of(calibration, chain, unknown).rows(POINTS, TOOL, PLAY)
    more, less = (build(calibration_of(tmp_path / str(by), key, by), chain) for by in (1.1, 0.9))
    # of half a difference of directions nothing is stated: the mean of both counts
    play = PLAY if {e.kind for e in entries} == {"backlash"} else None
    difference = 0.5 * (more.error(POINTS, TOOL, play) - less.error(POINTS, TOOL, play))
    np.testing.assert_allclose(rows[:, :, 0].T, difference, atol=2e-6)
    assert np.abs(difference).max() > 1e-4
    for entry, alone in zip(together, entries, strict=True):
        # of its own it is as large: everywhere where it is one number, else at its positions
        q = alone.position_mm if len(alone.rest) > 1 else POINTS[:, "XYZ".index(alone.name[-1])]
        size = np.linalg.norm(value_rows(alone, q), axis=1)
        np.testing.assert_allclose(size, np.abs(value_rows(entry, q)[:, 0]), rtol=1e-12)


@each
def test_inspect_tells_it(key: str, tmp_path: Path) -> None:
    without, once, twice = (
        machine_summary(Session.start(folder_of(tmp_path / str(n), k, by) / "machine.toml"))
        for n, (k, by) in enumerate(((None, 0.0), (key, 1.0), (key, 2.0)))
    )
    assert (once != without and twice != once) == (key not in NOT_SHOWN)


@each
def test_the_fingerprint_changes_with_it_and_with_nothing_else(key: str, tmp_path: Path) -> None:
    once, again, twice = (calibration_of(tmp_path / str(n), key, by) for n, by in enumerate((1.0, 1.0, 2.0)))
    assert fingerprint(once) == fingerprint(again)
    assert (fingerprint(once) != fingerprint(twice)) == NAMES[key].covered
    silent = loaded(folder_of(tmp_path / "note", key), key)
    text = (tmp_path / "note" / "calibration.toml").read_text()
    (tmp_path / "note" / "calibration.toml").write_text(f"# a note\n{text}")
    assert fingerprint(loaded(tmp_path / "note", key)) == fingerprint(silent) == fingerprint(once)


@each
def test_what_is_written_reads_back(key: str, tmp_path: Path) -> None:
    first = calibration_of(tmp_path / "first", key)
    second = tmp_path / "second"
    second.mkdir()
    files = calibration_files(first, second / "calibration.toml")
    write_files(files)
    again = loaded(second, key)
    assert plain(values_of(again, key)) == plain(values_of(first, key))
    assert plain(again) == plain(first)
    assert calibration_files(again, second / "calibration.toml") == files
    assert len(files) == 1 + len(NAMES[key].example(1.0).files)


@pytest.mark.parametrize("chain", sorted(CHAINS))
def test_all_of_them_at_once(chain: str, tmp_path: Path) -> None:
    """The examples fit together: what one leaves, another does not hold."""
    calibration = calibration_of(tmp_path, SOURCES[0].key)
    for key in NAMES:
        calibration = with_values(calibration, key, values_of(calibration_of(tmp_path / key, key), key))
    model = build(calibration, chain)
    command = invert(model, POINTS, TOOL, PLAY)
    np.testing.assert_allclose(command + model.error(command, TOOL, PLAY), POINTS, rtol=0.0, atol=1e-9)
