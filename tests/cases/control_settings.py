"""Settings of controls, one of each format, and what they state. Facts are those of the public manuals; the
values are made up."""

from __future__ import annotations

from dataclasses import dataclass, field

LINUXCNC = """[EMC]
MACHINE = Bench mill
[KINS]
KINEMATICS = trivkins
[TRAJ]
COORDINATES = XYZ
LINEAR_UNITS = mm
[AXIS_X]
MIN_LIMIT = -1
MAX_LIMIT = 400
MAX_VELOCITY = 60
MAX_ACCELERATION = 500
[AXIS_Y]
MIN_LIMIT = 0
MAX_LIMIT = 200
MAX_VELOCITY = 60
MAX_ACCELERATION = 500
[AXIS_Z]
MIN_LIMIT = -150
MAX_LIMIT = 0
MAX_VELOCITY = 30
MAX_ACCELERATION = 300
[JOINT_0]
BACKLASH = 0.02
"""

GRBL = """Grbl 1.1h ['$' for help]
$0=10
$3=5
$13=0
$20=1
$22=1
$23=3
$100=250.000
$101=250.000
$102=800.000
$110=6000.000
$111=4800.000
$112=1200.000
$120=200.000
$121=150.000
$122=50.000
$130=750.000
$131=730.000
$132=80.000
[G54:-700.000,-650.000,-60.500]
[G55:0.000,0.000,0.000]
[TLO:0.000]
ok
"""

GRBLHAL = """$22=13 (Homing cycle)
$23=2 (Homing direction invert, mask)
$100=200.00000 (X-axis travel resolution, step/mm)
$110=9000.000 (X-axis maximum rate, mm/min)
$111=9000.000 (Y-axis maximum rate, mm/min)
$112=3000.000 (Z-axis maximum rate, mm/min)
$120=500.000 (X-axis acceleration, mm/sec^2)
$121=500.000 (Y-axis acceleration, mm/sec^2)
$122=250.000 (Z-axis acceleration, mm/sec^2)
$130=600.000 (X-axis maximum travel, mm)
$131=400.000 (Y-axis maximum travel, mm)
$132=120.000 (Z-axis maximum travel, mm)
$160=0.040 (X-axis backlash compensation, mm)
$800=8000.000 (X-axis jerk, mm/sec^3)
$801=8000.000 (Y-axis jerk, mm/sec^3)
$802=4000.000 (Z-axis jerk, mm/sec^3)
"""

KLIPPER = """[mcu]
serial: /dev/ttyACM0
[printer]
kinematics: corexy
max_velocity: 300   # mm/s
max_accel = 3000
max_z_velocity: 15
[stepper_x]
rotation_distance: 40
position_min: -5
position_endstop: 235
position_max: 235
[stepper_y]
position_max: 240
[stepper_z]
position_max: 250
position_min: -2
[extruder]
nozzle_diameter: 0.400

#*# <---------------------- SAVE_CONFIG ---------------------->
#*# [stepper_z]
#*# position_max = 248.5
#*# [skew_correction bed]
#*# xy_skew = 0.0011
"""

MARLIN = """Send: M503
Recv: echo:; Linear Units:
Recv: echo:  G21 ; (mm)
Recv: echo:; Steps per unit:
Recv: echo:  M92 X80.00 Y80.00 Z400.00 E93.00
Recv: echo:; Max feedrates (units/s):
Recv: echo:  M203 X500.00 Y400.00 Z5.00 E25.00
Recv: echo:; Max Acceleration (units/s2):
Recv: echo:  M201 X500.00 Y450.00 Z100.00 E1000.00
Recv: echo:; Advanced:
Recv: echo:  M205 B20000.00 S0.00 T0.00 X10.00 Y10.00 Z0.40 E5.00
Recv: echo:; Home offset:
Recv: echo:  M206 X0.00 Y0.00 Z0.00
Recv: echo:; Skew Factor:
Recv: echo:  M852 I0.001200 J0.000000 K0.000000
Recv: echo:; Backlash compensation:
Recv: echo:  M425 F1.00 S3.00 X0.080 Y0.000 Z0.000
Recv: ok
Send: M211
Recv: echo:Soft endstops: On  Min: X0.00 Y-4.00 Z0.00   Max: X220.00 Y225.00 Z250.00
"""

SINUMERIK = """;archive of machine data
N10000 $MN_AXCONF_MACHAX_NAME_TAB[0]="X1"
N10000 $MN_AXCONF_MACHAX_NAME_TAB[1]="Z1"
N10000 $MN_AXCONF_MACHAX_NAME_TAB[2]="Y1"
N10000 $MN_AXCONF_MACHAX_NAME_TAB[3]="A1"
N10200 $MN_INT_INCR_PER_MM=10000
N10240 $MN_SCALING_SYSTEM_IS_METRIC=1
CHANDATA(1)
N32000 $MA_MAX_AX_VELO[AX1]=30000
N32000 $MA_MAX_AX_VELO[AX2]=20000
N32000 $MA_MAX_AX_VELO[AX3]=30000
N32300 $MA_MAX_AX_ACCEL[0,AX1]=3
N32300 $MA_MAX_AX_ACCEL[1,AX1]=5
N32300 $MA_MAX_AX_ACCEL[0,AX2]=2
N32300 $MA_MAX_AX_ACCEL[0,AX3]=2.5
N32431 $MA_MAX_AX_JERK[0,AX1]=40
N32431 $MA_MAX_AX_JERK[0,AX2]=20
N32431 $MA_MAX_AX_JERK[0,AX3]=1.e6
N32450 $MA_BACKLASH[0,AX1]=0.004
N32700 $MA_ENC_COMP_ENABLE[0,AX3]=1
N36100 $MA_POS_LIMIT_MINUS[AX1]=-0.6
N36110 $MA_POS_LIMIT_PLUS[AX1]=1500.6
N36100 $MA_POS_LIMIT_MINUS[AX2]=-500
N36110 $MA_POS_LIMIT_PLUS[AX2]=0.5
N36100 $MA_POS_LIMIT_MINUS[AX3]=0
N36110 $MA_POS_LIMIT_PLUS[AX3]=800
M17
"""

