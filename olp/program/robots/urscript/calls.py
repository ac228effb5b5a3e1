"""Which statements of a URScript text may move the robot by what they call, whatever the run."""

from __future__ import annotations

from collections.abc import Iterable

from olp.core.patterns import pattern
from olp.program.dialect import Support
from olp.program.robots.urscript.blocks import FUNCTIONS, function_of, nested
from olp.program.robots.urscript.table import TABLE
from olp.program.robots.urscript.text import Line

#: One behind a dot is of another machine, which answers.
_CALLED = pattern(rb"(?<![\w.])[A-Za-z_]\w*(?=[ \t]*\()")
#: A statement that waits for a thread, or ends it.
_WAITS = pattern(rb"[ \t]*(?:join|kill)[ \t]+(\w+)")
#: A thread that begins, and the name by which others wait for it.
_RUN = pattern(rb"(\w+)[ \t]*=[ \t]*run[ \t]+(\w+)")
#: Words before a bracket that call nothing.
_WORDS = frozenset((b"if", b"elif", b"while", b"for", b"not", b"and", b"or", b"xor", b"return", b"in"))
#: How functions of the controller begin that tell something, or talk to other machines.
_TELLS = (b"get_", b"read_", b"pose_", b"socket_", b"str_", b"modbus_", b"request_", b"write_", b"rtde_")
#: Other functions of the controller that move nothing.
_STILL = frozenset(
    b"abs acos asin atan atan2 binary_list_to_integer ceil cos d2r floor integer_to_binary_list "
    b"interpolate_pose inv is_steady is_within_safety_limits length log make_list norm normalize "
    b"point_dist pow r2d random rotvec2rpy rpc_factory rpy2rotvec sign sin size sqrt tan to_num to_str "
    b"transpose wrench_trans force assert time".split()
) | {name for name, (support, _) in TABLE.items() if support is Support.UNCHANGED}


class Calls:
    """What the functions of a text call. A function moves nothing where nothing that it calls does."""

    def __init__(self, lines: Iterable[Line]) -> None:
        self._calls: dict[bytes, set[bytes]] = {}
        self._threads: dict[bytes, set[bytes]] = {}
        self._survey(lines)
        self._moving: set[bytes] = set()
        again = True
        while again:
            found = {name for name, called in self._calls.items() if any(map(self._may, called))}
            again, self._moving = found != self._moving, found

    def _survey(self, lines: Iterable[Line]) -> None:
        """Take down what functions call, but not what those do that are defined in them."""
        for line, word, blocks in nested(lines):
            name = function_of(blocks).name
            own = self._calls.setdefault(name, set()) if name else set()
            if word in FUNCTIONS:
                continue
            if b"run" in line.text and (run := _RUN.search(line.text)) is not None:
                self._threads.setdefault(run[1], set()).add(run[2])
            own |= _called(line.text)

    def _may(self, name: bytes) -> bool:
        """Whether a function may move the robot."""
        if name in self._calls:
            return name in self._moving
        return name not in _STILL and not name.startswith(_TELLS)

    def may_move(self, text: bytes) -> bool:
        """Whether what a statement calls may move the robot, as one does that is not known."""
        waits = _WAITS.match(text)
        return any(map(self._may, _called(text) if waits is None else self._threads.get(waits[1], {b""})))

    def recursive(self, name: bytes) -> bool:
        """Whether a function may call itself."""
        found, waiting = set[bytes](), [name]
        while waiting:
            called = self._calls.get(waiting.pop(), set()) - found
            found |= called
            waiting += called
        return name in found

    def still(self, text: bytes) -> bool:
        """Whether a statement is known to move nothing: what it calls, or the threads that it waits for."""
        return (b"(" in text or _WAITS.match(text) is not None) and not self.may_move(text)

    def own_may_move(self, text: bytes) -> bool:
        """Whether a function of the text that a statement calls may move the robot."""
        return not self._moving.isdisjoint(_called(text))


def _called(text: bytes) -> set[bytes]:
    return set(_CALLED.findall(text)) - _WORDS
