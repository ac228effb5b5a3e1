;Fusion 360 CAM 2.0.17457
; Posts processor: MPCNC.cps
; Gcode generated: Friday, February 2, 2024 10:11:12 AM GMT
; Document: plate v4
; Ranges table:
; X: Min=-3 Max=203 Size=206
; *** START begin ***
G90
G21
M84 S0
G92 X0 Y0 Z0
; *** START end ***
; *** SECTION begin ***
; 2D Contour1
G0 Z15 F300
;Move X & Y to start
G0 X103.5 Y-3 F2500
G0 Z5 F300
G1 Z1 F300
G1 Z-2 F200
G1 X203 Y-3 F800
G1 X203 Y53
G3 X153 Y103 I-50 J0 F800
G1 X-3 Y103
G1 X-3 Y-3
G1 X103.5 Y-3
G0 Z15 F300
; *** STOP begin ***
M400
M5
G0 X0 Y0 F2500
; *** STOP end ***
