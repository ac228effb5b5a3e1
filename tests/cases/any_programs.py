"""Random programs for machines of any joints: lists of axis values, and words of controls for five axes."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from cases.any_machines import Made
from judge.five_axis import Judge
from scipy.spatial.transform import Rotation

#: By form of a program for five axes the control that reads it.
FORMS: Mapping[str, str] = {
    "axis words, fanuc": "fanuc", "axis words, linuxcnc": "linuxcnc", "axis words, sinumerik": "sinumerik",
    "G43.4": "fanuc", "G43.5": "fanuc", "TRAORI ORIAXES": "sinumerik", "TRAORI ORIVECT": "sinumerik",
    "TRAORI A3": "sinumerik", "M128": "heidenhain", "TCPM VECTOR": "heidenhain", "LN": "heidenhain",
    "APT": "fanuc",
}  # fmt: skip
#: Those that lead the direction of the tool, and those that state it by seven decimals.
VECTOR = ("TRAORI ORIVECT", "TRAORI A3", "TCPM VECTOR", "APT")
DIRECTED = ("G43.5", "TRAORI A3", "LN", "APT")
#: Forms with tilted planes.
PLANES: Mapping[str, str] = {
    "G68.2": "fanuc", "CYCLE800": "sinumerik", "PLANE SPATIAL": "heidenhain", "PLANE EULER": "heidenhain",
    "PLANE VECTOR": "heidenhain",
}  # fmt: skip


def slope(judge: Judge, values: np.ndarray) -> float:
    """How well both rotary axes turn the tool: the smaller singular value, 1 at best."""
    here, columns = judge.forward(values[None], False)[1][0], []
    for column, name in enumerate(judge.order):
        if name not in "XYZ":
            ahead = values.copy()
            ahead[column] += 0.01
            columns.append((judge.forward(ahead[None], False)[1][0] - here) / np.radians(0.01))
    # of three axes two have to
    return float(np.linalg.svd(np.array(columns), compute_uv=False)[1])


def waypoints(
    made: Made, rng: np.random.Generator, count: int, judge: Judge | None = None, least: float = 0.25
) -> np.ndarray:
    """Axis values (count + 3, k): the first three take every axis over its play upward."""
    if made.legs:
        shift, turn, rows = np.array(made.start), np.zeros(3), []
        for _ in range(count + 3):
            shift = shift + rng.uniform(-12, 12, 3)
            turn = turn + rng.uniform(-0.03, 0.03, 3) * (made.counts == "pose")
            rows.append(made.legs(shift, Rotation.from_rotvec(turn).as_matrix()))
        return np.array(rows).round(3)
    reach = np.array([made.reach[name] for name in made.axes])
    place = np.array([made.middle[name] for name in made.axes])
    turning = np.array([axis.kind == "rotary" for axis in made.axes.values()])
    for _ in range(200):
        if judge is None or slope(judge, place) > 1.2 * least:
            break
        place = np.where(turning, rng.uniform(-70, 70, len(place)), place)
    else:
        raise AssertionError("no posture turns the tool by both axes")
    lead = [place - 0.2 * reach, place - 0.1 * reach, place]
    rows = []
    for _ in range(count):
        for _ in range(60):
            step = rng.uniform(-1, 1, len(reach)) * reach * (rng.random(len(reach)) < 0.8)
            if judge is None or slope(judge, (place + step).round(3)) > least:
                place = place + step
                break
        rows.append(place)
    return np.array([*lead, *rows]).round(3)


def listed(made: Made, rows: np.ndarray, mark: str = ",") -> bytes:
    head = mark.join(f"{name}_{axis.unit}" for name, axis in made.axes.items())
    return "\n".join([head, *(mark.join(f"{v:.4f}" for v in row) for row in rows), ""]).encode()


def words(letters: list[str], values: np.ndarray, before: np.ndarray | None, form: str = "{}{:.3f}") -> str:
    """Words of coordinates, without those that stay."""
    stays = [before is not None and abs(value - before[k]) < 5e-4 for k, value in enumerate(values)]
    pairs = zip(letters, values, stays, strict=True)
    return " ".join(form.format(letter, value) for letter, value, same in pairs if not same)


def program(form: str, judge: Judge, rows: np.ndarray, rng: np.random.Generator) -> tuple[bytes, str]:
    """A program that goes to axis values, and what its job file states."""
    tips, axes = judge.forward(rows, False)
    stated = np.column_stack((tips.round(3), rows[:, 3:]))
    if form.startswith("axis"):
        return _of_axes(form, judge.order, rows, rng), ""
    if form in ("M128", "TCPM VECTOR", "LN"):
        return _heidenhain(form, judge.order, rows, stated, axes), ""
    if form == "APT":
        lines = ["PARTNO/A", "UNITS/MM", "MULTAX/ON", "LOADTL/1", "RAPID"]
        for k, (tip, axis) in enumerate(zip(tips, axes, strict=True)):
            lines += ["FEDRAT/500.,MMPM"] if k == 2 else []
            lines.append("GOTO/" + ",".join([*(f"{v:.4f}" for v in tip), *(f"{v:.7f}" for v in axis)]))
        start = ", ".join(f"{n} = {v}" for n, v in zip(judge.order[3:], rows[0, 3:], strict=True))
        return "\n".join([*lines, "FINI", ""]).encode(), f"start_deg = {{ {start} }}\n"
    siemens = form.startswith("TRAORI")
    lead = "ORIAXES" if form == "TRAORI ORIAXES" else "ORIVECT"
    lines = ["G71 G90 G54", "T1 M6", "D1", lead] if siemens else ["G21 G90 G54"]
    lines.append("G0 " + words(judge.order, rows[0], None))
    lines += ["TRAORI"] if siemens else []
    before = None
    for k, (place, axis) in enumerate(zip(stated, axes, strict=True)):
        if form in DIRECTED:
            shape, names = ("{}3={:.7f}", list("ABC")) if siemens else ("{}{:.7f}", list("IJK"))
            text = words(list("XYZ"), place[:3], None) + " " + words(names, axis, None, shape)
        else:
            text = words(judge.order, place, before)
        begin = "G0 " if siemens and not k else f"{form} H1 " if not k else "G1 " if k == 2 else ""
        lines += [begin + text + (" F500." if k == 2 else "")] if text else []
        before = place
    return "\n".join([*lines, "TRAFOOF" if siemens else "G49", "M30", ""]).encode(), ""


def _of_axes(form: str, letters: list[str], rows: np.ndarray, rng: np.random.Generator) -> bytes:
    lines = ["G71 G90 G54" if "sinumerik" in form else "G21 G90 G54"]
    for k, (before, row) in enumerate(zip([None, *rows], rows, strict=False)):
        text = words(letters, row, before)
        begin = "G0 " if not k else "G1 " if k == 2 or (k > 2 and rng.random() < 0.3) else ""
        lines += [begin + text + (" F800." if k == 2 else "")] if text else []
    return "\n".join([*lines, "M30", ""]).encode()


def _heidenhain(
    form: str, letters: list[str], rows: np.ndarray, stated: np.ndarray, axes: np.ndarray
) -> bytes:
    shape = "{}{:+.3f}"
    lines = ["BEGIN PGM A MM", "TOOL CALL 1 Z S1000", f"L {words(letters, rows[0], None, shape)} R0 FMAX"]
    lines += ["FUNCTION TCPM F TCP AXIS POS PATHCTRL VECTOR"] if form == "TCPM VECTOR" else []
    before = None
    for k, (place, axis) in enumerate(zip(stated, axes, strict=True)):
        rest = (" FMAX" if k < 2 else " F900" if k == 2 else "") + (
            " M128" if not k and form != "TCPM VECTOR" else ""
        )
        if form == "LN":
            text = f"LN {words(list('XYZ'), place[:3], None, shape)} " + words(
                ["TX", "TY", "TZ"], axis, None, "{}{:+.7f}"
            )
        else:
            text = words(letters, place, before, shape)
            text = f"L {text}" + (" R0" if not k else "") if text else ""
        lines += [text + rest] if text else []
        before = place
    lines += ["FUNCTION RESET TCPM" if form == "TCPM VECTOR" else "L M129", "END PGM A MM"]
    return "".join(f"{k} {line}\n" for k, line in enumerate(lines)).encode()


def read_by_judge(form: str, text: bytes, judge: Judge, start: np.ndarray) -> bytes:
    """The program in the words that the judge reads."""
    if form == "APT":
        first = " ".join(f"{n}{v}" for n, v in zip(judge.order, start, strict=True))
        lines, rapid = [f"G0 {first}", "G43.5"], False
        for line in text.decode().splitlines():
            if line.startswith("GOTO/"):
                pairs = zip("XYZIJK", line[5:].split(","), strict=True)
                lines.append(f"G{0 if rapid else 1} " + " ".join(f"{a}{v}" for a, v in pairs))
            rapid = line == "RAPID" or (rapid and not line.startswith("FEDRAT"))
        return "\n".join(lines).encode()
    if form in ("M128", "TCPM VECTOR", "LN"):
        text = re.sub(rb" T([XYZ])", lambda m: b" " + {b"X": b"I", b"Y": b"J", b"Z": b"K"}[m[1]], text)
        text = text.replace(b"LN", b"G1").replace(b"FUNCTION RESET TCPM", b"L M129")
        text = text.replace(b"FUNCTION TCPM F TCP AXIS POS PATHCTRL VECTOR", b"L M128")
        lines = [re.sub(r"^\d+ ", "", line) for line in text.decode().splitlines()]
        feed = re.compile(r"^L (?=.*[XYZABC][-+])(?!.*FMAX)")
        return "\n".join(feed.sub("G1 ", line) for line in lines).encode()
    return text


def plane(form: str, judge: Judge, rows: np.ndarray, rng: np.random.Generator) -> bytes:
    """A path in a plane whose normal is the tool at axis values."""
    turn = judge.poses(rows[:1], False)[1][0]
    tip = judge.forward(rows[:1], False)[0][0].round(3)
    normal = turn[:, 2]
    spin = Rotation.from_rotvec(normal * rng.uniform(-0.5, 0.5)).as_matrix() @ turn
    x, y, z = tip.tolist()
    path = [*rng.uniform(-30, 30, (4, 2)).round(3).tolist()]
    rotary = " ".join(f"{n}{v:+.6f}" for n, v in zip(judge.order[3:], rows[0, 3:], strict=True))
    if form.startswith("PLANE"):
        if form == "PLANE SPATIAL":
            a, b, c = Rotation.from_matrix(spin).as_euler("xyz", degrees=True)
            stated = f"SPA{a:+.6f} SPB{b:+.6f} SPC{c:+.6f}"
        elif form == "PLANE EULER":
            pr, nu, ro = Rotation.from_matrix(spin).as_euler("ZXZ", degrees=True)
            stated = f"EULPR{pr:+.6f} EULNU{nu:+.6f} EULROT{ro:+.6f}"
        else:
            base = " ".join(f"B{k}{v:+.7f}" for k, v in zip("XYZ", spin[:, 0], strict=True))
            stated = base + " " + " ".join(f"N{k}{v:+.7f}" for k, v in zip("XYZ", normal, strict=True))
        lines = [
            "BEGIN PGM A MM",
            "TOOL CALL 1 Z S1000",
            "L X+0 Y+0 Z+200 R0 FMAX",
            "CYCL DEF 7.0 DATUM SHIFT",
        ]
        lines += [f"CYCL DEF 7.{k} {a}{v:+.3f}" for k, (a, v) in enumerate(zip("XYZ", tip, strict=True), 1)]
        lines += [f"{form} {stated} STAY SEQ+", f"L {rotary} R0 FMAX", "L X+0 Y+0 R0 FMAX", "L Z+10 FMAX"]
        lines += [f"L X{a:+.3f} Y{b:+.3f} Z{-k:+.3f} F500" for k, (a, b) in enumerate(path, 1)]
        return "\n".join([*lines, "PLANE RESET STAY", "END PGM A MM", ""]).encode()
    moves = [f"G1 X{a:.3f} Y{b:.3f} Z{-k:.3f} F500." for k, (a, b) in enumerate(path, 1)]
    if form == "G68.2":
        i, j, k = Rotation.from_matrix(spin).as_euler("ZXZ", degrees=True)
        lines = ["G21 G90 G54", f"G0 X0. Y0. Z0. {rotary}", "G43 H1 Z200."]
        lines.append(f"G68.2 X{x:.3f} Y{y:.3f} Z{z:.3f} I{i:.6f} J{j:.6f} K{k:.6f}")
        lines += [f"G0 {rotary}", "G0 X0. Y0.", "Z10."]
        return "\n".join([*lines, *moves, "G69", "M30", ""]).encode()
    a, b, c = Rotation.from_matrix(spin).as_euler("XYZ", degrees=True)
    lines = ["G71 G90 G54 G17", "T1 M6", "D1", f"G0 X0 Y0 Z200 {rotary}"]
    call = f'CYCLE800(0,"TABLE",0,57,{x:.3f},{y:.3f},{z:.3f},{a:.6f},{b:.6f},{c:.6f},0,0,0,0,0)'
    lines += [call, f"G0 {rotary}", "G0 X0 Y0", "Z10"]
    return "\n".join([*lines, *moves, "CYCLE800()", "M30", ""]).encode()
