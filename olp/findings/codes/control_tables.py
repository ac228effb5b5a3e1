"""The rules of tables of controls: what they cannot hold, and what you have to state or check."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="control_tables", gate=False)

RULES = (
    _rule(
        "OLP871",
        "table cannot hold all errors",
        Severity.WARNING,
        "The format of this control has no entry for these errors, so its table leaves them uncorrected. "
        "The predicted residual says how large they are.",
        "Choose a format that holds them, or leave the table out and correct the programs.",
        "Pitch and yaw, exported to LinuxCNC, which corrects one axis by its own position.",
    ),
    _rule(
        "OLP872",
        "part of a table left out",
        Severity.WARNING,
        "The file holds entries that a calibration of three linear axes cannot hold. The rest was read.",
        "Check that the errors left out are zero or corrected elsewhere.",
        "The section `[C0B]`, for a rotary axis, in an Etalon exchange file.",
    ),
    _rule(
        "OLP873",
        "table coarser than the curve",
        Severity.INFO,
        "The control interpolates linearly between the rows of its table, and the number of rows is "
        "limited. The table departs from the measured curve between them.",
        "Give the control more rows where it can take them, or correct the programs.",
        "A curve with 400 positions in a table of 256 rows.",
    ),
    _rule(
        "OLP874",
        "sign convention of a table not verified",
        Severity.WARNING,
        "No public source says whether this control adds the values of its table or subtracts them. The "
        "file follows the sign convention that you stated. The wrong one doubles every error.",
        "Run the verification program beside the table, with a laser or a dial gauge, before any part.",
        "`olp calibrate export --format siemens-cec --sense correction`.",
    ),
    _rule(
        "OLP875",
        "backlash in the table",
        Severity.WARNING,
        "The table compensates the backlash of an axis. `compensated_by_controller` has no name for it, so "
        "a corrected program would compensate it a second time.",
        "While the table is active, leave the axis out of [backlash] in the calibration that corrects "
        "programs.",
        "`[backlash] X_um = 4.0` in a table with forward and reverse columns.",
    ),
    _rule(
        "OLP876",
        "corrected by the control already",
        Severity.INFO,
        "`compensated_by_controller` says that tables in the control correct these errors now, so the new "
        "table leaves them out. If it replaced the old tables, these errors would stay uncorrected.",
        "Clear compensated_by_controller if the new table replaces those in the control.",
        '`compensated_by_controller = ["EXX"]`, and an export for the same control.',
    ),
)
