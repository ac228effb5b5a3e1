"""The unknowns of a fit as numbers of a calibration file: where each stands among its keys."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from olp.calibration.joints.candidates import Unknown

#: Decimals of um and urad: a thousandth of a digit of any control.
_DECIMALS = 4
#: Locations that a file may state as squareness, by axis and key.
_SQUARE = {("Y", "C_urad"): "C0Y_urad", ("Z", "B_urad"): "B0Z_urad", ("Z", "A_urad"): "A0Z_urad"}


def number_of(values: Mapping[str, Any], unknown: Unknown) -> float:
    """What the keys of a calibration state of an unknown, in mm, rad or rad per Nm; 0 where nothing."""
    table, key, place = _place(copy.deepcopy(dict(values)), unknown)
    stated = table.get(key, 0.0)
    return float(stated if place is None else stated[place] if stated else 0.0) * unknown.scale


def put_number(values: dict[str, Any], unknown: Unknown, number: float) -> None:
    """State an unknown, in mm, rad or rad per Nm, among the keys of a calibration."""
    table, key, place = _place(values, unknown)
    rounded = round(number / unknown.scale, _DECIMALS) + 0.0
    if place is None:
        table[key] = rounded
    else:
        table.setdefault(key, [0.0, 0.0, 0.0])[place] = rounded


def _place(values: dict[str, Any], unknown: Unknown) -> tuple[dict[str, Any], str, int | None]:
    """The table of an unknown, made where there is none, its key there, and its place in a vector."""
    if unknown.leg:
        legs: list[dict[str, Any]] = values.setdefault("legs", [])
        same = [leg for leg in legs if (leg["platform"], leg["leg"]) == (unknown.part, unknown.leg)]
        if not same:
            same = [{"platform": unknown.part, "leg": unknown.leg}]
            legs += same
        # an end has three coordinates, such as base_X_um
        end, _, rest = unknown.key.partition("_")
        return (
            (same[-1], f"{end}_um", "XYZ".index(rest[0]))
            if end != "length"
            else (same[-1], unknown.key, None)
        )
    if unknown.table == "gravity":
        key, *angles = unknown.key.split()
        terms: list[dict[str, Any]] = values.setdefault("gravity", [])
        names = [f"E{letter}{unknown.part}" for letter in (unknown.part, *"ABC")]
        like = [term for term in terms if term["component"] in names and term["angles"] == angles]
        if not like:
            like = [{"component": names[0], "angles": angles}]
            terms += like
        return like[-1], key, None
    square = _SQUARE.get((unknown.part, unknown.key))
    if square is not None and square in values.get("squareness", {}):
        return values["squareness"], square, None
    return values.setdefault(unknown.table, {}).setdefault(unknown.part, {}), unknown.key, None
