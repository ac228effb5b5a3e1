"""DMIS part programs: motion statements and nothing else, under the judge's model; and its rules."""

from __future__ import annotations

import difflib
import re
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import unstamped
from judge import machines
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Kind
from olp.files.config import load_setup
from olp.program.program import Program
from olp.program.registry import DIALECTS, read

TURN = np.radians(30.0)
PART = np.array([300.0, 220.0, -180.0])
FRAMES = {
    "MCS": {"set_by": "true"},
    "PART": {"X_mm": 300.0, "Y_mm": 220.0, "Z_mm": -180.0, "C_deg": 30.0, "set_by": "true"},
}
STYLI = '\n[styli.STAR2]\noffset_mm = [40.0, 0.0, -90.0]\n[styli."A0.0B0.0"]\noffset_mm = [0, 0, -150]\n'
STYLI += '[styli."A90.0B0.0"]\noffset_mm = [0, 120, -50]\n'
RECIPE = Recipe(controller="dmis", increment_mm=0.0001, work_offsets=FRAMES, job_defaults={})
NUMBER = rb"([-+]?(?:\d+\.?\d*|\.\d+))"
MOTION = re.compile(
    rb"(?im)^[ \t]*(?:GOTO|PTMEAS)[ \t]*/[ \t]*(?:CART[ \t]*,)?[ \t]*" + rb"[ \t]*,[ \t]*".join([NUMBER] * 3)
)
HEAD = "DMISMN/'PART',05.2\nUNITS/MM,ANGDEC\n"
HEAD += "S(STAR1)=SNSDEF/PROBE,FIXED,CART,0,0,-120.0,0,0,1,4.0\nMODE/PROG,MAN\n"
PROGRAM = (
    HEAD + "SNSLCT/S(STAR1)\nD(PART)=DATSET/DAT(A),ZDIR,ZORIG,DAT(B),XDIR\n"
    "F(H1)=FEAT/CIRCLE,INNER,CART,10,20,-5,0,0,1,16\n"
    "GOTO/CART,10.0000,20.0000,30.0000\nMEAS/CIRCLE,F(H1),3\nPTMEAS/CART,18.0,20.0,-5.0,-1,0,0\n"
    "PTMEAS/CART,10.0,28.0,-5.0,0,-1,0\nPTMEAS/CART,2.0,20.0,-5.0,1,0,0\nENDMES\nGOTO/10.0,20.0,30.0\n"
    "T(D1)=TOL/DIAM,0.05,-0.05\nOUTPUT/FA(H1),TA(D1)\nSNSLCT/S(STAR2)\nGOTO/10.0,20.0,40.0\n"
    "MEAS/POINT,F(P1),1\nPTMEAS/CART,60.0,-20.0,0.0,0,0,1\nENDMES\nENDFIL\n"
)


def described(path: Path) -> Path:
    path.write_text(path.read_text() + STYLI)
    return path


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return described(machines.random_machine(tmp_path_factory.mktemp("bent"), 11, RECIPE))


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return described(machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE))


def points(text: bytes) -> np.ndarray:
    return np.array([[float(g) for g in m.groups()] for m in MOTION.finditer(text)])


def program(text: str, path: Path) -> Program:
    return read(text.encode(), load_setup(path), DIALECTS["dmis"])


def refused(text: str, path: Path, line: int, words: str) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        program(text, path)
    assert caught.value.line == line


def test_a_nominal_alignment_corrects_the_probe_path(bent: Path, zero: Path) -> None:
    """The tip goes to the nominal points of the part, with each stylus as its lever."""
    data = PROGRAM.encode()
    assert olp.correct(data, zero).data == data
    result = olp.correct(data, bent)
    turn = np.array([[np.cos(TURN), -np.sin(TURN), 0], [np.sin(TURN), np.cos(TURN), 0], [0, 0, 1]])
    styli = np.array([[0, 0, -120.0]] * 5 + [[40.0, 0, -90.0]] * 2)
    place = [points(text) @ turn.T + PART - styli for text in (data, result.data)]
    model = JudgeModel(bent)
    off = place[1] + model.error_mm(place[1], styli) - place[0]
    assert np.abs(model.error_mm(place[0], styli)).max() > 5e-3
    assert np.abs(off).max() < 1.5e-4
    moves = result.report["moves"]
    assert moves["inserted_blocks"] == 0
    assert result.report["deviation"]["holds"]
    assert not {"OLP101", "OLP104", "OLP306"} & {f.code for f in result.findings}


def test_the_shipped_program_is_that_of_its_script_and_is_corrected() -> None:
    folder = Path(__file__).resolve().parents[3] / "programs"
    path = folder / "dmis-housing" / "housing.dmi"
    script = runpy.run_path(str(folder / "make" / "statements.py"))
    assert path.read_bytes() == script["housing"]()
    result = olp.correct(path, load_setup(None, path.with_name("job.toml")))
    assert result.report["deviation"]["holds"]
    assert result.report["moves"]["passed"] == 1


