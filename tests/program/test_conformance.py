"""Laws L1 to L8 of the program representation over all dialects: one table of cases, one suite.

A dialect joins with a case in `cases.dialects`. What only one family has is tested beside it (`test_laws`,
`test_apt`, `test_dmis`).
"""

from __future__ import annotations

import re
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import judged, points, unstamped
from cases.dialects import BLOCKS, CASES, FRAMES, RS274, Case
from cases.fast import left_to_a_campaign
from hypothesis import example, given, settings
from hypothesis import strategies as st
from judge import linuxcnc, machines
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import match

import olp
from olp.core.errors import OlpError, ProgramError
from olp.core.machine import Setup
from olp.files.config import load_setup
from olp.files.described import described
from olp.program import registry

#: 1 nm, within which the two independent models agree
SLACK_MM = 1e-6
OFFSET = np.array([250.0, 200.0, -300.0])
LEVER = np.array([0.0, 0.0, -120.0])
HALF_DIGIT = 0.5e-3 + SLACK_MM
#: what the strictest control of them (grbl) takes as the difference of two radii of an arc
RADIUS_MM = 0.005
#: Profiles of RS-274 that others of them stand for where a law takes a second of each dialect.
ALIKE = {*RS274} - {"linuxcnc", "fanuc", "grbl", "marlin"}
#: Bytes of a specimen that takes long.
LONG = 120_000


def recipe(case: Case, **more: object) -> Recipe:
    return replace(Recipe(controller=case.controller, work_offsets=FRAMES), **more)


def pinned(path: Path, case: Case) -> Setup:
    """The setup with the dialect named, so that any bytes are read in it."""
    setup = load_setup(path)
    return replace(setup, job=replace(setup.job, dialect=case.name, described=described(case.name)))


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    folder = tmp_path_factory.mktemp("zero")
    return {n: pinned(machines.zero_machine(folder / n, recipe(c)), c) for n, c in CASES.items()}


@pytest.fixture(scope="module")
def shifted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    folder = tmp_path_factory.mktemp("shift")
    return {n: pinned(machines.shift_machine(folder / n, recipe=recipe(c)), c) for n, c in CASES.items()}


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bent")
    return {n: machines.random_machine(folder / n, 11, recipe(c, off_datum=True)) for n, c in CASES.items()}


def attempt(data: bytes, setup: Setup) -> bytes | None:
    """Corrected bytes, or None where the program is refused; anything but a refusal is a failure."""
    try:
        return olp.correct(data, setup).data
    except OlpError as error:
        assert str(error)
        return None


def test_every_registered_dialect_has_a_case() -> None:
    assert set(CASES) == {*registry.DIALECTS, *registry.DESCRIBED}
    assert all(case.name == name for name, case in CASES.items())


# -- L1, L3: identity ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(CASES, ALIKE))
@given(data=st.data())
@settings(max_examples=25)
def test_l1_any_bytes_come_back_or_are_refused(
    zero: dict[str, Setup], shifted: dict[str, Setup], name: str, data: st.DataObject
) -> None:
    text = data.draw(
        st.one_of(st.binary(max_size=200), st.text(CASES[name].alphabet, max_size=120).map(str.encode))
    )
    written = attempt(text, zero[name])
    assert written is None or written == text
    attempt(text, shifted[name])


