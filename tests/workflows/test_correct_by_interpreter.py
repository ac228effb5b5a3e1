"""The finished chain, judged by LinuxCNC's interpreter and an independent error model."""

from __future__ import annotations

import itertools
import re
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import CUTTING, allowed_um, judged, points
from cases.fast import some_of_a_campaign
from judge import linuxcnc, machines, programs
from judge.linuxcnc import KINDS, CanonMoves
from judge.machines import CHAINS, Recipe
from judge.model import JudgeModel
from judge.programs import FEATURES
from judge.splitter import chord_count

import olp
from olp.core.errors import OlpError, ProgramError
from olp.core.toolpath import Flag, Toolpath
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

pytestmark = pytest.mark.oracle

#: what the judge's sampling of the path may add
SLACK_UM = 0.02
#: the largest difference between directions in the curves of the random machines, in any component at the tip
DIRECTED_JUMP_UM = 4.0
MOVING = {
    "lines",
    "short",
    "rapid",
    "arcs",
    "planes",
    "helix",
    "circle",
    "radius",
    "incremental",
    "frames",
    "cycles",
}
NEAR_MM = 1e-6


def draw(seed: int) -> tuple[Recipe, list[str]]:
    """A machine and the features of a program, all of them over the seeds."""
    rng = np.random.default_rng(seed + 77)
    recipe = Recipe(
        chain=str(rng.choice(CHAINS)),
        off_datum=bool(rng.random() < 0.5),
        interpolation=str(rng.choice(["pchip", "linear"])),
        cyclic=bool(rng.random() < 0.3),
    )
    if rng.random() < 0.3:
        tables = recipe.chain[: recipe.chain.index("F")]
        recipe = replace(recipe, on_table=tables)
    features = [name for name in FEATURES if rng.random() < 0.6]
    if not MOVING & set(features):
        features.append("lines")
    kind = rng.random()
    if kind < 0.25:
        recipe = replace(
            recipe, backlash_um={a: float(rng.choice([3.0, 15.0])) for a in "XYZ" if rng.random() < 0.6}
        )
    elif kind < 0.35:
        recipe = replace(recipe, directed="".join(a for a in "XYZ" if rng.random() < 0.5))
    if recipe.backlash_um or recipe.directed:  # play is unknown after a tool change, and the judge's is not
        features = [name for name in features if name != "tools"]
    if rng.random() < 0.4:
        frames = {name: dict(entry) for name, entry in recipe.work_offsets.items()}
        frames["G54"]["set_by"] = "touch"
        if "g10" not in features and rng.random() < 0.5:
            touch = {"set_by": "touch", "touched_at_mm": {"X": 400.0, "Z": -100.0}, "touch_tool": 2}
            frames["G55"] |= touch
        recipe = replace(recipe, work_offsets=frames)
    return recipe, features


def turned(recipe: Recipe, rng: np.random.Generator) -> Recipe:
    """The machine with its work offsets turned about Z."""
    frames = {name: dict(entry) for name, entry in recipe.work_offsets.items()}
    for entry in frames.values():
        entry["C_deg"] = float(rng.choice([90.0, -180.0, round(rng.uniform(-180.0, 180.0), 3)]))
    return replace(recipe, work_offsets=frames)


def check(seed: int, folder: Path, *, turn: bool = False) -> None:
    recipe, features = draw(seed)
    if turn:
        recipe = turned(recipe, np.random.default_rng(seed))
        # arcs and holes of other planes would leave them, and a stored position is not read
        features = [name for name in features if name not in {"planes", "g10"}] + ["lines"]
    path = machines.random_machine(folder, seed, recipe)
    nominal = programs.random_program(seed, features=features, blocks=3 + seed % 17)
    whole = seed % 4 == 3 and "tools" not in features and not recipe.backlash_um and not recipe.directed
    result = olp.correct(nominal, path, expand_cycles=True, split_rapids=whole)
    verdict = judged(nominal, result.data, folder, kinds=KINDS if whole else CUTTING)
    bar = allowed_um(nominal) + SLACK_UM
    if recipe.directed:
        # at a reversal of one axis the straightness of another jumps by its part that depends on direction,
        # and that axis cannot follow against its own backlash: README, honest limits
        bar += DIRECTED_JUMP_UM
    assert verdict.after.judged > 0
    assert verdict.max_um <= bar, f"line {verdict.worst_line}: {features}"
    assert verdict.vertex_max_um <= bar
    if verdict.before.max_um > 10.0:
        assert verdict.after.rms_um < 0.2 * verdict.before.rms_um


@pytest.mark.parametrize("seed", some_of_a_campaign(range(1000, 1040), 2))
def test_the_corrected_path_is_the_nominal_one(tmp_path: Path, seed: int) -> None:
    check(seed, tmp_path)


@pytest.mark.parametrize("seed", some_of_a_campaign(range(1200, 1224), 3))
def test_the_corrected_path_is_the_nominal_one_in_turned_work_offsets(tmp_path: Path, seed: int) -> None:
    check(seed, tmp_path, turn=True)


