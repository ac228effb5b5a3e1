"""Load compliance: payloads of the job, in comments and by line, through every verb; hand-worked."""

from __future__ import annotations

import datetime
import json
import re
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine, points, unstamped
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from judge.beam import under_the_load

import olp
from olp.cli import main
from olp.core.errors import ConfigError, ProgramError
from olp.core.machine import CHAINS
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.sources.beams import Beam, tube_mm4
from olp.errormodel.sources.maps import DeviationMap
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.writer import calibration_files
from olp.files.write import write_files
from olp.program.directives import with_payloads
from olp.workflows.session import Session

#: EZX = -X/100 um/kg, EBX = 2 urad/kg
LOAD = "X_mm,EZX_um_kg,EBX_urad_kg\n-1000,10,2\n2000,-20,2\n"
TABLE = '[[compliance]]\nfile = "load.csv"\ninterpolation = "linear"\n'
HEAD = "G21 G90 G54 G64 P0.001 Q0\nG0 X0 Y0 Z0\n"


def loaded(folder: Path, job: str = "", calibration: str = "", tables: str = TRUE_ZERO, **more) -> Path:
    curves = {"load.csv": LOAD}
    return machine(folder, calibration + TABLE, curves, tables=tables, job=job, **more)


def z_words(text: bytes) -> dict[int, float]:
    """Z by X at the end of each block, of a program that names X in each."""
    words, z = {}, 0.0
    for line in text.decode().splitlines():
        plain = re.sub(r"\([^)]*\)|;.*", "", line)
        letters = dict(re.findall(r"([XZ])([-+]?[\d.]+)", plain))
        z = float(letters.get("Z", z))
        if "X" in letters:
            words[round(float(letters["X"]))] = z
    return words


def test_a_payload_that_changes_in_the_program_worked_by_hand(tmp_path: Path) -> None:
    path = loaded(tmp_path)
    program = (
        f"{HEAD}G1 X100 F600\n(OLP PAYLOAD 30 kg)\nG0 X200\nG1 X300\nG0 X320 ; olp payload 5\n"
        "(olp payload 0)\nG0 X400\nG1 X500\nM2\n"
    ).encode()
    result = olp.correct(program, path)
    written = z_words(result.data)
    assert [written[x] for x in (100, 200, 300)] == [0.0, 0.06, 0.09]
    assert written[320] == 0.016  # 3.2 um/kg times 5 kg: the payload holds on its own line
    assert [written[x] for x in (400, 500)] == [0.0, 0.0]
    assert olp.verify(program, result.data, path).report["deviation"]["holds"]
    # the virtual machine: sags by 60 um at X200 as it is, and by nothing once corrected
    for text, sag in ((program, -0.06), (result.data, 0.0)):
        shown = olp.simulate(text, path, step_mm=1000.0)
        samples = np.flatnonzero(np.abs(shown.points_mm[:, 0] - 200.0) < 0.01)
        np.testing.assert_allclose(shown.points_mm[samples[-1], 2], sag, atol=6e-4)
    assert [f.code for f in result.findings] == []


def test_the_same_by_lines_of_the_job_file_and_as_one_text_for_every_later_verb(tmp_path: Path) -> None:
    body = HEAD + "G1 X100 F600\nG0 X200 ; fetch\nG1 X300\nG0 X400 (put down)\nM2\n"
    comments = body.replace("G0 X200 ;", "G0 X200 (OLP PAYLOAD 30) ;").replace(
        "G0 X400", "(OLP payload 0)G0 X400"
    )
    by_comment = olp.correct(comments.encode(), loaded(tmp_path / "a"))
    path = loaded(
        tmp_path / "b", "[[payloads]]\nline = 4\npayload_kg = 30\n[[payloads]]\nline = 6\npayload_kg = 0.0"
    )
    job = path.with_name("job.toml")
    by_line = olp.correct(body.encode(), path, job)
    assert z_words(by_line.data) == z_words(by_comment.data)
    assert z_words(by_line.data)[300] == 0.09
    text = unstamped(by_line.data).decode()
    assert "(OLP PAYLOAD 30 kg, line 4); fetch" in text
    assert "(put down) (OLP PAYLOAD 0 kg, line 6)\n" in text
    # lines of the corrected text are others: its comments hold, the table does not count again
    assert olp.verify(body.encode(), by_line.data, path, job).report["deviation"]["holds"]
    checked = olp.check(by_line.data, path, job, nominal=body.encode(), select=["OLP1", "OLP42"])
    assert checked.findings == ()
    shown = olp.simulate(by_line.data, path, job, step_mm=1.0)
    # before and after, the rapids start where the load that came or went has moved the tip
    cut = shown.points_mm[(shown.points_mm[:, 0] > 200.0) & (shown.points_mm[:, 0] < 300.0)]
    assert np.abs(cut[:, 2]).max() < 1.7e-3
    # another job file than the one that it was made with
    job.write_text(job.read_text().replace("= 30", "= 31"))
    with pytest.raises(ProgramError, match=r"are not those of .*in the job file"):
        olp.verify(body.encode(), by_line.data, path, job)


