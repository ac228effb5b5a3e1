"""The table of a file that states in comments how it was taken."""

from __future__ import annotations

from olp.core.schema import Table, Text
from olp.core.schema_keys import Field


class InstrumentTable(Table):
    file: Text = Field(
        description="the path of a CSV file that states in comments how it was taken, as "
        "`olp calibrate diagonals` and `olp calibrate ballbar` read it, relative to this file"
    )