@pytest.mark.parametrize(("name", "text"), [(n, t) for n, c in CASES.items() for t in c.examples])
def test_l1_chosen_texts(zero: dict[str, Setup], shifted: dict[str, Setup], name: str, text: bytes) -> None:
    written = attempt(text, zero[name])
    assert written is None or written == text
    attempt(text, shifted[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(CASES, ALIKE))
@given(noise=st.binary(max_size=60))
@example(noise=b"$$ \xff 'x'")
@settings(max_examples=8)
def test_l1_text_in_a_comment_is_opaque(zero: dict[str, Setup], name: str, noise: bytes) -> None:
    case = CASES[name]
    content = re.sub(rb"[\0\r\n()]|olp", b"", noise).rstrip(b" $\t\v\f").decode("latin-1")
    text = "\n".join([*case.head, case.comment(content), case.point((1.0, 2.0, 3.0), 3), *case.tail])
    data = text.encode("latin-1")
    assert olp.correct(data, zero[name]).data == data


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(CASES, ALIKE))
@given(
    seed=st.integers(0, 2**20),
    cuts=st.lists(st.tuples(st.integers(0, 4000), st.binary(max_size=4)), max_size=6),
)
@settings(max_examples=12)
def test_l1_a_damaged_program_never_crashes(
    zero: dict[str, Setup], shifted: dict[str, Setup], name: str, seed: int,
    cuts: list[tuple[int, bytes]],
) -> None:  # fmt: skip
    rng = np.random.default_rng(seed)
    text = bytearray(CASES[name].program(rng.uniform(-50, 50, (6, 3)), 3))
    for place, piece in cuts:
        position = place % len(text)
        text[position : position + 2] = piece
    data = bytes(text)
    written = attempt(data, zero[name])
    assert written is None or written == data
    attempt(data, shifted[name])


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("seed", range(3))
def test_l3_no_error_no_edit(zero: dict[str, Setup], name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    data = CASES[name].program(rng.uniform(-60, 60, (40, 3)), int(rng.integers(0, 7)))
    assert olp.correct(data, zero[name]).data == data


@pytest.mark.corpus
@pytest.mark.parametrize("long", [False, pytest.param(True, marks=pytest.mark.campaign)])
@pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.specimens])
def test_l1_l3_every_specimen_stays_unchanged(corpus: Path, tmp_path: Path, name: str, long: bool) -> None:
    case = CASES[name]
    tools = {n: {"Z_mm": 100.0 + n} for n in range(1, 31)}
    frames = {**FRAMES, **{f"COOR_{n:04d}": FRAMES["A"] for n in range(1, 30)}}
    frames |= {f"CSYS{n}": FRAMES["A"] for n in range(2, 9)}
    described = machines.zero_machine(
        tmp_path, recipe(case, travel=((-3000.0, 3000.0),) * 3, tools=tools, work_offsets=frames)
    )
    described.write_text(
        described.read_text()
        + '[styli."A0.0B0.0"]\noffset_mm = [0, 0, -150]\n[styli."A90.0B0.0"]\noffset_mm = [0, 120, -50]\n'
    )
    paths = [
        path
        for pattern in case.specimens
        for path in sorted(corpus.glob(pattern))
        if path.stat().st_size < 400_000 and (path.stat().st_size >= LONG) == long
    ]
    unchanged = 0
    for path in paths:
        try:
            done = olp.correct(path, pinned(described, case))
            # the file itself, and that of its data where it has one
            copy = done.write(tmp_path / path.name, force=True)
            for own in {path.suffix, ".dat"} if copy.with_suffix(".dat").exists() else {path.suffix}:
                assert copy.with_suffix(own).read_bytes() == path.with_suffix(own).read_bytes(), path.name
            copy.with_suffix(".dat").unlink(missing_ok=True)
            unchanged += 1
        except OlpError as refusal:
            assert isinstance(refusal, ProgramError), path.name
            assert refusal.line is not None, path.name
            assert case.name not in ("apt", "dmis"), refusal
    assert unchanged or (long and not paths)


# -- L2: bytes outside edits; a shift edits every slot -------------------------------------------------


def numbers(text: bytes, pattern: re.Pattern[bytes]) -> tuple[bytes, list[Decimal]]:
    """The text with a mark in place of each coordinate, and the coordinates."""
    values: list[Decimal] = []

    def mark(hit: re.Match[bytes]) -> bytes:
        values.extend(Decimal(g.decode()) for g in hit.groups())
        digits = hit[0]
        for group in range(3, 0, -1):
            a, b = hit.span(group)
            digits = digits[: a - hit.start()] + b"@" + digits[b - hit.start() :]
        return digits

    return pattern.sub(mark, text), values


@pytest.mark.parametrize("name", CASES)
def test_l2_a_shift_edits_every_slot_and_nothing_else(
    shifted: dict[str, Setup], tmp_path: Path, name: str
) -> None:
    case = CASES[name]
    back = pinned(machines.shift_machine(tmp_path / "back", (-100.0, -100.0, -100.0), recipe(case)), case)
    rng = np.random.default_rng(5)
    nominal = case.program(rng.uniform(-60, 60, (20, 3)), 3)
    corrected = unstamped(olp.correct(nominal, shifted[name]).data)
    frame, before = numbers(nominal, case.coordinates)
    same, after = numbers(corrected, case.coordinates)
    assert same == frame
    assert [(b - a) * case.unit_mm for b, a in zip(before, after, strict=True)] == [Decimal("0.1")] * 60
    assert numbers(unstamped(olp.correct(corrected, back).data), case.coordinates) == (frame, before)


# -- L4, L6: the numbers written are the points meant -------------------------------------------------


def commanded(
    nominal: np.ndarray, text: bytes, path: Path, case: Case, own: np.ndarray | None = None
) -> float:
    """Largest difference of the written end of a nominal move from the command of the judge."""
    model = JudgeModel(path)
    # the ram of a measuring machine ends a stylus above the tip, and there its axes count
    up = np.array([0.0, 0.0, 120.0]) if case.name == "dmis" else np.zeros(3)
    want = model.command_for(nominal + OFFSET + up, LEVER) - OFFSET - up
    if own is None and case.in_order is not None:
        own = case.in_order(text)
    if own is None:
        own = np.array([[float(g) for g in m.groups()] for m in case.coordinates.finditer(text)])
        own *= case.unit_mm
    return float(np.abs(own[match(own, want)] - want).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(CASES, ALIKE))
