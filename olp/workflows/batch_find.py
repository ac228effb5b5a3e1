"""What a batch is about: the programs of folders, each with its machine, its job and its output."""

from __future__ import annotations

import fnmatch
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path, PurePath

from olp.compensation.stamp import find_stamp
from olp.core.errors import InputError, UsageError
from olp.core.projects import files_of, is_one_of_many
from olp.core.values import dataclass
from olp.errormodel.known import KnownErrors
from olp.files.config import beside
from olp.files.folders import files_below, from_root, identity, inside
from olp.files.sources import Sources
from olp.files.toml_text import read_toml
from olp.files.write import is_page, read_bytes
from olp.program.registry import ending_of, folder_endings
from olp.workflows.session import PathLike

#: The schema of a job file, as its text holds it.
_JOB = b"olp-job-1"
#: Between name and ending of what `olp correct` writes by itself.
_CORRECTED = ".corrected"


@dataclass(frozen=True, slots=True)
class Case:
    """A program of a batch. `machine` and `job` are paths; `machine` is None where the job names it.
    `output` is the path of its correction below the output folder, with `/`. `problem` says why it cannot be
    begun."""

    program: str
    machine: str | None
    job: str | None
    output: str
    problem: str = ""


@dataclass(frozen=True, slots=True)
class Skipped:
    """A file that looks like a program and is left out, and why."""

    file: str
    why: str


