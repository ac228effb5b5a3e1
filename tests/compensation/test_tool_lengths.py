"""Tool lengths that were set on the uncompensated machine, worked by hand.

Along X the machine leaves Z by 0.1 um/mm, and X by 7 um everywhere. The work offset was touched at X 100 (Z
10 um), tool 1 was set at X 200 (20 um) and tool 2 at X 300 (30 um). Programs cut at X 0, where Z has none.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped, words
from judge.model import JudgeModel

import olp
from olp.compensation.plan import zero_shifts
from olp.core.errors import ConfigError
from olp.core.toolpath import Frame, LengthError
from olp.errormodel.entry import alone
from olp.errormodel.sensitivity import Sensitivity
from olp.errormodel.uncertainty import Uncertainty, fingerprint
from olp.files.calibration.reader import load_calibration
from olp.files.config import load_machine, load_setup
from olp.files.starter import machine_toml
from olp.program.frames import length_errors_of
from olp.program.registry import DIALECTS, read
from olp.uncertainty.spread import Unknowns
from olp.workflows.session import Session

CURVES = {"x.csv": "X_mm,EXX_um,EZX_um\n-1000,7,-100\n2000,7,200\n"}
CALIBRATION = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
TOUCHED = "[work_offsets.G54]\ntouched_at_mm = { X = 100.0, Y = 0.0, Z = 100.0 }\ntouch_tool = 1\n"
HEAD = b"G21 G90 G54\n"
#: Where the tip has to be in Z in um, once the touched point is held: 10 um, and what the lengths add.
HELD_UM = 10.0


def tool(number: int, x: float, more: str = "", z: float = 100.0) -> str:
    set_by = f'set_by = "touch"\ntouched_at_mm = {{ X = {x}, Y = 0.0, Z = 200.0 }}\n'
    return f"[tools.{number}]\nZ_mm = {z + 50.0 * (number - 1)}\n{set_by}{more}"


def made(folder: Path, tables: str, **more: str) -> Path:
    return machine(folder, CALIBRATION, CURVES, tables=tables, increment_mm=1e-4, **more)


def body(number: int) -> bytes:
    return f"T{number} M6\nG43 H{number}\nG0 X0. Y0. Z0.\nG1 Y1. F60\nM2\n".encode()


def moved_um(path: Path, number: int) -> tuple[float, float]:
    """um by which X and Z are commanded away from 0 where tool `number` cuts."""
    result = olp.correct(HEAD + body(number), path)
    assert olp.verify(HEAD + body(number), result.data, path).report["deviation"]["holds"]
    text = unstamped(result.data)
    return tuple(round(1e3 * words(text, letter)[0], 3) for letter in "XZ")  # type: ignore[return-value]


@pytest.mark.parametrize("component", ["EXX", "EYX", "EZX"])
def test_one_tool_that_touches_and_cuts_leaves_the_program_as_it_is(tmp_path: Path, component: str) -> None:
    curve = {"x.csv": f"X_mm,{component}_um\n-1000,10\n2000,10\n"}
    path = machine(tmp_path, CALIBRATION, curve, tables=TOUCHED + tool(1, 200.0))
    assert olp.correct(HEAD + body(1), path).data == HEAD + body(1)


def test_another_tool_of_the_same_setter_differs_along_the_tool_alone(tmp_path: Path) -> None:
    path = made(tmp_path, TOUCHED + tool(1, 200.0) + tool(2, 300.0))
    assert moved_um(path, 1) == (0.0, HELD_UM)
    assert moved_um(path, 2) == (0.0, HELD_UM + 30.0 - 20.0)
    # and the constant of the one setter says nothing
    known = made(tmp_path / "k", TOUCHED + tool(1, 200.0, "k_um = 40.0\n") + tool(2, 300.0))
    assert moved_um(known, 2) == (0.0, HELD_UM + 30.0 - 20.0)


def test_lengths_of_two_setters_need_their_constants(tmp_path: Path) -> None:
    one, two = 'setter = "laser"\n', 'setter = "plate"\n'
    for first, second, lacking in (
        (one, two, 2),
        (one, f"{two}k_um = -4.0\n", 1),
        (f"{one}k_um = 3.0\n", two, 2),
        (one, "", 2),
    ):
        path = made(
            tmp_path / str(len(first + second)), TOUCHED + tool(1, 200.0, first) + tool(2, 300.0, second)
        )
        with pytest.raises(ConfigError, match=rf"give tools\.{lacking}\.k_um, from a master"):
            olp.correct(HEAD + body(2), path)
        # the tool that touched cuts all the same
        assert moved_um(path, 1) == (0.0, HELD_UM)
    both = tool(1, 200.0, f"{one}k_um = 3.0\n") + tool(2, 300.0, f"{two}k_um = -4.0\n")
    path = made(tmp_path / "both", TOUCHED + both)
    assert moved_um(path, 2) == (0.0, HELD_UM + (30.0 + 4.0) - (20.0 - 3.0))


def test_the_constant_counts_for_all_tools_of_its_setter_and_is_one(tmp_path: Path) -> None:
    other = '[tools.3]\nZ_mm = 80.0\nset_by = "true"\nsetter = "laser"\nk_um = -4.0\n'
    tools = tool(1, 200.0, "k_um = 3.0\n") + tool(2, 300.0, 'setter = "laser"\n') + other
    path = made(tmp_path, TOUCHED + tools)
    assert moved_um(path, 2) == (0.0, HELD_UM + (30.0 + 4.0) - (20.0 - 3.0))
    # a length from a presetter has the constant alone
    assert moved_um(path, 3) == (0.0, HELD_UM + 4.0 - (20.0 - 3.0))
    twice = made(tmp_path / "twice", TOUCHED + tools.replace('"laser"\n[', '"laser"\nk_um = 1.0\n['))
    with pytest.raises(ConfigError, match=r"tools\.3\.k_um = -4 and tools\.2\.k_um = 1 are of one setter"):
        olp.correct(HEAD + body(2), twice)


@pytest.mark.parametrize("offset", [TRUE_ZERO, "[work_offsets.G54]\nZ_mm = 0.0\n"], ids=["true", "no tool"])
def test_an_offset_without_a_tool_needs_the_constant(tmp_path: Path, offset: str) -> None:
    with pytest.raises(ConfigError, match=r"give tools\.1\.k_um"):
        olp.correct(HEAD + body(1), made(tmp_path / "a", offset + tool(1, 200.0)))
    true = offset == TRUE_ZERO
    path = made(tmp_path / "b", offset + tool(1, 200.0, "k_um = 5.0\n"))
    assert moved_um(path, 1) == (-7.0 if true else 0.0, 20.0 - 5.0)


def test_a_length_from_a_presetter_against_one_set_on_the_machine(tmp_path: Path) -> None:
    """set_by = "true" without a setter is a true length; then the constant of the other counts."""
    true = "[tools.2]\nZ_mm = 150.0\n"
    with pytest.raises(ConfigError, match=r"give tools\.1\.k_um"):
        olp.correct(HEAD + body(2), made(tmp_path / "a", TOUCHED + tool(1, 200.0) + true))
    path = made(tmp_path / "b", TOUCHED + tool(1, 200.0, "k_um = 3.0\n") + true)
    assert moved_um(path, 2) == (0.0, HELD_UM - (20.0 - 3.0))
    # two true lengths of one presetter, whose constant is not known
    presetter = 'setter = "presetter"\n'
    one = f"[tools.1]\nZ_mm = 100.0\n{presetter}"
    assert moved_um(made(tmp_path / "c", TOUCHED + one + true + presetter), 2) == (0.0, HELD_UM)


def test_lengths_relative_to_a_tool_need_the_tool_vector(tmp_path: Path) -> None:
    for z in (0.0, -30.0):
        tools = tool(1, 200.0, "gauge_to_tip_mm = [0.0, 0.0, -100.0]\n") + tool(2, 300.0, z=z - 50.0)
        with pytest.raises((ConfigError, olp.ProgramError), match=r"tools\.2\.gauge_to_tip_mm"):
            olp.correct(HEAD + body(2), made(tmp_path / f"a{z}", TOUCHED + tools))
        path = made(tmp_path / f"b{z}", TOUCHED + tools + "gauge_to_tip_mm = [0.0, 0.0, -70.0]\n")
        assert moved_um(path, 2) == (0.0, HELD_UM + 30.0 - 20.0)


def test_before_the_length_is_active_nothing_is_refused_and_nothing_added(tmp_path: Path) -> None:
    path = made(tmp_path, TRUE_ZERO + tool(1, 200.0))
    text = unstamped(olp.correct(HEAD + b"T1 M6\nG0 X0. Y0. Z0.\nG1 Y1. F60\nM2\n", path).data)
    assert (words(text, "X")[0], words(text, "Z")[0]) == (-0.007, 0.0)


def test_an_offset_that_the_program_sets_keeps_the_tool_that_touched(tmp_path: Path) -> None:
    path = made(tmp_path, TOUCHED + '[work_offsets.G55]\nset_by = "true"\n' + tool(1, 200.0) + tool(2, 300.0))
    program = b"T2 M6\nG43 H2\nG0 X0. Y0. Z0.\nG10 L20 P2 X0. Y0. Z0.\nG55\nG1 Y1. F60\nM2\n"
    frames = read(HEAD + program, load_setup(path), DIALECTS["linuxcnc"], words=False).toolpath.frames
    assert {f.work_offset for f in frames if f.lengths} == {"G54", "G55"}
    shifts = zero_shifts(frames, Session.start(path).loaded("refuse").model)
    own = [s for s, f in zip(shifts, frames, strict=True) if f.lengths]
    np.testing.assert_allclose(own, [[7e-3, 0.0, 20e-3]] * len(own), atol=1e-12)


def test_a_tilted_tool_needs_the_constant_and_is_longer_along_itself(tmp_path: Path) -> None:
    axis = (0.6, 0.0, 0.8)
    path = made(tmp_path, TOUCHED + tool(1, 200.0))
    with pytest.raises(ConfigError, match=r"tool 1 is tilted.*give tools\.1\.k_um"):
        length_errors_of(load_setup(path), 1, 1, axis)
    path = made(tmp_path / "k", TOUCHED + tool(1, 200.0, "k_um = 4.0\n"))
    errors = length_errors_of(load_setup(path), 1, 1, axis)
    (shift,) = zero_shifts((Frame(lengths=errors),), Session.start(path).loaded("refuse").model)
    np.testing.assert_allclose(shift, 16e-3 * (np.array(axis) - [0.0, 0.0, 1.0]), atol=1e-12)


def test_the_judge_says_the_same(tmp_path: Path) -> None:
    tools = (
        tool(1, 200.0, 'setter = "a"\nk_um = 3.0\n')
        + tool(2, 300.0, "k_um = -2.0\n")
        + "[tools.3]\nZ_mm = 9.0\n"
    )
    for name, offset in (("touch", TOUCHED), ("true", TRUE_ZERO)):
        path = made(tmp_path / name, offset + tools)
        judge, setup = JudgeModel(path), load_setup(path)
        model = Session.start(path).loaded("refuse").model
        for number in (1, 2, 3):
            errors = length_errors_of(setup, number, 1 if name == "touch" else None)
            (shift,) = zero_shifts((Frame(lengths=errors),), model)
            np.testing.assert_allclose(shift, judge.tool_shift(number, "G54"), atol=1e-12)


def test_the_keys_are_written_and_read_back_and_mean_something_together(tmp_path: Path) -> None:
    path = made(tmp_path, tool(1, 200.0, 'setter = "laser"\nk_um = -3.5\n'))
    own = load_machine(path)
    assert (own.tools[1].setter, own.tools[1].constant_mm) == ("laser", -3.5e-3)
    path.write_text(machine_toml(own))
    assert load_machine(path).tools == own.tools
    path = made(tmp_path / "b", "[tools.1]\nZ_mm = 100.0\nk_um = 2.0\n")
    with pytest.raises(ConfigError, match=r"tools\.1\.k_um is that of a setter"):
        load_machine(path)


def test_the_uncertainty_of_a_length_is_along_the_tool_and_cancels(tmp_path: Path) -> None:
    """One unknown: EZX of both knots, 2 um. It is the same where both lengths were set, so their difference
    has none of it."""
    path = made(tmp_path, TOUCHED)
    calibration = load_calibration(path.with_name("calibration.toml"))
    (curve,) = calibration.curves
    entry = alone("mean", "EZX", np.full(2, 2e-3), curve.position_mm)
    common = type(entry)(entry.kind, entry.name, entry.rest[:, None], np.zeros(2), entry.position_mm)
    known = Uncertainty((common,), fingerprint(calibration), "a test")
    unknowns = Unknowns(Sensitivity.of(calibration, "FXYZ", known), (1e-3, 1e-3, 1e-3))
    up = LengthError((0.0, 0.0, 1.0), ((200.0, 0.0, 0.0), (0.0, 0.0, -50.0)))
    down = LengthError((0.0, 0.0, -1.0), ((900.0, 0.0, 0.0), (0.0, 0.0, -50.0)))
    rows, count = unknowns.touches((Frame(lengths=(up,)), Frame(lengths=(up, down)), Frame()))
    np.testing.assert_allclose(rows[:, :, 0], [[0, 0, 2e-3], [0, 0, 0], [0, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(count, [[0, 0, 1], [0, 0, 2], [0, 0, 0]])
