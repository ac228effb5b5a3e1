"""Which dialect a text is in: by name, by text, by the ending of its file, by the control; and payloads."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine

from olp.core.errors import ProgramError, UsageError
from olp.files.config import load_setup
from olp.program import registry
from olp.program.dialect import Row, Support
from olp.program.registry import DIALECTS, dialect_of, find, named, read
from olp.program.text.signs import is_plain

HAAS = DIALECTS["haas"]
SHARED = b"GOTO/1,2,3\n"


def chosen(name: str | None, data: bytes, file: str, control: str = "haas") -> str:
    return dialect_of(name, DIALECTS[control], data, file).name


def test_names() -> None:
    assert named("haas") is find("haas") is HAAS
    assert find("has") is None
    with pytest.raises(UsageError, match="'HASS'; did you mean haas"):
        named("HASS")
    with pytest.raises(UsageError, match="expected one of linuxcnc, fanuc, grbl, haas, mach3, mach4, mazak"):
        named("?")


def test_a_name_comes_before_all_signs() -> None:
    assert chosen("grbl", b"PARTNO/1\n", "a.cls") == "grbl"


@pytest.mark.parametrize("file", ("a.cls", "A.CLS", "a.ncl.3"))
def test_an_ending_comes_before_the_control(file: str) -> None:
    assert chosen(None, b"", file) == "apt"
    assert chosen(None, b"", "cls") == "apt"
    assert chosen(None, b"", "a.nc") == "haas"
    assert chosen(None, b"", "a.cls.nc") == "haas"


def test_an_ending_of_the_control_too_leaves_the_dialect_to_it() -> None:
    assert chosen(None, b"G291\nG0 X1\n", "A.MPF", "siemens-iso") == "siemens-iso"
    assert chosen(None, b"R1=5\nG0 X1\n", "a.mpf", "siemens-iso") == "sinumerik"
    assert chosen(None, b"G0 X1\n", "a.mpf") == chosen(None, b"", "a.spf", "sinumerik") == "sinumerik"


def test_a_text_that_two_dialects_share_is_decided_by_ending_or_control() -> None:
    assert chosen(None, SHARED, "a.dmi") == "dmis"
    assert chosen(None, SHARED, "a.ncl") == "apt"
    assert chosen(None, SHARED, "a.txt", "apt") == "apt"
    with pytest.raises(ProgramError, match="may be apt or dmis; name its dialect"):
        chosen(None, SHARED, "a.txt")


def test_a_procedure_is_of_the_language_of_its_parameters() -> None:
    text = b"PROC HOLES1 (REAL SPCA, INT NUM)\nDEF AXIS _X\nM17\n"
    assert chosen(None, text, "holes1.spf") == "sinumerik"
    assert chosen(None, b"PROC holes1(num spca)\nENDPROC\n", "holes1.txt") == "abb-rapid"


def test_a_text_that_its_ending_contradicts_is_refused() -> None:
    text = b"DMISMN/'a',05.2\nGOTO/1,2,3\n"
    assert chosen(None, text, "a.txt") == "dmis"
    with pytest.raises(ProgramError, match="ending of the file is that of apt, and its text is dmis"):
        chosen(None, text, "a.ncl")


@pytest.mark.parametrize(("before", "line"), [(b"", 1), (b"FROM/0,0,0\nFEDRAT/100,MMPM\n", 3)])
def test_a_payload_comment_of_a_dialect_that_has_none_is_refused(
    tmp_path: Path, before: bytes, line: int
) -> None:
    setup = load_setup(machine(tmp_path, tables=TRUE_ZERO), None)
    with pytest.raises(ProgramError, match=r"a comment changes the payload: .* one payload") as caught:
        read(before + b"PPRINT (olp payload 30 kg)\nGOTO/1,2,3\n", setup, DIALECTS["apt"])
    assert caught.value.line == line


#: lines that only one dialect has, each the only one of its text
SIGNS = {
    "apt": (
        "PARTNO A", "LOADTL/1", "LOAD/TOOL,1", "LOAD /1", "SPINDL/9", "FINI", "FINI\r", "CUTTER/1",
        "TOOL PATH/A",
        "CUTCOM/LEFT", "MULTAX/ON", "TLAXIS/0,0,1", "RAPID", "RAPID/", "RAPID / \r", "FEDRAT/9", "FEDRAT/.5",
        "FEDRAT / IPM,1", "FEDRAT/MMPM,5", "FEDRAT/IM,5", "GODLTA/1", "INDIRV/1,0,0", "MOVARC/1", "CIRCLE/1",
        "CIRCLE /1", "CYCLE/OFF", "CYCLE /OFF", "UNITS/MM", "UNIT/INCH", "UNITS / INCHES \r",
        "GOTO/1,2,3,0,0,1",
        "GOTO / -1.5, +2E1 ,3D0 , 0,0,1",
    ),
    "dmis": (
        "DMISMN/A", "FILNAM/A", "SNSLCT/S(A)", "SNSET/A", "PTMEAS/CART", "MEAS/POINT", "MEAS /POINT",
        "ENDMES",
        "ENDFIL", "WKPLAN/XY", "TECOMP/ON", "UNITS/MM,ANGDEC", "UNITS / MM , A", "GOTO/CART,1",
        "GOTO / CART,1",
        "MODE/MAN", "MODE / PROG,MAN", "MODE/AUTO", "F(A)=FEAT/1", "F(A b) = FEAT/1", "FEDRAT/POSVEL,1",
        "FEDRAT / MESVEL,1",
    ),
    "urscript": (
        "def a():", "def pallet(x, y):  # rows", "thread b() :", "global v = 1", " local y = p[1]",
        "while (x < 3):", "elif x: # no", "if a:\r",
    ),
}  # fmt: skip
#: lines that no dialect of statements has alone
NO_SIGNS = (
    "LOAD 1", "FINISH", "RAPID A", "RAPID/5", "FEDRAT/A", "CIRCLE 1", "CYCLE 1", "UNITS MM", "UNIT/MM,X",
    "GOTO 1",
    "GOTO/1,2,3", "GOTO/A,2,3,0,0,1", "MEAS", "MODE/OFF", "F(A)=5", "X PARTNO", "(PARTNO)", "G0 X1 FINI",
    "if a: b", "IF X", "global = 2",
)  # fmt: skip


@pytest.mark.parametrize(("name", "line"), [(n, line) for n, lines in SIGNS.items() for line in lines])
def test_a_line_that_only_one_dialect_has_shows_it(name: str, line: str) -> None:
    """Anywhere in the text, in capitals or not, behind blanks; else the control's dialect is taken."""
    for text in (line, f"A\n \t{line}\nB", f"G0 X1\n{line.lower()}\n"):
        assert chosen(None, text.encode(), "a.txt") == name


