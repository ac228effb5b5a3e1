"""Laws L1 to L8 of the program representation, through `olp.correct`, on every dialect and any bytes."""

from __future__ import annotations

import re
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine, points, unstamped
from cases.dialects import RS274
from cases.fast import some_fast
from hypothesis import example, given, settings
from hypothesis import strategies as st
from judge import machines, programs
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import match

import olp
from olp.core.errors import OlpError
from olp.program.registry import DIALECTS

ALPHABET = "GXYZIJKRFMTNSPQHLDO%/;()[]#=+-. 0123456789\r\n\t:<>\"'^!"
#: 1 nm, within which the two independent models agree
SLACK_MM = 1e-6
HALF_DIGIT = 0.5e-3 + SLACK_MM
TOOL = np.array([0.0, 0.0, -120.0])
#: what a control may find wrong with an arc, in mm: the strictest of them (grbl) takes 0.005
RADIUS_MM = 0.005
#: features whose coordinates are all places in a frame
PLAIN = (
    "lines",
    "short",
    "rapid",
    "arcs",
    "planes",
    "circle",
    "radius",
    "frames",
    "modal",
    "style",
    "comments",
)
WORD = re.compile(rb"(?i)([XYZ])([ \t]*)([+-]?(?:\d+\.?\d*|\.\d+))")


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("zero")
    return {name: machines.zero_machine(folder / name, Recipe(controller=name)) for name in RS274}


@pytest.fixture(scope="module")
def shifted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("shift")
    return {name: machines.shift_machine(folder / name, recipe=Recipe(controller=name)) for name in RS274}


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 11, Recipe(chain="YFXZ", off_datum=True))


def attempt(data: bytes, path: Path) -> bytes | None:
    """Corrected bytes, or None where the program is refused; anything but a refusal is a failure."""
    try:
        return olp.correct(data, path).data
    except OlpError as error:
        assert str(error)
        return None


# -- L1, L3: identity ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("dialect", some_fast(RS274, 4))
@given(data=st.one_of(st.binary(max_size=200), st.text(ALPHABET, max_size=120).map(str.encode)))
@example(data=b"")
@example(data=b"%\n%\n")
@example(data=b"\xef\xbb\xbfG21\nG0 X1\n")
@example(data=b"g0x-.86Y3Z8\nG2X-.87i4")
@example(data=b"G1X8Z8\nX-.3Y-1.58\nG2x-.13Y-1.6R.077")
@example(data=b"G1y4X.2Z2\ng3I5\nX0Y0Z8I822")
@example(data=b"G20G1X6")
@example(data=b"G0x9.1Y5Z-10.75G18\ng2x18.70Z-3I-3.3K13.9")
@settings(max_examples=40)
def test_l1_any_bytes_come_back_or_are_refused(zero: dict[str, Path], dialect: str, data: bytes) -> None:
    written = attempt(data, zero[dialect])
    assert written is None or written == data


@pytest.mark.parametrize("dialect", some_fast(RS274, 4))
@given(noise=st.binary(max_size=60))
@settings(max_examples=15)
def test_l1_text_in_a_comment_is_opaque(zero: dict[str, Path], dialect: str, noise: bytes) -> None:
    noise = re.sub(rb"[\0\r\n()]", b"", noise).replace(b"olp", b"")
    opening, closing = DIALECTS[dialect].comment
    comment = opening + noise + closing
    data = b"G21\nG90\n" + comment + b"\nG0 X1. Y2. Z3. " + comment + b"\n"
    assert olp.correct(data, zero[dialect]).data == data


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**20),
    cuts=st.lists(st.tuples(st.integers(0, 4000), st.binary(max_size=4)), max_size=6),
)
@settings(max_examples=25)
def test_l1_a_damaged_program_never_crashes(
    zero: dict[str, Path], shifted: dict[str, Path], seed: int, cuts: list[tuple[int, bytes]]
) -> None:
    text = bytearray(programs.random_program(seed, blocks=4))
    for place, piece in cuts:
        position = place % len(text)
        text[position : position + 2] = piece
    data = bytes(text)
    written = attempt(data, zero["linuxcnc"])
    assert written is None or written == data
    attempt(data, shifted["linuxcnc"])
    attempt(data, shifted["haas"])


@pytest.mark.parametrize("seed", range(12))
def test_l3_no_error_no_edit(zero: dict[str, Path], seed: int) -> None:
    data = programs.random_program(seed, blocks=12)
    assert olp.correct(data, zero["linuxcnc"]).data == data


# -- L2: bytes outside edits; a shift edits every slot -------------------------------------------------


def numbers(text: bytes) -> tuple[bytes, list[Decimal]]:
    """The text with a mark in place of each coordinate outside comments, and the coordinates."""
    values: list[Decimal] = []

    def mark(hit: re.Match[bytes]) -> bytes:
        values.append(Decimal(hit[3].decode()))
        return hit[1] + hit[2] + b"@"

    pieces = re.split(rb"(\([^)\n]*\)|;[^\n]*)", text)
    pieces[::2] = [WORD.sub(mark, piece) for piece in pieces[::2]]
    return b"".join(pieces), values


@pytest.mark.parametrize("seed", some_fast(range(20), 4))
def test_l2_a_shift_edits_every_slot_and_nothing_else(tmp_path: Path, seed: int) -> None:
    there = machines.shift_machine(tmp_path / "there")
    back = machines.shift_machine(tmp_path / "back", (-100.0, -100.0, -100.0))
    nominal = programs.random_program(seed, features=PLAIN, blocks=12)
    corrected = unstamped(olp.correct(nominal, there).data)
    frame, before = numbers(nominal)
    same_frame, after = numbers(corrected)
    assert same_frame == frame
    step = Decimal("0.00394") if b"G20" in nominal.upper() else Decimal("0.1")
    assert [b - a for b, a in zip(before, after, strict=True)] == [step] * len(before)
    returned = unstamped(olp.correct(corrected, back).data)
    assert numbers(returned) == (frame, before)


