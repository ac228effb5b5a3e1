"""The changes that are named as equivalent are changes of lines that are there, each with its reason."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parent
ROWS = tomllib.loads((FOLDER / "equivalent.toml").read_text("utf-8")).get("equivalent", [])


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["after"])
def test_the_line_is_there(row: dict[str, str]) -> None:
    assert row.keys() == {"file", "before", "after", "reason"}
    assert row["before"] != row["after"]
    assert row["reason"].endswith(".")
    lines = (FOLDER.parents[1] / row["file"]).read_text("utf-8").splitlines()
    assert row["before"] in " ".join(line.strip() for line in lines)
