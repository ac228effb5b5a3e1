"""One random machine with a random program for it: corrected, and judged by a computation of its own."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cases.any_machines import KINDS, five, wrist, write_machine
from cases.any_programs import (
    DIRECTED,
    FORMS,
    PLANES,
    VECTOR,
    listed,
    plane,
    program,
    read_by_judge,
    waypoints,
)
from cases.singular import near
from judge.whole_path import Whole, WholeTilted

import olp
from olp.core.errors import OlpError

#: Tolerances in mm and rad.
WITHIN = (1e-3, 2e-6)
LIST = "list"
DIGITS = (1e-3, 1e-4, 1e-6)


@dataclass(frozen=True)
class Told:
    """What came of one program: "right", "wrong", "said" or "refused", and the residual in tolerances."""

    what: str
    cost: float
    words: str


def forms_of(kind: str) -> list[str]:
    return [LIST, *FORMS, *PLANES] if KINDS[kind] in (five, wrist) else [LIST]


def last_digit(judge: Whole, place: np.ndarray, digit: float) -> tuple[float, float]:
    """mm and rad that half a last digit of every axis moves the tool."""
    moved = np.zeros(2)
    here = judge.poses(place[None], False)
    for column in range(len(place)):
        ahead = place.copy()
        ahead[column] += 0.01
        there = judge.poses(ahead[None], False)
        turned = np.linalg.norm(there[1] - here[1]) / np.sqrt(2.0)
        moved += np.array([np.linalg.norm(there[0] - here[0]), turned]) * (0.5 * digit / 0.01)
    return float(moved[0]), float(moved[1])


@dataclass(frozen=True)
class Case:
    """A random machine in a folder, whose last digits are `digit`, with a `text` that goes to `rows` of axis
    values, and the `judge` of both."""

    folder: Path
    judge: Whole
    payload: tuple[float, Any]
    rows: np.ndarray
    text: bytes
    digit: float

    def corrected(self) -> olp.JointCorrection:
        return olp.correct_joints(
            self.text, self.folder / "machine.toml", self.folder / "job.toml", tolerance_urad=2.0
        )


def case_of(
    folder: Path, kind: str, form: str, seed: int, *, play: bool, digit: float | None = None,
    singular: bool = False,
) -> Case:  # fmt: skip
    """One machine and one program for it, which passes near a `singular` posture where there is one."""
    rng = np.random.default_rng([seed, 5])
    drawn = float(rng.choice(DIGITS)) if form != LIST or seed % 3 == 0 else 1e-6
    digit = drawn if digit is None else digit
    control = {**FORMS, **PLANES}.get(form, "linuxcnc")
    made, payload = write_machine(folder, kind, seed, control=control, digit=digit, play=play)
    judge = Whole(folder / "machine.toml", payload, made.counts)
    rows = waypoints(made, rng, 5, judge if made.counts == "axis" else None)
    beside = near(made, judge, np.random.default_rng([seed, 7]), 6) if singular else None
    rows = rows if beside is None else beside
    job = folder / "job.toml"
    if form in PLANES:
        text = plane(form, judge, rows[3:4], rng)
    elif form == LIST:
        text = listed(made, rows)
    else:
        text, stated = program(form, judge, rows, rng)
        job.write_text(job.read_text("utf-8") + stated, "utf-8")
    return Case(folder, judge, payload, rows, text, digit)


def judged(kind: str, form: str, seed: int, *, play: bool, singular: bool = False) -> Told:
    """What comes of one machine and one program for it."""
    with tempfile.TemporaryDirectory() as name:
        case = case_of(Path(name), kind, form, seed, play=play, singular=singular)
        folder, judge, rows, text, digit = case.folder, case.judge, case.rows, case.text, case.digit
        try:
            done = case.corrected()
        except OlpError as error:
            return Told("refused", 0.0, str(error)[:180])
        mm, rad = last_digit(judge, rows[3], digit)
        if form != LIST:
            # rotary words are rounded first, and the linear ones meet the tip
            mm = digit * 0.5 * 3**0.5
            rad = 1e-7 if form in DIRECTED else rad
        within = (WITHIN[0] + mm, WITHIN[1] + rad)
        after = done.report["deviation"]["after"]
        said = f"stated {after['position_max_um']:.3f} um {after['orientation_max_urad']:.3f} urad"
        if form in PLANES:
            tilted = WholeTilted(folder / "machine.toml", case.payload)
            distance = tilted.judged(text, done.data)[0]
            found = (distance, 0.0, distance / within[0])
        else:
            judge.vector = form in VECTOR
            read = judge.values if form == LIST else judge.read
            texts = (text, done.data)
            if form != LIST:
                texts = tuple(read_by_judge(form, one, judge, rows[0]) for one in texts)
            first, second = (read(one) for one in texts)
            found = judge.whole_judged(first, second, within, 3)
            if found[2] > 1.1 and done.report["orientation"]["near_singular"]:
                # where a rest of the orientation is left, the nearest place is another one
                judge.counts = "tip"
                found = (judge.whole_judged(first, second, within, 3)[0], *found[1:])
    words = f"{found[0] * 1e3:.3f} um {found[1] * 1e6:.3f} urad, {said}, digit {digit:g}"
    if found[2] <= 1.1 and done.report["verdict"]["ok"]:
        return Told("right", found[2], words)
    bounded = done.report["orientation"]["near_singular"] and found[0] <= 1.1 * within[0]
    stated_all = after["position_max_um"] >= 0.9e3 * found[0] and not done.report["verdict"]["ok"]
    stated_all |= bool(bounded) and after["orientation_max_urad"] >= 0.9e6 * found[1]
    return Told("said" if stated_all else "wrong", found[2], words)
