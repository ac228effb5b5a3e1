"""Workers of a batch: killed ones are replaced, inputs travel as bytes, a cluster gives the same bytes."""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cases.clusters import Cluster, cluster
from cases.plants import contents, correct_all, moved, plant, program, states

from olp.core.errors import CannotCompute, UsageError
from olp.files.sources import Parcel, Wanted, in_parcel
from olp.workflows.batch_pool import ATTEMPTS, Here, Processes, _Worker
from olp.workflows.batch_setup import config_of
from olp.workflows.batch_task import Config, Task
from olp.workflows.batch_work import perform
from olp.workflows.correct import CorrectOptions

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return plant(tmp_path / "plant")


def task_of(folder: Path, name: str = "one.ngc") -> tuple[Config, Task]:
    path = folder / "parts" / name
    config = config_of(str(folder / "mill" / "machine.toml"), None, None)
    return config, Task(str(path), {in_parcel(path): path.read_bytes()}, CorrectOptions(), name)


def test_a_task_needs_no_disk(folder: Path) -> None:
    """As on a worker of another machine: the files are gone, and the task has travelled as bytes."""
    wanted = perform(*task_of(folder))
    travelled = pickle.dumps(task_of(folder))
    folder.rename(folder.with_name("gone"))
    assert perform(*pickle.loads(travelled)).text == wanted.text


