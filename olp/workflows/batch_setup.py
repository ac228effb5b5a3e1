"""The setup of programs of a batch as bytes, and the options of a call as plain data."""

from __future__ import annotations

import datetime
import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from olp.core.errors import InputError
from olp.errormodel.known import KnownErrors
from olp.files.config import have_joints
from olp.files.sources import Sources
from olp.files.write import read_bytes
from olp.workflows.batch_task import Config, Task
from olp.workflows.correct import CorrectOptions
from olp.workflows.session import Session

#: Bytes of files by their names in a parcel, None for those that are not there.
Files = Mapping[str, bytes | None]


def config_of(
    machine: str | None, job: str | None, dialect: str | None, known: KnownErrors | None = None
) -> Config:
    """The setup of machine and job with the files that it names; `known` are errors that are stated in place
    of both. Raises as `Session.start`."""
    sources = Sources()
    if known is None and have_joints(machine, job, sources.read):
        return held(Config(machine, job, dialect, sources.parcel(), sources.there(), "", joints=True))
    session = Session.start(machine if known is None else known, job, dialect=dialect, sources=sources)
    setup = session.setup
    for name in filter(None, (setup.machine.calibration, *_beside(session), setup.job.sensor_log)):
        try:
            sources.read(name)
        except InputError:
            # whoever needs it says so
            continue
    return held(Config(machine, job, dialect, sources.parcel(), sources.there(), "", known=known))


def held(config: Config) -> Config:
    """The setup with the digest of all that it holds."""
    digests = {name: digest(data) for name, data in config.files.items()}
    names = [config.machine, config.job, config.dialect, config.calibration, repr(config.known)]
    words = [*names, digests, sorted(config.there)]
    return replace(config, digest=hashlib.sha256(json.dumps(words, sort_keys=True).encode()).hexdigest())


def digest(data: bytes | None) -> str | None:
    """SHA-256 in hexadecimal digits; None of a file that is not there."""
    return None if data is None else hashlib.sha256(data).hexdigest()


def _beside(session: Session) -> list[str]:
    try:
        return session.beside_calibration()
    except InputError:
        return []


def with_file(task: Task, name: str) -> Task:
    """The task with a file that it asks for, or with the word that it is not there."""
    data = None
    if Path(name).is_file():
        try:
            data = read_bytes(name)
        except InputError:
            data = None
    return replace(task, files={**task.files, name: data})


def plain_options(options: CorrectOptions) -> dict[str, Any]:
    """Options as plain data."""
    values = {field.name: getattr(options, field.name) for field in fields(CorrectOptions)}
    date: datetime.date | None = values["date"]
    return values | {"date": None if date is None else date.isoformat(), "accept": list(options.accept)}


def options_from(values: Mapping[str, Any]) -> CorrectOptions:
    """The options that `plain_options` gave."""
    date = values["date"]
    own = {"date": None if date is None else datetime.date.fromisoformat(date)}
    return CorrectOptions(**{**values, **own, "accept": tuple(values["accept"])})
