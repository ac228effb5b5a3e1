"""Random machines of every structure as files, with random errors of all sources."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

UNITS: Mapping[str, Any] = {"A": (1.0, 0.0, 0.0), "B": (0.0, 1.0, 0.0), "C": (0.0, 0.0, 1.0)}
OWN = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}


@dataclass
class Axis:
    """One axis: its kind, direction and point, and its travel in mm or deg."""

    kind: str
    direction: np.ndarray | None = None
    point: np.ndarray | None = None
    travel: tuple[float, float] = (-900.0, 900.0)
    correct: bool = True

    @property
    def unit(self) -> str:
        return "deg" if self.kind == "rotary" else "mm"


@dataclass
class Made:
    """A machine: its chain, axes and platforms; what a correction meets ("tip", "turn", "axis" or "pose");
    axis values in the middle of its work, and how far programs go from there."""

    chain: list[str]
    axes: dict[str, Axis]
    counts: str
    middle: Mapping[str, float]
    reach: Mapping[str, float]
    gauge: tuple[Any, Any] | None = None
    tip: Any = (0.0, 0.0, -120.0)
    platforms: dict[str, dict[str, Any]] = field(default_factory=dict)
    start: Any = None
    #: axis values of a shift and a turn of the platform, where the axes are not free
    legs: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None


def rotary(direction: Any, point: Any, span: float = 720.0, **more: Any) -> Axis:
    size = np.array(direction, float)
    return Axis("rotary", size / np.linalg.norm(size), np.array(point, float).round(3), (-span, span), **more)


def linear(direction: Any, low: float = -900.0, high: float = 900.0, **more: Any) -> Axis:
    return Axis("linear", np.array(direction, float), None, (low, high), **more)


def five(rng: np.random.Generator, kind: str) -> Made:
    """X, Y, Z in any order on both sides of the frame, and two rotary axes: on tables, heads or both; of
    nutating ones, one axis is oblique."""
    pair = [("A", "C"), ("B", "C"), ("A", "B"), ("C", "A"), ("C", "B")][rng.integers(5)]
    letters = list(rng.permutation(list("XYZ")))
    cut = int(rng.integers(0, 4))
    lines = {name: np.array(UNITS[name]) * rng.choice([-1.0, 1.0]) for name in pair}
    tables = {"table/table": 2, "head/head": 0, "table/head": 1}.get(kind, 0)
    if kind.startswith("nutating"):
        tables = 2 if kind == "nutating table" else 0
        lean = pair[1] if pair[0] == "C" else pair[0]
        other = pair[0] if lean == pair[1] else pair[1]
        angle = np.radians(rng.choice([45.0, 30.0, 50.0]))
        lines[lean] = np.cos(angle) * np.array(UNITS[lean]) + np.sin(angle) * np.array(UNITS[other])
    before, after = letters[:cut], letters[cut:]
    carried, led = list(pair[:tables]), list(pair[tables:])
    if abs(lines[pair[1]][2]) == 1.0:
        # the axis next to the tool would turn about it
        pair = (pair[1], pair[0])
        carried, led = list(pair[:tables]), list(pair[tables:])
    if len(carried) == 2 and before and rng.random() < 0.3:
        before = [carried[0], before[0], carried[1], *before[1:]]
    else:
        before = [*carried, *before]
    axes = {name: linear(OWN[name]) for name in "XYZ"}
    for name in pair:
        point = rng.uniform(-200, 200, 3) if name in carried else [*rng.uniform(-30, 30, 2), 180.0]
        axes[name] = rotary(lines[name], point)
    made = Made([*before, "F", *after, *led], axes, "axis", {}, {})
    made.tip = (0.0, 0.0, -float(rng.integers(60, 250)))
    made.reach = dict.fromkeys("XYZ", 25.0) | dict.fromkeys(pair, 8.0)
    made.middle = dict(zip(axes, [*rng.uniform(-60, 60, 3), *rng.uniform(-60, 60, 2)], strict=True))
    return made


def wrist(rng: np.random.Generator, _: str) -> Made:
    """A gantry with a wrist of two axes that meet."""
    height, second = rng.uniform(150, 400), rng.choice(["A", "B"])
    axes = {name: linear(OWN[name], -4000.0, 4000.0) for name in "XYZ"}
    axes["C"] = rotary((0, 0, rng.choice([-1, 1])), (0, 0, height))
    axes[second] = rotary(rng.choice([-1, 1]) * np.array(UNITS[second]), (0, 0, height))
    middle = {"X": rng.uniform(-1500, 1500), "Y": rng.uniform(-1500, 1500), "Z": 100.0}
    middle |= {"C": rng.uniform(-90, 90), second: rng.choice([-1, 1]) * rng.uniform(20, 70)}
    reach = dict.fromkeys("XYZ", 80.0) | {"C": 15.0, second: 10.0}
    return Made(["F", *rng.permutation(list("XYZ")), "C", second], axes, "axis", middle, reach)


def six_of_gantry(rng: np.random.Generator, _: str) -> Made:
    """A gantry with a wrist of three axes, none of which meet."""
    axes = {name: linear(OWN[name]) for name in "XYZ"}
    axes["C"] = rotary((0, 0, 1), (40.0, 9.0, 0.0))
    axes["A"] = rotary((1, 0, 0), (0.0, 5.0, 250.0))
    axes["B"] = rotary((0, -1, 0), (8.0, 0.0, 220.0))
    middle = {"X": 10.0, "Y": -20.0, "Z": 50.0, "C": 30.0, "A": rng.uniform(10, 40), "B": rng.uniform(10, 40)}
    return Made(list("CFXYZAB"), axes, "axis", middle, dict.fromkeys("XYZ", 25.0) | dict.fromkeys("CAB", 8.0))


def polar(rng: np.random.Generator, _: str) -> Made:
    out, high = rng.uniform(450, 700), rng.uniform(400, 600)
    axes = {"R": rotary((0, 0, 1), (0, 0, 0)), "H": linear((0, 0, 1)), "L": linear((1, 0, 0))}
    axes["W"] = rotary((1, 0, 0), (out, 0, high), correct=False)
    middle = {"R": rng.uniform(-90, 90), "H": 200.0, "L": 150.0, "W": rng.uniform(-90, 90)}
    reach = {"R": 10.0, "H": 50.0, "L": 50.0, "W": 10.0}
    return Made(["F", "R", "H", "L", "W"], axes, "tip", middle, reach, ((out, 0, high), 90.0), (0, 0, 80.0))


def scara(rng: np.random.Generator, _: str) -> Made:
    one, two = rng.uniform(200, 400), rng.uniform(180, 350)
    axes = {"J1": rotary((0, 0, 1), (0, 0, 0)), "J2": rotary((0, 0, 1), (one, 0, 0))}
    axes |= {
        "J3": linear((0, 0, -1), 0.0, 400.0),
        "J4": rotary((0, 0, rng.choice([-1, 1])), (one + two, 0, 0)),
    }
    middle = {
        "J1": rng.uniform(-60, 60),
        "J2": rng.choice([-1, 1]) * rng.uniform(40, 100),
        "J3": 150.0,
        "J4": 20.0,
    }
    reach = {"J1": 8.0, "J2": 8.0, "J3": 40.0, "J4": 15.0}
    gauge = ((one + two, 0, 50.0), 180.0)
    return Made(["F", *axes], axes, "turn", middle, reach, gauge, (0, 0, 60.0))


def arm(rng: np.random.Generator, kind: str) -> Made:
    """Six axes whose wrist meets in a point or not; or seven on a track."""
    up, along, down = rng.uniform(300, 500), rng.uniform(350, 500), rng.uniform(300, 500)
    axes: dict[str, Axis] = {}
    if kind == "arm 7 on a track":
        axes["E1"] = linear((1, 0, 0), -2000.0, 2000.0, correct=False)
        heights = np.cumsum([0.0, up, 0.0, along, 0.0, down, 126.0])
        for k, height in enumerate(heights):
            line = ((0, 0, 1), (0, (1, -1)[k == 3], 0))[k % 2]
            axes[f"J{k + 1}"] = rotary(line, (0, 0, height), 360.0)
        gauge = ((0, 0, heights[-1]), 0.0)
        angles = [rng.uniform(-60, 60), 30.0, 20.0, rng.choice([-1, 1]) * 60.0, 25.0, 50.0, 10.0]
    else:
        off = rng.uniform(-8, 8, (6, 3)) if kind == "arm 6 with offsets" else np.zeros((6, 3))
        foot, rise = rng.uniform(0, 60), rng.uniform(-30, 60)
        places = np.array(
            [(0, 0, up), (foot, 0, up), (foot, 0, up + along), (foot + 90, 0, up + along + rise),
             (foot + down, 0, up + along + rise), (foot + down + 80, 0, up + along + rise)]
        )  # fmt: skip
        lines = ((0, 0, -1), (0, 1, 0), (0, 1, 0), (-1, 0, 0), (0, 1, 0), (-1, 0, 0))
        for k, (line, place) in enumerate(zip(lines, places + off, strict=True)):
            axes[f"J{k + 1}"] = rotary(line, place, 360.0)
        gauge = (tuple(places[5]), 90.0)
        angles = [rng.uniform(-60, 60), 20.0, 30.0, rng.uniform(-60, 60), rng.choice([-1, 1]) * 50.0, 10.0]
    names = [name for name in axes if name != "E1"]
    middle = dict(zip(names, angles, strict=True)) | ({"E1": 300.0} if "E1" in axes else {})
    reach = dict.fromkeys(names, 5.0) | {"E1": 60.0}
    return Made(["F", *axes], axes, "pose", middle, reach, gauge, (20.0, -30.0, 120.0))


def around(radius: float, angle_deg: float) -> np.ndarray:
    return radius * np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg)), 0.0])


def legged(rng: np.random.Generator, kind: str) -> Made:
    """Platforms: a hexapod, a tripod that does not turn, and deltas with six rods on carriages or arms."""
    legs: list[dict[str, Any]] = []
    axes: dict[str, Axis] = {}
    size, end = rng.uniform(250, 450), rng.uniform(80, 200)
    rod, height = rng.uniform(320, 420), 0.0
    for k in range(3 if kind == "tripod" else 6):
        third = 120.0 * (k // 2)
        if kind == "hexapod":
            outer, inner = third + (-15, 15)[k % 2], 120.0 * ((k + 1) // 2) - 60 + (15, -15)[k % 2]
            leg = {
                "base": around(size, outer),
                "platform": around(end, inner),
                "axis": f"L{k + 1}",
                "rod": 0.0,
            }
        elif kind == "tripod":
            leg = {"base": around(size, 120.0 * k + 7), "platform": around(30.0, 120.0 * k + 7)}
            leg |= {"axis": f"L{k + 1}", "rod": 0.0}
        else:
            beside = around(25.0 * (1, -1)[k % 2], third + 90)
            base = around(170.0 if kind == "linear delta" else 100.0 + 120.0, third) + beside
            leg = {"base": base, "platform": around(40.0, third) + beside, "carriage": f"T{k // 2 + 1}"}
            leg["rod"] = rod
        legs.append(leg)
    if kind in ("hexapod", "tripod"):
        axes = {leg["axis"]: Axis("length", None, None, (50.0, 1500.0)) for leg in legs}
        height = rng.uniform(350, 500)
    elif kind == "linear delta":
        axes = {f"T{k + 1}": linear((0, 0, 1), -500.0, 900.0) for k in range(3)}
        height = -rng.uniform(150, 250)
    else:
        for k in range(3):
            line = np.cross(around(1.0, 120.0 * k), (0, 0, 1))
            axes[f"T{k + 1}"] = rotary(line, around(100.0, 120.0 * k), 80.0)
        height = -np.sqrt(rod**2 - 175.0**2) - rng.uniform(10, 40)
    platform = {"legs": legs, "fixed": kind == "tripod"}
    counts = "pose" if kind == "hexapod" else "tip"
    tip = (0.0, 0.0, 60.0)
    made = Made(["F", "P"], axes, counts, {}, {}, None, tip, {"P": platform}, (0.0, 0.0, height))

    def lengths(shift: np.ndarray, turn: np.ndarray) -> np.ndarray:
        at = [turn @ leg["platform"] + shift for leg in legs]
        if kind in ("hexapod", "tripod"):
            return np.array([np.linalg.norm(p - leg["base"]) for p, leg in zip(at, legs, strict=True)])
        if kind == "linear delta":
            away = [p - leg["base"] for p, leg in zip(at[::2], legs[::2], strict=True)]
            return np.array([v[2] + np.sqrt(rod**2 - v[0] ** 2 - v[1] ** 2) for v in away])
        found = []
        for k, leg in enumerate(legs[::2]):
            axis = axes[f"T{k + 1}"]
            arm_, to = leg["base"] - axis.point, at[2 * k] - axis.point
            # cos and sin of the turn that brings the end of the arm to the length of the rod
            flat = arm_ - axis.direction * (axis.direction @ arm_)
            a, b = flat @ to, np.cross(axis.direction, flat) @ to
            along = (axis.direction @ arm_) * (axis.direction @ to)
            right = (arm_ @ arm_ + to @ to - rod**2) / 2 - along
            both = np.arctan2(b, a) + np.array([-1.0, 1.0]) * np.arccos(right / np.hypot(a, b))
            both = np.degrees((both + np.pi) % (2 * np.pi) - np.pi)
            found.append(both[np.argmin(np.abs(both))])
        return np.array(found)

    made.legs = lengths
    return made


KINDS: Mapping[str, Callable[[np.random.Generator, str], Made]] = {
    **dict.fromkeys(("table/table", "head/head", "table/head", "nutating table", "nutating head"), five),
    "gantry with wrist": wrist, "six axes": six_of_gantry, "polar": polar, "scara": scara,
    **dict.fromkeys(("arm 6", "arm 6 with offsets", "arm 7 on a track"), arm),
    **dict.fromkeys(("linear delta", "rotary delta", "tripod", "hexapod"), legged),
}  # fmt: skip


def numbers(values: Any) -> str:
    return "[" + ", ".join(f"{float(value):.9f}" for value in values) + "]"


def machine_text(made: Made, control: str, digit: float, gravity: Any) -> str:
    text = (
        f'schema = "olp-machine-1"\nname = "m"\nchain = "{" ".join(made.chain)}"\ncontroller = "{control}"\n'
    )
    text += 'calibration = "calibration.toml"\ndecimal_point = "calculator"\n[kinematics]\n'
    text += f'tool_symmetry = "{"axis" if made.counts == "axis" else "none"}"\ngravity = {numbers(gravity)}\n'
    text += 'tcp_frame_zero = "axis-zero"\n' if made.counts == "axis" else ""
    for name, axis in made.axes.items():
        text += f'[axes.{name}]\nkind = "{axis.kind}"\ntravel_{axis.unit} = {numbers(axis.travel)}\n'
        text += f"least_increment_{axis.unit} = {digit:.9f}\n"
        if axis.direction is not None and name not in OWN:
            text += f"direction = {[float(v) for v in axis.direction]}\n"
        text += f"point_mm = {numbers(axis.point)}\n" if axis.point is not None else ""
        text += "" if axis.correct else "correct = false\n"
    for name, platform in made.platforms.items():
        text += f"[platforms.{name}]\nstart_mm = {numbers(made.start)}\n"
        text += 'orientation = "fixed"\n' if platform["fixed"] else ""
        for leg in platform["legs"]:
            text += f"[[platforms.{name}.legs]]\nbase_mm = {numbers(leg['base'])}\n"
            text += f"platform_mm = {numbers(leg['platform'])}\nlength_mm = {leg['rod']:.9f}\n"
            holder = "axis" if "axis" in leg else "carriage"
            text += f'{holder} = "{leg[holder]}"\n'
    if made.gauge:
        text += f"[gauge]\npoint_mm = {numbers(made.gauge[0])}\nB_deg = {made.gauge[1]}\n"
    text += '[work_offsets.G54]\nset_by = "true"\n' if made.counts == "axis" else ""
    return text + f"[tools.1]\ngauge_to_tip_mm = {numbers(made.tip)}\n[job_defaults]\ntool = 1\n"


def located(name: str, axis: Axis, size: float, rng: np.random.Generator) -> str:
    """Where the line of an axis really is, harmonics of its motion, and its play."""
    text = f"[location.{name}]\n"
    if axis.kind == "rotary":
        text += f"zero_urad = {rng.normal(0, 60) * size:.3f}\n"
        text += "".join(f"{letter}_um = {rng.normal(0, 25) * size:.3f}\n" for letter in across(axis, "XYZ"))
    else:
        text += f"zero_um = {rng.normal(0, 20) * size:.3f}\n"
    if axis.direction is not None:
        text += "".join(f"{letter}_urad = {rng.normal(0, 50) * size:.3f}\n" for letter in across(axis, "ABC"))
    period, unit = (rng.choice([3.0, 6.0, 12.0]), "urad") if axis.kind == "rotary" else (10.0, "um")
    text += f'[[cyclic]]\ncomponent = "E{name}{name}"\nperiod_{axis.unit} = {period}\n'
    return text + f"amplitude_{unit} = {rng.uniform(1, 8):.3f}\nphase_rad = {rng.uniform(-3, 3):.3f}\n"


def across(axis: Axis, letters: str) -> str:
    """The letters of directions that are not along the axis."""
    assert axis.direction is not None
    return "".join(a for a, part in zip(letters, axis.direction, strict=True) if abs(part) < 1 - 1e-9)


def curve(folder: Path, name: str, axis: Axis, rng: np.random.Generator) -> str:
    """Six error motions of an axis, and how they were read."""
    low, high = axis.travel
    value = np.linspace(low, high, 181)
    wave = np.radians(value) if axis.kind == "rotary" else value / rng.uniform(80, 250)
    turns = rng.integers(1, 3, 6) if axis.kind == "rotary" else np.ones(6)
    rows = rng.uniform(2, 12, 6) * np.sin(wave[:, None] * turns + rng.uniform(0, 6, 6))
    own = "urad" if axis.kind == "rotary" else "um"
    head, columns = [f"{name}_{axis.unit}", f"E{name}{name}_{own}"], [value, rows[:, 0]]
    if axis.kind != "length":
        assert axis.direction is not None
        parts = zip("XYZABC", [*np.zeros(3), *np.abs(axis.direction)], rows.T[::-1], strict=True)
        for letter, along, row in parts:
            own_again = axis.kind == "rotary" and along > 1 - 1e-9
            if not own_again and f"E{letter}{name}" != f"E{name}{name}":
                head.append(f"E{letter}{name}_{'urad' if letter in 'ABC' else 'um'}")
                columns.append(row)
    np.savetxt(
        folder / f"{name}.csv", np.column_stack(columns), "%.6f", ",", header=",".join(head), comments=""
    )
    how = rng.choice(["linear", "pchip"])
    text = f'[[curves]]\nfile = "{name}.csv"\ninterpolation = "{how}"\n'
    if axis.kind == "rotary" or rng.random() < 0.5:
        return text + (f"point_mm = {numbers(rng.uniform(-90, 90, 3))}\n" if axis.kind != "length" else "")
    if name in "XYZ":
        return text + f"tool_mm = {numbers(rng.uniform(-90, 90, 3))}\n"
    return text


def calibration_text(folder: Path, made: Made, rng: np.random.Generator, *, play: bool) -> str:
    text = 'schema = "olp-calibration-1"\nmachine = "m"\nmeasured = 2026-11-01\ntemperature_degC = 20.0\n'
    box = ", ".join(f"{n}_{a.unit} = {numbers(a.travel)}" for n, a in made.axes.items())
    text += f'sign = "actual-minus-commanded"\nmodel = "rigid-body"\nbox = {{ {box} }}\n'
    size = 3.0 if made.counts == "pose" and not made.platforms else 1.0
    for name, axis in made.axes.items():
        text += located(name, axis, size, rng) + curve(folder, name, axis, rng)
    for name, platform in made.platforms.items():
        for number in range(len(platform["legs"])):
            text += (
                f'[[legs]]\nplatform = "{name}"\nleg = {number + 1}\nlength_um = {rng.normal(0, 30):.3f}\n'
            )
            text += (
                f"base_um = {numbers(rng.normal(0, 40, 3))}\nplatform_um = {numbers(rng.normal(0, 30, 3))}\n"
            )
    hung = hanging(made, rng)
    text += "".join(hung.values())
    if not made.platforms:
        for name, axis in made.axes.items():
            if name in hung:
                # its springs and what it carries would count twice
                continue
            own = "own_urad_Nm" if axis.kind == "rotary" else "own_um_kN"
            text += f"[elasticity.{name}]\n{own} = {rng.uniform(0.1, 0.8):.3f}\n"
            text += f"{rng.choice(list('ABC'))}_urad_Nm = {rng.uniform(0.02, 0.2):.3f}\n"
            text += f"{rng.choice(list('XYZ'))}_um_kN = {rng.uniform(1, 9):.3f}\n"
            if rng.random() < 0.6:
                text += f'[[masses]]\non = "{name}"\nkg = {rng.uniform(5, 60):.2f}\n'
                text += f"centre_mm = {numbers(rng.uniform(-150, 150, 3))}\n"
    if made.counts == "pose":
        shifts = "".join(f"{a}_um = {rng.normal(0, 40):.3f}\n" for a in "XYZ")
        tilts = "".join(f"{a}_urad = {rng.normal(0, 60):.3f}\n" for a in "ABC")
        text += "[location.gauge]\n" + shifts + tilts
    if play:
        text += "[backlash]\n"
        for name, axis in made.axes.items():
            text += f"{name}_{'urad' if axis.kind == 'rotary' else 'um'} = {rng.uniform(1, 20):.3f}\n"
    return text


def hanging(made: Made, rng: np.random.Generator) -> dict[str, str]:
    """By joint what the weight on it does, as sums of angles, which state it without masses: of arms, whose
    first axis is upright."""
    lines = {name: axis.direction for name, axis in made.axes.items()}
    if "J6" not in lines or "J7" in lines or rng.random() < 0.4:
        return {}
    found = {}
    for name, groups in (("J2", [["J2"], ["J2", "J3"]]), ("J3", [["J2", "J3"]])):
        found[name] = "".join(
            f'[[gravity]]\ncomponent = "E{name}{name}"\nangles = {group!r}\n'
            f"sin_urad = {rng.normal(0, 150):.3f}\ncos_urad = {rng.normal(0, 150):.3f}\n"
            for group in groups
        ).replace("'", '"')
    return found


def write_machine(
    folder: Path, kind: str, seed: int, *, control: str = "linuxcnc", digit: float = 1e-6, play: bool = False
) -> tuple[Made, tuple[float, Any]]:
    """The files of a random machine of a kind, its job with a payload, and that payload."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    made = KINDS[kind](rng, kind)
    gravity = rng.choice([(0.0, 0.0, -1.0), (0.0, -1.0, 0.0), (0.3, 0.2, -0.9)])
    (folder / "machine.toml").write_text(machine_text(made, control, digit, gravity), "utf-8")
    text = calibration_text(folder, made, rng, play=play)
    (folder / "calibration.toml").write_text(text, "utf-8")
    payload = (0.0, (0.0, 0.0, 0.0))
    if not made.platforms:
        payload = (round(float(rng.uniform(1, 12)), 2), rng.uniform(-60, 60, 3).round(2).tolist())
    job = 'schema = "olp-job-1"\nmachine = "machine.toml"\n'
    job += f"payload_kg = {payload[0]}\npayload_centre_mm = {numbers(payload[1])}\n" if payload[0] else ""
    (folder / "job.toml").write_text(job, "utf-8")
    return made, payload
