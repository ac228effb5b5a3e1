"""A payload that a plan does not state: the weight at the gauge point with which readings fit best."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import PurePath

from olp.calibration.joints.adjustment import adjusted, starts_of
from olp.calibration.joints.mistakes import RIGHT, Mended
from olp.calibration.joints.readings import Reading
from olp.calibration.joints.unknowns import Model
from olp.core.errors import CannotCompute, ConfigError
from olp.kinematics.errors import Payload

#: kg: weights at which the readings are looked at; what fits best lies on the parabola through these.
_TRIED_KG = 4.0
#: Chi-square by which twice a weight fits worse where it is known, to some tenth of it.
_KNOWN = 100.0
#: Steps within which readings settle.
_QUICK = 7


def refuse_other_payloads(
    model: Model, readings: Sequence[Reading], file: str, stated: Payload | None = None
) -> None:
    """Raises ConfigError where nothing says what a payload bends, and readings state another one than other
    readings, or than a calibration was `stated` with."""
    if model.yields:
        return
    expected = readings[0].payload if stated is None else stated
    other = next((one for one in readings if one.payload != expected), None)
    if other is None:
        return
    sizes = [f"{one.kg:g} kg at {list(one.centre_mm)} mm" for one in (expected, other.payload)]
    where = "other readings" if stated is None else "the calibration"
    raise ConfigError(
        f"{PurePath(other.source).name} states a payload of {sizes[1]}, and {where} one of {sizes[0]}; "
        "nothing says what a payload bends: fit all readings together, and name the joints that give way in "
        "elasticity",
        file=file,
    )


def unstated_payloads(model: Model, readings: Sequence[Reading]) -> Iterator[Mended]:
    """By each source of readings without a payload the one that it may have had, where joints yield to it."""
    for index, reading in enumerate(readings):
        if not model.yields or reading.payload.kg:
            continue

        def held(kg: float, index: int = index, reading: Reading = reading) -> list[Reading]:
            return [*readings[:index], replace(reading, payload=Payload(kg)), *readings[index + 1 :]]

        try:
            nothing, some, more = (_score(model, held(k * _TRIED_KG)) for k in range(3))
            bend = 0.5 * (nothing - 2.0 * some + more)
            slope = some - nothing - bend
            if not bend > 0.0 > slope:
                continue
            kg = -0.5 * slope / bend * _TRIED_KG
            # where yields are open too, twice the weight fits as well
            known = _score(model, held(2.0 * kg)) - _score(model, held(kg)) > _KNOWN
        except CannotCompute:
            continue
        what = f"a payload of about {kg:.2g} kg" if known else "a payload"
        words = (
            f"{PurePath(reading.source).name}: {what} was on in these readings, which the plan does not state"
        )
        yield words, held(kg), RIGHT


def _score(model: Model, readings: Sequence[Reading]) -> float:
    return adjusted(model, starts_of(model, readings), _QUICK).score
