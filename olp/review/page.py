"""The page: the template with the packed data and meshcat's bundle in it, one file that needs no other.

Its policy (W3C Content Security Policy, level 3) names each script and style by its hash and admits no other,
so that a text that finds its way into the page does not run.
"""

from __future__ import annotations

import base64
import hashlib
import html
import importlib.util
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

from olp.core.errors import CannotCompute
from olp.files.write import read_bytes

#: A mark of the template.
_MARK = re.compile(r"@@([A-Z]+)@@")
#: The first script of a page, which keeps the document as it was sent.
_SHELL = "shell.js"
#: The style sheet that the bundle of meshcat puts into the page, as JavaScript writes it.
_ADDED_STYLE = re.compile(r'document\.head\.appendChild\(\w+\),\w+\}\}\(("(?:[^"\\]|\\["\\/bfnrt])*")\)')
#: Text that would end a script element, or change how the rest of it is read.
_BREAKS_OUT = re.compile(r"</script|<!--", re.IGNORECASE)


def page(manifest: Mapping[str, Any], data: bytes, *, live: bool = False) -> Iterator[bytes]:
    """The page in parts. `data` is the base64 of the arrays; with `live` the page may ask its own server, and
    no other, for changes."""
    shell, bundle = _script(_asset(_SHELL), _SHELL), _script(*_bundle())
    modules = [_script(_asset(name), name) for name in _asset("modules.txt").split()]
    css = _asset("review.css").encode()
    values: dict[str, bytes] = {
        "TITLE": html.escape(str(manifest["title"])).encode(errors="replace"),
        "CONNECT": b"'self'" if live else b"'none'",
        "SCRIPTS": _hashes((shell, bundle, *modules)),
        "STYLES": _hashes((css, *_added_styles(bundle))),
        "CSS": css,
        "SHELL": shell,
        "MESHCAT": bundle,
        "LICENCE": html.escape(_licence()).encode(),
        "MANIFEST": as_json(manifest),
        "DATA": data,
        "MODULES": b"\n".join(b"<script>" + module + b"</script>" for module in modules),
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


def _hashes(texts: Iterable[bytes]) -> bytes:
    """Sources of a policy that are these elements' texts alone."""
    digests = (base64.b64encode(hashlib.sha256(text).digest()) for text in texts)
    return b" ".join(b"'sha256-" + digest + b"'" for digest in digests)


def _added_styles(bundle: bytes) -> Iterator[bytes]:
    """Texts of the style elements that the bundle adds: that of its controls, which the page hides, and an
    empty one, which gets its rules by script."""
    for literal in _ADDED_STYLE.findall(bundle.decode()):
        yield json.loads(literal).encode()
    yield b""


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
    return _text(folder / name)


def _text(path: Path) -> str:
    """Text of a file with line ends as a browser reads, and hashes, them."""
    return re.sub("\r\n?", "\n", read_bytes(path).decode("utf-8"))


def _bundle() -> tuple[str, str]:
    """meshcat's viewer, and its path. The package is not imported, as that would load a server."""
    spec = importlib.util.find_spec("meshcat")
    if spec is None or not spec.submodule_search_locations:
        raise CannotCompute(
            "the page needs meshcat, which is not installed; install it with pip install meshcat"
        )
    path = Path(spec.submodule_search_locations[0]) / "viewer" / "dist" / "main.min.js"
    return _text(path), str(path)


def _licence() -> str:
    """The licences of the code in the bundle."""
    try:
        listed = files("meshcat") or []
    except PackageNotFoundError:
        listed = []
    wanted = (".dist-info/LICENSE", "viewer/dist/main.min.js.LICENSE.txt", ".dist-info/licenses")
    terms = [Path(str(f.locate())) for f in listed if any(part in f.as_posix() for part in wanted)]
    return "\n\n".join(read_bytes(path).decode("utf-8", "replace").strip() for path in terms)
