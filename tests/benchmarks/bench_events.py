"""CPU time and memory of `olp correct` on programs of one kind of line, compared with LinuxCNC.

    python tests/benchmarks/bench_events.py [--lines 12000] [--twice] [kind ...]

A row for each kind of `cases.event_lines`: user CPU seconds of the whole command (the least of three), that
of `rs274 -g` on the same file in the same minute, their ratio, and the peak memory. Kinds are all by default;
`long` has 1e5 lines at 12,000 of the others. With `--twice` the rows state growth: seconds of twice the lines
by seconds of the lines, both beyond what a program of ten lines takes, of holes and arcs too. Growth beyond
`MOST` is marked: 2 is linear, 4 is quadratic.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench_correct import ENVIRONMENT, TEN_LINES, machine, user_seconds
from bench_cycles import arcs, holes
from cases.event_lines import KINDS, program

#: as many more lines of a kind
MORE = {"long": 25 / 3, "deleted": 4 / 3}
#: growth at twice the lines that is no sum of linear ones
MOST = 2.6


def text_of(kind: str, lines: int) -> str:
    """A program of a kind of `KINDS`, of holes or of arcs."""
    whole = {"holes": holes, "arcs": arcs}
    return whole[kind](lines) if kind in whole else program(kind, lines)


class Folder:
    """A folder with a machine and programs, and how long commands take on these."""

    def __init__(self, path: Path, times: int) -> None:
        self.path, self.times, self.text = path, times, path / "part.ngc"
        self.machine = machine(path)
        offset = '[work_offsets.G55]\nset_by = "true"\nX_mm = 2.0\n'
        self.machine.write_text(self.machine.read_text() + offset)
        ENVIRONMENT["PYTHONPYCACHEPREFIX"] = str(path / "bytecode")
        (path / "tool.tbl").write_text("T1 P1 Z60\nT2 P2 Z60\n")
        # the first run compiles, too
        self.correct(TEN_LINES)

    def correct(self, text: str) -> tuple[float, int]:
        """User CPU and peak memory of `olp correct` on a program."""
        self.text.write_text(text)
        call = ["correct", str(self.text), "-m", str(self.machine), "-o", str(self.path / "out.ngc")]
        return user_seconds([sys.executable, "-m", "olp", *call, "--force", "--quiet"], self.times)

    def listing(self) -> float:
        """User CPU of LinuxCNC on the last program."""
        if not shutil.which("rs274"):
            return float("nan")
        table, canon = self.path / "tool.tbl", self.path / "canon.txt"
        return user_seconds(["rs274", "-g", "-t", str(table), str(self.text), str(canon)], self.times)[0]


def ratios(folder: Folder, lines_of: dict[str, int]) -> None:
    print("| kind | lines | olp correct s | rs274 s | ratio | us a line | peak MB |")
    print("|---|---|---|---|---|---|---|")
    for kind, lines in lines_of.items():
        cpu, peak = folder.correct(text_of(kind, lines))
        listing = folder.listing()
        print(
            f"| {kind} | {lines} | {cpu:.2f} | {listing:.3f} | {cpu / listing:.1f} x "
            f"| {cpu / lines * 1e6:.0f} | {peak / 1024:.0f} |",
            flush=True,
        )


def growth(folder: Folder, lines_of: dict[str, int]) -> None:
    print("| kind | lines | s | s of twice the lines | growth |")
    print("|---|---|---|---|---|")
    still, _ = folder.correct(TEN_LINES)
    for kind, lines in lines_of.items():
        once, twice = (folder.correct(text_of(kind, n))[0] - still for n in (lines, 2 * lines))
        grown = twice / once
        mark = " not linear" if grown > MOST else ""
        print(f"| {kind} | {lines} | {once:.2f} | {twice:.2f} | {grown:.2f}{mark} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("kinds", nargs="*", metavar="kind")
    parser.add_argument("--lines", type=float, default=12_000, help="of most kinds")
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--twice", action="store_true", help="growth at twice the lines")
    options = parser.parse_args()
    kinds = options.kinds or [*KINDS, *(("holes", "arcs") if options.twice else ())]
    lines_of = {kind: round(options.lines * MORE.get(kind, 1.0)) for kind in kinds}
    with tempfile.TemporaryDirectory() as name:
        (growth if options.twice else ratios)(Folder(Path(name), options.times), lines_of)


if __name__ == "__main__":
    main()
