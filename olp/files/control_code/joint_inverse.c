/* From poses to axis values: Newton's method with the slopes of the nominal machine where it starts. The
   position is met; of what meets it the least residual of orientation is taken, and then the least change.
   Near a singular posture a motion of the axes that the orientation alone needs is made smaller. */
#define OLP_WELL 1          /* once more without the directions that hardly move the tool */
#define OLP_MOVES 1e-7      /* a smaller share of the axes' motion does not move the tool */
#define OLP_MOVES_WELL 0.05
#define OLP_REGULAR 1e4     /* the squared least changes of the axes by unit wants are less at a regular posture */
#define OLP_SAME_MM 0.5     /* behind a step below this the slopes stay as they are */
#define OLP_LONGEST_MM 100.0 /* a longer step is made shorter */
#define OLP_SWEEPS 12       /* of Jacobi's method, at most; five suffice */
typedef struct {            /* the sum of size * left * right over three parts; left and right are unit vectors */
    double left[3][3], size[3], right[3][OLP_AXES];
} olp_split;
typedef struct {
    olp_pose target;
    int nominal, held, again, well;
    double beyond[OLP_AXES], turns[3][OLP_AXES], kept[3];
    double held_left[3][3], held_right[3][OLP_AXES];    /* motions that stay as they are, and what they turn */
    olp_split place, rest;
} olp_aim;

/* Singular values of three rows by one-sided rotations (Hestenes). */
static void olp_split_rows(double rows[3][OLP_AXES], olp_split *split)
{
    int sweep, p, q, k, turned = 1;
    memset(split->left, 0, sizeof split->left);
    for (p = 0; p < 3; p++) split->left[p][p] = 1.0;
    for (sweep = 0; turned && sweep < OLP_SWEEPS; sweep++) {
        turned = 0;
        for (p = 0; p < 2; p++)
            for (q = p + 1; q < 3; q++) {
                double pp = 0.0, qq = 0.0, pq = 0.0, zeta, t, c, s;
                for (k = 0; k < OLP_AXES; k++) {
                    pp += rows[p][k] * rows[p][k];
                    qq += rows[q][k] * rows[q][k];
                    pq += rows[p][k] * rows[q][k];
                }
                if (!(fabs(pq) > 1e-15 * sqrt(pp * qq))) continue;
                turned = 1;
                zeta = (qq - pp) / (2.0 * pq);
                t = (zeta < 0.0 ? -1.0 : 1.0) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                c = 1.0 / sqrt(1.0 + t * t);
                s = c * t;
                for (k = 0; k < OLP_AXES; k++) {
                    double one = rows[p][k];
                    rows[p][k] = c * one - s * rows[q][k];
                    rows[q][k] = s * one + c * rows[q][k];
                }
                for (k = 0; k < 3; k++) {
                    double one = split->left[p][k];
                    split->left[p][k] = c * one - s * split->left[q][k];
                    split->left[q][k] = s * one + c * split->left[q][k];
                }
            }
    }
    for (p = 0; p < 3; p++) {
        double squares = 0.0;
        for (k = 0; k < OLP_AXES; k++) squares += rows[p][k] * rows[p][k];
        split->size[p] = sqrt(squares);
        for (k = 0; k < OLP_AXES; k++)
            split->right[p][k] = split->size[p] > 0.0 ? rows[p][k] / split->size[p] : 0.0;
    }
}

/* Adds the least change of the axes whose image is `wanted`; of parts that are not kept, nothing. */
static void olp_least(const olp_split *split, const double kept[3], const double wanted[3], double change[])
{
    int p, k;
    for (p = 0; p < 3; p++) {
        double share = 0.0;
        for (k = 0; k < 3; k++) share += split->left[p][k] * wanted[k];
        if (kept[p] == 0.0) continue;
        for (k = 0; k < OLP_AXES; k++) change[k] += kept[p] * share / split->size[p] * split->right[p][k];
    }
}

