"""The tables by which controls know where the axes of a machine lie, by name."""

from __future__ import annotations

from importlib import import_module

from olp.files.kinematics.control_kinematics import KinematicTable

#: The modules of this package that hold TABLES, in the order in which formats are listed.
MODULES = (
    "siemens_vectors",
    "heidenhain_chain",
    "fanuc_vectors",
    "isg_chain",
    "dh_rows",
    "mastering",
)


def _tables(module: str) -> tuple[KinematicTable, ...]:
    tables: tuple[KinematicTable, ...] = import_module(f"olp.files.kinematics.{module}").TABLES
    return tables


#: The formats by name.
TABLES: dict[str, KinematicTable] = {table.key: table for module in MODULES for table in _tables(module)}