@pytest.mark.parametrize("seed", range(3))
def test_backlash_is_taken_up_on_ramps_along_a_contour_of_chords(tmp_path: Path, seed: int) -> None:
    """25 um in X and Y, taken up where the contour turns round, beside errors of 21 kinds with waves."""
    recipe = Recipe(backlash_um={"X": 25.0, "Y": 25.0}, waves=4.0, directed="")
    path = machines.random_machine(tmp_path, seed, recipe)
    turn = np.linspace(0.0, 2 * np.pi, 241)
    away = (12.0 + seed) * (1.0 + 0.2 * np.cos(5 * turn + seed))
    rows = [f"G1 X{x:.4f} Y{y:.4f}" for x, y in zip(away * np.cos(turn), away * np.sin(turn), strict=True)]
    start = rows[0].replace("G1", "G0")
    text = "\n".join(["G21 G90 G54 G61", "G0 Z20", start, "G1 Z1 F600", *rows, "G0 Z20", "M2", ""])
    corrected = olp.correct(text.encode(), path)
    verdict = judged(text.encode(), corrected.data, tmp_path, kinds=CUTTING)
    assert verdict.max_um <= allowed_um(text.encode()) + SLACK_UM
    assert corrected.report["moves"]["inserted_blocks"] > 10


@pytest.mark.parametrize("seed", range(1100, 1106))
def test_lengths_that_were_set_on_the_uncompensated_machine(tmp_path: Path, seed: int) -> None:
    """Every tool set on one setter, each elsewhere; one tool touched the work offsets and others cut too."""
    recipe, _ = draw(seed)
    rng = np.random.default_rng(seed)
    low, high = np.array(recipe.travel).T
    tools = {}
    for number, entry in recipe.tools.items():
        place = low + rng.uniform(0.2, 0.8, 3) * (high - low)
        at = dict(zip("XYZ", np.round(place, 3).tolist(), strict=True))
        tools[number] = {**entry, "set_by": "touch", "touched_at_mm": at}
    frames = {n: {**f, "set_by": "touch", "touch_tool": 2} for n, f in recipe.work_offsets.items()}
    recipe = replace(recipe, tools=tools, work_offsets=frames, backlash_um={}, directed="")
    path = machines.random_machine(tmp_path, seed, recipe)
    nominal = programs.random_program(seed, features=["lines", "tools", "frames"], blocks=12)
    result = olp.correct(nominal, path)
    verdict = judged(nominal, result.data, tmp_path)
    assert verdict.after.judged > 0
    assert verdict.max_um <= allowed_um(nominal) + SLACK_UM


@pytest.mark.slow
@pytest.mark.parametrize("block", some_of_a_campaign(range(8), 8))
def test_the_corrected_path_is_the_nominal_one_at_length(tmp_path: Path, block: int) -> None:
    wrong = []
    for seed in range(2000 + 20 * block, 2020 + 20 * block):
        try:
            check(seed, tmp_path / str(seed))
        except AssertionError as error:
            wrong.append((seed, str(error).splitlines()[0]))
        except OlpError as error:
            assert isinstance(error, ProgramError), seed
            assert error.line is not None, seed
    assert not wrong


# -- a shift -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_a_shift_is_seen_as_that_very_shift(tmp_path: Path, seed: int) -> None:
    """0.1 mm everywhere; 0.00394 in, the nearest that inches can say."""
    path = machines.shift_machine(tmp_path)
    features = [name for name in FEATURES if name not in ("cycles", "style")]
    nominal = programs.random_program(seed, features=features, blocks=12)
    corrected = olp.correct(nominal, path).data
    before, after = (linuxcnc.interpret(text, path, find_known=False) for text in (nominal, corrected))
    assert len(before) == len(after)
    step = 0.00394 * 25.4 if b"G20" in nominal else 0.1
    assert np.abs(before.axis - after.axis - step).max() <= NEAR_MM


# -- no more blocks than needed ---------------------------------------------------------------------------


