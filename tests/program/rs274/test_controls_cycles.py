"""Canned cycles where controls differ in what a block of a series has to say."""

from __future__ import annotations

import random
from dataclasses import fields

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.unrolling import fanuc

from olp.core.errors import ProgramError
from olp.core.toolpath import Kind
from olp.files.config import load_setup
from olp.program.program import Program
from olp.program.registry import DIALECTS, read

START = "O1\nG21 G90 G17 G54\nG0 X0. Y0. Z20.\n"


@pytest.fixture(scope="module")
def reading(tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    setup = load_setup(machine(tmp_path_factory.mktemp("m"), tables=TRUE_ZERO))

    def read_(body: str, control: str = "fanuc", start: str = START) -> Program:
        return read(f"{start}{body}M30\n".encode(), setup, DIALECTS[control])

    return read_


def path(program: Program) -> list[list[float]]:
    return program.toolpath.end_mm.tolist()


@pytest.mark.parametrize("zero", ["K0", "L0"])
def test_zero_repeats_store_what_the_next_blocks_use(zero: str, reading) -> None:  # type: ignore[no-untyped-def]
    stored = reading(f"G99 G81 Z-5. R2. F100. {zero}\nX10. Y5.\nX20.\nG80\n")
    stated = reading("G99 G81 X10. Y5. Z-5. R2. F100.\nX20.\nG80\n")
    assert path(stored) == path(stated)
    np.testing.assert_array_equal(stored.holes.place_mm, [[10, 5], [20, 5]])


def test_zero_repeats_at_a_place_are_refused(reading) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ProgramError, match="whether it goes to its place") as caught:
        reading("G99 G81 X1. Z-5. R2. F100. K0\nG80\n")
    assert (caught.value.code, caught.value.line) == ("OLP531", 4)


