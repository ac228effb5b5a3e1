"""The byte fuzz: a short run of it, and that it finds what it looks for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytest.importorskip("resource", reason="processes of POSIX")

from fuzz import mutated
from fuzz.mutated import defects_of, input_of
from fuzz.targets import Target, targets

from olp.core.errors import InputError, OlpError

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.mark.slow
def test_mutated_inputs_end_in_success_or_one_of_our_errors(tmp_path: Path) -> None:
    assert list(defects_of(1, range(600), targets(tmp_path))) == []


@pytest.mark.slow
def test_most_inputs_of_the_targets_are_good(tmp_path: Path) -> None:
    """A fuzz of inputs that fail at their first byte would find nothing."""
    bad = []
    for target in targets(tmp_path):
        for data in target.inputs:
            try:
                target.call(data)
            except OlpError:
                continue
            break
        else:
            bad.append(target.name)
    assert bad == []


def _falls(data: bytes) -> object:
    if b"0" in data:
        return [][len(data)]
    if b"." in data:
        os._exit(3)
    if b"," in data:
        while True:
            pass
    if b"=" in data:
        return bytearray(8 << 30)
    raise InputError("no")


@pytest.mark.slow
def test_every_kind_of_defect_is_found_and_made_small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mutated, "LIMIT_S", 0.2)
    target = Target("falls", (b"a quiet text\n" * 5, b"two\n"), _falls)
    defects = list(defects_of(2, range(300), [target]))
    kinds = {defect.kind: defect for defect in defects}
    assert kinds["IndexError in test_mutated.py:_falls"].data == b"0"
    assert "MemoryError in test_mutated.py:_falls" in kinds
    assert any(kind.startswith("the process ended") for kind in kinds)
    assert any(kind.startswith("takes more than 0.2 s") for kind in kinds)
    for defect in defects:
        assert input_of(2, defect.number, [target]) == input_of(2, defect.number, [target])
