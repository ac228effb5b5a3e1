"""Arcs of about half a circle: an R word may put the centre far off, and I, J then stand in its place."""

from __future__ import annotations

import math
import re
from pathlib import Path

from cases.acceptance import TRUE_ZERO, machine, unstamped

import olp

CURVE = '[[curves]]\nfile = "{}.csv"\ninterpolation = "linear"\n'
#: 10.001 becomes 10.000 in X and Y
SCALES = {f"{a.lower()}.csv": f"{a}_mm,E{a}{a}_um\n-1000,-100\n2000,200\n" for a in "XY"}
SCALE = 1.0001


def test_the_centre_of_an_arc_is_where_it_should_be_whether_by_r_or_by_i_and_j(tmp_path: Path) -> None:
    path = machine(tmp_path, CURVE.format("x") + CURVE.format("y"), SCALES, tables=TRUE_ZERO)
    lines, centres, y = [], [], 0.0
    for k in range(60):
        chord = round(20 + 0.0007 * k, 3)
        radius = round(chord / 2 + 0.00005 + 0.00001 * k, 5)
        # the short arc, clockwise from -Y to +Y, has its centre at the right
        centres.append((math.sqrt(max(radius**2 - chord**2 / 4, 0.0)), y + chord / 2))
        y += chord
        lines.append(f"G2 X0 Y{y:.3f} R{radius:.5f} F100")
    text = "G21 G90 G54\nG0 X0 Y0 Z0\n" + "\n".join(lines) + "\nM2\n"
    written = unstamped(olp.correct(text.encode(), path).data).decode().splitlines()[2:-1]
    by_radius, start = 0, 0.0
    for line, (x, middle) in zip(written, centres, strict=True):
        words = {letter: float(number) for letter, number in re.findall(r"([A-Z])([-\d.]+)", line)}
        half = (words["Y"] - start) / 2
        if "R" in words:
            by_radius += 1
            got = math.sqrt(max(words["R"] ** 2 - half**2, 0.0)), start + half
        else:
            got = words["I"], start + words["J"]
        assert math.dist(got, (x / SCALE, middle / SCALE)) < 0.003, line
        start = words["Y"]
    assert 10 < by_radius < 50