def test_lines_hold_where_a_program_is_unrolled(tmp_path: Path) -> None:
    body = HEAD + "#1 = 100\nO1 WHILE [#1 LT 400]\nG1 X#1 F600\n#1 = [#1 + 100]\nO1 ENDWHILE\nG0 X500\nM2\n"
    path = loaded(tmp_path, "[[payloads]]\nline = 8\npayload_kg = 30")
    result = olp.correct(body.encode(), path, path.with_name("job.toml"), flatten=True)
    assert z_words(result.data) == {0: 0.0, 100: 0.0, 200: 0.0, 300: 0.0, 500: 0.15}


@pytest.mark.parametrize("controller", ["linuxcnc", "fanuc", "haas", "grbl"])
@pytest.mark.parametrize("comment", ["(OLP PAYLOAD 30)", "( olp  Payload 30.0 KG )", "; Olp payload 30kg"])
def test_any_comment_of_the_dialect_in_any_case(tmp_path: Path, controller: str, comment: str) -> None:
    path = loaded(tmp_path, controller=controller)
    program = f"G21 G90 G54\nG0 X0. Y0. Z0.\n{comment}\nG0 X200.\nG1 X300. F600.\nM2\n".encode()
    assert z_words(olp.correct(program, path).data)[300] == 0.09


@pytest.mark.parametrize(
    ("comment", "words"),
    [
        ("(OLP PAYLOAD)", "olp PAYLOAD"),
        ("(OLP PAYLOAD thirty)", "(OLP PAYLOAD 30 kg)"),
        ("(OLP PAYLOAD 30 lb)", "mass in kg"),
        ("(OLP PAYLOAD -3)", "mass in kg"),
        ("(OLP PAYLOAD 3,5)", "mass in kg"),
        ("; olp paylod 30", "is not understood"),
        ("(olp payload 3)(olp payload 4)", "two payloads"),
        ("/M8 (olp payload 3)", "under block delete"),
    ],
)
def test_a_malformed_comment_is_refused_with_its_line(tmp_path: Path, comment: str, words: str) -> None:
    program = f"{HEAD}G1 X10 F600\n{comment}\nG1 X20\n".encode()
    for verb in (olp.correct, olp.simulate, olp.inspect):
        with pytest.raises(ProgramError, match=re.escape(words)) as caught:
            verb(program, loaded(tmp_path))
        assert caught.value.line == 4


def test_what_the_table_of_the_job_file_may_not_say(tmp_path: Path) -> None:
    path = loaded(tmp_path, "[[payloads]]\nline = 40\npayload_kg = 30")
    job = path.with_name("job.toml")
    with pytest.raises(ProgramError, match="names line 40, and the program has fewer"):
        olp.correct(HEAD.encode(), path, job)
    with pytest.raises(ProgramError, match="expected one of the two") as caught:
        olp.correct((HEAD + "(OLP PAYLOAD 3)\nG1 X1 F1\n").encode(), path, job)
    assert caught.value.line == 3
    job.write_text(job.read_text() + "[[payloads]]\nline = 3\npayload_kg = 3\n")
    with pytest.raises(ConfigError, match="line 3 after line 40"):
        olp.correct(HEAD.encode(), path, job)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_comment_is_put_at_the_end_of_its_line_and_nothing_else_changes(end: str) -> None:
    source = end.join(["%", "G1 X1", "", "N3 (a;b) G1 X2 ; c", "M2"]).encode()
    commented = with_payloads(source, {2: 0.5, 3: 1e-7, 4: 30.0}, (b"(", b")"))
    expected = end.join(
        [
            "%", "G1 X1 (OLP PAYLOAD 0.5 kg, line 2)", "(OLP PAYLOAD 0.0000001 kg, line 3)",
            "N3 (a;b) G1 X2  (OLP PAYLOAD 30 kg, line 4); c", "M2",
        ]
    )  # fmt: skip
    assert commented == expected.encode()
    assert with_payloads(commented, {2: 0.5, 3: 1e-7, 4: 30.0}, (b"(", b")")) == commented
    assert with_payloads(source, {}, (b"(", b")")) is source


