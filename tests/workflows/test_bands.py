"""A program is corrected in bands, and their size changes nothing: not a byte, not a figure of the report."""

from __future__ import annotations

import math
import random
import runpy
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import pytest
from cases.fast import left_to_a_campaign, some_fast, some_of_a_campaign
from fuzz import grammar
from judge.machines import Recipe, random_machine
from judge.programs import FEATURES, LOOSE, random_program

import olp
from olp.core import spool
from olp.core.errors import OlpError, OutsideBox
from olp.program import bands
from olp.program.text import columns
from olp.proof import deviation, kinds, matching, proof

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
MAKE = runpy.run_path(str(PROGRAMS / "generate.py"))
SHIPPED = {
    **{f"nasty/{path.name}": "job.toml" for path in sorted((PROGRAMS / "nasty").glob("*.ngc"))},
    "gantry-plate/plate.ngc": "job.toml",
    "table-router/outline.ngc": "job-outline.toml",
    "haas-mill/manifold.nc": "job-manifold.toml",
}
SIZES = (1, 7, 50)
BACKLASH = {"X": 6.0, "Y": 15.0, "Z": 4.0}


def corrected(*given: Any, **options: Any) -> tuple[bytes, dict[str, Any]] | str:
    """Bytes and report, or the words of a refusal."""
    try:
        done = olp.correct(*given, **options)
    except OlpError as error:
        return str(error)
    return done.data, done.report


def in_sizes(monkeypatch: pytest.MonkeyPatch, sizes: Sequence[int] = SIZES) -> Iterator[int]:
    """Bands and pages of some sizes, one after the other; texts are let go as long ones are."""
    monkeypatch.setattr(spool, "LONG", 1)
    monkeypatch.setattr(columns, "_FIRST", 8)
    monkeypatch.setattr(columns, "_MOST", 32)
    for size in sizes:
        monkeypatch.setattr(bands, "SIZE", size)
        # a page holds a window of the search at least
        monkeypatch.setattr(matching, "_PAGE", max(size, 12))
        for module in (deviation, kinds, proof):
            monkeypatch.setattr(module, "_BLOCK", 3 * size)
        yield size


