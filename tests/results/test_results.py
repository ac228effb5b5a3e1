"""Reported results of a measuring machine: the model runs forward, and only numbers of points change."""

from __future__ import annotations

import contextlib
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import example, given
from hypothesis import strategies as st
from judge import cmm
from judge.machines import Recipe, random_machine
from judge.model import JudgeModel

import olp
from olp.cli import main
from olp.core.errors import AlreadyCorrected, ConfigError, InputError, OlpError, OutsideBox, UsageError
from olp.program.text.delimited import detected_layout
from olp.program.text.numbers import number, written
from olp.results.dmis import read_dmis
from olp.results.table import read_table

OFFSET = np.array([210.0, 180.0, -260.0])
PART = np.array([[0.0, 0.0, 0.0], [150.0, 120.0, 80.0]])
FRAMES = {
    "G54": {"X_mm": 210.0, "Y_mm": 180.0, "Z_mm": -260.0, "set_by": "true"},
    "TOUCHED": {"X_mm": 210.0, "Y_mm": 180.0, "Z_mm": -260.0},
    "TURNED": {"X_mm": 210.0, "Y_mm": 180.0, "Z_mm": -260.0, "A_deg": 3.0, "B_deg": -8.0, "C_deg": 31.0,
               "set_by": "true"},
    "PART": {"X_mm": 210.0, "Y_mm": 180.0, "Z_mm": -380.0, "set_by": "true"},
}  # fmt: skip
STYLI = {
    1: {"Z_mm": 120.0, "radius_mm": 2.5},
    2: {"Z_mm": 120.0, "radius_mm": 1.5, "gauge_to_tip_mm": [40.0, -60.0, -120.0]},
}
BAR_MM = 2e-4


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cmm")
    recipe = Recipe(chain="FYXZ", off_datum=True, work_offsets=FRAMES, tools=STYLI)
    return random_machine(folder / "bridge", 5, recipe)


