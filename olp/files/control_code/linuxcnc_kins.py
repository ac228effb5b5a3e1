"""The model as a kinematics component of LinuxCNC, for halcompile, with snippets of HAL and INI files.

Sources: the HAL and kinematics chapters of the LinuxCNC documents, its header kinematics.h, halcompile(1).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from olp.calibration.control_tables.residuals import BAND_MM
from olp.core.errors import ConfigError, UsageError
from olp.core.units import AXES
from olp.files.control_code import source
from olp.files.control_code.base import Code, CodeFormat, vectors_beside
from olp.files.control_code.carried import Sensor
from olp.files.control_code.tables import real

#: HAL names are shorter than this.
_LONGEST = 47

_HEADERS = """#ifdef OLP_SELF_TEST
#include <math.h>
#include <string.h>
#else
#include <rtapi_math.h>
#endif
"""

#: The fields of a pose by the letter of their axis.
_FIELDS = {**{a: f"tran.{a.lower()}" for a in AXES}, **{a: a.lower() for a in "ABCUVW"}}

_PINS = [
    ("in bit enable = 1", "corrects while it is 1"),
    *((f"in float tool_offset_{a}", f"the tool offset along {a.upper()}: motion.tooloffset") for a in "xyz"),
    *((f"in float tool_more_{a}", "what gauge_to_tip_mm has beyond minus the tool offset") for a in "xyz"),
    ("in float ramp_time = 1.0", "seconds in which the correction is switched on and off"),
    ("out float switched_on", "0 to 1: how far the correction is switched on"),
    ("out bit active", "the whole correction acts"),
    ("out bit outside_box", "outside of the calibrated box: the error at its face acts"),
    ("out bit bounded", "a bound holds the correction back in this cycle"),
    ("out bit not_solved", "the inverse ran out of iterations once: do not go on"),
    ("out u32 iterations", "of the inverse in this cycle"),
]


def _write(code: Code, target: Path) -> Mapping[Path, bytes]:
    name = target.stem
    if target.suffix != ".comp" or not re.fullmatch(r"[a-z][a-z0-9_]{1,20}", name):
        raise UsageError(
            "expected the name of a component, such as gantrykins.comp: a small letter, then up to 20 small "
            "letters, digits and _",
            file=str(target),
        )
    pins = _temperature_pins(name, code.sensors)
    return {
        target: _component(code, name, pins).encode("ascii"),
        target.with_name(f"{name}.hal"): _hal(name, code, pins).encode("ascii"),
        target.with_name(f"{name}.ini"): _ini(name, code).encode("ascii"),
        vectors_beside(target): code.vectors.encode("ascii"),
    }


def _temperature_pins(name: str, sensors: Sequence[Sensor]) -> list[str]:
    """The pin of each sensor. Raises ConfigError where HAL could not tell two apart."""
    pins = []
    for sensor in sensors:
        pin = "temperature_" + re.sub(r"[^a-z0-9]+", "_", sensor.name.lower()).strip("_")
        if pin in pins or len(f"{name}.{pin}") >= _LONGEST or pin == "temperature_":
            raise ConfigError(
                f'sensor "{sensor.name}" has no name of its own in HAL; expected up to '
                f"{_LONGEST - len(name) - 14} letters and digits that no other sensor has"
            )
        pins.append(pin)
    return pins


def _pins(code: Code, temperatures: Sequence[str]) -> list[tuple[str, str]]:
    pins = [*_PINS, *((f"in float joint_{j}", f"joint.{j}.pos-cmd") for j in range(len(code.axes)))]
    for axis in code.axes:
        pins += [
            (f"out float correction_{axis.lower()}", f"what is added to {axis} in this cycle"),
            (f"out float play_{axis.lower()}", "+1: backlash taken up in +, -1: in -, between: not known"),
        ]
    pins += [
        (
            f"out u32 calibration_hash = 0x{code.digest[:8]}",
            "the first 8 digits of the hash, as in the stamp",
        ),
        (f"out u32 calibration_hash_rest = 0x{code.digest[8:12]}", "the next 4 digits"),
        (f"in float payload = {real(code.payload_kg)}", "kg of payload"),
        (f"in float most_correction = {code.linear.most!r}", "mm; the largest correction of an axis"),
        (f"in float most_rate = {code.linear.rate!r}", "mm/s; by which a correction changes at most"),
        (f"in float dead_band = {BAND_MM!r}", "mm; an axis turns only where it would be off by more"),
    ]
    if code.centred:
        pins += [
            (f"in float payload_{a}", "mm; the centre of the payload from the gauge point") for a in "xyz"
        ]
    if "deg" in code.units:
        pins += [
            (f"in float most_turn = {code.rotary.most!r}", "deg; the largest correction of a rotary axis"),
            (f"in float most_turn_rate = {code.rotary.rate!r}", "deg/s; by which it changes at most"),
        ]
    for pin, sensor in zip(temperatures, code.sensors, strict=True):
        pins.append((f"in float {pin} = {real(sensor.start_degC)}", "degC"))
    return pins


def _component(code: Code, name: str, temperatures: Sequence[str]) -> str:
    digest = code.digest
    tip = "1: X, Y and Z state the tip of the tool in the workpiece; 0: the axes"
    head = [
        f'component {name} "kinematics with the calibration {digest[: source.HASH_DIGITS]}";',
        *(f'pin {pin} "{says}";' for pin, says in _pins(code, temperatures)),
        *([f'modparam int tip = 0 "{tip}";'] if code.tips and not code.poses else []),
        'function begin fp "right before motion-controller";',
        'function end fp "right behind motion-controller";',
        "option singleton yes;",
        'license "Apache-2.0";',
        'author "olp";',
        ";;",
    ]
    parts = [
        "\n".join(head),
        source.remark(code, "Kinematics of LinuxCNC with the calibrated model of a machine."),
        _HEADERS,
        source.source(code),
        _kins(code, temperatures),
        source.part(code.self_test),
    ]
    return "\n".join(parts)


def _kins(code: Code, temperatures: Sequence[str]) -> str:
    """The kinematics itself: the part of that name with the axes and pins of this machine."""
    axes = list(enumerate(code.axes))
    state = [f"olp_now.temperature_degC[{k}] = {pin};" for k, pin in enumerate(temperatures)]
    if code.centred:
        state += [f"olp_now.payload_centre_mm[{k}] = payload_{a};" for k, a in enumerate("xyz")]
    bounds = ["olp_bounds.most_deg = most_turn;", "olp_bounds.rate_deg_s = most_turn_rate;"]
    world = _poses() if code.poses else _axes(code)
    filled = {
        "STATE": state,
        "BOUNDS": bounds if "deg" in code.units else [],
        "SHOWN": [
            line
            for j, axis in axes
            for line in (
                f"correction_{axis.lower()} = olp_at.correction[{j}];",
                f"play_{axis.lower()} = olp_at.play[{j}];",
            )
        ],
        **world,
    }
    text = source.part("kins")
    for key, lines in filled.items():
        text = text.replace(f"@{key}@\n", "".join(f"    {line}\n" for line in lines))
    return text.replace("@JOINTS@", ", ".join(f"joint_{j}" for j, _ in axes))


def _axes(code: Code) -> dict[str, list[str]]:
    """Programs state axis values, or by the option `tip` the tip."""
    to_tip = ["if (tip) {", "    olp_tip_of_axes(wanted, &olp_now, wanted);"]
    of_tip = ["if (tip) {"]
    for k, axis in enumerate(AXES):
        if axis in code.axes:
            place = code.axes.index(axis)
            to_tip.append(f"    wanted[{place}] += olp_offset[{k}];")
            of_tip.append(f"    wanted[{place}] -= olp_offset[{k}];")
    of_tip.append("    olp_axes_of_tip(wanted, &olp_now, wanted);")
    fields = [(j, _FIELDS[axis]) for j, axis in enumerate(code.axes)]
    return {
        "KEPT": [],
        "LED": [],
        "TO_WORLD": [
            *([*to_tip, "}"] if code.tips else []),
            "memset(world, 0, sizeof *world);",
            *(f"world->{field} = wanted[{j}];" for j, field in fields),
        ],
        "OF_WORLD": [
            *(f"wanted[{j}] = world->{field};" for j, field in fields),
            *([*of_tip, "}"] if code.tips else []),
        ],
        "MOVED": [],
    }


def _poses() -> dict[str, list[str]]:
    """Programs state where the tool is: X, Y and Z of its tip, and its turn as A, B and C. The joints go on
    from where they were."""
    fields = list(enumerate(("tran.x", "tran.y", "tran.z", "a", "b", "c")))
    offset = [f" + olp_offset[{k}]" for k in range(3)] + [""] * 3
    stated = ", ".join(f"world->{field}{offset[k].replace('+', '-')}" for k, field in fields)
    copy = "for (j = 0; j < OLP_AXES; j++)"
    return {
        "KEPT": ["static double olp_last[OLP_AXES];"],
        "LED": [
            "{",
            "    int j;",
            f"    {copy} olp_last[j] = olp_at.command[j] - olp_at.correction[j];",
            "}",
        ],
        "TO_WORLD": [
            "{",
            "    double pose[6];",
            "    olp_pose_of_axes(wanted, &olp_now, pose);",
            "    memset(world, 0, sizeof *world);",
            *(f"    world->{field} = pose[{k}]{offset[k]};" for k, field in fields),
            "}",
        ],
        "OF_WORLD": [
            "{",
            f"    double pose[6] = {{{stated}}};",
            f"    {copy} wanted[j] = olp_last[j];",
            "    if (!olp_axes_of_pose(pose, &olp_now, wanted)) {",
            "        if (olp_in_tick) olp_ever_unsolved = 1;",
            f"        {copy} wanted[j] = olp_last[j];",
            "    }",
            "}",
        ],
        "MOVED": [f"{copy} olp_last[j] = wanted[j];"],
    }


def _hal(name: str, code: Code, temperatures: Sequence[str]) -> str:
    lines = [
        f"# HAL of {name}: take it over into the HAL file of the machine.",
        f"# [KINS]KINEMATICS = {name}; in place of the line of trivkins, before motmod:",
        f"#   loadrt {name}",
    ]
    if code.tips and not code.poses:
        lines.append(f"#   or loadrt {name} tip=1, where programs state the tip of the tool")
    lines += [
        "# The order of the functions decides:",
        "#   addf motion-command-handler servo-thread",
        f"#   addf {name}.begin servo-thread",
        "#   addf motion-controller servo-thread",
        f"#   addf {name}.end servo-thread",
    ]
    lines += [f"net {name}-joint-{j} joint.{j}.pos-cmd => {name}.joint-{j}" for j in range(len(code.axes))]
    lines += [f"net {name}-tool-{a} motion.tooloffset.{a} => {name}.tool-offset-{a}" for a in "xyz"]
    lines += [f"setp {name}.payload {real(code.payload_kg)}"]
    for pin, sensor in zip(temperatures, code.sensors, strict=True):
        shown = pin.replace("_", "-")
        lines.append(f"setp {name}.{shown} {real(sensor.start_degC)}")
    lines += [
        f"# Stop, or tell the operator, where {name}.outside-box, .bounded or .not-solved is 1.",
        f"setp {name}.enable 1",
    ]
    return "\n".join(lines) + "\n"


def _ini(name: str, code: Code) -> str:
    more = [f"{code.linear.most!r} mm"] + ([f"{code.rotary.most!r} deg"] if "deg" in code.units else [])
    lines = [
        f"# INI of {name}.",
        f"# Joints need room beyond the limits of their axes: {' or '.join(more)} more at both ends.",
        "# Leave out COMP_FILE and BACKLASH of every joint: the component does both.",
        "[KINS]",
        f"KINEMATICS = {name}",
        f"JOINTS = {len(code.axes)}",
        "[TRAJ]",
        "COORDINATES = " + " ".join("XYZABC" if code.poses else code.axes),
        "LINEAR_UNITS = mm",
    ]
    if "deg" in code.units:
        lines.append("ANGULAR_UNITS = degree")
    return "\n".join(lines) + "\n"


def _plain(text: bytes) -> bytes:
    return text.split(b"\n;;\n", 1)[1]


FORMAT = CodeFormat(
    "linuxcnc-kins",
    "LinuxCNC kinematics component",
    ".comp",
    "its documents and headers; compiled by halcompile and run in the control in the tests",
    "the model itself: errors of axes and chain, tool, direction, payload, temperatures; in real time",
    _write,
    _plain,
)
