"""The files of `programs/gantry-checks`: ball-bar, body diagonals, go and return and postures on the machine
of `gantry-lines`, simulated.

    python programs/make/gantry_checks.py

The machine's errors are those of `gantry-plate/calibration.toml`, as in `gantry_lines.py`. Noise: ball-bar
0.2 um, laser 0.5 um, postures 1.5 um. The axes lag by 2.0 ms (X) and 1.7 ms (Y) behind their commands. Styli
2 and 3 are off their nominal vectors.
"""

from __future__ import annotations

import math
import random
from pathlib import Path

from gantry_lines import REFLECTOR, SPAN, error_um

OUT = Path(__file__).resolve().parents[1] / "gantry-checks"
CENTRE, RADIUS, FEED = (800.0, 500.0, -220.0), 150.0, 50.0
LAG_MS = (2.0, 1.7)
STYLI = {"1": (0.0, 0.0, -85.0), "2": (-60.0, 0.0, -45.0), "3": (0.0, -60.0, -45.0)}
STYLUS_ERROR_UM = {"1": (0.0, 0.0, 0.0), "2": (14.0, -6.0, 9.0), "3": (-3.0, 11.0, 5.0)}
POINT = (700.0, 400.0, -395.0)


def ball_bar(rng: random.Random) -> list[str]:
    """Two laps in XY each way, read every two degrees after a quarter of a lap to run in."""
    rows = [
        "# ball-bar on the table, XY, to and fro in one set-up", "# plane = XY", f"# radius_mm = {RADIUS}",
        f"# centre_mm = {list(CENTRE)}", f"# tool_mm = {list(REFLECTOR)}", f"# feed_mm_s = {FEED}",
        "# sigma_um = 0.2", "angle_deg,run,direction,deviation_um",
    ]  # fmt: skip
    aside = (rng.uniform(-8, 8), rng.uniform(-8, 8))
    for run in (1, 2):
        for direction in (1, -1):
            for k in range(180):
                degrees = 2 * k + 1
                t = math.radians(degrees)
                way = (-math.sin(t) * direction, math.cos(t) * direction)
                at = (CENTRE[0] + RADIUS * math.cos(t), CENTRE[1] + RADIUS * math.sin(t), CENTRE[2])
                play = [math.copysign(1.0, way[0]), math.copysign(1.0, way[1]), 0.0]
                off = error_um(at, REFLECTOR, play)
                x, y = (off[i] - FEED * way[i] * LAG_MS[i] - aside[i] for i in (0, 1))
                radial = x * math.cos(t) + y * math.sin(t) + 1.3 + rng.gauss(0.0, 0.2)
                rows.append(f"{degrees},{run},{direction},{radial:.2f}")
    return rows


def diagonal(rng: random.Random, signs: tuple[int, int, int]) -> list[str]:
    """Five runs there and back along a body diagonal of the measured volume, zero at its start."""
    low, high = zip(*SPAN, strict=True)
    start = [low[i] if signs[i] > 0 else high[i] for i in range(3)]
    end = [high[i] if signs[i] > 0 else low[i] for i in range(3)]
    length = math.dist(start, end)
    unit = [(b - a) / length for a, b in zip(start, end, strict=True)]
    rows = [
        "# laser along a body diagonal", f"# start_mm = {start}", f"# end_mm = {end}",
        f"# tool_mm = {list(REFLECTOR)}", "# sense = actual-minus-commanded", "# sigma_um = 0.5",
        "# sigma_scale_um_m = 0.5", "target_mm,run,direction,value_um",
    ]  # fmt: skip
    shares = [0.02 + 0.96 * k / 12 for k in range(13)]
    zero: float | None = None
    for run in range(1, 6):
        for direction in (1, -1):
            for share in shares[::direction]:
                at = [a + share * (b - a) for a, b in zip(start, end, strict=True)]
                play = [math.copysign(1.0, direction * u) for u in unit]
                off = error_um(at, REFLECTOR, play)
                value = sum(o * u for o, u in zip(off, unit, strict=True))
                zero = value if zero is None else zero
                rows.append(
                    f"{share * length:.3f},{run},{direction},{value - zero + rng.gauss(0.0, 0.5):.2f}"
                )
    return rows


def go_return(rng: random.Random, axis: int, count: int) -> list[str]:
    """Targets approached from both sides, one after the other, five runs."""
    name = "XYZ"[axis]
    low, high = SPAN[axis]
    others = ", ".join(f"{a} = {v}" for i, (a, v) in enumerate(zip("XYZ", CENTRE, strict=True)) if i != axis)
    rows = [
        f"# go and return on {name}", f'# component = "E{name}{name}"', "# sense = actual-minus-commanded",
        '# machine = "gantry-1600"', "# measured = 2026-04-22", "# temperature_degC = 20.0",
        f"# line_mm = {{ {others} }}", f"# tool_mm = {list(REFLECTOR)}", "target_mm,run,direction,value_um",
    ]  # fmt: skip
    targets = [round(low + 10 + (high - low - 20) * (k + 0.1 * math.sin(2.4 * k)) / (count - 1), 1)
               for k in range(count)]  # fmt: skip
    for run in range(1, 6):
        for target in targets:
            for direction in (1, -1):
                at = [*CENTRE]
                at[axis] = target
                play = [0.0, 0.0, 0.0]
                play[axis] = float(direction)
                value = error_um(at, REFLECTOR, play)[axis] + 0.3 * run + rng.gauss(0.0, 0.5)
                rows.append(f"{target},{run},{direction},{value:.2f}")
    return rows


def postures(rng: random.Random) -> list[str]:
    """One sphere, three styli of a star, four times each: axis positions with the tip at its centre."""
    rows = [
        "# one sphere on the table, three styli of a star", "# sigma_um = 1.5",
        "X_mm,Y_mm,Z_mm,tool,TX_mm,TY_mm,TZ_mm",
    ]  # fmt: skip
    for _ in range(4):
        for tool, vector in STYLI.items():
            true = [v + e * 1e-3 for v, e in zip(vector, STYLUS_ERROR_UM[tool], strict=True)]
            at = [p - v for p, v in zip(POINT, true, strict=True)]
            off = error_um(at, vector, (0.0, 0.0, 0.0))
            read = [a - o * 1e-3 + rng.gauss(0.0, 1.5e-3) for a, o in zip(at, off, strict=True)]
            rows.append(",".join([*(f"{v:.4f}" for v in read), tool, *(f"{v:g}" for v in vector)]))
    return rows


def main() -> None:
    OUT.mkdir(exist_ok=True)
    rng = random.Random(7)
    files = {"ballbar-xy.csv": ball_bar(rng), "postures.csv": postures(rng)}
    for name, signs in (("ppp", (1, 1, 1)), ("npp", (-1, 1, 1)), ("pnp", (1, -1, 1)), ("nnp", (-1, -1, 1))):
        files[f"diagonal-{name}.csv"] = diagonal(rng, signs)
    for axis, count in ((0, 12), (1, 9), (2, 6)):
        files[f"go-return-{'xyz'[axis]}.csv"] = go_return(rng, axis, count)
    for name, rows in files.items():
        (OUT / name).write_text("\n".join(rows) + "\n", "utf-8")


if __name__ == "__main__":
    main()
