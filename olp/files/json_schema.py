"""JSON Schemas of the TOML files that you write, for editors that complete and check them."""

from __future__ import annotations

import json
from typing import Any, get_args

from olp.core.errors import UsageError
from olp.core.schema import Table, fields_of
from olp.files.described import DialectFile
from olp.files.json_types import table_schema
from olp.files.kinematics.calibration_schema import JointCalibrationFile
from olp.files.kinematics.plan_schema import JointPlanFile
from olp.files.kinematics.schema import JointMachineFile
from olp.files.measurements.artefact_file import ArtefactFile
from olp.files.measurements.schemas import MeasurementsFile
from olp.files.point_profile import PointProfile
from olp.files.schemas import FILES
from olp.files.stated_units import with_quantities

#: The model of each kind of file.
KINDS: dict[str, type[Table]] = {
    **FILES,
    "joint-machine": JointMachineFile,
    "joint-calibration": JointCalibrationFile,
    "joint-measurements": JointPlanFile,
    "measurements": MeasurementsFile,
    "artefact": ArtefactFile,
    "points": PointProfile,
    "dialect": DialectFile,
}
#: What the identifiers of schemas begin with. They are names, and no addresses: nothing is fetched.
PREFIX = "urn:olp-corrector:schema:"
#: The version of JSON Schema that is written.
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(kind: str) -> dict[str, Any]:
    """The JSON Schema of a kind of file, one of KINDS. Raises UsageError for any other kind."""
    if kind not in KINDS:
        raise UsageError(f'there is no schema "{kind}"; expected one of {", ".join(KINDS)}')
    schema = table_schema(KINDS[kind])
    return {
        "$schema": DIALECT,
        "$id": schema_id(kind),
        "title": f"olp {kind} file",
        **with_quantities(schema),
    }


def schema_id(kind: str) -> str:
    """The `$id` of the schema of a kind of file: a name, and no address that anything would be read from."""
    form = _format(KINDS[kind])
    return f"{PREFIX}{form}" if f"-{kind}-" in form else f"{PREFIX}{form}:{kind}"


def _format(model: type[Table]) -> str:
    """What the key schema of such a file says, such as "olp-machine-1"."""
    field = fields_of(model)["schema_"]
    return str(get_args(field.annotation)[0])


def json_schema_text(kind: str) -> str:
    """The schema as JSON text. Raises as `json_schema`."""
    return json.dumps(json_schema(kind), indent=2) + "\n"