@given(seed=st.integers(0, 2**16), digits=st.sampled_from([2, 3, 4]))
@settings(max_examples=4)
def test_l4_points_within_half_a_digit(bent: dict[str, Path], name: str, seed: int, digits: int) -> None:
    rng = np.random.default_rng(seed)
    nominal = np.round(rng.uniform((-60, -50, -20), (60, 50, 40), (15, 3)), digits)
    case = CASES[name]
    text = olp.correct(case.program(nominal, digits), pinned(bent[name], case)).data
    own = points(text) if case.name in BLOCKS else None
    assert commanded(nominal, text, bent[name], case, own) <= 0.5 * 10.0 ** -max(digits, 3) + SLACK_MM


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.distance])
def test_l6_distances_do_not_drift(bent: dict[str, Path], name: str) -> None:
    case = CASES[name]
    assert case.distance is not None
    rng = np.random.default_rng(3)
    steps = np.round(rng.normal(scale=0.4, size=(1500, 3)) * (1, 1, 0.2), 3)
    steps -= np.round(steps.mean(axis=0), 3)
    statements = [case.distance(s, 3) for s in steps.tolist()]
    text = "\n".join([*case.head, case.point((0.0, 0.0, 0.0), 3), *statements, *case.tail]) + "\n"
    written = olp.correct(text.encode(), pinned(bent[name], case)).data
    three = rb"I?X?([^,\s]+)[,\s]I?Y?([^,\s]+)[,\s]I?Z?([^,\s)]+)"
    begins = rb"(?m)^(?:G91 )?(?:G1 |L |GODLTA/|GOTO/|DRAW |LMOVE TRANS\(|MOVES TRANS\()"
    rows = re.findall(begins + three, written)
    own = np.cumsum([[float(n) for n in row] for row in rows], axis=0)
    nominal = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    assert commanded(nominal, written, bent[name], case, own) <= HALF_DIGIT


# -- L5, L7: another interpreter makes the moves that are meant, and arcs are arcs for it ----------------


@pytest.mark.slow
@pytest.mark.oracle
@pytest.mark.parametrize("name", RS274)
def test_l5_l7_linuxcnc_makes_the_moves_and_the_arcs(tmp_path: Path, name: str) -> None:
    """What all controls of this family have in common is in words of LinuxCNC too."""
    case, profile = CASES[name], RS274[name]
    centres_open, coded = profile.arc_distance is None, 911 in profile.codes
    head = [*case.head, "G91.1"] if centres_open and coded else case.head
    arcs = ["G3 X0.000 Y10.000 I-10.000 J0.000", "G2 X-20.000 Y10.000 I-10.000 J0.000"]
    rows = [case.point((10.0, 0.0, 1.0), 3), *arcs, case.point((-40.0, 30.0, -3.5), 3)]
    nominal = "\n".join([*head, *rows, *case.tail, ""]).encode()
    path = machines.random_machine(tmp_path, 11, Recipe(controller=case.controller, off_datum=True))
    if centres_open and not coded:
        path.write_text('arc_centres = "incremental"\n' + path.read_text())
    meant = np.array([(10, 0, 1), (0, 10, 1), (-20, 10, 1), (-40, 30, -3.5)]) + OFFSET
    # for LinuxCNC the G0 with a feed alone at the head of printers is a move to where it stands
    np.testing.assert_allclose(linuxcnc.interpret(nominal, tmp_path).axis[-4:], meant, atol=1e-9)
    corrected = olp.correct(nominal, pinned(path, case)).data
    assert judged(nominal, corrected, tmp_path).max_um <= 1.0 + 0.87
    moves = linuxcnc.interpret(corrected, tmp_path)
    rounds = moves.turns != 0
    assert rounds.sum() >= len(arcs)
    radii = [np.linalg.norm((at - moves.centre)[rounds, :2], axis=1) for at in (moves.begin, moves.axis)]
    assert np.abs(radii[1] - radii[0]).max() <= RADIUS_MM


# -- L8: every move is accounted for ------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
def test_l8_the_tally_is_complete(bent: dict[str, Path], name: str) -> None:
    rng = np.random.default_rng(2)
    data = CASES[name].program(rng.uniform(-60, 60, (30, 3)), 3)
    moves = olp.correct(data, pinned(bent[name], CASES[name])).report["moves"]
    parts = [moves[key] for key in ("corrected", "approximated", "passed", "refused")]
    assert min(parts) >= 0
    assert sum(parts) == moves["total"] == 30


@pytest.mark.parametrize("name", CASES)
def test_the_support_matrix_says_what_becomes_of_each_statement(zero: dict[str, Setup], name: str) -> None:
    rows = olp.inspect(CASES[name].program(np.zeros((2, 3)), 3), zero[name])["support"]
    assert {row["support"] for row in rows} == CASES[name].support
    assert all(row["why"] for row in rows if row["support"] == "refused")
    assert len({row["statement"] for row in rows}) == len(rows)


@pytest.mark.parametrize("name", CASES)
def test_a_second_correction_is_refused(shifted: dict[str, Setup], name: str) -> None:
    once = olp.correct(CASES[name].program(np.ones((2, 3)), 3), shifted[name]).data
    with pytest.raises(OlpError, match="olp-corrected"):
        olp.correct(once, shifted[name])
