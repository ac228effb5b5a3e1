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
    "import": "Read the compensation table of a control as a calibration.",
    "export": "Write a calibration as the table of a control, and say what it would leave.",
    "formats": "List the tables of controls: sense, what each holds, how far verified.",
    "evaluate": "ISO 230-2 figures, cyclic errors, reversal and squareness of measured lines.",
    "ballbar": "Squareness, scale and servo mismatch, and lost motion from circles (ISO 230-4).",
    "diagonals": "Deviations along face and body diagonals (ISO 230-6), and what they tell.",
    "squareness": "Squareness in the senses of controls and instruments.",
    "postures": "Test A: errors of tool vectors from one point held in several postures.",
    "go-return": "Test B: lost motion of each axis from targets approached from both sides.",
    "thermal": "Identify how the structure distorts with temperatures, from logs of sensors and drift.",
}

_HELP = (
    """Makes the calibration of a machine from measurements, and reads and writes the tables of controls."""
)

command = LateGroup(
    VERBS, "olp.cli.calibrate_{}", name="calibrate", help=_HELP, subcommand_metavar="VERB ..."
)
