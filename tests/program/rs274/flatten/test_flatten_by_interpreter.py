"""LinuxCNC as the judge of the unrolling: a program and its plain blocks give the same canonical moves."""

from __future__ import annotations

import hashlib
import random
import re
from pathlib import Path

import numpy as np
import pytest
from judge import linuxcnc

from olp.core.errors import ProgramError
from olp.program.rs274.flatten.unroll import flatten
from olp.program.rs274.profiles.linuxcnc import DIALECT

pytestmark = [
    pytest.mark.oracle,
    pytest.mark.skipif(not linuxcnc.available(), reason="needs LinuxCNC's interpreter"),
]

TOOLS = dict.fromkeys(range(1, 21), (0.0, 0.0, 0.0))
SAMPLES = (Path("/usr/share/linuxcnc/ncfiles"), Path("/usr/share/doc/linuxcnc"))
LARGEST_SAMPLE = 60_000


def moves(data: bytes, *, joined: bool) -> np.ndarray:
    """(n, 9) kind, end, centre, turns and feed of every move; `joined` leaves out moves of no length."""
    canon = linuxcnc.interpret(data, tools=TOOLS, find_known=False)
    arc = canon.kind == linuxcnc.ARC
    centre = np.where(arc[:, None], canon.centre, 0.0)
    feed = np.where(canon.kind == linuxcnc.RAPID, 0.0, canon.feed)
    rows = np.column_stack([canon.kind, canon.tip, centre, np.where(arc, canon.turns, 0), feed])
    rows = rows[canon.kind != linuxcnc.DWELL]
    if joined and len(rows):
        still = np.append(False, np.abs(np.diff(rows[:, 1:4], axis=0)).max(axis=1) < 1e-9)
        rows = rows[~still | (rows[:, 0] == linuxcnc.ARC)]
    return rows


def assert_same(source: bytes, *, expand_cycles: bool = False) -> bytes:
    plain = flatten(source, DIALECT, expand_cycles=expand_cycles)
    # a row of holes with polar words is one block for each
    joined = expand_cycles or b"^" in source
    before, after = moves(source, joined=joined), moves(plain, joined=joined)
    assert before.shape == after.shape
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-6)
    return plain


def _samples() -> list[Path]:
    """Installed programs, each content once."""
    paths: dict[str, Path] = {}
    for folder in SAMPLES:
        for path in sorted(folder.rglob("*.ngc")):
            if path.is_file() and path.stat().st_size <= LARGEST_SAMPLE:
                paths.setdefault(hashlib.sha256(path.read_bytes()).hexdigest(), path)
    return list(paths.values())


@pytest.mark.parametrize("expand_cycles", [False, True])
@pytest.mark.parametrize("path", _samples(), ids=lambda path: path.name)
def test_installed_sample(path: Path, expand_cycles: bool) -> None:
    source = path.read_bytes()
    try:
        plain = flatten(source, DIALECT, expand_cycles=expand_cycles)
    except ProgramError as error:
        assert error.line is not None
        assert 1 <= error.line <= source.count(b"\n") + 1
        return
    try:
        linuxcnc.interpret(source, tools=TOOLS, find_known=False)
    except linuxcnc.InterpreterError:
        pytest.skip("LinuxCNC itself does not run this sample")
    assert b"#" not in b"".join(line.split(b"(")[0].split(b";")[0] for line in plain.splitlines())
    if re.search(rb"(?im)^\s*g0*5(\.[12])?\b", source):
        return  # chords of splines are finer than those of the interpreter: `test_splines`
    assert_same(source, expand_cycles=expand_cycles)


