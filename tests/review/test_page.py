"""The page: one file under a strict policy, in which no program becomes script; its size; what it says."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judge.machines import random_machine
from judge.unpacker import Page

import olp
from olp.core.errors import CannotCompute, InputError, OutsideBox, ProgramError, UsageError
from olp.findings.catalogue import RULES
from olp.review import job
from olp.review import page as pages
from olp.review.manifest import manifest_of
from olp.workflows import refusals
from olp.workflows.session import Session

ROOT = Path(__file__).resolve().parents[2]
HEAD = b"G21 G17 G90 G94 G54 G64 P0.01 Q0\nG43 H1\nG0 X0 Y0 Z20\n"
TEXT = HEAD + b"G1 X100 Y50 F600\nG2 X140 Y90 I40 J0\nM2\n"
HOSTILE = (
    b"</script><script>window.hacked=1</script>",
    b"<!-- <script> -->",
    b"<img src=x onerror=alert(1)>",
    b"<style>*{display:none}</style>",
    b"@@DATA@@ @@MODULES@@",
    b'"}]};alert(1);//',
    "\u2028alert(1)\u2029".encode(),
    b"\x00\x07\x1b[2J\x9b\x7f",
    "\u202e)evil(".encode(),
    b"&lt;b&gt; &#x3c;script&#x3e;",
    b"x" * 1_000_000,
)


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return random_machine(tmp_path_factory.mktemp("m"), 3)


@pytest.fixture(scope="module")
def html(machine: Path) -> bytes:
    return olp.view(TEXT, machine).html()


def policy(page: Page) -> dict[str, str]:
    policies = [
        a["content"]
        for tag, a in page.tags
        if tag == "meta" and a.get("http-equiv") == "Content-Security-Policy"
    ]
    assert len(policies) == 1
    return dict(part.split(None, 1) for part in str(policies[0]).split(";") if part.strip())


# -- one file, no network -------------------------------------------------------------------------------


def hashed(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def test_the_policy_lets_nothing_in_or_out_and_runs_these_scripts_alone(html: bytes) -> None:
    page = Page(html)
    rules = policy(page)
    assert rules.pop("script-src").split() == [hashed(script) for script in page.scripts]
    # that of the page, those that meshcat's bundle adds, and no other
    ours, *added = rules.pop("style-src").split()
    (style,) = re.findall("<style>(.*?)</style>", html.decode(), re.DOTALL)
    assert ours == hashed(style)
    (bundle,) = [script for script in page.scripts if "MeshCat" in script and ".dg ul{" in script]
    sheet = bundle[bundle.index('".dg ul{') :]
    assert added == [hashed(json.loads(sheet[: sheet.index('"))') + 1])), hashed("")]
    assert rules == {
        "default-src": "'none'", "img-src": "data: blob:", "connect-src": "'none'", "base-uri": "'none'",
        "form-action": "'none'",
    }  # fmt: skip
    before = html[: html.index(b"Content-Security-Policy")]
    assert b"<script" not in before and b"<style" not in before and b"<link" not in before


def test_the_page_has_no_script_or_style_in_an_attribute(html: bytes) -> None:
    """The policy has no hash for them."""
    for tag, attributes in Page(html).tags:
        assert not any(name == "style" or name.startswith("on") for name in attributes), (tag, attributes)


def test_line_ends_of_the_files_do_not_change_the_page(html: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """A browser reads every line end as one character, before it hashes."""
    ends = iter(["\r\n", "\r"] * 99)
    read = pages.read_bytes
    monkeypatch.setattr(pages, "read_bytes", lambda path: read(path).replace(b"\n", next(ends).encode()))
    monkeypatch.setattr(pages, "_licence", lambda: "")
    changed = Page(b"".join(pages.page({"title": "a"}, base64.b64encode(zlib.compress(b"")))))
    assert changed.scripts == Page(html).scripts
    assert policy(changed) == policy(Page(html))


def test_the_page_names_no_other_file(html: bytes) -> None:
    for tag, attributes in Page(html).tags:
        for name in ("src", "href", "action", "data", "poster", "srcset"):
            value = attributes.get(name)
            assert value is None or value.startswith(("data:", "#")), (tag, name, value)


def test_the_page_is_whole(html: bytes) -> None:
    page = Page(html)
    assert not re.search(r"@@[A-Z]+@@", page.text)
    assert any("MeshCat" in script for script in page.scripts)
    names = (ROOT / "viewer" / "static" / "modules.txt").read_text().split()
    for name in ("shell.js", *names):
        assert (ROOT / "viewer" / "static" / name).read_text() in page.scripts
    assert b"Permission is hereby granted" in html


def test_only_a_live_page_may_ask_and_only_its_own_server(machine: Path) -> None:
    review = olp.view(TEXT, machine, time=False)
    page, still = Page(b"".join(review.parts(live={"address": "version", "proof": "p"}))), Page(review.html())
    assert policy(page) == policy(still) | {"connect-src": "'self'"}
    assert page.manifest["live"] == {"address": "version", "proof": "p"}
    assert still.manifest["live"] is None


def test_the_same_job_gives_the_same_page(machine: Path, html: bytes) -> None:
    assert olp.view(TEXT, machine).html() == html


def test_a_setup_is_stated_alike_in_every_process(machine: Path) -> None:
    """The order of sets hangs on the seed of their hashes, which each process draws."""
    call = "import sys; from olp.review.job import _stated; from olp.workflows.session import Session; "
    call += "print(_stated(Session.start(sys.argv[1], None).setup))"
    stated = {
        subprocess.run(
            [sys.executable, "-c", call, str(machine)], check=True, capture_output=True, text=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    }  # fmt: skip
    assert len(stated) == 1
    assert "tool_change_moves" in stated.pop()


def test_a_digest_changes_with_what_the_page_shows(machine: Path) -> None:
    digests = {
        olp.view(text, machine, time=False).scene.digest
        for text in (TEXT, TEXT.replace(b"100", b"101"), TEXT)
    }
    assert len(digests) == 2
    assert all(re.fullmatch("[0-9a-f]{12}", digest) for digest in digests)


def test_a_module_that_would_end_its_element_is_refused(
    monkeypatch: pytest.MonkeyPatch, machine: Path
) -> None:
    monkeypatch.setattr(pages, "_bundle", lambda: ("a='</Script>'", "main.min.js"))
    with pytest.raises(CannotCompute, match=r"main\.min\.js: contains the end of a script element"):
        olp.view(TEXT, machine, time=False).html()


def test_the_title_is_text_and_the_data_cannot_end_their_element() -> None:
    hostile = """</script><!-- <b a='"'> & @@DATA@@"""
    page = b"".join(pages.page({"title": hostile}, b"AAAA")).decode()
    assert "<title>&lt;/script&gt;&lt;!-- &lt;b a=&#x27;&quot;&#x27;&gt; &amp; @@DATA@@" in page
    assert hostile not in page
    data = pages.as_json({"title": hostile, "umlaut": "ä"})
    assert b"<" not in data and "ä".encode() in data and b", " not in data
    assert json.loads(data) == {"title": hostile, "umlaut": "ä"}
    with pytest.raises(ValueError):
        pages.as_json({"a": float("nan")})


def test_a_name_that_is_no_utf_8_has_question_marks() -> None:
    assert pages.as_json({"a": "b\udce9", "c": [1, "<"]}) == b'{"a":"b?","c":[1,"\\u003c"]}'
    assert b"<title>b?</title>" in b"".join(pages.page({"title": "b\udce9"}, b""))


@pytest.mark.parametrize(("live", "connect"), [(False, "'none'"), (True, "'self'")])
def test_a_page_is_its_template_with_every_mark_filled(
    live: bool, connect: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the order of the template, and nothing that is put in is searched for marks."""
    texts = {
        "review.html": "A@@TITLE@@B@@SCRIPTS@@|@@STYLES@@|@@CONNECT@@C@@CSS@@D@@SHELL@@&@@MESHCAT@@E"
        "@@LICENCE@@F@@MANIFEST@@G@@DATA@@H@@MODULES@@I",
        "review.css": "@@DATA@@ä", "modules.txt": "one.js\ntwo.js\n", "one.js": "1<2", "two.js": "@@CSS@@",
        "shell.js": "keep",
    }  # fmt: skip
    # a style element that it adds, as the minified bundle of meshcat does it
    bundle = r"""mesh<cat(function(e){document.head.appendChild(t),e}}(".a\"b\n"))"""
    monkeypatch.setattr(pages, "_asset", texts.__getitem__)
    monkeypatch.setattr(pages, "_bundle", lambda: (bundle, "main.min.js"))
    monkeypatch.setattr(pages, "_licence", lambda: "<free> & 'open'")
    # a page is not live unless it is asked for
    more = {"live": True} if live else {}
    parts = list(pages.page({"title": "<a>", "b": "<"}, b"DA@@TA", **more))
    scripts = " ".join(map(hashed, ("keep", bundle, "1<2", "@@CSS@@")))
    styles = " ".join(map(hashed, ("@@DATA@@ä", '.a"b\n', "")))
    assert b"".join(parts).decode() == (
        f"A&lt;a&gt;B{scripts}|{styles}|{connect}C@@DATA@@äDkeep&{bundle}E"
        "&lt;free&gt; &amp; &#x27;open&#x27;F"
        '{"title":"\\u003ca>","b":"\\u003c"}'
        "GDA@@TAH<script>1<2</script>\n<script>@@CSS@@</script>I"
    )


