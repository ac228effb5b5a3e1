"""The files of `programs/gantry-lines`: lines of laser, level and square on the machine of `gantry-plate`, as
a shop would take them, simulated.

    python programs/make/gantry_lines.py

The machine's errors are those of `gantry-plate/calibration.toml`. All lines pass through one place, the
reflector hangs 85 mm below the gauge point. Noise: laser 0.5 um and a wavelength off by 0.5 um/m, of
straightness 0.5 um + 0.5 um/m, levels and angles 1 urad, squares 5 urad; drift of some um or urad; five runs
there and back. Tracker: 50 places of a Latin hypercube with three reflectors, 5 um, in a frame of its own.
"""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Sequence
from pathlib import Path

PROGRAMS = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PROGRAMS))
from generate import MACHINES, curve_values  # noqa: E402

OUT = PROGRAMS / "gantry-lines"
AXES = "XYZ"
PLATE = MACHINES["gantry-plate"]
ERRORS = [curve_values(PLATE, axis) for axis in range(3)]
#: gantry-plate/calibration.toml: where its curves were measured, squareness in urad, lost motion in um
PLACE, TOOL = (800.0, 500.0, -300.0), (0.0, 0.0, -120.0)
SQUARENESS = {"C0Y": 31.0, "B0Z": -14.0, "A0Z": 18.0}
LOST = (6.0, 0.0, 0.0)
#: what the shop did
AT, REFLECTOR, RUNS = (740.0, 620.0, -310.0), (0.0, 0.0, -85.0), 5
SPAN = ((20.0, 1580.0), (20.0, 980.0), (-440.0, -5.0))
TARGETS = (17, 13, 11)
UNCHANGED = ((1, 2), (2,), ())


def error_um(at: Sequence[float], tool: Sequence[float], play: Sequence[float]) -> list[float]:
    """Actual minus commanded in um: FXYZ, to first order."""
    total = [0.0, 0.0, 0.0]
    for axis in range(3):
        values = ERRORS[axis](at[axis])
        lever = [tool[k] - TOOL[k] + (at[k] - PLACE[k] if k in UNCHANGED[axis] else 0.0) for k in range(3)]
        a, b, c = (angle * 1e-3 for angle in values[3:])
        turned = (b * lever[2] - c * lever[1], c * lever[0] - a * lever[2], a * lever[1] - b * lever[0])
        for k in range(3):
            total[k] += values[k] + turned[k]
        total[axis] -= 0.5 * LOST[axis] * play[axis]
    total[0] += (-SQUARENESS["C0Y"] * at[1] + SQUARENESS["B0Z"] * at[2]) * 1e-3
    total[1] += -SQUARENESS["A0Z"] * at[2] * 1e-3
    return total


def line(
    name: str, rng: random.Random, *, slope: float = 0.0, aside: float = 0.0
) -> list[tuple[float, int, int, float]]:
    """(target, run, direction, reading) in the order of time."""
    axis, kind = AXES.index(name[2]), "XYZABC".index(name[1])
    low, high = SPAN[axis]
    # moved off equal steps, as ISO 230-2 asks
    spot = random.Random(name[2])
    step = (high - low) / (TARGETS[axis] - 1)
    targets = [
        low,
        *(round(low + i * step + spot.uniform(-4, 4), 1) for i in range(1, TARGETS[axis] - 1)),
        high,
    ]
    wave = rng.gauss(0.0, 0.5)
    trend, bend, zero = rng.gauss(0.0, 2.0), rng.gauss(0.0, 1.0), rng.uniform(-30.0, 30.0)
    rows: list[tuple[float, int, int, float]] = []
    count = 2 * RUNS * len(targets)
    for run in range(1, RUNS + 1):
        for direction in (1, -1):
            for q in targets if direction > 0 else reversed(targets):
                time = len(rows) / count
                drift = zero + trend * time + bend * math.sin(4.0 * time)
                far = abs(q - low) * 1e-3
                if kind >= 3:
                    value = ERRORS[axis](q)[kind] + rng.gauss(0.0, 1.0)
                else:
                    at, play = list(AT), [0.0, 0.0, 0.0]
                    at[axis], play[axis] = q, float(direction)
                    tool = (REFLECTOR[0] + aside, *REFLECTOR[1:])
                    value = error_um(at, tool, play)[kind]
                    if kind == axis:
                        value += wave * far + rng.gauss(0.0, 0.5)
                    else:
                        value += slope * q * 1e-3 + rng.gauss(0.0, 0.5 + 0.5 * far)
                rows.append((q, run, direction, value + drift))
    return rows