def test_a_worker_of_another_version_says_so(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config, task = task_of(folder)
    monkeypatch.setattr("olp.workflows.batch_work.__version__", "0.0")
    outcome = perform(config, task)
    assert outcome.row is not None and not outcome.lasting
    assert "install the same version on all workers" in outcome.row["message"]


def test_a_defect_is_a_row_and_no_end(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("planted")

    monkeypatch.setattr("olp.workflows.correct.run", broken)
    result = correct_all(folder, keep_going=True)
    assert result.exit_code == 4
    assert {row["state"] for row in result.report["programs"]} == {"failed"}
    assert "this is a defect of olp (RuntimeError: planted)" in result.report["programs"][0]["message"]
    monkeypatch.undo()
    # what may be gone the next time is no lasting outcome
    assert set(states(correct_all(folder)).values()) == {"written"}


def test_a_setup_is_loaded_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Calibration and predicted tests are those of machine and job, and not of the program."""
    counts = dict.fromkeys(("load_calibration", "predicted"), 0)
    for module, name in (("session", "load_calibration"), ("report", "predicted")):
        function = getattr(importlib.import_module(f"olp.workflows.{module}"), name)

        def counting(*words: object, name: str = name, function: Any = function, **more: object) -> object:
            counts[name] += 1
            return function(*words, **more)

        monkeypatch.setattr(f"olp.workflows.{module}.{name}", counting)
    assert len(states(correct_all(folder, reports="html"))) == 3
    # of two machines
    assert counts == {"load_calibration": 2, "predicted": 2}


def test_a_parcel_asks_for_what_it_lacks(tmp_path: Path) -> None:
    (tmp_path / "here.toml").write_text("")
    parcel = Parcel({in_parcel("a/b.nc"): b"text", "absent": None}, ["mesh.stl"])
    assert parcel.read(Path("a", "..", "a", "b.nc")) == b"text"
    assert not parcel.exists("absent")
    assert parcel.exists("mesh.stl")
    with pytest.raises(Wanted, match=r"mesh\.stl"):
        parcel.read("mesh.stl")
    with pytest.raises(Wanted):
        parcel.exists(tmp_path / "here.toml")


class _Killed(Processes):
    """Processes of which the first so many are killed as soon as they are started."""

    def __init__(self, kills: int) -> None:
        super().__init__(1)
        self.kills = kills
        self.started = 0

    def _start(self) -> _Worker:
        worker = super()._start()
        self.started += 1
        if self.started <= self.kills:
            worker.process.kill()
        return worker


@pytest.mark.slow
def test_the_task_of_a_killed_process_is_done_again(folder: Path) -> None:
    config, task = task_of(folder)
    pool = _Killed(ATTEMPTS - 1)
    try:
        pool.submit(7, config, task)
        number, outcome = pool.result()
        assert (number, pool.started) == (7, ATTEMPTS)
        assert outcome.text == perform(config, task).text
        # the process that is there does the next one
        pool.submit(8, config, task)
        assert pool.result()[1].text == outcome.text
        assert pool.started == ATTEMPTS
    finally:
        pool.close()


def test_a_task_that_kills_its_processes_is_given_up(folder: Path) -> None:
    config, task = task_of(folder)
    pool = _Killed(ATTEMPTS)
    try:
        pool.submit(0, config, task)
        _, outcome = pool.result()
    finally:
        pool.close()
    assert pool.started == ATTEMPTS
    assert outcome.row is not None
    assert outcome.row["exit_code"] == 4
    assert f"its process ended {ATTEMPTS} times" in outcome.row["message"]
    assert not outcome.lasting


def test_here_tasks_are_done_in_their_order(folder: Path) -> None:
    pool = Here()
    for number in range(3):
        pool.submit(number, *task_of(folder))
    assert [pool.result()[0] for _ in range(3)] == [0, 1, 2]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs a signal that ends a process at once")
def test_a_killed_call_is_gone_on_with(folder: Path) -> None:
    for number in range(40):
        (folder / "parts" / f"part-{number:02}.ngc").write_text(program(100 + number))
    command = [sys.executable, "-m", "olp", "batch", str(folder / "parts"), "-q", "--workers", "2"]
    command += ["-m", str(folder / "mill" / "machine.toml"), "-o", str(folder / "out"), "--reports", "none"]
    process = subprocess.Popen(command, cwd=ROOT)
    while process.poll() is None and len(list((folder / "out").glob("part-*.ngc"))) < 3:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    done = states(correct_all(folder))
    assert list(done.values()).count("unchanged") >= 3
    assert set(done.values()) <= {"unchanged", "written"}
    other = plant(folder.with_name("other"))
    for number in range(40):
        (other / "parts" / f"part-{number:02}.ngc").write_text(program(100 + number))
    correct_all(other)
    mine, theirs = contents(folder / "out"), contents(other / "out")
    assert {**mine, "index.html": b""} == {**theirs, "index.html": b""}


# -- a Dask cluster ------------------------------------------------------------------------------


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Cluster]:
    pytest.importorskip("distributed")
    with cluster(tmp_path / "dask", workers=2) as found:
        yield found


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(folder: Path, running: Cluster) -> None:
    for number in range(30):
        (folder / "parts" / f"part-{number:02}.ngc").write_text(program(100 + number))
    other = moved(folder, "other")
    correct_all(folder, reports="html")

    def kill() -> None:
        while not list((other / "out").glob("*.ngc")):
            time.sleep(0.01)
        running.workers[0].kill()

    killer = threading.Thread(target=kill)
    killer.start()
    result = correct_all(other, reports="html", workers=None, cluster=running.address)
    killer.join()
    assert set(states(result).values()) == {"written"}
    running.workers[0].wait()
    mine, theirs = contents(folder / "out"), contents(other / "out")
    assert {**mine, "index.html": b""} == {**theirs, "index.html": b""}
    # the second worker alone, and a subprogram that is asked for
    assert set(states(correct_all(other, reports="html")).values()) == {"unchanged"}


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_cluster_without_workers_ends_the_call(
    folder: Path, running: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("olp.workflows.batch_cluster._PATIENCE_S", 3.0)
    for worker in running.workers:
        worker.kill()
        worker.wait()
    with pytest.raises(CannotCompute, match="has no workers; start one with dask worker tcp://"):
        correct_all(folder, workers=None, cluster=running.address)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_scheduler_that_is_not_there(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("olp.workflows.batch_cluster._PATIENCE_S", 1.0)
    with pytest.raises(UsageError, match="no scheduler answers there"):
        correct_all(folder, workers=None, cluster="tcp://127.0.0.1:1")


def test_a_cluster_needs_its_package(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"pip install 'olp-corrector\[cluster\]'"):
        correct_all(folder, workers=None, cluster="tcp://127.0.0.1:1")
