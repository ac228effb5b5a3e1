"""What the verbs share: streams, where inputs come from, and when findings fail a run."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

import click

from olp.core.errors import InputError, OlpError, UsageError
from olp.core.optional import require_matplotlib
from olp.core.spool import Text, text_of
from olp.core.values import dataclass
from olp.files.write import is_page
from olp.findings.catalogue import Finding, worst
from olp.findings.rule import Severity

if TYPE_CHECKING:
    from olp.core.machine import Setup
    from olp.errormodel.known import KnownErrors
    from olp.files.sources import Source, Sources
    from olp.workflows.session import Session
    from olp.workflows.shown import Shown

#: Name of stdin and stdout on the command line.
STREAM = "-"
#: Exit code of a run with findings at or above --fail-on.
FINDINGS_EXIT = 1
PLOT_ENDINGS = (".svg", ".png")

#: Key under which a call keeps the value of --dialect.
DIALECT = "olp.dialect"
#: Key under which a call keeps the values of --skew, --scale and --backlash.
KNOWN = "olp.known"
#: Key under which a call keeps the files that it has read.
_SOURCES = "olp.sources"

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Given:
    """What a call is about: the program (a path or `-`) and its source, machine and job, and every file that
    it reads."""

    program: str
    source: Source
    session: Session
    inputs: tuple[str, ...]

    @property
    def setup(self) -> Setup:
        return self.session.setup

    @property
    def stream(self) -> str:
        """Name of the program in errors where it comes from stdin, else ""."""
        return "<stdin>" if self.program == STREAM else ""


def given(program: str | None, machine: str | None, job: str | None) -> Given:
    """Program and machine file: the command line's, else the job's. Raises UsageError, InputError."""
    if program is not None and program.lower().endswith(".toml"):
        raise UsageError(
            "is a TOML file and no program; name the program first, the machine file with -m, and the "
            "job file with -j",
            file=program,
        )
    if program is not None and program != STREAM and Path(program).is_dir():
        raise InputError("is a folder; expected a program in it", file=program)
    known = known_errors(machine, job)
    session, inputs = machine_given(machine, job) if known is None else (_stated(known), ())
    program = program if program is not None else session.setup.job.program
    if program is None:
        raise UsageError("no program is given; name it, or set the key program of the job file (-j)")
    return Given(program, source(session.sources, program), session, (*files_of(program), *inputs))


def known_errors(machine: str | None, job: str | None) -> KnownErrors | None:
    """The errors that the call states in place of machine and job file, None where it states none. Raises
    UsageError."""
    known: dict[str, tuple[str, ...]] = click.get_current_context().meta.get(KNOWN, {})
    if not known:
        return None
    if machine is not None or job is not None:
        raise UsageError(
            "--skew, --scale and --backlash stand in place of a machine file; leave out -m and -j, or put "
            "the numbers into the calibration file of the machine"
        )
    from olp.errormodel.known import KnownErrors

    return KnownErrors.of(**known)


def _stated(known: KnownErrors) -> Session:
    """A session of the errors that the call states. Raises UsageError, InputError."""
    from olp.workflows.session import Session

    return Session.start(known, dialect=click.get_current_context().meta.get(DIALECT))


def machine_given(machine: str | None, job: str | None) -> tuple[Session, tuple[str, ...]]:
    """A session of machine and job, and the files that describe them. Raises UsageError, InputError."""
    from olp.workflows.session import Session

    dialect = click.get_current_context().meta.get(DIALECT)
    session = Session.start(machine, job, dialect=dialect, sources=sources_of_call())
    return session, session.inputs()


def sources_of_call() -> Sources:
    """The files of this call: each is opened once."""
    from olp.files.sources import Sources

    meta = click.get_current_context().meta
    if _SOURCES not in meta:
        meta[_SOURCES] = Sources()
    sources: Sources = meta[_SOURCES]
    return sources


def source(sources: Sources, name: str) -> Source:
    """A program for a session: a file, or stdin for `-`."""
    from olp.files.sources import Source

    return Source.stream(_read_stdin) if name == STREAM else sources.source(name)


def _read_stdin() -> Text:
    if sys.stdin is None:
        raise InputError("is closed; name a file", file="<stdin>")
    try:
        return text_of(sys.stdin.buffer)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file="<stdin>") from None


def options_of(kind: type[T], words: Mapping[str, Any]) -> T:
    """A value, such as the options of a workflow, of those words of a call that are its parameters."""
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    return kind(**{name: words[name] for name in names if name in words})


def files_of(*names: str | None) -> list[str]:
    """The names that are files: given, and not `-`."""
    return [name for name in names if name is not None and name != STREAM]


def default_output(program: str) -> str:
    """PROGRAM.corrected.SUFFIX beside PROGRAM. Raises UsageError where that is the name of a page."""
    path = Path(program)
    return (
        STREAM if program == STREAM else no_page(str(path.with_name(f"{path.stem}.corrected{path.suffix}")))
    )


def no_page(name: str) -> str:
    """The name of a file that is no page. Raises UsageError where it ends as one: a browser would run what
    its text holds."""
    if is_page(name):
        raise UsageError("ends as a page, which a browser would run; give it another ending", file=name)
    return name


def refuse_early(targets: Iterable[str], inputs: Iterable[str], *, force: bool) -> None:
    """Raise the writer's errors before the work is done."""
    from olp.files.write import check_targets

    check_targets(map(Path, targets), inputs, force=force)


