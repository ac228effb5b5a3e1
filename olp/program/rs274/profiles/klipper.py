"""Klipper.

Differs from Marlin: names are commands, and those that Klipper does not have itself are macros of the
machine. G91 makes the extruder relative, and G90 gives it back to M82 or M83. Arcs need I and J in XY: R is
refused by the firmware, and its G18 turns the other way than that of RS-274.
"""

from __future__ import annotations

from dataclasses import replace

from olp.program.rs274.commands import Commands
from olp.program.rs274.profiles.base import Act
from olp.program.rs274.profiles.printer import PRINTER, PRINTER_CODES, TEXTS
from olp.program.text import signs

#: Commands of Klipper that move no axis and change no mode and no zero.
_STILL = frozenset(
    b"""ACTIVATE_EXTRUDER_STEPPER BED_MESH_CLEAR BED_MESH_MAP BED_MESH_OUTPUT BED_MESH_PROFILE CLEAR_PAUSE
    DISABLE_FILAMENT_WIDTH_LOG DISABLE_FILAMENT_WIDTH_SENSOR ENABLE_FILAMENT_WIDTH_LOG
    ENABLE_FILAMENT_WIDTH_SENSOR EXCLUDE_OBJECT EXCLUDE_OBJECT_DEFINE EXCLUDE_OBJECT_END
    EXCLUDE_OBJECT_START GET_POSITION GET_RETRACTION QUERY_ADC QUERY_ENDSTOPS QUERY_FILAMENT_SENSOR
    QUERY_FILAMENT_WIDTH QUERY_RAW_FILAMENT_WIDTH RESET_FILAMENT_WIDTH_SENSOR RESPOND SAVE_GCODE_STATE
    SAVE_VARIABLE SDCARD_RESET_FILE SET_DISPLAY_GROUP SET_DISPLAY_TEXT SET_EXTRUDER_ROTATION_DISTANCE
    SET_FAN_SPEED SET_FILAMENT_SENSOR SET_GCODE_VARIABLE SET_HEATER_TEMPERATURE SET_IDLE_TIMEOUT
    SET_INPUT_SHAPER SET_LED SET_LED_TEMPLATE SET_PIN SET_PRESSURE_ADVANCE SET_PRINT_STATS_INFO
    SET_RETRACTION SET_SERVO SET_TEMPERATURE_FAN_TARGET SET_TMC_CURRENT SET_TMC_FIELD SET_VELOCITY_LIMIT
    STATUS SYNC_EXTRUDER_MOTION TEMPERATURE_WAIT TURN_OFF_HEATERS UPDATE_DELAYED_GCODE""".split()
)
_ZERO = "moves the zero of the axes; set the offset before the print, and state it in the job"
_SKEW = (
    "changes how the control corrects squareness; load it in a macro before measuring, and list it in "
    "compensated_by_controller"
)

DIALECT = replace(
    PRINTER,
    name="klipper",
    title="Klipper",
    codes={**PRINTER_CODES, 180: Act.REFUSE, 190: Act.REFUSE},
    commands=Commands(
        text=TEXTS,
        named=True,
        zeros={b"SET_GCODE_OFFSET": _ZERO},
        still=_STILL,
        refused={
            b"SET_KINEMATIC_POSITION": _ZERO,
            b"SET_Z_THERMAL_ADJUST": "moves Z with the temperature; switch it off in the configuration",
            b"FORCE_MOVE": "moves one stepper by itself; take it out of the program",
            b"SKEW_PROFILE": _SKEW,
            b"SET_SKEW": _SKEW,
            b"RESTORE_GCODE_STATE": (
                "restores modes and zero of another place; write G90 or G91 and M82 or M83 instead"
            ),
            b"SET_DUAL_CARRIAGE": "changes which carriage the axis words move; post a program for each",
            b"TUNING_TOWER": "changes a parameter with Z while the program runs; print it uncorrected",
        },
        extruder_follows=False,
        arc_words="IJ",
    ),
    signs=signs.KLIPPER,
    path_mode="junctions of the firmware: square_corner_velocity",
)
