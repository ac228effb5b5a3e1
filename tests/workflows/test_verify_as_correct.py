"""`verify` says of a pair what `correct` says of it, and errors name the right text and line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.gate import FANUC, HEAD, box, scaled
from click.testing import CliRunner

import olp
from olp.cli import main
from olp.core.errors import Doubtful, OutsideBox, ProgramError

DELETED = HEAD + b"/G1 X100 Y0 Z0\nG1 X120 Y0 Z0\nM2\n"
#: A machine whose X error grows by 10 um each 100 mm.
GROWS: dict[str, Any] = scaled(10.0)


def made(folder: Path, swap: dict[str, str] | None = None, **more: Any) -> Path:
    path = machine(folder, GROWS["calibration"], GROWS["curves"], **({"tables": TRUE_ZERO} | more))
    for old, new in (swap or {}).items():
        for file in (path, path.with_name("calibration.toml")):
            file.write_text(file.read_text().replace(old, new, 1))
    return path


def said(result: olp.Correction | Any) -> list[dict[str, object]]:
    return [f.as_dict() for f in result.findings]


@pytest.mark.parametrize("text", [
    HEAD + b"G1 X100\nG1 Y100\nM2\n",
    HEAD + b"G81 X10 Y10 Z-21 R0\nX30\nG80\nG1 X100\nM2\n",
    HEAD + b"(olp off)\nG1 X90\n(olp on)\nG1 Y100\nM2\n",
    DELETED,
])  # fmt: skip
def test_outside_the_box_both_say_the_same(text: bytes, tmp_path: Path) -> None:
    path = made(tmp_path, box(80.0))
    done = olp.correct(text, path, outside_box="hold")
    assert "OLP403" in {f.code for f in done.findings}
    proved = olp.verify(text, done.data, path, outside_box="hold")
    assert said(proved) == said(done)
    assert proved.report["verdict"] == done.report["verdict"]
    with pytest.raises(OutsideBox) as refused:
        olp.correct(text, path)
    with pytest.raises(OutsideBox) as also:
        olp.verify(text, done.data, path, outside_box="refuse")
    assert (also.value.message, also.value.line) == (refused.value.message, refused.value.line)


def test_verify_takes_outside_box_on_the_command_line(tmp_path: Path) -> None:
    path = made(tmp_path, box(80.0))
    nominal, other = tmp_path / "a.ngc", tmp_path / "b.ngc"
    nominal.write_bytes(HEAD + b"G1 X100\nM2\n")
    other.write_bytes(olp.correct(nominal, path, outside_box="hold").data)
    words = ["verify", str(nominal), str(other), "-m", str(path)]
    assert CliRunner().invoke(main, words).exit_code == 0
    refused = CliRunner().invoke(main, [*words, "--outside-box", "refuse"])
    assert refused.exit_code == 3
    assert f"{nominal}:4: axis X would be commanded to" in refused.output


def test_verify_proves_with_the_block_delete_switch_on_too(tmp_path: Path) -> None:
    """With the switch off, Y100 is repeated by the block before; with it on, nothing says it."""
    path = made(tmp_path)
    nominal, other = tmp_path / "a.ngc", tmp_path / "b.ngc"
    nominal.write_bytes(HEAD + b"/G1 X100 Y50 Z0\nG1 X120 Y50 Z0\nM2\n")
    good = olp.correct(nominal, path).data
    other.write_bytes(good)
    assert "OLP304" in {f.code for f in olp.verify(nominal, other, path).findings}
    other.write_bytes(good.replace(b" Y50 Z0\nM2", b" Z0\nM2"))
    with pytest.raises(ProgramError, match="block delete") as caught:
        olp.verify(nominal, other, path)
    assert (caught.value.file, caught.value.line) == (str(nominal), 4)


def test_errors_of_verify_name_the_text_that_has_the_line(tmp_path: Path) -> None:
    path = machine(tmp_path, "[squareness]\nC0Y_urad = 50.0\nB0Z_urad = 50.0\n", tables=TRUE_ZERO)
    nominal, other = tmp_path / "a.ngc", tmp_path / "b.ngc"
    good = HEAD + b"G1 X100\nG1 Y100\nG1 X0\nM2\n"
    nominal.write_bytes(good)
    done = olp.correct(good, path).data

    def error(first: bytes, second: bytes) -> tuple[str | None, int | None]:
        nominal.write_bytes(first)
        other.write_bytes(second)
        with pytest.raises(ProgramError) as caught:
            olp.verify(nominal, other, path)
        return caught.value.file, caught.value.line

    assert error(HEAD + b"G5 X1\n", done) == (str(nominal), 4)
    assert error(good, done.replace(b"G1 Y100", b"G5 Y100")) == (str(other), 6)
    assert error(b"G21 G90 G54\nG1 X10 F100\nM2\n", done) == (str(nominal), 2)
    assert error(good, HEAD + b"M2\n") == (str(other), None)


def test_a_refused_contour_is_named_by_its_own_line(tmp_path: Path) -> None:
    tables = TRUE_ZERO + "[tools.1]\nZ_mm = 0.0\nradius_mm = 5.0\n[job_defaults]\ntool = 1\n"
    path = made(tmp_path, tables=tables)
    nominal, other = tmp_path / "a.ngc", tmp_path / "b.ngc"
    body = b"G41 D1 G1 X20 Y20\nX100\n%sY80\nX20\nG40 G1 X0 Y0\nM2\n"
    nominal.write_bytes(HEAD + body % b"")
    other.write_bytes(b"(one line more)\n" + HEAD + body % b"Y20.4\nX100.4\n")
    with pytest.raises(ProgramError) as caught:
        olp.verify(nominal, other, path)
    assert "does not fit into the corners of this move" in caught.value.message
    assert (caught.value.file, caught.value.line) == (str(other), 7)


def test_doubts_of_a_run_name_the_program_of_their_line(tmp_path: Path) -> None:
    swap = {"[axes.X]": "[check]\nlargest_correction_um = 9.0\n[axes.X]"}
    path = made(tmp_path, swap)
    nominal, other = tmp_path / "a.ngc", tmp_path / "b.ngc"
    nominal.write_bytes(HEAD + b"G1 X100\nM2\n")
    other.write_bytes(nominal.read_bytes())
    for call in (lambda: olp.verify(nominal, other, path), lambda: olp.correct(nominal, path)):
        with pytest.raises(Doubtful, match=re.escape(f"OLP409: line 4 of {nominal}: the error")):
            call()


def test_a_start_after_a_hole_is_a_finding_only_where_it_is_off(tmp_path: Path) -> None:
    text = HEAD + b"G0 X10 Y10 Z5\nG81 X20 Y10 Z-9 R0\nG80\nG1 Y100\nM2\n"
    plain = olp.correct(text, made(tmp_path / "a"))
    assert "OLP306" not in {f.code for f in plain.findings}
    tilted = machine(tmp_path / "b", "[squareness]\nB0Z_urad = 400.0\n", tables=TRUE_ZERO)
    done = olp.correct(text, tilted)
    (lean,) = [f for f in done.findings if f.code == "OLP306"]
    (line,) = lean.lines
    assert text.split(b"\n")[line - 1] == b"G1 Y100"
    of_line = np.nanmax(done.table.corrected[done.table.line == line]) * 1e3
    assert lean.message == (
        "1 feed moves start where a canned cycle or an uncorrected move ended; they are off by up to "
        f"{of_line:.2f} um"
    )
    assert of_line > 1.0


def test_numbers_without_a_point_count_increments_where_nothing_is_stated(tmp_path: Path) -> None:
    path = made(tmp_path, controller="fanuc")
    bare, pointed = (
        olp.correct(FANUC + text, path) for text in (b"G1 X100000\nX5.\nM30\n", b"G1 X100.\nX5.\nM30\n")
    )
    assert bare.report["deviation"]["before"] == pointed.report["deviation"]["before"]
    assert [f.line for f in bare.findings if f.code == "OLP302"] == [4]
    # 0 is 0 either way, and K counts holes
    for text in (b"G28 X0 Y0\nM30\n", b"G81 X1. Y1. Z-5. R2. K2\nG80\nM30\n", b"G0 X0 Y0 Z0\nM30\n"):
        codes = {f.code for f in olp.correct(FANUC + text, path).findings}
        assert not codes & {"OLP302", "OLP461"}, text