def test_a_payload_as_while_measuring_changes_nothing(tmp_path: Path) -> None:
    path = loaded(tmp_path, "payload_kg = 12.5", "payload_kg = 12.5\n")
    program = (HEAD + "G1 X100 F600\nM2\n").encode()
    assert olp.correct(program, path, path.with_name("job.toml")).data == program
    lines = "[[payloads]]\nline = 3\npayload_kg = 12.5"
    other = loaded(tmp_path / "b", f"payload_kg = 12.5\n{lines}", "payload_kg = 12.5\n")
    assert olp.correct(program, other, other.with_name("job.toml")).data == program


def test_a_touch_off_under_load_holds_the_part_where_it_was_touched(tmp_path: Path) -> None:
    """Touched at X 100 with 30 kg: the tip was 30 um lower than the axis said, and so is the part."""
    body = HEAD + "G1 X100 F600\nG1 X300\nM2\n"
    touched = "[work_offsets.G54]\ntouched_at_mm = { X = 100.0, Y = 0.0, Z = 0.0 }\n"
    with_load = loaded(tmp_path / "a", "payload_kg = 30", tables=touched)
    text = olp.correct(body.encode(), with_load, with_load.with_name("job.toml")).data
    assert (z_words(text)[100], z_words(text)[300]) == (0.0, 0.06)
    without = loaded(tmp_path / "b", "payload_kg = 30", tables=touched + "touched_payload_kg = 0.0\n")
    text = olp.correct(body.encode(), without, without.with_name("job.toml")).data
    assert (z_words(text)[100], z_words(text)[300]) == (0.03, 0.09)


def test_a_feed_move_that_starts_with_a_jump_is_found(tmp_path: Path) -> None:
    path = loaded(tmp_path)
    cut = (HEAD + "G1 X200 F600\n(olp payload 30)\nG1 X300\nM2\n").encode()
    findings = {f.code: f for f in olp.correct(cut, path).findings}
    assert findings["OLP421"].line == 5
    assert "60 um" in findings["OLP421"].message


def test_error_at_a_place_takes_the_payload_of_the_job(tmp_path: Path) -> None:
    path = loaded(tmp_path, "payload_kg = 30")
    shown = olp.error_at(path, (200.0, 0.0, 0.0), (10.0, 0.0, -50.0), path.with_name("job.toml"))
    # EBX = 60 urad turns the tool: dX = EBX tz, dZ = -EBX tx
    np.testing.assert_allclose(shown["error_um"], [-3.0, 0.0, -60.0 - 0.6], atol=1e-9)
    np.testing.assert_allclose(shown["rotation_urad"], [0.0, 60.0, 0.0], atol=1e-9)
    assert shown["payload_kg"] == 30.0
    assert {row["name"] for row in shown["sources"]} == {"load EZX", "load EBX"}


# -- the model itself ------------------------------------------------------------------------------

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])


def tables(seed: int, interpolation: str, angle: float = 2e-6) -> tuple[ComponentTable, ...]:
    rng = np.random.default_rng(seed)
    tables = []
    for axis, arguments in (("X", ("X",)), ("Y", ("Y", "Z")), ("Z", ("X", "Y", "Z"))):
        knots = [np.linspace(*BOX["XYZ".index(a)], int(rng.integers(2, 6))) for a in arguments]
        shape = tuple(map(len, knots))
        columns = {
            f"E{d}{axis}": rng.normal(size=shape) * (1e-3 if d in "XYZ" else angle)
            for d in rng.choice(list("XYZABC"), 4, replace=False)
        }
        tables.append(
            ComponentTable(
                axis, arguments, tuple(knots), columns, tuple(BOX.mean(axis=1)), (5.0, 0.0, -100.0),
                str(rng.choice(["table", "functional-point"])), interpolation,
            )
        )  # fmt: skip
    return tuple(tables)