def test_l2_the_stamp_is_one_line_behind_tape_mark_and_number(shifted: dict[str, Path]) -> None:
    text = b"%\r\nO0007 (PART)\r\nG21 G90\r\nG0 X1. Y1. Z1.\r\nM30\r\n%\r\n"
    lines = olp.correct(text, shifted["haas"]).data.split(b"\r\n")
    assert lines[:2] == [b"%", b"O0007 (PART)"]
    assert re.fullmatch(rb"\(olp-corrected [0-9a-f]{12} .*\)", lines[2])
    assert lines[3:] == [b"G21 G90", b"G0 X0.900 Y0.900 Z0.900", b"M30", b"%", b""]


# -- L4, L6: the numbers written are the points meant -------------------------------------------------


def commanded(nominal_mm: np.ndarray, text: bytes, path: Path) -> np.ndarray:
    """(n, 3) difference of the written end of each nominal move from the command of the judge."""
    model = JudgeModel(path)
    offset = np.array([250.0, 200.0, -300.0])
    want = model.command_for(nominal_mm + offset, TOOL) - offset
    own = points(text)
    return np.asarray(own[match(own, want)] - want)


@pytest.mark.slow
@given(seed=st.integers(0, 2**16), digits=st.sampled_from([2, 3, 4]))
@settings(max_examples=12)
def test_l4_absolute_words_within_half_a_digit(bent: Path, seed: int, digits: int) -> None:
    rng = np.random.default_rng(seed)
    nominal = np.round(rng.uniform((-60, -50, -20), (60, 50, 40), (15, 3)), digits)
    corrected = olp.correct(programs.polyline_program(nominal, digits), bent).data
    half = 0.5 * 10.0 ** -max(digits, 3) + SLACK_MM
    assert np.abs(commanded(nominal, corrected, bent)).max() <= half


def test_l6_increments_do_not_drift(bent: Path) -> None:
    rng = np.random.default_rng(3)
    steps = np.round(rng.normal(scale=0.4, size=(3000, 3)) * (1, 1, 0.2), 3)
    steps -= np.round(steps.mean(axis=0), 3)
    block = "\n".join(f"X{x:.3f} Y{y:.3f} Z{z:.3f}" for x, y, z in steps)
    text = f"G21 G90 G54\nG0 X0 Y0 Z0\nG91 G1 F1000\n{block}\nM2\n".encode()
    away = commanded(np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), olp.correct(text, bent).data, bent)
    assert np.abs(away).max() <= HALF_DIGIT


# -- L7: arcs stay arcs of the control ----------------------------------------------------------------


@pytest.mark.slow
@given(
    radius=st.floats(1.0, 40.0), begin=st.floats(0, 6.2), sweep=st.floats(0.2, 6.0), clockwise=st.booleans()
)
@settings(max_examples=25)
def test_l7_arcs_keep_their_radius(
    bent: Path, radius: float, begin: float, sweep: float, clockwise: bool
) -> None:
    turn = -sweep if clockwise else sweep
    x0, y0 = round(radius * np.cos(begin), 3), round(radius * np.sin(begin), 3)
    x1, y1 = round(radius * np.cos(begin + turn), 3), round(radius * np.sin(begin + turn), 3)
    code = "G2" if clockwise else "G3"
    text = f"G21 G90 G17 G54\nG0 X{x0} Y{y0} Z5.\nG1 Z0. F500\n{code} X{x1} Y{y1} I{-x0:.3f} J{-y0:.3f}\nM2\n"
    corrected = olp.correct(text.encode(), bent).data
    position, arcs = np.zeros(2), 0
    for block in corrected.splitlines():
        values = {
            key: float(number) for key, number in re.findall(rb"([XYIJ])([+-]?(?:\d+\.?\d*|\.\d+))", block)
        }
        if b"olp-corrected" in block:
            continue
        end = np.array([values.get(b"X", position[0]), values.get(b"Y", position[1])])
        if b"I" in values or b"J" in values:
            centre = position + np.array([values.get(b"I", 0.0), values.get(b"J", 0.0)])
            arcs += 1
            assert abs(np.linalg.norm(end - centre) - np.linalg.norm(position - centre)) <= RADIUS_MM
        position = end
    assert arcs >= 1


# -- L8: every move is accounted for ------------------------------------------------------------------


@pytest.mark.parametrize("seed", some_fast(range(10), 4))
def test_l8_the_tally_is_complete(bent: Path, seed: int) -> None:
    moves = olp.correct(programs.random_program(seed, blocks=10), bent).report["moves"]
    parts = [moves[name] for name in ("corrected", "approximated", "passed", "refused")]
    assert min(parts) >= 0
    assert sum(parts) == moves["total"] > 0


def test_l8_every_machine_move_is_counted(tmp_path: Path) -> None:
    path = machine(tmp_path, "[squareness]\nC0Y_urad = 50.0\n", tables=TRUE_ZERO)
    text = b"G21 G90\nG0 X0 Y0 Z0\nG1 Y100 F100\nG53 G0 Z0\nG0 X5 Y5 Z5\nM30\n"
    moves = olp.correct(text, path).report["moves"]
    assert (moves["total"], moves["passed"], moves["corrected"]) == (4, 1, 3)
