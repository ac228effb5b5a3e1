"""The stated maximum of `correct` and `verify` against a judge of the whole cut: never below it, not far
above it, and the same of both."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO
from cases.acceptance import machine as small_machine
from cases.fast import some_of_a_campaign
from cases.whole_cut import ARCS_UM, Whole, compare, judge_whole, marks
from judge import linuxcnc, machines, programs
from judge.linuxcnc import DWELL, FEED, RAPID, CanonMoves
from judge.machines import CHAINS, Recipe
from judge.model import JudgeModel
from judge.programs import FEATURES, LOOSE

import olp
from olp.core.errors import ProgramError
from olp.proof.judgement import Judgements

#: Samples of both along arcs are a few degrees apart: that may miss so much of a deviation.
SHARE = 0.01
#: Programs, and what each of them tries besides lines and inserted blocks.
SEEDS = {
    5: "arcs change loose machine off",
    13: "loose machine",
    24: "arcs backlash zero",
    26: "arcs backlash change start zero",
    38: "arcs change start unknown",
    102: "arcs direction holes inch zero",
    106: "arcs change home loose machine off zero",
    113: "arcs backlash inch loose machine off",
    115: "arcs change direction start zero",
    176: "arcs backlash load loose machine map start zero",
    190: "arcs backlash zero",
    215: "arcs backlash loose machine off",
    231: "deleted home load map unknown zero",
    241: "arcs backlash inch loose machine off",
    242: "arcs backlash change inch loose machine zero",
    254: "arcs change deleted holes start zero",
    286: "arcs backlash change holes machine open unknown",
    306: "arcs direction holes inch zero",
    319: "arcs backlash change holes inch open unknown",
    336: "arcs backlash change deleted load map zero",
    339: "arcs backlash change inch open unknown zero",
    364: "arcs inch loose machine off start zero",
    381: "backlash change holes home start",
    382: "arcs change deleted inch loose machine unknown zero",
}
#: How many of them try a kind, at least.
EACH = {
    "backlash": 8, "direction": 3, "map": 3, "load": 3, "zero": 8, "start": 5, "off": 5, "machine": 5,
    "home": 3, "change": 6, "deleted": 4, "inch": 6, "arcs": 10, "holes": 5, "loose": 6, "open": 3,
    "unknown": 4,
}  # fmt: skip
#: What 20 seeds in a row try at the least, all kinds together.
BLOCK = {
    "judged": 15, "lines": 14, "arcs": 8, "inserted": 14, "holes": 2, "backlash": 5, "direction": 1, "map": 1,
    "load": 1, "zero": 4, "start": 2, "machine": 1, "home": 1, "change": 5, "loose": 1,
    "unknown": 2,
}  # fmt: skip
START_MM = (310.0, 240.0, -90.0)
MOVING = {"lines", "short", "rapid", "arcs", "planes", "helix", "circle", "radius", "incremental", "cycles"}
MOVING |= {"frames", *LOOSE}


@dataclass(frozen=True)
class Job:
    """A machine, a program, and how they are put together."""

    machine: Path
    nominal: bytes
    start_mm: tuple[float, float, float] | None
    expand: bool

    @property
    def files(self) -> tuple[Path, Path | None]:
        job = self.machine.with_name("job.toml")
        return self.machine, job if job.exists() else None


def draw(seed: int, folder: Path) -> Job:
    rng = np.random.default_rng(seed + 4711)
    chain = str(rng.choice(CHAINS))
    recipe = Recipe(
        chain=chain,
        off_datum=bool(rng.random() < 0.5),
        interpolation=str(rng.choice(["pchip", "linear"])),
        cyclic=bool(rng.random() < 0.2),
        on_table=chain[: chain.index("F")] if rng.random() < 0.3 else "",
    )
    play = rng.random()
    if play < 0.45:
        sizes = {a: float(rng.choice([3.0, 6.0, 15.0])) for a in "XYZ" if rng.random() < 0.6}
        recipe = replace(recipe, backlash_um=sizes)
    elif play < 0.6:
        recipe = replace(recipe, directed="".join(a for a in "XYZ" if rng.random() < 0.5))
    features = [name for name in FEATURES if rng.random() < 0.4]
    features += [name for name in LOOSE if rng.random() < 0.3]
    if not MOVING & set(features):
        features.append("lines")
    if rng.random() < 0.4:
        frames = {name: dict(entry) for name, entry in recipe.work_offsets.items()}
        frames["G54"]["set_by"] = "touch"
        if "g10" not in features and rng.random() < 0.5:
            touched = {"set_by": "touch", "touched_at_mm": {"X": 400.0, "Z": -100.0}, "touch_tool": 2}
            frames["G55"] |= touched
        recipe = replace(recipe, work_offsets=frames)
    machine = machines.random_machine(folder, seed, recipe)
    job = folder / "job.toml"
    if rng.random() < 0.2:
        machines.add_map_and_load(machine, rng)
    start = START_MM if rng.random() < 0.3 else None
    if start is not None:
        text = job.read_text() if job.exists() else 'schema = "olp-job-1"\n'
        place = ", ".join(f"{a} = {v}" for a, v in zip("XYZ", start, strict=True))
        job.write_text(f'{text}machine = "machine.toml"\nstart_mm = {{ {place} }}\n')
    nominal = programs.random_program(seed, features=features, blocks=3 + seed % 9)
    return Job(machine, nominal, start, bool(rng.random() < 0.3))


def corrected(job: Job) -> tuple[bytes, olp.Correction]:
    """The nominal program with its cycles as the proof sees them, and its correction."""
    machine, file = job.files
    nominal = olp.flatten(job.nominal, machine, file, expand_cycles=True) if job.expand else job.nominal
    return nominal, olp.correct(nominal, machine, file)


def same(one: dict[str, Any], other: dict[str, Any]) -> None:
    for key in ("deviation", "judgement", "verdict", "largest_correction_um"):
        assert one[key] == other[key], key
    codes = [sorted(f["code"] for f in report["findings"]) for report in (one, other)]
    assert codes[0] == codes[1]


def compare_lines(table: Judgements, whole: Whole, slack: int) -> None:
    """Not below the judge on any line either. A step between two cuts is of either, so `slack` lines on both
    sides may have it; at the end of an arc the two figures of such a step still differ."""
    rows = table.by_line()
    counted = rows["state"] < 2
    lines, stated = rows["line"][counted].tolist(), np.nan_to_num(rows["corrected_um"][counted])
    below = {}
    for line, size in whole.possible_by_line.items():
        k = lines.index(line)
        largest = float(stated[max(k - slack, 0) : k + slack + 1].max())
        if largest < size - ARCS_UM - SHARE * size:
            below[line] = (round(largest, 2), round(size, 2))
    assert below == {}


def kinds(job: Job, nominal: bytes, whole: Whole) -> set[str]:
    """What a judged job has tried."""
    folder = job.machine.parent
    model, calibration = JudgeModel(folder), (folder / "calibration.toml").read_text()
    said = marks(nominal)
    shown = {
        "judged": whole.judged,
        "backlash": "[backlash]" in calibration and bool(model.has_play.any()),
        "direction": any("direction" in path.read_text() for path in folder.glob("[xyz].csv")),
        "map": "[[maps]]" in calibration,
        "load": "[[compliance]]" in calibration,
        "zero": 'set_by = "touch"' in job.machine.read_text(),
        "start": job.start_mm is not None,
        "off": b"olp off" in nominal,
        "machine": said.left - said.homes,
        "home": said.homes,
        "change": said.changes,
        "deleted": re.search(rb"(?m)^/", nominal),
        "inch": b"G20" in nominal,
        "lines": whole.lines,
        "arcs": whole.arcs,
        "holes": whole.holes,
        "inserted": whole.inserted,
        "loose": whole.loose,
        "open": whole.open,
        "unknown": whole.left_out,
    }
    return {name for name, value in shown.items() if value and whole.judged}


def check(seed: int, folder: Path, *, lines: bool = False) -> set[str]:
    job = draw(seed, folder)
    nominal, result = corrected(job)
    machine, file = job.files
    again = olp.verify(nominal, result.data, machine, file, outside_box="refuse")
    same(result.report, again.report)
    whole = judge_whole(nominal, result.data, folder, start_mm=job.start_mm)
    stated = result.report["deviation"]["path_max_um"]
    assert result.report["verdict"]["numerical"]["largest_um"] == stated
    compare(stated, whole)
    if lines:
        compare_lines(result.table, whole, 1)
    return kinds(job, nominal, whole)


def refused(seed: int, folder: Path, tried: Counter[str]) -> bool:
    """Check a seed and count what it tried; whether the program was refused, with its line."""
    try:
        tried.update(check(seed, folder))
    except ProgramError as error:
        assert error.line is not None, seed
        return True
    return False


@pytest.mark.oracle
@pytest.mark.parametrize("seed", SEEDS)
def test_the_stated_maximum_is_what_the_whole_cut_is_off(tmp_path: Path, seed: int) -> None:
    assert check(seed, tmp_path, lines=True) >= {"judged", "lines", "inserted", *SEEDS[seed].split()}


@pytest.mark.oracle
@pytest.mark.parametrize("seed", some_of_a_campaign(SEEDS, 3))
def test_each_line_of_an_uncorrected_program_is_what_it_is_off(tmp_path: Path, seed: int) -> None:
    """The nominal program as its own correction: every line is off, and each of them counts."""
    job = draw(seed, tmp_path)
    nominal, _ = corrected(job)
    verified = olp.verify(nominal, nominal, *job.files)
    whole = judge_whole(nominal, nominal, tmp_path, start_mm=job.start_mm)
    assert len(whole.by_line) > 2
    compare(verified.report["deviation"]["path_max_um"], whole)
    compare_lines(verified.table, whole, 0)


def test_the_seeds_try_everything() -> None:
    tried = Counter(word for words in SEEDS.values() for word in words.split())
    assert {kind: tried[kind] for kind in EACH if tried[kind] < EACH[kind]} == {}


@pytest.mark.oracle
@pytest.mark.slow
@pytest.mark.parametrize("block", some_of_a_campaign((1, 0), 2))
def test_the_stated_maximum_at_length(tmp_path: Path, block: int) -> None:
    wrong, without = [], 0
    tried: Counter[str] = Counter()
    for seed in range(400 + 20 * block, 420 + 20 * block):
        try:
            without += refused(seed, tmp_path / str(seed), tried)
        except AssertionError as error:
            wrong.append((seed, str(error).splitlines()[0]))
    assert not wrong
    assert without <= 4
    assert {kind: tried[kind] for kind in BLOCK if tried[kind] < BLOCK[kind]} == {}


@pytest.mark.oracle
def test_an_unknown_side_of_the_backlash_is_in_the_stated_maximum(tmp_path: Path) -> None:
    """The rapid is left uncorrected, so nothing takes the backlash up; the cut moves Z alone."""
    path = small_machine(tmp_path, "[backlash]\nX_um = 15.0\nY_um = 15.0\n", tables=TRUE_ZERO)
    text = b"G21 G90 G54\n(olp off)\nG0 X10 Y20 Z30\n(olp on)\nG1 Z5 F500\nM2\n"
    result = olp.correct(text, path)
    whole = judge_whole(text, result.data, tmp_path)
    assert whole.open
    assert whole.possible_um == pytest.approx(15.0 / np.sqrt(2.0), abs=0.01)
    compare(result.report["deviation"]["path_max_um"], whole)


@pytest.mark.oracle
def test_a_step_after_a_section_that_is_off_belongs_to_the_cut(tmp_path: Path) -> None:
    """The cut starts where the tool was left, not where the backlash is taken up."""
    curve = {"x.csv": "X_mm,EXX_um,EYX_um\n-1000,-50,8\n2000,100,8\n"}
    calibration = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
    calibration += "[backlash]\nX_um = 15.0\nY_um = 6.0\n"
    path = small_machine(tmp_path, calibration, curve, tables=TRUE_ZERO)
    text = b"""G21 G90 G54