@pytest.mark.parametrize("chain", sorted(CHAINS))
def test_a_constant_sensitivity_is_a_curve_times_the_load(chain: str) -> None:
    """The same numbers as a curve, scaled by the mass, give the same error but for products of errors."""
    rng = np.random.default_rng(3)
    x = np.linspace(0.0, 800.0, 5)
    columns = {f"E{d}X": rng.normal(size=5) * (1e-4 if d in "XYZ" else 1e-7) for d in "XYZABC"}
    line, tool = (0.0, 100.0, -50.0), (0.0, 0.0, -120.0)
    table = ComponentTable("X", ("X",), (x,), columns, line, tool, interpolation="linear")
    scaled = {name: 20.0 * value for name, value in columns.items()}
    curve = Curve("X", x, scaled, line_mm=line, tool_mm=tool, interpolation="linear")
    load_model = build(Calibration("m", BOX, compliance=(table,), payload_kg=5.0), chain)
    curve_model = build(Calibration("m", BOX, curves=(curve,)), chain)
    points = rng.uniform(BOX[:, 0], BOX[:, 1], (300, 3))
    vector = np.array([20.0, -30.0, -200.0])
    error = load_model.error(points, np.append(vector, 25.0))
    np.testing.assert_allclose(error, curve_model.error(points, vector), atol=1e-7)
    np.testing.assert_allclose(
        load_model.rotation(points, None, 25.0), curve_model.rotation(points), atol=1e-18
    )
    # what products of errors depend on besides is left out
    assert not (load_model.depends_on & ~curve_model.depends_on).any()


def test_files_of_one_axis_measured_on_different_lines_share_their_lever_arms() -> None:
    """What holds for curves: a translation already holds what the angle of another file did on its line."""
    x = np.linspace(0.0, 800.0, 3)
    angle, straight = {"EBX": [0.0, 1e-6, 3e-6]}, {"EZX": [0.0, 1e-3, 0.0]}
    lines = ((0.0, 10.0, -300.0), (0.0, 100.0, -50.0))
    tools = ((0.0, 0.0, -120.0), (60.0, 0.0, -40.0))
    measured = list(zip((angle, straight), lines, tools, strict=True))
    load_model = build(
        Calibration(
            "m",
            BOX,
            compliance=tuple(
                ComponentTable("X", ("X",), (x,), c, li, t, interpolation="linear") for c, li, t in measured
            ),
        ),
        "FXYZ",
    )
    curves = tuple(Curve("X", x, c, line_mm=li, tool_mm=t, interpolation="linear") for c, li, t in measured)
    points = np.random.default_rng(1).uniform(BOX[:, 0], BOX[:, 1], (50, 3))
    vector = np.array([20.0, 5.0, -90.0])
    expected = build(Calibration("m", BOX, curves=curves), "FXYZ").error(points, vector)
    np.testing.assert_allclose(load_model.error(points, np.append(vector, 1.0)), expected, atol=1e-8)


def test_a_load_is_not_counted_twice() -> None:
    table = ComponentTable("X", ("X",), (BOX[0],), {"EZX": [0.0, 1e-3]})
    with pytest.raises(ConfigError, match="EZX is in compliance and in compliance"):
        Calibration("m", BOX, compliance=(table, table))
    with pytest.raises(ConfigError, match="what was measured holds the beam"):
        Calibration("m", BOX, compliance=(table,), beams=(Beam("X", "simple", (0.0, 800.0), 210.0, 1e8),))
    two = (Beam("X", "simple", (0.0, 800.0), 210.0, 1e8), Beam("X", "fixed", (0.0, 800.0), 210.0, 1e8))
    points, tool = np.array([[300.0, 0.0, 0.0]]), np.array([30.0, 0.0, -100.0, 20.0])
    one = [build(Calibration("m", BOX, beams=(b,)), "FXYZ").error(points, tool) for b in two]
    np.testing.assert_allclose(build(Calibration("m", BOX, beams=two), "FXYZ").error(points, tool), sum(one))


