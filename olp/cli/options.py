"""Options of several verbs: each is defined once, and a verb may give the text of its help."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from olp.cli.common import DIALECT, KNOWN, STREAM, diagnostic, no_page
from olp.core.errors import UsageError
from olp.core.optional import has_matplotlib
from olp.core.patterns import pattern
from olp.core.units import unit_of_key

F = TypeVar("F", bound=Callable[..., Any])


#: A number with a decimal comma, and one with a unit.
_COMMA = pattern(r"[-+]?\d*,\d+")
_UNIT = pattern(r"[-+]?[\d.]+\s*[A-Za-z\u00b5\u03bc/%]+")


def renamed_option(old: str, new: str, *, flag: bool = False, values: int = 1) -> Callable[[F], F]:
    """An option that has another name now: using it is an error that says which."""

    def refuse(context: click.Context, _: click.Parameter, value: object) -> None:
        if value not in (None, False):
            raise click.UsageError(f"{old} is now {new}.", context)

    return click.option(
        old, f"renamed_{old.strip('-').replace('-', '_')}", is_flag=flag, nargs=values, hidden=True,
        expose_value=False, callback=refuse, help=f"Now {new}.",
    )  # fmt: skip


def _readable(value: Any, read: type[int] | type[float], what: str) -> Any:
    """The value, if it is such a number. Raises click.BadParameter in plain words."""
    try:
        read(value)
    except ValueError:
        text = str(value)
        hint = "; write a decimal point" if _COMMA.fullmatch(text) else ""
        hint = "; leave the unit out, which the name of the option states" if _UNIT.fullmatch(text) else hint
        raise click.BadParameter(f"{value!r} is not {what}; expected {what}, such as 5{hint}") from None
    return value


def number_in(value: Any, unit: str | None) -> Any:
    """The value, if it is a number, or a text such as "0.002 in" as a number of a unit. Raises
    click.BadParameter."""
    if unit is None or not isinstance(value, str):
        return _readable(value, float, "a number")
    try:
        return float(value)
    except ValueError:
        from olp.core.quantities import quantity

        try:
            return quantity(value, unit)
        except ValueError as error:
            raise click.BadParameter(f"{value!r} is not a number in {unit}; {error}") from None


def _unit(param: click.Parameter | None) -> str | None:
    """The unit in which the name of an option ends."""
    return None if param is None or param.name is None else unit_of_key(param.name)


class Number(click.types.FloatParamType):
    """Any number; with a unit also a text such as "0.002 in"."""

    def __init__(self, unit: str | None = None) -> None:
        super().__init__()
        self.unit = unit

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        return float(super().convert(number_in(value, self.unit or _unit(param)), param, ctx))


class Range(click.FloatRange):
    """A number within limits."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        return float(super().convert(number_in(value, _unit(param)), param, ctx))


class Integer(click.types.IntParamType):
    """Any integer."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        return int(super().convert(_readable(value, int, "an integer"), param, ctx))


class Count(click.IntRange):
    """An integer within limits."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        return int(super().convert(_readable(value, int, "an integer"), param, ctx))


class Length(Range):
    """A finite number above zero."""

    def __init__(self) -> None:
        super().__init__(min=0.0, min_open=True)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


NUMBER = Number()
#: A length in mm.
MM = Number("mm")


def machine_option(help: str = "The machine file.", *, required: bool = False) -> Callable[[F], F]:
    """-m, for verbs without a job."""
    return click.option("-m", "--machine", metavar="machine.toml", required=required, help=help)


def setup_options(function: F) -> F:
    """-m, -j and --dialect, which every verb that needs a machine takes; one that reads a program takes
    `program_options`."""
    function = click.option(
        "--dialect",
        metavar="NAME",
        expose_value=False,
        callback=_keep_dialect,
        help="The dialect, such as apt, or a file that describes it. Default: detected from text and ending.",
    )(function)
    function = click.option(
        "-j", "--job", metavar="job.toml", help="The job file: what changes from job to job."
    )(function)
    return machine_option()(function)


def _keep_dialect(context: click.Context, _: click.Parameter, value: str | None) -> None:
    context.meta[DIALECT] = value


def _keep_known(context: click.Context, parameter: click.Parameter, values: tuple[str, ...]) -> None:
    if values:
        assert parameter.name is not None
        context.meta.setdefault(KNOWN, {})[parameter.name] = values


