"""The files of a planned motion: one of each stretch between moves that the control makes by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from olp.core.errors import CannotCompute, UsageError
from olp.core.progress import Progress
from olp.files import trajectory as files
from olp.files.write import write_files
from olp.reports.plots.base import Format as Picture
from olp.trajectory.plan import Trajectory
from olp.workflows.session import PathLike
from olp.workflows.shown import Shown

Format = Literal["csv", "npz", "parquet", "ros", "pvt"]
#: Format of a trajectory, by suffix.
_SUFFIX: Mapping[str, Format] = {".csv": "csv", ".npz": "npz", ".parquet": "parquet", ".json": "ros"}

#: Format of a plot, by suffix.
PICTURES: Mapping[str, Picture] = {".svg": "svg", ".png": "png"}

#: Default time between samples: a common servo cycle of controls.
CYCLE_S = 1e-3


class StretchFiles(Shown):
    """A result with a trajectory for each stretch of a program, in the axes of `columns`."""

    __slots__ = ()

    if TYPE_CHECKING:

        @property
        def trajectories(self) -> tuple[Trajectory, ...]: ...

    @property
    def columns(self) -> files.Columns:
        """The axes of the trajectories and their units."""
        return files.LINEAR

    def stretch(self, number: int | None) -> Trajectory:
        """The trajectory of a stretch, counted from 1; None for the only one. Raises CannotCompute where
        there are several, and UsageError for an impossible number."""
        count = len(self.trajectories)
        if number is None and count != 1:
            raise CannotCompute(
                f"the program has {count} stretches, between which the control moves by itself (tool "
                "changes, G28 and similar, probing), so there is no one trajectory; take them one by one"
            )
        if number is not None and not 1 <= number <= count:
            raise UsageError(f"there is no stretch {number}; the program has {count}, counted from 1")
        return self.trajectories[(number or 1) - 1]

    def parts(
        self, kind: Format = "csv", cycle_s: float = CYCLE_S, stretch: int | None = None
    ) -> Iterator[bytes]:
        """The samples of every `cycle_s` as a file of a format, part by part; of one stretch, counted from
        1, where there are several.

        Raises CannotCompute as `trajectory` does, UsageError for an impossible stretch or cycle, and
        ConfigError for Parquet without pyarrow.
        """
        trajectory = self.stretch(stretch)
        files.check_cycle(trajectory, cycle_s)
        return _WRITERS[kind](trajectory, cycle_s, self.columns)

    def files(
        self, path: PathLike, kind: Format | None = None, cycle_s: float = CYCLE_S,
        stretch: int | None = None, progress: Progress | None = None,
    ) -> dict[Path, Iterator[bytes]]:  # fmt: skip
        """The files of `write`, by path: one file, or `name-1.csv`, `name-2.csv` ... of several stretches."""
        target = Path(path)
        chosen = format_of(target, kind)
        if stretch is not None or len(self.trajectories) == 1:
            return {target: self._counted(chosen, cycle_s, stretch, progress)}
        self.any_stretch()
        return {
            numbered(target, number): self._counted(chosen, cycle_s, number, progress)
            for number in range(1, len(self.trajectories) + 1)
        }

    def _counted(
        self, kind: Format, cycle_s: float, stretch: int | None, progress: Progress | None
    ) -> Iterator[bytes]:
        parts = self.parts(kind, cycle_s, stretch)
        whole = max(self.stretch(stretch).duration_s / cycle_s / files.ROWS, 1.0)
        for done, part in enumerate(parts):
            yield part
            if progress is not None:
                progress("write", min(done / whole, 1.0))

    def any_stretch(self) -> None:
        """Raises CannotCompute for a program without moves."""
        if not self.trajectories:
            raise CannotCompute("the program has no moves, so there is no trajectory")

    def write(
        self, path: PathLike, kind: Format | None = None, cycle_s: float = CYCLE_S,
        stretch: int | None = None, *, force: bool = False,
    ) -> list[Path]:  # fmt: skip
        """Write the samples; the format is that of the suffix (.csv, .npz, .parquet, .json for ROS) unless
        given. All files or none. Raises as `parts`, `format_of` and `olp.files.write.write_files` do."""
        written = self.files(path, kind, cycle_s, stretch)
        write_files(written, force=force)
        return list(written)


_WRITERS: Mapping[Format, Callable[[Trajectory, float, files.Columns], Iterator[bytes]]] = {
    "csv": files.csv, "npz": files.npz, "parquet": files.parquet, "ros": files.ros, "pvt": files.pvt,
}  # fmt: skip


def format_of(target: PathLike, kind: Format | None) -> Format:
    """The format of a trajectory: `kind`, else that of the ending of the file. Raises UsageError for an
    ending that names none."""
    chosen = kind or _SUFFIX.get(Path(target).suffix.lower())
    if chosen is None:
        endings = ", ".join(_SUFFIX)
        raise UsageError(
            f"the trajectory {str(target)!r} ends in no known format; expected {endings} (.json for ROS), or "
            "name the format"
        )
    return chosen


def picture_of(target: Path) -> Picture:
    """The format of a plot. Raises UsageError for an ending that names none."""
    kind = PICTURES.get(target.suffix.lower())
    if kind is None:
        raise UsageError(f"the plot {str(target)!r} ends in no known format; expected .svg or .png")
    return kind


def numbered(target: Path, number: int) -> Path:
    """The file of a stretch, counted from 1, where there are several."""
    return target.with_name(f"{target.stem}-{number}{target.suffix}")
