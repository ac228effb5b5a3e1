"""The C source of a model: its tables, the error, and the inverse at servo rate. All formats hold it."""

from __future__ import annotations

from importlib import resources

from olp.core.version import __version__
from olp.files.control_code.base import Code
from olp.files.control_code.tables import real

#: Digits of the hash of the calibration, as the stamp of corrected programs has them.
HASH_DIGITS = 12


def part(name: str) -> str:
    """A part of the source that is the same for every model."""
    return resources.files(__package__).joinpath(f"{name}.c").read_text("utf-8")


def _ascii(name: str) -> str:
    """A name inside of a remark of C, which it must not end."""
    return name.replace("*/", "* /").replace("\n", " ").encode("ascii", "replace").decode()


def remark(code: Code, what: str) -> str:
    """The first lines of a file: what it is, and of which calibration."""
    units = ", ".join(f"{name} in {unit}" for name, unit in zip(code.axes, code.units, strict=True))
    lines = [
        what,
        f"Machine {_ascii(code.machine)}, chain {_ascii(code.chain)}.",
        f"Axes in their order: {_ascii(units)}.",
        f"Calibration {code.digest[:HASH_DIGITS]}.",
        "Lengths in mm, angles of errors in rad, error = actual - commanded.",
        f"Written by olp {__version__}. Do not edit: export it again.",
    ]
    return f"/* {(chr(10) + '   ').join(lines)} */\n"


def source(code: Code) -> str:
    """The C source of a model, without the headers that it needs (math.h, string.h)."""
    lines = [
        *map(part, code.shapes),
        *code.tables,
        f'const char olp_calibration[] = "{code.digest[:HASH_DIGITS]}";',
    ]
    if code.sensors:
        sensors = "".join(
            f"   temperature_degC[{k}]: {_ascii(s.name)}, {real(s.start_degC)} until it is known\n"
            for k, s in enumerate(code.sensors)
        )
        start = ", ".join(real(s.start_degC) for s in code.sensors)
        lines += [
            f"/* Temperatures that the model takes.\n{sensors}*/",
            f"const double olp_start_degC[] = {{{start}}};",
        ]
    return "\n".join([*lines, "", *map(part, (*code.engine, *code.tips))])