#: --skew, --scale and --backlash: name, metavar, and what a value says.
_KNOWN_ERRORS = (
    ("--backlash", "AXIS=LENGTH", "backlash of an axis, such as X=0.05mm."),
    ("--scale", "AXIS=RATIO", "an axis moves too far, such as X=0.2mm/m."),
    (
        "--skew", "AXES=RATIO",
        "XY=1.4mm/m where Y leans toward +X by 1.4 mm per m; likewise XZ and YZ of Z. Or C0Y, B0Z, A0Z with "
        "the sign of ISO 230-1.",
    ),
)  # fmt: skip


def known_errors(says: str) -> Callable[[F], F]:
    """--skew, --scale and --backlash: errors stated in the call; their help begins with what `says`."""

    def decorate(function: F) -> F:
        for name, metavar, help in _KNOWN_ERRORS:
            option = click.option(
                name, multiple=True, metavar=metavar, expose_value=False, callback=_keep_known,
                help=says + help,
            )  # fmt: skip
            function = option(function)
        return function

    return decorate


#: The same for verbs that need no more of a machine.
known_options = known_errors("Without a machine file: ")


class Day(click.DateTime):
    """A day such as 2026-05-14, or `today`: nothing else reads the system clock."""

    def __init__(self) -> None:
        super().__init__(["%Y-%m-%d"])

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> datetime.datetime:
        if value == "today":
            return datetime.datetime.now()
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is not a day; expected one such as 2026-05-14, or today", param, ctx)


def _day(
    ctx: click.Context, parameter: click.Parameter, value: datetime.datetime | None
) -> datetime.date | None:
    return None if value is None else value.date()


def day_option(help: str, name: str = "--date") -> Callable[[F], F]:
    """--date and other days."""
    return click.option(name, type=Day(), callback=_day, metavar="YYYY-MM-DD", help=help)


def codes(_: click.Context, __: click.Parameter, values: tuple[str, ...]) -> tuple[str, ...]:
    """Codes of an option that may be repeated, and may hold several separated by commas."""
    return tuple(code.strip() for value in values for code in value.split(",") if code.strip())


def _acceptable(
    context: click.Context, parameter: click.Parameter, values: tuple[str, ...]
) -> tuple[str, ...]:
    accepted = codes(context, parameter, values)
    if accepted:
        from olp.workflows.doubt import acceptable

        acceptable(accepted)
    return accepted


def doubt_options(function: F, of: str = "run") -> F:
    """--date and --accept, of every verb that doubts its inputs; the date is that `of` something."""
    function = click.option(
        "--accept", multiple=True, callback=_acceptable, metavar="CODES",
        help="Go on in spite of these doubts about the inputs, such as OLP409; may be repeated.",
    )(function)  # fmt: skip
    day = day_option(f"The day of the {of}, or today; it is compared with valid_until of the calibration.")
    return day(function)


def output_option(
    metavar: str, help: str | None = None, *, page: bool = False, **settings: Any
) -> Callable[[F], F]:
    """-o; a file that is no `page` may not be named as one."""
    check = None if page else _no_page
    return click.option("-o", "--output", metavar=metavar, help=help, callback=check, **settings)


def file_option(name: str, metavar: str, help: str) -> Callable[[F], F]:
    """A further file that is written, and that is no page."""
    return click.option(name, metavar=metavar, help=help, callback=_no_page)


def _no_page(_: click.Context, __: click.Parameter, name: str | None) -> str | None:
    return None if name is None else no_page(name)


def json_option(help: str = "Print the report as JSON.") -> Callable[[F], F]:
    """--json."""
    return click.option("--json", "as_json", is_flag=True, help=help)


def _units(context: click.Context, _: click.Parameter, value: str | None) -> None:
    if value is not None:
        from olp.reports.shown import shown_in

        context.with_resource(shown_in(value))


def units_option(function: F) -> F:
    """--units, of every verb that prints a report for people."""
    return click.option(
        "--units", type=click.Choice(["mm", "inch"]), expose_value=False, callback=_units,
        help="Units of lengths in reports for people; JSON and findings keep theirs. Default: mm.",
    )(function)  # fmt: skip


def quiet_option(help: str) -> Callable[[F], F]:
    """-q; its help says what is left out."""
    return click.option("-q", "--quiet", is_flag=True, help=help)


def force_option(what: str = "output files") -> Callable[[F], F]:
    """--force; its help says what may be overwritten."""
    return click.option("--force", is_flag=True, help=f"Overwrite {what}.")


