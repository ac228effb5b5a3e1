"""Holes around a centre (G70, G71 of Haas), written one by one; places worked by hand."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from cases.unrolling import flatten, refused
from judge import machines
from judge.machines import Recipe

import olp

HEAD = "O1\nG21 G17 G90\nG0 X10. Y5. Z9.\nG98 G81 Z-3. R1. F9. L0\n"


def unrolled(body: str, **options: object) -> list[str]:
    text = flatten(f"{HEAD}{body}G80\nM30\n".encode(), profile="haas", **options).decode()
    return text.removeprefix(HEAD).removesuffix("G80\nM30\n").splitlines()


def test_a_circle_begins_at_its_angle_and_goes_counter_clockwise() -> None:
    assert unrolled("G70 I20. J0 L4\n") == ["X30. Y5.", "X10. Y25.", "X-10. Y5.", "X10. Y-15."]
    assert unrolled("N7 G70 X0. Y0. I10. J90. L2 (PCD)\n") == ["N7 (PCD)", "X0. Y10.", "X0. Y-10."]


def test_an_arc_goes_by_its_step() -> None:
    assert unrolled("G71 I20. J180. K-90. L3\n") == ["X-10. Y5.", "X10. Y25.", "X30. Y5."]
    assert unrolled("#1=2.\nG71 I[#1*10.] J0 K90. L#1\n") == ["X30. Y5.", "X10. Y25."]


def test_every_hole_is_drilled_where_it_belongs(tmp_path: Path) -> None:
    """The holes of the corrected program are those of a program that states each place."""
    path = machines.random_machine(tmp_path, 5, Recipe(controller="haas", off_datum=True))
    tail = "G80\nG0 Z9.\nM30\n"
    angles = [math.radians(15.0 + 60.0 * k) for k in range(6)]
    places = [f"X{10 + 25 * math.cos(a):.4f} Y{5 + 25 * math.sin(a):.4f}" for a in angles]
    own = olp.correct(f"{HEAD}G70 I25. J15. L6\n{tail}".encode(), path, flatten=True)
    stated = olp.correct("\n".join([HEAD + places[0], *places[1:], tail]).encode(), path)
    of_text = re.compile(rb"(?m)^X([-\d.]+) Y([-\d.]+)")
    wanted, got = (np.array(of_text.findall(done.data), float) for done in (stated, own))
    assert got.shape == (6, 2)
    np.testing.assert_array_equal(got, wanted)
    strokes = unrolled("G70 I25. J15. L6\n", expand_cycles=True)
    assert sum(line.startswith("G1 Z-3.") for line in strokes) == 6


@pytest.mark.parametrize(
    ("body", "code", "why"),
    [
        ("G70 I20. L4\n", "OLP516", "needs the word J"),
        ("G71 I20. J0 L4\n", "OLP516", "needs the word K"),
        ("G71 I20. J0 K30 L4\n", "OLP515", "K has no decimal point"),
        ("G70 I20 J0 L4\n", "OLP515", "I has no decimal point"),
        ("G70 I-20. J0 L4\n", "OLP516", "a radius I above 0"),
        ("G70 I20. J0 L0\n", "OLP516", "at least one hole"),
        ("G70 I20. J0 L1.5\n", "OLP540", "expected an integer"),
        ("G70 I20. J0 L4 F5.\n", "OLP518", "the word F are in one block"),
        ("G70 G98 I20. J0 L4\n", "OLP518", "another code are in one block"),
        ("G91\nG70 I20. J0 L4\n", "OLP518", "G90 and G17"),
        ("G80\nG70 I20. J0 L4\n", "OLP531", "needs a canned cycle"),
        ("G70 I20. J0 L4\nG70 I20. J0 L4\n", "OLP524", "the position of X"),
        ("G70 I20. J0 L99999999\n", "OLP543", ""),
    ],
)
def test_what_is_not_certain_is_refused(body: str, code: str, why: str) -> None:
    got, message, line = refused(HEAD + body, "haas")
    assert got == code, message
    assert why in message
    assert line == (HEAD + body).count("\n")


def test_other_controls_have_no_such_patterns() -> None:
    text = f"{HEAD}G70 I20. J0 L4\nM30\n".encode()
    assert flatten(text, profile="fanuc") == text
