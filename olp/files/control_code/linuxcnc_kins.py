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
from olp.files.control_code import data, source, vectors
from olp.files.control_code.base import Code, CodeFormat, vectors_beside
from olp.files.control_code.carried import Sensor

#: HAL names are shorter than this.
_LONGEST = 47

_HEADERS = """#ifdef OLP_SELF_TEST
#include <math.h>
#include <string.h>
#else
#include <rtapi_math.h>
#endif
"""

_PINS = [
    ("in bit enable = 1", "corrects while it is 1"),
    *((f"in float tool_offset_{a}", f"the tool offset along {a.upper()}: motion.tooloffset") for a in "xyz"),
    *((f"in float tool_more_{a}", "what gauge_to_tip_mm has beyond minus the tool offset") for a in "xyz"),
    *((f"in float joint_{j}", f"joint.{j}.pos-cmd") for j in range(3)),
    ("in float ramp_time = 1.0", "seconds in which the correction is switched on and off"),
    *((f"out float correction_{a}", f"what is added to {a.upper()} in this cycle") for a in "xyz"),
    *((f"out float play_{a}", "+1: backlash taken up in +, -1: in -, between: not known") for a in "xyz"),
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
    pins = _temperature_pins(name, code.kept.sensors)
    return {
        target: _component(code, name, pins).encode("ascii"),
        target.with_name(f"{name}.hal"): _hal(name, code, pins).encode("ascii"),
        target.with_name(f"{name}.ini"): _ini(name, code).encode("ascii"),
        vectors_beside(target): vectors.text(code.rows).encode("ascii"),
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


def _component(code: Code, name: str, temperatures: Sequence[str]) -> str:
    kept, digest = code.kept, code.digest
    pins = [
        *_PINS,
        (f"out u32 calibration_hash = 0x{digest[:8]}", "the first 8 digits of the hash, as in the stamp"),
        (f"out u32 calibration_hash_rest = 0x{digest[8:12]}", "the next 4 digits"),
        (f"in float payload = {data.real(kept.calibration.payload_kg)}", "kg of payload"),
        (f"in float most_correction = {code.most_mm()!r}", "mm; the largest correction of an axis"),
        (f"in float most_rate = {code.rate_mm_s()!r}", "mm/s; by which a correction changes at most"),
        (f"in float dead_band = {BAND_MM!r}", "mm; an axis turns only where it would be off by more"),
    ]
    for pin, sensor in zip(temperatures, kept.sensors, strict=True):
        pins.append((f"in float {pin} = {data.real(sensor.start_degC)}", "degC"))
    taken = "\n".join(f"    olp_now.temperature_degC[{k}] = {pin};" for k, pin in enumerate(temperatures))
    head = [
        f'component {name} "kinematics with the calibration {digest[: source.HASH_DIGITS]}";',
        *(f'pin {pin} "{says}";' for pin, says in pins),
        'function begin fp "right before motion-controller";',
        'function end fp "right behind motion-controller";',
        "option singleton yes;",
        'license "Apache-2.0";',
        'author "olp";',
        ";;",
    ]
    parts = [
        "\n".join(head),
        source.remark(kept, digest, "Kinematics of LinuxCNC with the calibrated model of a machine."),
        _HEADERS,
        source.source(kept, digest),
        source.part("kins").replace("@TEMPERATURES@", taken),
        source.part("self_test"),
    ]
    return "\n".join(parts)


def _hal(name: str, code: Code, temperatures: Sequence[str]) -> str:
    lines = [
        f"# HAL of {name}: take it over into the HAL file of the machine.",
        f"# [KINS]KINEMATICS = {name}; in place of the line of trivkins, before motmod:",
        f"#   loadrt {name}",
        "# The order of the functions decides:",
        "#   addf motion-command-handler servo-thread",
        f"#   addf {name}.begin servo-thread",
        "#   addf motion-controller servo-thread",
        f"#   addf {name}.end servo-thread",
    ]
    lines += [f"net {name}-joint-{j} joint.{j}.pos-cmd => {name}.joint-{j}" for j in range(3)]
    lines += [f"net {name}-tool-{a} motion.tooloffset.{a} => {name}.tool-offset-{a}" for a in "xyz"]
    lines += [f"setp {name}.payload {data.real(code.kept.calibration.payload_kg)}"]
    for pin, sensor in zip(temperatures, code.kept.sensors, strict=True):
        shown = pin.replace("_", "-")
        lines.append(f"setp {name}.{shown} {data.real(sensor.start_degC)}")
    lines += [
        f"# Stop, or tell the operator, where {name}.outside-box, .bounded or .not-solved is 1.",
        f"setp {name}.enable 1",
    ]
    return "\n".join(lines) + "\n"


def _ini(name: str, code: Code) -> str:
    lines = [
        f"# INI of {name}.",
        f"# Joints need room beyond the limits of their axes: {code.most_mm()!r} mm more at both ends.",
        "# Leave out COMP_FILE and BACKLASH of every joint: the component does both.",
        "[KINS]",
        f"KINEMATICS = {name}",
        "JOINTS = 3",
        "[TRAJ]",
        "COORDINATES = " + " ".join(AXES),
        "LINEAR_UNITS = mm",
    ]
    return "\n".join(lines) + "\n"


def _plain(text: bytes) -> bytes:
    return text.split(b"\n;;\n", 1)[1]


FORMAT = CodeFormat(
    "linuxcnc-kins",
    "LinuxCNC kinematics component",
    ".comp",
    "its documents and headers; compiled by halcompile and run in the control in the tests",
    "the model itself: 21 errors, tool, direction, payload, temperatures, maps; corrects in real time",
    _write,
    _plain,
)