def test_the_error_is_linear_in_the_payload_and_its_sources_add() -> None:
    model = build(Calibration("m", BOX, compliance=tables(1, "cubic"), payload_kg=10.0), "YFXZ")
    rng = np.random.default_rng(2)
    points, vector = rng.uniform(BOX[:, 0], BOX[:, 1], (50, 3)), np.array([5.0, 6.0, -70.0])
    one = model.error(points, np.append(vector, 11.0))
    mass = rng.uniform(0.0, 60.0, 50)
    rows = np.column_stack([np.tile(vector, (50, 1)), mass])
    np.testing.assert_allclose(model.error(points, rows), one * (mass - 10.0)[:, None], atol=1e-14)
    np.testing.assert_array_equal(model.error(points, np.append(vector, 10.0)), np.zeros((50, 3)))
    parts = sum(v for _, v in model.contributions(points, rows))
    np.testing.assert_allclose(parts, model.error(points, rows), atol=1e-15)
    no_payload = model.error(points, vector)
    np.testing.assert_allclose(no_payload, -10.0 * one, atol=1e-14)


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from(["linear", "cubic"]), st.sampled_from(sorted(CHAINS)))
def test_the_chord_bound_holds_with_load(seed: int, interpolation: str, chain: str) -> None:
    model = build(Calibration("m", BOX, compliance=tables(seed, interpolation, 1e-5), payload_kg=7.0), chain)
    rng = np.random.default_rng(seed + 1)
    start, end = rng.uniform(BOX[:, 0], BOX[:, 1], (2, 40, 3))
    delta = (end - start) * 10.0 ** rng.uniform(-3.0, 0.0, (40, 1))
    tool = np.array([20.0, -40.0, -150.0, float(rng.uniform(0.0, 60.0))])
    share = np.linspace(0.0, 1.0, 65)
    points = start[:, None, :] + share[None, :, None] * delta[:, None, :]
    error = model.error(points.reshape(-1, 3), tool).reshape(points.shape)
    chord = error[:, :1] + share[None, :, None] * (error[:, -1:] - error[:, :1])
    departure = np.linalg.norm(error - chord, axis=2).max(axis=1)
    bound = model.chord_bound(delta, tool)
    assert np.all(departure <= bound * (1.0 + 1e-9) + 1e-15)
    assert np.all(model.chord_bound(0.7 * delta, tool) <= bound * (1.0 + 1e-12))


def test_an_unknown_axis_hides_only_what_depends_on_it() -> None:
    table = ComponentTable("Y", ("Y",), (BOX[1],), {"EZY": [0.0, 1e-3]})
    model = build(Calibration("m", BOX, compliance=(table,)), "FXYZ")
    error = model.error(np.array([[np.nan, 0.0, np.nan]]), np.array([0.0, 0.0, 0.0, 2.0]))
    np.testing.assert_allclose(error, [[0.0, 0.0, 1e-3]])
    hidden = model.error(np.array([[0.0, np.nan, 0.0]]), np.array([0.0, 0.0, 0.0, 2.0]))
    np.testing.assert_array_equal(hidden, [[0.0, 0.0, np.nan]])


# -- beams -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("support", ["simple", "fixed", "cantilever"])
@pytest.mark.parametrize("load_mm", [400.0, 1000.0, 1700.0])
def test_beams_agree_with_finite_differences(support: str, load_mm: float) -> None:
    section = tube_mm4(200.0, 300.0, 10.0)
    beam = Beam("X", support, (0.0, 2000.0), 210.0, section)
    deflection, slope = beam.bends(np.array([load_mm]))
    length = load_mm if support == "cantilever" else 2000.0  # a ram that is out by so much
    expected = under_the_load(support, length, load_mm, 1.0, 210e3 * section)
    assert deflection[0] == pytest.approx(expected[0], rel=2e-3)
    assert slope[0] == pytest.approx(expected[1], rel=5e-3, abs=1e-11)


