"""Random contours under cutter compensation."""

from __future__ import annotations

import math

import numpy as np


def contour(seed: int) -> bytes:
    """Lines and arcs of 0.03 to 30 mm with corners of all sizes, in G17 or G18; many cannot be cut."""
    rng = np.random.default_rng(seed)
    plane = "G18" if seed % 5 == 0 else "G17"
    (a, i), (b, j), third = (("Z", "K"), ("X", "I"), "Y") if plane == "G18" else (("X", "I"), ("Y", "J"), "Z")
    side = rng.choice(["G41", "G42"])
    on = side + rng.choice(
        [" D1", " D2", "", f".1 D{rng.uniform(1, 12):.3f}", f".1 D{rng.uniform(1, 12):.3f}"]
    )
    place = rng.uniform(8, 20, 2)
    lines = [f"G21 G90 {plane} G94 G54 F1000", "G0 X0 Y0 Z10", "G1 Z0"]
    lines.append(f"{on} G1 {a}{place[0]:.3f} {b}{place[1]:.3f}")
    heading = math.atan2(place[1], place[0])
    for _ in range(rng.integers(2, 7)):
        heading += rng.choice([0, rng.normal() * 0.02, rng.normal() * 0.3, rng.uniform(-1.8, 1.8)])
        if seed % 2 and rng.random() < 0.5:
            radius, sweep = 10 ** rng.uniform(0, 1.5), rng.uniform(0.1, 2.5) * rng.choice([-1, 1])
            away = radius * np.sign(sweep) * np.array([-math.sin(heading), math.cos(heading)])
            end = math.atan2(-away[1], -away[0]) + sweep
            place = place + away + radius * np.array([math.cos(end), math.sin(end)])
            code = "G3" if sweep > 0 else "G2"
            words = f"{i}{away[0]:.5f} {j}{away[1]:.5f}"
            lines.append(f"{code} {a}{place[0]:.5f} {b}{place[1]:.5f} {words}")
            heading += sweep
        else:
            place = place + 10 ** rng.uniform(-1.5, 1.5) * np.array([math.cos(heading), math.sin(heading)])
            lines.append(f"G1 {a}{place[0]:.5f} {b}{place[1]:.5f}")
            if rng.random() < 0.2:
                lines.append(f"G1 {third}{rng.uniform(-5, 5):.2f}")
    return "\n".join([*lines, "G40 G0 X0 Y0", "G0 Z50", "M2", ""]).encode()


def worn(seed: int) -> bytes:
    """A contour that a worn cutter can follow: lines of 12 to 40 mm, corners of up to 90 degrees, arcs that
    leave the cutter room, tangential or not, moves along the tool axis, and rapids along the contour."""
    rng = np.random.default_rng(seed)
    plane = "G18" if seed % 4 == 3 else "G17"
    (a, i), (b, j), third = (("Z", "K"), ("X", "I"), "Y") if plane == "G18" else (("X", "I"), ("Y", "J"), "Z")
    code, tool = rng.choice(["G41", "G42"]), int(rng.integers(1, 5))
    on = f"{code} D{tool}" if seed % 5 else f"{code}.1 D{rng.uniform(2, 10):.4f}"
    place, heading = rng.uniform(10, 20, 2), rng.uniform(0, 0.8)
    lines = [f"G21 G90 {plane} G94 G54 F1000", "G0 X0 Y0 Z10", "G1 Z0"]
    lines.append(f"{on} G1 {a}{place[0]:.4f} {b}{place[1]:.4f}")
    for _ in range(rng.integers(3, 8)):
        heading += rng.choice([0.0, rng.normal() * 0.01, rng.uniform(-1.5, 1.5)])
        if rng.random() < 0.4:
            radius, sweep = rng.uniform(12, 40), rng.uniform(0.7, 2.4) * rng.choice([-1, 1])
            away = radius * np.sign(sweep) * np.array([-math.sin(heading), math.cos(heading)])
            end = math.atan2(-away[1], -away[0]) + sweep
            place = place + away + radius * np.array([math.cos(end), math.sin(end)])
            word = f"{i}{away[0]:.5f} {j}{away[1]:.5f}"
            if rng.random() < 0.3:
                word = f"R{radius:.5f}"
            lines.append(f"{'G3' if sweep > 0 else 'G2'} {a}{place[0]:.5f} {b}{place[1]:.5f} {word}")
            heading += sweep
        else:
            place = place + rng.uniform(12, 40) * np.array([math.cos(heading), math.sin(heading)])
            lines.append(f"G1 {a}{place[0]:.5f} {b}{place[1]:.5f}")
            if rng.random() < 0.2:
                lines.append(f"G1 {third}{rng.uniform(-0.2, 0.2):.3f}")
    return "\n".join([*lines, "G40 G0 X0 Y0", "G0 Z50", "M2", ""]).encode()


def entered(seed: int) -> bytes:
    """A contour that an arc of 6 to 20 mm enters, flat or as a helix, with a straight move or an outside
    corner behind it."""
    rng = np.random.default_rng(seed)
    side, sense = rng.choice([1, -1]), rng.choice([1, -1])
    centre, radius = rng.uniform(-5, 5, 2), rng.uniform(6, 20)
    begin, sweep = rng.uniform(0, 2 * math.pi), sense * rng.uniform(0.5, 4.5)

    def on(angle: float) -> np.ndarray:
        return centre + radius * np.array([math.cos(angle), math.sin(angle)])

    start, end = on(begin), on(begin + sweep)
    heading = begin + sweep + sense * math.pi / 2
    corner = -side * rng.choice([0.0, rng.uniform(0.1, 1.2)])
    first = end + rng.uniform(12, 30) * np.array([math.cos(heading), math.sin(heading)])
    second = first + rng.uniform(12, 30) * np.array([math.cos(heading + corner), math.sin(heading + corner)])
    away = centre - start
    level = f" Z{rng.uniform(-3, 0):.3f}" if rng.random() < 0.4 else ""
    lines = [
        "G21 G90 G17 G94 G54 F1000",
        f"G0 X{start[0]:.5f} Y{start[1]:.5f} Z10",
        "G1 Z0",
        f"{'G41' if side > 0 else 'G42'}.1 D{rng.uniform(1, 8):.3f}",
        f"{'G3' if sense > 0 else 'G2'} X{end[0]:.5f} Y{end[1]:.5f} I{away[0]:.6f} J{away[1]:.6f}{level}",
        f"G1 X{first[0]:.5f} Y{first[1]:.5f}",
        f"X{second[0]:.5f} Y{second[1]:.5f}",
        "G40 G0 X60 Y60",
        "G0 Z50",
        "M2",
    ]
    return "\n".join([*lines, ""]).encode()
