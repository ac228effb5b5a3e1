"""What the verbs of measurements share: options, plots in files, and the end of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from olp.cli.common import diagnostic, exit_for, files_of, put, refuse_early, refuse_twice
from olp.cli.options import fail_on_option, force_option, json_option, units_option
from olp.core.errors import UsageError
from olp.core.optional import require_matplotlib
from olp.findings.catalogue import Finding

F = TypeVar("F", bound=Callable[..., Any])
#: Endings of plots.
PLOTS = (".svg", ".png")


def ending_options(function: F) -> F:
    """--json, --fail-on and --force."""
    for option in (
        force_option(),
        fail_on_option,
        json_option("Print the result as JSON."),
        units_option,
    ):  # fmt: skip
        function = option(function)
    return function


def plot_kind(name: str | None) -> str:
    """svg or png by the ending of a plot's file. Raises UsageError."""
    if name is None:
        return "svg"
    ending = Path(name).suffix.lower()
    if ending not in PLOTS:
        raise UsageError(f"the plot {name!r} ends in no known format; expected .svg or .png")
    require_matplotlib()
    return ending[1:]


def numbered(name: str, plots: Mapping[str, bytes]) -> dict[str, bytes]:
    """Plots as files beside each other: name-<plot>.svg."""
    path = Path(name)
    return {str(path.with_name(f"{path.stem}-{key}{path.suffix}")): data for key, data in plots.items()}


def end(
    result: Mapping[str, Any], text: str, files: Mapping[str, bytes], inputs: Iterable[str],
    findings: Iterable[Finding], *, as_json: bool, fail_on: str, force: bool,
) -> None:  # fmt: skip
    """Write the files, print the result, and end with 1 where a finding is at or above `fail_on`."""
    from olp.files.write import write_files
    from olp.reports.report import to_json

    sources = list(inputs)
    refuse_twice(files_of(*files))
    refuse_early(files_of(*files), sources, force=force)
    write_files({Path(name): files[name] for name in files_of(*files)}, force=force, inputs=sources)
    put(to_json(result) if as_json else text)
    for name in files_of(*files):
        diagnostic(f"wrote {name}")
    exit_for(findings, fail_on)