G0 X10 Y20 Z30
(olp off)
G0 X165 Y273 Z-142
G1 X-176 Y175 Z197 F500
G1 X8 Y-211 Z199
(olp on)
G1 X7 Y-208 Z-219
G1 X-54 Y113 Z-58
M2
"""
    result = olp.correct(text, path)
    whole = judge_whole(text, result.data, tmp_path)
    assert whole.loose and whole.inserted
    compare(result.report["deviation"]["path_max_um"], whole)
    table = result.table.by_line()
    assert np.nanmax(table["corrected_um"]) < 20.0


# -- one coordinate changed -------------------------------------------------------------------------------

CUTS = ["lines", "short", "rapid", "series", "machine", "joint", "modal"]


def changed(text: bytes, line: int, letter: str, step_mm: float) -> bytes:
    """The text with one coordinate moved."""
    scale = 25.4 if b"G20" in text else 1.0
    rows = text.split(b"\n")
    number = re.search(letter.encode() + rb"(-?[0-9.]+)", rows[line - 1])
    assert number is not None
    value = f"{float(number[1]) + step_mm / scale:.5f}".encode()
    rows[line - 1] = rows[line - 1][: number.start(1)] + value + rows[line - 1][number.end(1) :]
    return b"\n".join(rows)


def choices(text: bytes, whole: Whole, own: CanonMoves) -> list[tuple[int, str]]:
    """Lines of the corrected text that are the ends of cuts between straight moves, and an axis of each."""
    plain = np.isin(own.kind, (FEED, RAPID))
    cycles = marks(text).cycles
    found = []
    rows = text.split(b"\n")
    for k in np.flatnonzero(own.kind[:-1] == FEED).tolist():
        line, after = int(own.line[k]), int(own.line[k + 1])
        letters = re.findall(rb"([XYZ])-?[0-9]", rows[line - 1])
        ends = whole.owners.get(line) != whole.owners.get(after)
        if ends and plain[k + 1] and letters and line not in cycles and after not in cycles:
            found += [(line, letter.decode()) for letter in letters]
    return found


def check_change(seed: int, folder: Path) -> dict[str, Any]:
    rng = np.random.default_rng(seed + 99)
    chain = str(rng.choice(CHAINS))
    machine = machines.random_machine(folder, seed, Recipe(chain=chain, off_datum=bool(seed % 2)))
    nominal = programs.random_program(seed, features=CUTS, blocks=8)
    text = olp.correct(nominal, machine).data
    whole = judge_whole(nominal, text, folder)
    own = linuxcnc.interpret(text, folder)
    own = own.pick(own.kind != DWELL)
    ends = choices(text, whole, own)
    assert ends
    base = olp.verify(nominal, text, machine).table.by_line()
    already = set(base["line"][base["state"] == 1].tolist())
    tried = {}
    for step in (0.004, 0.5, 5.0):
        for line, letter in [ends[i] for i in rng.permutation(len(ends))[:8]]:
            other = changed(text, line, letter, step * float(rng.choice([-1.0, 1.0])))
            there = linuxcnc.interpret(other, folder)
            there = there.pick(there.kind != DWELL)
            moved = np.abs(there.axis - own.axis).max(axis=1) > 1e-6
            begun = np.concatenate([[False], moved[:-1]])
            touched = {whole.owners[n] for n in own.line[moved | begun].tolist() if n in whole.owners}
            if len(touched) <= 0.25 * len(base["line"]):
                break
        else:
            continue
        again = olp.verify(nominal, other, machine)
        numerical = again.report["verdict"]["numerical"]
        lines = again.table.by_line()
        assert list(lines["line"]) == list(base["line"])
        assert not numerical["holds"]
        assert not again.report["verdict"]["ok"]
        own_line = whole.owners[line]
        assert lines["state"][lines["line"] == own_line][0] == 1, (step, line, letter)
        stated = float(lines["corrected_um"][lines["line"] == own_line][0])
        assert abs(stated - 1e3 * step) <= 25.0 + 0.02 * 1e3 * step if step > 0.1 else stated > 1.9
        assert numerical["line"] in touched or numerical["line"] in already
        rest = ~np.isin(lines["line"], list(touched))
        np.testing.assert_allclose(
            lines["corrected_um"][rest],
            base["corrected_um"][rest],
            rtol=0,
            atol=1e-3,
            err_msg=f"{step} {line}",
        )
        if step < 1.0:  # the judge's own matching may go astray beyond
            compare(numerical["largest_um"], judge_whole(nominal, other, folder))
        tried[str(step)] = round(stated, 2)
    return tried


@pytest.mark.oracle
@pytest.mark.parametrize("seed", some_of_a_campaign(range(8), 2))
def test_one_wrong_coordinate_is_a_figure_on_its_line(tmp_path: Path, seed: int) -> None:
    assert list(check_change(seed, tmp_path)) == ["0.004", "0.5", "5.0"]
