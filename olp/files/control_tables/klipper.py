"""Klipper's skew correction: `[skew_correction NAME]` with xy_skew, xz_skew, yz_skew.

A factor is the lean of the later axis to + of the earlier one, per unit of length: + is an acute angle. The
firmware removes the shear exactly: x' = x - y xy - z (xz - xy yz), y' = y - z yz. Saved values are at the end
of printer.cfg behind `#*#`. Source: the skew_correction module of Klipper.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from olp.calibration.control_tables.controls import Shear, factors
from olp.core.errors import ConfigError
from olp.core.machine import SQUARENESS
from olp.errormodel.calibration import Calibration
from olp.files.control_tables import base
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load
from olp.files.problems import Problem

_KEYS = ("xy_skew", "xz_skew", "yz_skew")
_SECTION = re.compile(r"\[\s*([^\]\s]+)\s*([^\]]*?)\s*\]")


def _read(path: Path, given: Given, load: Load) -> Imported:
    sections: dict[str, dict[str, float]] = {}
    problems: list[Problem] = []
    for line, section, key, value in _entries(load(path)):
        if key is None:
            if section in sections:
                problems.append((line, f"[skew_correction {section}] is defined twice; expected it once"))
            sections.setdefault(section, {})
        elif key not in _KEYS:
            problems.append((line, f"{key} is not a key of skew_correction; expected {', '.join(_KEYS)}"))
        elif (number := base.number(value)) is None:
            problems.append((line, f'{key} = "{value}" is not a number'))
        else:
            sections[section][key] = number
    base.refuse(problems, path)
    filled = {name: values for name, values in sections.items() if values}
    if len(filled) != 1:
        what = f"sections {', '.join(filled)}" if filled else "no section [skew_correction NAME] with factors"
        raise ConfigError(f"holds {what}; expected one; remove the others from the file", file=str(path))
    ((name, values),) = filled.items()
    xy, xz, yz = (values.get(key, 0.0) for key in _KEYS)
    square = {"C0Y": 0.0 - xy, "B0Z": xz, "A0Z": 0.0 - yz}
    return Imported(
        base.calibration_of(given, [], path, square), notes=(f"read from skew_correction {name}",)
    )


def _entries(data: bytes) -> Iterator[tuple[int, str, str | None, str]]:
    """(line, section, key, value) inside sections of skew_correction. The key is None at their header."""
    section: str | None = None
    for line, raw in base.lines(data):
        bare = raw.removeprefix("#*#").strip()
        bare = re.split(r"\s*(?:#|;)", bare, maxsplit=1)[0]
        header = _SECTION.fullmatch(bare)
        if header:
            section = (header[2] or "") if header[1] == "skew_correction" else None
            if section is not None:
                yield line, section, None, ""
        elif section is not None and bare:
            key, _, value = bare.partition("=") if "=" in bare else bare.partition(":")
            yield line, section, key.strip(), value.strip()


def _write(calibration: Calibration, target: Path, given: Given) -> Exported:
    name = re.sub(r"[^A-Za-z0-9_]", "_", calibration.machine) or "machine"
    lines = [
        "# Skew of the axes; + is an acute angle: the later axis leans to + of the earlier one.",
        f"# Append to printer.cfg, then: SKEW_PROFILE LOAD={name}",
        f"[skew_correction {name}]",
    ]
    lines += [f"{key} = {base.shown(value)}" for key, value in zip(_KEYS, factors(calibration), strict=True)]
    findings = [*base.not_held(calibration, SQUARENESS), *base.backlash_left_out(calibration)]
    corrects = frozenset(n for n, value in calibration.squareness.items() if value)
    return Exported({target: ("\n".join(lines) + "\n").encode()}, corrects, tuple(findings))


FORMAT = Format(
    "klipper",
    "Klipper skew_correction",
    ".cfg",
    "error",
    "source",
    "C0Y, B0Z, A0Z, taken out as an exact shear about axis position 0",
    _read,
    _write,
    lambda calibration, chain: Shear(calibration),
)
