"""C tables: each number with all its digits, and each list once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.interpolation import Interpolant

#: Numbers in one line of the source.
_IN_LINE = 6
#: No struct, no list.
NONE = "0"


class Data:
    """Gathers the tables of a model; `lines` are their definitions in order."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._names: dict[tuple[str, ...], str] = {}

    def numbers(self, values: Iterable[float] | Array) -> str:
        """The name of a list of doubles."""
        return self._list("double", [real(v) for v in np.asarray(values, float).ravel().tolist()])

    def integers(self, values: Iterable[int]) -> str:
        return self._list("int", [str(int(v)) for v in values])

    def one(self, kind: str, fields: str) -> str:
        """The name of a struct, without the & before it."""
        key = (kind, fields)
        if key not in self._names:
            self._names[key] = f"olp_d{len(self._names)}"
            self.lines.append(f"static const {kind} {self._names[key]} = {fields};")
        return self._names[key]

    def array(self, name: str, kind: str, items: Sequence[str]) -> None:
        """A list of structs; C has no empty one."""
        body = ",\n    ".join(items or ["{0}" if not kind.endswith("*") else "0"])
        self.lines.append(f"static const {kind} {name}[] = {{\n    {body}}};")

    def _list(self, kind: str, texts: list[str]) -> str:
        key = (kind, *texts)
        if key not in self._names:
            name = self._names[key] = f"olp_d{len(self._names)}"
            rows = [", ".join(texts[i : i + _IN_LINE]) for i in range(0, len(texts), _IN_LINE)]
            body = ",\n    ".join(rows)
            self.lines.append(f"static const {kind} {name}[] = {{{body}}};")
        return self._names[key]


def real(value: float) -> str:
    """A double with all its digits."""
    return repr(float(value) + 0.0)


def triple(values: Iterable[float]) -> str:
    """A list of numbers as C writes one inside of a struct."""
    return "{" + ", ".join(real(v) for v in values) + "}"


def pair(row: Sequence[float]) -> str:
    """A row of a box."""
    return f"{{{real(row[0])}, {real(row[1])}}}"


def curve(data: Data, values: Interpolant, column: int) -> str:
    """The name of a struct olp_curve."""
    lists = [data.numbers(v) for v in (values.x, values.y[:, column], values.slopes[:, column])]
    return data.one("olp_curve", f"{{{len(values.x)}, {int(values.kind == 'pchip')}, {', '.join(lists)}}}")


def defines(sizes: Mapping[str, object]) -> str:
    """What the engine has to know before it reads the tables."""
    return "".join(f"#define {name} {value}\n" for name, value in sizes.items())


def written(rows: Array) -> str:
    """The file of test vectors: one per line, with all digits."""
    return "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist())
