"""Releases of a batch: what is marked released, and what a new calibration changes about it."""

from __future__ import annotations

import datetime
import hashlib
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from olp.core.errors import CannotCompute, InputError, UsageError
from olp.core.progress import Progress, silent
from olp.core.values import dataclass
from olp.files.calibration.reader import files_beside
from olp.files.config import have_joints
from olp.files.folders import digest_of
from olp.files.history import History, Record, ReleaseLine, writing
from olp.files.releases import Release, check_name, packed, read_release
from olp.files.sources import Parcel, Sources, in_parcel
from olp.files.write import make_folder, read_bytes, write_files
from olp.workflows.batch_pool import Opener, Pool
from olp.workflows.batch_setup import Files, held, options_from
from olp.workflows.batch_task import Config, Outcome, Task
from olp.workflows.session import PathLike


def release(
    output: PathLike, name: str, date: datetime.date | None = None, *, keep_going: bool = False
) -> dict[str, Any]:
    """Mark the corrected programs of an output folder as released: append that to its history, and keep them
    with all that they were made from in an archive beside it.

    A program is released where it is good, as it was written, and its inputs are what they were then. Where
    one is not, nothing is released, unless you `keep_going`: then it is left out. Gives the report
    ("olp-release-report-1"). Raises UsageError for a name that is none, or is taken; InputError where there
    is no history.
    """
    check_name(name)
    with writing(output):
        return _marked(_history(output), name, date, keep_going=keep_going)


def _marked(history: History, name: str, date: datetime.date | None, *, keep_going: bool) -> dict[str, Any]:
    # names differ by their case on some systems only
    if name.casefold() in map(str.casefold, history.releases):
        raise UsageError(f"--release {name}: there is such a release already; take another name")
    ready: dict[str, Record] = {}
    left: list[dict[str, str]] = []
    for path, record in sorted(history.last.items()):
        if history.gone(record):
            continue
        why = _why_not(history, record)
        if why:
            left.append({"program": path, "why": why})
        else:
            ready[path] = record
    done = bool(ready) and (keep_going or not left)
    archive = history.archive(name)
    if done:
        day = None if date is None else date.isoformat()
        data = packed(_release(history, name, day, ready))
        corrected = {path: record.outputs[path] for path, record in ready.items()}
        if digest_of(archive) not in (None, hashlib.sha256(data).hexdigest()):
            raise UsageError("is of another history; move it, or take another name", file=str(archive))
        make_folder(archive.parent)
        # first the archive: without its line it is no release, and is written again
        write_files({archive: data}, force=True)
        history.add_release(ReleaseLine(name, day, hashlib.sha256(data).hexdigest(), corrected))
    return {
        "schema": "olp-release-report-1",
        "release": name,
        "date": date,
        "archive": archive.as_posix() if done else None,
        "released": sorted(ready) if done else [],
        "left_out": left,
        "exit_code": 0 if done and not left else 1,
    }


def what_if(
    output: PathLike, calibration: PathLike, opener: Opener, *, part_tolerance_um: float | None = None,
    date: datetime.date | None = None, progress: Progress | None = None,
) -> dict[str, Any]:  # fmt: skip
    """What a new calibration says about the programs of an output folder that are released: the deviation of
    each, unchanged, on the machine with its errors of now. Of several releases of a program the last one
    counts. Nothing is written.

    `part_tolerance_um` and `date` are taken instead of those that the program was corrected with. Gives the
    report ("olp-what-if-1"), the worst programs first. Raises InputError where there is no history or nothing
    is released.
    """
    tell = progress or silent
    history = _history(output)
    files, machine = _calibration(calibration)
    cases = list(_released(history))
    if not cases:
        raise InputError(
            "nothing is released; mark what is written with --release NAME", file=str(history.path)
        )
    tried = [case for case in cases if case.record["row"].get("machine") in (machine, None)]
    others = [case.path for case in cases if case not in tried]
    options = {"part_tolerance_um": part_tolerance_um, "date": date}
    changes = {key: value for key, value in options.items() if value is not None}
    tasks = [_task(history, case, str(calibration), files, changes) for case in tried]
    rows = []
    pool: Pool | None = opener(len(tasks)) if tasks else None
    try:
        for number, outcome in _done(pool, tasks) if pool is not None else ():
            rows.append(_row(tried[number], outcome))
            tell(f"{len(rows)} of {len(tasks)}: {tried[number].path}", len(rows) / len(tasks))
    finally:
        if pool is not None:
            pool.close()
    outside = [row for row in rows if row["outside"]]
    codes = [row.get("exit_code", 0) for row in rows]
    return {
        "schema": "olp-what-if-1",
        "output": Path(output).as_posix(),
        "calibration": {"file": Path(calibration).as_posix(), "machine": machine,
                        "sha256": hashlib.sha256(read_bytes(calibration)).hexdigest()},
        "date": date,
        "programs": sorted(rows, key=_rank),
        "other_machines": sorted(others),
        "outside": len(outside),
        "exit_code": max([1 if outside or not rows else 0, *codes]),
    }  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Case:
    """A released program: its path, the name of its release, its line of the history and its text. `inputs`
    are the files that it was made from, by digest."""

    path: str
    release: str
    record: Mapping[str, Any]
    text: bytes
    inputs: Mapping[str, bytes]


def _history(output: PathLike) -> History:
    history = History(output)
    if not history.last:
        raise InputError(
            "there is no history of this folder; name the folder that olp batch wrote with -o",
            file=str(history.path),
        )
    return history