@pytest.mark.parametrize("line", [line for lines in SIGNS.values() for line in lines] + ["GOTO/1", "FROM /1"])
def test_a_line_that_shows_a_dialect_is_no_plain_block(line: str) -> None:
    """Texts of plain blocks are not searched for signs."""
    for text in (line, line.lower()):
        assert not is_plain(text.encode())


def test_a_text_of_plain_blocks_is_plain() -> None:
    assert is_plain(b"N10 G1 X-1.5Y+.5 Z2. F1E3 (L X+1 R0 FMAX)\r\nM30\n")
    for odd in (b"G1 X", b"G1 X Y1", b"GO", b"GOX1", b"_", b"G641", b"X\xc41", b"X1;", b"%"):
        assert not is_plain(odd) and not is_plain(b"G0 X1\n" + odd + b"\nG0")


def test_a_dialect_is_imported_when_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_LOADED", {})
    assert chosen(None, b"GOTO/1,2,3\n", "a.cls", "apt") == "apt"
    assert {*registry._LOADED} == {"apt"}
    assert "dmis" in registry.DIALECTS and len(registry.DIALECTS) == len([*registry.DIALECTS])
    with pytest.raises(KeyError):
        _ = registry.DIALECTS["no such dialect"]


def test_a_dialect_with_another_name_or_other_signs_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_LOADED", {})
    apt = registry._KNOWN["apt"]
    monkeypatch.setitem(registry._KNOWN, "mine", apt)
    monkeypatch.setitem(registry._KNOWN, "apt", replace(apt, signs=registry.NO_SIGNS))
    for name in ("mine", "apt"):
        with pytest.raises(ValueError, match="another name or other signs"):
            named(name)


