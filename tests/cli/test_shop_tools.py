"""What other tools of a shop call: the post-processor of FreeCAD, lines for Fusion, the editor of Mastercam,
hooks of git, and several programs in one call."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import shutil
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import click
import pytest
from cli.test_cli import PROGRAMS, run

import olp
from olp.cli import main
from olp.files.json_schema import KINDS, json_schema

ROOT = Path(olp.__file__).parents[1]
SHOP = PROGRAMS / "shop"
ROUTER = PROGRAMS / "table-router"
POSTED = "G21 G90 G54 G17\nG0 X10 Y10 Z5\nG1 Z-1 F300\nX60 F900\nY60\nM2\n"


@pytest.fixture
def command(tmp_path: Path) -> Path:
    """The command olp as a file, as an installation has it."""
    if sys.platform == "win32":
        pytest.skip("writes a script for sh")
    path = tmp_path / "bin" / "olp"
    path.parent.mkdir()
    path.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m olp "$@"\n', "utf-8")
    path.chmod(0o755)
    return path


@pytest.fixture
def post() -> Any:
    """The post-processor, as FreeCAD loads it: from its file, under its own name."""
    spec = importlib.util.spec_from_file_location("olp_post", SHOP / "olp_post.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def linuxcnc(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, str, str]]:
    """A post-processor of FreeCAD that keeps its calls and writes POSTED."""
    calls: list[tuple[Any, str, str]] = []
    module = types.ModuleType("linuxcnc_post")
    module.TOOLTIP_ARGS = "[--no-show-editor] [--precision N]"  # type: ignore[attr-defined]

    def export(objects: Any, filename: str, words: str) -> str:
        calls.append((objects, filename, words))
        return POSTED

    module.export = export  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "linuxcnc_post", module)
    return calls


def words_of(command: Path, *more: str) -> str:
    return " ".join([f'--olp="{command}"', f'--machine="{ROUTER / "machine.toml"}"', *more])


def corrected_by_verb(tmp_path: Path) -> str:
    (tmp_path / "posted.ngc").write_text(POSTED, "utf-8")
    out = tmp_path / "by-verb.ngc"
    result = run("correct", tmp_path / "posted.ngc", "-m", ROUTER / "machine.toml", "-q", "-o", out)
    assert result.exit_code == 0, result.stderr
    return out.read_text("utf-8")


@pytest.mark.slow
def test_freecad_gets_the_corrected_program(
    post: Any, linuxcnc: list[Any], command: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As new versions call it, with "-", and as old ones do, with the name of a file."""
    monkeypatch.setenv("PYTHONHOME", str(tmp_path))
    text = post.export(["profile"], "-", words_of(command, "--precision 4"))
    assert text == corrected_by_verb(tmp_path) != POSTED
    assert linuxcnc == [(["profile"], "-", "--precision 4 --no-show-editor")]
    target = tmp_path / "part.ngc"
    assert post.export(["profile"], str(target), words_of(command)) == text
    assert target.read_text("utf-8") == text


@pytest.mark.slow
@pytest.mark.parametrize(("more", "says"), [
    ("--olp-args='--part-tolerance-um 0.1'", "exit code 1"),
    ("--olp-args='--no-such-option'", "there is no option"),
    ("--olp-args='--dialect apt'", "is not a statement that olp knows"),
])  # fmt: skip
def test_freecad_writes_nothing_where_olp_fails(
    post: Any, linuxcnc: list[Any], command: Path, tmp_path: Path, more: str, says: str
) -> None:
    target = tmp_path / "part.ngc"
    with pytest.raises(RuntimeError, match=says):
        post.export([], str(target), words_of(command, more))
    assert not target.exists()


