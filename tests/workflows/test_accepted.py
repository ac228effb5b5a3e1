"""What --accept lets go on: for one calibration alone, in every verb that doubts, as stamp and report say."""

from __future__ import annotations

import datetime
import json
import re
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.gate import HEAD, known, scaled, valued
from click.testing import CliRunner

import olp
from olp.checks.doubt_size import box_doubts
from olp.cli import main
from olp.core.errors import AlreadyCorrected, Doubtful, UsageError
from olp.errormodel.base import ErrorModel
from olp.findings.rule import Severity
from olp.workflows.session import Session

LATE = datetime.date(2100, 1, 1)
TEXT = HEAD + b"G1 X100\nM2\n"
LIST = b"# frame=G54\nX_mm,Y_mm,Z_mm\n10,20,30\n20,20,30\n"


def made(folder: Path, words: dict[str, Any], **more: Any) -> Path:
    return machine(folder, words["calibration"], words["curves"], **({"tables": TRUE_ZERO} | more))


@pytest.mark.parametrize(("text", "controller"), [
    (TEXT, "linuxcnc"), (TEXT.replace(b"\n", b"\r\n"), "linuxcnc"),
    (b"%\nO0001\n" + TEXT.replace(b" G64 P0.0001 Q0", b""), "fanuc"),
    (LIST, "list"),
    (b"UNITS/MM\nRAPID\nGOTO/-5,-10,0\nFEDRAT/600,MMPM\nGOTO/5,1,0\nFINI\n", "apt"),
])  # fmt: skip
def test_a_program_that_is_unchanged_bears_the_stamp_too(
    text: bytes, controller: str, tmp_path: Path
) -> None:
    path = made(tmp_path, valued(0.0, 0.0), controller=controller, keys='decimal_point = "calculator"\n')
    with pytest.raises(Doubtful):
        olp.verify(text, text, path)
    done = olp.correct(text, path, accept=["OLP440"])
    assert re.search(rb"olp-corrected [0-9a-f]{12} olp \S+ accepted OLP440", done.data)
    stamp = next(line for line in done.data.splitlines(keepends=True) if b"olp-corrected" in line)
    assert done.data.replace(stamp, b"", 1) == text
    assert done.report["accepted"] == ["OLP440"]
    assert olp.verify(text, done.data, path).report["accepted"] == ["OLP440"]
    with pytest.raises(AlreadyCorrected):
        olp.correct(done.data, path)


def test_without_a_comment_the_report_says_that_accept_is_needed_again(tmp_path: Path) -> None:
    path = made(tmp_path, scaled(10.0), controller="list", job='dialect = "layout.toml"\n')
    (tmp_path / "layout.toml").write_text(
        'schema = "olp-points-1"\ndelimiter = "comma"\ndecimal = "point"\nheader = true\nunit = "mm"\n'
        'frame = "G54"\nstamp = false\n[columns]\nX = "X_mm"\nY = "Y_mm"\nZ = "Z_mm"\n'
    )
    job = tmp_path / "job.toml"
    text = LIST.split(b"\n", 1)[1]
    done = olp.correct(text, path, job, date=LATE, accept=["OLP401"])
    assert b"olp-corrected" not in done.data
    said = [f.message for f in done.findings if f.code == "OLP626"]
    assert any("--accept OLP401 wherever this file is read" in message for message in said)
    with pytest.raises(Doubtful):
        olp.verify(text, done.data, path, job, date=LATE)
    proved = olp.verify(text, done.data, path, job, date=LATE, accept=["OLP401"])
    assert [f.as_dict() for f in proved.findings] == [f.as_dict() for f in done.findings]


def test_a_stamp_accepts_for_its_own_calibration_alone(tmp_path: Path) -> None:
    path = made(tmp_path, scaled(600.0))
    path.write_text(path.read_text().replace("[axes.X]", "[check]\nlargest_correction_um = 500.0\n[axes.X]"))
    done = olp.correct(TEXT, path, accept=["OLP409"])
    calls = (
        lambda: olp.verify(TEXT, done.data, path), lambda: olp.simulate(done.data, path),
        lambda: olp.retime(done.data, path), lambda: olp.view(TEXT, path, corrected=done.data, time=False),
    )  # fmt: skip
    for call in calls:
        call()
    assert olp.check(done.data, path).report["accepted"] == ["OLP409"]
    worse = scaled(6000.0)["curves"]["x.csv"]
    path.with_name("x.csv").write_text(worse)
    for call in calls:
        with pytest.raises(Doubtful, match="OLP409"):
            call()
    checked = olp.check(done.data, path)
    assert checked.report["accepted"] == []
    assert "OLP312" in {f.code for f in checked.findings}
    # without a calibration there is none that it could be of
    path.with_name("calibration.toml").unlink()
    assert olp.retime(done.data, path).report["accepted"] == []


