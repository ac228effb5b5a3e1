"""The questions of `olp init` on a terminal: what neither an option nor a file states."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import click

from olp.cli.common import diagnostic
from olp.cli.options import Day, number_in
from olp.core.errors import UsageError
from olp.core.machine import CHAINS, SQUARENESS
from olp.core.units import AXES
from olp.errormodel.known import KnownErrors
from olp.files.fields import CONTROLLER_NAMES, unknown_dialect
from olp.files.machine_settings.base import Settings
from olp.workflows.init import CHAIN, CONTROLLER, InitOptions, stated_travel

T = TypeVar("T")

#: The answer to a question for an error that is not known.
_NONE = "unknown"
#: Two numbers, each perhaps with a unit, with a blank between them.
_TWO_ENDS = re.compile(r"\s*([-+]?[\d.]+)\s*([a-z\"]*)(?:\s*,)?\s+([-+]?[\d.]+)\s*([a-z\"]*)\s*")
#: By option of known errors: their names, and an example.
_KNOWN = (
    ("skew", SQUARENESS, "0.4mm/600mm"),
    ("backlash", tuple(AXES), "0.05mm"),
    ("scale", tuple(AXES), "120um/m where it moves too far"),
)
_CHAINS = """Which axes move the workpiece?
  FXYZ  none: a gantry, Y on X, Z on Y          FYXZ  none: X on Y
  YFXZ  the table in Y                          XYFZ  the table in X, on a saddle in Y
"""


def asked(options: InitOptions, settings: Settings | None) -> InitOptions:
    """The options with the answers of a person. Raises KeyboardInterrupt where the person ends the call."""
    try:
        return _asked(options, settings)
    except click.Abort:
        raise KeyboardInterrupt from None


def _asked(options: InitOptions, settings: Settings | None) -> InitOptions:
    if options.controller is None and settings is None:
        known = ", ".join(CONTROLLER_NAMES)
        options = replace(options, controller=_ask(f"Control ({known})", _control, CONTROLLER))
    if options.chain is None:
        diagnostic(_CHAINS)
        options = replace(options, chain=_ask("Chain, from workpiece to tool", _chain, CHAIN))
    travel = dict(options.travel_mm)
    for axis in AXES:
        if axis not in stated_travel(options, settings):
            travel[axis] = _ask(f"Travel of {axis}: lowest and highest position, such as 0 500 mm", _ends)
    options = replace(options, travel_mm=travel)
    return options if options.known else _measured(options)


def _measured(options: InitOptions) -> InitOptions:
    if not click.confirm("Do you know an error of the machine as a number, such as squareness?", err=True):
        return options
    answers: dict[str, list[str]] = {}
    for kind, names, example in _KNOWN:
        given = [(name, _ask(f"{kind} {name}, such as {example}", _of(kind, name), _NONE)) for name in names]
        answers[kind] = [f"{name}={text}" for name, text in given if text != _NONE]
    options = replace(options, known=KnownErrors.of(**answers))
    if options.known and options.measured is None:
        day = _ask("Measured on (YYYY-MM-DD, or today)", lambda text: Day().convert(text, None, None))
        options = replace(options, measured=day.date())
    return options


def _ask(question: str, read: Callable[[str], T], default: str | None = None) -> T:
    """The answer as `read` takes it; asked again where that raises click.BadParameter."""
    answer: Any = click.prompt(question, default=default, value_proc=read, err=True)
    return answer  # type: ignore[no-any-return]


def _control(text: str) -> str:
    if text not in CONTROLLER_NAMES:
        raise click.BadParameter(unknown_dialect(text))
    return text


def _chain(text: str) -> str:
    if text.upper() not in CHAINS:
        raise click.BadParameter(f"{text!r} is not an order of F, X, Y, Z; expected such as FXYZ")
    return text.upper()


def _ends(text: str) -> tuple[float, float]:
    """Two lengths; a unit of one is that of both."""
    ends = _TWO_ENDS.fullmatch(text)
    if ends is None:
        raise click.BadParameter("expected two positions and perhaps a unit, such as 0 500 mm, or 0 20 in")
    first, unit, second, other = ends.groups()
    low = float(number_in(f"{first} {unit or other}".strip(), "mm"))
    high = float(number_in(f"{second} {other or unit}".strip(), "mm"))
    if not low < high:
        raise click.BadParameter(f"{low:g} to {high:g} mm is empty; expected the lowest position first")
    return low, high


def _of(kind: str, name: str) -> Callable[[str], str]:
    """Takes a text that states a known error."""

    def read(text: str) -> str:
        if text != _NONE:
            try:
                KnownErrors.of(**{kind: [f"{name}={text}"]})
            except UsageError as error:
                raise click.BadParameter(str(error)) from None
        return text

    return read
