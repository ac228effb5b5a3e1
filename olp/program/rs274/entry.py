"""How a registered control is read and unrolled; these modules are loaded when they are first used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from olp.core.arrays import Index
from olp.core.machine import Setup
from olp.core.spool import Text
from olp.program.dialect import Options
from olp.program.kept import Kept
from olp.program.origin import Unrolled
from olp.program.program import Program
from olp.program.rs274.profiles.base import Profile

if TYPE_CHECKING:
    from olp.program.touches import Touches


def read_blocks(data: Text, setup: Setup, profile: Profile, options: Options, *, words: bool) -> Program:
    """`olp.program.rs274.reader.read`, with the path of the tool along contours."""
    from olp.program.contours.program import with_tool_path
    from olp.program.rs274.reader import read

    return with_tool_path(read(data, setup, profile, options, words=words), profile.contours)


def unroll_blocks(data: bytes, profile: Profile, **options: Any) -> Unrolled:
    """`olp.program.rs274.flatten.unroll.flatten`."""
    from olp.program.rs274.flatten.unroll import flatten

    return flatten(data, profile, **options)


def keep_blocks(unrolled: Unrolled, corrected: bytes, starts: Index, profile: Profile) -> Kept:
    """`olp.program.rs274.flatten.kept.kept`."""
    from olp.program.rs274.flatten.kept import kept

    return kept(unrolled, corrected, starts, profile)


def touching_blocks(profile: Profile, touches: Touches, digits: int, notes: Sequence[str], log: str) -> bytes:
    """`olp.program.rs274.probing.probing_program`."""
    from olp.program.rs274.probing import probing_program

    return probing_program(profile, touches, digits, notes, log)
