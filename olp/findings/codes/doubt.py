"""The rules of doubt: inputs that are not plausible. As an error a doubt stops a verb before it writes."""

from __future__ import annotations

from functools import partial

from olp.findings.rule import Rule, Severity

_rule = partial(Rule, topic="doubt", doubt=True)

RULES = (
    _rule(
        "OLP440",
        "calibration of zeros",
        Severity.ERROR,
        "Every value of the calibration is zero, so nothing would be corrected. That is what `olp init` "
        "writes before you put in what was measured.",
        "Put measured values into the files of the calibration, or name another calibration in the "
        "machine file.",
        "`olp init mill`, then `olp correct part.nc -m mill/machine.toml`.",
    ),
    _rule(
        "OLP441",
        "calibration without errors",
        Severity.WARNING,
        "The calibration has no table of errors, so nothing would be corrected.",
        "Add [[curves]] or other tables to the calibration file. Leave it so for a machine that is to "
        "have no errors.",
        "A calibration file that ends after box_mm.",
    ),
    _rule(
        "OLP442",
        "date of measuring not filled in",
        Severity.ERROR,
        "The date of measuring is the one that `olp init` writes, so the file was not completed.",
        "Write the day of the measurement into the key measured of the calibration file.",
        "`measured = 2000-01-01`.",
    ),
    _rule(
        "OLP443",
        "calibration does not fit its readings",
        Severity.ERROR,
        "The adjustment that made this calibration left residuals far beyond the stated noise. The "
        "probability of that by chance is below one in a million, and the noise would have to be twice as "
        "large. A reading, a sign, a unit or a frame is wrong.",
        "Look at the report of `olp calibrate fit`, remove what is wrong, and fit again. State larger "
        "uncertainties where the instrument has them.",
        "Points of a tracker in a left-handed frame: reduced chi-square of 2.5e7.",
    ),
    _rule(
        "OLP444",
        "quality of the calibration not stated",
        Severity.INFO,
        "The calibration has no table [quality], so how well it fits its readings is not judged.",
        "Make the calibration with `olp calibrate fit`, which writes the table. Nothing to do for a "
        "calibration from elsewhere.",
        "A calibration that was written by hand.",
    ),
    _rule(
        "OLP445",
        "error in the calibrated box not plausible",
        Severity.ERROR,
        "The error model gives an error somewhere in the calibrated box that is larger than such a "
        "machine has. A wrong sign, unit, lever arm or decimal point in the calibration does that.",
        "Look at the error with `olp inspect machine.toml --at` that position, or `--axes` those values. "
        "Raise largest_correction_um of [check] where the error is real.",
        "`C0Y_urad = 20100` where 20.1 was measured.",
    ),
    _rule(
        "OLP446",
        "angle not plausible",
        Severity.ERROR,
        "A squareness above 10 mrad or an angular error above 5 mrad shows to the naked eye, and so does one "
        "above 50 mrad on arms and platforms. Angles in other units give such numbers.",
        "Check unit and decimal point of this value. Angles are in urad: 1 arcsec is 4.848 urad.",
        "`C0Y_urad = 20100`.",
    ),
    _rule(
        "OLP447",
        "backlash not plausible",
        Severity.ERROR,
        "A backlash above 1 mm, or above 0.5 % of the travel, is felt by hand.",
        "Check unit and decimal point of this value. Backlash is in um.",
        "`X_um = 4000` under [backlash].",
    ),
    _rule(
        "OLP448",
        "cyclic error not plausible",
        Severity.ERROR,
        "The amplitude is larger than screws and scales have, the period is longer than the travel, or it "
        "is too short for such an amplitude.",
        "Check the units of amplitude and period. They are um or urad, and mm.",
        "`period_mm = 10000` for a screw of 10 mm pitch.",
    ),
    _rule(
        "OLP449",
        "value stands out of a curve",
        Severity.ERROR,
        "One value of a curve is many times all others of its column, or lies far off its neighbours. "
        "Machines have no such spikes; typing errors do.",
        "Compare this value with the record of the measurement. Measure more points around it where it is "
        "real.",
        "12.3, 12.9, 1340, 14.1 um in the column EXX_um.",
    ),
    _rule(
        "OLP450",
        "errors of one axis in another unit",
        Severity.ERROR,
        "The errors of one axis are hundreds of times smaller than those of both other axes, or one column "
        "than most others. Millimetres in a column of micrometres do that. Values within their own "
        "uncertainty in the covariance of a fit raise no doubt: no reading shows them.",
        "Check the unit of these values: lengths are in um, angles in urad.",
        "0.012 in the column EXX_um, and 9.7 in EYY_um.",
    ),
    _rule(
        "OLP451",
        "errors smaller than any instrument measures",
        Severity.ERROR,
        "The largest error anywhere in the calibrated box is below 0.1 um per metre. Millimetres or "
        "metres in columns of micrometres do that.",
        "Check the units of the columns of the calibration.",
        "0.012, 0.015 ... in the columns of all curves.",
    ),
    _rule(
        "OLP452",
        "calibrated box does not fit the travel",
        Severity.ERROR,
        "The calibrated box reaches beyond the travel of this machine, or is smaller or larger by the "
        "factor of a unit. The calibration is of another machine, or one of the two is not in mm.",
        "Check box_mm of the calibration and travel_mm of the machine file.",
        "`box_mm` of X up to 31.5 and a travel of 800 mm: inches.",
    ),
    _rule(
        "OLP453",
        "positions of the calibration far from the machine",
        Severity.ERROR,
        "The positions of a curve, the line on which it was measured, or the datum lie far outside the "
        "travel. The unit or the zero of the axes is wrong.",
        "Check the positions in the file of the curve, line_mm and datum_mm. They are axis positions in mm.",
        "`datum_mm = [5000.0, 0.0, 0.0]` on a travel of 800 mm.",
    ),
    _rule(
        "OLP454",
        "tool length not plausible",
        Severity.ERROR,
        "A tool vector is shorter than 1 mm, much longer than the travel of Z, or the tool of the "
        "calibration in inches. Angular errors act over its length.",
        "Check Z_mm and gauge_to_tip_mm of this tool. Both are in mm.",
        "`Z_mm = 0.12` for a tool of 120 mm.",
    ),
    _rule(
        "OLP455",
        "tool far from all of the calibration",
        Severity.ERROR,
        "The tip is many times farther from those of the calibration than tool_within_mm of [check] "
        "allows. Angular errors act over the difference.",
        "Check the tool table, and tool_mm of the calibration. Raise tool_within_mm where such tools are "
        "meant.",
        "A tool vector of 1200 mm, and curves that were measured with 120 mm.",
    ),
    _rule(
        "OLP456",
        "work offset or start outside the travel",
        Severity.ERROR,
        "The origin of the program or the start position lies so far outside the travel that no tool "
        "reaches it.",
        "Check the unit and sign of this value. Both are axis positions in mm.",
        "`X_mm = 6350` on a travel of 800 mm: 250 mm in thousandths of an inch.",
    ),
    _rule(
        "OLP457",
        "temperature not plausible",
        Severity.ERROR,
        "No workshop has this temperature. Degrees Fahrenheit and kelvins give such numbers.",
        "State the temperature in degC: 68 degF and 293 K are 20 degC.",
        "`X_scale = 68.0` under [temperatures_degC].",
    ),
    _rule(
        "OLP458",
        "coefficient of expansion not plausible",
        Severity.ERROR,
        "No material of scales or workpieces expands by this much. The unit is um per metre and kelvin.",
        "Check the unit and decimal point. Steel has 11.5, aluminium 23, glass 8. State 0 where nothing "
        "expands.",
        "`X_scale_um_m_K = 0.0115`, which is mm per metre and kelvin.",
    ),
    _rule(
        "OLP459",
        "payload not plausible",
        Severity.ERROR,
        "No machine of this kind carries so much. Payloads in grams give such numbers.",
        "State the payload in kg.",
        "`payload_kg = 30000` for a workpiece of 30 kg.",
    ),
    _rule(
        "OLP460",
        "calibration measured after the run",
        Severity.ERROR,
        "The day of the run is before the day on which the calibration was measured. One of the two dates "
        "is wrong.",
        "Check --date, and the key measured of the calibration file.",
        "`--date 2025-11-21`, and `measured = 2026-05-14`.",
    ),
    _rule(
        "OLP461",
        "no number has a decimal point",
        Severity.ERROR,
        "On this control a length without a decimal point counts least increments, or whole units, as it "
        "is set. No length of the program has a point, and the machine file does not say which. The two "
        "differ by a factor of 1000.",
        'Write the points into the program, such as X100., or state decimal_point = "increment" or '
        '"calculator" in the machine file, which olp init writes. Where the finding is accepted, X100 counts '
        "as 100 least increments.",
        "`G1 X100 Y200` alone on a Fanuc control.",
    ),
    _rule(
        "OLP462",
        "validity of the calibration not stated",
        Severity.INFO,
        "The calibration states no last day, so no date can be later.",
        "Write valid_until into the calibration file.",
        "A calibration file without `valid_until`.",
    ),
    _rule(
        "OLP463",
        "calibration measured long ago",
        Severity.WARNING,
        "The calibration states no last day, and on the date given it is older than calibration_days of "
        "[check] (365). Machines change.",
        "Check the machine with a circle or some points, and write valid_until into the calibration file. "
        "Else measure it again.",
        "`--date 2027-06-01`, and `measured = 2026-05-14`.",
    ),
    _rule(
        "OLP464",
        "column not set to zero",
        Severity.ERROR,
        "All values of a column are almost the same, and larger than any machine is wrong by. The instrument "
        "was not set to zero, or the values are readings and no errors.",
        "Subtract the reading at the datum from the column.",
        "1000.2, 1003.1, 999.8 ... um in the column EXX_um.",
    ),
    _rule(
        "OLP465",
        "limit of an axis not plausible",
        Severity.ERROR,
        "The least increment is above 0.1 mm, or the axis is faster than any or would take 20 minutes for "
        "its travel. Values in um, in mm/min or in m/s do that.",
        "Check least_increment_mm and velocity_mm_s of this axis in the machine file.",
        "`least_increment_mm = 1.0`, and `velocity_mm_s = 30000`.",
    ),
    _rule(
        "OLP466",
        "curve of zeros",
        Severity.WARNING,
        "Every value of a curve is zero, and other parts of the calibration are not. That is what `olp init` "
        "writes before you put in what was measured.",
        "Put measured values into the file, or remove this curve from the calibration.",
        "z.csv as `olp init` wrote it, beside x.csv and y.csv that were measured.",
    ),
    _rule(
        "OLP470",
        "stated without files",
        Severity.INFO,
        "The errors are stated in the call, and no machine file says the rest. This is what is taken for it.",
        "Compare it with your machine. Where it is otherwise, write the files with `olp init`.",
        "`olp correct part.nc --skew XY=1.414mm/m`.",
    ),
    _rule(
        "OLP471",
        "lengths of tools not known",
        Severity.ERROR,
        "The error depends on the position of Z, which depends on the length of the tool, and the program "
        "uses several tools. With one tool the length cancels out, as only distances count.",
        "Give the lengths in the tool table of a machine file; `olp init` writes one.",
        "`--skew XZ=1mm/m` for a program with two tools.",
    ),
)