def truth(count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    return cmm.sphere(count, 3, *PART)


def csv(points: np.ndarray, normal: np.ndarray | None = None, head: str = "X_mm,Y_mm,Z_mm") -> bytes:
    rows = [head + (",I,J,K" if normal is not None else "")]
    for i, p in enumerate(points):
        cells = [f"{v:.6f}" for v in p]
        cells += [f"{v:.9f}" for v in normal[i]] if normal is not None else []
        rows.append(",".join(cells))
    return ("\n".join(rows) + "\n").encode()


def values(text: bytes) -> np.ndarray:
    rows = [r for r in text.decode().splitlines() if r and r[0] in "-0123456789."]
    return np.array([[float(v) for v in row.split(",")[:3]] for row in rows])


@pytest.mark.parametrize("noise_mm", [0.0, 3e-4])
@pytest.mark.parametrize(("frame", "angles"), [("G54", (0.0, 0.0, 0.0)), ("TURNED", (3.0, -8.0, 31.0))])
def test_true_points_are_recovered(
    machine: Path, frame: str, angles: tuple[float, float, float], noise_mm: float
) -> None:
    model = JudgeModel(machine)
    true, normal = truth()
    reported = cmm.report(
        model, true, normal, offset_mm=OFFSET, angles_deg=angles, stylus_mm=model.tool_vector_mm(2),
        radius_mm=1.5, noise_mm=noise_mm,
    )  # fmt: skip
    before = np.linalg.norm(reported - true, axis=1).max()
    result = olp.correct_results(csv(reported, normal), machine, frame=frame, tool=2)
    after = np.linalg.norm(values(result.data) - true, axis=1).max()
    assert before > 0.02
    assert after < BAR_MM + 5 * noise_mm
    if not noise_mm:
        assert result.report["correction"]["max_um"] == pytest.approx(before * 1e3, abs=0.01)


def test_the_model_runs_forward_and_not_backward(machine: Path) -> None:
    model = JudgeModel(machine)
    true, normal = truth()
    reported = cmm.report(
        model, true, normal, offset_mm=OFFSET, stylus_mm=model.tool_vector_mm(1), radius_mm=2.5
    )
    data = olp.correct_results(csv(reported, normal), machine, frame="G54").data
    centre = reported + 2.5 * normal + OFFSET
    added = values(data) - reported
    assert np.abs(added - model.error_mm(centre, model.tool_vector_mm(1))).max() < 2e-6


def test_a_zero_set_on_the_raw_machine_keeps_the_touched_point(machine: Path) -> None:
    model = JudgeModel(machine)
    true, normal = truth()
    reported = cmm.report(
        model, true, normal, offset_mm=OFFSET, stylus_mm=model.tool_vector_mm(1), radius_mm=2.5,
        zero_shift_mm=model.zero_shift("TOUCHED"),
    )  # fmt: skip
    good = values(olp.correct_results(csv(reported, normal), machine, frame="TOUCHED").data)
    bad = values(olp.correct_results(csv(reported, normal), machine, frame="G54").data)
    assert np.abs(good - true).max() < BAR_MM
    assert np.abs(bad - true).max() > 1e-3


def test_each_row_may_have_its_stylus(machine: Path) -> None:
    model = JudgeModel(machine)
    true, normal = truth(30)
    number_ = np.tile([1, 2], 15)
    tool_vector = np.array([model.tool_vector_mm(int(n)) for n in number_])
    reported = cmm.report(model, true, normal, offset_mm=OFFSET, stylus_mm=tool_vector, radius_mm=0.0)
    head = "X_mm,Y_mm,Z_mm,{}\n"
    by_number = head.format("tool") + "".join(
        f"{p[0]:.6f},{p[1]:.6f},{p[2]:.6f},{n}\n" for p, n in zip(reported, number_, strict=True)
    )
    by_vector = head.format("SX,SY,SZ") + "".join(
        f"{p[0]:.6f},{p[1]:.6f},{p[2]:.6f},{v[0]},{v[1]},{v[2]}\n"
        for p, v in zip(reported, tool_vector, strict=True)
    )
    for text in (by_number, by_vector):
        layout = detected_layout(text.splitlines()[:5])
        assert layout is not None
        layout = replace(layout, point="centre")
        data = olp.correct_results(text.encode(), machine, frame="G54", profile=layout).data
        assert np.abs(values(data) - true).max() < BAR_MM


def test_the_play_is_known_where_the_approach_is(tmp_path: Path) -> None:
    recipe = Recipe(work_offsets=FRAMES, tools=STYLI, backlash_um={"X": 6.0, "Y": 4.0, "Z": 5.0})
    machine = random_machine(tmp_path / "m", 8, recipe)
    model = JudgeModel(machine)
    true, normal = truth()
    reported = cmm.report(
        model, true, normal, offset_mm=OFFSET, stylus_mm=model.tool_vector_mm(1), radius_mm=2.5, play=True
    )
    profile = tmp_path / "p.toml"
    profile.write_text(
        'schema = "olp-points-1"\napproach_mm = 3.0\npoint = "surface"\n[columns]\n'
        'I = "I"\nJ = "J"\nK = "K"\n'
    )
    result = olp.correct_results(csv(reported, normal), machine, frame="G54", profile=profile)
    assert np.abs(values(result.data) - true).max() < BAR_MM
    blind = olp.correct_results(csv(reported, normal), machine, frame="G54")
    assert np.abs(values(blind.data) - true).max() > 1e-3
    assert "OLP103" in {f.code for f in blind.findings}


DMO = """DMISMN/'ENGINE BLOCK, OP 30',5.2
UNITS/MM,ANGDEC
DECPL/ALL,6
D(PART)=DATSET/DAT(A),ZDIR,ZORIG
SNSET/APPRCH,3.0
F(P1)=FEAT/POINT,CART,10.0,20.0,30.0,0,0,1
FA(P1)=FEAT/POINT,CART, {0:.6f}, {1:.6f}, {2:.6f}, {3:.9f}, {4:.9f}, {5:.9f}
$$ the next one goes on in a second line
FA(P2)=FEAT/POINT,CART,{6:.6f},{7:.6f},$
{8:.6f},{9:.9f},{10:.9f},{11:.9f}
FA(BORE)=FEAT/CIRCLE,INNER,CART,50.0021,60.0,10.0,0,0,1,20.0012
TA(POS1)=TOL/POS,2D,0.0250,INTOL
ENDFIL
"""


def dmo(points: np.ndarray, normal: np.ndarray) -> bytes:
    flat = np.hstack([points, normal]).ravel()
    return DMO.format(*flat).encode().replace(b"\n", b"\r\n")


def test_dmis_output_is_corrected_point_by_point(machine: Path) -> None:
    model = JudgeModel(machine)
    true, normal = truth(2)
    reported = cmm.report(
        model,
        true,
        normal,
        offset_mm=OFFSET - [0, 0, 120],
        stylus_mm=model.tool_vector_mm(1),
        radius_mm=2.5,
        ram=True,
    )
    source = dmo(reported, normal)
    result = olp.correct_results(source, machine)
    again = read_dmis(result.data)
    assert np.abs(again.value_mm - true).max() < BAR_MM
    assert again.normal == pytest.approx(normal, abs=1e-8)
    # nothing but the numbers of the points differs, and one comment in front
    stamp, _, rest = result.data.partition(b"\r\n")
    assert stamp.startswith(b"$$ olp-corrected ")
    blank = re.compile(rb"-?\d+\.\d{6}(?=[,$\r])")
    assert blank.sub(b"#", rest) == blank.sub(b"#", source)
    unchanged = [f for f in result.findings if f.code == "OLP622"]
    assert {f.line for f in unchanged} == {11, 12}


@pytest.mark.parametrize(("change", "line", "words"), [
    (("UNITS/MM,ANGDEC\r\n", ""), 6, "before any UNITS"),
    (("UNITS/MM,", "UNITS/FURLONG,"), 2, "FURLONG is not a unit"),
    (("POINT,CART, ", "POINT,POL, "), 7, "stated in POL"),
    (("ENDFIL", "GOTO/1,2,3"), 13, "part program"),
    (("D(PART)=DATSET/DAT(A),ZDIR,ZORIG\r\n", ""), None, "frame MCS is not defined"),
    (("DECPL/ALL,6", "TECOMP/MACHIN,ON"), None, ""),
    (("DECPL/ALL,6", "$$ volumetric compensation: ON"), 3, "corrected twice"),
    (("F(P1)=FEAT", "$$ a comment that goes on $\r\nF(P1)=FEAT"), 7, "may be part of it"),
])  # fmt: skip
def test_what_cannot_be_right_is_refused(
    machine: Path, change: tuple[str, str], line: int | None, words: str
) -> None:
    true, normal = truth(2)
    source = dmo(true, normal).replace(change[0].encode(), change[1].encode())
    if not words:
        findings = olp.correct_results(source, machine).findings
        assert "OLP625" in {f.code for f in findings}
        return
    with pytest.raises(OlpError, match=words) as caught:
        olp.correct_results(source, machine)
    assert caught.value.line == line


def test_a_stylus_of_a_file_is_looked_up_by_its_label(machine: Path, tmp_path: Path) -> None:
    true, normal = truth(2)
    source = dmo(true, normal).replace(b"SNSET/", b"SNSLCT/SA(Star_X)\r\nSNSET/")
    with pytest.raises(ConfigError, match="stylus Star_X is not defined"):
        olp.correct_results(source, machine)
    for file in machine.parent.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    here = tmp_path / "machine.toml"
    here.write_text(machine.read_text() + "[styli.STAR_X]\noffset_mm = [40.0, -60.0, -120.0]\n")
    model = JudgeModel(machine)
    tool_vector = np.array([40.0, -60.0, -120.0])
    result = olp.correct_results(source, here, tip_radius_mm=1.0)
    axis = true + 1.0 * normal + OFFSET - [0, 0, 120] - tool_vector
    assert np.abs(read_dmis(result.data).value_mm - true - model.error_mm(axis, tool_vector)).max() < 2e-6
    axis_mm = np.array([p["axis_mm"] for p in result.report["points"]])
    assert axis_mm == pytest.approx(axis, abs=2e-6)


def test_results_are_never_corrected_twice(machine: Path, tmp_path: Path) -> None:
    once = olp.correct_results(csv(truth()[0]), machine, frame="G54").data
    with pytest.raises(AlreadyCorrected, match="add the error twice"):
        olp.correct_results(once, machine, frame="G54")
    folder = machine.parent
    text = machine.read_text()
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "machine.toml").write_text(
        text.replace("compensated_by_controller = []", 'compensated_by_controller = "all"')
    )
    with pytest.raises(ConfigError, match="corrected twice"):
        olp.correct_results(csv(truth()[0]), tmp_path / "machine.toml", frame="G54")


