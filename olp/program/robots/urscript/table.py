"""What becomes of the functions and statements of URScript, by their names."""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.dialect import Support

_C = Support.CORRECTED
_R = Support.READ
_X = Support.UNCHANGED
_NO = Support.REFUSED

_SPEEDS = "moves by speeds or by what a sensor says"
_BY_HAND = "the robot is led by hand: the next move is corrected at its end"
_SENSED = "changes the path while the robot moves; take it into a program of its own"

#: Moves that are left as written.
LEFT: Mapping[bytes, str] = {
    **dict.fromkeys((b"speedl", b"speedj", b"servoj", b"servoc", b"servol"), _SPEEDS),
    **dict.fromkeys((b"optimovel", b"optimovej"), "is not read; post movel or movej"),
}

TABLE: Mapping[bytes, tuple[Support, str]] = {
    b"movel": (_C, "a straight move to p[...], a name of one, or pose_trans of two"),
    b"movep": (_C, "as movel"),
    b"movec": (_C, "an arc through a pose to another one; several arcs where one would bend"),
    b"movej": (_C, "corrected at its end. Where the machine is no arm, joints of moves are kept as written"),
    b"get_inverse_kin": (_C, "in a movej: its pose, reached near the joints that it states"),
    b"p[...]": (_C, "changed where moves use it, and cloned where they differ"),
    b"pose_trans": (_R, "of a frame with numbers and a target: the target is corrected"),
    b"pose_add": (_R, "in a move, of a target and a pose that does not turn: the target is corrected"),
    b"set_tcp": (_R, "the tool from here on; moves whose tool depends on the run are left as written"),
    b"def, thread": (_R, "where its first move comes from is not known: it is corrected at its end"),
    b"if, while, for": (_R, "behind moves that may not run, the next one is corrected at its end"),
    b"a call": (_R, "may move, where nothing shows that it does not: the next move is corrected at its end"),
    **{word: (_R, f"left as written, as it {why}") for word, why in LEFT.items()},
    b"force_mode": (_R, "targets behind it are corrected; forces lead the robot along some axes"),
    **dict.fromkeys((b"teach_mode", b"freedrive_mode"), (_R, _BY_HAND)),
    **dict.fromkeys(
        (b"path_offset_enable", b"path_offset_set", b"conveyor_tracking",
         b"track_conveyor_linear", b"track_conveyor_circular"),
        (_NO, _SENSED),
    ),
    **dict.fromkeys(
        (b"sleep", b"sync", b"textmsg", b"popup", b"halt", b"set_digital_out", b"set_standard_digital_out",
         b"set_configurable_digital_out", b"set_tool_digital_out", b"set_analog_out", b"set_payload",
         b"set_payload_mass", b"set_payload_cog", b"set_target_payload", b"set_gravity", b"set_tool_voltage",
         b"set_standard_analog_out", b"set_flag", b"write_output_boolean_register", b"stopl", b"stopj",
         b"write_output_integer_register", b"write_output_float_register", b"socket_open", b"socket_close",
         b"socket_send_string", b"socket_send_line", b"socket_send_byte", b"socket_send_int",
         b"enter_critical",
         b"exit_critical", b"return", b"break", b"continue", b"end_force_mode", b"end_teach_mode",
         b"end_freedrive_mode", b"set_standard_analog_input_domain", b"set_tool_analog_input_domain",
         b"set_analog_outputdomain", b"set_input_actions_to_default", b"set_safety_mode_transition_hardness",
         b"set_tool_communication", b"set_tool_output_mode", b"set_tool_digital_output_mode",
         b"modbus_add_signal", b"modbus_set_signal_update_frequency", b"modbus_set_runstate_dependent_choice",
         b"set_runstate_tool_digital_output_to_value", b"set_runstate_standard_digital_output_to_value",
         b"modbus_set_output_signal", b"modbus_set_output_register", b"zero_ftsensor", b"pass"),
        (_X, ""),
    ),
}  # fmt: skip