def test_a_tube_and_the_published_figures_of_a_beam() -> None:
    """60 kg on 2 m: the figures of the note on load, 78 um in the middle and 60 urad at 1.6 m."""
    assert tube_mm4(100.0, 200.0, 50.0) == pytest.approx(100.0 * 200.0**3 / 12.0)
    stiffness = 60 * 9.80665 * 2000.0**3 / (48.0 * 0.078)  # E I of that beam, from 78 um
    beam = Beam("X", "simple", (0.0, 2000.0), 210.0, stiffness / 210e3)
    deflection, slope = (60.0 * v for v in beam.bends(np.array([1000.0, 1600.0])))
    assert deflection[0] == pytest.approx(0.078)
    assert abs(slope[1]) == pytest.approx(60e-6, rel=0.02)
    reverse = Beam("X", "simple", (2000.0, 0.0), 210.0, stiffness / 210e3)
    np.testing.assert_allclose(reverse.bends(np.array([700.0])), beam.bends(np.array([700.0])))


@pytest.mark.parametrize(
    ("axis", "direction", "angle", "sign"),
    [("X", "-Z", "EBX", 1), ("Y", "-Z", "EAY", -1), ("X", "+Y", "ECX", 1), ("Z", "-X", "EBZ", -1)],
)
def test_a_beam_turns_the_tool_as_a_rigid_body_on_it(
    axis: str, direction: str, angle: str, sign: int
) -> None:
    """The sag grows along the axis, so a point that is ahead on the carriage lies lower by slope times
    lever arm."""
    beam = Beam(axis, "cantilever", (-1000.0, 2000.0), 210.0, 1e8, direction)
    j, i = "XYZ".index(axis), "XYZ".index(direction[1])
    model = build(Calibration("m", np.array([[0.0, 500.0]] * 3), beams=(beam,)), "FXYZ")
    table = beam.table(np.array([[0.0, 500.0]] * 3), "FXYZ")
    assert np.all(np.sign(table.columns[angle]) == sign)
    ahead = np.zeros(4)
    ahead[j], ahead[3] = 50.0, 30.0
    points = np.array([[200.0, 200.0, 200.0]])
    slope = beam.bends(np.array([200.0]))[1]
    toward = 1.0 if direction[0] == "+" else -1.0
    change = model.error(points, ahead) - model.error(points, ahead * [0, 0, 0, 1])
    assert change[0, i] == pytest.approx(toward * 30.0 * slope[0] * 50.0, rel=1e-4)


def test_a_beam_in_the_files_of_a_machine(tmp_path: Path) -> None:
    table = (
        '[[compliance_beam]]\naxis = "X"\nsupport = "simple"\nspan_mm = [-1000, 2000]\nyoungs_modulus_GPa '
        "= 210\n"
        "section_mm = [200, 300, 10]\n"
    )
    path = machine(tmp_path, table, tables=TRUE_ZERO, job="payload_kg = 30")
    model = Session.start(path, path.with_name("job.toml")).loaded("refuse").model
    expected = 30 * 9.80665 * 3000.0**3 / (48 * 210e3 * tube_mm4(200, 300, 10))
    np.testing.assert_allclose(
        model.error(np.array([[500.0, 0, 0]]), np.array([0, 0, 0, 30.0])), [[0, 0, -expected]], rtol=1e-6
    )