@pytest.mark.parametrize(("text", "keys", "error", "words"), [
    (b"X;Y;Z\n1;2;3\n", {"frame": "G54"}, InputError, "states no unit"),
    (b"X_mm,Y_mm,Z_mm\n1,2,3\n", {}, InputError, "states no frame"),
    (b"X_mm,Y_mm,Z_mm\n1,2,3\n", {"frame": "G57"}, ConfigError, "G57 is not defined"),
    (b"X_mm,Y_mm,Z_mm\n1,2,3\n", {"frame": "G54", "tool": 7}, ConfigError, "stylus 7 is not defined"),
    (b"X_mm,Y_mm,Z_mm,tool\n1,2,3,A1\n", {"frame": "G54"}, ConfigError, "stylus A1 is not defined"),
    (b"X_mm,Y_mm,Z_mm,tool\n1,2,3,A\n1,2,3,B\n", {"frame": "G54", "tool": 1}, UsageError, "name each"),
    (b"X_mm,Y_mm,Z_mm\n1,2,x\n1,2\n", {"frame": "G54"}, InputError, "line 3: 2 columns"),
    (b"X_mm,Y_mm,Z_mm\n1,2,9999\n", {"frame": "G54"}, OutsideBox, "outside the calibrated box"),
    (b"", {"frame": "G54"}, InputError, "holds no points"),
    (b"\xff\xfeX\x00", {"frame": "G54"}, InputError, "does not show"),
])  # fmt: skip
def test_tables_that_cannot_be_right_are_refused(
    machine: Path, text: bytes, keys: dict[str, object], error: type[OlpError], words: str
) -> None:
    with pytest.raises(error, match=words):
        olp.correct_results(text, machine, **keys)