@pytest.mark.parametrize("seed", some_of_a_campaign((1, 3, 0, 2, 4, 5), 3))
def test_few_blocks_more_than_the_longest_chords(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = machines.random_machine(tmp_path, seed, Recipe(chain=str(rng.choice(CHAINS)), off_datum=True))
    low, high = np.array(machines.TRAVEL).T
    position_mm = rng.uniform(low + 30, high - 30, (7, 3)).round(3)
    text = programs.polyline_program(position_mm - (250.0, 200.0, -300.0), 3)
    count = len(points(olp.correct(text, path).data)) - 1
    model, tool_vector = JudgeModel(path), np.array([0.0, 0.0, -120.0])
    best = sum(chord_count(a, b, model, tool_vector, 1e-3) for a, b in itertools.pairwise(position_mm))
    assert best >= 10
    assert count <= 1.15 * best


# -- LinuxCNC's own samples --------------------------------------------------------------------------------


@cache
def samples() -> tuple[Path, ...]:
    listed = subprocess.run(
        ["dpkg", "-L", "linuxcnc-uspace", "linuxcnc-doc-en"], capture_output=True, text=True, check=False
    ).stdout.split()
    found = (path for path in map(Path, listed) if path.suffix == ".ngc" and path.is_file())
    # a recursion of thousands of moves, which test_flatten_by_interpreter.py reads
    return tuple(path for path in found if path.name != "flowsnake.ngc")


@pytest.fixture(scope="module")
def big(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine without errors but with a box, offsets and tools for any sample; the job starts at zero."""
    return spacious(tmp_path_factory.mktemp("big"), (0.0, 0.0, 0.0))


def spacious(folder: Path, shift_um: tuple[float, float, float]) -> Path:
    recipe = Recipe(
        travel=((-1e5, 1e5),) * 3,
        tools={n: {"Z_mm": 10.0 + n, "radius_mm": 1.0} for n in range(1, 31)},
        work_offsets={
            f"G{n}": {
                "X_mm": 10.0 * (n - 50),
                "Y_mm": 5.0 * (n - 50),
                "Z_mm": -3.0 * (n - 50),
                "set_by": "true",
            }
            for n in range(54, 60)
        },
    )
    path = machines.shift_machine(folder, shift_um, recipe)
    start = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n"
    (folder / "job.toml").write_text(f'schema = "olp-job-1"\nmachine = "machine.toml"\n{start}')
    return path


def reading(text: bytes, path: Path) -> Toolpath:
    setup = load_setup(path, path.with_name("job.toml"))
    return read(text, setup, DIALECTS["linuxcnc"], words=False).toolpath


def difference(path: Toolpath, moves: CanonMoves) -> str:
    """Where two readings of one program part, moves without a way left out; empty where they agree."""
    own = (path.flag & np.uint8(Flag.CONTROL)) == 0
    ours, line = path.end_mm[own], path.line[own]
    real = moves.pick(moves.kind != linuxcnc.DWELL)
    theirs = real.axis
    i = j = 0
    while i < len(ours) or j < len(theirs):
        if (
            i < len(ours)
            and j < len(theirs)
            and np.nanmax(np.abs(ours[i] - theirs[j]), initial=0.0) <= NEAR_MM
        ):
            i, j = i + 1, j + 1
        elif j and j < len(theirs) and np.abs(theirs[j] - theirs[j - 1]).max() <= NEAR_MM:
            j += 1
        elif i and i < len(ours) and np.abs(ours[i] - ours[i - 1]).max() <= NEAR_MM:
            i += 1
        else:
            return f"line {line[i] if i < len(ours) else '-'}: {ours[i : i + 1]} and {theirs[j : j + 1]}"
    return ""


SPLINE = re.compile(rb"(?im)^\s*g0*5(\.[12])?\b")


@pytest.mark.parametrize("unroll", [False, True])
def test_samples_are_read_as_linuxcnc_reads_them(big: Path, unroll: bool) -> None:
    wrong, compared, moves = [], 0, 0
    for sample in samples():
        nominal = sample.read_bytes()
        try:
            text = olp.flatten(sample, big) if unroll else nominal
            ours = reading(text, big)
        except ProgramError as refusal:
            assert refusal.line is not None, sample
            continue
        if SPLINE.search(nominal):
            # chords of splines are finer than those of the interpreter: tests/program/rs274/flatten
            nominal = text
        try:
            theirs = linuxcnc.interpret(nominal, big, find_known=False)
        except linuxcnc.InterpreterError:
            continue
        mismatch = difference(ours, theirs)
        compared, moves = compared + 1, moves + len(theirs)
        if mismatch:
            wrong.append((str(sample), mismatch))
    assert not wrong
    assert compared >= (30 if unroll else 5)
    assert moves >= 1000


def test_samples_stay_acceptable_and_shift_exactly(big: Path, tmp_path: Path) -> None:
    path = spacious(tmp_path, (100.0, 100.0, 100.0))
    wrong, done = [], 0
    for sample in samples():
        try:
            flat = olp.flatten(sample, big, expand_cycles=True)
            if not linuxcnc.accepts(flat, big):
                continue
            corrected = olp.correct(flat, path, path.with_name("job.toml"))
        except ProgramError as refusal:
            assert refusal.line is not None, sample
            continue
        if not corrected.report["moves"]["total"]:
            continue
        done += 1
        if not linuxcnc.accepts(corrected.data, big):
            wrong.append(str(sample))
    assert not wrong
    assert done >= 10


# -- accepted before, accepted after ------------------------------------------------------------------------


@pytest.mark.parametrize("recipe", [Recipe(), Recipe(backlash_um={"X": 6.0, "Y": 4.0, "Z": 8.0})])
@pytest.mark.parametrize("seed", some_of_a_campaign(range(10), 3))
def test_what_linuxcnc_took_it_still_takes(tmp_path: Path, seed: int, recipe: Recipe) -> None:
    path = machines.random_machine(tmp_path, seed, recipe)
    nominal = programs.random_program(seed, blocks=20)
    assert linuxcnc.accepts(nominal, path)
    texts = (
        olp.correct(nominal, path),
        olp.correct(nominal, path, expand_cycles=True),
        olp.correct(nominal, path, split_rapids=True),
    )
    assert [linuxcnc.accepts(result.data, path) for result in texts] == [True] * len(texts)
