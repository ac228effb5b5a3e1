"""Centres of the balls of an artefact that the machine touched: tables [[artefacts]]."""

from __future__ import annotations

import numpy as np

from olp.calibration.observations.artefact import Artefact
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.schema import NotNegative, Positive, Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM
from olp.files.measurements.columns import Columns, read_columns
from olp.files.measurements.instruments.base import Instrument, Plan
from olp.files.measurements.point_readings import AXIS, COVARIANCE, covariances
from olp.files.write import PathLike


class ArtefactTable(Table):
    file: Text = Field(
        description="the path of a CSV file with columns pose, ball, X_mm, Y_mm, Z_mm: the axis positions "
        "where the probe is at the centre of a ball, relative to this file"
    )
    certificate: Text = Field(
        description="the path of a CSV file with columns ball, X_mm, Y_mm, Z_mm (places in the frame of the "
        "artefact, or as drawn) and, for balls that are known better, sigma_um"
    )
    sigma_um: Positive | None = Field(
        default=None,
        description="the standard uncertainty of a coordinate of a centre, in um; or columns "
        "covariance_XX_um2, covariance_XY_um2 ... of the file",
    )
    sigma_certificate_um: NotNegative = Field(
        default=0.0,
        description="the standard uncertainty of a coordinate of the certificate, in um; 0: as drawn, so "
        "that several poses have to tell where the balls are",
    )
    tool_mm: Triple | None = Field(
        default=None, description="the vector from the gauge point to the probe, [X, Y, Z] in mm"
    )


class CentreKeys(Table):
    """What a file of centres or a certificate states about itself."""

    tool_mm: Triple | None = Field(
        default=None, description="the vector from the gauge point to the probe, [X, Y, Z] in mm"
    )


def read_certificate(path: PathLike) -> tuple[tuple[str, ...], Array, Array]:
    """Names of balls, their places (balls, 3) and (balls,) standard uncertainties in mm; 0 where none is
    stated. Raises InputError, ConfigError."""
    columns, _ = read_columns(path, CentreKeys, AXIS, ("sigma_um",), words=("ball",))
    names = columns.word["ball"]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ConfigError(f'ball "{twice}" is listed twice; expected each once', file=str(path))
    sigma = columns.number.get("sigma_um", np.zeros(len(names))) * MM_PER_UM
    if (sigma < 0.0).any():
        raise ConfigError("a sigma_um is below 0; expected 0 for places as drawn", file=str(path))
    return names, np.stack([columns.number[name] for name in AXIS], axis=1), sigma


class ArtefactFiles(Instrument[ArtefactTable, Artefact]):
    key = "artefacts"
    table = ArtefactTable
    words = "tables [[artefacts]]: balls that the machine touched with its probe, in one pose or several"
    gives = Artefact
    marks = ("pose", "ball")
    asks = ("certificate", "sigma_um", "tool_mm")

    def read(self, table: ArtefactTable, plan: Plan) -> Artefact:
        path = plan.beside(table.file)
        columns, stated = read_columns(path, CentreKeys, ("pose", *AXIS), COVARIANCE, words=("ball",))
        names, places, sigma = read_certificate(plan.beside(table.certificate))
        unknown = sorted(set(columns.word["ball"]) - set(names))
        if unknown:
            raise ConfigError(
                f'ball "{unknown[0]}" is not in {table.certificate}; expected one of {", ".join(names[:8])}',
                file=str(path),
            )
        tool = table.tool_mm or stated.tool_mm or plan.defaults.tool_mm
        if tool is None:
            raise ConfigError(
                "tool_mm is missing; expected [X, Y, Z] from the gauge point to the probe, in mm"
            )
        covariance, sigma_mm = _spread(columns, table)
        index = {name: k for k, name in enumerate(names)}
        certificate = table.sigma_certificate_um * MM_PER_UM
        return Artefact(
            np.stack([columns.number[name] for name in AXIS], axis=1),
            np.array(tool),
            np.array([index[name] for name in columns.word["ball"]]),
            columns.number["pose"].astype(np.int64),
            places,
            np.where(sigma > 0.0, sigma, certificate),
            sigma_mm,
            str(path),
            columns.line,
            covariance,
        )


def _spread(columns: Columns, table: ArtefactTable) -> tuple[Array | None, float]:
    """The covariance of each centre, where the file has them, and the uncertainty of a coordinate, in mm.
    Raises ConfigError."""
    own = [name for name in COVARIANCE if name in columns.number]
    if bool(own) == (table.sigma_um is not None):
        wrong = "is stated here and in columns of the file" if own else "is missing"
        raise ConfigError(
            f"sigma_um {wrong}; expected the uncertainty of the centres once", file=columns.file
        )
    if not own:
        return None, (table.sigma_um or 0.0) * MM_PER_UM
    if len(own) < len(COVARIANCE):
        raise ConfigError(f"has some covariances only; expected {', '.join(COVARIANCE)}", file=columns.file)
    values = np.stack([columns.number[name] for name in COVARIANCE], axis=1)
    covariance = covariances(values, columns.line, columns.file)
    return covariance, float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean() / 3.0))
