"""Controls that correct in real time: by which calibration."""

from __future__ import annotations

from olp.core.errors import ConfigError

#: Digits of a hash that tell two calibrations apart.
_LEAST_DIGITS = 8


def refuse_other(real_time: str, digest: str, file: str | None) -> None:
    """Raises ConfigError where the control corrects by another calibration than that of `file`."""
    if len(real_time) < _LEAST_DIGITS or not digest.startswith(real_time.lower()):
        raise ConfigError(
            f'real_time = "{real_time}": the control corrects by that calibration. The hash of this '
            f"file is {digest[:12]}; expected the same; export it again, load it in the control, state its "
            "hash, or name the file that the control has",
            file=file,
        )
