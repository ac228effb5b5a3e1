"""`olp calibrate`: from measurements to the calibration that corrects programs, and tables of controls."""

from __future__ import annotations

from olp.cli.late import LateGroup

#: Verb to what it does; each is a module `olp.cli.calibrate_VERB`.
VERBS: dict[str, str] = {
    "fit": "Make a calibration from lines, points, lengths and directions.",
    "doctor": "Check sign, unit and column of every curve of a calibration with independent points.",
    "compare-methods": "Judge equation (1), a map of two pods and the adjustment on your own readings.",
    "plan": "Propose what to measure for a wanted uncertainty, and write the programs for it.",
    "probe": "Touch an artefact with the machine's own probe: write the programs, read the touches.",
    "refine": "Update a calibration within its covariance by a measured run.",
    "read": "Show what the program reads in the file of an instrument.",
    "import": "Read the compensation table of a control as a calibration.",
    "export": "Write a calibration as the table of a control, and show the residual error.",
    "formats": "List the tables of controls: sign convention, what each holds, how far verified.",
    "evaluate": "ISO 230-2 figures, cyclic errors, reversal and squareness of measured lines.",
    "ballbar": "Squareness, scale and servo mismatch, and backlash from circles (ISO 230-4).",
    "diagonals": "Deviations along face and body diagonals (ISO 230-6); squareness and scales from them.",
    "squareness": "Squareness in the sign conventions of controls and instruments.",
    "postures": "Test A: errors of tool vectors from one point held in several postures.",
    "go-return": "Test B: backlash of each axis from targets approached from both sides.",
    "thermal": "Identify how the structure distorts with temperature, from logs of sensors and drift.",
}

_HELP = "Makes the calibration of a machine from measurements, and reads and writes the tables of controls."

command = LateGroup(
    VERBS, "olp.cli.calibrate_{}", name="calibrate", help=_HELP, subcommand_metavar="VERB ..."
)
