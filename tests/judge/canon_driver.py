"""LinuxCNC's interpreter on one program, run by the system's Python: PROGRAM TABLE VAR OUT INITCODE UNITCODE.

Writes OUT as rows of COLUMNS doubles, prints one JSON line (error, error_line, messages, rows). Standard
library only. Lengths come from the interpreter in inches, whatever the program's units.
"""

import ctypes
import json
import math
import sys
from array import array
from pathlib import Path

COLUMNS = 20
MM = 25.4
#: Kinds of rows, as in `linuxcnc`.
RAPID = 0
FEED = 1
ARC = 2
PROBE = 3
DWELL = 4
#: active modal codes are listed in tenths
METRIC = 210


def stand_at(library, point):
    """Tells the library where the machine stands, a point in program units. After a tool change it goes on
    from there. On its own it would go on from the last straight move: arcs and new offsets are forgotten."""
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

    def __init__(self, tools, library):
        self.tools = tools
        self.library = library
        self.data = array("d")
        self.line, self.tool, self.plane, self.feed, self.index = 0, -1, 1, 0.0, 1
        self.g5x, self.g92, self.length = [0.0] * 3, [0.0] * 3, [0.0] * 3
        self.cos, self.sin = 1.0, 0.0
        self.position = [0.0] * 3
        self.axis = None
        self.unit = MM
        self.silent = False
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
        self.unit = MM if METRIC in state.gcodes else 1.0

    def set_g5x_offset(self, index, *offset):
        self.index, self.g5x = index, list(offset[:3])

    def set_g92_offset(self, *offset):
        self.g92 = list(offset[:3])

    def set_xy_rotation(self, degrees):
        self.cos, self.sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def tool_offset(self, *offset):
        self.length = list(offset[:3])

    def set_plane(self, plane):
        self.plane = plane

    def set_feed_rate(self, feed):
        self.feed = feed

    def change_tool(self, index):
        self.tools[0] = self.tools[index] if index > 0 else (0,) + (0.0,) * 12 + (0,)
        self.tool = self.tools[0][0]
        if self.axis is None:
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
        return 7

    def get_block_delete(self):
        return 0

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

    def straight_traverse(self, x, y, z, *_):
        self.row(RAPID, self.absolute(x, y, z))

    def straight_feed(self, x, y, z, *_):
        self.row(FEED, self.absolute(x, y, z))

    def straight_probe(self, x, y, z, *_):
        self.row(PROBE, self.absolute(x, y, z))

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


def main():
    program, table, variables, output, initcode, unitcode = sys.argv[1:7]
    keep = prepare_tools(table)  # the library reads this block for as long as the interpreter runs
    import gcode

    canon = Canon(read_tools(table), ctypes.PyDLL(gcode.__file__))
    canon.parameter_file = variables
    result, line = gcode.parse(program, canon, unitcode, initcode)
    Path(output).write_bytes(canon.data.tobytes())
    failed = result > gcode.MIN_ERROR
    report = {
        "error": gcode.strerror(result) if failed else None,
        "error_line": line,
        "messages": canon.messages,
    }
    print(json.dumps(report))
    del keep


if __name__ == "__main__":
    main()
