"""A calibration as the text of its files: an olp-calibration-1 file, and the files of its sources beside
it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.errormodel.calibration import Calibration
from olp.errormodel.quality import Fitted
from olp.errormodel.uncertainty import Uncertainty
from olp.files.calibration.covariance import covariance_bytes
from olp.files.fields import SIGN
from olp.files.toml_text import comment, toml_document, toml_lines

#: Decimals of chi-square and degrees of freedom: more say nothing.
_QUALITY_DIGITS = 3


def calibration_files(
    calibration: Calibration,
    target: Path,
    *,
    sigma: Mapping[str, Array] | None = None,
    covariance: Uncertainty | None = None,
    notes: Sequence[str] = (),
) -> dict[Path, bytes]:
    """The bytes of `target`, an olp-calibration-1 file, and of its curves `<stem>-x.csv` ..., maps
    `<stem>-map.csv` and loads `<stem>-load.csv` beside it.

    `sigma` holds standard uncertainties by component, (n,) in mm or rad at the positions of its curve.
    `covariance` becomes `<stem>-covariance.npz`, and notes become comments. Curves read back as the very same
    doubles. So does every other number of 15 digits or fewer in the unit of its key; longer ones read back
    within the last bit. The temperatures of a job are not part of a calibration and are not written. Raises
    ConfigError where the date of measuring is missing, or where a sigma fits no curve.
    """
    if calibration.measured is None:
        raise ConfigError("the calibration has no date of measuring; give it, such as 2026-05-14")
    writing = CalibrationWriting(target, calibration.machine, sigma or {})
    for source, values in calibration.sources():
        source.write(values, writing)
    writing.finish()
    if covariance is not None:
        archive = target.with_name(f"{target.stem}-covariance.npz")
        writing.files[archive] = covariance_bytes(covariance)
        stated = {
            "growth_per_year": covariance.growth_per_year or None,
            "temperature_K": covariance.temperature_K or None,
        }
        writing.table("[covariance]", {"file": archive.name, **stated})
    for header, values in _quality(calibration):
        writing.table(header, values)
    above = [*(line for note in notes for line in comment(note)), *_head(calibration)]
    text = "\n".join(above) + "\n" + toml_document(writing.tables)
    return {target: text.encode(), **writing.files}


class CalibrationWriting:
    """A calibration while it is written: the tables behind the head of `target`, and the files beside it."""

    def __init__(self, target: Path, machine: str, sigma: Mapping[str, Array]) -> None:
        self.machine = machine
        self.files: dict[Path, bytes] = {}
        self.tables: list[tuple[str, dict[str, object]]] = []
        self._target, self._sigma = target, dict(sigma)
        self._names: list[str] = []

    def sigma(self, component: str) -> Array | None:
        return self._sigma.pop(component, None)

    def table(self, header: str, values: Mapping[str, object]) -> None:
        self.tables.append((header, dict(values)))

    def find(self, header: str) -> dict[str, object] | None:
        return next((values for name, values in reversed(self.tables) if name == header), None)

    def csv(self, what: str, text: str) -> str:
        self._names.append(_unused(f"{self._target.stem}-{what}", self._names))
        return self._put(self._names[-1], text)

    def document(self, what: str, tables: Iterable[tuple[str, Mapping[str, object]]]) -> str:
        return self._put(f"{self._target.stem}-{what}.toml", toml_document(tables))

    def finish(self) -> None:
        """Raises ConfigError where a standard uncertainty belongs to no curve."""
        if self._sigma:
            named = ", ".join(sorted(self._sigma))
            raise ConfigError(f"sigma of {named} fits no curve; expected names of its curves")

    def _put(self, name: str, text: str) -> str:
        self.files[self._target.with_name(name)] = text.encode()
        return name


def _unused(stem: str, names: Sequence[str]) -> str:
    count = sum(name.startswith((f"{stem}.", f"{stem}-")) for name in names)
    return f"{stem}.csv" if not count else f"{stem}-{count + 1}.csv"


def _head(calibration: Calibration) -> Iterator[str]:
    active = sorted(calibration.active_during_measurement)
    yield from comment(
        "Errors of the machine: actual minus commanded, of the tool relative to the workpiece."
    )
    yield from toml_lines(
        {
            "schema": "olp-calibration-1",
            "machine": calibration.machine,
            "measured": calibration.measured,
            "valid_until": calibration.valid_until,
            "temperature_degC": calibration.temperature_degC,
            "sign": SIGN,
            "model": calibration.model,
            "datum_mm": calibration.datum_mm,
            "box_mm": calibration.box_mm.tolist(),
            "payload_kg": calibration.payload_kg or None,
            "active_during_measurement": "all" if active == ["all"] else active,
        }
    )


def _quality(calibration: Calibration) -> Iterator[tuple[str, dict[str, object]]]:
    if calibration.quality is None:
        return
    yield "[quality]", _figures(calibration.quality.total)
    for fitted in calibration.quality.sources:
        yield "[[quality.sources]]", {"source": Path(fitted.source).name, **_figures(fitted)}


def _figures(fitted: Fitted) -> dict[str, object]:
    return {
        "chi_square": round(fitted.chi_square, _QUALITY_DIGITS),
        "degrees_of_freedom": round(fitted.freedom, _QUALITY_DIGITS),
    }