@pytest.mark.parametrize("line", NO_SIGNS)
def test_a_line_that_others_have_too_shows_nothing(line: str) -> None:
    assert chosen(None, f"{line}\n".encode(), "a.nc", "apt") == "apt"
    signs = [d.signs.own for d in DIALECTS.values() if d.signs.own is not None]
    assert not any(sign.search(line.encode()) for sign in signs)


@pytest.mark.parametrize("line", ("GOTO/1,2,3", "goto / 1", "RAPID/5", "FROM/1,2,3", " \tFROM /1"))
def test_points_by_slash_are_of_two_dialects(line: str) -> None:
    with pytest.raises(ProgramError, match="the text may be apt or dmis; name its dialect") as caught:
        chosen(None, f"A\n{line}\n".encode(), "a.txt")
    assert caught.value.code == "OLP503"


def test_more_signs_decide_and_as_many_do_not() -> None:
    assert chosen(None, b"PARTNO\nFINI\nENDMES\n", "") == "apt"
    assert chosen(None, b"PARTNO\nENDFIL\nENDMES\n", "") == "dmis"
    with pytest.raises(ProgramError, match="may be apt or dmis"):
        chosen(None, b"PARTNO\nENDMES\n", "")
    assert chosen(None, b"PARTNO\nENDMES\n", "a.dmis") == "dmis"
    assert chosen(None, b"PARTNO\nENDMES\n", "a.cl", "dmis") == "apt"
    # signs count in the first 65536 bytes
    assert chosen(None, b"\n" * 65530 + b"PARTNO\n", "") == "apt"
    assert chosen(None, b"\n" * 65531 + b"PARTNO\n", "") == "haas"


@pytest.mark.parametrize(
    ("file", "name"),
    [
        *((f"part.{e}", "apt") for e in ("apt", "aptsource", "ncl", "cls", "cl", "clt", "cldata", "clf")),
        *((f"part.{e}", "dmis") for e in ("dmi", "dms", "dmis")), ("part.csv", "list"), ("PART.TSV", "list"),

        ("part.h", "heidenhain"), ("PART.H", "heidenhain"),
        ("part.ncl.12", "apt"), ("part.12", "haas"), ("part.ncl.x", "haas"), ("", "haas"), ("part", "haas"),
    ],
)  # fmt: skip
def test_endings_of_files(file: str, name: str) -> None:
    assert chosen(None, b"", file) == name


def test_an_ending_of_the_control_itself_is_no_contradiction() -> None:
    """User tasks of Okuma have `X=` as Sinumerik has it."""
    text, okuma = b"VC1=0\nG0 X=-3-VC1 Y=0\nM2\n", DIALECTS["okuma"]
    assert dialect_of(None, okuma, text, "PART.MIN").name == "okuma"
    assert dialect_of(None, okuma, text, "PART.MPF").name == "sinumerik"
    with pytest.raises(ProgramError, match="is that of okuma, and its text is sinumerik"):
        dialect_of(None, DIALECTS["haas"], text, "PART.MIN")


def test_a_contradiction_has_its_code() -> None:
    with pytest.raises(ProgramError, match="with --dialect, or with the key dialect") as caught:
        chosen(None, b"PARTNO A\n", "a.dmi")
    assert caught.value.code == "OLP503"


