"""Programs too large to keep, and the calibration curves of the machines in this folder.

    python programs/generate.py raster 1e6 -o raster.nc     finishing raster of modal G1, with helices and G91
    python programs/generate.py contour 2e5 -o contour.ngc  long smooth contour of short lines and arcs
    python programs/generate.py holes 1e4 -o holes.ngc      drilling cycles and helical bores
    python programs/generate.py steps 600 -o steps.ngc      one G91 line after the other, a few digits each
    python programs/generate.py curves                      x.csv, y.csv, z.csv of every machine here

Same arguments, same bytes. The programs fit the machine in `gantry-plate`; `-o -` is standard output.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

HERE = Path(__file__).resolve().parent
WIDTH_MM, DEPTH_MM = 1000.0, 600.0

START = (
    "G21 G17 G90 G94 G40 G49 G80",
    "G54",
    "T1 M6",
    "G43 H1",
    "S12000 M3",
    "G0 X0.000 Y0.000 Z50.000",
)
END = ("G0 Z50.000", "M5", "M30")


def surface(x: float, y: float) -> float:
    """Height of a shallow pressing tool, -28 to 0 mm."""
    return -14.0 + 10.0 * math.sin(x / 83.0) * math.cos(y / 61.0) + 4.0 * math.sin((x + y) / 29.0)


def raster(lines: int) -> Iterator[str]:
    """Rows along X, there and back, in the mixed writing that posts and hand edits leave behind."""
    pitch = 1.2
    per_row = int(WIDTH_MM / pitch)
    rows = max(2, math.ceil(lines / per_row))
    count = 0
    for row in range(rows + 1):
        y = DEPTH_MM * row / rows
        steps = range(per_row + 1) if row % 2 == 0 else range(per_row, -1, -1)
        yield f"(ROW {row} AT Y{y:.3f}, NOT A MOVE: X{row}.5 Z-99.)"
        x_last = steps[0] * pitch
        yield f"G1 X{x_last:.3f} Y{y:.3f} Z{surface(x_last, y):.4f} F{1800 + 150 * (row % 4)}"
        for step in steps[1:]:
            x = step * pitch
            z = surface(x, y)
            count += 1
            if count % 211 == 0:
                # half a turn about the middle: the direction of travel decides on which side it bulges
                word = "G2" if row % 2 == 0 else "G3"
                yield f"{word} X{x:.3f} Y{y:.3f} Z{z:.4f} I{(x - x_last) / 2:.4f} J0"
                yield f"G1 Z{z + 0.02:.4f}"
            elif count % 1499 == 0:
                yield "G91"
                yield "G1 Z0.25"
                yield "x.05 ; lift and shift"
                yield "X-.05 Z-0.25"
                yield "G90"
                continue
            elif count % 13 == 0:
                yield f"g01x{x:.3f}y{y:.3f}z{z:.4f}"
            elif count % 7 == 0:
                yield f"N{count * 10 % 99990} G1 X{x:.3f} Y{y:.3f} Z{z:.4f}"
            elif count % 5 == 0:
                yield f"X{x:.3f}"
            else:
                yield f"X{x:.3f} Z{z:.4f}"
            x_last = x


def centre(p: complex, q: complex, r: complex) -> complex:
    """Centre of the circle through three points of the plane."""
    a, b = q - p, r - p
    return p + (abs(b) ** 2 * a - abs(a) ** 2 * b) * 1j / (2 * (a.real * b.imag - a.imag * b.real))


def contour(lines: int) -> Iterator[str]:
    """A five-lobed outline, lap by lap deeper: four short lines, then an arc, and again."""
    laps = max(1, math.ceil(lines / 4000))
    per_lap = 4000
    middle = complex(WIDTH_MM / 2, DEPTH_MM / 2)

    def point(angle: float) -> complex:
        lobe = 1 + 0.12 * math.cos(5 * angle)
        return middle + lobe * complex(420 * math.cos(angle), 240 * math.sin(angle))

    yield f"G0 X{point(0).real:.4f} Y{point(0).imag:.4f}"
    yield "G0 Z2.0000"
    for lap in range(laps):
        yield f"(LAP {lap})"
        yield f"G1 Z{-20.0 * (lap + 1) / laps:.4f} F600"
        turn = 2 * math.pi / per_lap
        for step in range(per_lap):
            here, there = point(step * turn), point((step + 1) * turn)
            if step % 5 < 4:
                yield f"{'G1 ' if step % 5 == 0 else ''}X{there.real:.4f} Y{there.imag:.4f}"
                continue
            half = point((step + 0.5) * turn)
            to_centre = centre(here, half, there) - here
            left = ((half - here).conjugate() * (there - half)).imag > 0
            word = "G3" if left else "G2"
            end = f"X{there.real:.4f} Y{there.imag:.4f}"
            yield f"{word} {end} I{to_centre.real:.4f} J{to_centre.imag:.4f} F3000"


def holes(lines: int) -> Iterator[str]:
    """Holes in serpentine order, 40 a cycle block: G81, G83 and G82 by turns, then one helical bore."""
    columns = 40
    rows = max(2, math.ceil(lines / (columns + 9)))
    cycles = ("G99 G81 Z-12.5 R2. F240", "G98 G83 Z-30. R2. Q5. F180", "G99 G82 Z-4. R1.5 P0.2 F200")
    for row in range(rows):
        y = DEPTH_MM * (row + 0.5) / rows
        xs = [WIDTH_MM * (i + 0.5) / columns for i in range(columns)]
        if row % 2:
            xs.reverse()
        yield f"(ROW {row})"
        yield f"G0 X{xs[0]:.3f} Y{y:.3f} Z5.000"
        yield cycles[row % 3] + f" X{xs[0]:.3f} Y{y:.3f}"
        for x in xs[1:]:
            yield f"X{x:.3f}"
        yield "G80"
        yield f"G0 X{xs[-1] + 6:.3f} Y{y:.3f} Z1.000"
        yield f"G3 X{xs[-1] + 6:.3f} Y{y:.3f} Z-8.000 I-6.000 J0 P4 F900"
        yield "G3 I-6.000 J0"
        yield f"G1 X{xs[-1]:.3f}"
        yield "G0 Z5.000"


def steps(lines: int) -> Iterator[str]:
    """Increments of a few thousandths along a coil, where a rounding error kept at each would add up."""
    yield "G0 X300. Y200. Z1."
    yield "G1 Z0. F400"
    yield "G91"
    for i in range(lines):
        angle = i / 9.0
        words = [f"X{0.047 * math.cos(angle) + 0.003:.3f}", f"Y{0.047 * math.sin(angle):.3f}"]
        words += ["Z-0.001"] if i % 4 == 0 else []
        yield " ".join(w for w in words if float(w[1:]) != 0.0)
    yield "G90"
    yield "G1 X300. Y200. Z0."


KINDS: dict[str, Callable[[int], Iterator[str]]] = {
    "raster": raster,
    "contour": contour,
    "holes": holes,
    "steps": steps,
}


def program(kind: str, lines: int) -> Iterator[str]:
    """`lines` lines, without the end of line; `steps` counts its increments instead and ends by itself."""
    body = KINDS[kind](lines)
    if kind != "steps":
        body = islice(body, max(1, lines - len(START) - len(END) - 2))
    # G80 G90: the cut may fall into a cycle or an incremental passage
    yield from chain(START, [f"(GENERATED: {kind.upper()} {lines})"], body, ["G80 G90"], END)


@dataclass(frozen=True)
class Curves:
    """How the curves of one machine are made: a slope and harmonics of random phase, zero at the datum.

    `um` and `urad` are peak amplitudes of (positioning, straightness) and (roll, pitch, yaw) per axis;
    `slope_um_m` is the scale error per axis. `decimals` is the resolution of the instrument.
    """

    seed: int
    step_mm: tuple[float, float, float]
    slope_um_m: tuple[float, float, float]
    um: tuple[tuple[float, float], ...]
    urad: tuple[tuple[float, float, float], ...]
    box_mm: tuple[tuple[float, float], ...]
    datum_mm: tuple[float, float, float]
    decimals: int = 1


MACHINES = {
    "gantry-plate": Curves(
        seed=11,
        step_mm=(50.0, 50.0, 25.0),
        slope_um_m=(38.0, -24.0, 15.0),
        um=((14.0, 22.0), (10.0, 16.0), (5.0, 8.0)),
        urad=((34.0, 20.0, 42.0), (26.0, 24.0, 30.0), (15.0, 18.0, 12.0)),
        box_mm=((0.0, 1600.0), (0.0, 1000.0), (-450.0, 0.0)),
        datum_mm=(0.0, 0.0, 0.0),
    ),
    "bridge-cmm": Curves(
        seed=23,
        step_mm=(25.0, 25.0, 25.0),
        slope_um_m=(3.0, -4.0, 2.5),
        um=((1.6, 1.8), (1.8, 2.0), (1.2, 1.2)),
        urad=((3.0, 2.5, 3.5), (4.0, 3.0, 4.5), (2.0, 2.0, 2.5)),
        box_mm=((0.0, 900.0), (0.0, 1200.0), (-600.0, 0.0)),
        datum_mm=(0.0, 0.0, 0.0),
        decimals=2,
    ),
    "table-router": Curves(
        seed=37,
        step_mm=(10.0, 10.0, 5.0),
        slope_um_m=(180.0, -140.0, 90.0),
        um=((18.0, 15.0), (14.0, 16.0), (6.0, 8.0)),
        urad=((80.0, 60.0, 90.0), (110.0, 70.0, 85.0), (60.0, 60.0, 40.0)),
        box_mm=((-290.0, 0.0), (-170.0, 0.0), (-45.0, 0.0)),
        datum_mm=(-150.0, -90.0, -40.0),
    ),
    "haas-mill": Curves(
        seed=41,
        step_mm=(38.1, 29.0, 25.4),
        slope_um_m=(16.0, -12.0, 14.0),
        um=((4.0, 3.5), (3.5, 3.0), (3.0, 3.0)),
        urad=((14.0, 10.0, 12.0), (16.0, 12.0, 14.0), (9.0, 9.0, 6.0)),
        box_mm=((-762.0, 0.0), (-406.0, 0.0), (-508.0, 0.0)),
        datum_mm=(-381.0, -203.0, -508.0),
    ),
    "nasty": Curves(
        seed=59,
        step_mm=(30.0, 25.0, 20.0),
        slope_um_m=(60.0, -45.0, 30.0),
        um=((9.0, 14.0), (8.0, 12.0), (5.0, 7.0)),
        urad=((30.0, 24.0, 36.0), (28.0, 20.0, 26.0), (16.0, 18.0, 14.0)),
        box_mm=((0.0, 600.0), (0.0, 400.0), (-300.0, 0.0)),
        datum_mm=(0.0, 0.0, 0.0),
    ),
}


def smooth(rng: random.Random, length: float) -> Callable[[float], float]:
    """Random sum of four harmonics, about +-1, the longest a wave over 1.6 times `length`."""
    waves = [
        (rng.uniform(0.4, 1.0) / order**1.3, order / (1.6 * length), rng.uniform(0.0, 2 * math.pi))
        for order in (1, 2, 3, 5)
    ]
    scale = sum(a for a, _, _ in waves)
    return lambda q: sum(a * math.sin(2 * math.pi * f * q + phase) for a, f, phase in waves) / scale


def curve_values(spec: Curves, axis: int) -> Callable[[float], list[float]]:
    """The six errors of one axis by position, in um and urad."""
    low, high = spec.box_mm[axis]
    datum = spec.datum_mm[axis]
    rng = random.Random(1000 * spec.seed + axis)
    amplitudes = [spec.um[axis][0 if i == axis else 1] for i in range(3)] + list(spec.urad[axis])
    slopes = [spec.slope_um_m[axis] * 1e-3 if i == axis else 0.0 for i in range(6)]
    waves = [smooth(rng, high - low) for _ in range(6)]

    def values(q: float) -> list[float]:
        parts = zip(slopes, amplitudes, waves, strict=True)
        return [slope * (q - datum) + peak * (wave(q) - wave(datum)) for slope, peak, wave in parts]

    return values


def curve_rows(spec: Curves, axis: int) -> Iterator[str]:
    """The CSV file of one axis: header, then a row per measured position."""
    letter = "XYZ"[axis]
    low, high = spec.box_mm[axis]
    errors = curve_values(spec, axis)
    names = [f"E{d}{letter}_um" for d in "XYZ"] + [f"E{d}{letter}_urad" for d in "ABC"]
    yield ",".join([f"{letter}_mm", *names])
    count = math.ceil((high - low) / spec.step_mm[axis] - 1e-9)
    for i in range(count + 1):
        q = low + (high - low) * i / count
        values = errors(q)
        # + 0.0 turns a rounded -0.0 into 0.0
        yield ",".join([f"{q:.3f}", *(f"{round(v, spec.decimals) + 0.0:.{spec.decimals}f}" for v in values)])


def write_curves(folder: Path) -> None:
    for name, spec in MACHINES.items():
        for axis, letter in enumerate("xyz"):
            path = folder / name / f"{letter}.csv"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(("\n".join(curve_rows(spec, axis)) + "\n").encode())


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    for kind, function in KINDS.items():
        verb = verbs.add_parser(kind, help=(function.__doc__ or "").splitlines()[0])
        verb.add_argument("lines", type=lambda text: int(float(text)), help="number of lines, e.g. 1e6")
        verb.add_argument("-o", "--output", default="-", help="file to write; - is standard output")
        verb.add_argument("--crlf", action="store_true", help="end lines with CR LF")
    verb = verbs.add_parser("curves", help="write the calibration curves of every machine")
    verb.add_argument("--folder", type=Path, default=HERE, help="where the machines' folders are")
    options = parser.parse_args(arguments)
    if options.verb == "curves":
        write_curves(options.folder)
        return
    end = b"\r\n" if options.crlf else b"\n"
    with ExitStack() as stack:
        out = (
            sys.stdout.buffer
            if options.output == "-"
            else stack.enter_context(Path(options.output).open("wb"))
        )
        lines = program(options.verb, options.lines)
        while block := list(islice(lines, 50_000)):
            out.write("\n".join(block).encode().replace(b"\n", end) + end)


if __name__ == "__main__":
    main()