def plot_option(help: str) -> Callable[[F], F]:
    """--plot."""
    return click.option("--plot", metavar="FILE", help=help)


def reflector_option(help: str, *, several: bool = False) -> Callable[[F], F]:
    """--reflector."""
    return click.option("--reflector", multiple=several, type=(MM, MM, MM), metavar="X Y Z", help=help)


def sigma_option(help: str) -> Callable[[F], F]:
    """--sigma-um."""
    return click.option("--sigma-um", type=Length(), help=help)


def instrument_options(function: F) -> F:
    """--sigma-um and --reflector, for points of a tracker in a file that may not state them."""
    function = reflector_option("Vector from the gauge point to the reflector in mm, if the file has none.")(
        function
    )
    function = renamed_option("--tool", "--reflector", values=3)(function)
    return sigma_option("Standard uncertainty of a coordinate, if the file has none.")(function)


def report_option(endings: Sequence[str] = (".html", ".json", ".md")) -> Callable[[F], F]:
    """--report; the ending of the file's name decides its form."""

    def check(_: click.Context, __: click.Parameter, name: str | None) -> str | None:
        if name not in (None, STREAM) and Path(name).suffix.lower() not in endings:
            raise UsageError(f"is not a form of this report; expected {', '.join(endings)}", file=name)
        if name is not None and name.lower().endswith(".html") and not has_matplotlib():
            diagnostic("note: the report has no plots: matplotlib is not installed (pip install matplotlib)")
        return name

    return click.option(
        "--report", "report_file", metavar="FILE", callback=check,
        help=f"Also write the report: {' or '.join(', '.join(endings).rsplit(', ', 1))}.",
    )  # fmt: skip


def outside_box_option(refused: str, held: str, default: str = "refuse") -> Callable[[F], F]:
    """--outside-box; its help says what each choice does."""
    return click.option(
        "--outside-box",
        type=click.Choice(["refuse", "hold"]),
        default=default,
        show_default=True,
        help=f"Outside the calibrated box: {refused}, or {held}.",
    )


fail_on_option = click.option(
    "--fail-on",
    type=click.Choice(["info", "warning", "error", "never"]),
    default="error",
    show_default=True,
    help="Exit with 1 where a finding is at least this severe.",
)
turn_tolerance_option = click.option(
    "--tolerance-urad",
    type=Length(),
    default=10.0,
    show_default=True,
    help="Numerical tolerance of the orientation on machines with rotary joints, in urad.",
)
contour_option = click.option(
    "--contour",
    type=click.Choice(["contour", "path"]),
    default="contour",
    show_default=True,
    help="Write contours under G41/G42 as contours, or as the path of the tool without compensation.",
)
tolerance_option = click.option(
    "--tolerance-um",
    type=Length(),
    default=1.0,
    show_default=True,
    help="Numerical tolerance: largest deviation of the corrected path, without rounding.",
)


def cycle_options(function: F) -> F:
    """--expand-cycles and --peck-clearance-mm."""
    function = click.option(
        "--peck-clearance-mm",
        type=Length(),
        help="For --expand-cycles: clearance above the last peck, a parameter of Fanuc and Haas.",
    )(function)
    return click.option("--expand-cycles", is_flag=True, help="Write canned cycles out as plain moves.")(
        function
    )


def program_options(function: F) -> F:
    """-m, -j and --dialect, and how a program is unrolled: the options of every verb that reads one."""
    function = cycle_options(function)
    function = click.option(
        "--flatten", is_flag=True, help="Write out loops, subprograms and expressions first."
    )(function)
    return setup_options(function)


def part_tolerance_option(says: str) -> Callable[[F], F]:
    """--part-tolerance-um; its help says what is judged by it."""
    return click.option("--part-tolerance-um", type=Length(), help=says)


def confidence_options(function: F) -> F:
    """Options of every verb that shows uncertainties."""
    for option in (
        renamed_option("--within-um", "--part-tolerance-um"),
        part_tolerance_option(
            "The tolerance of the part: says whether the part is good, and with what probability. "
            "Default: the job's, else none."
        ),
        click.option(
            "--only-sure-components",
            is_flag=True,
            help="Leave out calibration components that are within their expanded uncertainty (k = 2).",
        ),
    ):
        function = option(function)
    return function


def proof_options(function: F) -> F:
    """Options of `correct` and `verify`."""
    for option in (
        fail_on_option,
        json_option(),
        units_option,
        doubt_options,
        turn_tolerance_option,
        tolerance_option,
    ):
        function = option(function)
    return function
