"""The archives of releases: corrected programs with all that they were made from, so that they can be judged
again when files have changed.

An archive is a ZIP file: `release.json`, the corrected programs below `corrected/`, and their inputs by
digest below `inputs/`. The same contents are the same bytes.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

from olp.core.errors import InputError, UsageError
from olp.core.values import dataclass
from olp.files.write import PathLike, read_bytes

SCHEMA = "olp-release-1"
_MANIFEST = "release.json"
_CORRECTED = "corrected/"
_INPUTS = "inputs/"
#: The day of all entries: an archive does not read the system clock.
_DAY = (1980, 1, 1, 0, 0, 0)
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._ -]{0,99}")
#: Names that Windows keeps for devices, with any ending.
_DEVICE = re.compile(r"(?i)(?:con|prn|aux|nul|com\d|lpt\d)(?:\..*)?")
#: Bytes of an entry, at most.
_LARGEST = 1 << 31


@dataclass(frozen=True, slots=True)
class Release:
    """A release: its name, the day that was given, and of each program its line of the history. `corrected`
    are the programs by their path, `inputs` the files that they were made from, by digest."""

    name: str
    date: str | None
    programs: Mapping[str, Mapping[str, Any]]
    corrected: Mapping[str, bytes]
    inputs: Mapping[str, bytes]


def check_name(name: str) -> None:
    """Raise UsageError for a name that is no name of a file on every system."""
    if not _NAME.fullmatch(name) or name[-1] in ". " or _DEVICE.fullmatch(name):
        raise UsageError(
            f"--release {name!r} is no name of a file; expected a letter (a to z) or digit first, "
            "then also spaces, `-`, `_` and `.`, and no name of a device of Windows such as CON"
        )


def packed(release: Release) -> bytes:
    """The archive of a release."""
    stream = io.BytesIO()
    manifest = {
        "schema": SCHEMA, "name": release.name, "date": release.date, "programs": dict(release.programs)
    }  # fmt: skip
    entries = {_MANIFEST: (json.dumps(manifest, indent=1, sort_keys=True) + "\n").encode()}
    entries |= {_CORRECTED + path: data for path, data in sorted(release.corrected.items())}
    entries |= {_INPUTS + digest: data for digest, data in sorted(release.inputs.items())}
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            entry = zipfile.ZipInfo(name, _DAY)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)
    return stream.getvalue()


def read_release(path: PathLike) -> Release:
    """The release of an archive. Raises InputError where it cannot be read, or is none."""
    data = read_bytes(path)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = {entry.filename: entry for entry in archive.infolist()}
            if any(entry.file_size > _LARGEST for entry in entries.values()):
                raise ValueError("an entry is too large")
            contents = {name: archive.read(entry) for name, entry in entries.items()}
        manifest = json.loads(contents.pop(_MANIFEST))
        if manifest["schema"] != SCHEMA:
            raise ValueError("another schema")
        return Release(
            manifest["name"], manifest["date"], manifest["programs"],
            {name.removeprefix(_CORRECTED): text for name, text in contents.items() if _CORRECTED in name},
            {name.removeprefix(_INPUTS): text for name, text in contents.items() if _INPUTS in name},
        )  # fmt: skip
    except (ValueError, KeyError, TypeError, RuntimeError, OSError, EOFError, zlib.error, zipfile.BadZipFile):
        raise InputError(
            f"is damaged, or no archive of a release ({SCHEMA}); restore the file", file=str(path)
        ) from None
