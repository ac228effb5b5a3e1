"""Writes the plan of a machine with rotary joints into a program, whatever its language."""

from __future__ import annotations

from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointPlan
from olp.compensation.joints.writer import JointWriter, WrittenJoints


def write_joints(path: JointPath, plan: JointPlan) -> WrittenJoints:
    """The text with its plan. Raises ProgramError where it cannot be written, NotInvertible."""
    if path.program.statements is None:
        return JointWriter(path, plan).written()
    if not path.program.in_blocks:
        from olp.compensation.joints.statements import StatementJoints

        return StatementJoints(path, plan).written()
    from olp.compensation.joints.conversational import ConversationalJoints

    return ConversationalJoints(path, plan).written()
