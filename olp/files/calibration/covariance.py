"""The uncertainty of a calibration in files: a covariance (.npz), or sigma columns and keys.

"olp-covariance-1" is a NumPy archive without objects. `kind`, `name`, `period_mm` and `count` (entries,)
describe the numbers of the calibration. `position_mm` and `rest` (numbers,) and `factor` (numbers, rank) are
in mm and rad. `fingerprint` is that of the calibration, `source` describes the origin in words, and `dropped`
is the share of a variance that the factor leaves out.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np

from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, ZERO, Machine
from olp.errormodel.calibration import Calibration
from olp.errormodel.entry import Entry
from olp.errormodel.sources.registry import NUMBERS, SOURCES
from olp.errormodel.uncertainty import Uncertainty, fingerprint, of_sigmas
from olp.files.calibration.reader import CalibrationReading, load_calibration
from olp.files.calibration.schema import covariance_of
from olp.files.write import PathLike, Reader, read_bytes

SCHEMA = "olp-covariance-1"
#: The arrays of the archive, each with the kind of its type.
_ARRAYS = {
    "schema": "U", "fingerprint": "U", "source": "U", "dropped": "f", "kind": "U", "name": "U",
    "period_mm": "f", "count": "i", "position_mm": "f", "factor": "f", "rest": "f",
}  # fmt: skip


def load_uncertainty(
    path: PathLike, calibration: Calibration, read: Reader = read_bytes
) -> Uncertainty | None:
    """The uncertainty of a calibration that was read from `path`, None where its files state none.

    The file that [covariance] names overrides sigma columns and keys. Raises InputError where a file cannot
    be read, ConfigError where it is not a covariance, or belongs to another calibration.
    """
    reading = CalibrationReading(path, {}, read)
    stated = covariance_of(reading.file)
    if stated.file is not None:
        named = FilePath(path).parent / stated.file
        uncertainty: Uncertainty | None = parse_covariance(read(named), str(named))
        if uncertainty is not None and uncertainty.fingerprint != fingerprint(calibration):
            raise ConfigError(
                f"does not belong to {FilePath(path).name}: the calibration has changed since, or is of "
                "another machine; write both again with olp calibrate fit, or remove the key file from "
                "[covariance]",
                file=str(named),
            )
    else:
        uncertainty = of_sigmas(
            calibration,
            {source.key: source.sigmas(source.stated(reading.file), reading) for source in SOURCES},
        )
    repeatability = calibration.repeatability_mm or ZERO
    if uncertainty is None and (any(repeatability) or stated.temperature_K):
        uncertainty = Uncertainty((), fingerprint(calibration), "nothing is known of the calibration itself")
    if uncertainty is None:
        return None
    return replace(
        uncertainty,
        repeatability_mm=repeatability,
        growth_per_year=stated.growth_per_year,
        temperature_K=stated.temperature_K,
    )


def load_known(
    path: PathLike, machine: Machine, read: Reader = read_bytes
) -> tuple[Calibration, Uncertainty]:
    """The calibration of `path` for a machine of the chain of `machine`, and its uncertainty.

    Raises InputError where a file cannot be read, ConfigError where it is wrong or states no uncertainty.
    """
    calibration = load_calibration(path, replace(machine, calibration=str(path)), read=read)
    uncertainty = load_uncertainty(path, calibration, read)
    if uncertainty is None or not uncertainty.entries:
        raise ConfigError(
            "states no uncertainty; expected [covariance], or keys and columns that begin with sigma_",
            file=str(path),
        )
    return calibration, uncertainty


def covariance_bytes(uncertainty: Uncertainty) -> bytes:
    """The bytes of an "olp-covariance-1" file. The same numbers give the same bytes."""
    from olp.files.archive import archive_bytes

    entries = uncertainty.entries
    positions = [e.position_mm if len(e.position_mm) else np.zeros(len(e.rest)) for e in entries]
    arrays = {
        "schema": np.array(SCHEMA),
        "fingerprint": np.array(uncertainty.fingerprint),
        "source": np.array(uncertainty.source),
        "dropped": np.array(uncertainty.dropped),
        "kind": np.array([e.kind for e in entries]),
        "name": np.array([e.name for e in entries]),
        "period_mm": np.array([e.period_mm for e in entries]),
        "count": np.array([len(e.rest) for e in entries], np.int64),
        "position_mm": np.concatenate(positions),
        "factor": np.concatenate([e.factor for e in entries]).astype(np.float32),
        "rest": np.concatenate([e.rest for e in entries]),
    }
    return archive_bytes(arrays)


def parse_covariance(data: bytes, file: str) -> Uncertainty:
    """As written by `covariance_bytes`. Raises ConfigError."""
    from olp.files.archive import read_covariance_arrays, wanted_of

    arrays, wanted = read_covariance_arrays(data, _ARRAYS, SCHEMA, file), wanted_of(SCHEMA)
    count = arrays["count"]
    whole = count.ndim == 1 and count.size and (count > 0).all() and (count <= arrays["rest"].size).all()
    total = int(count.sum()) if whole else -1
    alone = all(arrays[name].shape == () for name in ("schema", "fingerprint", "source", "dropped"))
    per_entry = all(arrays[name].shape == count.shape for name in ("kind", "name", "period_mm"))
    per_number = all(arrays[name].shape == (total,) for name in ("position_mm", "rest"))
    factor = arrays["factor"]
    # a covariance of so many numbers has no higher rank
    fits = factor.ndim == 2 and len(factor) == total and factor.shape[1] <= total
    if not (alone and per_entry and per_number and fits):
        raise ConfigError(f"its arrays do not fit each other; {wanted}", file=file)
    entries = []
    ends = np.cumsum(count).tolist()
    try:
        for k, last in enumerate(ends):
            own = slice(last - int(count[k]), last)
            kind = str(arrays["kind"][k])
            if kind not in NUMBERS:
                # the kinds of component errors first
                known = sorted(NUMBERS, key=lambda name: NUMBERS[name].names != COMPONENTS)
                raise ConfigError(f"kind '{kind}'; expected one of {', '.join(known)}")
            position = arrays["position_mm"][own].astype(float) if kind in ("mean", "half") else np.zeros(0)
            entries.append(
                Entry(
                    kind, str(arrays["name"][k]), factor[own],
                    arrays["rest"][own].astype(float), position, float(arrays["period_mm"][k]),
                )
            )  # fmt: skip
        return Uncertainty(
            tuple(entries), str(arrays["fingerprint"]), str(arrays["source"]), float(arrays["dropped"])
        )
    except ConfigError as error:
        raise error.in_file(file) from None
