"""Where G28, G30 and M6 leave the axes, as the machine file states it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped
from judge import linuxcnc, machines
from judge.machines import Recipe
from judge.path import judge_programs

import olp
from olp.core.errors import ConfigError, ProgramError, Refused

SQUARE = "[squareness]\nC0Y_urad = 1000.0\n"
TOOL = f"{TRUE_ZERO}[tools.1]\nZ_mm = 100.0\n"
HEAD = "G21\nG90\n"
POINTS = 'decimal_point = "calculator"\n'
HOMES = (
    "home_mm = { X = 200.0, Y = 150.0, Z = -100.0 }\nsecond_home_mm = { X = 300.0, Y = 250.0, Z = -120.0 }\n"
)
#: What LinuxCNC judges: increments, arcs, partial words and presets behind homes.
TEXTS = (
    "G0 X10 Y10 Z9\nG1 X30 Y20\nG91 G28 Z0\nG28 X0 Y0\nG1 X10 Y5 Z-3\nX20\nG2 X10 Y10 I10 J0\nG90\nG1 X3 Z2",
    "G28\nG92 X0 Y0 Z0\nG1 X10 Y5 Z-3\nG2 X20 Y15 I10 J0\nG0 Z5\nG1 X3 Y40\nG92.1\nG28\nG1 X12 Y3 Z4\nX2",
    "G91 G28 Z0\nG90 G0 X10 Y10\nG91\nG1 Z-5\nX30\nY25\nG90\nG0 X0 Y0",
    "G43 H1 G0 X10 Y9 Z9\nG1 X3\nG91 G30 Z0\nG30 X0 Y0\nG1 X10 Y5 Z-3\nX20\nG28 Z5 Y3\nG1 X5 Z5\nY2\nG90\nX3",
    "G0 X10 Y10 Z9\nG1 X30 Y20\nG91 G28 Z0\nG90 G1 Y50\nG1 X90\nG28 Y60\nG1 X30\nG1 Z3\nX2",
)


def corrected(
    folder: Path, text: str, *, keys: str = "", controller: str = "linuxcnc", head: str = HEAD
) -> str:
    path = machine(folder, SQUARE, controller=controller, keys=keys, tables=TOOL)
    return unstamped(olp.correct((head + text).encode(), path).data)[len(head) :].decode()


@pytest.mark.slow
@pytest.mark.oracle
@pytest.mark.parametrize("text", TEXTS)
def test_moves_behind_homes_are_those_of_the_interpreter(tmp_path: Path, text: str) -> None:
    linuxcnc.require()
    path = machines.random_machine(tmp_path, 3, Recipe())
    path.write_text(path.read_text().replace("controller =", f"{HOMES}controller =", 1))
    data = f"{HEAD}F600\n{text}\nM2\n".encode()
    seen = judge_programs(data, olp.correct(data, path).data, path)
    # from a home, which is uncorrected, the next move begins beside the path
    homes = [k for k, line in enumerate(data.decode().splitlines(), 1) if "G28" in line or "G30" in line]
    behind = [seen.lines[seen.lines > k].min() for k in homes]
    beside = np.isin(seen.lines, [*homes, *behind])
    later = seen.lines > max(homes[0], 4)
    assert (later & ~beside).sum() >= 3
    assert seen.after.by_move_um[later & ~beside].max() < 2.0


def test_an_axis_that_was_sent_home_stays_there_in_rapids(tmp_path: Path) -> None:
    keys = "home_mm = { Y = 100.0 }\n"
    behind = corrected(tmp_path, "G28 Y0\nG0 X50 Z5\nG0 X60\nG1 Y110 F100\nM2\n", keys=keys)
    assert behind.splitlines()[1:3] == ["G0 X50.100 Z5", "G0 X60.100"]


@pytest.mark.parametrize(
    ("keys", "text", "known"),
    [
        ("", "T1 M6\nG1 X9 F100", False),
        ("tool_change_mm = { Y = 5.0 }", "T1 M6\nG1 X9 F100", True),
        ("tool_change_mm = { X = 5.0, Z = 5.0 }", "T1 M6\nG1 X9 F100", False),
        ('tool_change_moves = ["Z"]', "T1 M6\nG1 X9 F100", True),
        ('tool_change_moves = ["Y"]', "T1 M6\nG1 X9 F100", False),
        ("tool_change_moves = false", "T1 M6\nG1 X9 F100", True),
        # a code that is not known may move all axes
        ("tool_change_mm = { Y = 5.0 }", "T1 M6 M123\nG1 X9 F100", False),
        ("tool_change_mm = { Y = 5.0 }", "M123\nG1 X9 F100", False),
        ("home_mm = { Y = 5.0 }", "G28\nG1 X9 F100", True),
        ("home_mm = { Y = 5.0 }", "G28 X3\nG1 X9 F100", True),
        ("home_mm = { Y = 5.0 }", "G30\nG1 X9 F100", False),
        ("second_home_mm = { Y = 5.0 }", "G30\nG1 X9 F100", True),
        ("second_home_mm = { Y = 5.0 }", "G30 P2 Y1\nG1 X9 F100", True),
        ("second_home_mm = { Y = 5.0 }", "G30 P3 Y1\nG1 X9 F100", False),
        # with the switch on the axis is elsewhere
        ("home_mm = { Y = 5.0 }", "/G28 Y0\nG1 X9 F100", False),
    ],
)
def test_what_is_stated_is_known(tmp_path: Path, keys: str, text: str, known: bool) -> None:
    program = f"G0 X1 Y1 Z1\n{text}\n"
    if known:
        assert corrected(tmp_path, program, keys=f"{keys}\n{POINTS}", controller="fanuc")
        return
    with pytest.raises(ProgramError, match=r"the position of .*Y.* is not known at this feed") as caught:
        corrected(tmp_path, program, keys=f"{keys}\n{POINTS}", controller="fanuc")
    assert "by itself in line 4: " in str(caught.value)
    assert "tool_change_moves, tool_change_mm, home_mm" in str(caught.value)


@pytest.mark.parametrize("controller", ["marlin", "klipper"])
@pytest.mark.parametrize(("home", "known"), [("G28", True), ("N1 G28 ; all", True), ("G28 X0", False),
                                             ("G28 X", False), ("G29", False)])  # fmt: skip
def test_printers_stand_where_g28_leaves_them(
    tmp_path: Path, controller: str, home: str, known: bool
) -> None:
    keys = "home_mm = { X = 0.0, Y = 200.0, Z = 0.0 }\n"

    def run() -> str:
        return corrected(tmp_path, f"{home}\nG92 E0\nG1 X10 E3 F900\n", keys=keys, controller=controller)

    if known:
        assert "G1 X10.200 E3" in run()
    else:
        with pytest.raises(ProgramError, match="the position of Y"):
            run()


def test_an_unread_value_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="tool_change_moves"):
        corrected(tmp_path, "M2", keys='tool_change_moves = ["A"]\n')


#: What a refusal says of the block that left the axes, and what to do about it.
BY_KEY = "; {name} in line {line} may have moved it: {do}, or command X, Y and Z behind it"
LIST = "list {} in still_m_codes of the machine file if it moves no axis"
STATE = "state {} in the machine file"
ARC = "G0 X10. Y10. Z9.\n{}\nG2 X30. Y10. I10. J0.\n"
LEAVERS = [
    ("M81\nG0 X3. Y3. Z3.\nM9\nM82", "M82", 7, LIST.format(82)),
    ("M6 T1", "M6", 4, STATE.format("tool_change_mm")),
    ("M6 T1\nM82\nG54", "M82", 5, LIST.format(82)),
    ("G28 X10.", "G28", 4, STATE.format("home_mm")),
    ("M82\nG30 X10.", "G30", 5, STATE.format("second_home_mm")),
]


@pytest.mark.parametrize(("between", "name", "line", "do"), LEAVERS)
def test_a_refusal_names_the_block_that_left_the_axes(
    tmp_path: Path, between: str, name: str, line: int, do: str
) -> None:
    with pytest.raises(ProgramError) as caught:
        corrected(tmp_path, ARC.format(between))
    assert caught.value.message.endswith(BY_KEY.format(name=name, line=line, do=do))


def test_such_a_block_is_named_by_its_line_where_the_program_was_unrolled(tmp_path: Path) -> None:
    path = machine(tmp_path, SQUARE, controller="linuxcnc", tables=TOOL)
    text = f"{HEAD}G0 X0 Y0 Z5\no1 sub\n\n\nM81\no1 endsub\no1 call\nG2 X1 Y1 I1 F100\nM2\n"
    with pytest.raises(ProgramError) as caught:
        olp.correct(text.encode(), path, flatten=True)
    assert caught.value.line == 10
    assert caught.value.message.endswith(BY_KEY.format(name="M81", line=7, do=LIST.format(81)))


BUILDERS = "G0 X10. Y10. Z9.\nM81\nG1 X30. F100\nG2 X30. Y30. I0. J10.\nM5 M110\nG1 Z1.\n"


@pytest.mark.parametrize("controller", ["linuxcnc", "fanuc", "mach3", "sinumerik"])
def test_codes_of_the_builder_that_move_nothing_are_stated(tmp_path: Path, controller: str) -> None:
    """The program without these codes is the judge."""
    head = "G71\nG90\n" if controller == "sinumerik" else HEAD
    points = POINTS if controller == "fanuc" else ""

    def of(name: str, text: str, keys: str = "") -> str:
        keys += points + 'arc_centres = "incremental"\n'
        return corrected(tmp_path / name, text, keys=keys, controller=controller, head=head)

    with pytest.raises(ProgramError, match=BY_KEY.format(name="M81", line=4, do=LIST.format(81))) as caught:
        of("unknown", BUILDERS)
    assert (caught.value.line, caught.value.code) == (6, "OLP524")
    stated = of("stated", BUILDERS, "still_m_codes = [110, 81]\n")
    plain = BUILDERS.replace("M81\n", "").replace(" M110", "")
    assert stated.replace("M81\n", "").replace(" M110", "") == of("plain", plain) != plain


def test_a_tool_change_is_no_such_code(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="what a tool change moves is stated by tool_change_moves"):
        corrected(tmp_path, "G0 X1. Y1. Z1.\n", keys="still_m_codes = [81, 6]\n")


#: Codes of a builder beside those of the control, and in a block of their own.
OWN_CODES = "G90 G94 G64.1 G17\nG0 X10. Y10. Z9.\nG1 X30. F100\nG187\nG2 X30. Y30. I0. J10.\n"
OWN_KEY = "still_g_codes = [187, 64.1]\n"


def without(text: str) -> str:
    return re.sub(r" G64\.1|G187\n", "", text)


@pytest.mark.parametrize("controller", ["linuxcnc", "grbl", "mach3"])
def test_g_codes_that_move_nothing_are_stated(tmp_path: Path, controller: str) -> None:
    """The program without these codes is the judge."""

    def of(name: str, text: str, keys: str = "") -> str:
        keys += 'arc_centres = "incremental"\n'
        return corrected(tmp_path / name, text, keys=keys, controller=controller)

    with pytest.raises(Refused, match="list it in still_g_codes of the machine file") as caught:
        of("unknown", OWN_CODES)
    assert [(reason.line, reason.code) for reason in caught.value.reasons] == [(3, "OLP512"), (6, "OLP512")]
    stated = of("stated", OWN_CODES, OWN_KEY)
    assert "G187" in stated
    assert without(stated) == of("plain", without(OWN_CODES)) != without(OWN_CODES)


@pytest.mark.parametrize(
    ("keys", "text", "why"),
    [
        (
            "[187, 68]",
            "G0 X1.",
            "still_g_codes of the machine file has G68, which the linuxcnc profile knows",
        ),
        ("[50.25]", "G0 X1.", "has 50.25; expected numbers with one decimal at most"),
        ("[50]", "G0 X1. Y1. Z1.\nG50 X2.", "G50 is one of still_g_codes, and its block has words of axes"),
        ("[50]", "G0 X1. Y1. Z1.\nG51 X2.", "G51 (scaling) is not read"),
    ],
)
def test_other_g_codes_are_none_of_them(tmp_path: Path, keys: str, text: str, why: str) -> None:
    with pytest.raises((ConfigError, ProgramError), match=re.escape(why)) as caught:
        corrected(tmp_path, text + "\n", keys=f"still_g_codes = {keys}\n")
    if isinstance(caught.value, ConfigError):
        assert Path(caught.value.file or "").name == "machine.toml"
