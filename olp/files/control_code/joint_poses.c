/* Poses as programs of arms state them: X, Y and Z of the tip in the workpiece in mm, and A, B and C of the tool in
   deg, about fixed axes: Rz(C) Ry(B) Rx(A). The joints go on from `value`; 0 where they do not come there. */
#define OLP_POSES 1
int olp_axes_of_pose(const double programmed[6], const olp_state *state, double value[])
{
    double angle[3];
    olp_pose target;
    int i;
    for (i = 0; i < 3; i++) angle[i] = programmed[3 + i] * OLP_RAD;
    olp_tilted(angle, 0, &target);
    for (i = 0; i < 3; i++) target.shift[i] = programmed[i];
    return olp_nominal_values(&target, state, value);
}

void olp_pose_of_axes(const double value[], const olp_state *state, double programmed[6])
{
    olp_pose tool;
    double level, angle[3];
    int i;
    olp_tool(value, state, 0, &tool);
    level = sqrt(tool.turn[0][0] * tool.turn[0][0] + tool.turn[1][0] * tool.turn[1][0]);
    angle[1] = atan2(-tool.turn[2][0], level);
    /* where B is at a right angle, A and C turn about one axis */
    angle[0] = level > 1e-9 ? atan2(tool.turn[2][1], tool.turn[2][2]) : atan2(-tool.turn[1][2], tool.turn[1][1]);
    angle[2] = level > 1e-9 ? atan2(tool.turn[1][0], tool.turn[0][0]) : 0.0;
    for (i = 0; i < 3; i++) {
        programmed[i] = tool.shift[i];
        programmed[3 + i] = angle[i] / OLP_RAD;
    }
}