def test_freecad_says_what_is_missing(post: Any, linuxcnc: list[Any]) -> None:
    with pytest.raises(RuntimeError, match="no post-processor absent with a function export"):
        post.export([], "-", "--post=absent")
    with pytest.raises(RuntimeError, match="is this one; give the one that writes"):
        post.export([], "-", "--post=olp")
    with pytest.raises(RuntimeError, match=r"no-such-olp does not start .*--olp=PATH"):
        post.export([], "-", "--olp=no-such-olp")
    with pytest.raises(RuntimeError, match="olp: argument --post: expected one argument"):
        post.export([], "-", "--post")
    with pytest.raises(RuntimeError, match="a quote without its end"):
        post.export([], "-", "--machine='C:/mill")
    sys.modules["linuxcnc_post"].export = lambda *_: None  # type: ignore[attr-defined]
    with pytest.raises(RuntimeError, match="has written no program"):
        post.export([], "-", "")


def test_freecad_takes_paths_of_windows(post: Any) -> None:
    line = r'--machine="C:\new mill\machine.toml" --olp=C:\olp\olp.exe # --precision 4'
    words = [r"--machine=C:\new mill\machine.toml", r"--olp=C:\olp\olp.exe", "#", "--precision", "4"]
    assert post._words(line) == words


def test_freecad_takes_a_script_of_the_user_and_a_legacy_one(
    post: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine_post.py").write_text(
        "def export(objects, filename, words):\n    return words\n", "utf-8"
    )
    preferences = types.SimpleNamespace(searchPathsPost=lambda: [str(tmp_path)])
    monkeypatch.setitem(sys.modules, "Path.Preferences", preferences)
    assert post._posted("mine", [], ["--a b"]) == "'--a b'"
    new = types.ModuleType("new_post")
    old = types.ModuleType("new_legacy_post")
    old.export = lambda *_: "G0"  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "new_post", new)
    monkeypatch.setitem(sys.modules, "new_legacy_post", old)
    assert post._posted("new", [], []) == "G0"


def node() -> str:
    found = shutil.which("node")
    if found is None:
        pytest.skip("needs node")
    return found


@pytest.mark.slow
@pytest.mark.parametrize("code", [0, 3])
def test_the_lines_for_fusion_call_olp(tmp_path: Path, code: int) -> None:
    """Run by node, with the functions of the post engine that they use."""
    script = tmp_path / "run.js"
    engine = (
        "const said = {};\n"
        "function getOutputPath() { return 'C:\\\\nc files\\\\part.nc'; }\n"
        f"function execute(...words) {{ said.call = words; return {code}; }}\n"
        "function error(text) { said.error = text; }\n"
    )
    lines = (SHOP / "fusion-olp.js").read_text("utf-8")
    script.write_text(f"{engine}{lines}\nonTerminate();\nconsole.log(JSON.stringify(said));\n", "utf-8")
    done = subprocess.run([node(), str(script)], capture_output=True, text=True, check=True)
    said = json.loads(done.stdout)
    program, arguments, hidden, folder = said["call"]
    assert (program, hidden, folder) == ("C:/olp/.venv/Scripts/olp.exe", True, "")
    words = re.findall(r'"([^"]*)"', arguments)
    assert arguments == " ".join(f'"{word}"' for word in words)
    assert words[:2] == ["correct", r"C:\nc files\part.nc"]
    assert_options_exist("correct", words)
    assert ("error" in said) == bool(code)
    assert not code or "exit code 3" in said["error"]


def assert_options_exist(verb: str, words: list[str]) -> None:
    known = main.get_command(click.Context(main), verb)
    assert known is not None
    options = {name for parameter in known.params for name in parameter.opts}
    assert {word for word in words if re.match(r"-\w|--\w", word)} <= options


def test_the_editor_of_mastercam_calls_olp() -> None:
    data = (SHOP / "olp-open.cmd").read_bytes()
    assert data.count(b"\r\n") == data.count(b"\n") > 5, "cmd.exe reads lines that end in CR LF"
    (line,) = (text for text in data.decode("ascii").splitlines() if " correct " in text)
    words = shlex.split(line)
    assert words[:3] == ["%OLP%", "correct", "%~1"]
    assert_options_exist("correct", words)


