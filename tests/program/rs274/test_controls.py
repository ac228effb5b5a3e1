"""What each control makes of the same words, by hand: where a program ends, or why it is refused."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.files.config import load_setup
from olp.files.sources import Source, Sources
from olp.program.dialect import Row, Support
from olp.program.registry import DIALECTS, read
from olp.program.rs274.cycle_rules import CycleRules
from olp.program.rs274.profiles.base import NO_CODE, Act, Profile, increment
from olp.workflows.flatten import UnrollOptions, as_asked

LINUXCNC, FANUC, HAAS, GRBL = CONTROLS = ("linuxcnc", "fanuc", "haas", "grbl")
MACH3, MACH4, MAZAK, OKUMA, SIEMENS = FURTHER = ("mach3", "mach4", "mazak", "okuma", "siemens-iso")
CENTROID = "centroid"
EDING = "eding"
MARLIN, KLIPPER = PRINTERS = ("marlin", "klipper")
#: Each tool has a length along X, too.
TOOLS = "".join(
    f"[tools.{n}]\nX_mm = {n}.0\nZ_mm = {n}0.0\ngauge_to_tip_mm = [0.0, 0.0, -{n}0.0]\n" for n in (1, 2, 3)
)
Outcome = tuple[float, float, float] | str

#: Field of the profile: the program, what the controls make of it, and another value of the field.
READINGS: dict[str, tuple[str, dict[str, Outcome], Any]] = {
    "motion": (
        "X1. Y0. Z0.",
        {GRBL: (1, 0, 0)} | dict.fromkeys((LINUXCNC, FANUC, HAAS), "no motion code is in force"),
        {GRBL: None, LINUXCNC: 0, FANUC: 0, HAAS: 0},
    ),
    "initial_retract": (
        "G0 X0. Y0. Z9.\nG81 X1. Y1. Z-2. R3. F60.",
        {LINUXCNC: (1, 1, 3), FANUC: (1, 1, 9), HAAS: (1, 1, 9)}
        | dict.fromkeys((MACH3, MACH4), "is a setting of the control; give G98 or G99"),
        {LINUXCNC: 980, FANUC: 990, HAAS: 990, MACH3: 980, MACH4: 980},
    ),
    "arc_distance": (
        "G0 X10. Y0. Z0.\nG3 X0. Y10. I-10. J0. F60.",
        {LINUXCNC: (0, 10, 0), MAZAK: (0, 10, 0)}
        | dict.fromkeys((MACH3, MACH4), 'state arc_centres = "incremental" or "absolute" in the machine'),
        {LINUXCNC: 901, MAZAK: 901, MACH3: 911, MACH4: 911},
    ),
    "aliases": (
        "G70 G0 X1. Y0. Z0.",
        {MACH3: (25.4, 0, 0)} | dict.fromkeys((MACH4, FANUC, MAZAK), "G70 is not known to the"),
        {MACH3: {}, MACH4: {700: 200}, FANUC: {700: 200}, MAZAK: {700: 200}},
    ),
    "home_m": (
        "G0 X1. Y2. Z3.\nM25\nG0 X5. Z4.",
        {CENTROID: (5, 2, 4)},
        {CENTROID: frozenset()},
    ),
    "length_awaits_number": (
        "G0 X0. Y0. Z99.\nG43\nG0 Z5. H2",
        {CENTROID: (0, 0, 25), FANUC: "G43 needs an H word", HAAS: "G43 needs an H word"},
        "not",
    ),
    "g10_clearances": (
        "G0 X1. Y2. Z3.\nG10 P73 R0.5\nX5.",
        {CENTROID: (5, 2, 3), FANUC: "G10 without L writes tables"},
        {CENTROID: frozenset(), FANUC: frozenset({73})},
    ),
    "g10_stores": (
        "G54.1 P1\nG0 X1. Y2. Z3.\nG10 L20 P2 X0.\nG54.1 P2 X1. Y0. Z0.",
        dict.fromkeys((FANUC, HAAS, MAZAK, SIEMENS, MACH4), (1, 8, 9)),
        "not",
    ),
    "g10_active": (
        "G0 X1. Y0. Z0.\nG10 L2 P0 X5.\nX1. Y2. Z3.",
        {LINUXCNC: (6, 2, 3), GRBL: (6, 2, 3)}
        | dict.fromkeys((FANUC, HAAS, MAZAK, SIEMENS, MACH3), "G10 P0 writes what this control adds to all"),
        "not",
    ),
    "further_offsets": (
        "G90 G10 L20 P2 X50. Y60. Z70.\nG154 P2\nG0 X1. Y1. Z1.",
        {HAAS: (51, 61, 71)},
        {HAAS: ("G54.1",)},
    ),
    "first_further": (
        "G90 G10 L20 P2 X50. Y60. Z70.\nG111\nG0 X1. Y1. Z1.",
        {HAAS: (51, 61, 71)},
        {HAAS: 0},
    ),
    "g10_tools": (
        "G90 G10 L10 P2 R20.\nG10 L11 P2 R0.\nG43 H2\nG0 X0. Y0. Z1.",
        {FANUC: (0, 0, 21), HAAS: (0, 0, 21), MAZAK: "G10 L10 writes tables of the control"},
        {FANUC: frozenset(), HAAS: frozenset(), MAZAK: frozenset({10, 11})},
    ),
    "offset_words": (
        "G54 P2\nG0 X1. Y2. Z3.",
        {SIEMENS: (8, 10, 12), FANUC: (8, 10, 12)}
        | dict.fromkeys((HAAS, MAZAK, MACH3), "of P beside G54 is not known; a further work offset is G"),
        {SIEMENS: {}, FANUC: {}, HAAS: {540: "P"}, MAZAK: {540: "P"}, MACH3: {540: "P"}},
    ),
    "offset_names": (
        "G15 H1\nG0 X1. Y2. Z3.",
        {OKUMA: (5, 7, 9)},
        {OKUMA: {}},
    ),
    "still_with": (
        "G0 X1. Y0. Z0.\nG05 P10000\nY2.\nG05 P0",
        {FANUC: (1, 2, 0), HAAS: "high-speed mode"},
        {FANUC: {}, HAAS: {50: ("P", frozenset({0.0, 10000.0}))}},
    ),
    # what the machine file states, which no control has by itself
    "still_g": (
        "G187\nG0 X1. Y0. Z0.",
        dict.fromkeys((LINUXCNC, GRBL), "G187 is not known to the"),
        dict.fromkeys((LINUXCNC, GRBL), frozenset({1870})),
    ),
    "machine_moves_absolute": (
        "G0 X1. Y2. Z3.\nG91\nG53 G0 X5.\nG0 X1.",
        {GRBL: (6, 2, 3)}
        | dict.fromkeys((LINUXCNC, FANUC), "G53 takes axis positions, and the block is in G91; give G90"),
        {GRBL: False, LINUXCNC: True, FANUC: True},
    ),
    "lathe_words": (
        "G0 X1. Y0. Z0.\nG50 S6000",
        dict.fromkeys((FANUC, HAAS), "G50 S limits the spindle of a lathe, whose X states diameters; give"),
        {FANUC: {}, HAAS: {}},
    ),
    "m_instead": (
        "G0 X1. Y0. Z0.\nM99",
        {OKUMA: "M99 repeats the program; write M30 in its place where it ends a main program"},
        {OKUMA: {}},
    ),
    "return_level": (
        "G0 X0. Y0. Z9.\nG80\nG71 Z7.\nG81 X1. R3. Z-2. F60. M53",
        {OKUMA: (1, 0, 7)},
        {OKUMA: 0},
    ),
    "return_modes": (
        "G0 X0. Y0. Z9.\nG71 Z7.\nG81 X1. R3. Z-2. F60. M54",
        {OKUMA: (1, 0, 3)},
        {OKUMA: {}},
    ),
    "offsets_alone": (
        "G54\nG0 X1. Y2. Z3.",
        dict.fromkeys((SIEMENS, FANUC), (1, 2, 3)),
        dict.fromkeys((SIEMENS, FANUC), frozenset()),
    ),
    "numbers_hold": (
        "G0 X0. Y0.\nG43 H1 Z1.\nH2 Z1.",
        dict.fromkeys((FANUC, HAAS, MAZAK, SIEMENS, MACH3), "H2 alone is in the block while H1 is in force"),
        "not",
    ),
    "mirrors_at_zero": (
        "G0 X0. Y0. Z1.\nG101 X5.\nX1. Y2.",
        {HAAS: "G101 mirrors at the zero of the work offset"},
        "not",
    ),
    "zero_ends_length": (
        "G0 X0. Y0.\nG43 H1 Z1.\nH0\nZ1.",
        dict.fromkeys((FANUC, HAAS, MAZAK, SIEMENS), (0, 0, 1)) | {MACH3: "H0 alone is in the block while"},
        "not",
    ),
    "radius_holds": (
        "G0 X0. Y0. Z1.\nD1\nG41 G1 X5. Y0. F60.\nY9.\nG40 X0.",
        dict.fromkeys((FANUC, HAAS, MAZAK), "the radius of tool 1, which is not known")
        | {SIEMENS: "G41 has no D word, and which radius it takes"},
        "not",
    ),
    "spindle_words": (
        "T2 M6\nG56 HA\nG0 X0. Y0. Z1.",
        {OKUMA: (0, 0, 21)},
        "not",
    ),
    "tools_in_block": (
        "T1 T2 M6\nG43 H1\nG0 X0. Y0. Z1.",
        {MAZAK: (0, 0, 11)},
        "not",
    ),
    "m_refusals": (
        "M47\nG0 X1. Y0. Z0.",
        {MACH3: "M47 repeats the program", MACH4: (1, 0, 0), FANUC: (1, 0, 0)},
        {MACH3: {}, MACH4: {470: "repeats"}, FANUC: {470: "repeats"}},
    ),
    "inert": (
        "$PART.MIN%\nOPART (A)\nNAT3\nG0 X1. Y0. Z0.",
        {OKUMA: (1, 0, 0), FANUC: "is not understood"},
        {OKUMA: None, FANUC: re.compile(rb"[^G].*")},
    ),
    "commands": (
        "G0 X1 Y0 Z0\nX2",
        dict.fromkeys(PRINTERS, "this line has no command"),
        {MARLIN: None, KLIPPER: None},
    ),
    "harmless_m_tenths": (
        "G0 X1 Y0 Z0\nM862.1 P0.4\nG0 Y2",
        dict.fromkeys(PRINTERS, (1, 2, 0)),
        dict.fromkeys(PRINTERS, frozenset()),
    ),
    "increments_without_point": (
        "G0 X1000 Y0 Z0",
        {LINUXCNC: (1000, 0, 0), GRBL: (1000, 0, 0), FANUC: (1, 0, 0), HAAS: (1, 0, 0)},
        "not",
    ),
    "g52_is_g92": (
        "G0 X0. Y0. Z0.\nG92 X1.\nG52 X5.\nG0 X1. Y0. Z0.",
        {LINUXCNC: (6, 0, 0), FANUC: (5, 0, 0), HAAS: (5, 0, 0)},
        "not",
    ),
    "g10_offsets": (
        "G10 L2 P7 X5.\nG0 X1. Y0. Z0.",
        {LINUXCNC: (1, 0, 0)} | dict.fromkeys((FANUC, HAAS, GRBL), "the number of a work offset"),
        {LINUXCNC: 6, FANUC: 9, HAAS: 9, GRBL: 9},
    ),
    "g10_adds": (
        "G10 L2 P1 X5.\nG91\nG10 L2 P1 X2.\nG90 G0 X1. Y0. Z0.",
        {LINUXCNC: (3, 0, 0), GRBL: (3, 0, 0), FANUC: (8, 0, 0), HAAS: (8, 0, 0)}
        | dict.fromkeys((MACH3, MACH4), "whether this control adds to the offset then is not known"),
        "not",
    ),
    "turns_offsets": (
        "G10 L2 P1 X5. R90\nG0 X1. Y0. Z0.",
        {LINUXCNC: (5, 1, 0)} | dict.fromkeys((FANUC, HAAS, GRBL), "G10 R turns the work offset"),
        "not",
    ),
    "polar": ("G16\nG0 X1. Y90.", {FANUC: "unroll the program with --flatten"}, "not"),
    "scales_axes": (
        "G51 X0. Y0. Z0. I2. J1. K3.\nG0 X1. Y1. Z1.",
        {FANUC: "has a decimal point", HAAS: "without its factors"},
        "not",
    ),
    "scales_by_parameter": (
        "G51 X0. Y0. Z0. P2.\nG0 X1. Y1. Z1.",
        {FANUC: "has a decimal point", HAAS: (2, 2, 2)},
        "not",
    ),
    "cycles_apart": (
        "G1 X0. Y0. Z9. F60.\nG80\nX2.",
        {FANUC: (2, 0, 9), HAAS: (2, 0, 9), LINUXCNC: "no motion code is in force"},
        "not",
    ),
    "axis_dwell": (
        "G0 X0. Y0. Z0.\nG4 X1.",
        {FANUC: (0, 0, 0), HAAS: (0, 0, 0), GRBL: (1, 0, 0)},
        "not",
    ),
    "m61_sets_tool": (
        "M61 Q2\nG43\nG0 X0. Y0. Z10.",
        {LINUXCNC: (2, 0, 30)},
        "not",
    ),
    "length_of_spindle_tool": (
        "T1 M6\nG43\nG0 X0. Y0. Z10.",
        {LINUXCNC: (1, 0, 20)} | dict.fromkeys((FANUC, HAAS), "G43 needs an H word"),
        "not",
    ),
    "lengths_keep_unit": (
        "G20 G43 H1\nG0 X0. Y0. Z1.\nG21 G49\nG0 X1.",
        {LINUXCNC: "the control does not convert it", FANUC: (1, 0, 35.4), HAAS: (1, 0, 35.4)},
        "not",
    ),
    "lengths_along_z": (
        "G43 H3\nG0 X0. Y0. Z10.",
        {LINUXCNC: (3, 0, 40), FANUC: (0, 0, 40), HAAS: (0, 0, 40)},
        "not",
    ),
}

_ISO = (FANUC, HAAS)
_SERIES = "G0 X0. Y0. Z9.\nG81 X1. Y1. Z-2. R3. F60."
_SYNCHRONISED = dict.fromkeys(_ISO, "synchronised by the control")
#: Rule of the cycles: the program, and what it holds or why it is refused when its cycles are written out.
CYCLES: dict[str, tuple[str, dict[str, str]]] = {
    "rises_first": (
        "G0 X0. Y0. Z1.\nG98 G81 X1. Y1. Z-2. R3. F60.\nG80",
        {LINUXCNC: "G0 Z3|G0 X1 Y1|G1 Z-2"} | dict.fromkeys(_ISO, "G0 X1. Y1.|G0 Z3.|G1 Z-2."),
    ),
    "feeds_home": (
        "G0 X0. Y0. Z9.\nG98 G89 X1. Y1. Z-2. R3. P1. F60.\nG80",
        {LINUXCNC: "G4 P1|G1 Z9|"} | dict.fromkeys(_ISO, "G4 P1000|G1 Z3.|G0 Z9."),
    ),
    "taps_in_any_plane": (
        "G18 M3 S100\nG0 X0. Y9. Z0.\nG84 X1. Z1. Y-2. R3. F60.",
        {LINUXCNC: "taps along the wrong axes"},
    ),
    "taps_by_control": (
        "M3 S100\nG0 X0. Y0. Z9.\nG84 X1. Y1. Z-2. R3. F60.",
        {LINUXCNC: "G1 Z-2|M5|M4|"} | _SYNCHRONISED,
    ),
    "peck_by_parameter": (
        "G0 X0. Y0. Z9.\nG83 X1. Y1. Z-2. R3. Q2. F60.",
        {LINUXCNC: "before any G20 or G21"} | dict.fromkeys(_ISO, "give peck_clearance_mm"),
    ),
    "stores": (
        "G0 X0. Y0. Z9.\nG81 Z-2. R3. F60. L0\nX2.",
        {LINUXCNC: "repeated L0 times"} | dict.fromkeys(_ISO, "F60.|G0 X2.|G0 Z3.|G1 Z-2."),
    ),
    "new_code_forgets": (
        f"{_SERIES}\nG82 X2. P1.",
        {LINUXCNC: "has no R word"} | dict.fromkeys(_ISO, "G0 X2.|G0 Z3.|G1 Z-2.|G4 P1"),
    ),
    "levels_follow_distance": (
        f"{_SERIES}\nG91\nX2.",
        {LINUXCNC: "G0 Z12|G0 X3|G1 Z10|", SIEMENS: "give R and the depth again"}
        | dict.fromkeys((*_ISO, MAZAK), "|G91|G90|G0 X3.|G0 Z3.|G1 Z-2.|G0 Z9.|G91"),
    ),
    "levels_stay": (
        f"{_SERIES}\nG91\nX2.",
        {SIEMENS: "give R and the depth again"}
        | dict.fromkeys((*_ISO, MAZAK), "|G91|G90|G0 X3.|G0 Z3.|G1 Z-2.|G0 Z9.|G91"),
    ),
    "keeps_numbers": (
        f"G21\n{_SERIES}\nG20\nX2. Y1.",
        {LINUXCNC: "G20|G61|G0 X2 Y1 Z3|G1 Z-2"} | dict.fromkeys(_ISO, "comes within a series of canned"),
    ),
    "exact_corners": (
        f"G64\n{_SERIES}",
        {LINUXCNC: "G61|G0 X1 Y1"} | dict.fromkeys(_ISO, "F60.|G0 X1. Y1."),
    ),
}  # fmt: skip
#: What these decide is a matter of time: feeds and rests by hand stand in `tests/program/feeds`.
OF_TIME = {
    "feed_without_point", "exact_stop", "feed_words_end", "feed_before_unit", "least_inverse_feed",
    "m_with_motion", "dwell_ms", "dwell_words", "dwell_in_seconds",
}  # fmt: skip
#: Tables and texts, which have tests of their own.
TABLES = {"codes", "refusals", "harmless_m", "text", "rules", "cycles", "contours", "language",
          "written_ending", "program_number", "tip_codes", "direction_codes", "plane_codes",
          "touch_log", "brackets_by_option"}  # fmt: skip
#: What controls with statements of their own do, which `tests/program/sinumerik` reads.
OF_STATEMENTS = {"translator", "machine_moves_keep_length", "increments_take_offsets", "lengths_follow_plane",
                 "further_turns", "absolute_centre", "metric", "cleared", "dwell"}  # fmt: skip


@pytest.fixture(scope="module")
def setups(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    by_control = {}
    further = "".join(
        f'[work_offsets."{name}"]\nset_by = "true"\nX_mm = {n + 2}.0\nY_mm = {n + 3}.0\nZ_mm = {n + 4}.0\n'
        for name, n in (("G54.1 P1", 1), ("G54.1 P2", 5), ("G15 H1", 2))
    )
    for control in (profile.name for profile in PROFILES):
        place = tmp_path_factory.mktemp(control)
        tables = TRUE_ZERO + TOOLS + further
        by_control[control] = load_setup(machine(place, controller=control, tables=tables))
    return by_control


def outcome(text: str, setup: Setup, control: Profile) -> Outcome:
    """The last position, or what the refusal says."""
    try:
        ends = read(text.encode(), setup, control).toolpath.end_mm
        x, y, z = np.round(ends[-1], 9).tolist()
    except ProgramError as error:
        return str(error)
    return x, y, z


def written_out(text: str, setup: Setup, control: Profile) -> str:
    """The program with its cycles written out, its blocks between bars, or what the refusal says."""
    source = Source("", text.encode)
    try:
        expanded = as_asked(Sources(), source, setup, control, UnrollOptions(expand_cycles=True))
        return expanded.data.decode().replace("\n", "|")
    except ProgramError as error:
        return str(error)


def is_it(got: Outcome, want: Outcome) -> bool:
    return want in got if isinstance(want, str) and isinstance(got, str) else got == want


def test_every_field_is_read_by_hand() -> None:
    own = {f.name for f in fields(Profile)} - {f.name for f in fields(Profile.__base__)}  # type: ignore[arg-type]
    assert own == set(READINGS) | OF_TIME | TABLES | OF_STATEMENTS
    # letters, K on Fanuc and Haas, and the spindle, which `test_interleaved` holds; `test_controls_cycles`
    elsewhere = {"repeat_words", "turning", "other_axes", "dwells", "first_peck"}
    assert {f.name for f in fields(CycleRules)} == {*CYCLES, *elsewhere}


@pytest.mark.parametrize(
    ("field", "control"),
    [(field, control) for field, (_, wanted, _) in READINGS.items() for control in wanted],
)
def test_a_control_reads_as_its_manual_says(field: str, control: str, setups: dict[str, Setup]) -> None:
    text, wanted, other = READINGS[field]
    profile = DIALECTS[control]
    assert isinstance(profile, Profile)
    got = outcome(text, setups[control], profile)
    assert is_it(got, wanted[control]), got
    # and it is this field that decides
    value = not getattr(profile, field) if other == "not" else other[control]
    changed = replace(profile, **{field: value})
    assert not is_it(outcome(text, setups[control], changed), wanted[control])


@pytest.mark.parametrize(
    ("rule", "control"), [(rule, control) for rule, (_, wanted) in CYCLES.items() for control in wanted]
)
def test_a_control_makes_cycles_as_its_manual_says(rule: str, control: str, setups: dict[str, Setup]) -> None:
    text, wanted = CYCLES[rule]
    profile = DIALECTS[control]
    assert isinstance(profile, Profile)
    assert wanted[control] in written_out(text, setups[control], profile)
    rules = replace(profile.cycles, **{rule: not getattr(profile.cycles, rule)})
    assert wanted[control] not in written_out(text, setups[control], replace(profile, cycles=rules))


@pytest.mark.parametrize("control", [MACH3, MACH4, FANUC, OKUMA])
def test_where_cycles_return_may_be_stated_where_it_is_a_setting(
    control: str, setups: dict[str, Setup]
) -> None:
    text = READINGS["initial_retract"][0]
    given, profile = setups[control], DIALECTS[control]
    assert isinstance(profile, Profile)
    for stated, level in (("initial", 9), ("r", 3)):
        setup = replace(given, machine=replace(given.machine, cycle_return=stated))
        end = outcome(text, setup, profile)
        if control in (MACH3, MACH4):
            assert end == (1, 1, level)
            assert written_out(text, setup, profile).endswith(f"|G0 Z{level}" + "." * (control == MACH4))
            assert outcome(f"G99\n{text}", setup, profile) == (1, 1, 3)
        else:
            assert end == outcome(text, given, profile)


@pytest.mark.parametrize("control", [FANUC, HAAS])
def test_a_lathe_is_known_by_its_slides(control: str, setups: dict[str, Setup]) -> None:
    got = outcome("G0 X1. Y0. Z0.\nG28 U0 W0", setups[control], DIALECTS[control])
    assert is_it(got, "G28 U W sends both slides home of a lathe, whose X states diameters")
    # a boring mill sends its quill home
    assert is_it(outcome("G0 X1. Y0. Z0.\nG28 W0", setups[control], DIALECTS[control]), (1, 0, 0))


@pytest.mark.parametrize("line", ["$G ; state", "$$", "?", "~", "$X (unlock)"])
def test_what_grbl_answers_moves_nothing(line: str, setups: dict[str, Setup]) -> None:
    text = f"G0 X1. Y2. Z3.\n{line}\nG91\nX1."
    assert outcome(text, setups[GRBL], DIALECTS[GRBL]) == (2, 2, 3)
    source = Source("", f"#1=1\n{text}".encode)
    unrolled = as_asked(Sources(), source, setups[GRBL], DIALECTS[GRBL], UnrollOptions(flatten=True))
    assert line.encode() in unrolled.data


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("$J=G91 X5 F100", "is a jog, which the control takes only when it is idle"),
        (" $j=X1 F1", "is a jog"),
        ("$H", "homes the machine; send it before the program"),
        ("$100=80", "changes a setting of the control; send it before the program"),
        ("$N0=G20", "changes a setting of the control"),
        ("$RST=*", "changes a setting of the control"),
    ],
)
def test_what_grbl_takes_when_idle_is_no_block(line: str, why: str, setups: dict[str, Setup]) -> None:
    text = f"G0 X1. Y2. Z3.\n{line}\nG91\nX1."
    assert f"`{line.strip()}` {why}" in str(outcome(text, setups[GRBL], DIALECTS[GRBL]))
    source = Source("", f"#1=1\n{text}".encode)
    with pytest.raises(ProgramError, match=re.escape(why)) as caught:
        as_asked(Sources(), source, setups[GRBL], DIALECTS[GRBL], UnrollOptions(flatten=True))
    assert (caught.value.line, caught.value.code) == (3, "OLP512")


@pytest.mark.parametrize("code", ["G12", "G13"])
def test_a_circular_pocket_of_haas_is_refused_with_what_to_do(code: str, setups: dict[str, Setup]) -> None:
    got = outcome(f"G0 X1. Y0. Z0.\n{code} I5. Z-1. F100. D1", setups[HAAS], DIALECTS[HAAS])
    assert f"{code} cuts a circular pocket inside the control; post the moves" in str(got)


def test_a_length_without_h_is_the_one_in_force(setups: dict[str, Setup]) -> None:
    """Only where the last H and the tool in the spindle are the same; behind G49 there is none."""
    again = "G43 H1\nG43\nG0 X0. Y0. Z10."
    for text, control, got in (
        (f"T1 M6\n{again}", FANUC, (0, 0, 20)), (again, HAAS, (0, 0, 20)), (again, MACH3, (0, 0, 20)),
        (f"T2 M6\n{again}", FANUC, "G43 needs an H word"), (f"T1 M6\n{again}", LINUXCNC, (1, 0, 20)),
        (again.replace("\n", "\nG49\n", 1), HAAS, "G43 needs an H word"),
        (again.replace("\n", "\nT2 M6\n", 1), FANUC, "G43 needs an H word"),
    ):  # fmt: skip
        assert is_it(outcome(text, setups[control], DIALECTS[control]), got), (text, control)


@pytest.mark.parametrize("control", _ISO)
def test_k_counts_holes(control: str, setups: dict[str, Setup]) -> None:
    profile = DIALECTS[control]
    assert isinstance(profile, Profile)
    text = "G0 X0. Y0. Z9.\nG91 G81 X1. Z-2. R-3. F60. K3"
    assert written_out(text, setups[control], profile).count("G1") == 3


PROFILES = [d for d in DIALECTS.values() if isinstance(d, Profile) and d.translator is None]


@pytest.mark.parametrize("profile", PROFILES, ids=lambda profile: profile.name)
def test_a_reason_names_its_code_and_the_code_is_refused(profile: Profile, setups: dict[str, Setup]) -> None:
    for code, why in profile.refusals.items():
        name = f"G{code / 10:g}"
        assert why.startswith(f"{name} ")
        if profile.codes.get(code, Act.REFUSE) is Act.REFUSE:
            assert f"1: {why}" in str(outcome(f"{name} X1.", setups[profile.name], profile)) or code in (
                profile.aliases
            )


@pytest.mark.parametrize(
    ("word", "why"),
    [("M70", "saves modal"), ("M71", "forgets"), ("M72", "restores"), ("M73", "saves modal"),
     ("M96", "branches"), ("M97", "calls"), ("M98", "calls"), ("M99", "repeats")],
)  # fmt: skip
def test_calls_and_saved_modes_say_how_to_unroll_them(word: str, why: str, setups: dict[str, Setup]) -> None:
    got = outcome(f"G0 X1.\n{word}", setups[LINUXCNC], DIALECTS[LINUXCNC])  # type: ignore[arg-type]
    assert isinstance(got, str)
    assert f"{word} {why}" in got


@pytest.mark.parametrize("control", [MACH3, MACH4, FANUC, HAAS, MAZAK, SIEMENS])
def test_codes_that_save_modes_on_linuxcnc_are_those_of_the_builder(
    control: str, setups: dict[str, Setup]
) -> None:
    """No position is known behind them, unless the machine file states that they move no axis."""
    setup, profile = setups[control], DIALECTS[control]
    assert isinstance(profile, Profile)
    for word in ("M70", "M71", "M72", "M73"):
        text = f"G0 X1. Y2. Z3.\n{word}\nG0 X5."
        x, y, z = outcome(text, setup, profile)
        assert (x, y == y, z == z) == (5.0, False, False)
        machine_ = replace(setup.machine, still_m_codes=frozenset({int(word[1:])}))
        assert outcome(text, replace(setup, machine=machine_), profile) == (5, 2, 3)


@pytest.mark.parametrize("control", [FANUC, HAAS, MAZAK, MACH4])
def test_an_m_code_that_may_call_a_macro_takes_no_axis_words(control: str, setups: dict[str, Setup]) -> None:
    """`M165 P9811 Z0 S2` of a probing macro is no move to Z0."""
    setup, profile = setups[control], DIALECTS[control]
    assert isinstance(profile, Profile)
    for words in ("P9811 Z0. S2.", "P9814 D.5 S2."):
        text = f"G0 X1. Y2. Z3.\nM165 {words}\nG0 X5."
        assert "2: M165 with P may call a macro" in str(outcome(text, setup, profile))
    # alone it moves the axes to no known place, and behind G0 P is no number of a program
    for text in ("M165 P9832", "G0 X5. M165 P1"):
        assert not isinstance(outcome(f"G0 X1. Y2. Z3.\n{text}\nG0 X5.", setup, profile), str)


#: M codes that move no axis, by the manuals of the controls.
HARMLESS = {
    LINUXCNC: "0-5 7-9 19 30 48-53 62-68",
    FANUC: "0-5 7-11 13 19 29 30 48 49 88 89",
    HAAS: "0-5 7-11 19 29-31 33-35 41 42 48 49 59 69 83 84 88 89",
    GRBL: "0-5 7-9 19 30 48 49 56",
}


@pytest.mark.parametrize("control", CONTROLS)
def test_m_codes_that_move_no_axis(control: str) -> None:
    listed = set()
    for part in HARMLESS[control].split():
        first, _, last = part.partition("-")
        listed |= set(range(int(first), int(last or first) + 1))
    profile = DIALECTS[control]
    assert isinstance(profile, Profile)
    assert profile.harmless_m == listed


_MILLING = "G0-G3 G38.2-G38.5 G80"
_DRILLING = "G73 G74 G81-G86 G89"
_FAMILY_REFUSED = "G5.2 G5.3 G6 G7 G7.1 G10.1 G12 G12.1 G13 G16 G31 G43.4 G43.5 G65 G66 G68.2"
_TRANSFORMS = "G51 G51.1 G68"
_REFUSED = f"G5 {_FAMILY_REFUSED} G28.1 G30.1 G33 G33.1 G88"
_BORES = "G76 G87"
_EVENTS = "G4 G10 G20 G21 G28 G49 G53-G59 G61 G92"
_ISO_EVENTS = f"{_EVENTS} G40 G41 G42 G30 G43 G44 G50 G51 G52 G54.1 G64 G68 G69"
_ISO_UNCHANGED = "G8 G9 G13.1 G15 G23.1 G25 G62 G63 G67 G69.1 G96 G97"
#: What becomes of the G codes of each control; other codes are refused as not known.
CODES: dict[str, dict[Act, str]] = {
    LINUXCNC: {
        Act.UNCHANGED: "G8 G96 G97",
        Act.MOTION: f"{_MILLING} {_DRILLING} G33",
        Act.ARC_DISTANCE: "G90.1 G91.1",
        Act.FEED: "G93-G95",
        Act.RETRACT: "G98 G99",
        Act.EVENT: f"{_EVENTS} G40 G41 G41.1 G42 G42.1 G30 G43 G43.1 G43.2 G52 G59.1-G59.3 G61.1 G64 "
        "G92.1-G92.3",
        Act.REFUSE: f"{_REFUSED} {_TRANSFORMS} G5.1 {_BORES}".replace(" G33 ", " "),
    },
    FANUC: {
        Act.UNCHANGED: f"{_ISO_UNCHANGED} G5.1 G11",
        Act.MOTION: f"{_MILLING} {_DRILLING} {_BORES}",
        Act.FEED: "G93-G95",
        Act.RETRACT: "G98 G99",
        Act.EVENT: f"{_ISO_EVENTS} G50.1 G51.1",
        Act.REFUSE: f"{_REFUSED} G41.1 G42.1 G92.1",
    },
    HAAS: {
        Act.UNCHANGED: f"{_ISO_UNCHANGED} G103 G187",
        Act.MOTION: f"{_MILLING} {_DRILLING} G76 G77",
        Act.FEED: "G93-G95",
        Act.RETRACT: "G98 G99",
        Act.EVENT: f"{_ISO_EVENTS} G50.1 G51.1 G110-G129 G154",
        Act.REFUSE: f"{_REFUSED} G41.1 G42.1 G5.1 G92.1 G47 G70-G72 G87 G150",
    },
    GRBL: {
        Act.UNCHANGED: "G40",
        Act.MOTION: _MILLING,
        Act.ARC_DISTANCE: "G91.1",
        Act.FEED: "G93 G94",
        Act.EVENT: f"{_EVENTS} G43.1 G92.1",
        Act.REFUSE: f"G5 {_FAMILY_REFUSED} {_TRANSFORMS} G5.1 G61.1",
    },
}


def listed_codes(text: str) -> set[int]:
    """Ten times the numbers of codes; `G1-G3` are G1, G2, G3, and `G1.1-G1.3` by tenths."""
    codes: set[int] = set()
    for part in text.split():
        first, _, last = part.partition("-")
        low, high = (round(10 * float(code[1:])) for code in (first, last or first))
        codes |= set(range(low, high + 1, 1 if "." in first else 10))
    return codes


@pytest.mark.parametrize("control", CONTROLS)
def test_what_becomes_of_each_g_code(control: str) -> None:
    profile = DIALECTS[control]
    assert isinstance(profile, Profile)
    wanted = CODES[control] | {Act.PLANE: "G17-G19", Act.DISTANCE: "G90 G91"}
    own: dict[Act, set[int]] = {}
    for code, act in profile.codes.items():
        own.setdefault(act, set()).add(code)
    assert own == {act: listed_codes(text) for act, text in wanted.items()}
    # the table for people says the same
    rows = [row for row in profile.rows() if re.fullmatch(r"G[\d.]+", row.statement)]
    here = {code: act for code, act in profile.codes.items() if profile.aliases.get(code) != NO_CODE}
    also = {alias: profile.codes[code] for alias, code in profile.aliases.items() if code != NO_CODE}
    assert [round(10 * float(row.statement[1:])) for row in rows] == sorted(here | also)
    support = {Act.UNCHANGED: Support.UNCHANGED, Act.REFUSE: Support.REFUSED, Act.MOTION: Support.CORRECTED}
    for row, (code, act) in zip(rows, sorted((here | also).items()), strict=True):
        assert row.support == support.get(act, Support.READ)
        if code in also:
            assert row.why == f"as G{profile.aliases[code] / 10:g} of other controls"
            continue
        assert bool(row.why) == (act is Act.REFUSE)
        assert not row.why or row.why.startswith(f"{row.statement} ") or row.statement == "G61.1"
    of_g92_1 = {
        FANUC: "G92.1 presets offsets that are not known off line",
        HAAS: "G92.1 is not a code of this control",
    }
    assert profile.refusals.get(921) == of_g92_1.get(control)


@pytest.mark.parametrize("profile", PROFILES, ids=lambda profile: profile.name)
def test_the_table_says_of_every_m_code_what_the_reader_does(
    profile: Profile, setups: dict[str, Setup]
) -> None:
    """Each alone behind a known position: unchanged, refused, or behind it nothing is known."""
    rows = {row.statement: row for row in profile.rows()}
    still = {f"M{m / 10:g}" for m in profile.still_m}
    head = "G0 X1. Y2. Z3.\n"
    for m in (0, 3, 9, 30, 47, 73, 98, 99, 104, 206, 600, 999):
        name = f"M{m}"
        got = outcome(f"{head}{name}\nG0 Y5.\n", setups[profile.name], profile)
        if name in rows and rows[name].support is Support.REFUSED:
            assert isinstance(got, str) and f"2: {name} " in got
        elif name in still:
            assert isinstance(got, tuple) and got[0] == 1.0
        else:
            assert rows["any other M"].support is Support.READ
            assert isinstance(got, tuple) and np.isnan(got[0])


@pytest.mark.parametrize("name", [*(profile.name for profile in PROFILES), "apt", "dmis", "urscript"])
def test_each_refusal_of_the_table_says_what_to_do(name: str) -> None:
    assert not [row for row in DIALECTS[name].rows() if row.support is Support.REFUSED and ";" not in row.why]


def test_a_code_without_a_reason_is_not_of_the_control() -> None:
    rows, alone = {row.statement: row for row in DIALECTS[GRBL].rows()}, "; post the program without it"
    assert rows["G61.1"] == Row("G61.1", Support.REFUSED, f"is not a code of this control{alone}")
    assert rows["G68"] == Row("G68", Support.REFUSED, f"G68 (rotation) is not read{alone}")
    assert rows["G54"] == Row("G54", Support.READ)


def test_how_programs_of_a_control_are_written() -> None:
    """Names, endings of files, decimals of inches and of centres, and bounds of feeds, by the manuals."""
    written = {
        d.name: (
            d.written_ending,
            d.inch_decimals,
            d.free_digits,
            d.path_tolerance,
            d.least_inverse_feed,
            d.program_number,
        )
        for d in PROFILES
    }
    assert written == {
        LINUXCNC: ("ngc", 5, 1, True, 0.1, False),
        CENTROID: ("nc", 4, 0, False, 0.0, False),
        FANUC: ("nc", 4, 0, False, 0.0, True),
        HAAS: ("nc", 4, 0, False, 0.0, True),
        GRBL: ("nc", 5, 1, False, 0.0, False),
        MACH3: ("tap", 5, 1, False, 0.0, False),
        MACH4: ("tap", 5, 1, False, 0.0, False),
        MAZAK: ("nc", 4, 0, False, 0.0, True),
        OKUMA: ("nc", 4, 0, False, 0.0, False),
        SIEMENS: ("nc", 4, 0, False, 0.0, True),
        MARLIN: ("gcode", 5, 1, False, 0.0, False),
        KLIPPER: ("gcode", 5, 1, False, 0.0, False),
        EDING: ("cnc", 5, 1, False, 0.0, False),
    }
    for profile in PROFILES:
        assert profile.title.startswith({GRBL: "Grbl 1.1 and", HAAS: "Haas mills"}.get(profile.name, ""))
        assert profile.first == (b"%", b"O|:") or profile.commands is not None
        assert profile.payload_comments
        assert (profile.unroller is None) == (profile.name in (*PRINTERS, CENTROID, EDING))
        # outputs that are switched along with a motion
        along = frozenset({62, 63, 67}) if profile.name == LINUXCNC else frozenset()
        assert profile.m_with_motion == along or {104, 106, 204} < profile.m_with_motion


@pytest.mark.parametrize(
    ("least_mm", "metric", "inch"),
    [(0.001, 0.001, 0.0001), (0.0005, 0.001, 0.0001), (0.0004, 0.0001, 0.00001), (0.0001, 0.0001, 0.00001)],
)
def test_a_number_without_a_point_counts_increments_of_its_axis(
    least_mm: float, metric: float, inch: float, setups: dict[str, Setup]
) -> None:
    """0.001 mm goes with 0.0001 inch. I, J and K are along X, Y and Z; R and Q count as X."""
    there = setups[FANUC].machine
    for axis, letters in (("X", "XIRQ"), ("Y", "YJ"), ("Z", "ZK")):
        axes = {a: replace(x, least_increment_mm=1e-3) for a, x in there.axes.items()}
        axes[axis] = replace(axes[axis], least_increment_mm=least_mm)
        fine = replace(there, axes=axes)
        for letter in "XYZIJKRQ":
            mine = letter in letters
            assert increment(fine, letter, 1.0) == (metric if mine else 0.001)
            assert increment(fine, letter, 25.4) == pytest.approx(inch if mine else 0.0001, rel=1e-12)


def test_a_calculator_control_counts_whole_units(setups: dict[str, Setup]) -> None:
    fanuc, linuxcnc = DIALECTS[FANUC], DIALECTS[LINUXCNC]
    assert isinstance(fanuc, Profile) and isinstance(linuxcnc, Profile)
    there = setups[FANUC].machine
    pocket = replace(there, decimal_point="calculator")
    assert fanuc.counts_increments(there)
    assert not fanuc.counts_increments(pocket)
    assert not linuxcnc.counts_increments(there)
    assert fanuc.bare_mm(there, "X", 1.0) == 0.001
    assert fanuc.bare_mm(there, "X", 25.4) == pytest.approx(0.00254, rel=1e-12)
    assert fanuc.bare_mm(pocket, "X", 25.4) == linuxcnc.bare_mm(there, "X", 25.4) == 25.4


def test_dwells_without_a_point_are_milliseconds_on_iso_controls() -> None:
    fanuc, linuxcnc = DIALECTS[FANUC], DIALECTS[LINUXCNC]
    assert isinstance(fanuc, Profile) and isinstance(linuxcnc, Profile)
    assert fanuc.dwell_s(500.0, pointed=False) == 0.5
    assert fanuc.dwell_s(500.0, pointed=True) == 500.0
    assert linuxcnc.dwell_s(500.0, pointed=False) == linuxcnc.dwell_s(500.0, pointed=True) == 500.0


@pytest.mark.parametrize(
    ("line", "straight"),
    [
        (b"G2 X1 Y2 I3 J-4.5 F6", b"G1   X1 Y2     F6"),
        (b"N5 G03X1Y2R+.5", b"N5 G1  X1Y2 "),
        (b"/2 n 10 X1 I2", b"/2 n 10 G1 X1  "),
        (b"X1 Y2 k 3 p2", b"G1 X1 Y2    "),
        (b"g 002 G20 G30 G2.1 G23 X3", b"G1   G20 G30 G2.1 G23 X3"),
        (b"G90 X1 I.5", b"G1 G90 X1  "),
    ],
)
def test_an_arc_made_straight_keeps_its_other_words(line: bytes, straight: bytes) -> None:
    assert DIALECTS[LINUXCNC].straightened(line) == straight


def test_lines_end_where_the_control_ends_them() -> None:
    text = b"X1\rX2\r\nX3"
    assert DIALECTS[LINUXCNC].lines(text) == [b"X1\rX2\r\n", b"X3"]
    assert DIALECTS[GRBL].lines(text) == [b"X1\r", b"X2\r\n", b"X3"]
