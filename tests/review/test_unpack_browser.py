"""The page's own script unpacks in a browser what was packed: whole numbers and every line of every text."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import texts
from cases.fast import left_to_a_campaign
from judge import browser

import olp
from olp.files.config import load_job
from olp.review import lines as coding
from olp.review.knots import Curve
from olp.review.listing import shown
from olp.review.pack import DEVIATION_MM, POSITION_MM, Arrays

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "viewer" / "static" / "unpack.js"
#: A job of each kind of text.
JOBS = ("gantry-plate", "dmis-housing", "apt-flavours", "haas-mill")
LINES = """name => {
  const text = olp.arrays.get(name);
  return Array.from({length: text.n}, (_, i) => text.line(i));
}"""
UNPACK = """async ([specs, text]) => {
  const arrays = await OLP.unpack({schema: "olp-review-1", arrays: specs}, text);
  const all = name => Array.from({length: arrays.get(name).n}, (_, i) => arrays.get(name).line(i));
  const written = spec => ["text", "lines"].includes(spec.enc);
  return Object.fromEntries(Object.entries(specs).map(
    ([name, spec]) => [name, written(spec) ? all(name) : Array.from(arrays.get(name))]));
}"""


@pytest.fixture(scope="module")
def page() -> Iterator[Any]:
    browser.require()
    with browser.driver() as play, browser.launched(play) as chromium:
        tab = chromium.new_page()
        tab.add_script_tag(content="window.OLP = {};")
        tab.add_script_tag(path=str(SCRIPT))
        yield tab


def unpacked(page: Any, arrays: Arrays) -> dict[str, Any]:
    """Numbers of arrays, row by row, and lines of texts."""
    return dict(page.evaluate(UNPACK, [arrays.specs, arrays.encoded().decode()]))


def test_whole_numbers_of_any_size_and_order_come_back(page: Any) -> None:
    rng = np.random.default_rng(1)
    columns = []
    for bits in (0, 1, 7, 8, 15, 16, 23, 24, 31, 32, 40, 47):
        noise = rng.integers(-(2**bits) + 1, 2**bits, 500)
        columns += [noise, np.cumsum(noise // 512), np.cumsum(np.cumsum(noise // 2**18))]
    arrays = Arrays()
    arrays.quantised("all", np.column_stack(columns), 1.0)
    assert set(arrays.specs["all"]["width"]) == set(range(7))
    for bits in (30, 31, 32):
        arrays.quantised(f"{bits}", [2**bits, -(2**bits), 2**bits - 1, -(2**bits) - 1], 1.0)
    result = unpacked(page, arrays)
    assert result["all"] == np.column_stack(columns).ravel().tolist()
    for bits in (30, 31, 32):
        assert result[f"{bits}"] == [2**bits, -(2**bits), 2**bits - 1, -(2**bits) - 1]


def test_quantised_values_come_back_exactly(page: Any) -> None:
    rng = np.random.default_rng(2)
    base = np.cumsum(rng.normal(0.0, 400.0, (300, 3)), axis=0)
    delta = rng.normal(0.0, 0.05, (300, 3))
    arrays = Arrays()
    arrays.quantised("P", base, POSITION_MM, keep=True)
    arrays.quantised("d", delta, DEVIATION_MM, keep=True)
    arrays.quantised("sum", delta + 1e-3, DEVIATION_MM, plus=["d"])
    result = unpacked(page, arrays)
    for name, values, digits in (("P", base, 4), ("d", delta, 6), ("sum", delta + 1e-3, 6)):
        assert result[name] == [float(f"{v:.{digits}f}") + 0.0 for v in values.ravel()]


def test_times_over_the_length_of_a_path_come_back_exactly(page: Any) -> None:
    rng = np.random.default_rng(7)
    path = np.cumsum(rng.normal(0.0, 2.0, (5000, 3)) * rng.integers(0, 2, (5000, 1)), axis=0)
    size = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    times = np.cumsum(size / 30.0) + np.cumsum(rng.random(5000) * rng.integers(0, 2, 5000) * 1e-3)
    arrays = Arrays()
    arrays.quantised("P", path, POSITION_MM, keep=True)
    arrays.along("t", times, 1e-6, "P")
    assert unpacked(page, arrays)["t"] == [float(f"{t:.6f}") for t in times]


def test_curves_come_back_from_their_knots(page: Any) -> None:
    x = np.arange(3000)
    curve = 40.0 * np.sin(x / 90.0) + np.where(x == 1234, 7.0, 0.0)
    arrays = Arrays()
    arrays.bent("curve", Curve.of(curve, 0.01))
    arrays.bent("one", Curve.of([3.0], 0.01))
    arrays.bent("none", Curve.of([], 0.01))
    result = unpacked(page, arrays)
    assert np.abs(np.array(result["curve"]) - curve).max() <= 0.01
    assert len(result["curve_at"]) < 1500
    assert (result["one"], result["none"]) == ([3.0], [])


def test_every_line_of_every_dialect_comes_back(page: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coding, "_FEW", 0)
    monkeypatch.setattr(coding, "_SPARSE", 1 << 30)
    rng = np.random.default_rng(3)
    arrays = Arrays()
    arrays.quantised("P", np.cumsum(rng.normal(0.0, 5.0, (100, 3)), axis=0), POSITION_MM, keep=True)
    arrays.quantised("d", rng.normal(0.0, 0.05, (100, 3)), DEVIATION_MM, keep=True)
    at = np.sort(rng.integers(0, 100, 200)).astype(np.int32)
    written = {f"t{seed}": texts.text(seed, 200, uneven=seed % 3 / 10) for seed in range(60)}
    for k, (name, text) in enumerate(written.items()):
        arrays.lines(name, text, ["P", "d"][: k % 3], at if k % 3 else None)
    predicted = [c for name in written for c in arrays.specs[name]["columns"] if c["axis"] is not None]
    assert {c["relative"] for c in predicted} == {False, True}
    result = unpacked(page, arrays)
    for name, text in written.items():
        assert result[name] == text.split("\n"), name


@pytest.mark.parametrize("name", left_to_a_campaign(JOBS, ("haas-mill",)))
def test_all_lines_of_both_programs_are_on_the_page(name: str, page: Any, tmp_path: Path) -> None:
    job = ROOT / "programs" / name / "job.toml"
    stated = load_job(job)
    assert stated.program and stated.machine
    result = olp.correct(stated.program, stated.machine, job)
    review = olp.view(stated.program, stated.machine, job, correction=result, time=False)
    file = tmp_path / "review.html"
    review.write(file)
    with browser.opened(page.context.browser, file) as opened:
        for text, data in (
            ("text_nominal", Path(stated.program).read_bytes()), ("text_corrected", result.data),
        ):  # fmt: skip
            assert opened.evaluate(LINES, text) == shown(data).split("\n")
