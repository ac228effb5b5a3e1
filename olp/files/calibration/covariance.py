"""The uncertainty of a calibration in files: a covariance (.npz), or sigma columns and keys.

"olp-covariance-1" is a NumPy archive without objects: `kind`, `name`, `period_mm` and `count` (entries,) say
what numbers there are; `position_mm` and `rest` (numbers,), `factor` (numbers, rank), in mm and rad;
`fingerprint` of the calibration, `source` in words and `dropped`, the share of a variance that the factor
leaves out.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np

from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, ZERO
from olp.errormodel.calibration import Calibration
from olp.errormodel.entry import Entry
from olp.errormodel.sources.registry import NUMBERS, SOURCES
from olp.errormodel.uncertainty import Uncertainty, fingerprint, of_sigmas
from olp.files.calibration.reader import CalibrationReading
from olp.files.calibration.schema import covariance_of
from olp.files.write import PathLike, Reader, read_bytes

SCHEMA = "olp-covariance-1"
_ARRAYS = {
    "schema": "U", "fingerprint": "U", "source": "U", "dropped": "f", "kind": "U", "name": "U",
    "period_mm": "f", "count": "i", "position_mm": "f", "factor": "f", "rest": "f",
}  # fmt: skip


def load_uncertainty(
    path: PathLike, calibration: Calibration, read: Reader = read_bytes
) -> Uncertainty | None:
    """What is known of the uncertainty of a calibration that was read from `path`; None where nothing is.

    The file that [covariance] names wins over sigma columns and keys. Raises InputError where a file cannot
    be read, ConfigError where it is no covariance, or that of another calibration.
    """
    reading = CalibrationReading(path, {}, read)
    stated = covariance_of(reading.file)
    if stated.file is not None:
        named = FilePath(path).parent / stated.file
        found: Uncertainty | None = parse_covariance(read(named), str(named))
        if found is not None and found.fingerprint != fingerprint(calibration):
            raise ConfigError(
                f"is the covariance of another calibration than {FilePath(path).name}: that has been changed "
                "since, or the files belong to different machines; make both again with olp calibrate fit, "
                "or take the key file out of [covariance]",
                file=str(named),
            )
    else:
        found = of_sigmas(
            calibration,
            {source.key: source.sigmas(source.stated(reading.file), reading) for source in SOURCES},
        )
    repeatability = calibration.repeatability_mm or ZERO
    if found is None and (any(repeatability) or stated.temperature_K):
        found = Uncertainty((), fingerprint(calibration), "nothing is known of the calibration itself")
    if found is None:
        return None
    return replace(
        found,
        repeatability_mm=repeatability,
        growth_per_year=stated.growth_per_year,
        temperature_K=stated.temperature_K,
    )


def covariance_bytes(uncertainty: Uncertainty) -> bytes:
    """The bytes of an "olp-covariance-1" file. The same numbers give the same bytes."""
    entries = uncertainty.entries
    places = [e.position_mm if len(e.position_mm) else np.zeros(len(e.rest)) for e in entries]
    arrays = {
        "schema": np.array(SCHEMA),
        "fingerprint": np.array(uncertainty.fingerprint),
        "source": np.array(uncertainty.source),
        "dropped": np.array(uncertainty.dropped),
        "kind": np.array([e.kind for e in entries]),
        "name": np.array([e.name for e in entries]),
        "period_mm": np.array([e.period_mm for e in entries]),
        "count": np.array([len(e.rest) for e in entries], np.int64),
        "position_mm": np.concatenate(places),
        "factor": np.concatenate([e.factor for e in entries]).astype(np.float32),
        "rest": np.concatenate([e.rest for e in entries]),
    }
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=False, **arrays)
    return out.getvalue()


def parse_covariance(data: bytes, file: str) -> Uncertainty:
    """As written by `covariance_bytes`. Raises ConfigError."""
    wanted = f'expected a file "{SCHEMA}" as olp calibrate fit writes it'
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            found = {name: np.asarray(archive[name]) for name in archive.files}
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, zipfile.LargeZipFile):
        raise ConfigError(f"is no covariance of a calibration; {wanted}", file=file) from None
    lacking = [name for name, kind in _ARRAYS.items() if name not in found or found[name].dtype.kind != kind]
    if lacking or found["schema"].shape != () or str(found["schema"]) != SCHEMA:
        what = f"array {lacking[0]} is missing or of another type" if lacking else "has another schema"
        raise ConfigError(f"{what}; {wanted}", file=file)
    count = found["count"]
    total = int(count.sum()) if count.size and (count > 0).all() else -1
    per_entry = all(found[name].shape == count.shape for name in ("kind", "name", "period_mm"))
    per_number = all(found[name].shape == (total,) for name in ("position_mm", "rest"))
    factor = found["factor"]
    if not per_entry or not per_number or factor.ndim != 2 or len(factor) != total or count.ndim != 1:
        raise ConfigError(f"its arrays do not fit each other; {wanted}", file=file)
    entries = []
    ends = np.cumsum(count).tolist()
    try:
        for k, last in enumerate(ends):
            own = slice(last - int(count[k]), last)
            kind = str(found["kind"][k])
            if kind not in NUMBERS:
                # those of component errors first
                known = sorted(NUMBERS, key=lambda name: NUMBERS[name].names != COMPONENTS)
                raise ConfigError(f"kind '{kind}'; expected one of {', '.join(known)}")
            position = found["position_mm"][own].astype(float) if kind in ("mean", "half") else np.zeros(0)
            entries.append(
                Entry(
                    kind, str(found["name"][k]), factor[own],
                    found["rest"][own].astype(float), position, float(found["period_mm"][k]),
                )
            )  # fmt: skip
        return Uncertainty(
            tuple(entries), str(found["fingerprint"]), str(found["source"]), float(found["dropped"])
        )
    except ConfigError as error:
        raise error.in_file(file) from None