def _why_not(history: History, record: Record) -> str:
    """Why a program cannot be released, in words; "" where it can."""
    if record.output not in record.outputs:
        return "it is refused: olp batch says why"
    if record.row.get("ok") is not True or any(f["severity"] == "error" for f in record.row["findings"]):
        return "it is not good: olp batch and its report say why"
    if not history.unchanged(record):
        return "its file is missing, or was changed since it was written; call olp batch again"
    if not history.place(record.setup["program"]).is_file():
        return "its program is gone; remove it from the output folder, too"
    if any(digest_of(history.place(name)) != own for name, own in record.inputs.items()):
        return "its inputs have changed since it was written; call olp batch again"
    return ""


def _release(history: History, name: str, day: str | None, ready: Mapping[str, Record]) -> Release:
    digests = {own: file for record in ready.values() for file, own in record.inputs.items() if own}
    return Release(
        name, day,
        {
            path: {"setup": dict(one.setup), "inputs": dict(one.inputs), "row": dict(one.row)}
            for path, one in ready.items()
        },
        {path: read_bytes(history.folder / path) for path in ready},
        {own: read_bytes(history.place(file)) for own, file in digests.items()},
    )  # fmt: skip


def _released(history: History) -> Iterator[_Case]:
    """The released programs, each as in its last release. Raises InputError where an archive has changed."""
    last = {path: line.name for line in history.releases.values() for path in line.programs}
    for line in history.releases.values():
        paths = [path for path, name in last.items() if name == line.name]
        if not paths:
            continue
        archive = history.archive(line.name)
        if archive.is_file() and digest_of(archive) != line.sha256:
            raise InputError("was changed since the release; restore the file", file=str(archive))
        kept = read_release(archive)
        for path in sorted(paths):
            yield _Case(path, line.name, kept.programs[path], kept.corrected[path], kept.inputs)


def _calibration(path: PathLike) -> tuple[Files, str]:
    """A calibration file and the files that it names, under the names of a parcel, and its machine."""
    sources = Sources()
    data = sources.read(path)
    try:
        machine = tomllib.loads(data.decode("utf-8-sig"))["machine"]
    except (ValueError, KeyError):
        raise InputError(
            "is no calibration file; expected the keys schema and machine", file=str(path)
        ) from None
    for file in files_beside(path, sources.read):
        sources.read(file)
    return sources.parcel(), str(machine)


def _task(
    history: History, case: _Case, calibration: str, files: Files, changes: Mapping[str, Any]
) -> tuple[Config, Task]:
    """The released program with what it was made from, and the new calibration."""
    inputs = {
        in_parcel(history.place(name)): None if own is None else case.inputs[own]
        for name, own in case.record["inputs"].items()
    }
    setup = case.record["setup"]
    program = in_parcel(history.place(setup["program"]))
    corrected = in_parcel(history.folder / case.path)
    machine, job = (setup[key] and str(history.place(setup[key])) for key in ("machine", "job"))
    common = {name: data for name, data in inputs.items() if name != program}
    # meshes are not kept, and no verification reads one
    meshes, given = _meshes(common), {**common, **files}
    joints = have_joints(machine, job, Parcel(given, meshes).read)
    config = held(Config(machine, job, setup["dialect"], given, meshes, "", calibration, joints=joints))
    own = {program: inputs[program], corrected: case.text}
    options = replace(options_from(setup["options"]), **changes)
    return config, Task(program, own, options, Path(case.path).name, released=corrected)


def _meshes(files: Files) -> frozenset[str]:
    """The names of meshes that job files among the files name."""
    names = set()
    for name, data in files.items():
        if data is None or not name.endswith(".toml"):
            continue
        try:
            meshes = tomllib.loads(data.decode("utf-8-sig")).get("meshes", [])
            names |= {in_parcel(Path(name).parent / mesh["file"]) for mesh in meshes}
        except (ValueError, TypeError, KeyError, AttributeError):
            continue
    return frozenset(names)


def _done(pool: Pool, tasks: list[tuple[Config, Task]]) -> Iterator[tuple[int, Outcome]]:
    begun = under_way = 0
    while begun < len(tasks) or under_way:
        while begun < len(tasks) and under_way < pool.capacity:
            pool.submit(begun, *tasks[begun])
            begun, under_way = begun + 1, under_way + 1
        number, outcome = pool.result()
        under_way -= 1
        if outcome.wanted is not None:
            raise CannotCompute(f"{outcome.wanted}: is no part of the release; restore its archive")
        yield number, outcome


def _row(case: _Case, outcome: Outcome) -> dict[str, Any]:
    """What a calibration says of a released program, beside what that of its release said."""
    row = dict(outcome.row or {})
    then = case.record["row"]
    part = row.get("part_tolerance_um")
    allowed, largest = part if part is not None else row.get("allowed_um"), row.get("corrected_um")
    inside = row.get("holds") if part is None else row.get("part_ok")
    beyond = None if largest is None or allowed is None else max(largest - allowed, 0.0)
    return {
        "program": case.path,
        "release": case.release,
        "machine": then.get("machine"),
        "moves": row.get("moves"),
        "released_um": then["corrected_um"],
        "largest_um": largest,
        "tolerance_um": allowed,
        "of_part": part is not None,
        "beyond_um": beyond,
        "outside": inside is not True,
        "findings": row.get("findings", []),
    } | ({"message": row["message"], "exit_code": row["exit_code"]} if "message" in row else {})


def _rank(row: Mapping[str, Any]) -> tuple[Any, ...]:
    share = row["largest_um"] / row["tolerance_um"] if row["largest_um"] and row["tolerance_um"] else 0.0
    return "message" not in row, -share, row["program"]
