"""A machine with a trunnion for LinuxCNC in lockstep, and how far its joints lead the tool from a program."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from judge.five_axis import Judge

MACHINE = """schema = "olp-machine-1"
name = "five"
chain = "C A Y F X Z"
controller = "linuxcnc"
calibration = "calibration.toml"
compensated_by_controller = []
[axes.X]
travel_mm = [-400.0, 400.0]
least_increment_mm = 0.000001
[axes.Y]
travel_mm = [-400.0, 400.0]
least_increment_mm = 0.000001
[axes.Z]
travel_mm = [-400.0, 400.0]
least_increment_mm = 0.000001
[axes.A]
kind = "rotary"
direction = [-1.0, 0.0, 0.0]
point_mm = [0.0, 4.0, -60.0]
travel_deg = [-120.0, 60.0]
least_increment_deg = 0.000001
[axes.C]
kind = "rotary"
direction = [0.0, 0.0, -1.0]
point_mm = [3.0, 0.0, -90.0]
travel_deg = [-360.0, 360.0]
least_increment_deg = 0.000001
[tools.1]
Z_mm = 80.0
gauge_to_tip_mm = [0.0, 0.0, -80.0]
[work_offsets.G54]
set_by = "true"
X_mm = 0.0
Y_mm = 0.0
Z_mm = 0.0
"""
CALIBRATION = """schema = "olp-calibration-1"
machine = "five"
measured = 2026-01-01
temperature_degC = 20.0
sign = "actual-minus-commanded"
model = "rigid-body"
box = { X_mm = [-400, 400], Y_mm = [-400, 400], Z_mm = [-400, 400], A_deg = [-120, 60], C_deg = [-360, 360] }
[location.A]
Y_um = 40.0
Z_um = -25.0
B_urad = 90.0
C_urad = -60.0
zero_urad = 120.0
[location.C]
X_um = -30.0
Y_um = 20.0
A_urad = 50.0
B_urad = -70.0
[location.Y]
C_urad = 80.0
[[cyclic]]
component = "ECC"
period_deg = 9.0
amplitude_urad = 60.0
phase_rad = 0.7
[[cyclic]]
component = "EXX"
period_mm = 10.0
amplitude_um = 6.0
"""


def off_path(
    judge: Judge, program: bytes, joints: np.ndarray, tips: bool, *, actual: bool = True
) -> np.ndarray:
    """(n, 2) mm and rad of the tool from the nearest nominal pose of a cut; `tips`: words state the tip."""
    places = [(cuts, np.nan_to_num(row)) for cuts, _, row in judge.read(program)]
    tip, axis = judge.forward(joints[::20], actual)
    best, found = np.full(len(tip), np.inf), np.zeros((len(tip), 2))
    for (_, begin), (cuts, end) in pairwise(places):
        if not cuts:
            continue
        low, high = np.zeros(len(tip)), np.ones(len(tip))

        def miss(share: np.ndarray, begin: np.ndarray = begin, end: np.ndarray = end) -> np.ndarray:
            place = begin + share[:, None] * (end - begin)
            if tips:
                there, along = place[:, :3], judge.forward(place, False)[1]
            else:
                # axis words count with the length of the tool
                there, along = judge.forward(place - [0.0, 0.0, judge.tool[2], 0.0, 0.0], False)
            away = np.linalg.norm(tip - there, axis=1)
            return np.stack([away, np.linalg.norm(np.cross(axis, along), axis=1)], axis=1)

        grid = [miss(np.full(len(tip), share)) for share in np.linspace(0.0, 1.0, 41)]
        near = np.argmin([np.hypot(one[:, 0], 100.0 * one[:, 1]) for one in grid], axis=0) / 40.0
        low, high = np.clip(near - 0.025, 0.0, 1.0), np.clip(near + 0.025, 0.0, 1.0)
        for _ in range(45):
            left, right = low + (high - low) / 3.0, high - (high - low) / 3.0
            costs = [np.hypot(*(miss(share) * [1.0, 100.0]).T) for share in (left, right)]
            low, high = np.where(costs[0] < costs[1], low, left), np.where(costs[0] < costs[1], right, high)
        one = miss(0.5 * (low + high))
        size = np.hypot(one[:, 0], 100.0 * one[:, 1])
        found[size < best] = one[size < best]
        best = np.minimum(best, size)
    return found