def test_the_motion_on_the_page_accepts_what_the_proof_accepts(tmp_path: Path) -> None:
    """The stamp of a correction with sure components alone is that of another model."""
    words = known(0.01)
    words["calibration"] += '[[curves]]\nfile = "y.csv"\n'
    words["curves"]["y.csv"] = "Y_mm,EYY_um,sigma_EYY_um\n-1000,1,5\n2000,1,5\n"
    path = made(tmp_path, words)
    path.write_text(path.read_text().replace("[axes.X]", "[check]\nlargest_correction_um = 5.0\n[axes.X]"))
    done = olp.correct(TEXT, path, only_sure_components=True, accept=["OLP409"])
    page = olp.view(TEXT, path, corrected=done.data, only_sure_components=True)
    assert page.scene.report["accepted"] == ["OLP409"]


def cli(*words: object) -> tuple[int, str]:
    result = CliRunner().invoke(main, [str(word) for word in words])
    return result.exit_code, result.output


def test_every_verb_that_doubts_takes_accept(tmp_path: Path) -> None:
    """`compare` states the doubt and writes; `results` and `export` change what they are given."""
    path = made(tmp_path, scaled(10.0))
    program, points = tmp_path / "p.nc", tmp_path / "s.csv"
    program.write_bytes(TEXT)
    points.write_bytes(olp.simulate(program, path, step_mm=10.0).to_csv())
    late = ("-m", path, "--date", LATE)
    compared = ("compare", program, points, *late, "-q", "--part-tolerance-um", 50)
    assert cli(*compared)[0] == 1
    assert cli(*compared, "--accept", "OLP401") == (0, "")
    touched = tmp_path / "t.csv"
    touched.write_text("# frame=G54\nX_mm,Y_mm,Z_mm\n10.000,20,30\n20.000,20,30\n")
    output = tmp_path / "t.out.csv"
    corrected = ("results", touched, *late, "--tool", 0, "--tip-radius-mm", 0, "-o", output, "--json")
    code, text = cli(*corrected)
    assert (code, output.exists()) == (3, False), text
    assert "--accept OLP401 goes on" in text
    code, text = cli(*corrected, "--accept", "OLP401")
    assert code == 0, text
    assert json.loads(text[text.index("{") : text.rindex("}") + 1])["accepted"] == ["OLP401"]
    assert b"accepted OLP401" in output.read_bytes()
    shown = ("calibrate", "export", "--compare", "--program", program, *late)
    assert re.search("olp correct refuses the program: .*OLP401", cli(*shown)[1])
    _, text = cli(*shown, "--accept", "OLP401")
    assert "refuses" not in text
    assert "quality" not in text, "it is no error that a table could hold"
    for words in (compared, corrected, shown):
        assert cli(*words, "--accept", "OLP101")[0] == 2
    with pytest.raises(UsageError):
        olp.compare_tables(path, program=program, accept=["OLP101"])


def test_results_of_a_calibration_that_cannot_be_right_are_not_written(tmp_path: Path) -> None:
    path = made(tmp_path, {"calibration": "[squareness]\nC0Y_urad = 20100.0\n", "curves": {}})
    text = b"# frame=G54\nX_mm,Y_mm,Z_mm\n10,20,30\n20,20,30\n"
    with pytest.raises(Doubtful) as caught:
        olp.correct_results(text, path, tool=0, tip_radius_mm=0.0)
    assert set(caught.value.codes) == {"OLP445", "OLP446"}
    done = olp.correct_results(text, path, tool=0, tip_radius_mm=0.0, accept=["OLP445", "OLP446"])
    assert done.report["accepted"] == ["OLP445", "OLP446"]


def test_without_an_end_a_calibration_is_an_info_and_once_old_a_warning(tmp_path: Path) -> None:
    path = made(tmp_path, scaled(10.0))
    calibration = path.with_name("calibration.toml")
    calibration.write_text(calibration.read_text().replace("valid_until = 2099-01-01\n", ""))

    def doubts(date: datetime.date | None) -> list[tuple[str, Severity]]:
        return [(f.code, f.severity) for f in olp.correct(TEXT, path, date=date).findings]

    assert doubts(None) == doubts(datetime.date(2027, 1, 15)) == [("OLP462", Severity.INFO)]
    assert doubts(datetime.date(2027, 1, 16)) == [("OLP463", Severity.WARNING)]
    path.write_text(path.read_text().replace("[axes.X]", "[check]\ncalibration_days = 3\n[axes.X]"))
    assert doubts(datetime.date(2026, 1, 19)) == [("OLP463", Severity.WARNING)]


def test_the_error_in_the_box_is_computed_once_per_tool(tmp_path: Path) -> None:
    """Not once per tool change, nor per work offset."""
    loaded = Session.start(made(tmp_path, scaled(10.0))).loaded("hold")
    asked: list[Any] = []

    class Counting:
        box_mm = loaded.model.box_mm

        def error(self, points: Any, tool: Any) -> Any:
            asked.append(tool)
            return loaded.model.error(points, tool)

    tools = np.tile([[0.0, 0.0, -80.0], [0.0, 0.0, -120.0]], (5000, 1))
    model = cast(ErrorModel, Counting())
    assert box_doubts(model, tools, loaded.calibration, loaded.setup.machine) == []
    assert len(asked) == 2
