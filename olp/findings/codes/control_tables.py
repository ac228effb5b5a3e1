"""The rules of tables of controls: what they cannot hold, and what has to be stated or checked."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="control_tables", gate=False)

RULES = (
    _rule(
        "OLP871",
        "table cannot hold all errors",
        Severity.WARNING,
        "The format of this control has no place for these errors, so its table leaves them in the machine; "
        "the predicted residual says how much that is.",
        "Choose a format that holds them, or leave the table out and correct the programs.",
        "Pitch and yaw, exported to LinuxCNC, which corrects one axis by its own position.",
    ),
    _rule(
        "OLP872",
        "part of a table left out",
        Severity.WARNING,
        "The file holds something that a calibration of three linear axes has no place for; the rest was "
        "read.",
        "See that the errors left out are zero or corrected elsewhere.",
        "The section `[C0B]`, the place of a rotary axis, in an Etalon exchange file.",
    ),
    _rule(
        "OLP873",
        "table coarser than the curve",
        Severity.INFO,
        "The control takes straight lines between the rows of its table, and the number of rows is limited, "
        "so that the table departs from the measured curve between them.",
        "Give the control more rows where it can take them, or correct the programs.",
        "A curve with 400 positions in a table of 256 rows.",
    ),
    _rule(
        "OLP874",
        "sense of a table not verified",
        Severity.WARNING,
        "Whether this control adds the values of its table or takes them off is not known from a public "
        "source; the file follows the sense that was stated. The wrong sense doubles every error.",
        "Run the verification program beside the table, with a laser or a dial gauge, before any part.",
        "`olp calibrate export --format siemens-cec --sense correction`.",
    ),
    _rule(
        "OLP875",
        "lost motion in the table",
        Severity.WARNING,
        "The table takes up the lost motion of an axis. `compensated_by_controller` has no name for it, so a "
        "corrected program would take it up a second time.",
        "Leave the axis out of [backlash] in the calibration that corrects programs while the table is "
        "active.",
        "`[backlash] X_um = 4.0` in a table with forward and reverse columns.",
    ),
    _rule(
        "OLP876",
        "corrected by the control already",
        Severity.INFO,
        "`compensated_by_controller` says that tables in the control correct these errors now, so they are "
        "not part of the new table; a new table that replaces the old one would leave them in the machine.",
        "Clear compensated_by_controller if the new table replaces those in the control.",
        '`compensated_by_controller = ["EXX"]`, and an export for the same control.',
    ),
)
