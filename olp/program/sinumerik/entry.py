"""How a Sinumerik text is turned into words and unrolled; modules are loaded when they are first used."""

from __future__ import annotations

from olp.program.rs274.translation import Translation


def translate_text(data: bytes) -> Translation:
    """`olp.program.sinumerik.translate.translate`."""
    from olp.program.sinumerik.translate import translate

    return translate(data)
