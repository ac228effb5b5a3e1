"""Unrolls short programs: the text that a control gets, or the refusal."""

from __future__ import annotations

from typing import Any

import pytest

from olp.core.errors import ProgramError
from olp.program.origin import Unrolled
from olp.program.registry import named


def flatten(data: bytes, *, profile: str, **options: Any) -> Unrolled:
    dialect = named(profile)
    assert dialect.unroller is not None
    return dialect.unroller(data, dialect, **options)


def lcnc(text: str, **options: Any) -> str:
    return flatten(text.encode(), profile="linuxcnc", **options).decode()


def fanuc(text: str, **options: Any) -> str:
    return flatten(text.encode(), profile="fanuc", **options).decode()


def refusal(text: str, profile: str = "linuxcnc", **options: Any) -> ProgramError:
    """Why a program, the file p.ngc, is not unrolled."""
    with pytest.raises(ProgramError) as caught:
        flatten(text.encode(), profile=profile, file="p.ngc", **options)
    return caught.value


def refused(text: str, profile: str = "linuxcnc", **options: Any) -> tuple[str, str, int | None]:
    """Code, message and line of a refusal."""
    error = refusal(text, profile, **options)
    return error.code, error.message, error.line
