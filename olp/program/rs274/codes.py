"""Which G codes change what: modal groups, frames, positions; ten times their number (G5.1 is 51).

The reader and the unroller use the same sets. The profile of a control says which of them it has or refuses.
"""

from __future__ import annotations

#: Canned cycles that nearly all controls have: G73, G74, G81 to G86, G89.
COMMON_CYCLES = frozenset({730, 740, 810, 820, 830, 840, 850, 860, 890})
#: G76, which leaves the bottom of a bore with its tip off the wall.
FINE_BORE = 760
#: Bores from below: G87, and G77 of Haas.
BACK_BORES = frozenset({770, 870})
#: Bores that the control leaves with an oriented spindle, shifted aside.
SHIFTED_BORES = frozenset({FINE_BORE, *BACK_BORES})
#: Canned cycles: those, G73, G74, G81 to G89.
CYCLES = COMMON_CYCLES | SHIFTED_BORES
#: Probing moves: G38.2 to G38.5.
PROBES = frozenset({382, 383, 384, 385})
#: Splines and NURBS: G5, G5.1, G5.2, G5.3.
SPLINES = frozenset({50, 51, 52, 53})
#: G70 and G71 of Haas: a canned cycle at places around a centre.
HOLE_CIRCLE = 700
HOLE_ARC = 710
HOLE_PATTERNS = frozenset({HOLE_CIRCLE, HOLE_ARC})
#: G33, a straight move in time with the spindle.
THREAD = 330
#: Motion that ends where its axis words say.
LINEAR = frozenset({0, 10, 20, 30, THREAD})
#: Cutter compensation: G41, G41.1, G42, G42.1.
CUTTER_COMPENSATION = frozenset({410, 411, 420, 421})
#: Cutter compensation to the left; the others are to the right.
COMPENSATION_LEFT = frozenset({410, 411})
#: Their D is the diameter of the cutter, not the number of a tool.
COMPENSATION_BY_DIAMETER = frozenset({411, 421})
COMPENSATION_OFF = 400

#: G20, lengths in inches.
INCH = 200
#: G21, lengths in mm.
METRIC = 210
#: G90, absolute positions.
ABSOLUTE = 900
#: G91, positions counted from the last one.
INCREMENTAL = 910
#: G93, feeds as the inverse of the time of a block.
INVERSE_TIME = 930
#: A cycle returns to the level before its series.
RETRACT_TO_INITIAL = 980
#: A cycle returns to its R.
RETRACT_TO_R = 990
#: G80, no motion, end of canned cycles.
END_OF_CYCLES = 800

#: Modal groups besides motion, by the field of `State` that holds their code. A control takes one code of a
#: group per block. The reader refuses two; the unroller takes the one that is last here.
GROUPS: dict[str, tuple[int, ...]] = {
    "plane": (170, 180, 190),
    "distance": (INCREMENTAL, ABSOLUTE),
    "arc_distance": (901, 911),
    "retract": (RETRACT_TO_INITIAL, RETRACT_TO_R),
    "feed_mode": (940, 950, INVERSE_TIME),
}
#: Plane code to index into `geometry.PLANES`.
PLANE_OF = {170: 0, 180: 1, 190: 2}
#: Units of length.
UNITS = (INCH, METRIC)
#: How the control moves from block to block: G61, G61.1, G64.
PATH_MODES = frozenset({610, 611, 640})

#: G16: X is a radius and Y an angle from here.
POLAR = 160
#: G15: to here.
POLAR_OFF = 150
#: G4, a dwell.
DWELL = 40
#: G65, a macro call.
MACRO = 650
MACROS = frozenset({MACRO, 660})
#: G10, which writes offsets.
WRITE_OFFSET = 100
#: G52, a local offset.
LOCAL_OFFSET = 520
#: G92, a preset position.
PRESET = 920
#: G53, a move in machine positions.
MACHINE = 530
#: G28, to the first reference position.
FIRST_HOME = 280
#: To the reference positions, through the point that the axis words state.
HOMES = frozenset({FIRST_HOME, 300})
#: G10 L2 and L20, G52, and the family of G92: they write offsets between axis and program positions.
SHIFTS = frozenset({LOCAL_OFFSET, PRESET, 921, 922, 923})
#: G68, a rotation of the program about Z.
ROTATION = 680
#: G51, a scaling of the program.
SCALING = 510
#: G51.1, a mirror image of the program.
MIRROR = 511
#: G68.2, a tilted plane, and G53.1, which brings the tool along its normal.
TILTED = 682
ALIGNED = 531
#: G69, G50 and G50.1 by what they end.
UNDOES = {690: ROTATION, 500: SCALING, 501: MIRROR}
#: The codes that end these.
UNDONE_BY = {code: end for end, code in UNDOES.items()}
#: Every code that changes how a program is turned, scaled or mirrored.
TRANSFORMS = frozenset({*UNDOES, *UNDOES.values()})
#: Their axis words are values, not motion: G10, G52, G92, G43.1, G50.1, G51, G51.1, G68 and G68.2. Beside
#: G92.1 to G92.3 they are motion.
AXIS_VALUES = frozenset({WRITE_OFFSET, LOCAL_OFFSET, PRESET, 431, 501, ROTATION, SCALING, MIRROR, TILTED})
#: G49, which ends a tool length.
LENGTH_OFF = 490
#: Tool lengths from the table of tools, and G43.1 and G43.2.
TABLE_LENGTHS = frozenset({430, 440, 490})
#: G43.1, a tool length from the words of the block.
LENGTH_FROM_WORDS = 431
#: Every code that sets a tool length.
LENGTHS = TABLE_LENGTHS | {LENGTH_FROM_WORDS, 432}
#: G54 to G59.3, and G54.1 P.
WORK_OFFSETS = frozenset({540, 541, *range(550, 600, 10), 591, 592, 593})
#: G154 P and G110 to G129.
FURTHER_OFFSETS = frozenset({1540, *range(1100, 1300, 10)})
#: M6, as ten times its number.
TOOL_CHANGE = 60
#: M61, as ten times its number.
SET_TOOL = 610
#: M codes that act after the motion of their block
M_ENDS = frozenset({0, 1, 2, 30, 60})
#: those that do so too on controls with exact stops
M_AFTER_EXACT = frozenset({5, 9})