def test_names_of_the_file_lead_to_those_of_the_job(machine: Path) -> None:
    text = b"X_mm,Y_mm,Z_mm,tool\n1.000000,2.000000,3.000000,A\n1.000000,2.000000,3.000000,B\n"
    rows = values(olp.correct_results(text, machine, frame="G54", tool={"A": 1, "B": 2}).data)
    one = values(olp.correct_results(text[:-30], machine, frame="G54", tool=1).data)
    assert rows[0] == pytest.approx(one[0], abs=1e-9)
    assert np.abs(rows[1] - rows[0]).max() > 1e-4


def test_doubt_about_the_touch_is_stated(machine: Path) -> None:
    findings = olp.correct_results(csv(truth()[0]), machine, frame="G54").findings
    messages = {f.code: f.message for f in findings}
    message = messages.get("OLP623") or messages["OLP621"]
    assert "which side of the tip" in message or "OLP623" in messages


def test_columns_keep_their_edges(machine: Path) -> None:
    text = (
        b"  name       X_mm      Y_mm      Z_mm\n"
        b"   A1     9.9999    99.999   12.3456\n"
        b"   A22  100.0000     0.001   -1.0000\n"
    )
    data = olp.correct_results(text, machine, frame="G54").data
    rows = data.split(b"\n")[1:4]
    assert [len(r) for r in rows] == [len(r) for r in text.split(b"\n")[:3]]
    assert rows[0] == text.split(b"\n")[0]


NUMBERS = st.from_regex(r"[-+]?(0|[1-9][0-9]{0,5})?(\.[0-9]{1,6})?", fullmatch=True).filter(
    lambda s: any(c.isdigit() for c in s)
)


@pytest.mark.slow
@given(NUMBERS)
def test_a_number_written_again_is_the_same_text(text: str) -> None:
    form = number(text.encode())
    assert form is not None
    again = written(form, form.value)
    if form.value == 0.0 and text.startswith("-"):
        assert again == text[1:].encode()
    else:
        assert again == text.encode()


@pytest.mark.slow
@given(st.binary(max_size=300))
@example(b"\r")
@example(b"\n\r\n")
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    for reader in (read_dmis, lambda d: read_table(d, detected_layout(["X_mm,Y_mm,Z_mm"]))):  # type: ignore[arg-type]
        with contextlib.suppress(InputError):
            reader(data)


def test_the_command_line(machine: Path, tmp_path: Path) -> None:
    source = tmp_path / "run.csv"
    source.write_bytes(csv(truth()[0]))
    run = CliRunner()
    words = ["results", str(source), "-m", str(machine)]
    assert run.invoke(main, words).exit_code == 3
    done = run.invoke(main, [*words, "--frame", "G54", "--report", str(tmp_path / "r.md")])
    assert done.exit_code == 0, done.output
    assert "Error added to the points" in done.stdout
    assert "nothing was inverted" in (tmp_path / "r.md").read_text()
    assert b"olp-corrected" in (tmp_path / "run.corrected.csv").read_bytes()
    done = run.invoke(main, [*words, "--frame", "G54", "--force", "--json"])
    report = json.loads(done.stdout)
    assert report["schema"] == "olp-results-1"
    assert len(report["points"]) == 40
    assert run.invoke(main, [*words, "--frame", "G54", "--flatten"]).exit_code == 2
    assert run.invoke(main, ["correct", str(source), "-m", str(machine), "--frame", "G54"]).exit_code == 2
    piped = run.invoke(
        main, ["results", "-", "-m", str(machine), "--frame", "G54"], input=source.read_bytes()
    )
    assert piped.stdout_bytes == (tmp_path / "run.corrected.csv").read_bytes()
