"""Mutation testing of the modules that decide: python tests/mutation/run.py --count 600 --seed 1

Draws changes of the code (tests/mutation/sites.py says which), and for each runs the fast tests that run the
changed lines, on a copy of the checkout. Prints every change that no test notices and the share of killed
ones by room; ends with 1 where that is below `--least`. Changes named in tests/mutation/equivalent.toml do
not count.

Needs `pip install -e ".[test,mutation]"`. The map of tests by line takes several minutes: it is kept in
`--work`; `--map tests/proof` builds that part of it again, `--map` all of it.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from mutation import sites
from mutation.cover import Map
from mutation.server import Outcome, Server

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent.toml")
#: Folders of tests that judge the shape of the code, not what it does.
NOT_RUN = ("house", "mutation", "benchmarks", "fuzz")
COPIED = ("olp", "tests", "viewer", "programs", "pyproject.toml", "README.md", ".ci")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=600, help="changes that are drawn")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="files whose path contains this")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60.0, help="of tests for one change, at most")
    parser.add_argument("--least", type=float, default=0.0, help="share that must be killed, 0 to 1")
    parser.add_argument(
        "--work", type=Path, default=Path("/tmp/olp-mutation"), help="folder of copies and map"
    )
    parser.add_argument("--map", nargs="*", help="build the map of tests by line again, or these tests in it")
    parser.add_argument("--again", type=Path, help="only the survivors of this table, an earlier --write")
    parser.add_argument("--write", type=Path, help="table of all changes: outcome, file, line, before, after")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    recorded = options.work / "map.json"
    servers = [Server(_copied(options.work / f"copy{job}")) for job in range(options.jobs)]
    if options.map is not None or not recorded.is_file():
        if not options.map:
            recorded.unlink(missing_ok=True)
        servers[0].record(options.map or _folders(), sites.files(ROOT), recorded)
    for server in servers:
        server.warm_up(_folders())
    tests = Map.read(recorded, ROOT)
    drawn = sites.drawn(ROOT, options.count, options.seed, options.only)
    wanted = None if options.again is None else _survivors(options.again)
    named = _named()
    counts: Counter[tuple[str, str]] = Counter()
    if options.write:
        options.write.write_text("", "utf-8")

    def one_job(job: int) -> None:
        for site, change in drawn[job :: options.jobs]:
            if wanted is not None and (site.path, str(site.line)) not in {row[:2] for row in wanted}:
                continue
            one = sites.mutant(ROOT, site, change)
            if wanted is not None and _row(one) not in wanted:
                continue
            chosen = tests.tests_of(site, options.seconds)
            begun = time.monotonic()
            outcome = servers[job].judge(one, chosen) if chosen else Outcome("survived", "no test runs it")
            word = outcome.word
            if word == "survived" and (site.path, one.before, one.after) in named:
                word = "equivalent"
            counts[one.room, word] += 1
            if options.write:
                with options.write.open("a", encoding="utf-8") as table:
                    table.write("\t".join((word, *_row(one))) + "\n")
            if word == "survived":
                why = outcome.why or f"{len(chosen)} tests, {time.monotonic() - begun:.0f} s"
                print(f"{site.path}:{site.line} ({why})\n  - {one.before}\n  + {one.after}", flush=True)

    with ThreadPoolExecutor(options.jobs) as pool:
        list(pool.map(one_job, range(options.jobs)))
    return int(_printed(counts, options.seed) < options.least)


def _folders() -> list[str]:
    names = sorted(path.name for path in (ROOT / "tests").iterdir() if path.is_dir())
    return [f"tests/{name}" for name in names if name not in NOT_RUN and not name.startswith("__")]


def _row(one: sites.Mutant) -> tuple[str, ...]:
    return one.site.path, str(one.site.line), one.before.replace("\t", " "), one.after.replace("\t", " ")


def _survivors(table: Path) -> set[tuple[str, ...]]:
    rows = [tuple(row.split("\t")) for row in table.read_text("utf-8").splitlines()]
    return {row[1:] for row in rows if row[0] == "survived"}


def _named() -> set[tuple[str, str, str]]:
    value = tomllib.loads(EQUIVALENT.read_text("utf-8"))
    return {(row["file"], row["before"], row["after"]) for row in value.get("equivalent", ())}


def _copied(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        elif (ROOT / name).exists():
            shutil.copy2(ROOT / name, folder / name)
    return folder


def _printed(counts: Counter[tuple[str, str]], seed: int) -> float:
    """Prints the table by room, and returns the share of killed ones among those that count."""
    print(f"\nseed {seed}: room, drawn, equivalent, killed, survived")
    rooms = sorted({room for room, _ in counts})
    killed = sum(counts[room, "killed"] for room in rooms)
    survived = sum(counts[room, "survived"] for room in rooms)
    for room in rooms:
        row = [counts[room, word] for word in ("equivalent", "killed", "survived")]
        share = row[1] / max(row[1] + row[2], 1)
        print(f"{room:14} {sum(row):4} {row[0]:4} {row[1]:4} {row[2]:4}  {share:6.1%}")
    share = killed / max(killed + survived, 1)
    print(f"killed {killed} of {killed + survived}: {share:.1%}")
    return share


if __name__ == "__main__":
    sys.exit(main())
