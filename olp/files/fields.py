"""The types of values in files: chains, controls, names of errors and of work offsets."""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Iterable
from typing import Annotated

from olp.core.machine import CHAINS, COMPONENTS, SQUARENESS
from olp.core.patterns import pattern
from olp.core.schema_keys import After, Before, Field, Instead, Shown, refusal
from olp.program.registry import DESCRIBED, DIALECTS

#: Dialects that are built in.
CONTROLLERS = tuple(DIALECTS)
#: Dialects that are described by files which come with `olp`.
SHIPPED = DESCRIBED
#: What `controller` of a machine file may be.
CONTROLLER_NAMES = (*CONTROLLERS, *SHIPPED)
#: ISO 230-1 names of the 21 errors.
ISO_NAMES = COMPONENTS + SQUARENESS
#: The one sign convention of calibration files.
SIGN = "actual-minus-commanded"

#: Work offsets that most machines have.
_USUAL = frozenset(f"G{number}" for number in range(54, 60))
_TOOL_NUMBER = "(0|[1-9][0-9]*)"
# Frames of other languages may have any name, but no program would ever select a misspelt G-code.
_G_OFFSET = pattern(r"G(5[4-9](\.\d)?|1[12]\d|154)( ?P\d{1,3})?|G15 ?H\d{1,3}|G50[05-9]|G5[1-9]\d")


def shown(value: object) -> str:
    """A value as TOML, cut where it is long."""
    if isinstance(value, str):
        import json

        text = json.dumps(value, ensure_ascii=False)
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, datetime.date):
        text = value.isoformat()
    else:
        text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that a misspelt one most likely means."""
    import difflib

    folded = {candidate.casefold(): candidate for candidate in known}
    similar = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.6)
    without_unit = [candidate for candidate in folded if candidate.startswith(name.casefold() + "_")]
    return next((folded[candidate] for candidate in (*without_unit, *similar)), None)


def unknown_dialect(value: object, more: str = "") -> str:
    """What is wrong with a name that no dialect has, and the one that it most likely means."""
    near = nearest(value, CONTROLLER_NAMES) if isinstance(value, str) else None
    hint = f"did you mean {near}?" if near else f"expected one of {', '.join(CONTROLLER_NAMES)}{more}"
    return f"= {shown(value)} is not a dialect that olp knows; {hint}"


def _chain(value: object) -> object:
    if not isinstance(value, str) or value not in CHAINS:
        raise refusal(
            f"= {shown(value)} is not a chain; expected one of the 24 orders of F, X, Y, Z from workpiece to "
            'tool. In "FXYZ" all axes carry the tool; in "YFXZ" the table moves in Y'
        )
    return value


def _controller(value: object) -> object:
    if value not in CONTROLLER_NAMES:
        raise refusal(unknown_dialect(value))
    return value


def _dialect(value: object) -> object:
    described = isinstance(value, str) and value.endswith(".toml")
    if not described and value not in CONTROLLER_NAMES:
        raise refusal(unknown_dialect(value, ", or the path of a file that describes one (.toml)"))
    return value


def _sign(value: object) -> object:
    if value != SIGN:
        raise refusal(
            f'= {shown(value)} is not accepted; expected "{SIGN}". For the opposite sign convention '
            "(commanded minus actual, or compensation values) multiply curve columns, squareness and cyclic "
            f'amplitudes by -1, then write sign = "{SIGN}"'
        )
    return value


def _iso_names(value: object) -> frozenset[str]:
    if value == "all":
        return frozenset({"all"})
    if not isinstance(value, list):
        raise refusal(
            f'= {shown(value)}; expected a list of ISO 230-1 names such as ["EXX", "C0Y"], or "all"'
        )
    unknown = [shown(item) for item in value if item not in ISO_NAMES]
    if unknown:
        raise refusal(
            f"names {', '.join(unknown)}; expected ISO 230-1 names: E, direction X Y Z A B C, axis X Y Z "
            "(EXX, EYX, EAX ...), or C0Y, B0Z, A0Z. Backlash has no name here: if the control takes it up, "
            "leave the axis out of [backlash]"
        )
    return frozenset(value)


def _compliance(value: object) -> float | tuple[float, float, float]:
    parts = value if isinstance(value, list | tuple) and len(value) == 3 else [value]
    numbers = [float(v) for v in parts if isinstance(v, int | float) and not isinstance(v, bool)]
    one = len(parts) == 1
    if len(numbers) < len(parts) or not all(map(math.isfinite, numbers)) or (one and numbers[0] < 0.0):
        raise refusal(
            f"= {shown(value)}; expected the lag of the tool in um per m/s2, 0 or above, or its three values "
            "[X, Y, Z], actual minus commanded"
        )
    return numbers[0] if one else (numbers[0], numbers[1], numbers[2])


def _still_m(number: int) -> int:
    if number == 6:
        raise refusal("has 6; what a tool change moves is stated by tool_change_moves")
    return number


def _still_g(number: float) -> float:
    if abs(number * 10 - round(number * 10)) > 1e-6:
        raise refusal(f"has {number:g}; expected numbers with one decimal at most, such as 64.1")
    return number


def _offset_name(name: str) -> str:
    if name not in _USUAL and re.match(r"[Gg]\d", name) and not _G_OFFSET.fullmatch(name):
        raise refusal('is not a work offset; expected G54 to G59, "G59.1" (in quotes), "G54.1 P1" ...')
    return name


def _tool_number(name: str) -> str:
    if not re.fullmatch(_TOOL_NUMBER, name):
        raise refusal("is not a tool number; expected an integer as name, such as [tools.1]")
    return name


Compliance = Annotated[
    float | tuple[float, float, float],
    Instead(_compliance),
    Shown(
        {
            "anyOf": [
                {"minimum": 0, "type": "number"},
                {"items": {"type": "number"}, "maxItems": 3, "minItems": 3, "type": "array"},
            ],
            "default": 0.0,
        }
    ),
]
IsoNames = Annotated[
    frozenset[str],
    Instead(_iso_names),
    Shown(
        {"anyOf": [{"items": {"enum": list(ISO_NAMES)}, "type": "array"}, {"const": "all"}], "default": []}
    ),
]
ToolNumber = Annotated[str, After(_tool_number), Shown({"type": "string", "pattern": f"^{_TOOL_NUMBER}$"})]
#: The number of an M code that moves no axis.
StillM = Annotated[int, Field(ge=0, le=9999), After(_still_m)]
#: The number of a G code that moves no axis.
StillG = Annotated[float, Field(ge=0, le=299.8), After(_still_g)]
OffsetName = Annotated[str, Field(min_length=1), After(_offset_name)]
Chain = Annotated[str, Before(_chain), Field(shown={"enum": sorted(CHAINS)})]
Controller = Annotated[str, Before(_controller), Field(shown={"enum": [*CONTROLLER_NAMES]})]
ProgramDialect = Annotated[
    str,
    Before(_dialect),
    Field(shown={"anyOf": [{"enum": [*CONTROLLER_NAMES]}, {"pattern": r"\.toml$"}]}),
]
Sign = Annotated[str, Before(_sign), Field(shown={"const": SIGN})]