def several(seed: int, dwell: str) -> str:
    """Series of several cycles that inherit words, repeat, and begin at many levels; `{}` ends each."""
    draw = random.Random(seed)
    lines = []
    for _ in range(9):
        code = draw.choice(["G81", "G83 Q1.5", "G73 Q2.", "G82 P0.5", "G82" + dwell])
        r = draw.uniform(-1, 3)
        lines.append(f"G90 {draw.choice(('G98', 'G99'))} {code} X1. R{r:.2f} Z{r - draw.uniform(0, 4):.2f}")
        lines += draw.choices(["X5.", "Y3.", "X2. Y4.", "X7. R3.", "Y6. Z-6.", "/X9.", "X8. L2"], k=4)
        lines += draw.choice([[], ["G91 X1. R-1. Z-3.", "X2.", "G90 R2. Z-1.", "X3."]])
        ends = ["G0 Z9.", "/G1 Z9.", "G0 X3. Z2.\nY4.", "G1 X4.", "G0 Z1.\nG1 X2. Z5.", "G91 G0 Z1."]
        lines.append(f"{{}} G80\n{draw.choice(ends)}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(("control", "dwell"), [("haas", ""), ("linuxcnc", " P1.")])
@pytest.mark.parametrize("seed", [3])
def test_series_made_together_are_those_made_one_by_one(seed: int, control: str, dwell: str, reading) -> None:  # type: ignore[no-untyped-def]
    """An event, here the offset that is in force already, ends what is carried out together."""
    start, text = START.replace("O1\n", "F100\n"), several(seed, dwell)
    together, single = (reading(text.format(*[word] * 9), control, start) for word in ("N54", "G54"))
    for name in ("end_mm", "kind", "flag", "line"):
        np.testing.assert_array_equal(getattr(together.toolpath, name), getattr(single.toolpath, name))
    for field in fields(together.holes):
        columns = (getattr(program.holes, field.name) for program in (together, single))
        np.testing.assert_array_equal(*columns, err_msg=field.name)


@pytest.mark.parametrize("code", ["G82", "G86", "G89"])
def test_a_cycle_of_fanuc_needs_no_dwell(code: str, reading) -> None:  # type: ignore[no-untyped-def]
    with_none = reading(f"G99 {code} X1. Z-5. R2. F100.\nG80\n")
    assert path(with_none) == path(reading(f"G99 {code} X1. Z-5. R2. P0 F100.\nG80\n"))
    with pytest.raises(ProgramError, match="needs a dwell P"):
        reading(f"M3 S9\nG99 {code} X1. Z-5. R2. F100.\nG80\n", "linuxcnc", START.replace("O1\n", ""))


def test_a_first_peck_of_haas_counts_where_there_is_no_q(reading) -> None:  # type: ignore[no-untyped-def]
    varying = reading("G99 G83 X1. Z-5. R2. I3. J.5 K1. F100.\nG80\n", "haas")
    assert path(varying) == path(reading("G99 G83 X1. Z-5. R2. Q3. F100.\nG80\n", "haas"))
    assert len(varying.holes.line) == 1
    with pytest.raises(ProgramError, match="needs a peck Q"):
        reading("G99 G83 X1. Z-5. R2. I3. F100.\nG80\n")


def test_a_colon_begins_the_number_of_a_program(reading) -> None:  # type: ignore[no-untyped-def]
    start = START.replace("O1", ":0001 (PART)")
    assert path(reading("X5.\n", start=start)) == path(reading("X5.\n"))
    text = fanuc(":1\nG21 G90\nM98 P2\nM98 P2\nM30\n:2\nG91 G1 X5. F9.\nG90\nM99\n")
    assert text == ":1\nG21 G90\nG91 G1 X5. F9.\nG90\nG91 G1 X5. F9.\nG90\nM30\n"


@pytest.mark.parametrize("flatten", [False, True])
def test_a_colon_in_front_of_words_is_named(flatten: bool, reading) -> None:  # type: ignore[no-untyped-def]
    """As a common post of NX has it for changes of tools; these controls begin a program there."""
    body = ":0030 T01 M06\nX5.\n"
    if flatten:
        assert ":0030 T01 M06\n" in fanuc(START + body + "M30\n")
    with pytest.raises(
        ProgramError, match=r"`:0030 T01 M06` begins with a colon, .* write N instead"
    ) as caught:
        reading(body)
    assert (caught.value.code, caught.value.line) == ("OLP510", 4)


OKUMA = "G21 G90 G17\nG0 X0. Y0. Z50.\n"


@pytest.fixture(scope="module")
def okuma(tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    setup = load_setup(machine(tmp_path_factory.mktemp("m"), tables=TRUE_ZERO))

    def read_(body: str) -> Program:
        return read(f"{OKUMA}{body}M2\n".encode(), setup, DIALECTS["okuma"])

    return read_


def test_okuma_returns_to_the_level_of_g71_or_to_r(okuma) -> None:  # type: ignore[no-untyped-def]
    """By hand: M53 goes up to the level of G71, M54 to R, whatever the height before the series was."""
    program = okuma("G71 Z20.\nG81 X10. R2. Z-5. F100. M53\nX20.\nX30. M54\nX40.\nG80\nG0 X0. Z50.\n")
    assert [row[::2] for row in path(program)[1:]] == [
        [10, 50], [10, 2], [10, -5], [10, 20], [20, 20], [20, 2], [20, -5], [20, 20],
        [30, 20], [30, 2], [30, -5], [30, 2], [40, 2], [40, -5], [40, 2], [0, 50],
    ]  # fmt: skip
    np.testing.assert_array_equal(program.holes.initial_mm, 20.0)


def test_a_later_level_of_okuma_holds_from_its_own_block_on(okuma) -> None:  # type: ignore[no-untyped-def]
    program = okuma("M53\nG71 Z20.\nG81 X10. R2. Z-5. F100.\nG71 Z30.\nX20.\nG80\n")
    assert [row[2] for row in path(program) if row[0] in (10, 20)] == [50, 2, -5, 20, 20, 2, -5, 30]


@pytest.mark.parametrize("control", ["fanuc", "haas", "mazak"])
@pytest.mark.parametrize(
    ("text", "again"),
    [
        # the usual row of holes, and a series in G91 that goes on at places
        ("G98 G81 X10. Z-5. R2. F60.\nG91 X5.{} L3\nG90 X2.{}\nG80\n", (" R-18. Z-7.", " R2. Z-5.")),
        ("G91 G99 G81 X10. Z-5. R-18. F60.\nX3.\nG90 X5.{}\nG91 Y2.{}\nG80\n", (" R2. Z-3.", " R-18. Z-5.")),
    ],
)
def test_levels_of_a_cycle_stay_where_they_are(  # type: ignore[no-untyped-def]
    text: str, again: tuple[str, str], control: str, reading
) -> None:
    """Between G90 and G91, by the same holes with all words."""
    kept, stated = reading(text.format("", ""), control), reading(text.format(*again), control)
    assert path(kept) == path(stated)
    np.testing.assert_array_equal(kept.holes.z_mm, stated.holes.z_mm)


@pytest.mark.parametrize(
    ("control", "more"), [("siemens-iso", ""), ("mach3", ""), ("fanuc", " Z-7."), ("haas", "\nX5. R-40.")]
)
def test_levels_that_are_not_known_to_stay_are_refused(control: str, more: str, reading) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ProgramError, match=r"give R and the depth again$"):
        reading(f"G98 G81 X10. Z-5. R2. F60.\nG91 X5.{more}\nG90 G80\n", control)


@pytest.mark.parametrize(("synchronous", "plain"), [("G284", "G84"), ("G274", "G74")])
def test_synchronous_taps_of_okuma_have_the_strokes_of_its_taps(  # type: ignore[no-untyped-def]
    synchronous: str, plain: str, okuma
) -> None:
    taps = "G71 Z20.\nM3 S500\n{} X10. Y5. R4. Z-8. F625. M53\nX30. M54\nG80\n"
    assert path(okuma(taps.format(synchronous))) == path(okuma(taps.format(plain)))


@pytest.mark.parametrize(
    ("synchronous", "mark", "plain"),
    [("G84.2", "", "G84"), ("G84.3", "", "G74"), ("G84", ",R1", "G84"), ("g 074", " , r 0 (A)", "G74")],
)
def test_synchronous_taps_of_mazak_have_the_strokes_of_its_taps(  # type: ignore[no-untyped-def]
    synchronous: str, mark: str, plain: str, reading
) -> None:
    taps = "M3 S500\n{} X10. Y5. R4. Z-8. F1.25{}\nX30.\nG80\n"
    read = reading(taps.format(synchronous, mark), "mazak")
    assert path(read) == path(reading(taps.format(plain, ""), "mazak"))
    for text in ("G1 X5. ,R1 F60.\n", "G84 X5. R4. Z-8. F1. ,R2\n", "(G84) G1 X5. ,R1 F60.\n"):
        with pytest.raises(ProgramError, match="asks for a corner"):
            reading(text, "mazak")


@pytest.mark.parametrize(
    ("body", "code", "line", "why"),
    [
        ("G81 X10. R2. Z-5. F100. M53\n", "OLP532", 3, "give G71 with the level"),
        ("G71 Z20.\nG81 X10. R2. Z-5. F100.\n", "OLP532", 4, "give M53 or M54"),
        ("G71 Z20.\nG91 G81 X10. R2. Z-5. F100. M53\n", "OLP518", 4, "give G90"),
        ("G71 Z20.\nG81 X10. R2. Z-5. F100. M52\n", "OLP512", 4, "upper limit of Z"),
        ("G71 X20.\n", "OLP516", 3, "a word Z alone"),
        ("G71 Z20.\nG76 X10. R2. Z-5. Q1. F100. M53\n", "OLP512", 4, "bore"),
    ],
)
def test_what_okuma_does_not_say_is_refused(body: str, code: str, line: int, why: str, okuma) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ProgramError, match=why) as caught:
        okuma(body)
    assert (caught.value.code, caught.value.line) == (code, line)


