/* What a model needs beside the position of the axes: tool vector (gauge point to tip), payload, temperatures,
   and the play of each axis: +1 where it last moved in + and has taken up its backlash, -1 in -, 0 unknown. */
#define OLP_AXES 3
typedef struct {
    double tool_mm[3], payload_kg, temperature_degC[OLP_SENSORS + 1], play[OLP_AXES];
} olp_state;

/* The components of one axis. A curve is a chain of short chords, as in the model that corrects programs. */
static void olp_components(const olp_body *body, double q, double play, double six[6])
{
    double from = 0.0, to = 0.0, share = 0.0;
    int d, w, r;
    if (body->knots) {
        double at = olp_within(q, body->knot[0], body->knot[body->knots - 1]);
        int k = olp_cell(body->knots, body->knot, at), pieces = body->pieces[k];
        double a = body->knot[k], width = body->knot[k + 1] - a, u = (at - a) / width * pieces;
        int i = (int)u;
        if (i > pieces - 1) i = pieces - 1;
        share = u - i;
        from = a + width * i / pieces;
        to = i + 1 == pieces ? body->knot[k + 1] : a + width * (i + 1) / pieces;
    }
    for (d = 0; d < 6; d++) {
        const olp_curve *mean = body->mean[d], *half = body->half[d];
        six[d] = 0.0;
        if (mean) {
            double value = olp_curve_at(mean, from);
            six[d] += value + share * (olp_curve_at(mean, to) - value);
        }
        if (half && play != 0.0) {
            double value = olp_curve_at(half, from);
            six[d] += play * (value + share * (olp_curve_at(half, to) - value));
        }
    }
    six[body->axis] -= 0.5 * body->backlash * play;
    for (w = 0; w < body->waves; w++) {
        const olp_wave *wave = body->wave + w;
        double value = wave->amplitude * sin(q * wave->factor + wave->phase);
        six[wave->component] += value;
        for (r = 0; r < wave->rows; r++)
            six[wave->row[r]] += value * (wave->constant[r] + wave->by_position[r] * q);
    }
}

/* The backlash of an axis at a position; less than nothing never gets here. */
static double olp_backlash(const olp_body *body, double q)
{
    olp_body directed = *body;
    double six[6];
    int d;
    if (!body->half[body->axis]) return body->backlash;
    directed.backlash = 0.0;
    directed.waves = 0;
    for (d = 0; d < 6; d++) {
        directed.mean[d] = 0;
        if (d != body->axis) directed.half[d] = 0;
    }
    olp_components(&directed, q, 1.0, six);
    return -2.0 * six[body->axis];
}

static void olp_turn(const olp_body *body, const double angle[3], const double arm[3], double turned[3])
{
    static const int plane[3][2] = {{1, 2}, {2, 0}, {0, 1}};
    double moved[3] = {0.0, 0.0, 0.0}, now[3];
    int i;
    for (i = 0; i < 3; i++) now[i] = arm[i];
    for (i = 0; i < 3; i++) {
        int a = body->carries_workpiece ? 2 - i : i, p = plane[a][0], q = plane[a][1];
        double sine = angle[a], half, back, ahead;
        if (sine == 0.0) continue;
        if (body->terms == 2) sine -= sine * sine * sine * (1.0 / 6.0);
        half = 0.5 * sine;
        if (body->terms == 0) {
            half = tan(0.5 * sine);
            sine = sin(sine);
        }
        back = (half * now[p] + now[q]) * sine;
        ahead = (now[p] - half * now[q]) * sine;
        moved[p] -= back;
        moved[q] += ahead;
        now[p] -= back;
        now[q] += ahead;
    }
    for (i = 0; i < 3; i++) turned[i] = moved[i];
}

static void olp_lever(const olp_arm *arm, const double position[3], const double tool[3], double lever[3])
{
    int k;
    for (k = 0; k < 3; k++) lever[k] = arm->moves[k] * position[k] + (tool[k] - arm->offset[k]);
}

/* Row i of angle x arm. */
static double olp_cross(int i, const double angle[3], const double arm[3])
{
    int p = (i + 1) % 3, q = (i + 2) % 3;
    return angle[p] * arm[q] - angle[q] * arm[p];
}

static void olp_grid_at(const olp_grid *grid, const double position[3], double *column)
{
    double weight[3][4];
    int first[3], window[3], a, w, c, i, j, k, size[3];
    for (a = 0; a < 3; a++) {
        first[a] = 0;
        window[a] = size[a] = 1;
        weight[a][0] = 1.0;
        if (a < grid->arguments) {
            const olp_line *line = grid->line[a];
            double q = position[grid->axis[a]], t = 0.0;
            int cell = 0, power;
            size[a] = line->knots;
            window[a] = line->window;
            if (line->knots > 1) {
                cell = olp_cell(line->knots, line->knot, q);
                t = (q - line->knot[cell]) / (line->knot[cell + 1] - line->knot[cell]);
                t = olp_within(t, 0.0, 1.0);
            }
            first[a] = line->first[cell];
            for (w = 0; w < line->window; w++) {
                const double *of_cell = line->weight + (cell * line->powers) * line->window + w;
                double value = of_cell[(line->powers - 1) * line->window];
                for (power = line->powers - 2; power >= 0; power--)
                    value = value * t + of_cell[power * line->window];
                weight[a][w] = value;
            }
        }
    }
    for (c = 0; c < grid->columns; c++) column[c] = 0.0;
    for (i = 0; i < window[0]; i++)
        for (j = 0; j < window[1]; j++)
            for (k = 0; k < window[2]; k++) {
                const double *node = grid->value + grid->columns * (((first[0] + i) * size[1] + first[1] + j)
                    * size[2] + first[2] + k);
                double of_node = weight[0][i] * weight[1][j] * weight[2][k];
                for (c = 0; c < grid->columns; c++) column[c] += of_node * node[c];
            }
}

