"""The formats of control code, by name."""

from __future__ import annotations

from pathlib import Path

from olp.errormodel.calibration import Calibration
from olp.files.control_code import c99, linuxcnc_kins
from olp.files.control_code.base import Code, CodeFormat
from olp.files.control_code.carried import carried
from olp.files.control_code.vectors import vectors

#: The formats by name.
CODE: dict[str, CodeFormat] = {form.key: form for form in (c99.FORMAT, linuxcnc_kins.FORMAT)}


def write_code(
    calibration: Calibration, chain: str, digest: str, key: str, target: Path
) -> dict[Path, bytes]:
    """The files of a format, the source first. Raises ConfigError for what C code cannot hold."""
    kept = carried(calibration, chain)
    return dict(CODE[key].write(Code(kept, digest, vectors(kept)), target))
