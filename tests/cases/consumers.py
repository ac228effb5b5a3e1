"""What every consumer of the table of judgements says of one job, held against the table.

`predicted` is for a correction and its verification, `measured` for runs on the machine. Both raise
AssertionError at the first contradiction.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from cli.test_cli import run
from judge.unpacker import Page

import olp
from olp.proof.judgement import Judgements
from olp.reports.plots import path as plots_path

#: Half of the last digit that is printed, and what binary numbers add to it.
PRINTED_UM = 0.00501


@dataclass(frozen=True)
class Job:
    """A nominal program with the words that name its machine on the command line, and a folder for outputs;
    `unroll` are --flatten and --expand-cycles."""

    program: Path
    setup: tuple[str | Path, ...]
    folder: Path
    unroll: tuple[str, ...] = ()

    @property
    def api(self) -> dict[str, Any]:
        names = dict(zip(self.setup[::2], self.setup[1::2], strict=True))
        unroll = {word.removeprefix("--").replace("-", "_"): True for word in self.unroll}
        return {"machine": names.get("-m"), "job": names.get("-j")} | unroll

    def words(self, *more: str | Path) -> tuple[str | Path, ...]:
        return (*self.setup, *self.unroll, *more)


def wrapped(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def plain(report: str) -> str:
    """A Markdown or HTML report without its marks."""
    text = re.sub(r"<[^>]+>", " ", report) if "<html" in report else report.replace("\\", "")
    return wrapped(text.replace("&gt;", ">").replace("&lt;", "<"))


def predicted(job: Job, *, plots: bool = False) -> tuple[dict[str, Any], Path]:
    """The report of the correction, and its file, once every consumer has been heard."""
    out = job.folder / f"corrected{job.program.suffix}"
    file = job.folder / "report.json"
    done = run("correct", job.program, *job.words("-o", out, "--report", file, "--force"))
    assert done.exit_code in (0, 1), done.stderr
    stated = json.loads(file.read_text())
    verdict = stated["verdict"]
    words = " ".join(verdict["sentences"])
    assert done.exit_code == int(verdict["ok"] is False)
    assert words in wrapped(done.stdout)
    _one_report(stated)
    table = olp.verify(job.program, out, **job.api).table
    _table_and_report(table, stated)
    _verified(job, out, stated)
    _checked(job, out, verdict)
    _documents(job, stated, plots=plots)
    html = job.folder / "page.html"
    shown = run("view", job.program, *job.words("--corrected", out, "--no-time", "-o", html, "--force"))
    assert shown.exit_code == 0, shown.stderr
    page = Page(html.read_bytes())
    shown_verdict = page.manifest["verdict"]
    assert shown_verdict["ok"] == verdict["ok"]
    assert shown_verdict["questions"] == verdict["questions"]
    said = [*(question["sentence"] for question in verdict["questions"]), *shown_verdict["remarks"]]
    assert sorted(said) == sorted(verdict["sentences"])
    _page_and_table(page, table)
    _page_and_report(page, stated)
    return stated, out


def _one_report(stated: dict[str, Any]) -> None:
    """A report does not contradict itself."""
    verdict, found = stated["verdict"], {f["code"] for f in stated["findings"]}
    numerical, largest = verdict["numerical"], verdict["numerical"]["largest_um"] or 0.0
    assert stated["deviation"]["path_max_um"] == largest
    assert stated["deviation"]["allowed_um"] == pytest.approx(numerical["allowed_um"], rel=1e-9)
    assert stated["deviation"]["holds"] in (numerical["holds"], True)
    assert ("OLP101" in found) is (numerical["holds"] is False)
    for rows in (stated["judgement"]["operations"], stated["judgement"]["tools"]):
        assert max((row["corrected_um"] for row in rows), default=0.0) == largest
        assert all(row["holds"] for row in rows) is (numerical["holds"] is not False)
    worst = stated["worst"]
    assert (worst[0]["after_um"] if worst else 0.0) == largest


def _table_and_report(table: Judgements, stated: dict[str, Any]) -> None:
    rows = table.by_line()
    counts = rows["state"] < 2
    numerical = stated["verdict"]["numerical"]
    assert np.nan_to_num(rows["corrected_um"][counts]).max(initial=0.0) == (numerical["largest_um"] or 0.0)
    assert bool((rows["state"] == 1).any()) is (numerical["holds"] is False)
    of_line = {int(line): k for k, line in enumerate(rows["line"])}
    for row in stated["worst"]:
        k = of_line[row["line"]]
        assert row["after_um"] == rows["corrected_um"][k]
        assert row["before_um"] == np.nan_to_num(rows["uncorrected_um"][k])
    if numerical["line"] is not None:
        assert rows["corrected_um"][of_line[numerical["line"]]] == numerical["largest_um"]


def _verified(job: Job, out: Path, stated: dict[str, Any]) -> None:
    call = ("verify", job.program, out, *job.words("--fail-on", "never"))
    verified = json.loads(run(*call, "--json").stdout)
    for key in ("verdict", "judgement", "deviation", "largest_correction_um", "worst"):
        assert verified[key] == stated[key], key
    assert " ".join(stated["verdict"]["sentences"]) in wrapped(run(*call).stdout)


def _checked(job: Job, out: Path, verdict: dict[str, Any]) -> None:
    words = " ".join(verdict["sentences"])
    options = ("check", job.program, *job.words("--fail-on", "never", "--format"))
    assert json.loads(run(*options, "json").stdout)["verdict"] == verdict
    assert words in wrapped(run(*options, "text").stdout)
    sarif = json.loads(run(*options, "sarif").stdout)
    assert sarif["runs"][0]["properties"]["verdict"] == verdict
    junit = ElementTree.fromstring(run(*options, "junit").stdout)
    assert [p.get("value") for p in junit.iter("property")] == verdict["sentences"]
    pair = ("check", out, "--nominal", job.program, *job.words("--fail-on", "never", "--json"))
    checked = json.loads(run(*pair).stdout)["verdict"]
    # its lines are those of the program that it was given
    assert checked["numerical"] | {"line": 0} == verdict["numerical"] | {"line": 0}


def _documents(job: Job, stated: dict[str, Any], *, plots: bool) -> None:
    verdict = stated["verdict"]
    mark = {True: "good", False: "bad", None: "open"}[verdict["ok"]]
    for ending in (".md", ".html") if plots else (".md",):
        shown = job.folder / f"shown{ending}"
        again = job.folder / f"again{job.program.suffix}"
        with _allowed_lines() as drawn:
            call = ("correct", job.program, *job.words("-o", again, "--report", shown, "-q", "--force"))
            assert run(*call).exit_code in (0, 1)
        text = shown.read_text("utf-8")
        assert " ".join(verdict["sentences"]) in plain(text)
        assert (mark == "bad") or ending == ".md" or f'<p class="verdict {mark}">' in text
        assert set(drawn) <= {verdict["numerical"]["allowed_um"]}
        assert drawn or ending == ".md"


class _allowed_lines:
    """The limits with which plots along a path are drawn while this is entered."""

    def __enter__(self) -> list[float | None]:
        self.kept = plots_path.along, plots_path.histogram
        drawn: list[float | None] = []

        def along(path: Any, runs: Any, tolerance_um: float | None, sides: Any) -> bytes:
            drawn.append(tolerance_um)
            return self.kept[0](path, runs, tolerance_um, sides)

        def histogram(runs: Any, tolerance_um: float | None, sides: Any) -> bytes:
            drawn.append(tolerance_um)
            return self.kept[1](runs, tolerance_um, sides)

        plots_path.along, plots_path.histogram = along, histogram  # type: ignore[assignment]
        return drawn

    def __exit__(self, *_: object) -> None:
        plots_path.along, plots_path.histogram = self.kept  # type: ignore[assignment]


def _page_and_table(page: Page, table: Judgements) -> None:
    listing, rows = page.manifest["listing"], table.by_line()
    if listing["names"] is not None:
        _named_rows(page, rows)
        return
    numbers = page.array(listing["row_nominal"]).astype(int)
    row = {int(n): k for k, n in enumerate(numbers.tolist()) if n}
    where = [row[int(line)] for line in rows["line"]]
    for layer, column, key in (
        ("uncorrected", "uncorrected_um", "uncorrected"), ("corrected", "corrected_um", "corrected"),
    ):  # fmt: skip
        own = listing["by_layer"][layer]
        assert own["um"] == listing[column]
        shown = page.array(own["um"])[where]
        expected = np.nan_to_num(rows[f"{key}_um"], nan=-1.0)
        assert np.abs(shown - expected).max(initial=0.0) <= PRINTED_UM
        assert page.array(own["state"])[where].tolist() == rows[f"{key}_state"].tolist()
    state = page.array(listing["state"])
    assert state[where].tolist() == rows["state"].tolist()
    assert set(np.delete(state, where).tolist()) <= {3}


def _rows_of_lines(page: Page) -> dict[str, list[int]]:
    """The rows of the listing of each line of the program: several where it was unrolled."""
    listing, made = page.manifest["listing"], dict[str, list[int]]()
    names = None if listing["names"] is None else page.array(listing["names"])
    for row, number in enumerate(page.array(listing["row_nominal"]).astype(int).tolist()):
        if number:
            made.setdefault(names[number - 1] if names else str(number), []).append(row)
    return made


def _named_rows(page: Page, rows: dict[str, Any]) -> None:
    """The rows of an unrolled text, whose lines were made from one of the program, say together what the
    table says of that: the largest of what counts, else of what is shown."""
    listing, made = page.manifest["listing"], _rows_of_lines(page)
    for layer, key in (("uncorrected", "uncorrected"), ("corrected", "corrected")):
        own = listing["by_layer"][layer]
        shown, state = page.array(own["um"]), page.array(own["state"]).astype(int)
        for line, value, verdict in zip(rows["line"], rows[f"{key}_um"], rows[f"{key}_state"], strict=True):
            mine = made[str(line)]
            counted = [row for row in mine if state[row] < 2] or [row for row in mine if state[row] == 2]
            assert max(shown[row] for row in counted) == pytest.approx(
                np.nan_to_num(value, nan=-1.0), abs=PRINTED_UM
            )
            states = {int(state[row]) for row in counted}
            assert verdict == (1 if 1 in states else min(states))


def _page_and_report(page: Page, stated: dict[str, Any]) -> None:
    numerical, deviation = stated["verdict"]["numerical"], stated["deviation"]
    assert page.manifest["tolerance_um"] == numerical["allowed_um"]
    figures = {(s["layer"], s["label"]): s["value"] for s in page.manifest["statistics"] if s["layer"]}
    largest = max((row["uncorrected_um"] for row in stated["judgement"]["tools"]), default=0.0)
    assert figures["corrected", "largest"] == (numerical["largest_um"] or 0.0)
    assert figures["uncorrected", "largest"] == largest
    for side, layer in (("before", "uncorrected"), ("after", "corrected")):
        assert figures.get((layer, "rms")) in (None, deviation[side]["between"]["rms_um"])
        assert figures[layer, "at waypoints"] == deviation[side]["waypoints"]["max_um"]
    pictures = {picture["name"]: picture for picture in page.manifest["pictures"]}
    shown = pictures["corrected"]
    assert shown["largest_um"] == numerical["largest_um"]
    if numerical["line"] is not None and shown["flag"] is not None:
        assert (shown["flag"]["um"], shown["flag"]["line"]) == (
            numerical["largest_um"], str(numerical["line"]),
        )  # fmt: skip
        assert pictures["uncorrected"]["flag"]["um"] == pictures["uncorrected"]["largest_um"] == largest
    for side, layer in (("before", "uncorrected"), ("after", "corrected")):
        assert pictures[layer]["tolerance_um"] == numerical["allowed_um"]
        assert pictures[layer]["rms_um"] in (None, deviation[side]["between"]["rms_um"])
    removed = page.manifest["removed"]
    assert (removed["before_um"], removed["after_um"]) == (largest, numerical["largest_um"] or 0.0)
    assert [f["message"] for f in page.manifest["findings"]][: len(stated["findings"])] == [
        f["message"] for f in stated["findings"]
    ]


def measured(
    job: Job, corrected: Path, files: Sequence[Path], tolerance_um: float | None, *, plots: bool = False
) -> dict[str, Any]:
    """The report of `compare`, once every consumer of measured runs has been heard."""
    part = () if tolerance_um is None else ("--part-tolerance-um", str(tolerance_um))
    target, text = job.folder / "points.csv", job.folder / "compared.md"
    call = ("compare", job.program, *files, *job.words(*part, "--force"))
    done = run(*call, "--json", "-o", target, "--report", text)
    stated = json.loads(done.stdout)
    verdict = stated["verdict"]
    assert verdict["measured"]["tolerance_um"] == stated["judgement"]["tolerance_um"]
    _one_comparison(stated)
    _points(target, stated)
    words = " ".join(verdict["sentences"])
    assert words in plain(text.read_text("utf-8"))
    assert done.exit_code == int(any(f["severity"] == "error" for f in stated["findings"]))
    assert verdict["ok"] is not False or done.exit_code == 1
    report = ("--report", job.folder / "compared.html") if plots else ()
    with _allowed_lines() as drawn:
        shown = run(*call, *report)
    assert shown.exit_code == done.exit_code
    assert words in wrapped(shown.stdout)
    assert set(drawn) <= {tolerance_um}
    assert not plots or words in plain((job.folder / "compared.html").read_text("utf-8"))
    html = job.folder / "measured.html"
    runs = [word for file in files for word in ("--measured", file)]
    shown_run = run(
        "view", job.program, *job.words(*part, "--corrected", corrected, *runs, "--no-time", "-o", html),
        "--force",
    )  # fmt: skip
    assert shown_run.exit_code == 0, shown_run.stderr
    _page_and_comparison(Page(html.read_bytes()), stated)
    return stated


def measured_briefly(job: Job, corrected: Path, files: Sequence[Path], tolerance_um: float | None) -> None:
    """The report of `compare` and the page alone, which is quicker."""
    part = () if tolerance_um is None else ("--part-tolerance-um", str(tolerance_um))
    stated = json.loads(run("compare", job.program, *files, *job.words(*part, "--json")).stdout)
    _one_comparison(stated)
    review = olp.view(
        job.program, **job.api, corrected=corrected, measured=files, part_tolerance_um=tolerance_um,
        time=False,
    )  # fmt: skip
    _page_and_comparison(Page(review.html()), stated)


def _one_comparison(stated: dict[str, Any]) -> None:
    verdict, layer, after = stated["verdict"], stated["judgement"], stated["after"]
    sizes = {row["name"]: row["largest_um"] for row in layer["runs"]}
    assert sizes == {row["name"]: (row["across_um"] or {}).get("max") for row in after["runs"]}
    known = [size for size in sizes.values() if size is not None]
    assert verdict["measured"]["largest_um"] == max(known, default=None)
    assert verdict["measured"]["not_verified"] == [name for name, size in sizes.items() if size is None]
    if known:
        assert after["across_um"]["max"] == after["worst"][0]["max_um"] == max(known)
        assert stated["worst"][0]["max_um"] == max(known)
    for rows in (layer["operations"], layer["tools"]):
        assert max((row["measured_um"] for row in rows), default=None) == max(known, default=None)
    tolerance = layer["tolerance_um"]
    good = bool(known) and None not in sizes.values() and max(known) <= (tolerance or 0.0)
    assert verdict["ok"] is (None if tolerance is None else good)
    above = [f for f in stated["findings"] if f["code"] == "OLP609"]
    assert bool(above) is (verdict["ok"] is False)
    assert stated.get("holds") is verdict["ok"]


def _points(target: Path, stated: dict[str, Any]) -> None:
    """The rows of -o: the largest of what counts, by line and by run."""
    with target.open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.DictReader(stream) if row["counted"] == "1"]
    by_line: dict[int, float] = {}
    by_run: dict[str, float] = {}
    for row in rows:
        size = float(row["size_um"])
        by_line[int(row["line"])] = max(by_line.get(int(row["line"]), 0.0), size)
        by_run[row["run"]] = max(by_run.get(row["run"], 0.0), size)
    worst = {row["line"]: row["max_um"] for row in stated["after"]["worst"]}
    assert {line: by_line.get(line) for line in worst} == pytest.approx(worst, abs=1e-4)
    sizes = {row["name"]: row["largest_um"] for row in stated["judgement"]["runs"]}
    assert by_run == pytest.approx({k: v for k, v in sizes.items() if v is not None}, abs=1e-4)


def _page_and_comparison(page: Page, stated: dict[str, Any]) -> None:
    manifest, verdict = page.manifest, stated["verdict"]
    shown = manifest["verdict"]
    assert shown["questions"][-1:] == verdict["questions"]
    assert shown["questions"][-1]["sentence"] == " ".join(verdict["sentences"])
    assert shown["ok"] is False if verdict["ok"] is False else shown["ok"] in (verdict["ok"], False, None)
    assert manifest["part_tolerance_um"] == verdict["measured"]["tolerance_um"]
    names = list(_layers(stated))
    figures = {(s["layer"], s["label"]): s["value"] for s in manifest["statistics"] if s["layer"] in names}
    expected = {}
    for name, row in zip(names, stated["after"]["runs"], strict=True):
        if row["across_um"]:
            expected |= {
                (name, "largest"): row["across_um"]["max"], (name, "rms"): row["across_um"]["rms"],
            }  # fmt: skip
    assert figures == expected
    codes = {(f["code"], f["message"]) for f in manifest["findings"]}
    assert {(f["code"], f["message"]) for f in stated["findings"]} <= codes
    pictures = [p for p in manifest["pictures"] if p["layers"][0] in names]
    assert [p["layers"] for p in pictures] == [[name] for name in names]
    for picture, row, judged in zip(
        pictures, stated["after"]["runs"], stated["judgement"]["runs"], strict=True
    ):
        assert picture["tolerance_um"] == verdict["measured"]["tolerance_um"]
        assert picture["largest_um"] == judged["largest_um"]
        assert picture["rms_um"] == (row["across_um"] or {}).get("rms")
    assert max(p["largest_um"] or 0.0 for p in pictures) == (verdict["measured"]["largest_um"] or 0.0)
    flags = [(p["flag"]["um"], p["flag"]["line"]) for p in pictures if p["flag"]]
    for worst in stated["worst"][:1]:
        assert (worst["max_um"], str(worst["line"])) in flags
    _measured_lines(page, stated, names)


def _layers(stated: dict[str, Any]) -> Iterator[str]:
    runs = stated["after"]["runs"]
    yield from ["measured"] if len(runs) == 1 else (f"measured-{k + 1}" for k in range(len(runs)))


def _measured_lines(page: Page, stated: dict[str, Any], names: Sequence[str]) -> None:
    listing, tolerance = page.manifest["listing"], stated["judgement"]["tolerance_um"]
    made = _rows_of_lines(page)
    shown = page.array(listing["measured_um"])
    for row in stated["worst"]:
        assert max(shown[made[str(row["line"])]]) == pytest.approx(row["max_um"], abs=PRINTED_UM)
    each = [page.array(listing["by_layer"][name]["um"]) for name in names]
    assert np.maximum.reduce(each).tolist() == shown.tolist()
    for name, run_ in zip(names, stated["judgement"]["runs"], strict=True):
        own = page.array(listing["by_layer"][name]["um"])
        largest = -1.0 if run_["largest_um"] is None else run_["largest_um"]
        assert own.max() == pytest.approx(largest, abs=PRINTED_UM)
        state = page.array(listing["by_layer"][name]["state"])
        if tolerance is None:
            assert set(state.tolist()) <= {2, 3}
        else:
            assert bool((state == 1).any()) is ((run_["largest_um"] or 0.0) > tolerance)
    if tolerance is not None and (verdict := stated["verdict"])["measured"]["largest_um"] is not None:
        state = page.array(listing["state"])
        over = verdict["measured"]["largest_um"] > tolerance
        assert not over or (state[shown > tolerance + 0.01] == 1).all()