@pytest.mark.corpus
def test_only_coordinates_of_motion_statements_differ(corpus: Path, tmp_path: Path) -> None:
    frame = {"X_mm": 5.0, "Y_mm": 2.0, "Z_mm": -200.0, "set_by": "true"}
    names = ("MCS", *(f"COOR_{n:04d}" for n in range(1, 30)))
    wide = replace(RECIPE, travel=((-3000.0, 3000.0),) * 3, work_offsets=dict.fromkeys(names, frame))
    path = described(machines.random_machine(tmp_path, 5, wide))
    sources = sorted(corpus.glob("dmis/*"))
    for source in sources:
        data = source.read_bytes()
        corrected = unstamped(olp.correct(source, path).data)
        before, after = (re.split(rb"\r?\n", text) for text in (data, corrected))
        assert len(before) == len(after)
        changed = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
        assert changed
        for old, new in changed:
            assert MOTION.match(old), old
            assert MOTION.sub(b"@", old) == MOTION.sub(b"@", new)
            assert np.abs(points(old) - points(new)).max() < 0.1
    assert len(sources) >= 3
    assert difflib.SequenceMatcher(None, before, after).ratio() > 0.5


def test_points_under_manual_mode_are_left_to_the_person(bent: Path) -> None:
    manual = PROGRAM.replace("MODE/PROG,MAN", "MODE/MAN")
    result = olp.correct(manual.encode(), bent)
    assert result.data == manual.encode()
    moves = result.report["moves"]
    assert moves["passed"] == moves["total"] > 0


def test_thermal_compensation_is_warned_of(bent: Path) -> None:
    for statement in ("TECOMP/ON,0.0000105\n", "TEMPR/PART,23.8\n"):
        findings = olp.correct(PROGRAM.replace("MODE", statement + "MODE", 1).encode(), bent).findings
        assert "OLP412" in {f.code for f in findings}
    assert "OLP412" not in {f.code for f in olp.correct(PROGRAM.encode(), bent).findings}


def test_a_feature_without_points_leaves_the_position_unknown(zero: Path) -> None:
    text = HEAD + "GOTO/CART,1,2,3\nMEAS/PLANE,F(A),4\nENDMES\nGOTO/4,5,6\n"
    path = program(text, zero).toolpath
    assert ((path.flag & Flag.CONTROL) != 0).tolist() == [False, True, False]


def test_names_numbers_and_comments_may_be_broken(zero: Path) -> None:
    text = HEAD + "$$ a comment, $\n$$ and its end\nSNSL$\nCT/S(STA$\nR1)\nGOTO/CART,1.$\n5,-2,.2$\n5\n"
    broken = program(text, zero)
    assert broken.toolpath.end_mm[-1] == pytest.approx([1.5, -2.0, 120.25])
    refused(HEAD + "$$ a comment $\nGOTO/1,2,3\n", zero, 6, "may belong")


def test_units(zero: Path) -> None:
    path = program(HEAD.replace("MM", "INCH") + "GOTO/1,2,3\n", zero).toolpath
    assert path.end_mm[0] == pytest.approx([25.4, 50.8, 76.2])
    assert path.kind.tolist() == [Kind.RAPID]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("GOTO/X1,2,3\n", 5, "X1"),
        ("PTMEAS/CART,1,2,3,0,0,1\n", 5, "outside MEAS"),
        ("SNSLCT/S(GONE)\nGOTO/1,2,3\n", 6, "GONE"),
        ("D(OTHER)=TRANS/XORIG,FA(H1)\nGOTO/1,2,3\n", 6, "OTHER"),
        ("RECALL/D(OTHER)\nGOTO/1,2,3\n", 6, "OTHER"),
        ("IF/(A .EQ. 1)\nSNSLCT/S(STAR1)\nENDIF\n", 6, "run time"),
        ("M(A)=MACRO/\nGOTO/1,2,3\nENDMAC\n", 6, "macro A"),
        ("CALL/EXTERN,DMIS,M(B)\n", 5, "CALL"),
        ("JUMPTO/(L1)\n", 5, "JUMPTO"),
        ("PAMEAS/DISTANCE,.5,P(1)\n", 5, "PAMEAS is outside MEAS"),
        ("ROTAB/RT(1),INCR,90\n", 5, "ROTAB"),
        ("FROBNICATE/ON\n", 5, "FROBNICATE"),
        ("MEAS/POINT,F(A),1\nMEAS/POINT,F(B),1\n", 6, "inside MEAS"),
        ("DO/I,1,3\nGOTO/1,2,3\n", 6, "no end"),
    ],
)
def test_what_may_move_and_is_not_read_is_refused(zero: Path, text: str, line: int, words: str) -> None:
    refused(HEAD + text, zero, line, words)


def test_points_in_branches_and_loops_are_corrected(bent: Path) -> None:
    text = HEAD + "GOTO/1,2,-3\nIF/(A .EQ. 1)\nGOTO/10,20,-30\nELSE\nGOTO/40,20,-30\nENDIF\n"
    text += "DO/I,1,3\nGOTO/5,5,-5\nENDDO\n"
    result = olp.correct(text.encode(), bent)
    assert (points(result.data) != points(text.encode())).any(axis=1).all()


def test_no_datum_means_the_machine_and_has_to_be_said(tmp_path: Path) -> None:
    path = machines.zero_machine(tmp_path, replace(RECIPE, work_offsets={}))
    refused(HEAD + "GOTO/1,2,3\n", path, 5, "MCS")
