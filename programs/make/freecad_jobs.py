"""Two CAM jobs, modelled and posted by FreeCAD 0.20 without a screen.

OUT=folder QT_QPA_PLATFORM=offscreen freecadcmd programs/make/freecad_jobs.py </dev/null

Writes plate.ngc (post linuxcnc) and manifold.nc (post fanuc). Three things differ from what FreeCAD writes:
the time stamp is dropped, since it names the day and nothing of the job; so is the rapid to clearance height
before the first tool change, where no tool length is active yet; and the file name that the fanuc post writes
outside a comment becomes an O number.
"""

import importlib
import os
import pathlib
import re

import FreeCAD
import Part
import Path
from FreeCAD import Vector
from PathScripts import (
    PathDrilling,
    PathHelix,
    PathJob,
    PathPocketShape,
    PathPost,
    PathProfile,
    PathToolBit,
    PathToolController,
    PathUtils,
)

PLATE_MM = (1120.0, 640.0, 16.0)
MANIFOLD_MM = (160.0, 100.0, 36.0)


class Chooser:
    """Answers FreeCAD's question which tool or job a new operation takes; a dialog does it on a screen."""

    def __init__(self, job):
        self.job = job

    def selectedToolController(self):
        return self.job.Tools.Group[0]

    def chooseJob(self, jobs):
        return self.job


def rounded(x, y, z, dx, dy, dz, radius):
    """Box with its four upright edges rounded."""
    box = Part.makeBox(dx, dy, dz, Vector(x, y, z))
    upright = [e for e in box.Edges if abs(e.Vertexes[0].Z - e.Vertexes[1].Z) > dz / 2]
    return box.makeFillet(radius, upright)


def drilled(solid, points, radius, top, depth):
    for x, y in points:
        solid = solid.cut(Part.makeCylinder(radius, depth, Vector(x, y, top - depth)))
    return solid


def new_job(name, solid):
    doc = FreeCAD.newDocument(name)
    body = doc.addObject("Part::Feature", "Part")
    body.Shape = solid
    doc.recompute()
    job = PathJob.Create("Job", [body], None)
    for controller in list(job.Tools.Group):
        doc.removeObject(controller.Name)
    job.OrderOutputBy = "Fixture"
    PathUtils.UserInput = Chooser(job)
    return doc, job


def tool(job, number, shape, diameter, feed, plunge, speed, label):
    bit = PathToolBit.Factory.Create(label, PathToolBit.findToolShape(shape))
    bit.Label = label
    bit.Diameter = diameter
    bit.addProperty("App::PropertyString", "ToolType")  # the fanuc post asks for it, tool bits lack it
    controller = PathToolController.Create(label, bit, number)
    controller.HorizFeed = f"{feed} mm/min"
    controller.VertFeed = f"{plunge} mm/min"
    controller.SpindleSpeed = speed
    job.Proxy.addToolController(controller)
    return controller


def faces(model, wanted):
    """Names of the faces of `model` that `wanted(face)` accepts."""
    return [f"Face{i + 1}" for i, face in enumerate(model.Shape.Faces) if wanted(face)]


def floor_at(z, area):
    """Accepts horizontal faces at height z of at least `area` mm2, in mm."""

    def wanted(face):
        box = face.BoundBox
        return box.ZLength < 1e-6 and abs(box.ZMin - z) < 1e-6 and face.Area > area

    return wanted


def hole_walls(radius):
    def wanted(face):
        surface = face.Surface
        return (
            isinstance(surface, Part.Cylinder)
            and abs(surface.Radius - radius) < 1e-6
            and (
                abs(surface.Axis.z) > 0.99
                and abs(face.Area - 6.283185 * radius * face.BoundBox.ZLength) < 1.0
            )
        )

    return wanted


def set_up(op, controller, label, **values):
    op.Label = label
    op.ToolController = controller
    for key, value in values.items():
        op.setExpression(key, None)
        setattr(op, key, value)
    return op


def post(doc, job, name, arguments, path):
    doc.recompute()
    module = importlib.import_module(f"PathScripts.post.{name}_post")
    (objects,) = PathPost.CommandPathPost().buildPostList(job)
    for fixture in [o for o in objects if o.Label == "G54"]:
        fixture.Path = Path.Path([Path.Command("G54")])
    module.export(objects, path, arguments + " --no-show-editor")
    text = pathlib.Path(path).read_text()
    text = re.sub(r"(?im)^(N\d+ *)?\(Output Time:.*\)\n", "", text)
    text = re.sub(r"(?m)^.*FREECAD-FILENAME-GOES-HERE.*$", "O2010 (MANIFOLD)", text)
    pathlib.Path(path).write_bytes(text.encode())
    print(path, text.count("\n"), "lines", len(text), "bytes")


