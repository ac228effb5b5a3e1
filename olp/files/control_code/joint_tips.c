/* Axis values of the nominal machine at a programmed tip. The three linear ones state where a tool without
   length would be with all rotary axes at zero; those of the rotary axes stand as they are. */
static void olp_linear_ways(const double value[], const olp_state *state, olp_pose *tool, double ways[3][3])
{
    double shifts[3][OLP_AXES], turns[3][OLP_AXES];
    int i, k;
    olp_tool(value, state, 0, tool);
    olp_slopes(value, state, 0, shifts, turns);
    for (k = 0; k < 3; k++)
        for (i = 0; i < 3; i++) ways[k][i] = shifts[i][olp_linear[k]];
}

static void olp_as_ways(double ways[3][3], const double away[3], double share[3])
{
    double normal[3], volume;
    int k, i;
    for (k = 0; k < 3; k++) {
        olp_cross(ways[(k + 1) % 3], ways[(k + 2) % 3], normal);
        volume = share[k] = 0.0;
        for (i = 0; i < 3; i++) {
            volume += ways[k][i] * normal[i];
            share[k] += away[i] * normal[i];
        }
        share[k] /= volume;
    }
}

static void olp_bare_tool(const olp_state *state, olp_state *bare)
{
    *bare = *state;
    memset(bare->tool_mm, 0, sizeof bare->tool_mm);
}

void olp_axes_of_tip(const double programmed[], const olp_state *state, double value[])
{
    static const double zero[OLP_AXES] = {0.0};
    double ways[3][3], away[3], share[3], still[OLP_AXES];
    olp_pose tool;
    olp_state bare;
    int i, k;
    olp_bare_tool(state, &bare);
    olp_linear_ways(zero, &bare, &tool, ways);
    for (i = 0; i < 3; i++) {
        away[i] = tool.shift[i];
        for (k = 0; k < 3; k++) away[i] += ways[k][i] * programmed[olp_linear[k]];
    }
    for (k = 0; k < OLP_AXES; k++) still[k] = programmed[k];
    for (k = 0; k < 3; k++) still[olp_linear[k]] = 0.0;
    olp_linear_ways(still, state, &tool, ways);
    for (i = 0; i < 3; i++) away[i] -= tool.shift[i];
    olp_as_ways(ways, away, share);
    for (k = 0; k < OLP_AXES; k++) value[k] = still[k];
    for (k = 0; k < 3; k++) value[olp_linear[k]] = share[k];
}

void olp_tip_of_axes(const double value[], const olp_state *state, double programmed[])
{
    static const double zero[OLP_AXES] = {0.0};
    double ways[3][3], away[3], share[3];
    olp_pose tool, origin;
    olp_state bare;
    int i, k;
    olp_tool(value, state, 0, &tool);
    olp_bare_tool(state, &bare);
    olp_linear_ways(zero, &bare, &origin, ways);
    for (i = 0; i < 3; i++) away[i] = tool.shift[i] - origin.shift[i];
    olp_as_ways(ways, away, share);
    for (k = 0; k < OLP_AXES; k++) programmed[k] = value[k];
    for (k = 0; k < 3; k++) programmed[olp_linear[k]] = share[k];
}
