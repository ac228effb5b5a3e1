"""What a file of readings shows of itself: the names of its columns, its comments, and whose file it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from olp.files.columns import decoded
from olp.files.measurements.instruments.base import Instrument, SeenFile
from olp.files.measurements.instruments.registry import INSTRUMENTS
from olp.files.measurements.point_readings import header_in
from olp.files.measurements.rtl import is_stored_line, parse_rtl
from olp.files.measurements.stated import stated_keys
from olp.files.write import read_bytes

#: Endings of files that say their columns.
COLUMNS = (".csv",)
#: Endings of measured lines of which only the first states its unit.
STORED = (".rtl", ".rta", ".rts")
#: An instrument, what a file of it shows, and the keys of its table.
Known = tuple[Instrument[Any, Any], SeenFile, dict[str, object]]


def known_of(path: Path) -> Known | None:
    """The instrument of a file, by its columns or its format; None where it shows none. Raises InputError
    where it cannot be read."""
    if path.suffix.lower() not in (*COLUMNS, *STORED):
        return None
    seen = _seen(path)
    for instrument in INSTRUMENTS:
        keys = instrument.proposed(seen)
        if keys is not None:
            return instrument, seen, keys
    return None


def _seen(path: Path) -> SeenFile:
    data = read_bytes(path)
    if is_stored_line(data):
        readings = parse_rtl(data, str(path), "um")
        stated = {key: written for key, (written, _) in readings.keys.items()}
        own = readings.component if path.suffix.lower() == STORED[0] else None
        return SeenFile(path.name, ("target_mm",), stated, own)
    text = decoded(data, str(path))
    return SeenFile(path.name, header_in(text), {key: written for key, (written, _) in stated_keys(text)})


__all__ = ["COLUMNS", "STORED", "Known", "known_of"]