def test_maps_loads_and_beams_are_written_and_read_back_the_same(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    x, y, z = (np.sort(rng.uniform(low, high, 3)) for low, high in BOX)
    levels = tuple(np.array([low, *k[1:2], high]) for k, (low, high) in zip((x, y, z), BOX, strict=True))
    whole = Calibration(
        "m",
        BOX,
        measured=datetime.date(2026, 5, 14),
        maps=(
            DeviationMap(levels, rng.normal(size=(3, 3, 3, 3)), tool_mm=(0.1, 2.0, -3.0)),
            DeviationMap(
                (*levels[:2], [-1.0]),
                rng.normal(size=(3, 3, 1, 3)),
                interpolation="cubic",
                holds_along=("Z",),
            ),
        ),
        compliance=tables(3, "linear")[1:],
        beams=(Beam("X", "simple", (0.0, 800.0), 210.0, 1.5e7, "+Y", (0.0, 1.0, 2.0)),),
        payload_kg=12.5,
    )
    write_files(calibration_files(whole, tmp_path / "c.toml"))
    again = load_calibration(tmp_path / "c.toml")
    assert (again.payload_kg, again.beams) == (whole.payload_kg, whole.beams)
    for one, two in zip(whole.maps, again.maps, strict=True):
        np.testing.assert_array_equal(one.values, two.values)
        assert (one.tool_mm, one.kind, one.interpolation) == (two.tool_mm, two.kind, two.interpolation)
    for one, two in zip(whole.compliance, again.compliance, strict=True):
        assert one.columns.keys() == two.columns.keys()
        for name in one.columns:
            np.testing.assert_array_equal(one.columns[name], two.columns[name])
        assert (one.arguments, one.tool_mm, one.reference) == (two.arguments, two.tool_mm, two.reference)
        others = ["XYZ".index(a) for a in "XYZ" if a != one.axis]
        assert [one.line_mm[k] for k in others] == [two.line_mm[k] for k in others]


def test_inspect_shows_maps_loads_and_payloads(tmp_path: Path) -> None:
    rows = [f"{x},{y},{z},1,2,2" for x in (-1000, 2000) for y in (-1000, 2000) for z in (-1000, 2000)]
    (tmp_path / "map.csv").write_text("X_mm,Y_mm,Z_mm,DX_um,DY_um,DZ_um\n" + "\n".join(rows))
    path = loaded(tmp_path, calibration='payload_kg = 5\n[[maps]]\nfile = "map.csv"\nkind = "residual"\n')
    done = CliRunner().invoke(main, ["inspect", str(path), "--json"])
    summary = json.loads(done.output)
    assert summary["maps"][0]["nodes"] == "2 x 2 x 2"
    assert summary["maps"][0]["max_um"] == pytest.approx(3.0)
    assert summary["load"][0] == {
        "name": "compliance load.csv: EZX", "by_position_of": "X", "max_um_kg": pytest.approx(20.0),
    }  # fmt: skip
    assert summary["load_measured_with"] == {"payload_kg": 5.0}
    assert "max urad kg" in CliRunner().invoke(main, ["inspect", str(path)]).output
    program = (HEAD + "G1 X10 F600\n(olp payload 30)\nG0 X20\nM2\n").encode()
    assert olp.inspect(program, path)["payloads_kg"] == [0.0, 30.0]


def test_the_stamp_changes_with_every_file_that_decides_the_model(tmp_path: Path) -> None:
    path = loaded(tmp_path)
    before = Session.start(path).loaded("refuse").digest
    (tmp_path / "load.csv").write_text(LOAD.replace("-20,2", "-21,2"))
    assert Session.start(path).loaded("refuse").digest != before


def test_the_review_page_and_a_comparison_take_the_payload(tmp_path: Path) -> None:
    path = loaded(tmp_path, "[[payloads]]\nline = 4\npayload_kg = 30")
    job, source = path.with_name("job.toml"), (HEAD + "G1 X100 F600\nG0 X200\nG1 X300\nM2\n").encode()
    page = olp.view(source, path, job)
    assert page is not None
    shown = olp.simulate(source, path, job, step_mm=5.0)
    (tmp_path / "measured.csv").write_bytes(shown.to_csv())
    comparison = olp.compare(source, [tmp_path / "measured.csv"], path, job)
    # 3 um/kg at X300
    assert comparison.report["after"]["across_um"]["max"] == pytest.approx(90.0, abs=0.1)


def test_payloads_between_the_holes_of_a_cycle_and_in_distances(tmp_path: Path) -> None:
    """A cycle takes the depth of each of its holes under the payload of its block; G91 counts differences."""
    path = loaded(tmp_path)
    holes = HEAD + "G81 X100 Z-5 R2 F100\n(olp payload 30)\nX200\nX300 (olp payload 10)\nG80\nM2\n"
    text = olp.correct(holes.encode(), path).data.decode()
    depth = [float(z) for z in re.findall(r"Z(-[\d.]+)", text)]
    assert depth == [-5.0, -4.94, -4.97]
    steps = HEAD + "(olp payload 30)\nG91\nG0 X100\nG0 X100\nG90\nM2\n"
    moved = points(olp.correct(steps.encode(), path).data)
    np.testing.assert_allclose(moved[1:, 2], [0.03, 0.06], atol=1e-9)


def test_planned_feeds_are_written_into_a_program_with_payloads_by_line(tmp_path: Path) -> None:
    path = loaded(tmp_path, "[[payloads]]\nline = 4\npayload_kg = 30")
    job, source = path.with_name("job.toml"), (HEAD + "G1 X1 F60000\nG1 X2\nG0 X300\nM2\n").encode()
    text = olp.retime(source, path, job).with_feeds()
    assert b"F60000" not in text
    assert z_words(olp.correct(text, path, job).data) == z_words(olp.correct(source, path, job).data)


# -- a value of a table is what was read at its own node ----------------------------------------------


@pytest.mark.parametrize("chain", sorted(CHAINS))
@pytest.mark.parametrize("arguments", [("Y", "Z"), ("X", "Y", "Z"), ("X", "Z"), ("X",)])
def test_at_its_own_nodes_a_table_gives_what_was_read(chain: str, arguments: tuple[str, ...]) -> None:
    rng = np.random.default_rng(4)
    datum, line, tool = (17.0, -40.0, 30.0), (300.0, 100.0, -50.0), (5.0, 2.0, -120.0)
    knots = tuple(np.linspace(*BOX["XYZ".index(a)], 3) for a in arguments)
    columns = {f"E{d}Y": rng.normal(size=(3,) * len(arguments)) * 1e-3 for d in "XYZ"}
    columns |= {f"E{d}Y": rng.normal(size=(3,) * len(arguments)) * 1e-5 for d in "ABC"}
    table = ComponentTable("Y", arguments, knots, columns, line, tool, interpolation="linear")
    model = build(Calibration("m", BOX, datum_mm=datum, compliance=(table,)), chain)
    nodes = np.tile(line, (3 ** len(arguments), 1))
    for k, levels in zip(arguments, np.meshgrid(*knots, indexing="ij"), strict=True):
        nodes[:, "XYZ".index(k)] = levels.ravel()
    read = np.stack([columns[f"E{d}Y"].ravel() for d in "XYZ"], axis=1)
    np.testing.assert_allclose(model.error(nodes, np.array([*tool, 1.0])), read, atol=1e-15)


def test_the_load_of_a_node_counts_from_no_axis_of_the_table(tmp_path: Path) -> None:
    """By hand: 10 urad/kg about X and a tip 60 mm below the gauge point; 1 um/kg was read at every node."""
    rows = "Y_mm,Z_mm,EYY_um_kg,EAY_urad_kg\n" + "".join(
        f"{y},{z},1,10\n" for y in (-1000, 2000) for z in (-1000, 2000)
    )
    load = '[[compliance]]\nfile = "load2.csv"\ntool_mm = [0.0, 0.0, -60.0]\nline_mm = { X = 100.0 }\n'
    path = machine(
        tmp_path, f'{load}interpolation = "linear"\n', {"load2.csv": rows},
        tables=TRUE_ZERO, job="payload_kg = 1.0",
    )  # fmt: skip
    job = path.with_name("job.toml")
    for z in (-300.0, 0.0, 200.0):
        shown = olp.error_at(path, (100.0, 200.0, z), (0.0, 0.0, -60.0), job)
        np.testing.assert_allclose(shown["error_um"], [0.0, 1.0, 0.0], atol=1e-9)
        # a tip 40 mm lower: 10 urad times -40 mm, against the axis
        shown = olp.error_at(path, (100.0, 200.0, z), (0.0, 0.0, -100.0), job)
        np.testing.assert_allclose(shown["error_um"], [0.0, 1.4, 0.0], atol=1e-9)


def test_an_axis_that_is_no_argument_stood_on_the_line_and_stays_in_the_file(tmp_path: Path) -> None:
    """The table carries the workpiece in X and is tabled by Z alone: an arm along X counts from line_mm."""
    table = ComponentTable(
        "X", ("Z",), (BOX[2],), {"EZX": [0.0, 0.0], "EBX": [1e-5, 1e-5]}, (300.0, 20.0, 0.0), (0.0, 0.0, 0.0)
    )
    calibration = Calibration(
        "m", BOX, compliance=(table,), measured=datetime.date(2026, 5, 14), temperature_degC=20.0
    )
    error = build(calibration, "XFYZ").error(np.array([[340.0, 0.0, -100.0]]), np.array([0.0, 0.0, 0.0, 1.0]))
    np.testing.assert_allclose(error, [[0.0, 0.0, -1e-5 * 40.0]], atol=1e-15)
    files = calibration_files(calibration, tmp_path / "calibration.toml")
    write_files(files)
    (again,) = load_calibration(tmp_path / "calibration.toml").compliance
    assert again.line_mm == (300.0, 20.0, 0.0)
