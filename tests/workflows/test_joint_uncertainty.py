"""The uncertainty of poses that a report states: judged by machines drawn from the covariance, each loaded
from a calibration file of its own."""

from __future__ import annotations

import datetime
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import olp
from olp.calibration.joints.unknowns import Unknown
from olp.cli import main
from olp.core.errors import ConfigError
from olp.files.kinematics.covariance import JointCovariance, joint_covariance_bytes, lines_of

TRUNNION = Path(__file__).resolve().parents[2] / "programs" / "trunnion-mill" / "machine.toml"
NAMES = (("A", "Y_um", 18.0), ("A", "C_urad", -21.0), ("A", "zero_urad", 45.0), ("C", "X_um", 14.0),
         ("C", "B_urad", -27.0))  # fmt: skip
#: um and urad
SIGMA = np.array([4.0, 9.0, 12.0, 5.0, 8.0])
LIST = (
    "# joined=points\nX_mm,Y_mm,Z_mm,A_deg,C_deg\n0,0,60,0,0\n40,10,20,-20,30\n60,-20,25,-45,75\n"
    "-30,-20,5,-80,200\n10,50,0,10,-90\n"
)
HEAD = """schema = "olp-calibration-1"
machine = "trunnion-500"
measured = 2026-01-01
temperature_degC = 20.0
sign = "actual-minus-commanded"
model = "rigid-body"
box = { X_mm = [-290, 290], Y_mm = [-290, 290], Z_mm = [-290, 290], A_deg = [-115, 25], C_deg = [-400, 400] }
"""


def calibration(numbers: np.ndarray, covariance: str = "") -> str:
    tables = {"A": "", "C": ""}
    for (part, key, _), value in zip(NAMES, numbers.tolist(), strict=True):
        tables[part] += f"{key} = {value!r}\n"
    return HEAD + covariance + "".join(f"[location.{part}]\n{lines}" for part, lines in tables.items())


def machine_of(folder: Path, numbers: np.ndarray, covariance: str = "") -> Path:
    (folder / "calibration.toml").write_text(calibration(numbers, covariance))
    path = folder / "machine.toml"
    path.write_bytes(TRUNNION.read_bytes())
    return path


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray, np.ndarray]:
    """A machine with a covariance beside its calibration: its file, the numbers and their covariance."""
    folder = tmp_path_factory.mktemp("known")
    numbers = np.array([value for *_, value in NAMES])
    mixed = np.random.default_rng(5).normal(size=(5, 5)) * 0.4 + np.eye(5)
    correlation = mixed @ mixed.T
    size = SIGMA / np.sqrt(np.diag(correlation))
    covariance = correlation * np.outer(size, size)
    stated = '[covariance]\nfile = "c.npz"\ngrowth_per_year = 0.5\n'
    machine = machine_of(folder, numbers, stated)
    scale = np.array([1e-6 if "urad" in key else 1e-3 for _, key, _ in NAMES])
    unknowns = tuple(Unknown("location", part, key, 1.0) for part, key, _ in NAMES)
    lines = lines_of(olp.load_kinematics(machine_of(_folder(folder), numbers)).structure)
    table = JointCovariance(unknowns, covariance * np.outer(scale, scale), lines)
    values = tomllib.loads(calibration(numbers, stated))
    (folder / "c.npz").write_bytes(joint_covariance_bytes(table, values))
    return machine, numbers, covariance


def _folder(parent: Path) -> Path:
    (parent / "bare").mkdir(exist_ok=True)
    return parent / "bare"