@dataclass(frozen=True, slots=True)
class Found:
    """What there is in the folders of a batch, in the order of outputs. `looked` are all files there."""

    cases: tuple[Case, ...]
    skipped: tuple[Skipped, ...]
    looked: tuple[Path, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """Where a batch looks, and where it writes. `folders` may be single files, too. `machine` is that of
    programs whose job names none, `job` the job of programs that no job file names. `known` are errors that
    the call states in place of both. `include` are patterns of
    names, such as `O*`, of programs with another ending; `exclude` those of files to leave out. Folders
    without any program are refused, unless they `may_be_empty`."""

    folders: tuple[str, ...]
    output: str
    machine: str | None = None
    job: str | None = None
    known: KnownErrors | None = None
    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    may_be_empty: bool = False


def find(where: Where) -> Found:
    """The programs of the folders. Raises UsageError where folders and output are in each other's way, and
    InputError where there is no such folder."""
    _refuse(where)
    roots = _roots(where)
    files = [(root, file) for root in roots for file in root.files]
    jobs = [job for root, file in files if ending_of(file.name) == "toml" for job in _jobs(root, file, where)]
    named = {identity(case.program) for case in jobs if isinstance(case, Case)}
    endings = folder_endings()
    cases = [case for case in jobs if isinstance(case, Case)]
    skipped = [one for one in jobs if isinstance(one, Skipped)]
    for root, file in files:
        known = ending_of(file.name) in endings or _matches(root, file, where.include)
        if not known or identity(file) in named:
            continue
        why = _why_not(file, where)
        if why:
            skipped.append(Skipped(str(file), why))
        else:
            cases.append(Case(str(file), where.machine, where.job, root.place(file)))
    if not (cases or where.may_be_empty):
        _refuse_empty(where, skipped)
    cases, others = _whole_programs(cases)
    skipped += others
    done = sorted(_apart(cases), key=lambda case: case.output)
    return Found(tuple(done), tuple(skipped), tuple(file for _, file in files))


def _whole_programs(cases: Sequence[Case]) -> tuple[list[Case], list[Skipped]]:
    """The cases without those of files that are read with another one, which has most of them."""
    sources = Sources()
    read_with: dict[str, str] = {}
    files: dict[int, list[Path]] = {}
    for k, case in enumerate(cases):
        path = Path(case.program)
        if not case.problem and is_one_of_many(path):
            with suppress(InputError):
                files[k] = files_of(path, sources)
    kept: set[int] = set()
    for k in sorted(files, key=lambda k: (-len(files[k]), cases[k].program)):
        if identity(cases[k].program) not in read_with:
            kept.add(k)
            read_with |= {identity(file): cases[k].program for file in files[k][1:]}
    skipped = [
        Skipped(cases[k].program, f"it is read with {read_with[identity(cases[k].program)]}")
        for k in files
        if k not in kept
    ]
    return [case for k, case in enumerate(cases) if k in kept or k not in files], skipped


def looked(where: Where) -> list[Path]:
    """All files of the folders that are not left out. Raises as `find`."""
    return [file for root in _roots(where) for file in root.files]


@dataclass(frozen=True, slots=True)
class _Root:
    """A folder of the call, its files, and the folder below the output that keeps their tree."""

    folder: Path
    files: tuple[Path, ...]
    prefix: str

    def place(self, file: PathLike) -> str:
        """The path of a file below the output folder."""
        path, folder = from_root(file), from_root(self.folder)
        below = path.relative_to(folder) if path.is_relative_to(folder) else Path(path.name)
        return (PurePath(self.prefix) / below).as_posix()


def _refuse(where: Where) -> None:
    """Raise UsageError for an output folder that holds the programs."""
    if not where.folders:
        raise UsageError("no folder is given; name one or more folders of programs")
    for folder in where.folders:
        if inside(folder, where.output):
            raise UsageError(
                "holds the programs of this call; name another folder with -o, so that no program is "
                "overwritten",
                file=where.output,
            )
    if not from_root(where.output).name:
        raise UsageError(
            "has no name, so no history can lie beside it; name a folder in it", file=where.output
        )
    if Path(where.output).exists() and not Path(where.output).is_dir():
        raise UsageError("is a file; name a folder", file=where.output)


def _refuse_empty(where: Where, skipped: Sequence[Skipped]) -> None:
    """Raise InputError for folders without a program that can be corrected."""
    if skipped:
        first = f"the first of {len(skipped)} files that are left out is {skipped[0].file}: {skipped[0].why}"
    else:
        endings = ", ".join(f".{ending}" for ending in sorted(folder_endings()))
        first = f"expected files that end in {endings}, others by --include PATTERN, or job files"
    raise InputError(f"holds no program to correct; {first}", file=where.folders[0])


def _roots(where: Where) -> list[_Root]:
    folders = [Path(name) for name in where.folders]
    names = [from_root(f).name for f in folders if not f.is_file()]
    twice = [name for name, count in Counter(map(os.path.normcase, names)).items() if count > 1]
    if twice:
        raise UsageError(
            f"two folders of this call are called {twice[0]!r}, so their programs would go to one place; "
            "correct them in two calls"
        )
    several = len(names) > 1 or len(names) < len(folders) > 1
    roots = []
    for folder in folders:
        if folder.is_file():
            roots.append(_Root(folder.parent, (folder,), ""))
            continue
        files = (file for file in files_below(folder, [where.output]))
        root = _Root(folder, (), from_root(folder).name if several else "")
        kept = tuple(file for file in files if not _matches(root, file, where.exclude))
        roots.append(replace(root, files=kept))
    return roots


def _matches(root: _Root, file: Path, patterns: Sequence[str]) -> bool:
    """Whether the name of a file, or its path below its folder, is one of the patterns."""
    below = Path(os.path.relpath(file, root.folder)).as_posix()
    return any(fnmatch.fnmatch(file.name, p) or fnmatch.fnmatch(below, p) for p in patterns)


def _jobs(root: _Root, file: Path, where: Where) -> Iterator[Case | Skipped]:
    """The case of a job file; nothing for another file."""
    if where.job is not None and identity(file) == identity(where.job):
        return
    try:
        data = read_bytes(file)
        if _JOB not in data:
            return
        values, _ = read_toml(data, str(file))
    except InputError as error:
        yield Case(str(file), None, str(file), root.place(file), str(error))
        return
    if values.get("schema") != _JOB.decode():
        return
    program, machine = values.get("program"), values.get("machine")
    if program is None:
        yield Skipped(str(file), "the job file names no program")
    elif not (isinstance(program, str) and isinstance(machine, str | None) and _is_name(program)):
        sentence = f"{file}: program and machine are paths; expected names of files in quotes"
        yield Case(str(file), None, str(file), root.place(file), sentence)
    else:
        path = str(beside(file, program))
        place = (PurePath(root.place(file)).parent / Path(program).name).as_posix()
        if from_root(path).is_relative_to(from_root(root.folder)):
            place = root.place(path)
        problem = ""
        if machine is None and where.machine is None:
            problem = f"{file}: names no machine; add the key machine, or name the machine file with -m"
        elif is_page(place):
            problem = f"{path}: ends as a page, which a browser would run; give it another ending"
        yield Case(path, None if machine is not None else where.machine, str(file), place, problem)


def _is_name(path: str) -> bool:
    """Whether a path ends in the name of a file."""
    return Path(path).name not in ("", "..") and "\0" not in path


def _why_not(file: Path, where: Where) -> str:
    """Why a file that no job names is no program of this call, in words; "" where it is one."""
    stem = Path(file.stem)
    if stem.suffix == _CORRECTED and file.with_name(f"{stem.stem}{file.suffix}").is_file():
        return "it is the corrected program of the file beside it"
    try:
        stamp = find_stamp(read_bytes(file))
    except InputError:
        return ""
    if stamp is not None:
        return f"it has the stamp `{stamp.group().decode()}` of a correction"
    if where.machine is None and where.job is None and where.known is None:
        return "no job file names it, and no machine is given with -m"
    return "it ends as a page" if is_page(file) else ""


def _apart(cases: Sequence[Case]) -> Iterator[Case]:
    """The cases with outputs of their own: of a program that several jobs name, each has the name of its
    job."""
    counts = Counter(os.path.normcase(case.output) for case in cases)
    seen: set[str] = set()
    for case in cases:
        output = case.output
        if counts[os.path.normcase(output)] > 1 and case.job is not None:
            path = PurePath(output)
            output = path.with_name(f"{path.stem}.{Path(case.job).stem}{path.suffix}").as_posix()
        key = os.path.normcase(output)
        if key in seen:
            what = f"{case.job or case.program}: another one goes to {output}, too; rename one of them"
            number = len(seen)
            yield replace(case, output=f"{output}.{number}", problem=case.problem or what)
            seen.add(f"{key}.{number}")
            continue
        seen.add(key)
        yield replace(case, output=output)
