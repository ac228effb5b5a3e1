"""The tree says what the table says, points to what it means, and keeps within its bounds."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.part_features import HEAD, bent, figures, nodes_of, one, scene_of
from judge.machines import Recipe, random_machine, zero_machine
from judge.unpacker import Page

import olp
from olp.core.toolpath import Kind
from olp.program.origin import Origin, Unrolled
from olp.proof.proof import Counts
from olp.review.features.nodes import plain
from olp.review.features.registry import KINDS
from olp.review.manifest import manifest_of
from olp.review.scene import Scene

PROGRAMS = Path(__file__).resolve().parents[3] / "programs"
#: program, machine and job
SHIPPED = {
    "bracket": ("haas-mill/bracket.nc", "haas-mill/machine.toml", "haas-mill/job.toml"),
    "manifold": ("haas-mill/manifold.nc", "haas-mill/machine.toml", "haas-mill/job-manifold.toml"),
    "plate": ("gantry-plate/plate.ngc", "gantry-plate/machine.toml", "gantry-plate/job.toml"),
    "drill": ("table-router/drill.ngc", "table-router/machine.toml", "table-router/job-drill.toml"),
    "outline": ("table-router/outline.ngc", "table-router/machine.toml", "table-router/job-outline.toml"),
    "front": ("table-router/front.ngc", "table-router/machine.toml", "table-router/job.toml"),
    "cmm": ("bridge-cmm/housing.ngc", "bridge-cmm/machine.toml", "bridge-cmm/job.toml"),
    "dmis": ("dmis-housing/housing.dmi", "bridge-cmm/machine.toml", "dmis-housing/job.toml"),
    "creo": ("apt-flavours/creo.ncl", "gantry-plate/machine.toml", "apt-flavours/job.toml"),
    "offsets": ("nasty/work-offsets.ngc", "nasty/machine.toml", "nasty/job.toml"),
}
Tree = dict[str, Any]


@cache
def shipped(name: str) -> Scene:
    return olp.view(*(PROGRAMS / path for path in SHIPPED[name]), time=False).scene


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield zero_machine(tmp_path_factory.mktemp("machine"))


def groups_are_those_of_the_table(scene: Scene, tree: Tree) -> None:
    """Operations and tools, held against the groups that reports print."""
    table = scene.table
    judged = [node for node in tree["nodes"] if node["kind"] == "operation" and node["holds"] is not None]
    tools = [tool for tool in tree["tools"] if tool["holds"] is not None]
    for own, groups in ((judged, table.groups(table.operation)), (tools, table.groups(table.tool))):
        assert len(own) == len(groups)
        for node, group in zip(own, groups, strict=True):
            assert node["tool"] == group["tool"]
            assert node["largest_um"]["uncorrected"] == group["uncorrected_um"]
            assert node["largest_um"]["corrected"] == group["corrected_um"]
            assert node["worst_line"]["corrected"] == scene.place(group["worst_line"])
            assert node["holds"] == group["holds"]
    for node, group in zip(judged, table.groups(table.operation), strict=True):
        assert (node["first_line"], node["last_line"]) == (group["first_line"], group["last_line"])
        assert node["lines"].split(" to ")[0] == scene.place(group["first_line"])


def samples_are_its_own(scene: Scene, tree: Tree) -> None:
    """Ranges hold samples of feed moves on the lines of the node, all of them; the worst one is on its
    line."""
    path, move = scene.nominal.toolpath, scene.samples.move
    for node in tree["nodes"]:
        ranges = np.array(node["samples"], np.int64).reshape(-1, 2)
        assert (ranges[:, 0] <= ranges[:, 1]).all()
        assert (ranges[1:, 0] > ranges[:-1, 1] + 1).all()
        inside = np.zeros(len(move), bool)
        for a, b in ranges.tolist():
            inside[a : b + 1] = True
        if len(ranges) > 1:
            assert (path.kind[move[inside]] != Kind.RAPID).all()
            assert len(np.unique(move[inside])) == node["moves"]
            lines = path.line[move[inside]]
            assert (lines >= node["first_line"]).all()
            assert (lines <= node["last_line"]).all()
        for layer, sample in node["worst_sample"].items():
            assert scene.place(int(path.line[move[sample]])) == node["worst_line"][layer]
            assert sample == scene.worst_sample(layer, int(move[sample]))


def figures_do_not_contradict_the_table(tree: Tree) -> None:
    """No distance of a node is above its largest deviation."""
    for node in tree["nodes"]:
        for layer, largest in node["largest_um"].items():
            own = figures(node, layer) if node["figures"] else {}
            size = own.get("position")
            # the centre of a fitted arc may be off by more than any of its points, as may an open contour
            if size is not None and node["kind"] != "arc" and "open" not in node["detail"]:
                assert abs(size) <= largest + 0.35, (node["label"], layer)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_the_tree_of_a_shipped_job_is_its_table(name: str) -> None:
    scene = shipped(name)
    tree = plain(scene)
    json.dumps(tree, allow_nan=False, default=np.ndarray.tolist)
    groups_are_those_of_the_table(scene, tree)
    samples_are_its_own(scene, tree)
    figures_do_not_contradict_the_table(tree)
    parents: set[int] = set()
    for number, node in enumerate(tree["nodes"]):
        assert node["id"] == number
        assert node["parent"] is None or node["parent"] in parents
        assert (node["parent"] is None) == (node["kind"] == "operation")
        parents.add(number)
        meanings = tree["kinds"][node["kind"]]["figures"]
        assert {figure["name"] for figure in node["figures"]} <= meanings.keys()


@pytest.mark.slow
def test_a_bracket_is_known_again() -> None:
    tree = plain(shipped("bracket"))
    tops = {n["id"]: n["label"] for n in tree["nodes"] if n["parent"] is None}
    assert list(tops.values()) == [
        "T3, G54: --- OP 1, FACE AND OUTSIDE ---", "T4, G54: --- OP 1, HOLES ---",
        "T1, G54: --- OP 1, BORE D48 BY HELIX, THEN FINISH ---",
        "T5, G55: --- OP 2, FILLET WITH BALL MILL ---",
    ]  # fmt: skip
    first = [(n["kind"], n["detail"]) for n in tree["nodes"] if n["parent"] == 0]
    assert first == [
        ("flat", "Z 0 mm, path 204 x 86 mm, 13 moves"), ("contour", "path 200 x 130 mm, closed, Z -14 mm"),
    ]  # fmt: skip
    assert [n["label"] for n in tree["nodes"] if n["kind"] == "holes"] == ["4 holes", "4 holes", "6 holes"]
    bores = [n["detail"] for n in tree["nodes"] if n["kind"] == "circle"]
    assert bores == ["R 18 mm, 360°, 1 level, helix of 5 turns", "R 19 mm, 360°, 1 level"]
    slot = next(n for n in tree["nodes"] if "SLOT" in n["detail"])
    assert slot["detail"] == "100 mm along X, normal +Y, 1 level; SLOT, STEPPED DOWN INCREMENTALLY"


@pytest.mark.slow
def test_points_of_a_measuring_program_are_points() -> None:
    tree = plain(shipped("dmis"))
    assert [n["kind"] for n in tree["nodes"]] == ["operation", "points", "points", "points"]
    details = ["4 points", "8 points; --- bore", "2 points; --- edge, with the star stylus of the job file"]
    assert [n["detail"] for n in tree["nodes"][1:]] == details
    for node in tree["nodes"][1:]:
        for layer in ("uncorrected", "corrected"):
            # only the points count, not the way to them; the table adds the other side of the backlash
            assert figures(node, layer)["position"] == pytest.approx(node["largest_um"][layer], abs=0.05)


TEXT = (
    "(outside)\nG0 X10 Y10\nG1 Z-1\nX110\nY70\nX10\nY10\nG0 Z5\nG81 X40 Y40 Z-8 R2\nX70\nG80\n"
    "T2 M6 (6 mm)\nG43 H2\n(bore)\n(finish)\nG0 X60 Y40 Z5\nG1 Z-2\nG3 I-20\nG0 Z20\n(slot)\nX80\nG1 Z-3\nY60"
)


@pytest.mark.slow
def test_what_is_measured_is_told_of_each_feature(tmp_path: Path) -> None:
    machine_path = random_machine(tmp_path / "m", 5, Recipe())
    head = "G21 G17 G90 G94 G54\nT1 M6\nG43 H1\nG0 X0 Y0 Z20\nF600\n"
    program = tmp_path / "part.ngc"
    program.write_text(f"{head}{TEXT}\nG0 Z30\nM2\n")
    run = tmp_path / "run.csv"
    run.write_bytes(olp.simulate(program, machine_path, step_mm=0.5).to_csv())
    for tolerance_um in (1.0, 1000.0):
        scene = olp.view(
            program, machine_path, measured=[run], time=False, part_tolerance_um=tolerance_um, step_mm=0.5
        ).scene
        tree = plain(scene)
        groups_are_those_of_the_table(scene, tree)
        runs = scene.table.measured
        assert runs is not None
        report = runs.report()
        for own, groups in ((tree["nodes"], report["operations"]), (tree["tools"], report["tools"])):
            nodes = [n for n in own if n.get("kind", "operation") == "operation"]
            for node, group in zip(nodes, groups, strict=True):
                assert node["largest_um"]["measured"] == group["measured_um"]
                assert node["worst_line"]["measured"] == scene.place(group["worst_line"])
                assert node["measured_holds"] == group["holds"] == (tolerance_um > 1.0)
        # what simulate writes is the uncompensated machine
        for kind in ("wall", "circle", "contour", "hole"):
            for node in [n for n in tree["nodes"] if n["kind"] == kind]:
                before, measured = figures(node), figures(node, "measured")
                assert measured.keys() == before.keys()
                for name in before.keys() - {"depth"}:
                    assert measured[name] == pytest.approx(before[name], abs=0.5), (node["label"], name)
    twice = olp.view(program, machine_path, measured=[run, run], time=False, step_mm=0.5).scene
    node = one(twice, "circle")
    assert set(node["figures"][0]["by_layer"]) == {"uncorrected", "corrected", "measured-1", "measured-2"}
    assert node["measured_holds"] is None


def test_comments_name_operations_and_features(machine: Path) -> None:
    scene = scene_of(TEXT, machine)
    tree = plain(scene)
    tops = [n["label"] for n in tree["nodes"] if n["parent"] is None]
    assert tops == ["T1, G54: outside", "T2, G54: finish"]
    details = {n["label"]: n["detail"] for n in tree["nodes"]}
    # the last comment before it, on a line of its own; none is handed on to the next feature
    assert details["circle 1"] == "R 20 mm, 360°, 1 level"
    assert details["wall 5"] == "20 mm along Y, normal +X, 1 level; slot"
    assert details["2 holes"] == "tool Ø 10 mm, to Z -8 mm, stroke of 10 mm"
    assert [t["label"] for t in tree["tools"]] == ["T1", "T2"]
    assert [t["nodes"] for t in tree["tools"]] == [[n["id"]] for n in tree["nodes"] if n["parent"] is None]
    # one on a line of its own comes before one behind a statement
    text = "(facing)\nM8 (coolant)\nG0 X10 Y10\nG1 Z-1\nX20"
    assert plain(scene_of(text, machine))["nodes"][0]["label"] == "T1, G54: facing"
    behind = text.replace("(facing)\n", "")
    assert plain(scene_of(behind, machine))["nodes"][0]["label"] == "T1, G54: coolant"
    # without comments there are none
    bare = "\n".join(line for line in TEXT.replace(" (6 mm)", "").split("\n") if not line.startswith("("))
    assert [n["label"] for n in plain(scene_of(bare, machine))["nodes"] if n["parent"] is None] == [
        "T1, G54", "T2, G54",
    ]  # fmt: skip


def test_a_node_fails_where_one_of_its_moves_does(machine: Path) -> None:
    scene = scene_of(TEXT, machine)
    table = scene.table
    # the third side of the rectangle is above what is allowed
    row = int(np.flatnonzero(scene.nominal.toolpath.line == 11)[0])
    corrected = table.corrected.copy()
    corrected[row] = 0.1
    nodes = {n["label"]: n for n in plain(replace(scene, table=replace(table, corrected=corrected)))["nodes"]}
    failed = {label for label, n in nodes.items() if n["holds"] is False}
    assert failed == {"T1, G54: outside", "contour 1", "wall 3"}
    for label in failed:
        assert nodes[label]["largest_um"]["corrected"] == pytest.approx(100.0)
        assert nodes[label]["worst_line"]["corrected"] == "11"
    assert nodes["wall 1"]["holds"] is True


def test_where_nothing_counts_there_is_no_verdict_and_no_figure(machine: Path) -> None:
    scene = scene_of(TEXT, machine)
    counts = np.full(len(scene.table.counts), np.uint8(Counts.UNKNOWN))
    tree = plain(replace(scene, table=replace(scene.table, counts=counts)))
    assert {n["holds"] for n in tree["nodes"]} == {None}
    assert all(n["figures"] == [] and n["largest_um"] == {} for n in tree["nodes"])
    assert len(tree["nodes"]) == len(plain(scene)["nodes"])


@pytest.mark.parametrize("most", [3, 7, 12, 19, 20])
def test_the_tree_is_bounded_and_loses_no_deviation(machine: Path, most: int) -> None:
    rows = "\n".join(
        f"G0 X{10 * k} Y{5 * k} Z5\nG1 Z-1\nX{10 * k + 3}\nY{5 * k + 2}\nG0 Z5" for k in range(6)
    )
    scene = scene_of(rows, machine)
    table = replace(scene.table, corrected=np.arange(len(scene.table.line)).astype(np.float32) * 1e-4)
    scene = replace(scene, table=table)
    tree = plain(scene, most)
    whole = plain(scene)
    assert len(whole["nodes"]) == 19 and whole["unlisted"] == 0
    assert len(tree["nodes"]) <= most
    listed = [n for n in tree["nodes"] if n["kind"] != "more"]
    assert len(listed) + tree["unlisted"] == 19
    if most < 19:
        rest = tree["nodes"][-1]
        assert rest["kind"] == "more"
        assert rest["label"] == f"{19 - len(listed)} more features not listed"
        gone = [n for n in whole["nodes"] if n["label"] not in {m["label"] for m in listed}]
        largest = max(n["largest_um"]["corrected"] for n in gone)
        assert rest["largest_um"]["corrected"] == largest
        assert rest["moves"] == len({(n["first_line"]) for n in gone if n["kind"] == "wall"})


def test_the_manifest_has_the_tree_and_what_its_figures_mean(machine: Path) -> None:
    scene = scene_of(TEXT, machine)
    manifest, _ = manifest_of(scene)
    tree = plain(scene)
    for node, packed in zip(tree["nodes"], manifest["tree"]["nodes"], strict=True):
        begin, end = packed.pop("ranges")
        assert end - begin == len(node.pop("samples"))
    assert manifest["tree"] == tree | {"samples": "tree"}
    kinds = manifest["tree"]["kinds"]
    for kind in KINDS:
        assert kinds[kind.name]["label"] == kind.label
        assert all(text.strip() for text in kinds[kind.name]["figures"].values())
    assert set(kinds) == {"operation", "holes", "more", *(kind.name for kind in KINDS)}


def test_an_operation_without_a_feature_is_listed_all_the_same(machine: Path) -> None:
    scene = scene_of("G1 X10 Y10 Z-1\nX20 Y25 Z-3", machine)
    (node,) = plain(scene)["nodes"]
    assert (node["kind"], node["moves"], node["detail"]) == ("operation", 2, "2 feed moves")
    assert node["samples"][0][0] > 0


def test_figures_are_of_what_counts_only(machine: Path) -> None:
    """A move that does not count, and the start of the first one after it, have no part in figures."""
    scene = scene_of("G0 X10 Y10\nG1 Z-1\nX50\nX90", machine)
    first = int(np.flatnonzero(scene.nominal.toolpath.line == 8)[0])
    counts = scene.table.counts.copy()
    counts[first] = Counts.UNKNOWN
    half = replace(scene, table=replace(scene.table, counts=counts))

    def step(p: np.ndarray) -> np.ndarray:
        return np.stack((0.0 * p[:, 0], np.where(p[:, 0] <= 50.0, 0.5, 0.001), 0.0 * p[:, 0]), axis=1)

    assert figures(one(bent(half, step), "wall"))["position"] == pytest.approx(1.0)
    assert nodes_of(half, "wall")[0]["moves"] == 2


@pytest.mark.slow
def test_any_number_of_ranges_is_exact(machine: Path) -> None:
    """300 plunges with rapids between them: neither the tree nor the page takes rapids with them."""
    text = "\n".join(f"G0 X{k} Z2\nG1 Z-{1 + k % 7}\nG0 Z2" for k in range(300))
    review = olp.view(f"{HEAD}{text}\nM2\n".encode(), machine, time=False)
    scene, page = review.scene, Page(review.html())
    feed = scene.nominal.toolpath.kind[scene.samples.move] != Kind.RAPID
    every = page.array(page.manifest["tree"]["samples"]).astype(int)
    nodes = plain(scene)["nodes"]
    assert len(nodes[0]["samples"]) == 300
    for node, packed in zip(nodes, page.manifest["tree"]["nodes"], strict=True):
        begin, end = packed["ranges"]
        assert np.array_equal(every[begin:end], node["samples"])
        inside = np.zeros(len(feed), bool)
        for a, b in every[begin:end].tolist():
            inside[a : b + 1] = True
        assert feed[inside].all() and len(np.unique(scene.samples.move[inside])) == node["moves"]
    samples_are_its_own(scene, plain(scene))


def test_spans_of_tools_and_operations_hold_their_rapids(machine: Path) -> None:
    scene = scene_of("G0 X10 Y10\nG1 Z-1\nX50\nG0 Z9\nT2 M6\nG43 H2\nG0 X0 Y0 Z5\nG1 Z-1\nX9", machine)
    tree, move = plain(scene), scene.samples.move
    for own, of in (
        ([node for node in tree["nodes"] if node["kind"] == "operation"], scene.table.operation),
        (tree["tools"], scene.table.tool),
    ):
        assert len(own) == 2
        for entry in own:
            inside = np.zeros(len(move), bool)
            for a, b in entry["spans"]:
                inside[a : b + 1] = True
            values = set(of[move[inside]].tolist())
            assert len(values) == 1 and np.array_equal(inside, of[move] == values.pop())
            kinds = scene.nominal.toolpath.kind[move[inside]]
            assert (kinds == Kind.RAPID).any() and (kinds != Kind.RAPID).any()


def test_the_lines_of_a_node_are_those_that_were_written(machine: Path) -> None:
    """In a loop a line that comes later in the unrolled text may come earlier in the program."""
    loop = "#1 = 0\no1 while [#1 lt 2]\nG1 X10 Y0 Z-1\nX50\nY[40 + #1]\nX10\n#1 = [#1 + 1]\no1 endwhile"
    scene = scene_of(loop, machine, flatten=True)
    origin, path, move = scene.nominal.origin, scene.nominal.toolpath, scene.samples.move
    assert origin is not None
    several = 0
    for node in plain(scene)["nodes"]:
        inside = np.concatenate([np.arange(a, b + 1) for a, b in node["samples"]])
        written = origin.line[path.line[np.unique(move[inside])] - 1]
        first, last = int(written.min()), int(written.max())
        assert node["lines"] == (str(first) if first == last else f"{first} to {last}")
        unrolled = path.line[np.unique(move[inside])]
        several += origin.line[unrolled.max() - 1] != last or origin.line[unrolled.min() - 1] != first
    assert several, "no node begins at a later line of the loop than it ends"


def test_lines_of_files_of_subprograms_are_named_with_them(machine: Path) -> None:
    scene = scene_of("G1 X10", machine)
    origin = Origin(("/sub/drill.ngc",), np.array([20]), (b"",) * 30, np.array([3, 22, 24, 22, 7]))
    called = replace(scene, nominal=replace(scene.nominal, data=Unrolled.of(scene.nominal.data, origin)))
    assert called.places(np.array([1, 5])) == "3 to 7"
    assert called.places(np.array([2, 3, 4])) == "2 to 4 of drill.ngc"
    assert called.places(np.array([2, 4])) == "2 of drill.ngc"
    assert called.places(np.array([5, 2])) == "7 to 2 of drill.ngc"
