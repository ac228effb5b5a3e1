"""A post-processor for FreeCAD's CAM workbench: another one writes the program, and `olp` corrects it.

Put this file into the folder of your own post-processors, choose the processor "olp" in the job, and give its
arguments there, such as

    --post=linuxcnc --machine=C:/mill/machine.toml --olp=C:/olp/.venv/Scripts/olp.exe

Where olp refuses the program, or it is above tolerance, nothing is written, and the report view says why.
FreeCAD has a Python of its own: this file needs nothing but that, and calls the command olp.
"""

import argparse
import importlib
import importlib.util
import os
import shlex
import subprocess
from pathlib import Path

#: Variables by which FreeCAD's own Python and libraries would be taken by the one that runs olp.
_OURS = ("PYTHONHOME", "PYTHONPATH", "PYTHONSTARTUP", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
#: Where FreeCAD keeps its post-processors, the newest place first.
_PLACES = ("Path.Post.scripts.{}", "PathScripts.post.{}", "{}")
#: Endings of their names; those that are scripts have the second one in new versions.
_ENDINGS = ("_post", "_legacy_post")
#: Keeps a processor from showing the uncorrected program in an editor.
_NO_EDITOR = "--no-show-editor"


class _Parser(argparse.ArgumentParser):
    """Arguments whose errors are those of a post-processor; FreeCAD would not outlive SystemExit."""

    def error(self, message):
        raise RuntimeError(f"olp: {message}")


_parser = _Parser(prog="olp", add_help=False, allow_abbrev=False)
_parser.add_argument("--post", default="linuxcnc", help="the post-processor that writes the program")
_parser.add_argument("--machine", help="the machine file of olp")
_parser.add_argument("--job", help="the job file of olp")
_parser.add_argument("--olp", default="olp", help="the command olp, where it is not on the path")
_parser.add_argument("--olp-args", default="", help='more options of olp correct, such as "--accept OLP409"')

TOOLTIP = __doc__
TOOLTIP_ARGS = _parser.format_help() + "\nOther arguments go to the post-processor that writes the program.\n"
UNITS = "G21"


def export(objectslist, filename, argstring):
    """The corrected program as text, which is also written to `filename` unless that is "-".

    Raises RuntimeError where the program cannot be written or corrected; nothing is written then.
    """
    ours, others = _parser.parse_known_args(_words(argstring))
    corrected = _corrected(_posted(ours.post, objectslist, others), ours)
    if filename != "-":
        # the line ends are those of the program
        Path(filename).write_bytes(corrected.encode("utf-8"))
    return corrected


def _words(argstring):
    """The words of a line; a backslash is one of a path, not an escape."""
    lexer = shlex.shlex(argstring, posix=True)
    lexer.whitespace_split, lexer.escape, lexer.commenters = True, "", ""
    try:
        return list(lexer)
    except ValueError:
        raise RuntimeError(f"the arguments {argstring!r} have a quote without its end; close it") from None


def _posted(name, objectslist, words):
    """What the other post-processor writes."""
    module = _post(name)
    if _NO_EDITOR in (getattr(module, "TOOLTIP_ARGS", None) or "") and _NO_EDITOR not in words:
        words = [*words, _NO_EDITOR]
    program = module.export(objectslist, "-", shlex.join(words))
    if not isinstance(program, str) or not program:
        raise RuntimeError(f"the post-processor {name} has written no program; check its arguments")
    return program


def _post(name):
    """The module of a post-processor that is a script: of the user, else of FreeCAD."""
    if f"{name}{_ENDINGS[0]}" == Path(__file__).stem:
        raise RuntimeError(f"the post-processor {name} is this one; give the one that writes with --post")
    for ending in _ENDINGS:
        for folder in _own_folders():
            path = Path(folder) / f"{name}{ending}.py"
            if path.is_file():
                spec = importlib.util.spec_from_file_location(path.stem, path)
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
                if hasattr(module, "export"):
                    return module
        for place in _PLACES:
            try:
                module = importlib.import_module(place.format(f"{name}{ending}"))
            except ImportError:
                continue
            if hasattr(module, "export"):
                return module
    raise RuntimeError(f"there is no post-processor {name} with a function export; give another with --post")


def _own_folders():
    """The folders of the user's own post-processors, and the one of this file."""
    try:
        preferences = importlib.import_module("Path.Preferences")
    except ImportError:
        preferences = None
    return [*(preferences.searchPathsPost() if preferences else ()), Path(__file__).parent]


def _corrected(program, ours):
    """The program as olp corrects it."""
    words = [ours.olp, "correct", "-", "-o", "-"]
    words += ["-m", ours.machine] if ours.machine else []
    words += ["-j", ours.job] if ours.job else []
    environment = {key: value for key, value in os.environ.items() if key not in _OURS}
    try:
        done = subprocess.run(
            [*words, *_words(ours.olp_args)], input=program.encode("utf-8"), capture_output=True,
            env=environment, creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0), check=False,
        )  # fmt: skip
    except OSError as error:
        raise RuntimeError(f"{ours.olp} does not start ({error.strerror}); name it with --olp=PATH") from None
    said = done.stderr.decode("utf-8", "replace")
    if done.returncode:
        raise RuntimeError(f"olp: the program is not written (exit code {done.returncode})\n{said}")
    print(said)
    return done.stdout.decode("utf-8")
