(Exported by FreeCAD)
(Post Processor: grbl_post)
(Output Time: 2024-02-03 11:12:13)
(Begin preamble)
G17 G90
G21
(Begin operation: G54)
G54
(Begin operation: TC: 3mm Endmill)
( M6 T1 )
M3 S10000.000
(Begin operation: Pocket)
G0 Z10.000
G0 X20.000 Y20.000
G0 Z3.000
G1 Z-1.000 F120.000
G1 X60.000 F480.000
G1 Y40.000
G3 X50.000 Y50.000 I-10.000 J0.000
G1 X20.000
G0 Z10.000
M5
G17 G90
M2
