"""`olp calibrate`: from measurements to the calibration that corrects programs, and tables of controls."""

from __future__ import annotations

from olp.cli.late import LateGroup

#: Verb to what it does; each is a module `olp.cli.calibrate_VERB`.
VERBS: dict[str, str] = {
    "fit": "Make a calibration from lines, points, lengths and directions.",
    "doctor": "Judge sign, unit and place of every curve of a calibration by independent points.",
    "plan": "Propose what to measure for a wanted uncertainty, with programs that go there.",
    "refine": "Update a calibration within its covariance by a measured run.",
    "read": "Show what is understood of the file of an instrument.",
}

_HELP = (
    """Makes the calibration of a machine from measurements, and reads and writes the tables of controls."""
)

command = LateGroup(
    VERBS, "olp.cli.calibrate_{}", name="calibrate", help=_HELP, subcommand_metavar="VERB ..."
)
