"""Report files of a batch, and the page of its output folder: HTML, JSON or Markdown by their ending."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from olp.core.version import __version__
from olp.files.folders import from_root
from olp.reports import batch as report_batch
from olp.reports import document
from olp.reports.report import to_json


def in_form(report: Mapping[str, Any], target: Path, folder: Path) -> bytes:
    """The summary in the form that the name of `target` ends in; its links lead from there to the files of
    the output `folder`."""
    if target.suffix.lower() == ".json":
        return to_json(report)
    above = from_root(target).parent

    def place(name: str) -> str:
        try:
            return Path(os.path.relpath(from_root(folder) / name, above)).as_posix()
        except ValueError:
            # on another drive there is no such path
            return name

    return document.in_form(report_batch.to_document(report, __version__, place), target.name)