@pytest.mark.parametrize("wanted", ["shell.js", "unpack.js", "main.js"])
def test_a_script_of_ours_that_would_end_its_element_is_refused_by_name(
    wanted: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asset = pages._asset
    monkeypatch.setattr(pages, "_asset", lambda name: "<!--" if name == wanted else asset(name))
    with pytest.raises(CannotCompute, match=f"^{re.escape(wanted)}: contains the end of a script element"):
        b"".join(pages.page({"title": "a"}, b""))


@pytest.mark.parametrize("text", ("</script", "</SCRIPT>", "a <!-- b"))
def test_a_script_that_would_end_its_element_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(pages, "_bundle", lambda: (text, "main.min.js"))
    with pytest.raises(CannotCompute, match=r"main\.min\.js: contains the end of a script element"):
        b"".join(pages.page({"title": "a"}, b""))


# -- hostile programs -----------------------------------------------------------------------------------


@pytest.mark.parametrize("comment", HOSTILE, ids=lambda text: ascii(text[:12]))
def test_a_hostile_comment_is_text(comment: bytes, machine: Path, html: bytes) -> None:
    # behind the end a control takes anything
    program = HEAD + b"G1 X100 Y50 F600\nM2\n; " + comment + b"\n"
    page = Page(olp.view(program, machine).html())
    clean = Page(html)
    # the same elements and the same scripts as any page has
    assert [tag for tag, _ in page.tags] == [tag for tag, _ in clean.tags]
    assert page.scripts == clean.scripts
    assert "<" not in page.manifest_text
    line = page.array("text_nominal")[5]
    assert len(line) < 2100
    assert all(c.isprintable() or c in "\t�" for c in line)
    visible = comment.decode("utf-8", "ignore")[:50]
    if visible.isprintable():
        assert visible in line


def test_hostile_names_are_text(machine: Path, tmp_path: Path, html: bytes) -> None:
    path = tmp_path / "<img src=x onerror=alert(1)>&'\".ngc"
    path.write_bytes(TEXT)
    page = Page(olp.view(path, machine).html())
    assert [tag for tag, _ in page.tags] == [tag for tag, _ in Page(html).tags]
    assert page.manifest["program"] == path.name
    assert path.name in page.text


def test_a_name_cannot_turn_the_words_beside_it(machine: Path, tmp_path: Path) -> None:
    path = tmp_path / "part\u202egnp.ngc"
    path.write_bytes(TEXT)
    page = Page(olp.view(path, machine).html())
    assert "\u202e" not in json.dumps(page.manifest, ensure_ascii=False)
    assert page.manifest["program"] == "part\ufffdgnp.ngc"
    assert "\u202e" not in page.text


# -- what it says ---------------------------------------------------------------------------------------


def test_every_array_that_is_named_is_there(html: bytes) -> None:
    page = Page(html)
    manifest = page.manifest
    count = manifest["samples"]
    for name in (manifest[key] for key in ("base", "line", "rapid", "time", "way", "axes")):
        assert len(page.array(name)) == count
    for layer in manifest["layers"]:
        assert (layer["delta"] is None) == (layer["name"] == "nominal")
        assert layer["delta"] is None or page.array(layer["delta"]).shape == page.array(layer["base"]).shape
    for metric in manifest["metrics"]:
        for array in metric["by_layer"].values():
            assert array is None or len(page.array(array)) == count
    motion = manifest["motion"]
    columns = [motion[key] for key in ("time", "line", "speed", "feed")]
    columns += [
        axis[key] for axis in motion["axes"] for key in ("position", "velocity", "acceleration", "jerk")
    ]
    assert len({len(page.array(name)) for name in columns}) == 1
    for mesh in manifest["meshes"]:
        faces = page.array(mesh["faces"])
        assert faces.max() < len(page.array(mesh["vertices"]))
        assert mesh["path"] == [] or mesh["path"] in [node["path"] for node in manifest["nodes"]]


def test_layers_are_the_samples_to_a_nanometre(machine: Path) -> None:
    review = olp.view(TEXT, machine, time=False)
    scene, page = review.scene, Page(review.html())
    origin = np.array(page.manifest["origin_mm"])
    assert np.abs(page.array("P") + origin - scene.position_mm).max() <= 0.5e-4 + 1e-10
    axes = page.array("Q") + np.array(page.manifest["axes_origin"])
    assert np.abs(axes - scene.samples.axis_mm).max() <= 0.5e-4 + 1e-10
    deltas = {
        "uncorrected": scene.samples.uncorrected, "command": scene.samples.correction,
        "corrected": scene.samples.corrected,
    }  # fmt: skip
    for name, delta in deltas.items():
        assert np.abs(page.array(page.layer(name)["delta"]) - delta).max() <= 0.5e-6 + 1e-12
    assert np.abs(page.array("t") - scene.time_s).max() <= 0.5e-6 + 1e-9
    assert np.abs(page.array("s") - scene.samples.arc_mm).max() <= 0.5e-3 + 1e-9


def test_a_source_shows_what_it_does(machine: Path) -> None:
    review = olp.view(TEXT, machine, time=False)
    page = Page(review.html())
    assert page.manifest["sources"] == [f"source:{name}" for name, _ in review.scene.sources]
    for name, size in review.scene.sources:
        metric: dict[str, Any] = next(m for m in page.manifest["metrics"] if m["name"] == f"source:{name}")
        shown = page.array(metric["by_layer"]["uncorrected"])
        assert np.abs(shown - size.values()).max() <= size.step
        assert size.step <= max(size.largest / 200, 0.001)


@pytest.mark.slow
def test_findings_and_verdict_are_those_of_the_proof(machine: Path) -> None:
    result = olp.correct(TEXT, machine)
    page = Page(olp.view(TEXT, machine, correction=result, time=False).html())
    assert [f["code"] for f in page.manifest["findings"]] == [f.code for f in result.findings]
    assert all(f["title"] == RULES[f["code"]].title for f in page.manifest["findings"])
    assert page.manifest["verdict"]["ok"] is result.report["deviation"]["holds"] is True
    above = olp.correct(TEXT, machine)
    above.report["verdict"]["ok"] = False
    assert (
        Page(olp.view(TEXT, machine, correction=above, time=False).html()).manifest["verdict"]["ok"] is False
    )


def test_numbers_of_the_manifest_are_numbers(html: bytes) -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    json.loads(Page(html).manifest_text, parse_constant=refuse)


# -- size -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("step", "most"), [(0.02, 14.0), (0.005, 9.0)])
def test_a_point_takes_so_many_bytes(step: float, most: float, machine: Path) -> None:
    """All layers, sources and times of a smooth path, in base64; four texts and meshes are not counted."""
    review = olp.view(TEXT, machine, time=False, step_mm=step)
    arrays = manifest_of(review.scene)[1]
    assert len(review.scene.samples) > 5000
    assert len(arrays.encoded()) / len(review.scene.samples) <= most


# -- refusals -------------------------------------------------------------------------------------------


def test_refusals_name_file_and_line(machine: Path, tmp_path: Path) -> None:
    part = tmp_path / "part.ngc"
    part.write_bytes(HEAD + b"G1 X#5 F600\nM2\n")
    with pytest.raises(ProgramError) as caught:
        olp.view(part, machine, time=False)
    assert str(caught.value).startswith(f"{part}:4: ")
    part.write_bytes(HEAD + b"G1 X9000 F600\nM2\n")
    with pytest.raises(OutsideBox) as outside:
        olp.view(part, machine, time=False)
    assert str(outside.value).startswith(f"{part}:4: ")
    part.write_bytes(TEXT)
    other = tmp_path / "other.ngc"
    other.write_bytes(TEXT.replace(b"X100", b"X130"))
    with pytest.raises(ProgramError) as foreign:
        olp.view(part, machine, corrected=other, time=False)
    assert str(foreign.value).startswith(f"{other}:")


@pytest.mark.slow
def test_a_corrected_program_is_shown_as_it_is(machine: Path) -> None:
    """Whoever wrote it: the proof is that of a verification."""
    result = olp.correct(TEXT, machine)
    ours = olp.view(TEXT, machine, correction=result, time=False).scene
    theirs = olp.view(TEXT, machine, corrected=result.data, time=False).scene
    np.testing.assert_array_equal(ours.samples.corrected, theirs.samples.corrected)
    raw = olp.view(TEXT, machine, corrected=TEXT, time=False).scene
    ends = raw.samples.share == 1.0
    np.testing.assert_allclose(raw.samples.corrected[ends], raw.samples.uncorrected[ends], atol=1e-12)
    assert raw.report["deviation"]["holds"] is False


def test_a_correction_of_an_unrolled_program_is_shown_beside_it(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (
        HEAD + b"#1 = 0\no1 while [#1 lt 3]\nG1 X[40 + #1] Y[2 * #1] F600\n#1 = [#1 + 1]\no1 endwhile\nM2\n"
    )
    corrected = olp.correct(text, machine, flatten=True)
    ours = olp.view(text, machine, correction=corrected, flatten=True, time=False).scene
    calls: list[str] = []
    for name, where, key in (("read", job, "read"), ("read", refusals, "read"), ("load", Session, "loaded")):
        what = getattr(where, key)

        def counted(*args: Any, _what: Any = what, _name: str = name, **more: Any) -> Any:
            calls.append(_name)
            return _what(*args, **more)

        monkeypatch.setattr(where, key, counted)
    theirs = olp.view(text, machine, corrected=corrected.data, flatten=True, time=False).scene
    np.testing.assert_array_equal(ours.samples.corrected, theirs.samples.corrected)
    assert theirs.report["deviation"] == ours.report["deviation"]
    # each text is read once
    assert sorted(calls) == ["load", "read", "read"]


def test_a_page_is_written_whole_and_over_nothing(machine: Path, tmp_path: Path) -> None:
    review = olp.view(TEXT, machine, time=False)
    path = tmp_path / "review.html"
    review.write(path)
    assert path.read_bytes() == review.html()
    path.write_bytes(b"mine")
    with pytest.raises(UsageError, match="--force"):
        review.write(path)
    assert path.read_bytes() == b"mine"
    review.write(path, force=True)
    assert path.read_bytes() == review.html()
    assert list(tmp_path.iterdir()) == [path]


def test_a_page_that_cannot_be_made_leaves_no_file(
    machine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    review = olp.view(TEXT, machine, time=False)
    monkeypatch.setattr(pages, "_bundle", lambda: ("</script>", "bad.js"))
    with pytest.raises(CannotCompute):
        review.write(tmp_path / "review.html")
    assert list(tmp_path.iterdir()) == []


def test_without_meshcat_the_page_says_what_to_do(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(CannotCompute, match="pip install meshcat"):
        olp.view(TEXT, machine, time=False).html()


def test_a_file_that_is_not_there(machine: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        olp.view(tmp_path / "none.ngc", machine)


@pytest.mark.slow
def test_the_page_colours_by_band_and_by_probability(tmp_path: Path) -> None:
    machine = random_machine(tmp_path, 3)
    unknown = Page(olp.view(TEXT, machine, time=False).html())
    assert {"band", "beyond"}.isdisjoint(m["name"] for m in unknown.manifest["metrics"])
    calibration = machine.with_name("calibration.toml")
    square = "[squareness]\nsigma_C0Y_urad = 20.0\n"
    assert "[squareness]\n" in calibration.read_text()
    calibration.write_text(calibration.read_text().replace("[squareness]\n", square))
    review = olp.view(TEXT, machine, part_tolerance_um=3.0, time=False)
    sure, page = review.scene.uncertainty, Page(review.html())
    assert sure is not None
    metrics: dict[str, Any] = {m["name"]: m for m in page.manifest["metrics"]}
    band = page.array(metrics["band"]["by_layer"]["corrected"])
    assert sure.band_mm.max() > 1e-3
    assert np.abs(band - sure.band_mm * 1e3).max() <= max(sure.band_mm.max() * 5.0, 0.001)
    assert metrics["beyond"]["label"] == "probability beyond 3 µm"
    for layer in ("uncorrected", "corrected"):
        shown = page.array(metrics["beyond"]["by_layer"][layer])
        assert np.abs(shown - 100.0 * sure.beyond[layer]).max() <= 0.051
    # points far off are beyond the tolerance with probability 1
    away = np.linalg.norm(review.scene.samples.uncorrected, axis=1) > 3e-3 + 3.0 * sure.band_mm
    assert away.any() and (sure.beyond["uncorrected"][away] > 0.99).all()
    # at the touch-off, or where a sure path is right, nothing is beyond
    assert (sure.beyond["corrected"][sure.band_mm < 1e-3] < 0.01).all()
