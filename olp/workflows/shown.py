"""What results of all verbs offer to those who use arrays and notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from olp.core.arrays import Array, Index, Mask, read_only
from olp.core.units import UM_PER_MM
from olp.files.write import write_files

if TYPE_CHECKING:
    from olp.findings.catalogue import Finding
    from olp.proof.judgement import Judgements


PathLike = str | Path


class Shown:
    """A result with a report for people: `print(result.to_text())`, and as it is in a notebook."""

    __slots__ = ()

    if TYPE_CHECKING:
        report: dict[str, Any]
        findings: tuple[Finding, ...]

    def to_text(self) -> str:
        """The report as the command line prints it."""
        from olp.reports.outline import outline

        return outline(self.full_report())

    def full_report(self) -> dict[str, Any]:
        """The report with its findings, as the command line writes it with `--json`."""
        return {**self.report, "findings": [finding.as_dict() for finding in self.findings]}

    def _repr_html_(self) -> str:
        """The report of `to_text` in a notebook, with the verdict as a colour."""
        from olp.reports.notebook import fragment

        verdict = self.report.get("verdict")
        return fragment(self.to_text(), verdict.get("ok") if isinstance(verdict, Mapping) else None)


class Filed(Shown):
    """A result that is several files, such as a calibration and its curves."""

    __slots__ = ()

    if TYPE_CHECKING:
        inputs: tuple[str, ...]

    def files(self, target: PathLike) -> dict[Path, bytes]:
        """The bytes of the files by path."""
        raise NotImplementedError

    def write(self, path: PathLike, *, force: bool = False) -> list[Path]:
        """Write the files of `files(path)`, all or none. Existing ones are overwritten with `force` only, and
        what was read never. Returns the paths. Raises as `olp.files.write.write_files`."""
        files = self.files(path)
        write_files(files, force=force, inputs=self.inputs)
        return list(files)


class Judged(Shown):
    """A result with a table of judgements; its columns are read-only arrays, one row per nominal move."""

    __slots__ = ()

    if TYPE_CHECKING:
        table: Judgements

    @property
    def line(self) -> Index:
        """(n,) the line of each move in the nominal program."""
        return read_only(self.table.line.astype(np.int64))

    @property
    def tool(self) -> Index:
        """(n,) the number of the tool, -1 where there is none."""
        return read_only(self.table.tool)

    @property
    def judged(self) -> Mask:
        """(n,) whether the move counts in the verdict; rapids do not."""
        return read_only(self.table.judged)

    @property
    def over(self) -> Mask:
        """(n,) whether it counts and is above what is allowed."""
        return read_only(self.table.over)

    @property
    def uncorrected_um(self) -> Array:
        """(n,) the largest distance of the tip from the nominal path with the nominal program, in um; NaN
        where a position is unknown."""
        return read_only(self.table.uncorrected.astype(np.float64) * UM_PER_MM)

    @property
    def corrected_um(self) -> Array:
        """(n,) the same with the corrected program."""
        return read_only(self.table.corrected.astype(np.float64) * UM_PER_MM)