static void olp_keep(const olp_split *split, double least, double kept[3])
{
    int p;
    for (p = 0; p < 3; p++) kept[p] = split->size[p] > least ? 1.0 : 0.0;
}

/* mm of the tip and rad times the radius of the tool per scaled mm of each axis; of axes that a correction
   leaves alone nothing, where it is asked for one. */
static void olp_slopes(const double value[], const olp_state *state, int correcting, double shifts[3][OLP_AXES],
                       double turns[3][OLP_AXES])
{
    olp_pose tool, pose = olp_still;
    int j, i;
    olp_tool(value, state, 0, &tool);
    for (j = 0; j < OLP_AXES; j++) {
        const olp_joint *joint = olp_joint_list + j;
        double direction[3], at[3], arm[3], moves[3];
        olp_pose motion;
        olp_turned(&pose, joint->direction, direction);
        olp_point(&pose, joint->point, at);
        for (i = 0; i < 3; i++) arm[i] = tool.shift[i] - at[i];
        olp_cross(direction, arm, moves);
        for (i = 0; i < 3; i++) {
            double free = !correcting || olp_corrects[joint->axis] ? 1.0 : 0.0;
            shifts[i][joint->axis] = free * (joint->turns ? moves[i] / OLP_RADIUS : direction[i]);
            turns[i][joint->axis] = free * (joint->turns ? direction[i] : 0.0);
        }
        olp_nominal_motion(joint, value[joint->axis], &motion);
        olp_then(&pose, &motion, &pose);
    }
    if (OLP_SYMMETRIC)
        for (j = 0; j < OLP_AXES; j++) {
            double turn[3] = {turns[0][j], turns[1][j], turns[2][j]}, across[3];
            olp_turned_back(&tool, turn, across);
            for (i = 0; i < 3; i++) turns[i][j] = i < 2 ? across[i] : 0.0;
        }
}

/* The change of the axes by what is missing, in scaled mm. */
static void olp_step(const olp_aim *aim, const double place[3], const double turn[3], double change[OLP_AXES])
{
    double left[3], kept[3];
    int i, k;
    memset(change, 0, OLP_AXES * sizeof *change);
    olp_keep(&aim->place, OLP_MOVES, kept);
    olp_least(&aim->place, kept, place, change);
    for (i = 0; i < 3; i++) {
        left[i] = turn[i];
        for (k = 0; k < OLP_AXES; k++) left[i] -= aim->turns[i][k] * change[k];
    }
    olp_least(&aim->rest, aim->kept, left, change);
}

/* A row of slopes without what is held. */
static void olp_without(const olp_aim *aim, double row[])
{
    int p, k;
    for (p = 0; p < aim->held; p++) {
        double along = 0.0;
        for (k = 0; k < OLP_AXES; k++) along += row[k] * aim->held_right[p][k];
        for (k = 0; k < OLP_AXES; k++) row[k] -= along * aim->held_right[p][k];
    }
}

/* A turn without what held motions would turn. */
static void olp_unasked(const olp_aim *aim, double turn[3])
{
    int p, k;
    for (p = 0; p < aim->held; p++) {
        double along = 0.0;
        for (k = 0; k < 3; k++) along += turn[k] * aim->held_left[p][k];
        for (k = 0; k < 3; k++) turn[k] -= along * aim->held_left[p][k];
    }
}

/* What is missing to the target: mm of the tip, and rad times the radius as far as it is asked for. */
static void olp_miss(const olp_aim *aim, const double value[], const olp_state *state, double place[3],
                     double turn[3])
{
    olp_pose pose;
    double vector[3];
    int i;
    olp_tool(value, state, !aim->nominal, &pose);
    olp_relative(&aim->target, &pose, vector);
    if (OLP_SYMMETRIC) olp_turned_back(&aim->target, vector, turn);
    for (i = 0; i < 3; i++) {
        place[i] = aim->target.shift[i] - pose.shift[i];
        turn[i] = OLP_SYMMETRIC ? (i < 2 ? turn[i] * OLP_RADIUS : 0.0) : vector[i] * OLP_RADIUS;
    }
    olp_unasked(aim, turn);
}

