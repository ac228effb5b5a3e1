"""The judge's warm machine: heat flows through lumps of a gantry, which grow and bend it; sensors see it
badly.

Bodies (room, base, beam top, beam bottom, column) exchange heat by lumped capacities, integrated in steps of
5 s by an explicit rule. The drives heat the beam from above, the room swings over the day. The temperatures
of the bodies, not of the sensors, act. The scale of X grows, the column leans and grows. The beam bends by
the difference of its top and bottom (bow alpha dT L^2 / 8 h, slope with it). A sensor lags its body by
minutes and has noise and an individual offset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ALPHA = 11.5e-6  # 1/K, steel
LENGTH = 2000.0  # mm
HEIGHT = 300.0  # mm
BODIES = ("base", "top", "bottom", "column")
STEP_S = 5.0
REFERENCE = 20.0


@dataclass(frozen=True)
class Day:
    """`time_s` every minute; `bodies` (n, 4) and `room` (n,) in degC."""

    time_s: np.ndarray
    bodies: np.ndarray
    room: np.ndarray


def day(seed: int, hours: float, swing: float, power: float) -> Day:
    """A day with a swinging room and drives that run and rest; begins at 20 degC all through."""
    rng = np.random.default_rng(seed)
    count = int(hours * 3600 / STEP_S)
    t = STEP_S * np.arange(count + 1)
    phase, period = rng.uniform(0, 2 * np.pi), rng.uniform(6, 10) * 3600
    room = REFERENCE + swing * (np.sin(2 * np.pi * t / period + phase) - np.sin(phase))
    runs = np.repeat(rng.random(int(hours) + 1) < 0.6, int(3600 / STEP_S))[: count + 1] * power
    lag = np.array([9000.0, 2400.0, 4200.0, 5400.0])  # s, to the room
    heat = np.array([0.0, 1.0, 0.35, 0.15]) / 2400.0  # K/s per unit of power
    state = np.full(4, REFERENCE)
    temperatures = np.empty((count + 1, 4))
    for i in range(count + 1):
        temperatures[i] = state
        flow = (room[i] - state) / lag + heat * runs[i]
        flow[1] += (state[2] - state[1]) / 6000.0
        flow[2] += (state[1] - state[2]) / 6000.0
        state = state + STEP_S * flow
    every = int(60 / STEP_S)
    return Day(t[::every], temperatures[::every], room[::every])


def errors(bodies: np.ndarray, x: np.ndarray) -> dict[str, np.ndarray]:
    """Component errors (n, m) in mm and rad at bodies (n, 4) and positions x (m,)."""
    rise = bodies - REFERENCE
    u = x - 0.5 * LENGTH
    scale = 0.5 * (rise[:, 1] + rise[:, 2])
    gradient = rise[:, 1] - rise[:, 2]
    curvature = ALPHA * gradient / HEIGHT
    lean = 0.4 * ALPHA * (rise[:, 3] - rise[:, 0])
    return {
        "EXX": np.outer(ALPHA * scale, u) + 60.0 * ALPHA * rise[:, :1],
        # a hot top lengthens: the middle rises, and the carriage pitches with the slope of the guide
        "EZX": np.outer(curvature, 0.5 * ((0.5 * LENGTH) ** 2 - u**2))
        + np.outer(lean, u)
        + 250.0 * ALPHA * rise[:, 3:],
        "EBX": np.outer(curvature, u) - lean[:, None] * np.ones_like(u),
    }


def sensed(day: Day, seed: int) -> dict[str, np.ndarray]:
    """What the sensors say: each a lag behind its body of minutes, an offset of tenths, noise of 0.05 K."""
    rng = np.random.default_rng(seed + 1000)
    lags = np.array([600.0, 240.0, 300.0, 420.0])
    offset = np.random.default_rng(99).normal(0.0, 0.1, 4)  # the sensors are the same
    sensors = {}
    step = float(day.time_s[1] - day.time_s[0])
    for i, name in enumerate(BODIES):
        value = day.bodies[0, i]
        seen = []
        for body in day.bodies[:, i]:
            value += (body - value) * (1.0 - np.exp(-step / lags[i]))
            seen.append(value)
        sensors[name] = np.array(seen) + offset[i] + rng.normal(0.0, 0.05, len(seen))
    return sensors
