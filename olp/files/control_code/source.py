"""The C source of a model: its tables, the error, and the inverse at servo rate. All formats hold it."""

from __future__ import annotations

from importlib import resources

from olp.core.version import __version__
from olp.files.control_code import data
from olp.files.control_code.carried import Carried

#: Digits of the hash of the calibration, as the stamp of corrected programs has them.
HASH_DIGITS = 12


def part(name: str) -> str:
    """A part of the source that is the same for every model."""
    return resources.files(__package__).joinpath(f"{name}.c").read_text("utf-8")


def _ascii(name: str) -> str:
    """A name inside of a remark of C, which it must not end."""
    return name.replace("*/", "* /").replace("\n", " ").encode("ascii", "replace").decode()


def remark(kept: Carried, digest: str, what: str) -> str:
    """The first lines of a file: what it is, and of which calibration."""
    lines = [
        what,
        f"Machine {_ascii(kept.calibration.machine)}, chain {kept.chain}.",
        f"Calibration {digest[:HASH_DIGITS]}.",
        "Lengths in mm, angles in rad, error = actual - commanded.",
        f"Written by olp {__version__}. Do not edit: export it again.",
    ]
    return f"/* {(chr(10) + '   ').join(lines)} */\n"


def source(kept: Carried, digest: str) -> str:
    """The C source of a model, without the headers that it needs (math.h, string.h)."""
    sensors = "".join(
        f"   temperature_degC[{k}]: {_ascii(s.name)}, {data.real(s.start_degC)} until it is known\n"
        for k, s in enumerate(kept.sensors)
    )
    start = ", ".join([*(data.real(s.start_degC) for s in kept.sensors), "0.0"])
    defines = "".join(f"#define {name} {value}\n" for name, value in data.sizes(kept).items())
    return "\n".join(
        [
            part("shapes") + defines,
            *data.write(kept),
            f'const char olp_calibration[] = "{digest[:HASH_DIGITS]}";',
            f"/* Temperatures that the model takes.\n{sensors}*/",
            f"const double olp_start_degC[] = {{{start}}};",
            "",
            part("engine"),
            part("follower"),
        ]
    )