def drawn_machines(known: tuple[Path, np.ndarray, np.ndarray], folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """(draws, n, 3) tips in mm and tool directions of drawn machines, each moved as one onto the mean."""
    _, numbers, covariance = known
    values = np.loadtxt(LIST.splitlines()[2:], delimiter=",")
    rng, tips, tools = np.random.default_rng(2), [], []
    for _ in range(160):
        own = machine_of(folder, rng.multivariate_normal(numbers, covariance))
        pose = olp.load_kinematics(own).actual(values)
        tips.append(pose.position)
        tools.append(pose.rotation[:, :, 2])
    mean = np.mean(tips, axis=0)
    for k, tip in enumerate(tips):
        # the best turn by singular values
        a, b = tip - tip.mean(axis=0), mean - mean.mean(axis=0)
        u, _, vt = np.linalg.svd(a.T @ b)
        turn = vt.T @ u.T
        tips[k], tools[k] = a @ turn.T, tools[k] @ turn.T
    return np.array(tips), np.array(tools)


def _worst(drawn: np.ndarray) -> np.ndarray:
    """(n,) standard deviations in the direction where they are largest, of draws (draws, n, 3)."""
    spread = (np.cov(drawn[:, n].T) for n in range(drawn.shape[1]))
    return np.array([np.sqrt(np.linalg.eigvalsh(one)[-1]) for one in spread])


def test_what_numbers_do_not_explain_is_part_of_every_band(
    known: tuple[Path, np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    """3 um of each coordinate, in quadrature; and of the probability of the whole program as of each end."""
    stated = f'[covariance]\nfile = "{known[0].parent.as_posix()}/c.npz"\nmisfit_um = 3.0\n'
    machine = machine_of(tmp_path, known[1], stated)
    without, more = (
        olp.correct_joints(LIST.encode(), one).report["uncertainty"] for one in (known[0], machine)
    )
    assert (without["misfit_um"], more["misfit_um"]) == (0.0, 3.0)
    added = np.hypot(without["band_um"]["max_um"], more["coverage_factor"] * 3.0)
    assert more["band_um"]["max_um"] == pytest.approx(added, rel=1e-9)
    assert more["band_urad"] == without["band_urad"]
    assert more["expected"]["after_rms_um"] > 3.0 * np.sqrt(3.0)
    radius = 1.2 * without["band_um"]["max_um"]
    sure, doubtful = (
        olp.correct_joints(LIST.encode(), one, part_tolerance_um=radius).report["part"]
        for one in (known[0], machine_of(tmp_path, known[1], stated.replace("= 3.0", "= 9.0")))
    )
    assert doubtful["probability"] < sure["probability"] - 0.2


@pytest.mark.slow
def test_what_is_stated_is_what_drawn_machines_do(
    known: tuple[Path, np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    report = olp.correct_joints(LIST.encode(), known[0]).report
    stated = report["uncertainty"]
    drawn, tools = drawn_machines(known, tmp_path)
    tip, turn = _worst(drawn), _worst(tools)
    assert stated["waypoints"] == 5 and stated["growth_by_age"] == 1.0
    assert {row["line"] for row in stated["lines"]} == {3, 4, 5, 6, 7}
    by_line = sorted(stated["lines"], key=lambda row: row["line"])
    assert [row["band_um"] for row in by_line] == pytest.approx(2e3 * tip, rel=0.25)
    assert [row["band_urad"] for row in by_line] == pytest.approx(2e6 * turn, rel=0.25)
    mean = np.mean([row["band_um"] for row in by_line] / (2e3 * tip))
    assert mean == pytest.approx(1.0, abs=0.1)
    assert stated["expected"]["after_rms_um"] > report["deviation"]["after"]["position_rms_um"]
    far_um = 1e3 * np.sort(np.linalg.norm(drawn - drawn.mean(axis=0), axis=2).max(axis=1))
    for share in (0.3, 0.8):
        radius = float(np.quantile(far_um, share))
        judged = olp.correct_joints(LIST.encode(), known[0], part_tolerance_um=radius)
        assert judged.report["part"]["probability"] == pytest.approx(share, abs=0.08)
        assert "OLP433" in [one.code for one in judged.findings] and judged.report["verdict"]["ok"] is None
    text = olp.correct_joints(LIST.encode(), known[0]).to_text()
    assert "Uncertainty of the poses, from the calibration" in text and "c.npz, at 5 waypoints" in text


def test_it_grows_with_age_and_without_covariance_nothing_is_said(
    known: tuple[Path, np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    now, later = (
        olp.correct_joints(LIST.encode(), known[0], date=day).report["uncertainty"]
        for day in (datetime.date(2026, 1, 1), datetime.date(2028, 1, 1))
    )
    assert later["band_um"]["max_um"] == pytest.approx(now["band_um"]["max_um"] * 2.0, rel=1e-3)
    bare = olp.correct_joints(LIST.encode(), machine_of(tmp_path, known[1]))
    assert "uncertainty" not in bare.report and "Uncertainty" not in bare.to_text()


def test_a_part_is_judged_and_runs_are_beside_what_is_known(
    known: tuple[Path, np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    """The tolerance of the job counts, too; a comparison states the bands of the correction."""
    (tmp_path / "job.toml").write_text('schema = "olp-job-1"\npart_tolerance_um = 0.5\n')
    done = olp.correct_joints(LIST.encode(), known[0], tmp_path / "job.toml")
    assert "OLP108" in [one.code for one in done.findings] and done.report["verdict"]["ok"] is False
    assert "ABOVE the part tolerance of 0.5 um" in done.to_text()
    wide = olp.check_joints(LIST.encode(), known[0], part_tolerance_um=500.0)
    assert wide.report["verdict"]["ok"] and "Within the part tolerance of 500 um" in wide.to_text()
    nominal, run = tmp_path / "nominal.csv", tmp_path / "run.csv"
    nominal.write_text(LIST)
    poses = olp.load_kinematics(known[0]).nominal(np.loadtxt(LIST.splitlines()[2:], delimiter=","))
    band_um = done.report["uncertainty"]["band_um"]
    for far_um, share in ((0.0, 1.0), (1.1 * band_um["max_um"], 0.0)):
        np.savetxt(
            run,
            poses.position + np.array((0.0, 0.0, far_um / 1e3)),
            delimiter=",",
            header="X_mm,Y_mm,Z_mm",
            comments="",
        )
        told = CliRunner().invoke(main, ["compare", *map(str, (nominal, run, "-m", known[0], "--json"))])
        part = json.loads(told.stdout)["uncertainty"]
        assert part["measured_within"] == share and part["band_um"] == pytest.approx(band_um)


@pytest.mark.slow
def test_the_page_has_the_bands(known: tuple[Path, np.ndarray, np.ndarray]) -> None:
    shown = olp.view_joints(LIST.encode(), known[0], part_tolerance_um=5.0, time=False).scene.uncertainty
    assert shown is not None and shown.within_mm == 0.005
    assert 0.002 < shown.band_mm.max() < 0.05
    beyond = {name: float(np.median(value)) for name, value in shown.beyond.items()}
    assert 0.0 < beyond["corrected"] < beyond["uncorrected"] <= 1.0


def test_a_calibration_that_was_changed_is_refused(
    known: tuple[Path, np.ndarray, np.ndarray], tmp_path: Path
) -> None:
    stated = '[covariance]\nfile = "c.npz"\n'
    machine = machine_of(tmp_path, known[1] + 1.0, stated)
    (tmp_path / "c.npz").write_bytes((known[0].parent / "c.npz").read_bytes())
    with pytest.raises(ConfigError, match="numbers have changed since"):
        olp.correct_joints(LIST.encode(), machine)