CASES = {
    "nested flow": """G21 G90 F100
G0 X0 Y0 Z0
#1=0
o1 while [#1 lt 4]
  #1 = [#1 + 1]
  o2 repeat [#1]
    G91 G1 X[#1/3] Y-#1
  o2 endrepeat
  o3 if [#1 eq 2]
    G90 G1 X0
  o3 else if [#1 gt 3]
    G90 G1 Y[#5421 * 0.5]
  o3 else
    G0 Z[#1]
  o3 endif
o1 endwhile
M2
""",
    "recursion": """o<fact> sub
  o1 if [#1 le 1]
    o<fact> return [1]
  o1 else
    o<fact> call [#1 - 1]
    o<fact> return [#1 * #<_value>]
  o1 endif
o<fact> endsub
G21 o5
M2
""".replace("G21 o5\n", "G21\no<fact> call [5]\nG0 X#<_value>\n"),
    "sub after its call": "G21\no7 call [3] [4]\nM2\no7 sub\nG0 X#1 Y#2 Z#3\no7 endsub\n",
    "do while and break": """G21 G90
#1=1
o1 do
G0 X#1
#1=[#1*2]
o2 if [#1 ge 64]
o1 break
o2 endif
o1 while [#1 lt 1000]
G0 Y#1
M2
""",
    "arcs by radius": """G20 G90 F10
#1=30
G0 X[COS[#1]] Y[SIN[#1]]
G2 X[-COS[#1]] Y[-SIN[#1]] R1
G3 X[COS[#1+90]] Y[SIN[#1+90]] R1.
G17 G2 X[COS[#1]] Y[SIN[#1]] I[-COS[#1+90]] J[-SIN[#1+90]]
M2
""",
    "fanuc call": "O1\nG21 G0 X1\nM98 P20 L3\nX0\nM2\nO20\nG91 X[1/7]\nG90\nM99\n",
    "modes saved": "G21 G90 G0 X1\nM70\nG91 G20 G0 X1\nM72\nX5\nY[#5420]\nM2\n",
    "modes saved in levels": "G21 G90 G54 G17 G94 G64\nF200\nG0 X1 Y2 Z3\no1 sub\nM73\nG91 G20 G55 F3\nX1\n"
    "o2 call\nG1 X1\no1 endsub\no2 sub\nM73\nG90 G21 G98 G64 P0.1\nX7\no3 if [#5420 GT 0]\no2 return\n"
    "o3 endif\no2 endsub\no1 call\nX5\nG91 X1\no1 call\nX2\nM2\n",
    "modes saved and kept": "G21 G90 G0 X1\no1 sub\nM70\nG91\no1 endsub\no1 call\nX5\nY[#5420]\nM2\n",
    "modes saved twice": "G21 G90 S500 M3 F100\nG0 X1\no1 sub\nM70\nG91 G1 X1 F50\nM5\nM72\nX9\nG18\nM72\n"
    "Y[#5420]\nM71\no1 endsub\no1 call\nX5\nM98 P7 L2\nX1\nM2\no7\nM73\nG91\nX1\nM99\n",
    "indirect": "#10=11 #11=12 #12=1.5\nG21 G0 X##10 Y###10 Z[##[5+5]-#11]\nM2\n",
}


@pytest.mark.parametrize("name", CASES)
def test_hand_written_case(name: str) -> None:
    plain = assert_same(CASES[name].encode())
    assert b"#" not in plain and b"[" not in plain


@pytest.mark.parametrize("seed", range(20))
def test_cycles_written_out(seed: int) -> None:
    """Series of cycles with sticky words, other motion between them, both units, three planes."""
    rng = random.Random(seed)

    def number(low: float, high: float) -> str:
        return f"{rng.uniform(low, high):.3f}"

    plane = rng.choice([17, 18, 19])
    tool = "ZYX"[plane - 17]
    sides = [letter for letter in "XYZ" if letter != tool]
    lines = [f"{rng.choice(['G20', 'G21'])} G90 G94 F100 S100 G{plane} M3", "G0 X1 Y2 Z3", "#1=0.5"]
    for _ in range(rng.randint(2, 6)):
        if rng.random() < 0.3:
            lines += ["G80", f"G0 {tool}{number(-2, 9)} {sides[0]}{number(-5, 5)}"]
        code = rng.choice([81, 82, 83, 73, 85, 86, 89] + ([84] if plane == 17 else []))
        lines.append(rng.choice(["G90 G98", "G91 G98", "G90 G99", "G91 G99"]))
        deep = f"{tool}[{number(-9, -6)}*1] R[{number(-5, 5)}+#1] L{rng.randint(1, 3)}"
        deep += f" Q{number(0.5, 3)}" if code in (73, 83) else ""
        deep += " P0.1" if code in (82, 86, 89) else ""
        lines.append(f"G{code} {sides[0]}{number(-5, 5)} {deep} {sides[1]}#1 M8 (hole)")
        lines += [f"{rng.choice(sides)}{number(-5, 5)}" for _ in range(rng.randint(0, 2))]
    source = "\n".join([*lines, "G80 G0 X0", "M2", ""]).encode()
    plain = assert_same(source, expand_cycles=True)
    assert not any(f"G{code}".encode() in plain for code in (73, 81, 82, 83, 84, 85, 86, 89))
