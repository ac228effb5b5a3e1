"""Equation (1) of the paper (University of Huddersfield): chain FXYZ, first order, no tool vector.

    dX = EXX + EXY + EXZ + (EBX + EBY) z - ECX y + B0Z z - C0Y y
    dY = EYX + EYY + EYZ - (EAX + EAY) z         - A0Z z
    dZ = EZX + EZY + EZZ + EAX y

in ISO 230-1 names, right-handed; y and z count from where the curve was measured (default: the datum). In the
paper's names X_pitch = EBX, X_yaw = -ECX, X_roll = -EAX, Y_pitch = -EAY, Y_roll = EBY. Its squareness is
XY = -C0Y, XZ = B0Z, YZ = -A0Z. An importer converts these names; nothing here uses them.
"""

from __future__ import annotations

from olp.core.errors import ConfigError
from olp.errormodel.bodies import build_bodies
from olp.errormodel.calibration import Calibration
from olp.errormodel.chain import RigidBody

#: The chain of the paper.
CHAIN = "FXYZ"


def huddersfield(calibration: Calibration, chain: str, hold: bool, skip: frozenset[str]) -> RigidBody:
    """The general first-order law with all tool terms dropped is the equation above; raises ConfigError for
    another chain. ECY, EAZ, EBZ and ECZ turn the tool and move nothing."""
    if chain != CHAIN:
        raise ConfigError(f"model huddersfield with chain {chain}; expected {CHAIN}; use model rigid-body")
    bodies = build_bodies(calibration, chain, skip, tool_terms=False)
    return RigidBody(calibration.box_mm, hold, bodies, exact=False, tool_terms=False)
