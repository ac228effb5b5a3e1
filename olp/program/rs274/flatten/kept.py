"""A corrected program with its loops, subprograms and expressions kept.

The unrolled program was corrected: each visit of a line has a text of its own. Where all visits of each line
have the same numbers, within the last digit, these are put into the line itself, and the flow stays as it is.
A number that an expression gives cannot be changed.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from olp.core.arrays import Index
from olp.core.errors import ProgramError
from olp.program.kept import Difference, Kept
from olp.program.origin import Unrolled
from olp.program.rs274.codes import HOLE_PATTERNS, SPLINES
from olp.program.rs274.flatten.apart import apart, can_be_apart, otherwise, runs_once
from olp.program.rs274.flatten.centres import LETTERS as CENTRES
from olp.program.rs274.flatten.lines import Line, Word, compile_line
from olp.program.rs274.profiles.base import Profile
from olp.program.text.line_ends import split

#: Numbers that a correction changes, with their letters.
_LENGTH = re.compile(rb"([XYZIJKRxyzijkr])[ \t]*([-+]?(?:\d+\.?\d*|\.\d+))")
_NUMBER = re.compile(rb"(?i)(?<![A-Z\d])N[ \t]*\d+[ \t]*")
#: Characters of a text that a sentence shows.
_SHOWN = 40


#: A visit of a line: what the unrolled program has for it, and what the corrected one has.
_Visit = tuple[bytes, bytes]


def kept(unrolled: Unrolled, corrected: bytes, starts: Index, profile: Profile) -> Kept:
    """The program that `unrolled` was made from, with the corrections of its unrolled form.

    (n,) `starts` are where the lines of the unrolled text begin in the `corrected` one, which has no stamp.
    """
    origin = unrolled.origin
    bounds = [*starts.tolist(), len(corrected)]
    texts = profile.lines(unrolled)
    visits: dict[int, dict[int, Counter[_Visit]]] = {}
    rows = zip(origin.line.tolist(), unrolled.within.line.tolist(), texts, strict=True)
    for i, (line, within, raw) in enumerate(rows):
        visit = _bare(raw), _bare(corrected[bounds[i] : bounds[i + 1]])
        visits.setdefault(line, {}).setdefault(within, Counter())[visit] += 1
    lines = list(origin.texts[: origin.lines])
    differences: list[Difference] = []
    changed: list[int] = []
    repeated: list[int] = []
    for line, runs in sorted(visits.items()):
        counts = sum(runs.values(), Counter[_Visit]())
        if all(raw == written for raw, written in counts):
            if _centre_stated(origin.texts[line - 1], counts, profile):
                why = "it turns or scales about the present position, which the correction moves"
                differences.append(Difference(line, why))
            continue
        try:
            if line > origin.lines:
                raise _cannot("it is in a file of its own, and one program is written")
            text = _of_visits(origin.texts[line - 1], counts, profile)
        except ProgramError as error:
            differences.append(Difference(line, error.message))
            continue
        lines[line - 1] = text
        changed.append(line)
        if counts.total() > 1:
            repeated.append(line)
    if differences:
        calls = _calls(unrolled, {d.line: visits[d.line] for d in differences}, texts, profile)
    else:
        calls = _repeated_calls(unrolled, {line: visits[line] for line in repeated})
    program = apart(unrolled, calls, texts) if calls else None
    whole = None if differences else b"".join(lines)
    return Kept(whole, tuple(differences), tuple(changed), tuple(repeated), program, tuple(sorted(calls)))


def _repeated_calls(unrolled: Unrolled, lines: Mapping[int, Mapping[int, Counter[_Visit]]]) -> frozenset[int]:
    """The calls in which lines run more than once; empty where they cannot be written out."""
    calls = frozenset(within for line, runs in lines.items() for within in runs if within != line)
    return calls if calls and can_be_apart(unrolled) and calls <= runs_once(unrolled) else frozenset()


def _calls(
    unrolled: Unrolled,
    lines: Mapping[int, Mapping[int, Counter[_Visit]]],
    texts: Sequence[bytes],
    profile: Profile,
) -> frozenset[int]:
    """The calls and blocks to write out, so that all other passes of each of these lines have the same
    numbers, and no block needs what unrolling has written otherwise.

    Empty where that does not help. `lines` are the visits of each by the line that they run in, `texts` the
    lines of the unrolled text."""
    origin = unrolled.origin
    if not can_be_apart(unrolled):
        return frozenset()
    chosen = otherwise(unrolled, texts, profile.language)
    for line, runs in lines.items():
        same = Counter[_Visit]()
        for within, counts in runs.items():
            try:
                if line > origin.lines:
                    raise _cannot("it is in a file of its own")
                _of_visits(origin.texts[line - 1], same + counts, profile)
                same += counts
            except ProgramError:
                if within == line and line not in chosen:
                    return frozenset()
                chosen.add(within)
    return frozenset(chosen) if chosen <= runs_once(unrolled) else frozenset()


def _cannot(why: str) -> ProgramError:
    return ProgramError(why, code="OLP511")


def _centre_stated(source: bytes, counts: Counter[_Visit], profile: Profile) -> bool:
    """Whether unrolling has put a centre into a block that had none."""
    visited = [compile_line(raw, 0, profile.language).words for raw, _ in counts]
    own = {word.letter for word in compile_line(source, 0, profile.language).words}
    return any(
        round(10 * word.number) in CENTRES and word.letter == "g" and {w.letter for w in words} - own
        for words in visited for word in words
    )  # fmt: skip


def _bare(text: bytes) -> bytes:
    return text.rstrip(b"\r\n")


def _of_visits(source: bytes, counts: Counter[_Visit], profile: Profile) -> bytes:
    """The line with what all of its visits need; ProgramError where they differ."""
    bare = _bare(source)
    line = compile_line(source, 0, profile.language)
    candidates = Counter[bytes]()
    for (raw, written), count in counts.items():
        same = raw == written
        candidates[bare if same else _restored(line, bare, raw, written, profile)] += count
    return _merged(candidates) + source[len(bare) :]


def _restored(line: Line, source: bytes, raw: bytes, written: bytes, profile: Profile) -> bytes:
    """What was written for a visit, with the expressions and the words that unrolling left out."""
    if raw == source:
        return written
    if line.prints:
        return source
    if line.flow is not None or line.opaque:
        raise _cannot("its flow is in the block that has to change; put it into a block of its own")
    if any(word.letter == "g" and round(10 * word.number) in SPLINES for word in line.words):
        raise _cannot("its spline is written as chords")
    if profile.language.hole_patterns and any(
        word.letter == "g" and round(10 * word.number) in HOLE_PATTERNS for word in line.words
    ):
        raise _cannot("its holes are written one by one")
    if any(word.letter in "@^" for word in line.words):
        raise _cannot("its radius and angle are written as X and Y")
    stated = {word.letter: word.number for word in line.words if word.letter in "xy" and word.value is None}
    unrolled = {word.letter: word.number for word in compile_line(raw, 0, profile.language).words}
    if any(unrolled.get(letter) != number for letter, number in stated.items()):
        raise _cannot("its radius and angle are written as X and Y")
    language = profile.language
    visited = compile_line(raw, 0, language)
    partner = _partners(line.words, visited.words)
    blocks = split(written, profile.text.line_end)
    compiled = [compile_line(block, 0, language) for block in blocks]
    splices: list[tuple[int, int, int, bytes]] = []
    out: list[bytes] = [source[a.start : a.end] for a in line.assignments]
    for word, mine in zip(line.words, partner, strict=True):
        text = source[word.start : word.end]
        if mine is None:
            # the number of a block is there on its first visit
            if word.letter != "n":
                out.append(text)
        elif word.value is not None:
            number = raw[mine.value_start : mine.end]
            k, place = _same_word(word.letter, number, blocks, compiled)
            splices.append((k, place.value_start, place.end, source[word.value_start : word.end]))
    if any(b"(" in text for text in out):
        raise _cannot("a comment is inside of an expression; put it behind the block")
    for k, start, end, text in sorted(splices, reverse=True):
        blocks[k] = blocks[k][:start] + text + blocks[k][end:]
    if out:
        last = compiled[-1].words
        moved = sum(len(text) - (end - start) for k, start, end, text in splices if k == len(blocks) - 1)
        place_of_rest = last[-1].end + moved if last else 0
        rest = b" ".join(out)
        blocks[-1] = blocks[-1][:place_of_rest] + b" " + rest + blocks[-1][place_of_rest:]
    return b"".join(blocks)


def _partners(words: Sequence[Word], visited: Sequence[Word]) -> Iterator[Word | None]:
    """The word of a visit for each word of a line, None where unrolling left it out."""
    done = 0
    for word in words:
        mine = visited[done] if done < len(visited) else None
        same = mine is not None and mine.letter == word.letter
        if same and (word.value is not None or (mine is not None and mine.number == word.number)):
            done += 1
            yield mine
        else:
            yield None


def _same_word(
    letter: str, number: bytes, blocks: Sequence[bytes], compiled: Sequence[Line]
) -> tuple[int, Word]:
    """The block and the word that have the number of an expression; ProgramError where none has it."""
    places = [
        (k, word) for k, line in enumerate(compiled) for word in line.words
        if word.letter == letter and blocks[k][word.value_start : word.end] == number
    ]  # fmt: skip
    if len(places) != 1:
        raise _cannot(f"an expression gives its {letter.upper()}, which has to be another number")
    return places[0]


def _merged(candidates: Counter[bytes]) -> bytes:
    """The text that stands for all of them, whose numbers are the same within the last digit. Words that only
    some of them have are taken, as the others hold that position."""
    base = next((text for text in candidates if _NUMBER.search(text)), next(iter(candidates)))
    if len(candidates) == 1:
        return base
    single = all(b"\n" not in text and b"\r" not in text for text in candidates)
    if single:
        letters = set[bytes]()
        for match in _LENGTH.finditer(base):
            letters.add(match[1].upper())
        for text in candidates:
            for match in _LENGTH.finditer(text):
                if match[1].upper() not in letters:
                    letters.add(match[1].upper())
                    base = _with_word(base, match[0])
    spans = [match.span(2) for match in _LENGTH.finditer(base)]
    numbers: list[Counter[bytes]] = [Counter() for _ in spans]
    for text, count in candidates.items():
        aligned = _aligned(text, base, single=single)
        for number, column in zip(aligned, numbers, strict=True):
            if number is not None:
                column[number] += count
    chosen = [_agreed(column, base, span) for column, span in zip(numbers, spans, strict=True)]
    for (start, end), number in sorted(zip(spans, chosen, strict=True), reverse=True):
        base = base[:start] + number + base[end:]
    return base


def _with_word(text: bytes, word: bytes) -> bytes:
    """A block with a word behind its last coordinate."""
    lengths = list(_LENGTH.finditer(text))
    if not lengths:
        raise _cannot("its passes move other axes")
    end = lengths[-1].end()
    return text[:end] + b" " + word + text[end:]


def _aligned(text: bytes, base: bytes, *, single: bool) -> list[bytes | None]:
    """The numbers of a text for each of those of `base`; ProgramError where its other bytes differ."""
    mine = list(_LENGTH.finditer(text))
    wanted = list(_LENGTH.finditer(base))
    numbers: list[bytes | None] = [match[2] for match in mine]
    if len(mine) < len(wanted) and single:
        by_letter = {match[1].upper(): match[2] for match in mine}
        numbers = [by_letter.get(match[1].upper()) for match in wanted]
        for match in reversed(wanted):
            if match[1].upper() not in by_letter:
                base = base[: match.start()].rstrip(b" \t") + base[match.end() :]
    if len(numbers) != len(wanted) or _form(text) != _form(base):
        shown = text[:_SHOWN].decode("latin-1"), base[:_SHOWN].decode("latin-1")
        raise _cannot(f"its passes need other words: `{shown[0]}` and `{shown[1]}`")
    return numbers


def _form(text: bytes) -> bytes:
    """A text without its block number and its lengths."""
    return _LENGTH.sub(rb"\1", _NUMBER.sub(b"", text)).strip()


def _agreed(column: Counter[bytes], base: bytes, span: tuple[int, int]) -> bytes:
    """The number of most passes, if the others are within one of its last digit."""
    number, _ = max(column.items(), key=lambda item: item[1])
    digit = 10.0 ** -max(len(text.partition(b".")[2]) for text in column)
    if any(abs(float(text) - float(number)) > 1.001 * digit for text in column):
        letter = base[: span[0]].rstrip(b" \t")[-1:].decode().upper()
        values = sorted(column, key=float)
        raise _cannot(f"its passes need {letter}{values[0].decode()} to {letter}{values[-1].decode()}")
    return number
