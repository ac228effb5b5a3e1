"""CSV files of measured positions of the tip, as `olp simulate` and a tracker write them."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.exceptions import InputError
from olp.files.write import PathLike, read_bytes

Array = npt.NDArray[np.float64]

_POSITION = ("X_mm", "Y_mm", "Z_mm")
#: columns that may stand beside the positions; `line` is what `olp simulate` adds
_BESIDE = ("t_s", "line")
_FRAME = re.compile(r"\s*#\s*frame\s*=\s*(.*?)\s*", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """(n, 3) positions of the tip in mm in the work offset `frame` ("machine": axis positions less active
    tool lengths), in the order of time, and the line of the file that each stands in (n,); (n,) `time_s`
    where the file has it."""

    file: str
    frame: str
    position_mm: Array
    line: npt.NDArray[np.int64]
    time_s: Array | None


def read_measured(path: PathLike) -> Measured:
    """Read `X_mm,Y_mm,Z_mm[,t_s]` with a line `# frame=G54` before it. Raises InputError with file and
    line."""
    return parse_measured(read_bytes(path), str(path))


def parse_measured(data: bytes, file: str) -> Measured:
    """As `read_measured`, from the bytes of the file."""
    text = data.decode("utf-8-sig", "replace").replace("\r\n", "\n").replace("\r", "\n")
    frame, header, numbers = None, None, []
    rows: list[str] = []
    for number, line in enumerate(text.split("\n"), 1):
        if line.lstrip().startswith("#"):
            stated = _FRAME.fullmatch(line)
            if stated:
                if frame is not None and stated[1] != frame:
                    raise InputError(
                        f"the frame is {stated[1]!r} here and {frame!r} before; expected one frame a file",
                        file=file, line=number,
                    )  # fmt: skip
                frame = stated[1]
        elif line.strip():
            if header is None:
                header = _header(line, file, number)
            else:
                rows.append(line)
                numbers.append(number)
    if frame is None or not frame:
        raise InputError(
            "names no frame; expected a line such as `# frame=G54`, the work offset that the positions count "
            "in, or `# frame=machine`",
            file=file, line=1,
        )  # fmt: skip
    if header is None or not rows:
        raise InputError("holds no positions; expected the columns X_mm,Y_mm,Z_mm[,t_s]", file=file)
    values = _values(rows, numbers, header, file)
    place = [header.index(name) for name in _POSITION]
    time = values[:, header.index("t_s")] if "t_s" in header else None
    line_of = np.array(numbers, np.int64)
    if time is not None and (np.diff(time) < 0).any():
        back = int(np.flatnonzero(np.diff(time) < 0)[0]) + 1
        raise InputError(
            "t_s runs backwards; expected positions in the order of time", file=file, line=numbers[back]
        )
    return Measured(file, frame, values[:, place], line_of, time)


def _header(line: str, file: str, number: int) -> list[str]:
    names = [name.strip() for name in line.split(",")]
    missing = [name for name in _POSITION if name not in names]
    unknown = [name for name in names if name not in (*_POSITION, *_BESIDE)]
    if missing or unknown or len(set(names)) < len(names):
        what = f"column {unknown[0]!r} is not known" if unknown else f"the columns are {line.strip()[:80]!r}"
        raise InputError(f"{what}; expected X_mm,Y_mm,Z_mm[,t_s]", file=file, line=number)
    return names


def _values(rows: list[str], numbers: list[int], header: list[str], file: str) -> Array:
    """All rows at once; where that fails, the first row that is wrong."""
    try:
        values = np.loadtxt(io.StringIO("\n".join(rows)), delimiter=",", ndmin=2, comments=None)
        if values.shape[1] == len(header) and np.isfinite(values).all():
            return np.asarray(values, float)
    except ValueError:
        pass
    for row, number in zip(rows, numbers, strict=True):
        cells = row.split(",")
        if len(cells) != len(header):
            raise InputError(
                f"{len(cells)} values under {len(header)} columns; expected one value a column",
                file=file,
                line=number,
            )
        for name, cell in zip(header, cells, strict=True):
            try:
                good = bool(np.isfinite(float(cell)))
            except ValueError:
                good = False
            if not good:
                raise InputError(f"{name} = {cell.strip()[:40]!r}; expected a number", file=file, line=number)
    raise InputError("cannot be read as numbers", file=file)
