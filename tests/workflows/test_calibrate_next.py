"""The readings that help most next: laws of the choice, what it gains, files and the command."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from cases.sequential import begun, chosen, residual_um, today
from click.testing import CliRunner
from judge import simulated

from olp.calibration.design import layout, line_offers, offers
from olp.calibration.design.choosing import Candidates, Criterion, alone, choose
from olp.calibration.design.known import Known, judged_rows
from olp.calibration.design.prediction import known_of_machines, parameters_of_machines, predict
from olp.calibration.observations.lines import line_block
from olp.cli import main
from olp.core.errors import UsageError
from olp.files.measurements.reader import load_measurements
from olp.workflows.calibrate_fit import fit_calibration
from olp.workflows.calibrate_next import plan_next

LINES = Path(__file__).resolve().parents[2] / "programs" / "gantry-lines"
MACHINE = LINES / "machine.toml"
BOX = np.array(simulated.BOX)


# -- the choice ------------------------------------------------------------------------------------------


def small(seed: int, shared: int) -> tuple[Candidates, np.ndarray]:
    """Eight candidates of two readings of five unknowns, and what is judged."""
    rng = np.random.default_rng(seed)
    scale = rng.uniform(0.2, 3.0, (8, 1, 1))
    return Candidates(scale * rng.normal(size=(8, 2, 5)), rng.normal(size=(8, 2, shared))), rng.normal(
        size=(1, 6, 5)
    )


def posterior(candidates: Candidates, index: tuple[int, ...]) -> np.ndarray:
    """The covariance of the unknowns after some candidates, by inverting the whole information."""
    rows = np.concatenate([candidates.rows, candidates.shared], axis=2)[list(index)].reshape(-1, 5 + 1)
    return np.linalg.inv(np.eye(6) + rows.T @ rows)[:5, :5]


@pytest.mark.parametrize("criterion", ["A", "D"])
@pytest.mark.parametrize("seed", range(8))
def test_no_exchange_of_one_candidate_is_better(seed: int, criterion: Criterion) -> None:
    candidates, judged = small(seed, 1)

    def cost(index: tuple[int, ...]) -> float:
        covariance = posterior(candidates, index)
        if criterion == "D":
            return float(np.linalg.det(covariance))
        return float(np.trace(judged[0] @ covariance @ judged[0].T))

    choice = choose(candidates, judged, 3, criterion)
    index = tuple(choice.index.tolist())
    assert len(set(index)) == 3
    swaps = [(*index[:k], one, *index[k + 1 :]) for k in range(3) for one in set(range(8)) - set(index)]
    assert cost(index) <= min(map(cost, swaps)) * (1.0 + 1e-9)
    for k in range(4):
        covariance = posterior(candidates, index[:k]) if k else np.eye(5)
        square = np.trace(judged[0] @ covariance @ judged[0].T) / 2.0
        assert choice.rms_mm[k] == pytest.approx(np.sqrt(square))
    lengths = np.diag(judged[0] @ posterior(candidates, index) @ judged[0].T).reshape(2, 3).sum(axis=1)
    assert choice.worst_mm == pytest.approx(np.sqrt(lengths.max()))


@pytest.mark.parametrize("seed", range(4))
def test_exchanges_beside_readings_that_tell_nearly_all(seed: int) -> None:
    """To give a reading back by a change of the covariance would leave rounding alone."""
    candidates, judged = small(seed, 1)
    rows = candidates.rows * np.array([1e6, 1.0, 1.0, 1.0, 1.0])
    fine = Candidates(rows, candidates.shared)
    choice = choose(fine, judged, 3, "A")
    for k in range(1, 4):
        square = np.trace(judged[0] @ posterior(fine, tuple(choice.index[:k].tolist())) @ judged[0].T) / 2.0
        assert choice.rms_mm[k] == pytest.approx(np.sqrt(square), rel=1e-3)
    best = min(
        np.trace(judged[0] @ posterior(fine, (a, b, c)) @ judged[0].T)
        for a in range(8) for b in range(a) for c in range(b)
    )  # fmt: skip
    assert choice.rms_mm[3] <= 1.2 * np.sqrt(best / 2.0)


@pytest.mark.parametrize("chain", ["FXYZ", "YFXZ", "XZFY"])
def test_what_a_line_would_read_is_what_the_adjustment_takes_it_for(chain: str) -> None:
    """Beside its zero, its slope, its scale and its drift."""
    unknowns = parameters_of_machines(chain, BOX)
    known = Known(unknowns.size, unknowns.design)
    for name in line_offers.READ:
        q = np.linspace(*BOX["XYZ".index(name[2])], 7)
        state = layout.line(name, q, (900.0, 400.0, -250.0), (30.0, -50.0, -120.0), BOX, None, "a.csv")
        taken = state.observation
        block = line_block(taken, unknowns, state.noise)
        (chunk,) = block.chunks()
        whole = np.zeros((len(chunk.y), unknowns.size))
        whole[:, block.columns] = chunk.rows
        offered = line_offers.read_rows(known, name, taken.line_mm, taken.tool_mm, taken.target_mm)
        rest = np.linalg.lstsq(chunk.local, offered - whole, rcond=None)
        assert np.abs(offered - whole - chunk.local @ rest[0]).max() < 1e-9 * np.abs(whole).max()


def test_readings_beside_their_own_unknowns() -> None:
    """Against the covariance that own unknowns add to the noise; a free one has a variance without bound."""
    rng = np.random.default_rng(3)
    rows, local = rng.normal(size=(9, 4)), rng.normal(size=(9, 2))
    reduced = alone(rows, local, np.array([0.0, 0.5]))
    noise = np.eye(9) + local @ np.diag([1e9, 2.0]) @ local.T
    assert np.allclose(reduced.T @ reduced, rows.T @ np.linalg.solve(noise, rows), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("instrument", ["tracker", "multilateration", "lines", "targets"])
def test_what_a_choice_predicts_is_what_the_adjustment_predicts(instrument: str) -> None:
    known = known_of_machines("FXYZ", BOX)
    tools = list(simulated.OFFSETS)
    if instrument == "tracker":
        offer, count = offers.points("m", known, BOX, tools, 0.005, 3), 20
    elif instrument == "lines":
        offer, count = line_offers.lines("m", known, BOX, tools[0], line_offers.READ, 3), 14
    elif instrument == "targets":
        offer, count = line_offers.targets("m", known, BOX, tools[0], ("EXX", "EYX", "ECX")), 12
    else:
        offer, count = offers.stations("m", known, BOX, tools, 60, 3), 4
    choice = choose(offer.candidates, judged_rows(known, BOX, tools[:1]), count, "A")
    prediction = predict(offer.planned(choice.index), "FXYZ", BOX, tools[:1])
    assert choice.rms_mm[-1] == pytest.approx(prediction.rms_mm, rel=0.02)
    assert choice.worst_mm == pytest.approx(prediction.worst_mm, rel=0.02)
    assert (np.diff(choice.rms_mm) < 0.0).all()


# -- what it gains ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_half_the_points_after_lines_reach_what_todays_plan_reaches() -> None:
    residuals = []
    for seed in range(2):
        machine, lines = begun(seed, "smooth", lines=True)
        half, whole = chosen(machine, lines, seed, 20, 0.008), today(machine, lines, seed, 40, 0.008)
        residuals.append((residual_um(machine, half), residual_um(machine, whole)))
    mean = np.sqrt(np.mean(np.square(residuals), axis=0))
    assert mean[0] <= mean[1]


# -- files and the command -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lines") / "calibration.toml"
    fit_calibration(LINES, MACHINE).write(path)
    return path


@pytest.mark.slow
def test_the_command_and_its_files(calibration: Path, tmp_path: Path) -> None:
    call = ["calibrate", "plan", "-m", str(MACHINE), "--next", "6", "--calibration", str(calibration)]
    done = CliRunner().invoke(
        main, [*call, "--instrument", "tracker", "--date", "2026-04-20", "-o", str(tmp_path), "--json"]
    )
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["schema"] == "olp-next-1"
    assert report["known_um"] > report["next"][0]["predicted_um"] > report["predicted_um"] > 0.0
    assert [row["number"] for row in report["next"]] == [1, 2, 3, 4, 5, 6]
    with (tmp_path / "points.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    read = {tuple(map(float, row[:6])) for row in rows[1:]}
    tools = {k: row["tool_mm"] for k, row in enumerate(report["reflectors"], start=1)}
    named = {(r["X_mm"], r["Y_mm"], r["Z_mm"], *tools[r["reflector"]]) for r in report["next"]}
    assert read == named
    box = np.array([report["box_mm"][axis] for axis in "XYZ"])
    places = np.array(sorted(read))[:, :3]
    assert (places >= box[:, 0]).all() and (places <= box[:, 1]).all()
    filled = [row[:6] + [f"{float(a) + float(b):.4f}" for a, b in zip(row[:3], row[3:6], strict=True)]
              for row in rows[1:]]  # fmt: skip
    text = "\n".join(",".join(row) for row in [rows[0], *filled]) + "\n"
    (tmp_path / "points.csv").write_text(text, "utf-8")
    taken = load_measurements([LINES, tmp_path / "measurements.toml"], "FXYZ")
    assert len(taken.scattered[-1].axis_mm) == 6
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".toml", ".ngc"}


@pytest.mark.slow
@pytest.mark.parametrize("instrument", ["lines", "targets"])
def test_lines_that_help_most_and_their_files(instrument: str, calibration: Path, tmp_path: Path) -> None:
    call = ["calibrate", "plan", "-m", str(MACHINE), "--next", "5", "--calibration", str(calibration)]
    done = CliRunner().invoke(
        main, [*call, "--instrument", instrument, "--date", "2026-05-14", "-o", str(tmp_path), "--json"]
    )
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["known_um"] > report["next"][0]["predicted_um"] >= report["predicted_um"] > 0.0
    for path in tmp_path.glob("*.csv"):
        text = path.read_text("utf-8").splitlines()
        path.write_text("\n".join([text[0], *(row + "0.0" for row in text[1:])]) + "\n", "utf-8")
    taken = load_measurements([tmp_path / "measurements.toml"], "FXYZ")
    named = {name for row in report["next"] for name in row["line"].split(" and ")}
    assert {line.component for line in taken.lines} == named
    for row in report["next"] if instrument == "targets" else ():
        (line,) = [line for line in taken.lines if line.component == row["line"]]
        assert np.abs(line.target_mm - row["target_mm"]).min() < 0.01
    # every line has its program: as many as there are places and sets of targets
    runs = {(line.axis, line.line_mm, line.target_mm.tobytes()) for line in taken.lines}
    assert len(list(tmp_path.glob("*.ngc"))) == len(runs)


@pytest.mark.slow
def test_what_is_known_changes_what_is_chosen(calibration: Path) -> None:
    def planned(**keys: object) -> dict:
        return plan_next(MACHINE, 4, instrument="tracker", **keys).report  # type: ignore[arg-type]

    lines, nothing = planned(calibration=calibration), planned()
    assert nothing["known_um"] > 20.0 * lines["known_um"]
    other = planned(calibration=calibration, criterion="D", sigma_um=1.0)
    assert other["predicted_um"] < lines["predicted_um"]
    assert [row["number"] for row in other["next"]] == [1, 2, 3, 4]
    places = [{(row["X_mm"], row["Y_mm"], row["Z_mm"], row["reflector"]) for row in one["next"]}
              for one in (lines, nothing, other)]  # fmt: skip
    assert places[0] != places[1] and places[0] != places[2]


def test_what_cannot_be_planned_is_refused() -> None:
    with pytest.raises(UsageError, match="2 points of a tracker cannot be planned; expected 4 to"):
        plan_next(MACHINE, 2, instrument="tracker")
    call = ["calibrate", "plan", "-m", str(MACHINE)]
    for options, words in (
        (["--calibration", "c.toml"], "are for --next N"),
        (["--criterion", "D"], "are for --next N"),
        (["--next", "5", "--instrument", "pods"], "chooses for tracker, multilateration, lines, targets"),
        (["--next", "5", "--component", "ECZ", "--instrument", "lines"], "ECZ is read by no line"),
        (["--next", "5", "--component", "EXX", "--instrument", "tracker"], "is for lines and targets"),
        (["--next", "41", "--component", "EXX", "--instrument", "targets"], "expected 1 to 40"),
        (["--instrument", "targets"], "are for --next N"),
        (["--next", "5", "--period-x", "10"], "without --period-x"),
    ):
        done = CliRunner().invoke(main, [*call, *options])
        assert done.exit_code == 2
        assert words in " ".join(done.output.split())


def test_a_calibration_without_uncertainty_is_refused(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(
        'schema = "olp-calibration-1"\nmachine = "gantry-1600"\nmeasured = 2026-05-14\n'
        'temperature_degC = 20.0\nsign = "actual-minus-commanded"\nmodel = "rigid-body"\n'
        "datum_mm = [0.0, 0.0, 0.0]\nbox_mm = [[20, 1580], [20, 980], [-440, -5]]\n"
        "active_during_measurement = []\n[squareness]\nC0Y_urad = 20.0\n",
        "utf-8",
    )
    call = ["calibrate", "plan", "-m", str(MACHINE), "--next", "5", "--calibration", str(tmp_path / "c.toml")]
    done = CliRunner().invoke(main, call)
    assert done.exit_code in (2, 3)
    assert "states no uncertainty" in done.output