def test_what_each_dialect_of_statements_says_of_itself() -> None:
    apt, dmis = DIALECTS["apt"], DIALECTS["dmis"]
    assert list(DIALECTS) == [
        "linuxcnc", "fanuc", "grbl", "haas", "mach3", "mach4", "mazak", "centroid", "eding", "fagor", "okuma",
        "siemens-iso", "marlin", "klipper", "sinumerik", "heidenhain", "apt", "dmis", "list", "fanuc-tp",
        "urscript", "abb-rapid", "kuka-krl", "yaskawa-inform", "staubli-val3",
    ]  # fmt: skip
    assert apt.title == "APT and cutter-location data (ISO 4343, ISO 3592)"
    assert dmis.title == "DMIS part programs of coordinate measuring machines (ISO 22093)"
    assert (apt.path_mode, dmis.path_mode) == (
        "the post-processor's", "the control's own approach and retract"
    )  # fmt: skip
    assert apt.comment == dmis.comment == (b"$$ ", b"")
    assert (apt.first, dmis.first) == ((b"%", b"$$*", b"PARTNO"), (b"FILNAM|DMISMN|DMISMD",))
    assert (apt.points, apt.axes_at_ram, dmis.points, dmis.axes_at_ram) == (False, False, True, True)
    for dialect in (apt, dmis, DIALECTS["list"]):
        assert (dialect.marks, dialect.payload_comments, dialect.path_tolerance) == (True, False, False)
        assert (dialect.inch_decimals, dialect.free_digits, dialect.keeper) == (5, 1, None)
        assert (dialect.unroller is None) == (dialect is not apt)
        assert dialect.straightened(b"G2 X1\n") == b"G2 X1\n"
        assert dialect.lines(b"a\r\nb\rc") == [b"a\r\n", b"b\r", b"c"]
    assert not DIALECTS["list"].continues(b"a $")


@pytest.mark.parametrize(
    ("line", "goes_on"),
    [(b"A $", True), (b"A $ \r\n", True), (b"$", True), (b"A $ B", False), (b"$$ A $", False), (b"A", False)],
)
def test_statements_go_on_behind_a_dollar(line: bytes, goes_on: bool) -> None:
    assert DIALECTS["apt"].continues(line) is DIALECTS["dmis"].continues(line) is goes_on


def test_support_is_said_for_people_and_for_reports() -> None:
    titles = {support: (support.value, support.title) for support in Support}
    assert titles == {
        Support.CORRECTED: ("corrected", "corrected"), Support.READ: ("read", "read"),
        Support.UNCHANGED: ("carried", "unchanged"), Support.REFUSED: ("refused", "refused"),
    }  # fmt: skip
    assert Row("A", Support.UNCHANGED).as_dict() == {"statement": "A", "support": "carried", "why": ""}
    assert DIALECTS["apt"].support()[0] == {
        "statement": "GOTO", "support": "corrected", "why": "points with or without a tool axis"
    }  # fmt: skip


def test_payloads_of_a_job_belong_to_languages_that_have_them(tmp_path: Path) -> None:
    setup = load_setup(machine(tmp_path, tables=TRUE_ZERO), None)
    changing = replace(setup, job=replace(setup.job, payloads={7: 1.0, 3: 2.0}))
    with pytest.raises(ProgramError, match=r"\[\[payloads\]\] of the job file: .* one payload") as caught:
        read(b"GOTO/1,2,3\n", changing, DIALECTS["apt"])
    assert (caught.value.line, caught.value.code) == (3, "OLP550")
    assert "APT and cutter-location data (ISO 4343, ISO 3592) programs have one payload" in str(caught.value)
    for comment in (b"$$ olp payload 3", b"PPRINT OLP\tPAYLOAD", b"olp  payload"):
        with pytest.raises(ProgramError, match="a comment changes the payload") as caught:
            read(b"GOTO/1,2,3\n\n" + comment, setup, DIALECTS["apt"])
        assert (caught.value.line, caught.value.code) == (3, "OLP550")
    for comment in (b"$$ xolp payload", b"$$ olp payloads", b"$$ olp-payload", b"$$ olp\n$$ payload"):
        assert len(read(b"GOTO/1,2,3\n" + comment, setup, DIALECTS["apt"]).toolpath) == 1
