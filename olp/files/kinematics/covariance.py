"""The covariance of a calibration of any joints in a file.

"olp-joint-covariance-1" is a NumPy archive without objects. `table`, `part`, `key` and `leg` (k,) name the
unknowns as the calibration file does, `number` (k,) is what it states of each and `covariance` (k, k) how
well that is known, in mm and rad. `lines` is the hash of the nominal machine that these are relative to.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from olp.calibration.joints.candidates import Unknown
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.values import dataclass
from olp.files.kinematics.numbers import number_of
from olp.files.write import PathLike, Reader, read_bytes
from olp.kinematics.structure import Structure

SCHEMA = "olp-joint-covariance-1"
#: The arrays of the archive, each with the kind of its type.
_ARRAYS = {
    "schema": "U", "lines": "U", "table": "U", "part": "U", "key": "U", "leg": "i", "prior": "f",
    "number": "f", "covariance": "f",
}  # fmt: skip
#: Numbers of a calibration agree with those of its covariance within this, mm or rad.
_SAME = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class JointCovariance:
    """The unknowns of a calibration with their covariance (k, k) in mm and rad, and the hash of the nominal
    machine."""

    unknowns: tuple[Unknown, ...]
    covariance: Array
    lines: str


def lines_of(structure: Structure) -> str:
    """The hash of where a nominal machine has its lines; travels and limits do not count."""
    joints = [(j.name, j.kind, j.direction, j.point_mm) for j in structure.joints.values()]
    nominal = (structure.chain, joints, structure.platforms, structure.gauge)
    return hashlib.sha256(repr(nominal).encode()).hexdigest()


def joint_covariance_bytes(known: JointCovariance, values: Mapping[str, Any]) -> bytes:
    """The bytes of the covariance of a calibration with these keys. The same numbers give the same bytes."""
    from olp.files.archive import archive_bytes

    unknowns = known.unknowns
    arrays = {
        "schema": np.array(SCHEMA),
        "lines": np.array(known.lines),
        "table": np.array([unknown.table for unknown in unknowns]),
        "part": np.array([unknown.part for unknown in unknowns]),
        "key": np.array([unknown.key for unknown in unknowns]),
        "leg": np.array([unknown.leg for unknown in unknowns], np.int64),
        "prior": np.array([unknown.prior for unknown in unknowns], float),
        "number": np.array([number_of(values, unknown) for unknown in unknowns], float),
        "covariance": known.covariance,
    }
    return archive_bytes(arrays)


def load_joint_covariance(
    path: PathLike, values: Mapping[str, Any], structure: Structure, read: Reader = read_bytes
) -> JointCovariance | None:
    """The covariance of a calibration file with these keys, None where it names none. Raises InputError where
    it cannot be read, ConfigError where it is none, or of another calibration or machine."""
    named = values.get("covariance", {}).get("file")
    if named is None:
        return None
    file = Path(path).parent / named
    arrays = _arrays(read(file), str(file))
    columns = (arrays[name].tolist() for name in ("table", "part", "key", "prior", "leg"))
    unknowns = tuple(Unknown(*row) for row in zip(*columns, strict=True))
    try:
        same = all(
            abs(number_of(values, unknown) - number) < _SAME
            for unknown, number in zip(unknowns, arrays["number"].tolist(), strict=True)
        )
    except (ValueError, IndexError):
        same = False
    if not same:
        raise ConfigError(
            f"does not belong to {Path(path).name}, whose numbers have changed since; write both again with "
            "olp calibrate fit, or remove the table [covariance]",
            file=str(file),
        )
    if str(arrays["lines"]) != lines_of(structure):
        raise ConfigError(
            "is of another nominal machine: the lines of the machine file have changed since, and a "
            "calibration is relative to them; fit it again, or put them back",
            file=str(file),
        )
    return JointCovariance(unknowns, arrays["covariance"].astype(float), str(arrays["lines"]))


def _arrays(data: bytes, file: str) -> dict[str, Any]:
    """The arrays of an archive. Raises ConfigError."""
    from olp.files.archive import read_covariance_arrays, wanted_of

    arrays, wanted = read_covariance_arrays(data, _ARRAYS, SCHEMA, file), wanted_of(SCHEMA)
    count = len(np.atleast_1d(arrays["key"]))
    rows = all(
        arrays[name].shape == (count,) for name in _ARRAYS if name not in ("schema", "lines", "covariance")
    )
    table = arrays["covariance"]
    whole = rows and count > 0 and table.shape == (count, count) and bool(np.isfinite(table).all())
    if not whole or not _positive(table.astype(float)):
        raise ConfigError(f"its arrays do not fit each other; {wanted}", file=file)
    return arrays


def _positive(table: Array) -> bool:
    """Whether a matrix is symmetric and positive definite."""
    size = np.sqrt(np.abs(np.diag(table)))
    if not size.all():
        return False
    scaled = table / np.outer(size, size)
    try:
        np.linalg.cholesky(scaled + 1e-13 * np.eye(len(size)))
    except np.linalg.LinAlgError:
        return False
    return bool(np.abs(scaled - scaled.T).max() < 1e-9)
