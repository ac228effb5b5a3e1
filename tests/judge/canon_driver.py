"""LinuxCNC's interpreter as a server, run by the system's Python: it is loaded once, and each program is
carried out by a child of its own.

A request on the standard input is a JSON line (table, variables, start, unit, deletes, axes, seconds,
size), then
`size` bytes of program. The answer on the standard output is a JSON line (error, error_line, messages, size;
`failed` where the child ended without an answer: a crash, a limit of time), then `size` bytes: rows of
COLUMNS doubles. Standard library only. Lengths come from the interpreter in inches, whatever the program's
units.
"""

import ctypes
import gc
import json
import math
import os
import select
import signal
import sys
import time
from array import array
from pathlib import Path

COLUMNS = 22  # the last one is the speed of the spindle
MM = 25.4
#: Kinds of rows, as in `linuxcnc`.
RAPID = 0
FEED = 1
ARC = 2
PROBE = 3
DWELL = 4
FEED_MODE = "interpreter: feed mode set to"
#: active modal codes are listed in tenths
UNITS = {200: 1.0, 210: MM}


def stand_at(library, point):
    """Tells the library where the machine stands, a point in program units. After M6 and M61 it goes on from
    there. On its own it would go on from the last straight move: arcs and new offsets are forgotten."""
    library._Z13STRAIGHT_FEEDiddddddddd(-1, *map(ctypes.c_double, (*point, *[0.0] * 6)))


def prepare_tools(table):
    """The interpreter crashes on T, G43 or M6 without the tool map that the I/O task creates: create it."""
    library = ctypes.CDLL("libtooldata.so.0", mode=ctypes.RTLD_GLOBAL)
    status = ctypes.create_string_buffer(1 << 16)
    library._Z17tool_mmap_creatorPK13EMC_TOOL_STATi(status, 0)
    library._Z13tooldata_initb(ctypes.c_bool(False))
    if library._Z13tooldata_loadPKcPPc(table.encode(), None):
        raise SystemExit("tool table not read")
    return status


def read_tools(table):
    """Rows of the tool table in file order, index 0 the spindle."""
    rows = [(-1,) + (0.0,) * 12 + (0,)]
    for line in Path(table).read_text().splitlines():
        words = {word[0]: float(word[1:]) for word in line.split()}
        values = [words.get(letter, 0.0) for letter in "XYZABCUVWDIJ"]
        rows.append((int(words["T"]), *values, 0))
    return rows


class Canon:
    """Receives the canonical calls; points are controlled-point coordinates before the offsets."""

    def __init__(self, tools, library, *, deletes, axes):
        self.tools = tools
        self.library = library
        self.deletes, self.axes = deletes, axes
        self.feed_mode, self.speed, self.rows = 0, 0.0, 0
        self.data = array("d")
        self.line, self.tool, self.plane, self.feed, self.index = 0, -1, 1, 0.0, 1
        self.g5x, self.g92, self.length = [0.0] * 3, [0.0] * 3, [0.0] * 3
        self.cos, self.sin = 1.0, 0.0
        self.position = [0.0] * 3
        self.axis = None
        self.unit = MM
        self.silent = False
        self.told = True
        self.messages = []

    def __getattr__(self, name):
        """State calls without a meaning for the path."""
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *_: None

    def next_line(self, state):
        if self.silent:
            return
        self.line = state.sequence_number
        self.check_speeds(state.speed)
        # before the first line of the program no code is listed
        unit = next((UNITS[code] for code in state.gcodes if code in UNITS), self.unit)
        if unit != self.unit:
            self.unit = unit
            # a straight move has told where it ends before this call
            self.told = False
            self.stand()

    def check_speeds(self, speed):
        """The speed of moves counts where it is the same before and after them; else it is NaN."""
        if speed != self.speed:
            last = len(self.data) // COLUMNS
            for row in range(self.rows, last):
                self.data[row * COLUMNS + COLUMNS - 1] = math.nan
        self.speed, self.rows = speed, len(self.data) // COLUMNS

    def set_g5x_offset(self, index, *offset):
        self.index, self.g5x = index, list(offset[:3])
        self.stand()

    def set_g92_offset(self, *offset):
        self.g92 = list(offset[:3])
        self.stand()

    def set_xy_rotation(self, degrees):
        self.cos, self.sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def tool_offset(self, *offset):
        self.length = list(offset[:3])
        self.stand()

    def set_plane(self, plane):
        self.plane = plane

    def set_feed_rate(self, feed):
        self.feed = feed

    def comment(self, text):
        """The only word of the interpreter about G93, G94 and G95."""
        if text.startswith(FEED_MODE):
            self.feed_mode = int(text.endswith("revolution"))

    def change_tool(self, index):
        self.tools[0] = self.tools[index] if index > 0 else (0,) + (0.0,) * 12 + (0,)
        self.tool = self.tools[0][0]
        self.stand()

    def stand(self):
        """M6 and M61 ask at the end of their block where the machine stands, in the offsets in force then."""
        if self.axis is None or self.silent:
            return
        self.silent = True
        point = [a / MM - length for a, length in zip(self.axis, self.length, strict=True)]
        stand_at(self.library, [self.unit * value for value in self.relative(*point)])
        self.silent = False

    def get_tool(self, index):
        return self.tools[index] if 0 <= index < len(self.tools) else (-1,) + (0.0,) * 12 + (0,)

    def get_external_length_units(self):
        return 1.0

    def get_external_angular_units(self):
        return 1.0

    def get_axis_mask(self):
        return self.axes

    def get_block_delete(self):
        return int(self.deletes)

    def check_abort(self):
        return False

    def message(self, text):
        self.messages.append([self.line, text])

    def absolute(self, x, y, z):
        x, y, z = x + self.g92[0], y + self.g92[1], z + self.g92[2]
        x, y = x * self.cos - y * self.sin, x * self.sin + y * self.cos
        return [MM * (x + self.g5x[0]), MM * (y + self.g5x[1]), MM * (z + self.g5x[2])]

    def relative(self, x, y, z):
        """The controlled point that lies at an absolute one, both in inches."""
        x, y, z = x - self.g5x[0], y - self.g5x[1], z - self.g5x[2]
        x, y = x * self.cos + y * self.sin, y * self.cos - x * self.sin
        return x - self.g92[0], y - self.g92[1], z - self.g92[2]

    def row(self, kind, tip, centre=(0.0, 0.0, 0.0), turns=0, extra=0.0):
        if self.silent:
            return
        self.position = tip
        length = [MM * value for value in self.length]
        self.axis = [a + b for a, b in zip(tip, length, strict=True)]
        self.data.extend([float(self.line), float(kind), *tip, *length, float(self.tool), float(self.index)])
        self.data.extend([MM * self.feed, *centre, float(turns), float(self.plane), extra])
        self.data.extend([MM * value for value in self.g92])
        self.data.extend([float(self.feed_mode), self.speed])

    def straight_traverse(self, x, y, z, *_):
        self.straight(RAPID, self.absolute(x, y, z))

    def straight_feed(self, x, y, z, *_):
        self.straight(FEED, self.absolute(x, y, z))

    def straight_probe(self, x, y, z, *_):
        self.straight(PROBE, self.absolute(x, y, z))

    def straight(self, kind, tip):
        # the move to the start may come while the codes of the next line are listed
        begun = self.axis is not None
        self.row(kind, tip)
        if begun and not (self.told or self.silent):
            self.told = True
            self.stand()

    def rigid_tap(self, x, y, z, *_):
        back = self.position
        self.row(FEED, self.absolute(x, y, z))
        self.row(FEED, back)

    def dwell(self, seconds):
        self.row(DWELL, self.position, extra=seconds)

    def arc_feed(self, first, second, centre_1, centre_2, turns, third, *_):
        order = {1: (0, 1, 2), 2: (2, 0, 1), 3: (1, 2, 0)}[self.plane]
        end, centre = (first, second, third), (centre_1, centre_2, third)
        tip, middle = ([point[i] for i in order] for point in (end, centre))
        self.row(ARC, self.absolute(*tip), self.absolute(*middle), turns)
        self.stand()


