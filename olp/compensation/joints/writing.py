"""Writes the plan of a machine with rotary joints into a program, whatever its language."""

from __future__ import annotations

from olp.compensation.joints.arm_path import ArmPath
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointLimits, JointPlan, planned
from olp.compensation.joints.rounded_play import with_rounded
from olp.compensation.joints.writer import JointWriter, WrittenJoints


def planned_words(path: JointPath, limits: JointLimits) -> JointPlan:
    """The plan of a path, for the words that it is written in. Raises as `planned`, and as `write_joints`."""
    plan = planned(path, limits)
    alone = path.listed is not None or isinstance(path, ArmPath) or path.coordinates.poses
    if alone or not path.motion.width[~path.coordinates.rotary].any():
        return plan
    return with_rounded(path, plan, limits, _writer(path, plan).rotary_words())


def write_joints(path: JointPath, plan: JointPlan) -> WrittenJoints:
    """The text with its plan. Raises ProgramError where it cannot be written, NotInvertible."""
    return _writer(path, plan).written()


def _writer(path: JointPath, plan: JointPlan) -> JointWriter:
    if path.program.statements is None:
        return JointWriter(path, plan)
    if not path.program.in_blocks:
        from olp.compensation.joints.statements import StatementJoints

        return StatementJoints(path, plan)
    from olp.compensation.joints.conversational import ConversationalJoints

    return ConversationalJoints(path, plan)