def check(monkeypatch: pytest.MonkeyPatch, *given: Any, sizes: Sequence[int] = SIZES, **options: Any) -> None:
    whole = corrected(*given, **options)
    for size in in_sizes(monkeypatch, sizes):
        assert corrected(*given, **options) == whole, f"bands of {size} lines"


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(SHIPPED, ("nasty/g91-steps.ngc",)))
def test_any_size_of_bands_gives_the_same_of_what_is_shipped(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = PROGRAMS / name
    # a long one has many bands of any size
    sizes = SIZES if name.startswith("nasty/") else SIZES[-1:]
    check(monkeypatch, path, path.with_name("machine.toml"), path.with_name(SHIPPED[name]), sizes=sizes)


@pytest.fixture(scope="module", params=[{}, BACKLASH], ids=["without backlash", "with backlash"])
def machine(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("machine")
    return random_machine(folder, 5, Recipe(backlash_um=request.param, waves=6.0))


@pytest.mark.parametrize("name", ["nasty/block-delete.ngc", "nasty/g10-l20.ngc", "nasty/r-arcs.ngc"])
def test_a_size_of_bands_gives_the_same_of_some_that_are_shipped(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = PROGRAMS / name
    check(monkeypatch, path, path.with_name("machine.toml"), path.with_name("job.toml"), sizes=(2,))


@pytest.mark.slow
@pytest.mark.parametrize("seed", some_of_a_campaign(range(24), 6))
def test_any_size_of_bands_gives_the_same_of_random_programs(
    seed: int, machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Splits, arcs, cycles, G91, frames, tools, captures and `/` lines."""
    text = random_program(seed, features=(*FEATURES, *LOOSE), blocks=8)
    check(monkeypatch, text, machine, sizes=(1, 7))


@pytest.mark.slow
@pytest.mark.parametrize("seed", some_of_a_campaign(range(0, 200, 5), 8))
def test_any_size_of_bands_gives_the_same_of_mixed_blocks(
    seed: int, machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check(monkeypatch, grammar.legal(seed).data, machine)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "lines"), [("raster", 60), ("contour", 60), ("holes", 30), ("steps", 40)])
def test_any_size_of_bands_gives_the_same_of_generated_programs(
    kind: str, lines: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "\n".join(chain(MAKE["START"], MAKE[kind](lines), MAKE["END"])) + "\n"
    check(monkeypatch, text.encode(), PROGRAMS / "gantry-plate" / "machine.toml", sizes=(50, 333))


CONTOUR = (
    "G21 G90 G17 G54 G61\nG0 X0 Y0 Z5\nF600\nG1 X10\nX20\nX30 Y4\n{}\nX50 Y0\nX60\nY40\nX30\nX10\n"
    "G3 X0 Y30 I0 J-10\nG1 Y10\n{}\nG1 Z6\nX-10\nX-20 Y5\nX-30\nX-40 Y9\nM2\n"
)


def test_any_size_of_bands_gives_the_same_of_contours(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = CONTOUR.format("G41 D1", "G40").encode()
    assert isinstance(corrected(text, machine), tuple)
    check(monkeypatch, text, machine)


@pytest.mark.slow
@pytest.mark.parametrize("seed", some_of_a_campaign(range(6), 3))
def test_any_size_of_bands_gives_the_same_where_errors_are_large(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Samples between waypoints take a second step where the error is large, whatever is beside them."""
    machine = random_machine(tmp_path, seed, Recipe(peak_um=(400.0, 600.0), waves=8.0))
    check(monkeypatch, random_program(seed, features=FEATURES, blocks=8), machine, sizes=(1, 7))


def coil(count: int) -> Iterator[str]:
    for k in range(count):
        yield f"G1 X{50 + 0.02 * math.cos(k / 9) + 0.01 * k:.4f} Y{50 + 0.03 * math.sin(k / 9):.4f}"


def test_the_play_goes_on_from_band_to_band(monkeypatch: pytest.MonkeyPatch, machine: Path) -> None:
    """In a slow coil both axes turn round again and again, and most moves are shorter than the dead band."""
    text = "\n".join(["G21 G90 G54 G61", "G0 X50 Y50 Z0", "F600", *coil(120), "M2"]) + "\n"
    check(monkeypatch, text.encode(), machine, sizes=(5,))


def tiny(seed: int) -> Iterator[str]:
    """Feeds and rapids that are often shorter than what the proof takes for one place."""
    rng = random.Random(seed)
    at = [50.0, 50.0]
    digits, size = rng.choice((3, 4)), rng.choice((0.001, 0.003, 0.01))
    for _ in range(20):
        step = rng.choice((size, size, size * rng.random(), 3.0))
        at = [value + rng.choice((-step, step, 0.0)) for value in at]
        yield f"{rng.choice(('G0', 'G1', 'G1'))} X{at[0]:.{digits}f} Y{at[1]:.{digits}f}"


@pytest.mark.parametrize("seed", some_fast(range(1, 60, 7), 5, 2))
def test_steps_within_short_moves_beside_rapids_are_their_own(
    seed: int, machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "\n".join(["G21 G90 G54 G61", "G0 X50 Y50 Z0", "F600", *tiny(seed), "M2"]) + "\n"
    assert isinstance(corrected(text.encode(), machine), tuple)
    check(monkeypatch, text.encode(), machine, sizes=(1, 5))


def test_a_refusal_in_a_later_band_names_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    moves = [f"G1 X{100 + x} Y50 F900" for x in range(40)]
    text = "\n".join(["G21 G90 G54 G61", "G0 X99 Y50 Z10", *moves, "X99999", "M2"]) + "\n"
    for _ in in_sizes(monkeypatch):
        with pytest.raises(OutsideBox, match="outside the calibrated box") as refused:
            olp.correct(text.encode(), PROGRAMS / "gantry-plate" / "machine.toml")
        assert refused.value.line == 43