def interpret(request, program):
    """The report and the rows of one program, in a process that interprets no other."""
    Path("t.tbl").write_text(request["table"])
    keep = prepare_tools("t.tbl")  # the library reads this block for as long as the interpreter runs
    result = parse(request, program)
    del keep
    return result


def parse(request, program):
    """The report and the rows of one program."""
    import gcode

    Path("v.var").write_text(request["variables"])
    Path("p.ngc").write_bytes(program)
    library = ctypes.PyDLL(gcode.__file__)
    canon = Canon(read_tools("t.tbl"), library, deletes=request["deletes"], axes=request["axes"])
    canon.parameter_file = "v.var"
    result, line = gcode.parse("p.ngc", canon, request["unit"], request["start"])
    failed = result > gcode.MIN_ERROR
    report = {
        "error": gcode.strerror(result) if failed else None,
        "error_line": line,
        "messages": canon.messages,
    }
    return report, canon.data.tobytes()


def send(stream, report, rows):
    stream.write(json.dumps({**report, "size": len(rows)}).encode() + b"\n" + rows)
    stream.flush()


def child(request, program, pipe):
    """Carries out one program and ends the process; what the interpreter prints is not kept."""
    silent = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1):
        os.dup2(silent, descriptor)
    try:
        report, rows = interpret(request, program)
    except BaseException as error:
        report, rows = {"failed": repr(error)}, b""
    with os.fdopen(pipe, "wb") as stream:
        send(stream, report, rows)
    os._exit(0)


def answer(request, program):
    """What the child of a program sends, or why it sends nothing."""
    read_end, write_end = os.pipe()
    process = os.fork()
    if not process:
        os.close(read_end)
        child(request, program, write_end)
    os.close(write_end)
    parts, late = [], False
    end = time.monotonic() + request["seconds"]
    while True:
        late = not select.select([read_end], [], [], max(0.0, end - time.monotonic()))[0]
        part = b"" if late else os.read(read_end, 1 << 20)
        if not part:
            break
        parts.append(part)
    os.close(read_end)
    if late:
        os.kill(process, signal.SIGKILL)
    _, status = os.waitpid(process, 0)
    if late:
        return json.dumps({"failed": "time", "size": 0}).encode() + b"\n"
    if os.WIFSIGNALED(status):
        name = signal.Signals(os.WTERMSIG(status)).name
        return json.dumps({"failed": name, "size": 0}).encode() + b"\n"
    return b"".join(parts)


def main():
    """Answers requests until the input ends. The working folder is this process's own."""
    # the first program of a process loads what all others use
    warm = {
        "table": "",
        "variables": "5220\t1.0\n",
        "deletes": False,
        "axes": 7,
        "unit": "G21",
        "start": "G0 X0",
    }
    Path("t.tbl").write_text("")
    parse(warm, b"M2\n")
    # a child then copies fewer pages of its parent
    gc.disable()
    gc.freeze()
    while line := sys.stdin.buffer.readline():
        request = json.loads(line)
        program = sys.stdin.buffer.read(request["size"])
        sys.stdout.buffer.write(answer(request, program))
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