def plate(path):
    """Base plate of 1120 x 640 x 16 mm: pockets, slots, bores, drilled grid, window, outer contour."""
    dx, dy, dz = PLATE_MM
    solid = rounded(0, 0, -dz, dx, dy, dz, 40.0)
    solid = solid.cut(rounded(380, 190, -dz, 360, 260, dz, 18.0))
    for x in (190.0, 930.0):
        solid = solid.cut(Part.makeCylinder(75.0, 6.0, Vector(x, 320, -6)))
        solid = solid.cut(Part.makeCylinder(30.0, dz, Vector(x, 320, -dz)))
    for y in (90.0, 550.0):
        solid = solid.cut(rounded(460, y - 12, -8.0, 200, 24, 8.0, 11.9))
    grid = [(x, y) for x in range(60, 1100, 125) for y in (50, 590)]
    grid += [(x, y) for x in (60, 1060) for y in range(158, 500, 108)]
    solid = drilled(solid, grid, 4.0, 0.0, dz)
    taps = [
        (x + 100 * s, 320 + 100 * t) for x in (190.0, 930.0) for s, t in ((1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    solid = drilled(solid, taps, 3.4, 0.0, 12.0)

    doc, job = new_job("plate", solid)
    model = job.Model.Group[0]
    mill12 = tool(job, 1, "endmill.fcstd", 12.0, 2400, 500, 16000, "12 mm end mill")
    mill6 = tool(job, 2, "endmill.fcstd", 6.0, 1500, 300, 20000, "6 mm end mill")
    drill8 = tool(job, 3, "drill.fcstd", 8.0, 400, 280, 4000, "8 mm drill")
    drill68 = tool(job, 4, "drill.fcstd", 6.8, 400, 240, 4800, "6.8 mm drill")

    op = PathPocketShape.Create("Pocket")
    op.Base = [(model, faces(model, floor_at(-6.0, 1000.0)))]
    set_up(op, mill12, "bearing pockets", StepOver=55, StepDown=3.0, StartDepth=0.0, FinalDepth=-6.0)
    op.OffsetPattern = "Offset"

    op = PathPocketShape.Create("Slots")
    op.Base = [(model, faces(model, floor_at(-8.0, 1000.0)))]
    set_up(op, mill6, "slots", StepOver=45, StepDown=4.0, StartDepth=0.0, FinalDepth=-8.0)
    op.OffsetPattern = "ZigZagOffset"

    op = PathHelix.Create("Bores")
    op.Base = [(model, faces(model, hole_walls(30.0)))]
    set_up(op, mill6, "bores 60 mm", StepDown=4.0, StartDepth=-6.0, FinalDepth=-16.5, StartRadius="20 mm")

    op = PathDrilling.Create("Drill8")
    op.Base = [(model, faces(model, hole_walls(4.0)))]
    set_up(
        op,
        drill8,
        "grid 8 mm through",
        PeckEnabled=True,
        PeckDepth=5.0,
        RetractHeight=2.0,
        FinalDepth=-18.5,
        StartDepth=0.0,
        ReturnLevel="G99",
    )

    op = PathDrilling.Create("Drill68")
    op.Base = [(model, faces(model, hole_walls(3.4)))]
    set_up(
        op,
        drill68,
        "tapping holes M8",
        DwellEnabled=True,
        DwellTime=0.3,
        RetractHeight=2.0,
        FinalDepth=-12.0,
        StartDepth=0.0,
        ReturnLevel="G98",
    )

    def window_wall(face):
        box = face.BoundBox
        return abs(box.ZLength - dz) < 1e-6 and 370 < box.XMin <= box.XMax < 750 and 180 < box.YMin < 460

    op = PathProfile.Create("Window")
    op.Base = [(model, faces(model, window_wall))]
    set_up(op, mill12, "window", StepDown=4.0, StartDepth=0.0, FinalDepth=-16.3)
    op.Side = "Inside"

    op = PathProfile.Create("Contour")
    set_up(op, mill12, "outer contour", StepDown=4.0, StartDepth=0.0, FinalDepth=-16.3)
    op.processPerimeter = True
    op.processHoles = False

    post(doc, job, "linuxcnc", "--modal --precision 4", path)


def manifold(path):
    """Hydraulic manifold of 160 x 100 x 36 mm: pocket, helical port, peck-drilled bolt holes, contour."""
    dx, dy, dz = MANIFOLD_MM
    solid = rounded(0, 0, -dz, dx, dy, dz, 10.0)
    solid = solid.cut(rounded(20, 20, -9, 70, 60, 9.0, 8.0))
    solid = solid.cut(Part.makeCylinder(15.0, dz, Vector(125, 50, -dz)))
    solid = drilled(solid, [(10, 10), (150, 10), (10, 90), (150, 90)], 3.3, 0.0, dz)

    doc, job = new_job("manifold", solid)
    model = job.Model.Group[0]
    mill10 = tool(job, 1, "endmill.fcstd", 10.0, 900, 250, 6000, "10 mm end mill")
    drill66 = tool(job, 2, "drill.fcstd", 6.6, 300, 160, 2800, "6.6 mm drill")

    op = PathPocketShape.Create("Pocket")
    op.Base = [(model, faces(model, floor_at(-9.0, 1000.0)))]
    set_up(op, mill10, "pocket", StepOver=50, StepDown=3.0, StartDepth=0.0, FinalDepth=-9.0)
    op.OffsetPattern = "Offset"

    op = PathHelix.Create("Port")
    op.Base = [(model, faces(model, hole_walls(15.0)))]
    set_up(op, mill10, "port 30 mm", StepDown=3.0, StartDepth=0.0, FinalDepth=-36.5)

    op = PathDrilling.Create("Bolts")
    op.Base = [(model, faces(model, hole_walls(3.3)))]
    set_up(
        op,
        drill66,
        "bolt holes",
        PeckEnabled=True,
        PeckDepth=6.0,
        RetractHeight=2.0,
        FinalDepth=-38.5,
        StartDepth=0.0,
    )

    op = PathProfile.Create("Contour")
    set_up(op, mill10, "outer contour", StepDown=9.0, StartDepth=0.0, FinalDepth=-36.5)
    op.processPerimeter = True
    op.processHoles = False

    post(doc, job, "fanuc", "--line-numbers --no-axis-modal", path)


os.chdir(os.environ.get("OUT", "."))
plate("plate.ngc")
manifold("manifold.nc")
