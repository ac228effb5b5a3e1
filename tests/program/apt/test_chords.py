"""Arcs in no plane of two axes: read as chords within 0.2 um, written as points or kept as they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases import posts
from cases.acceptance import unstamped
from judge import machines
from judge.cldata import read_apt
from judge.linuxcnc import RAPID
from judge.model import JudgeModel
from scipy.spatial import cKDTree

import olp
from olp.core.errors import ProgramError
from olp.core.toolpath import Kind
from olp.files.config import load_setup
from olp.program.program import Program
from olp.program.registry import DIALECTS, Options, read

ORIGIN = np.array([250.0, 200.0, -300.0])
LENGTHS = {1: 120.0}
RECIPE = machines.Recipe(increment_mm=0.0001)
#: tolerance, rounding to 0.1 um, and what a chord may be off
ALLOWED_UM = 1.0 + 0.09 + 0.2
LEANING = {"A_deg": 25.0, "B_deg": -10.0, "C_deg": 40.0}


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 7, RECIPE)


def program(text: str, path: Path) -> Program:
    return read(text.encode(), load_setup(path), DIALECTS["apt"], Options())


def turn(angles_deg: tuple[float, float, float]) -> np.ndarray:
    """About X first, then Y, then Z."""
    matrix = np.eye(3)
    for axis, angle in enumerate(np.radians(angles_deg)):
        one = np.eye(3)
        a, b = (axis + 1) % 3, (axis + 2) % 3
        one[a, a] = one[b, b] = np.cos(angle)
        one[a, b], one[b, a] = -np.sin(angle), np.sin(angle)
        matrix = one @ matrix
    return matrix


def spread(steps: list[posts.Step]) -> np.ndarray:
    """(n, 3) a job as points that are close together, those of arcs within 0.02 um of their chords."""
    here, points = steps[0].end, [steps[0].end[None]]
    for step in steps[1:]:
        share = np.linspace(0, 1, int(np.linalg.norm(step.end - here) / 0.1) + 2)[1:]
        way = here + share[:, None] * (step.end - here)
        if step.kind == "arc":
            assert step.centre is not None
            arm = (here - step.centre)[:2]
            radius = float(np.hypot(*arm))
            share = np.linspace(0, 1, int(abs(step.sweep) / np.sqrt(8 * 2e-5 / radius)) + 3)[1:]
            angle = np.arctan2(arm[1], arm[0]) + share * step.sweep
            size = radius + share * (np.hypot(*(step.end - step.centre)[:2]) - radius)
            flat = step.centre[:2] + size[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))
            way = np.column_stack((flat, here[2] + share * (step.end[2] - here[2])))
        points.append(way)
        here = step.end
    return np.vstack(points)


def off(point: np.ndarray, path: np.ndarray) -> np.ndarray:
    """(m,) distances of points from a polyline whose points are close together."""
    _, near = cKDTree(path).query(point)
    gaps = []
    for first in (np.maximum(near - 1, 0), np.minimum(near, len(path) - 2)):
        a, b = path[first], path[first + 1]
        along = ((point - a) * (b - a)).sum(axis=1) / np.maximum(((b - a) ** 2).sum(axis=1), 1e-30)
        gaps.append(np.linalg.norm(a + np.clip(along, 0, 1)[:, None] * (b - a) - point, axis=1))
    return np.minimum(*gaps)


@pytest.mark.parametrize("flavour", posts.FLAVOURS)
def test_arcs_of_a_leaning_part_are_proved_against_the_arcs_themselves(flavour: str, tmp_path: Path) -> None:
    frame = dict(zip(("X_mm", "Y_mm", "Z_mm"), ORIGIN.tolist(), strict=True)) | LEANING | {"set_by": "true"}
    recipe = replace(RECIPE, work_offsets={"G54": frame})
    path = machines.random_machine(tmp_path, 7, recipe)
    steps = posts.job(5, count=7, reach=100.0)
    data = posts.apt(steps, flavour)
    result = olp.correct(data, path)
    assert b"CIRCLE" not in result.data and b"MOVARC" not in result.data
    matrix = turn((25.0, -10.0, 40.0))
    moves = read_apt(result.data, {"G54": (matrix, ORIGIN)}, LENGTHS, tool=1)
    axis, model = np.array(moves.axis), JudgeModel(path)
    axis = np.vstack([axis[1:], (axis[1:] + axis[:-1]) / 2])
    reach = np.array([0.0, 0.0, -120.0])
    tips = axis + model.error_mm(axis, np.broadcast_to(reach, axis.shape)) + reach
    nominal = spread(steps) @ matrix.T + ORIGIN
    cuts = np.array(moves.kind[1:]) != RAPID
    assert off(tips[np.tile(cuts, 2)], nominal).max() <= ALLOWED_UM * 1e-3
    assert "OLP416" in {f.code for f in result.findings}
    assert olp.verify(data, result.data, path).report["deviation"]["holds"]
    still = machines.zero_machine(tmp_path, recipe)
    assert olp.correct(data, still).data == data


def test_an_arc_that_leans_in_the_program_and_not_on_the_machine_stays_an_arc(bent: Path) -> None:
    tilt = turn((30.0, 0.0, 0.0))
    rows = ",".join(f"{v:.9f}" for row in np.column_stack((tilt.T, np.zeros(3))) for v in row)
    start, centre, end = (p @ tilt.T for p in np.array([[20.0, 0, 0], [10, 0, 0], [10.0, 10, 0]]))
    text = f"UNITS/MM\nTRACUT/{rows}\n" + "".join(
        word + ",".join(f"{v:.6f}" for v in values) + "\n"
        for word, values in (
            ("RAPID\nGOTO/", start), ("CIRCLE/", (*centre, *tilt[:, 2], 10.0)), ("GOTO/", end),
        )
    )  # fmt: skip
    assert program(text, bent).toolpath.kind.tolist() == [Kind.RAPID, Kind.ARC_CCW]
    assert b"CIRCLE" in olp.correct(text.encode(), bent).data


ROUND = "UNITS/MM\nRAPID\nGOTO/10.0,0.0,0.0\nFEDRAT/500,MMPM\n{arc}GOTO/20,20,20\n"


@pytest.mark.parametrize(
    ("arc", "degrees", "rise"),
    [
        ("CIRCLE/0,0,0,0,-.6,.8,10\nGOTO/0,8,6\n", 90.0, 0.0),
        ("CIRCLE/0,0,0,0,.6,-.8,10\nGOTO/0,8,6\n", -270.0, 0.0),
        ("CIRCLE/0,0,0,0,-.6,.8\nGOTO/10,0,0\n", 360.0, 0.0),
        ("CIRCLE/0,0,0,0,-1.2,1.6,10,TIMES,2\nGOTO/0,8,6\n", 450.0, 0.0),
        ("MOVARC/0,0,0,0,-.6,.8,10,ANGLE,180\nGOTO/-10,-1.8,2.4\n", 180.0, 3.0),
        ("INDIRV/0,.8,.6\nTLON,GOFWD/(CYLNDR/0,0,0,$\n0,-.6,.8,10),ON,(LINE/0,0,0,$\n0,8,6)\n", 90.0, 0.0),
        (
            "INDIRV/0,-.8,-.6\nTLON,GOFWD/(CYLNDR/0,0,0,0,-.6,.8,10),ON,2,INTOF,(LINE/0,0,0,0,8,6)\n",
            -270.0,
            0.0,
        ),
    ],
)
def test_chords_lie_on_the_arc_and_the_arc_becomes_points(
    arc: str, degrees: float, rise: float, zero: Path, bent: Path
) -> None:
    text = ROUND.format(arc=arc)
    path = program(text, zero).toolpath
    points = path.end_mm - ORIGIN
    count = len(points) - 2
    across, normal = np.array([0.0, 0.8, 0.6]), np.array([0.0, -0.6, 0.8])
    for share in (0.25, 0.5, 1.0):
        # the end of a chord, and its middle
        angle = np.radians(degrees) * share
        want = 10 * (np.cos(angle) * np.array([1.0, 0, 0]) + np.sin(angle) * across) + rise * share * normal
        ends = points[: count + 1]
        middle = (ends[1:] + ends[:-1]) / 2
        near = np.sqrt(((np.vstack((ends, middle)) - want) ** 2).sum(axis=1)).min()
        assert near < np.radians(abs(degrees)) * 10 / count / 2
    size = points[:count] - np.outer(points[:count] @ normal, normal)
    assert np.abs(np.sqrt((size**2).sum(axis=1)) - 10).max() < 1e-9
    turned = np.degrees(np.unwrap(np.arctan2(points[: count + 1] @ across, points[: count + 1, 0])))
    assert turned[-1] - turned[0] == pytest.approx(degrees, abs=1e-6)
    assert 10 * (1 - np.cos(np.radians(abs(degrees)) / count / 2)) <= 2e-4
    assert olp.correct(text.encode(), zero).data == text.encode()
    result = olp.correct(text.encode(), bent)
    written = unstamped(result.data).decode()
    assert "CIRCLE" not in written and "MOVARC" not in written and "INDIRV" not in written
    assert written.count("GOTO") >= count + 2
    model, moves = JudgeModel(bent), read_apt(result.data, {"G54": (np.eye(3), ORIGIN)}, LENGTHS)
    axis = np.array(moves.axis)
    reach = np.array([0.0, 0.0, -120.0])
    tips = axis + model.error_mm(axis, np.broadcast_to(reach, axis.shape)) - ORIGIN
    gap = np.sqrt(((tips[:, None] - points[None]) ** 2).sum(axis=2))
    assert gap.min(axis=0).max() < 1e-3


def test_what_else_is_on_the_line_and_between_arc_and_end_stays(bent: Path) -> None:
    text = ("UNITS/MM\r\nRAPID\r\nGOTO / 10.0, 0.0, 0.0\r\nCIRCLE / 0,0,0, $ part\r\n").replace(
        " part", ""
    ) + " 0,-.6,.8,10\r\nFEDRAT / 90, MMPM\r\n$$ note\r\nGOTO / 0, 8, 6\r\nFINI\r\n"
    written = unstamped(olp.correct(text.encode(), bent).data).decode()
    lines = written.split("\r\n")
    assert lines[:2] == ["UNITS/MM", "RAPID"] and lines[-2:] == ["FINI", ""]
    assert lines[-5:-3] == ["FEDRAT / 90, MMPM", "$$ note"] and lines[-3].startswith("GOTO / ")
    assert all(line.startswith("GOTO / ") for line in lines[2:-5])
    assert "\n\n" not in written.replace("\r", "")


def test_feeds_after_an_arc_are_those_of_their_moves(zero: Path) -> None:
    text = ROUND.format(arc="CIRCLE/0,0,0,0,-.6,.8,10\nFEDRAT/60,MMPM\nGOTO/0,8,6\nFEDRAT/120,MMPM\n")
    done = program(text, zero)
    assert done.statements is not None
    feed = done.statements.feed_mm_s
    assert feed[-1] == 2.0 and (feed[1:-1] == 1.0).all() and len(feed) > 20


@pytest.mark.parametrize(
    ("arc", "line", "code", "words"),
    [
        ("CIRCLE/0,0,0,0,-.6,.8,10\nGODLTA/-10,8,6\n", 6, "OLP518", "ends with GODLTA"),
        ("CIRCLE/0,0,0,0,-.6,.8,11\nGOTO/0,8,6\n", 5, "OLP530", "states a radius of 11"),
        ("CIRCLE/0,0,0,0,0,0,10\nGOTO/0,8,6\n", 5, "OLP516", "the normal of an arc has no length"),
        ("MOVARC/0,0,0,0,-.6,.8,10,ANGLE,80\nGOTO/0,8,6\n", 5, "OLP530", "states an angle of 80"),
        ("RAPID\nCIRCLE/0,0,0,0,-.6,.8,10\nGOTO/0,8,6\n", 7, "OLP518", "an arc is at rapid"),
        ("RETRCT\nCIRCLE/0,0,0,0,-.6,.8,10\nGOTO/0,8,6\n", 6, "OLP524", "the start of the arc is not known"),
        (
            "GOTO/9E6,0,0\nCIRCLE/0,0,0,0,-.6,.8\nGOTO/0,72E5,54E5\n",
            6,
            "OLP512",
            "chords to be within 0.2 um",
        ),
    ],
)
def test_refusals(arc: str, line: int, code: str, words: str, zero: Path) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        program(ROUND.format(arc=arc), zero)
    assert (caught.value.line, caught.value.code) == (line, code)