/* The slopes at `value`, taken apart. */
static void olp_prepare(olp_aim *aim, const double value[], const olp_state *state)
{
    double shifts[3][OLP_AXES], still[3][OLP_AXES], kept[3];
    int i, k;
    olp_slopes(value, state, 1, shifts, aim->turns);
    for (i = 0; i < 3; i++) {
        olp_without(aim, shifts[i]);
        olp_without(aim, aim->turns[i]);
    }
    for (k = 0; k < OLP_AXES; k++) {
        double turn[3] = {aim->turns[0][k], aim->turns[1][k], aim->turns[2][k]};
        olp_unasked(aim, turn);
        for (i = 0; i < 3; i++) aim->turns[i][k] = turn[i];
    }
    olp_split_rows(shifts, &aim->place);
    olp_keep(&aim->place, OLP_MOVES, kept);
    /* of the turns those that keep the tip: without their part along the rows of the shifts */
    for (i = 0; i < 3; i++) {
        int p;
        for (k = 0; k < OLP_AXES; k++) still[i][k] = aim->turns[i][k];
        for (p = 0; p < 3; p++) {
            double along = 0.0;
            for (k = 0; k < OLP_AXES; k++) along += aim->turns[i][k] * aim->place.right[p][k];
            for (k = 0; k < OLP_AXES; k++) still[i][k] -= kept[p] * along * aim->place.right[p][k];
        }
    }
    olp_split_rows(still, &aim->rest);
    olp_keep(&aim->rest, aim->well ? OLP_MOVES_WELL : OLP_MOVES, aim->kept);
}

/* Whether the axes move the tool in all ways that are asked for, and a first step turns none of them far. */
static int olp_regular(const olp_aim *aim, const double change[])
{
    double squares = 0.0, way = 0.0, unit[3], least[OLP_AXES];
    static const double none[3] = {0.0, 0.0, 0.0};
    int i, k, free = 0, asked = OLP_SYMMETRIC ? 5 : 6;
    for (k = 0; k < OLP_AXES; k++) {
        free += olp_corrects[k];
        way += change[k] * change[k];
    }
    if (free != 3 && free != asked) return 0;
    for (i = 0; i < free; i++) {
        for (k = 0; k < 3; k++) unit[k] = k == i % 3 ? 1.0 : 0.0;
        olp_step(aim, i < 3 ? unit : none, i < 3 ? none : unit, least);
        for (k = 0; k < OLP_AXES; k++) squares += least[k] * least[k];
    }
    return squares < OLP_REGULAR && sqrt(way) < OLP_LARGEST_DEG * OLP_RAD * OLP_RADIUS;
}

/* Motions that the orientation needs and that turn an axis by x, more than L, become L^2 / x. */
static void olp_bound_turns(olp_aim *aim, const olp_state *state, double command[])
{
    double place[3], turn[3], change[OLP_AXES], start[OLP_AXES];
    int p, k, held = 0;
    olp_miss(aim, command, state, place, turn);
    olp_step(aim, place, turn, change);
    if (olp_regular(aim, change)) return;
    memset(start, 0, sizeof start);
    for (p = 0; p < 3; p++) {
        double motion[OLP_AXES], share = 0.0, most = 0.0;
        if (aim->kept[p] == 0.0) continue;
        /* the part of the step along this motion, which keeps the tip */
        for (k = 0; k < OLP_AXES; k++) share += change[k] * aim->rest.right[p][k];
        for (k = 0; k < OLP_AXES; k++) {
            motion[k] = share * aim->rest.right[p][k] / olp_unit_mm[k];
            if (olp_turns[k] && fabs(motion[k]) > most) most = fabs(motion[k]);
        }
        if (!(most > OLP_LARGEST_DEG)) continue;
        aim->kept[p] = 0.0;
        memcpy(aim->held_left[held], aim->rest.left[p], sizeof aim->held_left[held]);
        memcpy(aim->held_right[held++], aim->rest.right[p], sizeof aim->held_right[0]);
        for (k = 0; k < OLP_AXES; k++) start[k] += OLP_LARGEST_DEG * OLP_LARGEST_DEG / (most * most) * motion[k];
    }
    for (k = 0; k < OLP_AXES; k++) command[k] += start[k];
    aim->again = aim->held = held;
}

