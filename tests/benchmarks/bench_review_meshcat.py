"""The page of a program beside MeshCat's own static export of the same path, in one run.

    python tests/benchmarks/bench_review_meshcat.py [lines ...] [--rounds 3] [--keep FOLDER]

A finishing raster on a machine with all 21 errors, one line of the program per point. `olp view --no-time`
makes the page as a command of its own. The export has the nominal, the uncorrected and the corrected path as
three lines with a colour per point for its deviation, as `meshcat.Visualizer.static_html` gives it. Its time
is that from the arrays, without reading or correcting a program. Both pages are opened in turn in Chromium
with software rendering, and the median of the rounds is printed: seconds until the paths are there, and
milliseconds of a frame.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bench_correct
import bench_review
import numpy as np

from olp.review.job import view
from olp.review.scene import Scene

#: Enlargement of deviations in both pages.
ENLARGED = 100.0
METRE = 1e-3
SIZE = {"width": 1280, "height": 720}
LAYERS = ("nominal", "uncorrected", "corrected")
#: The export runs its commands as they arrive: the paths are there when each of them has its points.
EXPORTED = """names => typeof viewer !== "undefined" && names.every(name => {
  const node = viewer.scene_tree.find(["meshcat", name, "<object>"]).object;
  return node.geometry?.attributes?.position?.count > 0;
})"""
#: Draws a frame and waits until the graphics have done so.
FRAME = """() => {
  const start = performance.now(), gl = viewer.renderer.getContext();
  viewer.set_dirty();
  viewer.render();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  return performance.now() - start;
}"""


@dataclass
class Figures:
    """What is measured of a page."""

    name: str
    megabytes: float
    made_s: float
    opened_s: list[float] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)
    frame_ms: list[float] = field(default_factory=list)

    def row(self) -> dict[str, float]:
        return {
            "MB": self.megabytes,
            "made s": self.made_s,
            "opened s": statistics.median(self.opened_s),
            "of it CPU s": statistics.median(self.cpu_s),
            "frame ms": statistics.median(self.frame_ms),
        }


def page(program: Path, machine: Path, target: Path) -> Figures:
    """The page, made by the command."""
    command = [sys.executable, "-m", "olp", "view", str(program), "-m", str(machine), "--no-time"]
    begin = time.perf_counter()
    process = subprocess.Popen(
        [*command, "-o", str(target), "--force"], env=bench_correct.ENVIRONMENT, stdout=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        raise SystemExit(f"olp view ended with {process.returncode}")
    made = time.perf_counter() - begin
    size = target.stat().st_size / 1e6
    print(f"page: {usage.ru_utime:.1f} s of user CPU, {usage.ru_maxrss / 1e3:.0f} MB of memory")
    return Figures("page", size, made)


def export(scene: Scene, target: Path) -> Figures:
    """MeshCat's own export of the paths."""
    import meshcat
    import meshcat.geometry as shapes

    begin = time.perf_counter()
    visualizer = meshcat.Visualizer()
    centre = scene.position_mm.mean(axis=0)
    samples = scene.samples
    largest = max(float(np.linalg.norm(samples.uncorrected, axis=1).max()), 1e-9)
    for name, delta in zip(
        LAYERS, (0.0 * samples.uncorrected, samples.uncorrected, samples.corrected), strict=True
    ):
        points = (scene.position_mm - centre + ENLARGED * delta).T * METRE
        share = np.linalg.norm(delta, axis=1) / largest
        colour = np.stack((share, 1.0 - share, 0.4 + 0.0 * share))
        geometry = shapes.PointsGeometry(points.astype(np.float32), colour.astype(np.float32))
        material = shapes.LineBasicMaterial(vertexColors=True)
        visualizer[name].set_object(shapes.Line(geometry, material))
    target.write_text(visualizer.static_html())
    made = time.perf_counter() - begin
    visualizer.window.server_proc.kill()
    visualizer.window.server_proc.wait()
    return Figures("MeshCat's export", target.stat().st_size / 1e6, made)


def opened(chromium: Any, path: Path, figures: Figures, ready: Callable[[Any], None], frame: str) -> None:
    """Adds the time until a page is ready, that of its main thread, and that of five frames."""
    context = chromium.new_context(viewport=SIZE, offline=True)
    tab = context.new_page()
    counters = context.new_cdp_session(tab)
    counters.send("Performance.enable", {"timeDomain": "threadTicks"})
    begin = time.perf_counter()
    tab.goto(path.as_uri())
    ready(tab)
    tab.evaluate(frame)
    figures.opened_s.append(time.perf_counter() - begin)
    metrics = {each["name"]: each["value"] for each in counters.send("Performance.getMetrics")["metrics"]}
    figures.cpu_s.append(metrics["TaskDuration"])
    figures.frame_ms += [tab.evaluate(frame) for _ in range(5)]
    context.close()


def shown(tab: Any) -> None:
    tab.wait_for_selector("html[data-ready]", state="attached", timeout=240_000)


def exported(tab: Any) -> None:
    while not tab.evaluate(EXPORTED, list(LAYERS)):
        time.sleep(0.02)


def run(lines: int, rounds: int, folder: Path) -> None:
    from playwright.sync_api import sync_playwright

    machine = bench_correct.machine(folder)
    program, _ = bench_review.program(folder, lines)
    ours, theirs = folder / f"page-{lines}.html", folder / f"export-{lines}.html"
    first = page(program, machine, ours)
    scene = view(program, machine, time=False).scene
    second = export(scene, theirs)
    print(f"{scene.nominal.lines} lines, {len(scene.samples)} points")
    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path="/usr/bin/chromium", args=bench_review.BROWSER)
        for _ in range(rounds):
            opened(chromium, ours, first, shown, "olp.frame_ms()")
            opened(chromium, theirs, second, exported, FRAME)
        chromium.close()
    rows = [each.row() for each in (first, second)]
    for each, row in zip((first, second), rows, strict=True):
        print(f"{each.name:18}" + "".join(f"{value:10.1f} {name}" for name, value in row.items()))
    print(f"{'ratio':18}" + "".join(f"{rows[0][name] / rows[1][name]:10.3f} {name}" for name in rows[0]))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("lines", nargs="*", type=float, default=[1e6])
    parser.add_argument("--rounds", type=int, default=3, help="how often both pages are opened")
    parser.add_argument("--keep", type=Path, help="folder that keeps the pages")
    call = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        for lines in call.lines:
            run(int(lines), call.rounds, call.keep or Path(temporary))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"this process: {peak:.0f} MB of memory")


if __name__ == "__main__":
    main()
