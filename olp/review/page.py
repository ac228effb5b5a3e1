"""The page: the template with the packed data and meshcat's bundle in it, one file that needs no other."""

from __future__ import annotations

import html
import importlib.util
import json
import re
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

from olp.core.errors import CannotCompute
from olp.files.write import read_bytes

#: A mark of the template.
_MARK = re.compile(r"@@([A-Z]+)@@")
#: Text that would end a script element, or change how the rest of it is read.
_BREAKS_OUT = re.compile(r"</script|<!--", re.IGNORECASE)


def page(manifest: Mapping[str, Any], data: bytes, *, live: bool = False) -> Iterator[bytes]:
    """The page in parts. `data` is the base64 of the arrays; with `live` the page may ask its own server, and
    no other, for changes."""
    values: dict[str, bytes] = {
        "TITLE": html.escape(str(manifest["title"])).encode(errors="replace"),
        "CONNECT": b"'self'" if live else b"'none'",
        "CSS": _asset("review.css").encode(),
        "MESHCAT": _script(*_bundle()),
        "LICENCE": html.escape(_licence()).encode(),
        "MANIFEST": as_json(manifest),
        "DATA": data,
        "MODULES": b"\n".join(_modules()),
    }
    # the values are not searched for marks, as a program may contain the text of one
    copied = 0
    template = _asset("review.html")
    for mark in _MARK.finditer(template):
        yield template[copied : mark.start()].encode()
        yield values[mark[1]]
        copied = mark.end()
    yield template[copied:].encode()


def as_json(value: Mapping[str, Any]) -> bytes:
    """JSON for a script element: it has no `<`, so that no text can end the element. Bytes of a name that are
    no UTF-8 become `?`."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c").encode(errors="replace")


def _modules() -> Iterator[bytes]:
    for name in _asset("modules.txt").split():
        yield b"<script>" + _script(_asset(name), name) + b"</script>"


def _script(text: str, name: str) -> bytes:
    if _BREAKS_OUT.search(text):
        raise CannotCompute(
            "contains the end of a script element, so it cannot be put into a page", file=name
        )
    return text.encode()


def _asset(name: str) -> str:
    """A file of the page: from the installed package, or from the checkout."""
    here = Path(__file__).resolve().parents[1]
    folder = here / "_viewer"
    if not folder.is_dir():
        folder = here.parent / "viewer" / "static"
    return read_bytes(folder / name).decode("utf-8")


def _bundle() -> tuple[str, str]:
    """meshcat's viewer, and its path. The package is not imported, as that would load a server."""
    spec = importlib.util.find_spec("meshcat")
    if spec is None or not spec.submodule_search_locations:
        raise CannotCompute(
            "the page needs meshcat, which is not installed; install it with pip install meshcat"
        )
    path = Path(spec.submodule_search_locations[0]) / "viewer" / "dist" / "main.min.js"
    return read_bytes(path).decode("utf-8"), str(path)


def _licence() -> str:
    """The licences of the code in the bundle."""
    try:
        listed = files("meshcat") or []
    except PackageNotFoundError:
        listed = []
    wanted = (".dist-info/LICENSE", "viewer/dist/main.min.js.LICENSE.txt", ".dist-info/licenses")
    terms = [Path(str(f.locate())) for f in listed if any(part in f.as_posix() for part in wanted)]
    return "\n\n".join(read_bytes(path).decode("utf-8", "replace").strip() for path in terms)
