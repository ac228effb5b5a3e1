"""Speed and memory of `olp` on every kind of program, as one table.

    python tests/benchmarks/bench_speed.py [--only WORD ...] [--share 1.0] [--beside CHECKOUT]

A row for each kind: user CPU seconds of the whole command (the least of two), what it is set beside, the
ratio of the two, what the ratio or the seconds should be at most, and the peak memory. Beside it stands
`rs274 -g` of the same file, `python -c "import numpy"`, or the same run without what is measured. With
`--beside` the last column has the ratio to another checkout, such as the last release, in turn. `--share`
makes all programs shorter.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench_correct import ENVIRONMENT, ROOT, TEN_LINES, machine, user_seconds
from bench_cycles import arcs, holes
from bench_reports import touches, with_sigmas
from cases.event_lines import program

_TOOLS = "T1 P1 Z60\nT2 P2 Z60\n"


@dataclass(frozen=True, slots=True)
class Row:
    """A kind of program: the `words` of the command, and of what it is `beside`, which may be empty."""

    name: str
    words: list[str]
    beside: list[str]
    reach: str


class Table:
    """The rows, with their programs in a folder."""

    def __init__(self, folder: Path, share: float) -> None:
        self.folder, self.share = folder, share
        self.machine = machine(folder)
        offset = '[work_offsets.G55]\nset_by = "true"\nX_mm = 2.0\n'
        self.machine.write_text(self.machine.read_text() + offset)
        self.unsure = with_sigmas(self.machine, folder / "unsure")
        (folder / "tool.tbl").write_text(_TOOLS)

    def rows(self) -> Iterator[Row]:
        """All rows; the program of each is made when it is asked for."""
        numpy = [sys.executable, "-c", "import numpy"]
        yield self._row("10 lines", TEN_LINES, numpy, "1.8 x")
        yield self._row("1e4 lines, raster", self._raster(1e4), numpy, "1.8 x")
        for name, text, reach in (
            ("1e6 lines, raster", self._raster(1e6), "0.7 x, 200 MB"),
            ("1e5 arcs", arcs(self._count(1e5)), "2 x"),
            ("2e4 canned holes", holes(self._count(2e4)), "3 x"),
            ("12,000 lines, G90 and G91", program("switches", self._count(12e3)), "5 x"),
            ("12,000 lines, all events", program("mixed", self._count(12e3)), "5 x"),
            ("1e5 long lines", program("long", self._count(1e5)), "10 x, 300 MB"),
        ):
            yield self._row(name, text, self._listing(name), reach)
        yield self._row("16,000 lines under /", program("deleted", self._count(16e3)), [], "1 s")
        raster = self._raster(1e5)
        plain = self._row("1e5 lines", raster, [], "")
        base = [sys.executable, "-m", "olp", *plain.words]
        yield self._row("1e5 lines, sigma columns", raster, base, "2 x", machine=self.unsure)
        yield self._row("1e5 lines, HTML report", raster, [], "3 s", "--report", str(self.folder / "r.html"))
        yield self._row("1e5 lines, page", raster, [], "3 s", "--review", str(self.folder / "v.html"))
        table, dmis = touches(self.folder, self._count(1e6))
        for name, file in (("1e6 results, table", table), ("1e6 results, DMIS", dmis)):
            words = [
                "results",
                str(file),
                "-o",
                str(self.folder / f"o{file.suffix}"),
                "-m",
                str(self.machine),
            ]
            words += ["--tip-radius-mm", "1", "--frame", "machine", "--tool", "1", "--force", "--quiet"]
            yield Row(name, words, [], "10 s, 300 MB")

    def _count(self, count: float) -> int:
        return max(10, round(count * self.share))

    def _raster(self, count: float) -> str:
        generate = [str(ROOT / "programs" / "generate.py"), "raster", str(self._count(count)), "-o", "-"]
        return subprocess.run([sys.executable, *generate], check=True, capture_output=True, text=True).stdout

    def _file(self, name: str) -> Path:
        return self.folder / f"{name.replace(' ', '-').replace('/', '')}.ngc"

    def _row(
        self, name: str, text: str, beside: list[str], reach: str, *more: str, machine: Path | None = None
    ) -> Row:
        self._file(name).write_text(text)
        words = ["correct", str(self._file(name)), "-m", str(machine or self.machine)]
        words += ["-o", str(self.folder / "out.ngc"), *more, "--force", "--quiet"]
        return Row(name, words, beside, reach)

    def _listing(self, name: str) -> list[str]:
        table, canon = self.folder / "tool.tbl", self.folder / "canon.txt"
        return ["rs274", "-g", "-t", str(table), str(self._file(name)), str(canon)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[""], metavar="WORD", help="rows whose name has a word")
    parser.add_argument("--share", type=float, default=1.0, help="of the lengths")
    parser.add_argument(
        "--beside", metavar="CHECKOUT", type=os.path.abspath, help="another checkout of this project"
    )
    options = parser.parse_args()
    print("| program | user CPU | beside it | ratio | to reach | peak | to the other checkout |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        table = Table(folder, options.share)
        # run beside no checkout, so that the path alone says which `olp` it is
        os.chdir(folder)
        ENVIRONMENT["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        ENVIRONMENT["PYTHONPATH"] = str(ROOT)
        user_seconds([sys.executable, "-m", "olp", "--version"], 1)
        for row in table.rows():
            if not any(word in row.name for word in options.only):
                continue
            cpu, peak = user_seconds([sys.executable, "-m", "olp", *row.words], 2)
            beside = ratio = "-"
            if row.beside and shutil.which(row.beside[0]):
                seconds, _ = user_seconds(row.beside, 2)
                beside, ratio = f"{seconds:.2f} s", f"{cpu / seconds:.2f} x"
            other = "-"
            if options.beside:
                ENVIRONMENT["PYTHONPATH"] = options.beside
                other = f"{cpu / user_seconds([sys.executable, '-m', 'olp', *row.words], 2)[0]:.2f} x"
                ENVIRONMENT["PYTHONPATH"] = str(ROOT)
            memory = f"{peak / 1024:.0f} MB"
            print(
                f"| {row.name} | {cpu:.2f} s | {beside} | {ratio} | {row.reach} | {memory} | {other} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