def native(name: str, rows: Sequence[tuple[float, int, int, float]]) -> str:
    unit = "urad" if name[1] in "ABC" else "um"
    text = [f"target_mm,run,direction,value_{unit}"]
    text += [f"{q:.1f},{run},{direction},{value:.2f}" for q, run, direction, value in rows]
    return "\n".join(text) + "\n"


def export(name: str, rows: Sequence[tuple[float, int, int, float]]) -> str:
    """What a laser's program exports in a country of decimal commas."""
    text = ["Laser measurement", f"Axis;{name[2]}", "Runs;5", "Unit;um", "", "Position;Error"]
    text += [f"{q:.1f};{value:.2f}".replace(".", ",") for q, _, _, value in rows]
    return "\r\n".join(text) + "\r\n"


def tracker() -> str:
    """Places of three reflectors as a tracker beside the machine saw them."""
    rng, n = random.Random(30), 50
    shares = [[(k + rng.random()) / n for k in rng.sample(range(n), n)] for _ in AXES]
    text = [
        "# Points after the calibration, for olp calibrate doctor.",
        "# sigma_um = 5",
        "X_mm,Y_mm,Z_mm,tool_X_mm,tool_Y_mm,tool_Z_mm,measured_X_mm,measured_Y_mm,measured_Z_mm",
    ]
    turn, tilt = math.radians(37.0), math.radians(1.5)
    for k, share in enumerate(zip(*shares, strict=True)):
        at = [round(low + s * (high - low), 1) for s, (low, high) in zip(share, SPAN, strict=True)]
        tool = (REFLECTOR, (140.0, 0.0, -85.0), (-60.0, 120.0, -200.0))[k % 3]
        off = error_um(at, tool, (0.0, 0.0, 0.0))
        x, y, z = (a + t + 1e-3 * (e + rng.gauss(0.0, 5.0)) for a, t, e in zip(at, tool, off, strict=True))
        x, z = x * math.cos(tilt) + z * math.sin(tilt), z * math.cos(tilt) - x * math.sin(tilt)
        x, y = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)
        row = (*at, *tool, *(f"{v:.4f}" for v in (x + 2311.0, y - 1874.0, z + 903.0)))
        text.append(",".join(map(str, row)))
    return "\n".join(text) + "\n"


def main() -> None:
    rng = random.Random(2026)
    files: dict[str, str] = {}
    for axis in AXES:
        name = f"E{axis}{axis}"
        files[f"laser-{axis.lower()}.txt"] = export(name, line(name, rng))
        for kind in "ABC":
            if (kind, axis) != ("C", "Z"):
                name = f"E{kind}{axis}"
                files[f"{name.lower()}.csv"] = native(name, line(name, rng))
    for first, second in ("XY", "XZ", "YZ"):
        pose = rng.gauss(0.0, 100.0)
        other = rng.gauss(0.0, 5.0) - pose
        for name, slope in ((f"E{second}{first}", pose), (f"E{first}{second}", other)):
            rows = line(name, rng, slope=slope)
            if name == "EZX":
                # somebody walked through the beam
                q, run, direction, value = rows[40]
                rows[40] = q, run, direction, value + 38.0
            files[f"{name.lower()}.csv"] = native(name, rows)
    for label, aside in (("left", -130.0), ("right", 130.0)):
        files[f"eyz-{label}.csv"] = native("EYZ", line("EYZ", rng, slope=other, aside=aside))
    files["tracker.csv"] = tracker()
    OUT.mkdir(exist_ok=True)
    for file, text in files.items():
        (OUT / file).write_bytes(text.encode())


if __name__ == "__main__":
    main()
