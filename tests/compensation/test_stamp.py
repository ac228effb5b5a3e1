"""The stamp of a corrected program: how it reads, and where it goes."""

from __future__ import annotations

import pytest

from olp.compensation.stamp import accepted_in, find_stamp, is_of, stamp_line, stamped
from olp.core.version import __version__

DIGEST = "0123456789abcdef"
STAMP = b"(S)"
VERSION = __version__.encode()
#: a tape mark, then a number or a colon
FIRST = (b"%", b"O|:")


def test_the_stamp_states_calibration_version_and_accepted_doubts() -> None:
    assert stamp_line(DIGEST, (b"(", b")")) == b"(olp-corrected 0123456789ab olp " + VERSION + b")"
    line = stamp_line(DIGEST, (b"; ", b""), ("OLP440", "OLP101"))
    assert line == b"; olp-corrected 0123456789ab olp " + VERSION + b" accepted OLP440 OLP101"


def test_a_stamp_is_found_and_says_of_which_calibration_it_is() -> None:
    text = b"%\n" + stamp_line(DIGEST, (b"(", b")")) + b"\nG1\n"
    found = find_stamp(text)
    assert found is not None and found.start() == 3
    assert is_of(found, DIGEST) and not is_of(found, "1" + DIGEST)
    for other in (b"(olp-corrected 0123456789a)", b"(olp-corrected 0123456789aB)", b"G1\n"):
        assert find_stamp(other) is None


def test_doubts_are_accepted_for_one_calibration() -> None:
    text = b"%\n" + stamp_line(DIGEST, (b"(", b")"), ("OLP440", "OLP101")) + b"\n"
    both = frozenset({"OLP440", "OLP101"})
    assert accepted_in(text, DIGEST) == accepted_in(text, None) == both
    assert accepted_in(text, "f" + DIGEST) == frozenset()
    assert accepted_in(stamp_line(DIGEST, (b"(", b")")), None) == frozenset()
    assert accepted_in(b"G1\n", DIGEST) == frozenset()


@pytest.mark.parametrize(
    ("before", "behind"),
    [
        (b"", b"G1\n"), (b"%\n", b"G1\n"), (b"%\nO100 (NAME)\n", b"G1\n"), (b"O100\n", b"G1\n"),
        (b"%\r\n:5\r\n", b"G1\r\n"), (b" \t% abc\n o7\n", b"G1\n"),
        (b"\xef\xbb\xbf", b"G1\n"), (b"\xef\xbb\xbf%\n", b"G1\n"),
        # one of each kind, and in this order
        (b"%\n", b"%\nG1\n"), (b"O1\n", b"%\nG1\n"), (b"O1\n", b"O2\n"),
        # an end of the text is an end of a line
        (b"%", b""), (b"", b""), (b"%\n", b"\nO1\n"), (b"", b"\xef\xbb%\n"),
    ],
)  # fmt: skip
def test_the_stamp_comes_behind_what_has_to_be_first(before: bytes, behind: bytes) -> None:
    assert stamped(before + behind, STAMP, b"\r\n", FIRST) == before + STAMP + b"\r\n" + behind


def test_nothing_has_to_be_first() -> None:
    assert stamped(b"%\nO1\n", STAMP, b"\n", ()) == b"(S)\n%\nO1\n"


def test_a_line_of_blanks_is_looked_into_for_forty_bytes() -> None:
    for blanks, expected in ((39, b" " * 39 + b"%\n(S)\nG1"), (40, b"(S)\n" + b" " * 40 + b"%\nG1")):
        assert stamped(b" " * blanks + b"%\nG1", STAMP, b"\n", FIRST) == expected