def test_a_fine_bore_has_the_strokes_of_a_bore_with_a_stop(reading) -> None:  # type: ignore[no-untyped-def]
    for control in ("fanuc", "haas", "mazak", "siemens-iso"):
        for words in ("X5. Y6. Z-20. R2. {}P200 F60.\nX30.", "X5. Z-20. R2. {}F60.\nG98 Y3."):
            fine = reading(f"G99 G76 {words.format('Q0.3 ')}\nG80\n", control)
            assert path(fine) == path(reading(f"G99 G86 {words.format('')}\nG80\n", control))


@pytest.mark.parametrize(("control", "code"), [("fanuc", "G87"), ("siemens-iso", "G87"), ("haas", "G77")])
@pytest.mark.parametrize("mode", ["G98", "G99"])
def test_a_bore_from_below_is_fed_upwards_and_left_above(control: str, code: str, mode: str, reading) -> None:  # type: ignore[no-untyped-def]
    """Worked by hand: down to R beside the wall, up to Z in feed, and always back to the initial level."""
    program = reading(f"{mode} {code} X5. Y6. Z-12. R-35. Q1.5 F40.\nX9.\nG80\n", control)
    assert path(program) == [
        [0, 0, 20], [5, 6, 20], [5, 6, -35], [5, 6, -12], [5, 6, 20],
        [9, 6, 20], [9, 6, -35], [9, 6, -12], [9, 6, 20],
    ]  # fmt: skip
    assert np.flatnonzero(program.toolpath.kind == Kind.LINE).tolist() == [3, 7]


def test_bores_and_patterns_that_a_control_makes_otherwise_are_refused(reading) -> None:  # type: ignore[no-untyped-def]
    for body, why in (
        ("G98 G87 X5. Z-12. R2. F40.\n", "waits for the operator"),
        ("G81 G98 Z-5. R2. F9. L0\nG70 I20. L6\n", "unroll the program with --flatten"),
        ("G98 G77 X5. Z-12. R2. F40.\n", "R 2 is above its end -12"),
    ):
        with pytest.raises(ProgramError, match=why):
            reading(body, "haas")


def test_levels_of_g90_last_in_g91_until_a_block_states_both(reading) -> None:  # type: ignore[no-untyped-def]
    """From Z20: R-18. is at 2, and Z-9. at -7."""
    turned = reading("G81 X9. Z-5. R2. F100.\nG91 X1.\nX1.\nX1. Z-9. R-18.\nX1.\nG80\nG90\n")
    stated = reading("G81 X9. Z-5. R2. F100.\nX10.\nX11.\nX12. Z-7.\nX13.\nG80\n")
    np.testing.assert_allclose(path(turned), path(stated), atol=1e-12)
    with pytest.raises(ProgramError, match="G90 and G91"):
        reading("G81 X9. Z-5. R2. F100.\nG91 X1.\nX1. Z-9.\nG80\n")
