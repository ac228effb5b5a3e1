"""The programs of the machines with rotary joints: trunnion mill, gantry with wrist, arm, hexapod.

    python programs/make/joint_jobs.py

The first two are programs with tool centre point control, the last two lists of axis values. Those come from
poses by the nominal inverse of the machine files beside them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import olp
from olp.kinematics.inverse import inverse
from olp.kinematics.poses import Poses, tilts

PROGRAMS = Path(__file__).resolve().parents[1]
#: The dome of the trunnion mill: radius, and the height of its centre above the zero of the part, mm.
DOME_MM, CENTRE_MM = 40.0, -10.0


def dome() -> Iterator[str]:
    """Rings on a dome with the tool 8 deg off its normal, then four slots with the table clamped."""
    yield from ("%", "O5100 (DOME, TRUNNION A C)", "(T1 BALL END MILL 8 MM)")
    yield from ("G21 G90 G17 G94 G54", "G0 X0. Y0. Z80. A0. C0.")
    yield "G43.4 H1 X0. Y0. Z60. A0. C0."
    for ring, polar in enumerate((10.0, 22.0, 34.0, 46.0)):
        tilt = polar - 8.0
        yield f"(RING AT {polar:g} DEG)"
        for step in range(25):
            turn = 15.0 * step
            angle, slope = math.radians(turn), math.radians(polar)
            x = DOME_MM * math.sin(slope) * math.sin(angle)
            y = -DOME_MM * math.sin(slope) * math.cos(angle)
            z = CENTRE_MM + DOME_MM * math.cos(slope)
            if step == 0:
                yield f"G0 X{x:.3f} Y{y:.3f} Z{z + 20.0:.3f} A{-tilt:.3f} C{turn:.3f}"
                yield f"G1 Z{z:.3f} F{600 if ring == 0 else 900}"
            else:
                yield f"X{x:.3f} Y{y:.3f} C{turn:.3f}"
        yield "G0 Z60."
        yield "C0."
    yield from ("G49", "G0 X0. Y0. Z150.")
    for turn in (0.0, 90.0, 180.0, 270.0):
        yield f"(SLOT AT C {turn:g})"
        yield f"G0 A-60. C{turn:.3f}"
        yield from ("G0 X-12. Y-20. Z60.", "G1 Z5. F400", "X12. F700", "Y-24.", "X-12.", "G0 Z150.")
    yield from ("G0 A0. C0.", "M30", "%")


def trim() -> Iterator[str]:
    """The edge of a panel bent about Y, trimmed with the tool along its normal."""
    yield from ("; TRIM OF A BENT PANEL, GANTRY WITH WRIST C B", "G71 G90 G17 G94 G54", "T1 D1 M6")
    yield from ("G0 X800 Y500 Z-100 C0 B0", "TRAORI", "ORIAXES")
    length, width, bend = 700.0, 420.0, 900.0
    sides = (((-1, -1), (1, -1)), ((1, -1), (1, 1)), ((1, 1), (-1, 1)), ((-1, 1), (-1, -1)))
    first = True
    for (x0, y0), (x1, y1) in sides:
        for step in range(9):
            if step == 0 and not first:
                continue
            u = (x0 + (x1 - x0) * step / 8.0) * length / 2.0
            v = (y0 + (y1 - y0) * step / 8.0) * width / 2.0
            slope = math.asin(u / bend)
            z = bend * (math.cos(slope) - 1.0)
            word = f"X{800.0 + u:.3f} Y{500.0 + v:.3f} Z{z - 400.0:.3f} C0 B={-math.degrees(slope):.3f}"
            if first:
                yield f"G0 X{800.0 + u:.3f} Y{500.0 + v:.3f} Z-300 C0 B={-math.degrees(slope):.3f}"
                yield f"G1 {word} F1200"
                first = False
            else:
                yield f"{word} F3000"
    yield from ("G0 Z-200", "TRAFOOF", "G0 X800 Y500 Z-100 C0 B0", "M30")


def listed(name: str, poses: Poses, start: np.ndarray, decimals: int) -> Iterator[str]:
    """Rows of axis values that bring the nominal tool to poses one after the other."""
    machine = olp.load_kinematics(PROGRAMS / name / "machine.toml")
    structure = machine.structure
    yield ",".join(f"{axis}_{unit}" for axis, unit in zip(structure.order, structure.units, strict=True))
    near = start
    for rotation, position in zip(poses.rotation, poses.position, strict=True):
        near = inverse(machine, Poses(rotation[None], position[None]), near, nominal=True).values
        yield ",".join(f"{value:.{decimals}f}" for value in near[0].tolist())


def deburr() -> Iterator[str]:
    """An oval on a plane that leans 20 deg toward the arm, with the spindle square to it."""
    angle = np.radians(np.linspace(0.0, 360.0, 97))
    flat = np.column_stack((120.0 * np.cos(angle), 180.0 * np.sin(angle), 0.0 * angle))
    lean = tilts(np.radians([[0.0, -20.0, 0.0]]))[0]
    # the spindle's Z points out of the part, the gauge's Z along the flange
    square = lean @ tilts(np.radians([[180.0, 0.0, 0.0]]))[0]
    poses = Poses(np.broadcast_to(square, (len(angle), 3, 3)), [620.0, 0.0, 350.0] + flat @ lean.T)
    yield from listed("arm-payload", poses, np.array([[0.0, -60.0, 90.0, 0.0, 60.0, 0.0]]), 4)


def lens() -> Iterator[str]:
    """A spiral on a shallow sphere, with the platform square to it."""
    share = np.linspace(0.0, 1.0, 121)
    angle, radius = np.radians(3.0 * 360.0 * share), 60.0 * share
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    sphere = 400.0
    z = np.sqrt(sphere**2 - radius**2) - sphere
    tilt = np.column_stack((-np.arcsin(y / sphere), np.arcsin(x / sphere), 0.0 * angle))
    poses = Poses(tilts(tilt), np.column_stack((x, y, 700.0 + z)))
    yield from listed("hexapod", poses, np.full((1, 6), 880.0), 4)


def main() -> None:
    texts = {
        "trunnion-mill/dome.nc": dome(),
        "gantry-wrist/trim.mpf": trim(),
        "arm-payload/deburr.csv": deburr(),
        "hexapod/lens.csv": lens(),
    }
    for name, lines in texts.items():
        (PROGRAMS / name).write_text("".join(f"{line}\n" for line in lines), "utf-8", newline="\n")


if __name__ == "__main__":
    main()