def hooks() -> dict[str, str]:
    """The only hook, as pre-commit reads it."""
    text = (ROOT / ".pre-commit-hooks.yaml").read_text("utf-8")
    assert text.count("- id:") == 1
    return dict(re.findall(r"^[- ] (\w+): (.*)$", text, re.MULTILINE))


def test_the_hook_of_git_checks_programs(tmp_path: Path) -> None:
    hook = hooks()
    assert hook["id"] == "olp-check"
    assert hook["language"] == "python"
    ours = [path.name for path in PROGRAMS.rglob("*") if re.search(hook["files"], path.as_posix())]
    assert {"plate.ngc", "bracket.nc", "housing.dmi", "creo.ncl"} <= set(ours)
    assert not any(name.endswith((".toml", ".csv", ".py")) for name in ours)
    program, verb = hook["entry"].split()
    assert program == "olp"
    names = [ROUTER / "outline.ngc", ROUTER / "drill.ngc"]
    good = run(verb, "-m", ROUTER / "machine.toml", *names)
    assert good.exit_code == 0, good.stderr
    assert [good.stdout.count(f"Program  {path.name}") for path in names] == [1, 1]
    assert good.stdout.count("Go: no finding") == 2


def test_several_programs_end_with_the_worst_exit_code(tmp_path: Path) -> None:
    (tmp_path / "refused.ngc").write_text("G21 G90 G54\nG41 D1\nG1 X10 F300\n", "utf-8")
    machine = ("-m", ROUTER / "machine.toml")
    names = [tmp_path / "absent.ngc", tmp_path / "refused.ngc", ROUTER / "outline.ngc"]
    result = run("check", *names, *machine)
    assert result.exit_code == 3
    assert "absent.ngc: no such file" in result.stderr
    assert "refused.ngc:2" in result.stderr
    assert "Go: no finding" in result.stdout, "the others are checked all the same"
    strict = (*machine, "--fail-on", "warning", "-q")
    assert run("check", *names[2:], *strict).exit_code == 1
    assert run("check", *names[1:], *strict).exit_code == 3, "not that of the last"
    assert run("check", names[1], ROUTER / "machine.toml", *machine, "-q").exit_code == 3


@pytest.mark.parametrize("words", [
    ("--format", "sarif"), ("--json",), ("-o", "out.txt"), ("--nominal", "part.ngc"),
])  # fmt: skip
def test_what_one_program_alone_has(words: tuple[str, ...]) -> None:
    result = run("check", ROUTER / "outline.ngc", ROUTER / "drill.ngc", "-m", ROUTER / "machine.toml", *words)
    assert result.exit_code == 2
    assert "is for one program, and 2 are named" in result.stderr


def test_runs_of_two_programs_have_two_ids_for_services() -> None:
    ids = []
    for name in ("outline.ngc", "drill.ngc"):
        result = run("check", ROUTER / name, "-m", ROUTER / "machine.toml", "--format", "sarif")
        (sarif,) = json.loads(result.stdout)["runs"]
        ids.append(sarif["automationDetails"]["id"])
    assert len(set(ids)) == 2
    assert all(name.endswith("/") for name in ids), "what is before the last slash is the category"


def test_schemas_have_identifiers_and_go_to_files(tmp_path: Path) -> None:
    identifiers = {kind: json_schema(kind)["$id"] for kind in KINDS}
    assert identifiers["machine"] == "urn:olp-corrector:schema:olp-machine-1"
    assert len(set(identifiers.values())) == len(KINDS)
    for kind in KINDS:
        stated = json.dumps(json_schema(kind))
        # a machine of joints is a machine file as well, of another shape
        key = f"olp-{kind.removeprefix('joint-')}-1"
        assert f'"{key}"' in stated and key in identifiers[kind], "the identifier names the key schema"
    target = tmp_path / "machine.schema.json"
    assert run("schema", "machine", "-o", target).exit_code == 0
    assert target.read_text("utf-8") == run("schema", "machine").stdout
    assert run("schema", "machine", "-o", target).exit_code == 2
    assert run("schema", "machine", "-o", target, "--force").exit_code == 0