/* Aims at where the nominal tool is at `wanted`; `command` is where to start. Outside of the calibrated box the
   correction at its face acts. */
static void olp_aim_at(olp_aim *aim, const double wanted[], const double correction[], const olp_state *state,
                       int well, double command[])
{
    double inside[OLP_AXES];
    int k;
    memset(aim, 0, sizeof *aim);
    aim->well = well;
    for (k = 0; k < OLP_AXES; k++) {
        inside[k] = olp_within(wanted[k], olp_box[k][0], olp_box[k][1]);
        aim->beyond[k] = wanted[k] - inside[k];
    }
    olp_tool(inside, state, 0, &aim->target);
    olp_prepare(aim, inside, state);
    olp_bound_turns(aim, state, inside);
    for (k = 0; k < OLP_AXES; k++)
        command[k] = inside[k] + aim->beyond[k] + (aim->held || !olp_corrects[k] ? 0.0 : correction[k]);
}

/* What to take from a command, so that the tool comes to its aim. */
static void olp_off(olp_aim *aim, const double command[], const olp_state *state, double off[])
{
    double inside[OLP_AXES], place[3], turn[3], longest = 0.0;
    int k;
    for (k = 0; k < OLP_AXES; k++) inside[k] = command[k] - aim->beyond[k];
    if (aim->again) olp_prepare(aim, inside, state);
    olp_miss(aim, inside, state, place, turn);
    olp_step(aim, place, turn, off);
    for (k = 0; k < OLP_AXES; k++)
        if (fabs(off[k]) > longest) longest = fabs(off[k]);
    for (k = 0; k < OLP_AXES; k++)
        off[k] *= -(longest > OLP_LONGEST_MM ? OLP_LONGEST_MM / longest : 1.0) / olp_unit_mm[k];
    aim->again = longest > OLP_SAME_MM;
}

/* Axis values of the nominal machine that bring the tool to `target`, from `value` on. */
int olp_nominal_values(const olp_pose *target, const olp_state *state, double value[])
{
    double off[OLP_AXES];
    olp_aim aim;
    int step, k;
    memset(&aim, 0, sizeof aim);
    aim.target = *target;
    aim.nominal = 1;
    olp_prepare(&aim, value, state);
    for (step = 0; step < OLP_STEPS; step++) {
        double largest = 0.0;
        olp_off(&aim, value, state, off);
        for (k = 0; k < OLP_AXES; k++) {
            value[k] -= off[k];
            if (!(fabs(off[k]) * olp_unit_mm[k] <= largest)) largest = fabs(off[k]) * olp_unit_mm[k];
        }
        if (largest < OLP_CLOSE) return 1;
    }
    return 0;
}

/* The axis values that stand for where the tool is. */
static int olp_stands_for(const double command[], const olp_state *state, double wanted[])
{
    double beyond[OLP_AXES];
    olp_pose tool;
    int k, solved;
    for (k = 0; k < OLP_AXES; k++) {
        wanted[k] = olp_within(command[k], olp_box[k][0], olp_box[k][1]);
        beyond[k] = command[k] - wanted[k];
    }
    olp_tool(wanted, state, 1, &tool);
    solved = olp_nominal_values(&tool, state, wanted);
    for (k = 0; k < OLP_AXES; k++) wanted[k] += beyond[k];
    return solved;
}

static void olp_backlash_at(const double command[], double backlash[])
{
    int j;
    for (j = 0; j < OLP_AXES; j++) {
        const olp_joint *joint = olp_joint_list + j;
        backlash[joint->axis] = joint->turns ? joint->backlash / OLP_RAD : joint->backlash;
    }
    (void)command;
}