def refuse_twice(names: Iterable[str]) -> None:
    """Raise where two outputs are one file."""
    seen: set[str] = set()
    for name in names:
        path = os.path.normcase(os.path.realpath(name))
        if path in seen:
            raise UsageError("is named as output twice; name two files", file=name)
        seen.add(path)


def refuse_stream(**outputs: str | None) -> None:
    """Raise where an output that must be a file is named `-`; keys are options, as in `save_profile`."""
    for key, name in outputs.items():
        if name == STREAM:
            option = f"--{key.replace('_', '-')}"
            raise UsageError(f"{option} writes a file and cannot be -; name a file")


def plot_ending(name: str) -> None:
    """Raise UsageError for a picture whose ending names no format."""
    if Path(name).suffix.lower() not in PLOT_ENDINGS:
        raise UsageError(f"the plot {name!r} ends in no known format; expected .svg or .png")
    require_matplotlib()


def diagnostic(message: str) -> None:
    """Write a message to stderr. Where that is closed or full, the message is lost, and the run goes on."""
    if sys.stderr is None:
        return
    try:
        click.echo(_encodable(message, sys.stderr.encoding), err=True)
    except (OSError, ValueError):
        silence(sys.stderr)


def put(text: str | bytes | Iterable[bytes], *, err: bool = False) -> None:
    """Write a result, whole or in parts, to stdout or stderr. A reader that has gone is no error: the run
    goes on without it.

    Raises OlpError where stdout is closed, or cannot take it.
    """
    if err and sys.stderr is None:
        return
    stream = sys.stderr if err else _stdout()
    if isinstance(text, str):
        text = text.encode(stream.encoding or "utf-8", "replace")
    try:
        stream.flush()
        for part in (text,) if isinstance(text, bytes) else text:
            stream.buffer.write(part)
        stream.buffer.flush()
    except BrokenPipeError:
        silence(stream)
    except OSError as error:
        silence(stream)
        if not err:
            raise OlpError(
                f"cannot be written ({error.strerror}); each output file is whole, or is not written",
                file="<stdout>",
            ) from error


def _stdout() -> TextIO:
    if sys.stdout is None:
        raise OlpError("is closed; give a file with -o, or open it", file="<stdout>")
    return sys.stdout


def is_terminal(stream: TextIO | None) -> bool:
    """Whether people read the stream; a closed one is none."""
    return stream is not None and stream.isatty()


def takes_colour(stream: TextIO | None) -> bool:
    """Whether people read the stream in colours. A console of Windows is told to obey them."""
    if not is_terminal(stream):
        return False
    if os.name == "nt":
        # comes with click there
        import_module("colorama").just_fix_windows_console()
    return True


def silence(stream: TextIO | None) -> None:
    """Discard what is still to be flushed, so that the interpreter does not complain at its end."""
    if stream is not None:
        devnull = os.open(os.devnull, os.O_WRONLY)
        os.dup2(devnull, stream.fileno())
        os.close(devnull)


def note_of_use(machine: str, calibration: str) -> None:
    """Say what puts a calibration that was written into use, where the machine file does not name it."""
    from olp.files.toml_text import read_toml
    from olp.files.write import read_bytes

    stated = read_toml(read_bytes(machine), machine)[0].get("calibration")
    folder = Path(machine).resolve().parent
    if isinstance(stated, str) and (folder / stated).resolve() == Path(calibration).resolve():
        return
    try:
        name = Path(os.path.relpath(Path(calibration).resolve(), folder)).as_posix()
    except ValueError:
        # another drive
        name = Path(calibration).resolve().as_posix()
    names = "names no calibration" if stated is None else f'names calibration = "{stated}"'
    how = "add before its first table" if stated is None else "write there instead"
    diagnostic(f'note: {machine} {names}; to use {calibration}, {how} the line calibration = "{name}"')


def put_result(result: Shown, *, as_json: bool, quiet: bool) -> None:
    """Write the report of a result to stdout: as JSON, else as text unless `quiet`."""
    if as_json:
        from olp.reports.report import to_json

        put(to_json(result.full_report()))
    elif not quiet:
        put(result.to_text())


def exit_for(findings: Iterable[Finding], fail_on: str) -> None:
    """End with exit code 1 where a finding is at or above `fail_on`."""
    most_severe = worst(findings)
    if most_severe is not None and fail_on != "never" and most_severe >= Severity[fail_on.upper()]:
        click.get_current_context().exit(FINDINGS_EXIT)


def _encodable(text: str, encoding: str | None) -> str:
    """The text as a stream can take it, without the control characters that a terminal would obey."""
    encoding = encoding or "utf-8"
    text = "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in text)
    return text.encode(encoding, "replace").decode(encoding)
