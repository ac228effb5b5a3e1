"""Shapes that the control computes, written as lines and arcs: against a judge, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from judge.sinumerik_shapes import elements

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read
from olp.program.sinumerik.flatten.unroll import flatten

SINUMERIK = DIALECTS["sinumerik"]
HEAD = "G71 G90 G17 G54 G94 F600\nG0 X0 Y0 Z0\n"


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return load_setup(machine(tmp_path_factory.mktemp("m"), tables=TRUE_ZERO, controller="sinumerik"))


def unrolled(text: str) -> str:
    return flatten(text.encode(), SINUMERIK).decode()


def random_shapes(seed: int) -> str:
    """Lines of 20 to 60 mm and arcs, stated in all ways, with small corners."""
    rng = np.random.default_rng(seed)
    here, heading = 0j, 0.0
    rows, relative, lines = [], False, 0

    def point(end: complex, x: str = "X", y: str = "Y") -> str:
        how = rng.integers(3) if not relative else 1
        if how == 0:
            return f"{x}={end.real:.6f} {y}={end.imag:.6f}"
        d = end - here
        if how == 1 and relative:
            return f"{x}={d.real:.6f} {y}={d.imag:.6f}"
        return f"{x}=IC({d.real:.6f}) {y}=AC({end.imag:.6f})"

    for _ in range(rng.integers(4, 9)):
        heading += rng.uniform(-1.3, 1.3)
        end = here + rng.uniform(20, 60) * complex(math.cos(heading), math.sin(heading))
        end = complex(round(end.real, 6), round(end.imag, 6))
        kind = rng.integers(7)
        corner = ""
        lines = lines + 1 if kind in (0, 1, 2) else 0
        if rng.random() < 0.6:
            corner = f" RND={rng.uniform(0.2, 2):.3f}"
        if kind == 0:
            row = f"G1 {point(end)}"
        elif kind == 1 and abs(math.cos(heading)) > 0.2:
            gone = end.real - here.real
            end = complex(end.real, here.imag + gone * math.tan(heading))
            row = f"G1 X{gone if relative else end.real:.6f} ANG={math.degrees(heading):.9f}"
        elif kind in (1, 2):
            rows.append(f"G111 X{here.real + 3:.6f} Y{here.imag - 4:.6f}")
            away = end - complex(here.real + 3, here.imag - 4)
            row = f"G1 AP={math.degrees(math.atan2(away.imag, away.real)):.9f} RP={abs(away):.9f}"
        elif kind == 3:
            middle = (here + end) / 2 + 1j * (end - here) * rng.uniform(0.1, 0.3) * rng.choice([-1, 1])
            row = f"CIP {point(end)} {point(middle, 'I1', 'J1')}"
        elif kind == 4 and rows:
            row = f"CT {point(end)}"
        elif kind == 5:
            size = f"CR={abs(end - here) * rng.uniform(0.6, 2):.6f}"
            if rng.random() < 0.5:
                size = f"AR={rng.uniform(20, 120):.6f}"
            row = f"G{rng.integers(2, 4)} {point(end)} {size}"
        else:
            if rng.random() < 0.3:
                relative = not relative
            row = f"G9{int(relative)} G1 {point(end)}"
        rows.append(row + corner)
        here = end
    return HEAD + "\n".join(rows) + "\nG90 G0 Z5\nM30\n"


def same(text: str, setup: Setup) -> int:
    """Compare begin, middle and end of all elements; their number."""
    path = read(unrolled(text).encode(), setup, SINUMERIK).toolpath
    want = elements(text)
    end = path.end_mm[:, 0] + 1j * path.end_mm[:, 1]
    rows = np.flatnonzero(path.kind[1:] != 0) + 1
    assert len(rows) == len(want) - 1
    arcs = {int(m): k for k, m in enumerate(path.arcs.move)}
    for row, one in zip(rows.tolist(), want[1:], strict=True):
        a, b = end[row - 1], end[row]
        middle = (a + b) / 2
        if row in arcs:
            c = complex(*path.arcs.centre_mm[arcs[row], :2])
            middle = c + (a - c) * np.exp(0.5j * path.arcs.sweep_rad[arcs[row]])
        got = np.array([a, middle, b])
        assert np.abs(got - [one.a, one.at(0.5), one.b]).max() < 2e-5, (row, got, one.a, one.at(0.5), one.b)
    return len(rows)


def test_random_shapes_are_those_of_the_judge(setup: Setup) -> None:
    read_ones, corners = 0, 0
    for seed in range(40):
        text = random_shapes(seed)
        try:
            count = same(text, setup)
        except ProgramError as error:
            # a corner that has no room, or a line straight back
            assert error.code in ("OLP544", "OLP530")
            continue
        read_ones += 1
        corners += count - text.count("G1 ") - text.count("CIP") - text.count("CT") - text.count("CR=")
    assert read_ones > 25 and corners > 50


WRITTEN = {
    "X10 CHR=2\nY10": "X8 Y0\nG1 X10 Y2\nG1 Y10 X10\n",
    "X10 CHF=2\nY10": "X8.585786438 Y0\nG1 X10 Y1.414213562\nG1 Y10 X10\n",
    "X10 CHF=2\nX20 Y5": "X8.972513703 Y0\nG1 X10.91901168 Y0.459505841\nG1 X20 Y5\n",
    "X10 RND=2\nM8\nY10 F100 ; a": "X8 Y0\nM8\nG3 X10 Y2 I0 J2 F100\nG1 Y10 F100 X10 ; a\n",
    "X10 RND=2\nZ5\nX20": "X10\nZ5\nX20\n",
    "G91 X10 RND=2\nY10": "G91 X8 Y0\nG3 X2 Y2 I0 J2\nG1 Y8 X0\n",
    "CIP X2 Y0 I1=1 J1=1\nG90 X4 Y0 I1=3 J1=1": "G2 I1 J0 X2 Y0\nG90 X4 Y0 G2 I1 J0\n",
    "X5\nCT X10 Y5\nCT X10 Y8": "X5\nG3 I0 J5 X10 Y5\nG1 X10 Y8\n",
    "G3 X10 Y0 AR=180": "G3 X10 Y0 I5 J0\n",
    "G2 I5 J0 AR=90": "G2 I5 J0 X5 Y5\n",
    "G91 G3 X10 AR=90": "G91 G3 X10 I5 J5\n",
    "G110 X1 Y2\nRP=1 AP=0": "X2 Y2\n",
    # what stands beside a pole stays
    "G18 G111 Z0 X10 F50\nRP=5 AP=90": "G18  F50\nZ0 X15\n",
    "A1: X1\nREPEAT A1 P=2\nREPEATB A1": "X1\nX1\nX1\nX1\n",
    "A1: X1\nB1: X2\nENDLABEL:\nX3\nREPEAT A1": "X1\nX2\nX3\nX1\nX2\n",
    "X1\nA1: X2\nB1: X3\nREPEAT A1 B1": "X1\nX2\nX3\nX2\nX3\n",
}  # fmt: skip


@pytest.mark.parametrize("text", WRITTEN, ids=lambda t: t.replace("\n", " | "))
def test_written_by_hand(text: str) -> None:
    got = unrolled(f"{HEAD}G1\n{text}\nM30\n").removeprefix(f"{HEAD}G1\n").removesuffix("M30\n")
    assert got == WRITTEN[text]


REFUSED = {
    "G1 X10 RND=2\nG0 Y5": "no G1, G2 or G3",
    "G1 X10 RND=2\nX15 Z5": "no G1, G2 or G3",
    "G1 X10 RND=2\nTRANS X5": "no motion in its plane",
    "G1 X10 RND=20\nY10": "does not fit into the blocks",
    "G1 X10 CHR=2\nG2 X12 Y2 CR=2": "beside an arc",
    "G1 CT X5 Y5": "not known",
    "CIP X5 Y0 I1=2": "on one line",
    "CIP X5 Y5 I1=2 J1=3 K1=1": "leaves the plane",
    "CIP X5 Y5 Z1 I1=2 J1=3": "leaves the plane",
    "G3 X5 I5 AR=90": "one of them",
    "G3 AR=400 X5": "below 360",
    "G1 AR=40 X5": "in G2 and G3",
    "RP=5": "AP of a polar position",
    "G111 X1 Y1\nTRANS X5\nRP=1 AP=2": "pole",
    "RP=5 AP=1 X2": "one or the other",
    "AP=45 RP=10 G110 X0 Y0": "a block of its own",
    "G110 AP=45\nX1": "either its coordinates or its AP and RP",
    "G111 X0 Y0 CIP\nX1": "a block of its own",
    "ANG=30": "one coordinate",
    "G1 X-5 ANG=30": "does not lead",
    "REPEAT NONE": "0 times",
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda t: t.replace("\n", " | "))
def test_what_is_not_known_is_refused(text: str) -> None:
    with pytest.raises(ProgramError) as caught:
        unrolled(HEAD + text + "\nM30\n")
    assert REFUSED[text] in str(caught.value)
    assert caught.value.code in ("OLP544", "OLP524", "OLP542")
    assert caught.value.line in (3, 4, 5)


def test_shapes_are_refused_with_the_way_where_nothing_is_unrolled(setup: Setup) -> None:
    for text in ("CIP X1 Y1 I1=1 J1=0", "CT X1 Y1", "X1 RND=2", "G1 RP=5 AP=2", "G111 X0 Y0", "REPEATB A1"):
        with pytest.raises(ProgramError) as caught:
            read((HEAD + text).encode(), setup, SINUMERIK)
        assert (caught.value.code, caught.value.line) == ("OLP511", 3) and "--flatten" in str(caught.value)
