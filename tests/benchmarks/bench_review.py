"""Size of review pages and the time that it takes to make, open, draw and pick them.

    python tests/benchmarks/bench_review.py [points ...] [--lines] [--no-time] [--browser] [--keep FOLDER]

A finishing raster on a machine with all 21 errors, measured too, with a workpiece mesh. By default a few
thousand blocks carry the points; with `--lines` every point is a block of its own. Packing is from samples to
the bytes of the page. `--browser` measures Chromium by playwright, where both are installed, with software
rendering: time until the page is ready, of one frame, and of picks.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from itertools import chain, islice
from pathlib import Path
from typing import Any

import bench_correct
import numpy as np

import olp
from olp.files.write import write_bytes
from olp.review.job import Review, view
from olp.review.manifest import manifest_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "programs"))

BROWSER = [
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
#: blocks that carry the points unless each has its own
BLOCKS = 4000
#: mm; the plate in X and Y
WIDE = 1000.0
DEEP = 600.0


def program(folder: Path, blocks: int) -> tuple[Path, float]:
    """A raster of `blocks` blocks, and its length in mm."""
    import generate

    path = folder / "raster.ngc"
    if blocks > BLOCKS:
        text = islice(
            chain(generate.START, generate.raster(blocks), generate.END), blocks + len(generate.START)
        )
        path.write_text("\n".join(text) + "\nM30\n")
        return path, blocks * 1.2
    rows = blocks // 16
    lines = [*generate.START]
    for row in range(rows):
        y = DEEP * row / rows
        ends = np.linspace(0.0, WIDE, 16)[:: 1 if row % 2 == 0 else -1]
        lines += [f"G1 X{x:.3f} Y{y:.3f} Z{generate.surface(x, y):.4f} F3000" for x in ends]
    path.write_text("\n".join([*lines, *generate.END]) + "\n")
    return path, rows * WIDE


def job(folder: Path, points: int, *, lines: bool) -> tuple[Path, Path, float | None]:
    """Program, job file and step of the samples."""
    machine = bench_correct.machine(folder)
    path, length = program(folder, points if lines else BLOCKS)
    mesh = folder / "plate.obj"
    corners = [(x, y, z) for z in (-60, -30) for y in (0, DEEP) for x in (0, WIDE)]
    faces = [(1, 3, 2), (2, 3, 4), (5, 6, 7), (6, 8, 7), (1, 2, 5), (2, 6, 5), (3, 7, 4), (4, 7, 8)]
    mesh.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {a} {b} {c}\n" for a, b, c in faces)
    )
    described = folder / "job.toml"
    described.write_text(
        f'schema = "olp-job-1"\nprogram = "{path.name}"\nmachine = "{machine.name}"\n'
        '[[meshes]]\nfile = "plate.obj"\nrole = "workpiece"\nframe = "G54"\n'
    )
    return path, described, None if lines else length / points


def measured(folder: Path, path: Path, described: Path, points: int) -> Path:
    """The predicted run of the machine, as a tracker would measure it at a quarter of the points."""
    setup = olp.load_setup(None, described)
    step = {True: 4.0, False: 2.0}[points > 300_000]
    target = folder / "measured.csv"
    write_bytes(target, olp.simulate(path, setup, step_mm=step).to_csv(), force=True)
    return target


def run(points: int, folder: Path, *, lines: bool, timed: bool, browser: bool) -> str:
    path, described, step = job(folder, points, lines=lines)
    other = measured(folder, path, described, points)
    begin = time.perf_counter()
    review = view(path, olp.load_setup(None, described), measured=[other], time=timed, step_mm=step)
    viewed = time.perf_counter() - begin
    packed, page = pack(review)
    arrays = manifest_of(review.scene)[1]
    target = folder / f"review-{points}{'-lines' if lines else ''}.html"
    target.write_bytes(page)
    count = len(review.scene.samples)
    print(
        f"{count} points, {review.scene.nominal.lines} lines: view {viewed:.1f} s, pack {packed:.2f} s, "
        f"{len(page) / 1e6:.2f} MB, {len(arrays.encoded()) / count:.1f} bytes per point"
    )
    if browser:
        print("  " + ", ".join(f"{name} {value}" for name, value in opened(target).items()))
    return str(target)


def pack(review: Review) -> tuple[float, bytes]:
    """Least seconds of three, and the page."""
    times = []
    for _ in range(3):
        fresh = Review(review.scene)
        begin = time.perf_counter()
        page = fresh.html()
        times.append(time.perf_counter() - begin)
    return min(times), page


def opened(page: Path) -> dict[str, Any]:
    """Seconds until a page is ready, and milliseconds of a frame and of a pick, the median of several."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path="/usr/bin/chromium", args=BROWSER)
        tab = chromium.new_page(viewport={"width": 1280, "height": 720})
        begin = time.perf_counter()
        tab.goto(page.as_uri())
        tab.wait_for_selector("html[data-ready]", timeout=120_000)
        ready = time.perf_counter() - begin
        frames = [tab.evaluate("olp.frame_ms()") for _ in range(5)]
        picks = []
        for share in np.linspace(0.1, 0.9, 9):
            sample = f"olp.project(Math.floor({share} * olp.manifest.samples), 'nominal')"
            picks.append(
                tab.evaluate(
                    f"(() => {{ const [x, y] = {sample}; const t = performance.now(); olp.pick(x, y);"
                    " return performance.now() - t; })()"
                )
            )
        heap = tab.evaluate("performance.memory ? performance.memory.usedJSHeapSize : 0")
        chromium.close()
    return {
        "ready s": round(ready, 2),
        "frame ms": round(statistics.median(frames)),
        "pick ms": round(statistics.median(picks), 1),
        "heap MB": round(heap / 1e6),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("points", nargs="*", type=float, default=[1e5, 1e6])
    parser.add_argument("--lines", action="store_true", help="one block per point")
    parser.add_argument("--no-time", action="store_true", help="do not plan the motion")
    parser.add_argument("--browser", action="store_true", help="open the pages in Chromium")
    parser.add_argument("--keep", type=Path, help="folder that keeps the pages")
    call = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = call.keep or Path(temporary)
        for points in call.points:
            run(int(points), folder, lines=call.lines, timed=not call.no_time, browser=call.browser)


if __name__ == "__main__":
    main()
