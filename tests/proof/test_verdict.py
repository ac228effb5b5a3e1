"""One table of judgements: what counts, one verdict, and the same words and figures wherever shown."""

from __future__ import annotations

import pkgutil
import re
import tomllib
from collections.abc import Iterator
from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.consumers import Job, measured, measured_briefly, predicted
from cases.fast import left_to_a_campaign, some_of_a_campaign
from cases.joint_jobs import JOINT_JOBS
from cli.test_cli import run
from judge.machines import Recipe, random_machine, zero_machine
from judge.programs import random_program

import olp
from olp.proof.proof import Counts
from olp.workflows.session import Session

ROOT = Path(__file__).resolve().parents[2] / "programs"
#: Shipped jobs by their job file, on machines with three linear axes: the shortest of each machine.
JOBS = sorted(
    f"{path.parent.name}/{path.name}"
    for path in ROOT.glob("*/job*.toml")
    if path.parent.name not in ("dmis-housing", *JOINT_JOBS)
    and f"{path.parent.name}/{path.name}"
    not in (
        "gantry-plate/job.toml",
        "haas-mill/job-manifold.toml",
        "table-router/job.toml",
        "table-router/job-outline.toml",
    )
)
#: The same without backlash.
STIFF = Recipe(work_offsets={"G54": {"Z_mm": -100.0, "set_by": "true"}})
HEAD = b"G21 G90 G17 G54 G94 G61\n"
#: A machine with backlash on two axes, and a start that nobody knows.
PLAY = Recipe(backlash_um={"X": 14.0, "Y": 6.0}, work_offsets={"G54": {"Z_mm": -100.0, "set_by": "true"}})


def machine(folder: Path, seed: int = 4, recipe: Recipe = PLAY) -> Path:
    return random_machine(folder, seed, recipe)


# -- the same everywhere ---------------------------------------------------------------------------------


def job_of(path: Path, folder: Path) -> Job:
    return Job(path.parent / tomllib.loads(path.read_text())["program"], ("-j", path), folder)


def simulated(job: Job, program: Path, name: str, off_um: float = 0.0) -> Path:
    """A run of a program on the machine, shifted along the diagonal."""
    path = job.folder / name
    done = run("simulate", program, *job.setup, "--step-mm", "5", "-o", path, "--force", "-q")
    assert done.exit_code == 0, done.stderr
    head, columns, *rows = path.read_text().splitlines()
    values = np.array([row.split(",") for row in rows], float)
    values[:, :3] += off_um * 1e-3 / np.sqrt(3.0)
    table = [",".join(f"{v:.6f}" for v in row) for row in values.tolist()]
    path.write_text("\n".join([head, columns, *table]) + "\n")
    return path


def heard(job: Job, *, plots: bool = False) -> None:
    """All consumers of a job, also of two measured runs of it."""
    _, out = predicted(job, plots=plots)
    heard_of_runs(job, out, plots=plots)


def heard_of_runs(job: Job, out: Path, *, plots: bool = False) -> None:
    """All consumers of two measured runs of a corrected program."""
    files = [simulated(job, out, "first.csv"), simulated(job, out, "second.csv", 7.0)]
    measured(job, out, files, 5.0, plots=plots)
    measured_briefly(job, out, files[:1], None)


#: The cheapest of them, and one of another dialect.
SHORT = ("nasty/job.toml", "gantry-plate/job-bracket.toml")
#: A cut and a hole.
FEW = HEAD + b"G0 X100 Y100 Z50\nG1 X130 F600\nY110\nG0 Z60\nG81 X140 Y120 Z-60 R40 F300\nG80\nM2\n"
TEXT = HEAD + (
    b"G0 X100 Y100 Z50\nG1 Z20 F600\nX400 Y180\nG2 X500 Y280 J100\nG1 Y150\nG0 Z50\n"
    b"G81 X300 Y120 Z-60 R40 F300\nX350\nG80\nG0 X100 Y100\nM2\n"
)


def own_job(folder: Path, text: bytes = TEXT, seed: int = 4, recipe: Recipe = PLAY) -> Job:
    path = machine(folder / "m", seed, recipe)
    program = folder / "part.ngc"
    program.write_bytes(text)
    return Job(program, ("-m", path), folder)


