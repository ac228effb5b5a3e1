"""The extruder of a printer, shared out where a move is split: judged by a printer of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import unstamped
from judge import machines
from judge.machines import Recipe
from judge.printer import Printer, Step

import olp
from olp.core.machine import Setup
from olp.files.config import load_setup

#: Lines of each mode of the extruder, long enough that they bend.
MODES = {
    "absolute": "M82\nG92 E0\n{move} E12.5\n{back} E30\nG1 E28 F1800\n{move} E28\n{back} E40.12345\n",
    "distances": "M83\n{move} E12.5\n{back} E.00004\nG1 E-2 F1800\n{move} E-.5\n{back} E3.3333\n",
    "by G91": "M82\nG91\nG1 E2\nG90\nG92 E0\n{move} E5\n{back} E7\n",
}
MOVES = {
    "line": ("G1 X900 Y600 Z20 F3000", "G1 X10 Y10 Z5"),
    "arc": ("G2 X610 Y10 I300 J0 F3000", "G3 X10 Y10 I-300 J0"),
}
HEAD = "G21\nG90\nG0 X10 Y10 Z5 F9000\n"


@pytest.fixture(scope="module")
def printers(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, bool], Setup]:
    made = {}
    for control in ("marlin", "klipper"):
        for play in (False, True):
            backlash = {"X": 20.0, "Y": 30.0} if play else {}
            recipe = Recipe(controller=control, travel=((-1500.0, 1500.0),) * 3, backlash_um=backlash)
            folder = tmp_path_factory.mktemp(control)
            made[control, play] = load_setup(machines.random_machine(folder, 3, recipe))
    return made


def groups(nominal: list[Step], corrected: list[Step]) -> list[list[Step]]:
    """The steps of the corrected program by the nominal step at which they end."""
    out: list[list[Step]] = []
    rest = list(corrected)
    for step in nominal:
        k = next(i for i, s in enumerate(rest) if np.abs(np.subtract(s.end, step.end)).max() < 0.5)
        out.append(rest[: k + 1])
        rest = rest[k + 1 :]
    assert not rest
    return out


@pytest.mark.parametrize("play", [False, True])
@pytest.mark.parametrize("control", ["marlin", "klipper"])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", MOVES)
def test_each_part_feeds_its_share_and_all_of_them_the_total(
    kind: str, mode: str, control: str, play: bool, printers: dict[tuple[str, bool], Setup]
) -> None:
    move, back = MOVES[kind]
    text = HEAD + MODES[mode].format(move=move, back=back)
    result = olp.correct(text.encode(), printers[control, play], tolerance_um=1.0)
    assert result.report["moves"]["split"]
    klipper = control == "klipper"
    nominal = Printer(klipper).run(text)
    corrected = Printer(klipper).run(unstamped(result.data).decode())
    for step, parts in zip(nominal, groups(nominal, corrected), strict=True):
        assert sum(p.fed for p in parts) == pytest.approx(step.fed, abs=1e-9)
        length = sum(p.length for p in parts)
        for part in parts:
            # one digit of the extruder, and what a step of backlash is long
            coarse = 1.1e-5 + 2e-4 * abs(step.fed)
            assert part.fed == pytest.approx(step.fed * part.length / length, abs=coarse)
    # the extruder ends where it did
    assert corrected[-1].end == pytest.approx(nominal[-1].end, abs=0.5)


def test_a_text_without_errors_keeps_its_words(tmp_path: Path) -> None:
    setup = load_setup(
        machines.zero_machine(tmp_path, Recipe(controller="marlin", travel=((-1500.0, 1500.0),) * 3))
    )
    text = (HEAD + MODES["absolute"].format(move=MOVES["arc"][0], back=MOVES["arc"][1])).encode()
    assert olp.correct(text, replace(setup)).data == text


def test_a_move_from_an_unknown_extruder_is_not_split(printers: dict[tuple[str, bool], Setup]) -> None:
    """Behind a change of the extruder its position is not known: a share of a position cannot be written."""
    text = HEAD + "M82\nT0\nG0 X10 Y10 Z5\nG1 X900 Y600 E12.5 F3000\nG1 X10 Y10 E30\n"
    result = olp.correct(text.encode(), printers["marlin", False])
    assert b"E12.5 F3000\n" in result.data
    assert result.report["moves"]["split"] == 1
