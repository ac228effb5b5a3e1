"""Libraries that are installed on request, and what is said where one is missing."""

from __future__ import annotations

from importlib.util import find_spec

from olp.core.errors import CannotCompute


def has_matplotlib() -> bool:
    """Whether the library of plots is installed. It is looked for, and not loaded."""
    try:
        return find_spec("matplotlib") is not None
    except ValueError:
        # something stands in its place that was not loaded from a file
        return False


def require_matplotlib() -> None:
    """Raise CannotCompute where the library of plots is not installed."""
    if not has_matplotlib():
        raise CannotCompute(
            "plots need matplotlib, which is not installed; install it with pip install matplotlib"
        )


def takes_plots(name: str) -> bool:
    """Whether a report of this name has plots: a page, where the library is installed."""
    return name.lower().endswith(".html") and has_matplotlib()
