"""One table of judgements: what counts, one verdict, and the same words and figures wherever shown."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from cli.test_cli import run
from judge.machines import Recipe, random_machine, zero_machine
from judge.unpacker import Page

import olp
from olp.proof.proof import Counts
from olp.workflows.session import Session

ROOT = Path(__file__).resolve().parents[2] / "programs"
#: Shipped jobs by their job file.
JOBS = sorted(path for path in ROOT.glob("*/job*.toml") if path.parent.name not in ("dmis-housing",))
#: The same without backlash.
STIFF = Recipe(work_offsets={"G54": {"Z_mm": -100.0, "set_by": "true"}})
HEAD = b"G21 G90 G17 G54 G94 G61\n"
#: A machine with backlash on two axes, and a start that nobody knows.
PLAY = Recipe(backlash_um={"X": 14.0, "Y": 6.0}, work_offsets={"G54": {"Z_mm": -100.0, "set_by": "true"}})


def machine(folder: Path, seed: int = 4, recipe: Recipe = PLAY) -> Path:
    return random_machine(folder, seed, recipe)


def wrapped(text: str) -> str:
    return re.sub(r"\s+", " ", text)


# -- the same everywhere ---------------------------------------------------------------------------------


@pytest.mark.parametrize("job", JOBS, ids=lambda job: f"{job.parent.name}/{job.name}")
def test_every_consumer_says_the_same(job: Path, tmp_path: Path) -> None:
    out, report = tmp_path / "out.txt", tmp_path / "report.json"
    done = run("correct", "-j", job, "-o", out, "--report", report, "--fail-on", "never")
    assert done.exit_code == 0, done.stderr
    stated = json.loads(report.read_text())
    verdict = stated["verdict"]
    words = " ".join(verdict["sentences"])
    assert verdict["numerical"]["largest_um"] == stated["deviation"]["path_max_um"]
    assert verdict["numerical"]["holds"] is stated["deviation"]["holds"]
    assert words in wrapped(done.stdout)

    program = job.parent / tomllib.loads(job.read_text())["program"]
    verified = json.loads(run("verify", program, out, "-j", job, "--json", "--fail-on", "never").stdout)
    for key in ("verdict", "judgement", "deviation", "largest_correction_um", "worst"):
        assert verified[key] == stated[key], key

    for ending in (".html", ".md"):
        shown = tmp_path / f"shown{ending}"
        again = tmp_path / f"again{ending}.txt"
        assert (
            run("correct", "-j", job, "-o", again, "--report", shown, "-q", "--fail-on", "never").exit_code
            == 0
        )
        assert verdict["sentences"][0] in shown.read_text().replace("\\", "")

    options = ("check", "-j", job, "--fail-on", "never", "--format")
    checked = json.loads(run(*options, "json").stdout)
    assert checked["verdict"] == verdict
    assert words in wrapped(run(*options, "text").stdout)
    sarif = json.loads(run(*options, "sarif").stdout)
    assert sarif["runs"][0]["properties"]["verdict"] == verdict
    junit = ElementTree.fromstring(run(*options, "junit").stdout)
    assert [p.get("value") for p in junit.iter("property")] == verdict["sentences"]


@pytest.mark.parametrize("seed", range(3))
def test_the_page_shows_the_table(seed: int, tmp_path: Path) -> None:
    path = machine(tmp_path / "m", seed)
    text = HEAD + b"G0 X100 Y100 Z50\nG1 Z20 F600\nX400 Y180\nG2 X500 Y280 J100\nG1 Y150\nG0 Z50\nM2\n"
    done = olp.correct(text, path)
    page = Page(olp.view(text, path, correction=done, time=False).html())
    assert page.manifest["verdict"]["ok"] is done.report["verdict"]["ok"]
    assert page.manifest["verdict"]["text"] == " ".join(done.report["verdict"]["sentences"])
    table = done.table.by_line()
    rows = page.array(page.manifest["listing"]["row_nominal"]).astype(int)
    for key, column in (("error_um", "uncorrected_um"), ("result_um", "corrected_um")):
        shown = page.array(page.manifest["listing"][key])
        for line, value in zip(table["line"], table[column], strict=True):
            assert shown[rows == line][0] == pytest.approx(np.nan_to_num(value, nan=-1.0), abs=0.00501)
    state = page.array(page.manifest["listing"]["state"])
    assert [int(state[rows == line][0]) for line in table["line"]] == table["state"].tolist()
    largest = {s["layer"]: s["value"] for s in page.manifest["statistics"] if s["label"] == "largest"}
    assert largest["result"] == pytest.approx(done.report["verdict"]["numerical"]["largest_um"])


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
