"""Reads the arrays of a NumPy archive (.npz) that anyone may have written or damaged.

Sizes are compared before memory is taken, and nothing in it is run.
"""

from __future__ import annotations

import io
import lzma
import math
import struct
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.errors import ConfigError

#: bytes that an archive may unpack to: a small one, and for each byte of a large one; arrays of measured
#: numbers shrink to a half or a tenth
_UNPACKED = 8_000_000
_UNPACKED_PER_BYTE = 20
#: the bit of an entry that is encrypted
_ENCRYPTED = 1
#: What the libraries raise for bytes that are no archive, or no array.
_DAMAGED = (
    ValueError, OSError, EOFError, KeyError, IndexError, TypeError, SyntaxError, OverflowError, MemoryError,
    RuntimeError, struct.error, zlib.error, lzma.LZMAError, zipfile.BadZipFile, zipfile.LargeZipFile,
)  # fmt: skip


def read_arrays(data: bytes, names: Iterable[str]) -> dict[str, npt.NDArray[Any]]:
    """Those arrays of the names that the archive has. Raises ValueError, which says what is wrong with it."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = {entry.filename: entry for entry in archive.infolist()}
            wanted = {name: entries[f"{name}.npy"] for name in names if f"{name}.npy" in entries}
            _check_sizes(wanted.values(), len(data))
            return {name: _array(archive.read(entry)) for name, entry in wanted.items()}
    except _Refused as error:
        raise ValueError(str(error)) from None
    except _DAMAGED:
        raise ValueError("it is damaged, or no NumPy archive") from None


def wanted_of(schema: str) -> str:
    """What a covariance of a schema has to be, for messages."""
    return f'expected a file "{schema}" as olp calibrate fit writes it'


def read_covariance_arrays(
    data: bytes, kinds: Mapping[str, str], schema: str, file: str
) -> dict[str, npt.NDArray[Any]]:
    """The arrays of the covariance of a calibration, each of its kind of type. Raises ConfigError for bytes
    that are none, and for an array that is missing or of another type."""
    wanted = wanted_of(schema)
    try:
        arrays = read_arrays(data, kinds)
    except ValueError as error:
        raise ConfigError(f"is not a covariance of a calibration: {error}; {wanted}", file=file) from None
    lacking = [name for name, kind in kinds.items() if name not in arrays or arrays[name].dtype.kind != kind]
    if lacking or str(arrays["schema"]) != schema:
        what = f"array {lacking[0]} is missing or of another type" if lacking else "has another schema"
        raise ConfigError(f"{what}; {wanted}", file=file)
    return arrays


def archive_bytes(arrays: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """The bytes of an archive. The same arrays give the same bytes."""
    archive = io.BytesIO()
    np.savez_compressed(archive, allow_pickle=False, **arrays)
    return archive.getvalue()


class _Refused(Exception):
    """What is wrong with an archive that is readable as such."""


def _check_sizes(entries: Iterable[zipfile.ZipInfo], size: int) -> None:
    total = 0
    for entry in entries:
        if entry.flag_bits & _ENCRYPTED:
            raise _Refused(f"{entry.filename} is encrypted")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise _Refused(f"{entry.filename} is packed in another way than NumPy does it")
        total += entry.file_size
    limit = max(_UNPACKED, _UNPACKED_PER_BYTE * size)
    if total > limit:
        raise _Refused(f"it unpacks to {total} bytes; expected at most {limit} of so small a file")


def _array(raw: bytes) -> npt.NDArray[Any]:
    """The array in a .npy file, whose header states no more than the file has."""
    stream = io.BytesIO(raw)
    version = np.lib.format.read_magic(stream)
    if version not in ((1, 0), (2, 0)):
        raise _Refused(f"its arrays are of version {version}; expected 1.0 or 2.0")
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_column, kind = header(stream)
    count = math.prod(shape)
    body = raw[stream.tell() :]
    if kind.hasobject or min(shape, default=0) < 0 or count * kind.itemsize != len(body):
        raise _Refused("an array has another size than its header states")
    if not count:
        return np.zeros(shape, kind)
    return np.frombuffer(body, kind).reshape(shape, order="F" if by_column else "C")
