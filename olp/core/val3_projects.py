"""The files of an application of VAL 3, which a project file names."""

from __future__ import annotations

from pathlib import Path

from olp.core.patterns import pattern
from olp.core.projects import Beside, is_plain

#: Endings of the project, and of data.
_PROJECT = ".pjx"
_DATA = ".dtx"
_NAMED = pattern(rb"<(?:[Pp]rogram|[Dd]ata)\s[^<>]*?\bfile\s*=\s*[\"']([^\"'<>]*)[\"']")


def files_of(path: Path, beside: Beside) -> list[Path]:
    """The files of the application of a program or a project, this one first. The project has the name of its
    folder, or that of the program, or is the only one there that names it. Files in other folders are left
    out. Raises InputError where one cannot be read."""
    found: dict[str, Path] = {}
    project: Path | None = path
    if path.suffix.lower() != _PROJECT:
        project = _project_of(path, beside)
    if project is None:
        for stem in dict.fromkeys((_folder_of(path), path.stem)):
            data = path.with_name(f"{stem}{_DATA}")
            if beside.exists(data):
                found[data.name] = data
    else:
        found[project.name] = project
        for file in _named_in(beside.read(project)):
            if beside.exists(path.with_name(file)):
                found[file] = path.with_name(file)
    found.pop(path.name, None)
    return [path, *found.values()]


def _project_of(path: Path, beside: Beside) -> Path | None:
    for stem in dict.fromkeys((_folder_of(path), path.stem)):
        project = path.with_name(f"{stem}{_PROJECT}")
        if beside.exists(project):
            return project
    naming = [p for p in beside.listed(path.parent, _PROJECT) if path.name in _named_in(beside.read(p))]
    return naming[0] if len(naming) == 1 else None


def _named_in(project: bytes) -> list[str]:
    """The names of the files of a project that are in its folder."""
    names = (name.decode("utf-8", "replace") for name in _NAMED.findall(project))
    return [name for name in names if is_plain(name)]


def _folder_of(path: Path) -> str:
    return path.absolute().parent.name
