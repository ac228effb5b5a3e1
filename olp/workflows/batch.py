"""`batch`: the programs of folders corrected, with what is unchanged left as it is, and a summary of all."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from olp.core.errors import InputError, OlpError
from olp.core.progress import Progress, silent
from olp.core.values import dataclass
from olp.core.version import __version__
from olp.errormodel.known import KnownErrors
from olp.files.folders import digest_of
from olp.files.history import History, Record, writing
from olp.files.sources import Sources
from olp.files.write import make_folder, write_files
from olp.findings.rule import Severity
from olp.workflows.batch_find import Case, Found, Where, find
from olp.workflows.batch_pool import Opener, Pool, opened
from olp.workflows.batch_setup import Files, config_of, digest, plain_options, with_file
from olp.workflows.batch_task import Config, Outcome, Page, Task
from olp.workflows.batch_work import UNEXPECTED, lost, refused
from olp.workflows.correct import CorrectOptions
from olp.workflows.session import PathLike

#: The page of the output folder that lists all programs.
INDEX = "index.html"
#: Exit code of findings, and the least one of a program that is not written.
_FINDINGS = 1
_REFUSED = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchOptions:
    """The options of `batch`: those of `correct`, which hold for each program, and its own. `reports` is the
    form of the report of each program ("" for none), with `plots` or without; `page` makes its review page.
    `keep_going` goes on after a program that is refused, `force` overwrites what `batch` did not write."""

    correct: CorrectOptions = CorrectOptions()
    dialect: str | None = None
    reports: str = "html"
    plots: bool = False
    page: Page | None = None
    keep_going: bool = False
    force: bool = False
    fail_on: str = "error"


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """What a batch did: its report ("olp-batch-1"), with one row per program, and its exit code, the largest
    of all programs. `looked` are the files that would change it."""

    report: dict[str, Any]
    looked: tuple[str, ...] = ()

    @property
    def exit_code(self) -> int:
        """The largest exit code of a program: that of `olp correct` on it."""
        code: int = self.report["exit_code"]
        return code


def batch(
    folders: Sequence[PathLike],
    machine: PathLike | KnownErrors | None = None,
    job: PathLike | None = None,
    *,
    output: PathLike,
    options: CorrectOptions | None = None,
    reports: Literal["html", "json", "md", ""] = "html",
    plots: bool = False,
    keep_going: bool = False,
    force: bool = False,
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress | None = None,
) -> Batch:
    """Correct the programs in folders, and prove each of them.

    `machine` is the machine file of programs whose job file names none, or the errors that are known of it.
    `output` is the folder that keeps the tree of the folders; beside it is its history. What is unchanged
    since the last call is not done again. `options` are those of `olp.correct`. `workers` are processes of
    this machine (default: one for each processor; 1: this process), `cluster` is the address of a Dask
    scheduler. Processes are spawned: a script calls this below `if __name__ == "__main__":`.

    A program that is refused has a row with its error, and is the last one begun unless you `keep_going`.
    Raises UsageError for folders that are in each other's way, InputError where a folder or the history
    cannot be read, and CannotCompute where a cluster has gone.
    """
    known = machine if isinstance(machine, KnownErrors) else None
    where = Where(
        folders=tuple(map(str, folders)), output=str(output), known=known,
        machine=None if machine is None or known is not None else str(machine),
        job=None if job is None else str(job),
    )  # fmt: skip
    chosen = BatchOptions(
        correct=options or CorrectOptions(), reports=reports, plots=plots, keep_going=keep_going, force=force
    )
    return run(where, chosen, lambda tasks: opened(workers, cluster, tasks), progress)


def run(where: Where, options: BatchOptions, opener: Opener, progress: Progress | None = None) -> Batch:
    """As `batch`. `opener` gives the workers where there is work to do; they are closed at the end."""
    with writing(where.output):
        return _run(where, options, opener, progress or silent)


def _run(where: Where, options: BatchOptions, opener: Opener, tell: Progress) -> Batch:
    tell("look for programs", 0.0)
    found = find(where)
    plant = _Plant(where, options, found)
    stale = plant.stale()
    pool: Pool | None = None
    try:
        if stale:
            pool = opener(len(stale))
            for done, (case, outcome, files) in enumerate(plant.outcomes(pool, stale), 1):
                plant.keep(case, outcome, files)
                tell(f"{done} of {len(stale)}: {case.output}", done / len(stale))
    finally:
        if pool is not None:
            pool.close()
    report = plant.report()
    plant.write_index(report)
    return Batch(report, plant.looked())


class _Plant:
    """The programs of a call with their history, and the rows of those that are settled."""

    def __init__(self, where: Where, options: BatchOptions, found: Found) -> None:
        self._where = where
        self._options = options
        self._found = found
        self._history = History(where.output)
        self._rows: dict[str, dict[str, Any]] = {}
        self._halted = False
        self._digests: dict[str, str | None] = {}
        self._configs: dict[tuple[str | None, str | None], Config | OlpError] = {}

    def stale(self) -> list[Case]:
        """The programs to correct. What is unchanged, and what cannot be begun, has its row then."""
        cases = []
        for case in self._found.cases:
            record = self._history.last.get(case.output)
            if case.problem:
                self._settle(case, {"message": case.problem, "exit_code": 3})
            elif record is not None and self._fresh(case, record):
                self._settle(case, record.row, "unchanged")
            elif self._is_foreign(case):
                self._settle(case, self._foreign(case))
            else:
                cases.append(case)
        return cases

    def outcomes(self, pool: Pool, cases: list[Case]) -> Iterator[tuple[Case, Outcome, Files]]:
        """The outcomes of the programs with the files that each was made from, as they are done. After one
        that is refused no other is begun, unless the call keeps going."""
        waiting = iter(enumerate(cases))
        under_way: dict[int, tuple[Case, Config, Task]] = {}
        done: list[tuple[Case, Outcome, Files]] = []
        stop = self._stopped()
        while True:
            while not (stop or self._halted) and len(under_way) < pool.capacity:
                number, case = next(waiting, (None, None))
                if number is None or case is None:
                    break
                prepared = self._prepared(case)
                if isinstance(prepared, Outcome):
                    stop = not self._options.keep_going
                    done.append((case, prepared, {}))
                    continue
                pool.submit(number, *prepared)
                under_way[number] = (case, *prepared)
            # the workers have the next programs while these are written
            yield from done
            done.clear()
            if not under_way:
                return
            number, outcome = pool.result()
            case, config, task = under_way.pop(number)
            if outcome.wanted is not None:
                if outcome.wanted not in task.files:
                    task = with_file(task, outcome.wanted)
                    pool.submit(number, config, task)
                    under_way[number] = (case, config, task)
                    continue
                outcome = lost(f"{case.program}: {outcome.wanted} cannot be sent to a worker")
            if outcome.text is None and not self._options.keep_going:
                stop = True
            done.append((case, outcome, {**config.files, **task.files}))

    def keep(self, case: Case, outcome: Outcome, files: Files) -> None:
        """Write what a program has become, and append it to the history."""
        assert outcome.row is not None
        names = self._targets(case)
        contents = (outcome.text, outcome.report, outcome.page)
        pairs = zip(names, contents, strict=True)
        written = {name: data for name, data in pairs if name and data is not None}
        if written and self._is_foreign(case):
            self._settle(case, self._foreign(case))
            return
        before = self._history.last.get(case.output)
        if outcome.lasting:
            inputs = {self._history.named(name): digest(data) for name, data in files.items()}
            outputs = {name: hashlib.sha256(data).hexdigest() for name, data in written.items()}
            setup = self._setup_of(case) | {"options": plain_options(self._options.correct)}
            self._history.add(Record(case.output, self._key(case), inputs, outputs, setup, outcome.row))
        targets = {self._history.folder / name: data for name, data in written.items()}
        try:
            for target in targets:
                make_folder(target.parent)
            write_files(targets, force=True, inputs=[case.program])
            if written and before is not None:
                self._history.remove_older(before, written)
        except (OlpError, OSError) as error:
            code = error.exit_code if isinstance(error, OlpError) else OlpError.exit_code
            self._settle(case, {"message": str(error), "exit_code": code})
            self._halted = not self._options.keep_going
            return
        self._settle(case, outcome.row, "written")

    def report(self) -> dict[str, Any]:
        """The summary of the call ("olp-batch-1"), the worst programs first."""
        for case in self._found.cases:
            if case.output not in self._rows:
                self._settle(case, {}, "not done")
        rows = sorted(map(self._judged, self._rows.values()), key=_rank)
        others = [
            {"program": output, "state": "not in this call", **record.row}
            for output, record in self._history.last.items()
            if output not in self._rows and not self._history.gone(record)
        ]
        states = [row["state"] for row in rows]
        return {
            "schema": "olp-batch-1",
            "output": Path(self._where.output).as_posix(),
            "history": self._history.path.name,
            "index": INDEX if self._options.force or self._history.owns(INDEX) else None,
            "date": self._options.correct.date,
            "programs": rows,
            "others": sorted(map(self._judged, others), key=_rank),
            "skipped": [{"file": one.file, "why": one.why} for one in self._found.skipped],
            "counts": {state: states.count(state) for state in dict.fromkeys(states)},
            "time": _time(rows),
            "fail_on": self._options.fail_on,
            "exit_code": max((row["exit_code"] for row in rows), default=0),
        }

    def write_index(self, report: Mapping[str, Any]) -> None:
        """Write the page of the plant, where it has changed."""
        from olp.workflows.batch_report import in_form

        page = in_form(report, self._history.folder / INDEX, self._history.folder)
        target = self._history.folder / INDEX
        own = hashlib.sha256(page).hexdigest()
        if report["index"] is None or digest_of(target) == own:
            return
        make_folder(target.parent)
        self._history.add_index(INDEX, own)
        write_files({target: page}, force=True)

    def looked(self) -> tuple[str, ...]:
        """All files that decide what there is to do."""
        inputs = (self._history.last[o].inputs for o in self._rows if o in self._history.last)
        named = {str(self._history.place(name)) for names in inputs for name in names}
        return tuple(sorted(named | {str(path) for path in self._found.looked}))

    def _stopped(self) -> bool:
        """Whether a row that is settled stops the call."""
        codes = (row.get("exit_code", 0) for row in self._rows.values())
        return not self._options.keep_going and any(code >= _REFUSED for code in codes)

    def _settle(self, case: Case, row: Mapping[str, Any], state: str = "") -> None:
        """Keep the row of a program; one that has an exit code of its own is refused, or has failed."""
        if "exit_code" in row:
            state = "failed" if row["exit_code"] >= UNEXPECTED else "refused"
        names = {"program": case.output, "source": case.program, "job": case.job, "state": state}
        self._rows[case.output] = {**names, **row}

    def _judged(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """A row with its exit code, the files that belong to it, and the release that it is part of."""
        result = dict(row)
        record = self._history.last.get(row["program"])
        # what an earlier call wrote is not of a row that says why nothing is written
        written = {} if record is None or "message" in row else record.outputs
        for key, ending in (("report", ".report."), ("page", ".review.html")):
            name = next((n for n in written if n.startswith(f"{row['program']}{ending}")), None)
            result[key] = name
        if "exit_code" not in result:
            result["exit_code"] = _exit_code(result.get("findings", ()), self._options.fail_on)
        own = written.get(row["program"])
        releases = self._history.releases.values()
        names = [r.name for r in releases if own is not None and r.programs.get(row["program"]) == own]
        result["released"] = names[-1] if names else None
        if not written and (self._history.folder / row["program"]).is_file():
            result["older_output"] = True
        return result

    def _fresh(self, case: Case, record: Record) -> bool:
        """Whether a program was made from the same inputs in the same way, and is as it was written."""
        return (
            record.key == self._key(case)
            and all(self._digest(name) == digest for name, digest in record.inputs.items())
            and self._history.unchanged(record)
        )

    def _digest(self, name: str) -> str | None:
        if name not in self._digests:
            self._digests[name] = digest_of(self._history.place(name))
        return self._digests[name]

    def _key(self, case: Case) -> str:
        """What decides the output beside the contents of files."""
        options = self._options
        page = None if options.page is None else options.page.__module__
        words = [
            __version__, plain_options(options.correct), self._setup_of(case), options.reports,
            options.plots, page,
        ]  # fmt: skip
        return hashlib.sha256(json.dumps(words, sort_keys=True).encode()).hexdigest()

    def _setup_of(self, case: Case) -> dict[str, Any]:
        """How a program is called, with the names that files have in the history."""
        files = {"program": case.program, "machine": case.machine, "job": case.job}
        named = {key: None if path is None else self._history.named(path) for key, path in files.items()}
        alone = case.machine is None and case.job is None
        known = repr(self._where.known) if alone and self._where.known is not None else None
        return named | {"dialect": self._options.dialect, "known": known}

    def _targets(self, case: Case) -> tuple[str, str, str]:
        """The names of corrected program, report and page, "" for those that are not asked for."""
        report = f"{case.output}.report.{self._options.reports}" if self._options.reports else ""
        page = f"{case.output}.review.html" if self._options.page is not None else ""
        return case.output, report, page

    def _is_foreign(self, case: Case) -> bool:
        return not self._options.force and not all(map(self._history.owns, filter(None, self._targets(case))))

    def _foreign(self, case: Case) -> dict[str, Any]:
        name = next(name for name in self._targets(case) if name and not self._history.owns(name))
        path = self._history.folder / name
        sentence = f"{path}: is not what olp batch wrote; move it, or overwrite it with --force"
        return {"message": sentence, "exit_code": _REFUSED}

    def _prepared(self, case: Case) -> tuple[Config, Task] | Outcome:
        """Setup and task of a program; its outcome where it cannot be begun. That is looked at again in the
        next call, as not all of its files are known."""
        config = self._config(case.machine, case.job)
        if isinstance(config, OlpError):
            return replace(refused(config), lasting=False)
        try:
            files = _program_files(case.program)
        except InputError as error:
            return replace(refused(error), lasting=False)
        output, report, _ = self._targets(case)
        return config, Task(
            case.program, files, self._options.correct, Path(output).name,
            Path(report).name if report else "", self._options.plots, self._options.page,
        )  # fmt: skip

    def _config(self, machine: str | None, job: str | None) -> Config | OlpError:
        """The setup of machine and job as bytes, or the error of their files."""
        key = (machine, job)
        if key not in self._configs:
            try:
                known = self._where.known if key == (None, None) else None
                self._configs[key] = config_of(machine, job, self._options.dialect, known)
            except OlpError as error:
                self._configs[key] = error
        return self._configs[key]


def _program_files(program: str) -> Files:
    """The bytes of a program, and those of the files beside it that decide what belongs to it."""
    sources = Sources()
    sources.source(program).load()
    return sources.parcel()


def _time(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """How long all programs take together, and of how many that is not known; None where none was timed."""
    timed = [row["time"] for row in rows if "time" in row]
    if not timed:
        return None
    from olp.workflows.correct_time import cost

    known = [time for time in timed if "unknown" not in time]
    nominal_s, corrected_s = (sum(time[key] for time in known) for key in ("nominal_s", "corrected_s"))
    whole = cost(nominal_s, corrected_s, all(time["optimised"] for time in known))
    return whole | {"programs": len(known), "unknown": len(timed) - len(known)}


def _exit_code(findings: Sequence[Mapping[str, Any]], fail_on: str) -> int:
    """The exit code of `olp correct` with these findings."""
    if fail_on == "never":
        return 0
    least = Severity[fail_on.upper()]
    return _FINDINGS if any(Severity[f["severity"].upper()] >= least for f in findings) else 0


def _rank(row: Mapping[str, Any]) -> tuple[Any, ...]:
    """The place of a row: the worst first."""
    largest, allowed = row.get("corrected_um"), row.get("allowed_um")
    share = largest / allowed if largest is not None and allowed else 0.0
    verdicts = {False: 0, None: 1, True: 2}
    return -row["exit_code"], verdicts[row.get("ok")], -share, row["program"]