/* The bodies of the chain, from tool to workpiece: their exact product, or to first order. */
static void olp_bodies_error(const double position[3], const olp_state *state, double error[3])
{
    static const double no_tool[3] = {0.0, 0.0, 0.0};
    const double *tool = OLP_TOOL_TERMS ? state->tool_mm : no_tool;
    int b, i;
    for (b = 0; b < OLP_BODIES; b++) {
        const olp_body *body = olp_body_list + b;
        double q = position[body->axis], six[6], carried[3], turned[3], arm[3];
        olp_components(body, q, state->play[body->axis], six);
        for (i = 0; i < 3; i++)
            carried[i] = error[i] + (body->carries_workpiece ? body->shear[i] * (q - body->datum) : 0.0);
        for (i = 0; i < 3; i++) {
            olp_lever(body->arm + i, position, tool, arm);
            if (OLP_EXACT) {
                double moved[3];
                int k;
                for (k = 0; k < 3; k++) arm[k] += carried[k];
                olp_turn(body, six + 3, arm, moved);
                turned[i] = moved[i];
            } else {
                turned[i] = olp_cross(i, six + 3, arm);
            }
        }
        for (i = 0; i < 3; i++) error[i] += six[i] + body->shear[i] * (q - body->datum) + turned[i];
    }
}

static void olp_tables_error(const double position[3], const olp_state *state, double error[3])
{
    static const double no_tool[3] = {0.0, 0.0, 0.0};
    const double *tool = OLP_TOOL_TERMS ? state->tool_mm : no_tool;
    int t, d, i;
    for (t = 0; t < OLP_TABLES; t++) {
        const olp_table *table = olp_table_list + t;
        double column[6], six[6], arm[3], weight = state->payload_kg - table->zero;
        if (table->sensor >= 0)
            weight = olp_within(state->temperature_degC[table->sensor], table->low, table->high) - table->zero;
        if (weight == 0.0) continue;
        olp_grid_at(table->grid, position, column);
        for (d = 0; d < 6; d++) six[d] = table->column[d] < 0 ? 0.0 : weight * column[table->column[d]];
        for (i = 0; i < 3; i++) {
            olp_lever(table->arm + i, position, tool, arm);
            error[i] += six[i] + olp_cross(i, six + 3, arm);
        }
    }
}

/* error = actual - commanded of the tip against the workpiece, at axis positions; outside of the calibrated box
   that at its face. */
void olp_error(const double axis_mm[3], const olp_state *state, double error[3])
{
    double position[3], column[3];
    int i, m;
    for (i = 0; i < 3; i++) {
        position[i] = olp_within(axis_mm[i], olp_box[i][0], olp_box[i][1]);
        error[i] = 0.0;
    }
    olp_bodies_error(position, state, error);
    olp_tables_error(position, state, error);
    for (m = 0; m < OLP_MAPS; m++) {
        olp_grid_at(olp_map_list[m], position, column);
        for (i = 0; i < 3; i++) error[i] += column[i];
    }
    for (m = 0; m < OLP_EXPANSIONS; m++) {
        const olp_expansion *expansion = olp_expansion_list + m;
        double at = position[expansion->axis] + (expansion->of_tip ? state->tool_mm[expansion->axis] : 0.0);
        double rise = state->temperature_degC[expansion->sensor] - expansion->zero_degC;
        error[expansion->axis] += expansion->per_K * rise * (at - expansion->fixed);
    }
}

int olp_outside(const double axis_mm[3])
{
    int i;
    for (i = 0; i < 3; i++)
        if (!(axis_mm[i] >= olp_box[i][0] && axis_mm[i] <= olp_box[i][1])) return 1;
    return 0;
}

/* What the follower asks of a model: its aim, by how much a command is off it, and the play of its axes. */
#define OLP_WELL 0
static const int olp_turns[OLP_AXES] = {0, 0, 0};
static const double olp_unit_mm[OLP_AXES] = {1.0, 1.0, 1.0};
typedef struct {
    double wanted[OLP_AXES];
} olp_aim;

static void olp_aim_at(olp_aim *aim, const double wanted[], const double correction[], const olp_state *state,
                       int well, double command[])
{
    int j;
    for (j = 0; j < OLP_AXES; j++) {
        aim->wanted[j] = wanted[j];
        command[j] = wanted[j] + correction[j];
    }
    (void)state;
    (void)well;
}

/* What to take from a command, so that the tip comes to its aim. */
static void olp_off(olp_aim *aim, const double command[], const olp_state *state, double off[])
{
    int j;
    olp_error(command, state, off);
    for (j = 0; j < OLP_AXES; j++) off[j] += command[j] - aim->wanted[j];
}

/* The axis values that stand for where the tip is. */
static int olp_stands_for(const double command[], const olp_state *state, double wanted[])
{
    int j;
    olp_error(command, state, wanted);
    for (j = 0; j < OLP_AXES; j++) wanted[j] += command[j];
    return 1;
}

static void olp_backlash_at(const double command[3], double backlash[3])
{
    int b;
    for (b = 0; b < OLP_BODIES; b++) {
        const olp_body *body = olp_body_list + b;
        int j = body->axis;
        backlash[j] = olp_backlash(body, olp_within(command[j], olp_box[j][0], olp_box[j][1]));
    }
}