HEIDENHAIN = """;MP of an iTNC 530
MP100.0: -----AZYX
MP730 : %000000010
MP750.0: 0
MP750.1: 0.008
MP910.0: +510
MP910.1: +405
MP910.2: +1
MP910.3: +99999
MP920.0: -10
MP920.1: -5
MP920.2: -400
MP1010.0: 24000
MP1010.1: 24000
MP1010.2: 15000
MP1060.0: 3.5
MP1060.1: 3
MP1060.2: 2
MP1090.0: 40
"""

Limits = tuple[float, float] | None


@dataclass(frozen=True)
class Sample:
    """A file in a format, and what it states by axis; None is not stated."""

    key: str
    name: str
    text: str
    controller: str
    travel_mm: dict[str, Limits]
    velocity_mm_s: tuple[float, float, float]
    acceleration_mm_s2: tuple[float, float, float]
    jerk_mm_s3: tuple[float | None, float | None, float | None] = (None, None, None)
    least_increment_mm: float = 0.001
    compensated: frozenset[str] = frozenset()
    offsets: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def of(x: Limits, y: Limits, z: Limits) -> dict[str, Limits]:
    return {"X": x, "Y": y, "Z": z}


SAMPLES = (
    Sample(
        "linuxcnc", "mill.ini", LINUXCNC, "linuxcnc", of((-1.0, 400.0), (0.0, 200.0), (-150.0, 0.0)),
        (60.0, 60.0, 30.0), (500.0, 500.0, 300.0), least_increment_mm=0.0001,
        notes=("[JOINT_0] BACKLASH = 0.02 mm", "no jerk of X, Y, Z"),
    ),
    Sample(
        "grbl", "settings.txt", GRBL, "grbl", of((-750.0, 0.0), (-730.0, 0.0), (-80.0, 0.0)),
        (100.0, 80.0, 20.0), (200.0, 150.0, 50.0), offsets={"G54": (-700.0, -650.0, -60.5)},
        notes=("run from -travel to 0", "One step of X is 4 um", "no jerk of X, Y, Z"),
    ),
    Sample(
        "grbl", "hal.txt", GRBLHAL, "grbl", of((-600.0, 0.0), (0.0, 400.0), (-120.0, 0.0)),
        (150.0, 150.0, 50.0), (500.0, 500.0, 250.0), (8000.0, 8000.0, 4000.0),
        notes=("$160 = 0.04 mm is compensated",),
    ),
    Sample(
        "klipper", "printer.cfg", KLIPPER, "klipper", of((-5.0, 235.0), (0.0, 240.0), (-2.0, 248.5)),
        (300.0, 300.0, 15.0), (3000.0, 3000.0, 3000.0), offsets={"G54": (0.0, 0.0, 0.0)},
        notes=("[skew_correction bed] corrects squareness", "G54 stands for the bed", "no jerk"),
    ),
    Sample(
        "marlin", "m503.txt", MARLIN, "marlin", of((0.0, 220.0), (-4.0, 225.0), (0.0, 250.0)),
        (500.0, 400.0, 5.0), (500.0, 450.0, 100.0), compensated=frozenset({"C0Y"}),
        offsets={"G54": (0.0, 0.0, 0.0)},
        notes=("M852 corrects C0Y", "M425 X = 0.08 mm", "no jerk"),
    ),
    Sample(
        "sinumerik", "nc.arc", SINUMERIK, "sinumerik", of((-0.6, 1500.6), (0.0, 800.0), (-500.0, 0.5)),
        (500.0, 500.0, 20000 / 60), (3000.0, 2500.0, 2000.0), (40000.0, None, 20000.0),
        least_increment_mm=0.0001, compensated=frozenset({"EYY"}),
        notes=("BACKLASH of X = 0.004 mm", "ENC_COMP_ENABLE of Y corrects EYY", "no jerk of Y:"),
    ),
    Sample(
        "heidenhain", "tnc.mp", HEIDENHAIN, "heidenhain", of((-10.0, 510.0), (-5.0, 405.0), (-400.0, 1.0)),
        (400.0, 400.0, 250.0), (3500.0, 3000.0, 2000.0), least_increment_mm=0.0001,
        notes=("MP750.1 = 0.008 mm", "MP730 switches", "no jerk of X, Y, Z"),
    ),
)  # fmt: skip
