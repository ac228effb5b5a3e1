"""Path of a coordinate measuring machine over a gearbox housing of 500 x 700 mm, top face at Z0.

    python programs/make/cmm_path.py > programs/bridge-cmm/housing.ngc

Touch points on the top face, scan lines over a crowned sealing face, bores scanned as circles and as helices,
and points on a side wall with the star stylus. The path is that of the ball centre; the control triggers and
latches by itself, so the program holds plain moves only.
"""

import math
from collections.abc import Iterator

BALL_MM = 1.5
STAR_BALL_MM = 1.0
APPROACH_MM = 4.0
OVERTRAVEL_MM = 0.3


def touch_grid() -> Iterator[str]:
    """Top face, 7 x 9 points in serpentine order: down to just below the face, and back."""
    yield "(TOP FACE, 7 X 9 POINTS)"
    for row in range(9):
        y = 30.0 + 80.0 * row
        columns = range(7) if row % 2 == 0 else range(6, -1, -1)
        for column in columns:
            yield f"G0 X{20.0 + 75.0 * column:.4f} Y{y:.4f}"
            yield f"G0 Z{BALL_MM + APPROACH_MM:.4f}"
            yield f"G1 Z{BALL_MM - OVERTRAVEL_MM:.4f} F240"
            yield f"G1 Z{BALL_MM + APPROACH_MM:.4f} F1800"
        yield "G0 Z20.0000"


def scan_lines() -> Iterator[str]:
    """Sealing face, crowned by 0.6 mm both ways; the ball centre runs a radius off along the normal."""
    yield "(SEALING FACE, 6 SCAN LINES)"
    x_low, x_high, pitch = 60.0, 440.0, 2.0
    count = round((x_high - x_low) / pitch)
    for line in range(6):
        y = 110.0 + 12.5 * line
        steps = range(count + 1) if line % 2 == 0 else range(count, -1, -1)
        for nth, step in enumerate(steps):
            x = x_low + pitch * step
            u, v = (x - 250.0) / 190.0, (y - 141.25) / 31.25
            slope_x, slope_y = -1.2 * u / 190.0, -1.2 * v / 31.25
            length = math.sqrt(1 + slope_x**2 + slope_y**2)
            cx = x - BALL_MM * slope_x / length
            cy = y - BALL_MM * slope_y / length
            cz = 0.6 * (2 - u * u - v * v) + BALL_MM / length
            if nth == 0:
                yield f"G0 X{cx:.4f} Y{cy:.4f}"
                yield f"G0 Z{cz + APPROACH_MM:.4f}"
                yield f"G1 Z{cz:.4f} F240"
                yield "F600"
            else:
                yield f"X{cx:.4f} Y{cy:.4f} Z{cz:.4f}"
        yield "G0 Z20.0000"


def bore(x: float, y: float, diameter: float) -> Iterator[str]:
    """Circles at three depths, then a helix back up, with the ball on the wall."""
    radius = diameter / 2 - BALL_MM
    yield f"(BORE {diameter:.3f} AT X{x:.3f} Y{y:.3f})"
    yield f"G0 X{x:.4f} Y{y:.4f}"
    yield "G0 Z5.0000"
    for depth in (-8.0, -20.0, -32.0):
        yield f"G1 Z{depth:.4f} F1200"
        yield f"G1 X{x + radius:.4f} F300"
        yield f"G3 X{x + radius:.4f} Y{y:.4f} I{-radius:.4f} J0.0000 F480"
        yield f"G1 X{x:.4f} F1800"
    yield f"G1 X{x + radius:.4f} F300"
    yield f"G3 X{x + radius:.4f} Y{y:.4f} Z-8.0000 I{-radius:.4f} J0.0000 P6 F480"
    yield f"G1 X{x:.4f} F1800"
    yield "G0 Z20.0000"


def side_wall() -> Iterator[str]:
    """The wall X = 0 from outside, 12 points at two heights, with the star stylus whose arm looks to +X."""
    yield "(SIDE WALL X0, STAR STYLUS)"
    yield "G0 X-25.0000 Y40.0000"
    for z in (-15.0, -35.0):
        yield f"G0 Z{z:.4f}"
        for point in range(6):
            yield f"G0 Y{40.0 + 124.0 * point:.4f}"
            yield f"G0 X{-STAR_BALL_MM - APPROACH_MM:.4f}"
            yield f"G1 X{-STAR_BALL_MM + OVERTRAVEL_MM:.4f} F240"
            yield f"G1 X{-STAR_BALL_MM - APPROACH_MM:.4f} F1800"
            yield "G0 X-25.0000"
    yield "G0 Z60.0000"


def program() -> Iterator[str]:
    yield "(GEARBOX HOUSING, UPPER HALF)"
    yield "G21 G17 G90 G94 G40 G49 G80"
    yield "G61.1"
    yield "G54"
    yield "T1 M6"
    yield "G43 H1"
    yield "G0 X0.0000 Y0.0000 Z60.0000"
    yield "G0 Z20.0000"
    yield from touch_grid()
    yield from scan_lines()
    yield from bore(130.0, 400.0, 90.0)
    yield from bore(360.0, 430.0, 120.0)
    yield "G0 Z120.0000"
    yield "T2 M6"
    yield "G43 H2"
    yield "G0 X-25.0000 Y0.0000 Z60.0000"
    yield from side_wall()
    yield "M2"


if __name__ == "__main__":
    print("\n".join(program()))