@pytest.mark.slow
def test_page_and_compare_say_the_same_of_two_runs(tmp_path: Path) -> None:
    job = own_job(tmp_path, FEW)
    out = tmp_path / "out.ngc"
    out.write_bytes(olp.correct(job.program, **job.api).data)
    files = [simulated(job, out, "first.csv"), simulated(job, out, "second.csv", 7.0)]
    measured_briefly(job, out, files, 5.0)


@pytest.mark.slow
def test_every_consumer_says_the_same_of_holes_and_arcs(tmp_path: Path) -> None:
    heard(own_job(tmp_path), plots=True)


@pytest.mark.slow
@pytest.mark.parametrize("job", left_to_a_campaign(JOBS, set(JOBS) - {*SHORT}))
def test_every_consumer_says_the_same_of_every_shipped_job(job: str, tmp_path: Path) -> None:
    # plots are those of the test above
    heard(job_of(ROOT / job, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("seed", some_of_a_campaign((2, 0, 1), 3))
def test_every_consumer_says_the_same_of_random_jobs(seed: int, tmp_path: Path) -> None:
    features = ("lines", "short", "arcs", "helix", "circle", "incremental", "cycles", "rapid", "tools")
    text = random_program(seed, features=features, blocks=8)
    play = {"X": 14.0, "Y": 6.0} if seed % 2 else {}
    heard(own_job(tmp_path, text, seed, Recipe(backlash_um=play)))


@pytest.mark.slow
@pytest.mark.parametrize("unroll", [("--flatten",), ("--expand-cycles",)])
def test_every_consumer_says_the_same_of_unrolled_programs(unroll: tuple[str, ...], tmp_path: Path) -> None:
    job = own_job(tmp_path, FEW)
    heard(Job(job.program, job.setup, tmp_path, unroll))


def louder(said: Any) -> Any:
    """Another number, another verdict."""
    if isinstance(said, bool):
        return not said
    if isinstance(said, float):
        return said + 1.0
    if isinstance(said, bytes):
        return louder(said.decode()).encode()
    if isinstance(said, str):
        return re.sub(r"\d+\.\d\d(?= um| µm)", "98.76", said)
    if isinstance(said, dict):
        return {key: louder(value) for key, value in said.items()}
    if isinstance(said, list | tuple):
        return type(said)(louder(value) for value in said)
    if is_dataclass(said):
        return replace(said, report=louder(said.report))  # type: ignore[type-var]
    return [louder(value) for value in said] if isinstance(said, Iterator) else said


def in_result(function: Any) -> Any:
    return lambda *args, **words: louder(function(*args, **words))


def in_lines(function: Any) -> Any:
    return lambda scene, arrays, name, line, um: function(scene, arrays, name, line, um + 1.0)


def in_states(function: Any) -> Any:
    return lambda scene, arrays, name, line, state: function(scene, arrays, name, line, 1 - (state == 1))


def in_limit(function: Any) -> Any:
    return lambda path, runs, limit, sides: function(path, runs, limit + 1.0, sides)


def in_points(function: Any) -> Any:
    return lambda self: (part.replace(b",1,", b",0,") for part in function(self))


#: Every place in which a consumer has its say, and a contradiction planted there.
PLANTS = {
    "report: verdict": ("olp.workflows.proof.verdict", in_result),
    "report: worst blocks": ("olp.checks.correction.worst_blocks", in_result),
    "report: groups": ("olp.proof.judgement.Judgements.groups", in_result),
    "text": ("olp.reports.report._verdict", in_result),
    "document": ("olp.reports.document.to_markdown", in_result),
    "plots": ("olp.workflows.report._path_plots", in_limit),
    "verify": ("olp.workflows.verify.verify_programs", in_result),
    "check": ("olp.workflows.check._verdict", in_result),
    "check: text": ("olp.reports.check._verdict", in_result),
    "check: SARIF": ("olp.reports.check.FORMATS sarif", in_result),
    "check: JUnit": ("olp.reports.check.FORMATS junit", in_result),
    "page: verdict": ("olp.review.manifest._verdict", in_result),
    "page: statistics": ("olp.review.manifest.statistics", in_result),
    "page: pictures": ("olp.review.manifest.pictures", in_result),
    "page: removed": ("olp.review.manifest.removed", in_result),
    "page: lines": ("olp.review.judged._line_column", in_lines),
    "page: states": ("olp.review.judged._line_states", in_states),
    "compare: figures": ("olp.comparison.figures.Run.figures", in_result),
    "compare: worst lines": ("olp.proof.measured.Measured.worst", in_result),
    "compare: groups": ("olp.proof.measured.Measured._group", in_result),
    "compare: verdict": ("olp.proof.judgement.measured", in_result),
    "compare: text": ("olp.reports.compare._verdict", in_result),
    "compare: points": ("olp.workflows.compare.Comparison.to_csv", in_points),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTS)
def test_a_planted_contradiction_is_found(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target, plant = PLANTS[name]
    where, _, key = target.partition(" ")
    if key:
        formats = pkgutil.resolve_name(where)
        monkeypatch.setitem(formats, key, plant(formats[key]))
    else:
        monkeypatch.setattr(where, plant(pkgutil.resolve_name(where)))
    job, out = own_job(tmp_path, FEW), tmp_path / "out.ngc"
    if name.startswith("compare"):
        out.write_bytes(olp.correct(job.program, **job.api).data)
    with pytest.raises(AssertionError):
        if name.startswith("compare"):
            heard_of_runs(job, out)
        else:
            heard(job, plots=name == "plots")


# -- what counts -----------------------------------------------------------------------------------------


def test_rapids_are_shown_and_not_judged(tmp_path: Path) -> None:
    text = HEAD + b"G0 X100 Y100 Z50\nG1 X300 F600\nG0 Y200\nM2\n"
    table = olp.correct(text, machine(tmp_path)).table
    assert [Counts(c) for c in table.counts] == [Counts.RAPID, Counts.FEED, Counts.RAPID]
    assert not table.over[[0, 2]].any()
    assert table.by_line()["state"].tolist() == [2, 0, 2]


def test_a_program_without_feed_counts_at_its_points(tmp_path: Path) -> None:
    done = olp.correct(HEAD + b"G0 X100 Y100 Z50\nX300\nM2\n", machine(tmp_path, recipe=STIFF))
    assert (done.table.counts == Counts.POINT).all()
    assert done.report["verdict"]["numerical"]["holds"]


def test_the_backlash_is_taken_up_before_the_first_cut(tmp_path: Path) -> None:
    """Where nothing is known of the side, the rapid goes past its end and comes back."""
    path = machine(tmp_path)
    text = HEAD + b"G0 X100 Y100 Z50\nG1 X101 Y101 F600\nX200 Y200\nM2\n"
    done = olp.correct(text, path)
    assert done.report["verdict"]["ok"]
    assert not [f for f in done.findings if f.code == "OLP103"]
    lines = done.data.decode().splitlines()
    rapid = next(k for k, line in enumerate(lines) if line.startswith("G0"))
    first, second = (dict(re.findall(r"([XYZ])([-\d.]+)", lines[rapid + k])) for k in (0, 1))
    assert {axis: round(float(second[axis]) - float(first[axis]), 3) > 0 for axis in "XY"} == {
        "X": True,
        "Y": True,
    }
    assert float(second["X"]) - float(first["X"]) == pytest.approx(0.016, abs=0.003)


def test_an_unknown_side_is_part_of_the_deviation(tmp_path: Path) -> None:
    """A feed as the first move: no rapid can take the backlash up."""
    path = machine(tmp_path)
    job = tmp_path / "job.toml"
    job.write_text(
        'schema = "olp-job-1"\nmachine = "machine.toml"\nstart_mm = { X = 100.0, Y = 100.0, Z = -50.0 }\n'
    )
    done = olp.correct(HEAD + b"G1 X101 Y100 F600\nX200\nM2\n", path, job)
    assert {"OLP103", "OLP101"} <= {f.code for f in done.findings}
    assert done.report["verdict"]["numerical"]["largest_um"] >= 7.0
    assert done.report["verdict"]["ok"] is False


def test_a_cut_after_a_hole_counts_from_where_the_tool_is(tmp_path: Path) -> None:
    path = machine(tmp_path)
    text = HEAD + b"G0 X100 Y100 Z50\nG81 X150 Y150 Z-60 R10 F300\nG80\nG1 X200 F600\nM2\n"
    done = olp.correct(text, path)
    lean = [f for f in done.findings if f.code == "OLP306"]
    assert [f.line for f in lean] == [5]
    of_line = dict(zip(done.table.line.tolist(), done.table.corrected.tolist(), strict=True))
    assert f"{of_line[5] * 1e3:.2f} um" in lean[0].message
    # the beginning of the cut is where the hole ended, which is right at mid-depth and not here
    assert of_line[5] * 1e3 > 0.5


def test_the_whole_stroke_of_a_hole_counts(tmp_path: Path) -> None:
    """A hole that leans over its depth: half of the change of the error counts at either end."""
    path = machine(tmp_path)
    text = HEAD + b"G0 X100 Y100 Z50\nG81 X150 Y150 Z-90 R40 F300\nG80\nM2\n"
    done = olp.correct(text, path)
    assert (done.table.counts == Counts.HOLE).any()
    error = Session.start(path).loaded("hold").model.error
    top, bottom = (error(np.array([[150.0, 150.0, z - 100.0]]), np.zeros(3))[0, :2] for z in (40.0, -90.0))
    assert done.table.largest_mm() >= np.linalg.norm(top - bottom) / 2 - 0.0015


@pytest.mark.parametrize("off_mm", (0.004, 0.5, 5.0, -40.0))
def test_one_wrong_coordinate_is_a_figure_with_its_line(off_mm: float, tmp_path: Path) -> None:
    path = machine(tmp_path)
    text = HEAD + b"G0 X100 Y100 Z50\nG1 Z20 F600\nX400 Y180\nX410 Y100\nX300 Y110\nG0 Z50\nM2\n"
    done = olp.correct(text, path)
    good = done.table.by_line()
    blocks = done.data.decode().split("\n")
    wrong = next(k for k, block in enumerate(blocks) if re.match(r"X4(09|10)\.\d* Y(99|100)\.", block))
    blocks[wrong] = re.sub(r"X([-\d.]+)", lambda m: f"X{float(m[1]) + off_mm:.3f}", blocks[wrong], count=1)
    verified = olp.verify(text, "\n".join(blocks).encode(), path)
    assert verified.report["verdict"]["numerical"]["line"] in (5, 6)
    assert verified.report["verdict"]["numerical"]["largest_um"] == pytest.approx(abs(off_mm) * 1e3, rel=0.35)
    assert not verified.report["verdict"]["ok"]
    table = verified.table.by_line()
    others = ~np.isin(table["line"], (5, 6))
    assert table["corrected_um"][others] == pytest.approx(good["corrected_um"][others], abs=0.02, nan_ok=True)


def test_a_program_of_another_job_is_refused(tmp_path: Path) -> None:
    path = machine(tmp_path)
    text = HEAD + b"G0 X100 Y100 Z50\nG1 Z20 F600\nX400 Y180\nM2\n"
    other = HEAD + b"G0 X10 Y300 Z50\nG1 Z2 F600\nX40 Y18\nM2\n"
    with pytest.raises(olp.OlpError, match="not a correction of this program"):
        olp.verify(text, other, path)


# -- two questions, two answers --------------------------------------------------------------------------


def test_without_a_part_tolerance_there_is_no_probability(tmp_path: Path) -> None:
    path = machine(tmp_path)
    text = HEAD + b"G0 X100 Y100 Z50\nG1 X300 F600\nM2\n"
    done = olp.correct(text, path)
    assert done.report["verdict"]["part"] is None
    assert "uncertainty" not in done.report
    assert done.confidence is None


@pytest.mark.parametrize(("part_um", "holds"), [(0.01, False), (50.0, True)])
def test_the_part_tolerance_has_its_own_sentence(part_um: float, holds: bool, tmp_path: Path) -> None:
    path = machine(tmp_path)
    text = HEAD + b"G0 X100 Y100 Z50\nG1 X300 Y177 F600\nM2\n"
    done = olp.correct(text, path, part_tolerance_um=part_um)
    verdict = done.report["verdict"]
    assert verdict["numerical"]["holds"] is True
    assert verdict["part"]["holds"] is holds
    assert verdict["ok"] is holds
    assert len(verdict["sentences"]) == 2
    assert ("OLP108" in {f.code for f in done.findings}) is not holds


def test_another_error_fails_the_verdict_too(tmp_path: Path) -> None:
    folder = zero_machine(tmp_path).parent
    text = HEAD + b"G0 X0 Y0 Z0\nG1 X100000 F600\nM2\n"
    done: dict[str, Any] = dict(
        olp.correct(text, folder / "machine.toml", outside_box="hold").report["verdict"]
    )
    assert done["numerical"]["holds"]
    assert done["errors"] == ["OLP402"]
    assert done["ok"] is False
    assert "OLP402" in done["sentences"][-1]
