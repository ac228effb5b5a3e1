"""Covariance files that are damaged, or that unpack to more than their bytes: one sentence, little memory."""

from __future__ import annotations

import io
import random
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.errormodel.entry import Entry
from olp.errormodel.uncertainty import Uncertainty
from olp.files.archive import read_arrays
from olp.files.calibration.covariance import covariance_bytes, parse_covariance

RNG = np.random.default_rng(5)
KNOWN = Uncertainty(
    (
        Entry("mean", "EXX", RNG.normal(size=(4, 3)), np.full(4, 1e-4), np.arange(4.0)),
        Entry("mean", "EYY", RNG.normal(size=(3, 3)), np.full(3, 1e-4), np.arange(3.0)),
    ),
    "0" * 64,
    "a fit",
)
GOOD = covariance_bytes(KNOWN)


def archive(**changes: Any) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **(dict(np.load(io.BytesIO(GOOD))) | changes))
    return stream.getvalue()


def refusal(data: bytes) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_covariance(data, "c.npz")
    message = str(caught.value)
    assert message.startswith("c.npz: ") and "\n" not in message
    assert "as olp calibrate fit writes it" in message or "covariance" in message
    return message


def rewritten(change: Callable[[zipfile.ZipInfo, bytes], bytes], **settings: Any) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(GOOD)) as old, zipfile.ZipFile(stream, "w", **settings) as new:
        for entry in old.infolist():
            new.writestr(entry.filename, change(entry, old.read(entry)))
    return stream.getvalue()


@pytest.mark.slow
def test_every_cut_and_many_flips_of_bits_are_refused_or_read() -> None:
    draw = random.Random(8)
    cuts = [GOOD[:k] for k in range(0, len(GOOD), 7)]
    flips = []
    for _ in range(1500):
        flipped = bytearray(GOOD)
        for _ in range(draw.choice((1, 1, 2, 5))):
            flipped[draw.randrange(len(flipped))] ^= 1 << draw.randrange(8)
        flips.append(bytes(flipped))
    refused = 0
    for data in cuts + flips:
        try:
            parse_covariance(data, "c.npz")
        except ConfigError:
            refused += 1
    assert refused > len(cuts)


@pytest.mark.slow
def test_an_archive_that_unpacks_to_much_is_refused_before_it_is_unpacked() -> None:
    data = archive(factor=np.zeros((7, 40_000_000 // 7), np.float32))
    assert len(data) < 500_000
    tracemalloc.start()
    try:
        message = refusal(data)
        assert "unpacks to 1600" in message and "expected at most 8000000 of so small a file" in message
        assert tracemalloc.get_traced_memory()[1] < 4_000_000
    finally:
        tracemalloc.stop()


def test_a_header_that_states_more_than_there_is_takes_no_memory() -> None:
    def lies(entry: zipfile.ZipInfo, raw: bytes) -> bytes:
        return raw.replace(b"(7, 3), ", b"(7, 10**9), ".replace(b"10**9", b"900000000"))

    assert "its header states" in refusal(rewritten(lies))


def test_other_packings_and_encryption_are_refused() -> None:
    assert "packed in another way" in refusal(rewritten(lambda _, raw: raw, compression=zipfile.ZIP_LZMA))
    marked = bytearray(GOOD)
    for mark, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        place = marked.find(mark)
        while place >= 0:
            struct.pack_into("<H", marked, place + at, 1)
            place = marked.find(mark, place + 1)
    assert "is encrypted" in refusal(bytes(marked))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"count": np.array([2**63 - 1, 2**63 - 1], np.int64)}, "do not fit each other"),
        ({"count": np.array(7)}, "do not fit each other"),
        ({"dropped": np.zeros(3)}, "do not fit each other"),
        ({"source": np.array(["a", "b"])}, "do not fit each other"),
        ({"rest": np.array(1.0)}, "do not fit each other"),
        ({"factor": np.zeros((7, 9))}, "do not fit each other"),
        ({"factor": np.zeros((7, 3), "U5")}, "factor is missing or of another type"),
        ({"name": np.array(["EXX", 3], object)}, "its header states"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(changes: dict[str, Any], expected: str) -> None:
    assert expected in refusal(archive(**changes))


def test_only_what_is_asked_for_is_read() -> None:
    data = archive(other=np.zeros(30_000_000, np.uint8))
    assert parse_covariance(data, "c.npz").entries[0].name == "EXX"
    assert set(read_arrays(data, ["rest", "none"])) == {"rest"}
