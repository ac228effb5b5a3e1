"""Machines with rotary axes as files, with random errors, and programs for them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

#: By chain: directions and points of its rotary axes.
STRUCTURES: Mapping[str, Mapping[str, tuple[list[float], list[float]]]] = {
    "C A Y F X Z": {"A": ([-1, 0, 0], [0, 0, -180]), "C": ([0, 0, -1], [0, 0, -230])},
    "C B F X Y Z": {"B": ([0, -1, 0], [20, 0, -160]), "C": ([0, 0, -1], [20, 5, -200])},
    "C F X Y Z B": {"B": ([0, 1, 0], [0, 0, 220]), "C": ([0, 0, 1], [100, 0, -300])},
    "F X Y Z C B": {"C": ([0, 0, 1], [0, 0, 250]), "B": ([0, -1, 0], [0, 0, 250])},
    "F X Y Z C A": {"C": ([0, 0, 1], [0, 0, 250]), "A": ([0.6, 0, 0.8], [0, 0, 250])},
    "A F X Y Z": {"A": ([1, 0, 0], [0, 30, -100])},
}


def machine_file(
    folder: Path, chain: str, *, control: str = "linuxcnc", errors: bool = True, seed: int = 0, digit: float
    = 0.001, extra: str = "", calibration: str = "", offset: str = "",
) -> Path:  # fmt: skip
    """A machine of `STRUCTURES` with random errors; digits of 0.001 mm and deg."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(seed)
    rotary = STRUCTURES[chain]
    text = f'schema = "olp-machine-1"\nname = "m"\nchain = "{chain}"\ncontroller = "{control}"\n'
    text += (
        'calibration = "calibration.toml"\ntool_change_moves = false\ndecimal_point = "calculator"\n' + extra
    )
    for name in "XYZ":
        text += f"[axes.{name}]\ntravel_mm = [-900.0, 900.0]\nleast_increment_mm = {digit}\n"
    for name, (direction, point) in rotary.items():
        text += f'[axes.{name}]\nkind = "rotary"\ndirection = {direction}\npoint_mm = {point}\n'
        text += f"travel_deg = [-720.0, 720.0]\nleast_increment_deg = {digit}\n"
    text += f'[work_offsets.G54]\nset_by = "true"\n{offset}'
    text += "[tools.1]\ngauge_to_tip_mm = [0.0, 0.0, -120.0]\n[job_defaults]\ntool = 1\n"
    (folder / "machine.toml").write_text(text)
    box = ", ".join(f"{n}_mm = [-900, 900]" for n in "XYZ") + "".join(
        f", {n}_deg = [-720, 720]" for n in rotary
    )
    text = 'schema = "olp-calibration-1"\nmachine = "m"\nmeasured = 2026-11-01\ntemperature_degC = 20.0\n'
    text += f'sign = "actual-minus-commanded"\nmodel = "rigid-body"\nbox = {{ {box} }}\n'
    if errors:
        text += located(rng, rotary)
    (folder / "calibration.toml").write_text(text + calibration)
    return folder / "machine.toml"


def located(rng: np.random.Generator, rotary: Mapping[str, tuple[list[float], list[float]]]) -> str:
    """Location errors of all axes and harmonics of the own motion."""
    text = ""
    for name, (direction, _) in rotary.items():
        along = int(np.argmax(np.abs(direction)))
        text += f"[location.{name}]\nzero_urad = {rng.normal(0, 60):.3f}\n"
        straight = abs(direction[along]) == 1
        for k in range(3):
            if k != along or not straight:
                text += (
                    f"{'XYZ'[k]}_um = {rng.normal(0, 25):.3f}\n{'ABC'[k]}_urad = {rng.normal(0, 50):.3f}\n"
                )
    text += f"[location.Y]\nC_urad = {rng.normal(0, 40):.3f}\n"
    text += f"[location.Z]\nA_urad = {rng.normal(0, 40):.3f}\nB_urad = {rng.normal(0, 40):.3f}\n"
    for name in rotary:
        text += f'[[cyclic]]\ncomponent = "E{"ABC"["ABC".index(name)]}{name}"\nperiod_deg = 6.0\n'
        text += f"amplitude_urad = {rng.uniform(5, 30):.3f}\nphase_rad = {rng.uniform(0, 3):.3f}\n"
    text += '[[cyclic]]\ncomponent = "EXX"\nperiod_mm = 20.0\namplitude_um = 4.0\n'
    return text


def program(chain: str, *, seed: int = 0, moves: int = 6, tips: bool = False, small: bool = False) -> bytes:
    """A program of random moves of all axes, with words left out; `tips` in tool centre point control. Small
    moves are as a CAM system writes them."""
    rng = np.random.default_rng(seed)
    letters = ["X", "Y", "Z", *STRUCTURES[chain]]
    middle = {"X": 10.0, "Y": -20.0, "Z": 30.0, "A": -25.0, "B": 20.0, "C": 40.0}
    spread = {"X": 60.0, "Y": 60.0, "Z": 40.0, "A": 15.0, "B": 15.0, "C": 60.0}
    lines = ["G21 G90 G54", "G0 " + " ".join(f"{name}0." for name in letters)]
    start = " ".join(f"{name}{middle[name]:.3f}" for name in letters)
    lines.append(f"G43.4 H1 {start}" if tips else f"G0 {start}")
    place = dict(middle)
    for number in range(moves):
        words = []
        for name in letters:
            if rng.random() < 0.75:
                step = 0.02 if small else 1.0
                place[name] += step * spread[name] * rng.uniform(-0.5, 0.5) * (0.3 if not small else 1.0)
                words.append(f"{name}{place[name]:.3f}")
        if words:
            lines.append(("G1 " if not number else "") + " ".join(words) + (" F500." if not number else ""))
    lines += ["G0 Z150."] + (["G49"] if tips else []) + ["M30"]
    return ("\n".join(lines) + "\n").encode()
