"""Programs as posts of CAM systems and slicers write them: the files of `tests/posts`, and their controls."""

from __future__ import annotations

from pathlib import Path

from judge.machines import Recipe

FOLDER = Path(__file__).resolve().parents[1] / "posts"
#: The control of each file.
CONTROLS = {
    "artsoft-mach4.nc": "mach4",
    "bcnc-grbl.ngc": "grbl",
    "cura-ender3.gcode": "marlin",
    "estlcam-grbl.nc": "grbl",
    "estlcam-marlin.gcode": "marlin",
    "freecad-grbl.nc": "grbl",
    "freecad-linuxcnc.ngc": "linuxcnc",
    "fusion360-fanuc.nc": "fanuc",
    "fusion360-grbl.nc": "grbl",
    "fusion360-haas.nc": "haas",
    "fusion360-mach3.tap": "mach3",
    "fusion360-mpcnc.gcode": "marlin",
    "haas-corners.nc": "haas",
    "haas-row-of-holes.nc": "haas",
    "hsmworks-okuma.min": "okuma",
    "inventor-haas-inch.nc": "haas",
    "mastercam-fanuc.nc": "fanuc",
    "mastercam-mazak.eia": "mazak",
    "mazak-synchronous-tap.eia": "mazak",
    "nx-siemens-iso-sub.mpf": "siemens-iso",
    "okuma-drill.min": "okuma",
    "okuma-own-offsets.min": "okuma",
    "orcaslicer-voron.gcode": "klipper",
    "powermill-fanuc.nc": "fanuc",
    "prusaslicer-mk3s.gcode": "marlin",
    "siemens-iso.mpf": "siemens-iso",
    "solidcam-fanuc-d-before.nc": "fanuc",
    "solidcam-haas.nc": "haas",
    "sprutcam-fanuc.nc": "fanuc",
    "superslicer-voron.gcode": "klipper",
    "vcarve-grbl.gcode": "grbl",
    "vcarve-mach3.tap": "mach3",
}
#: Those that call subprograms.
UNROLLED = frozenset({"nx-siemens-iso-sub.mpf"})
_ZERO = {"X_mm": 5.0, "Y_mm": 2.0, "Z_mm": -200.0, "set_by": "true"}
_OFFSETS = ("G54", "G55", "G54.1 P3", "G54.1 P5", "G15 H1")


def recipe(control: str) -> Recipe:
    """A big machine with the tools and work offsets that these programs use."""
    return Recipe(
        controller=control,
        travel=((-1500.0, 1500.0),) * 3,
        tools={n: {"Z_mm": 100.0 + n, "radius_mm": 3.0} for n in range(1, 31)},
        work_offsets={
            name: {"X_mm": 5.0, "Y_mm": 2.0, "Z_mm": -200.0, "set_by": "true"} for name in _OFFSETS
        },
    )
