/* What a model needs beside axis values: tool vector (gauge point to tip, in the gauge frame), payload with its
   centre from the gauge point, and the play of each axis: +1 where it last moved in + and has taken up its
   backlash, -1 in -, 0 unknown. */
typedef struct {
    double tool_mm[3], payload_kg, payload_centre_mm[3], play[OLP_AXES];
} olp_state;
#define OLP_RAD 0.017453292519943295

static void olp_turned(const olp_pose *pose, const double v[3], double out[3])
{
    int i;
    for (i = 0; i < 3; i++)
        out[i] = pose->turn[i][0] * v[0] + pose->turn[i][1] * v[1] + pose->turn[i][2] * v[2];
}

static void olp_turned_back(const olp_pose *pose, const double v[3], double out[3])
{
    int i;
    for (i = 0; i < 3; i++)
        out[i] = pose->turn[0][i] * v[0] + pose->turn[1][i] * v[1] + pose->turn[2][i] * v[2];
}

static void olp_point(const olp_pose *pose, const double point[3], double out[3])
{
    int i;
    olp_turned(pose, point, out);
    for (i = 0; i < 3; i++) out[i] += pose->shift[i];
}

/* First `b`, then `a`; the result may be one of them. */
static void olp_then(const olp_pose *a, const olp_pose *b, olp_pose *result)
{
    olp_pose c;
    int i, k;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++)
            c.turn[i][k] = a->turn[i][0] * b->turn[0][k] + a->turn[i][1] * b->turn[1][k]
                + a->turn[i][2] * b->turn[2][k];
    olp_point(a, b->shift, c.shift);
    *result = c;
}

static void olp_back(const olp_pose *pose, olp_pose *result)
{
    olp_pose c;
    int i, k;
    olp_turned_back(pose, pose->shift, c.shift);
    for (i = 0; i < 3; i++) {
        c.shift[i] = -c.shift[i];
        for (k = 0; k < 3; k++) c.turn[i][k] = pose->turn[k][i];
    }
    *result = c;
}

static void olp_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static const olp_pose olp_still = {{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}, {0.0, 0.0, 0.0}};

/* The rotation about a unit vector (Rodrigues). */
static void olp_turn_about(const double d[3], double angle, olp_pose *pose)
{
    /* 1 - cos, without cancelling at small angles */
    double sine = sin(angle), half = sin(0.5 * angle), versine = 2.0 * half * half;
    int i, k;
    *pose = olp_still;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++) pose->turn[i][k] += versine * (d[i] * d[k] - (i == k ? 1.0 : 0.0));
    for (i = 0; i < 3; i++) {
        pose->turn[(i + 2) % 3][(i + 1) % 3] += sine * d[i];
        pose->turn[(i + 1) % 3][(i + 2) % 3] -= sine * d[i];
    }
}

/* Rotations by A, B, C of fixed axes: Rz Ry Rx; `reverse` gives Rx Ry Rz. */
static void olp_tilted(const double angle[3], int reverse, olp_pose *pose)
{
    double sx, sy, sz, cx, cy, cz;
    *pose = olp_still;
    if (angle[0] == 0.0 && angle[1] == 0.0 && angle[2] == 0.0) return;
    sx = sin(angle[0]);
    sy = sin(angle[1]);
    sz = sin(angle[2]);
    cx = cos(angle[0]);
    cy = cos(angle[1]);
    cz = cos(angle[2]);
    if (reverse) {
        double turn[3][3] = {{cy * cz, -cy * sz, sy},
                             {cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy},
                             {sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy}};
        memcpy(pose->turn, turn, sizeof turn);
    } else {
        double turn[3][3] = {{cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx},
                             {sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx},
                             {-sy, cy * sx, cy * cx}};
        memcpy(pose->turn, turn, sizeof turn);
    }
}

/* A rotation about a point, then a shift. */
static void olp_about(const double point[3], const double offset[3], olp_pose *turn)
{
    double there[3];
    int i;
    olp_turned(turn, point, there);
    for (i = 0; i < 3; i++) turn->shift[i] = point[i] - there[i] + offset[i];
}

static void olp_nominal_motion(const olp_joint *joint, double value, olp_pose *motion)
{
    int i;
    *motion = olp_still;
    if (joint->turns) {
        olp_turn_about(joint->direction, value * OLP_RAD, motion);
        olp_about(joint->point, olp_still.shift, motion);
    } else {
        for (i = 0; i < 3; i++) motion->shift[i] = joint->direction[i] * value;
    }
}

/* What a joint gives way under the weights that it carries. */
typedef struct {
    double own, tilt[3], give[3];
} olp_gives;

static void olp_error_body(const olp_joint *joint, const double point[3], int follows, const double motions[7],
                           double value, olp_pose *body)
{
    double at[3], moved[3];
    int i;
    for (i = 0; i < 3; i++) {
        at[i] = point[i] + (follows ? joint->direction[i] * value : 0.0);
        moved[i] = motions[i] + (joint->turns ? 0.0 : joint->direction[i] * motions[6]);
    }
    olp_tilted(motions + 3, joint->on_workpiece, body);
    olp_about(at, moved, body);
}

/* All error motions that are stated of a joint, and its own angle. */
static void olp_stated(const olp_joint *joint, double value, olp_pose *stated, double *own)
{
    int m, w, d;
    *stated = olp_still;
    for (m = 0; m < joint->motions + (joint->harmonics > 0); m++) {
        double motions[7] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
        olp_pose body;
        if (m < joint->motions) {
            const olp_motion *motion = joint->motion + m;
            double q = value;
            if (motion->periodic) {
                q = fmod(value - motion->low, 360.0);
                q = motion->low + (q < 0.0 ? q + 360.0 : q);
            }
            for (d = 0; d < 7; d++)
                if (motion->column[d]) motions[d] = olp_curve_at(motion->column[d], q);
            olp_error_body(joint, motion->point, motion->follows, motions, value, &body);
        } else {
            for (w = 0; w < joint->harmonics; w++) {
                const olp_harmonic *wave = joint->harmonic + w;
                motions[wave->component] += wave->amplitude * sin(value * wave->factor + wave->phase);
            }
            olp_error_body(joint, joint->wave_point, joint->follows, motions, value, &body);
        }
        if (joint->turns) *own += motions[6];
        if (joint->on_workpiece) olp_then(&body, stated, stated); else olp_then(stated, &body, stated);
    }
}

static void olp_actual_motion(const olp_joint *joint, double value, double play, const olp_gives *gives,
                              olp_pose *motion)
{
    olp_pose stated, yielded, line = olp_still;
    double own = gives->own - 0.5 * joint->backlash * play;
    int i;
    olp_stated(joint, value, &stated, &own);
    olp_tilted(gives->tilt, joint->on_workpiece, &yielded);
    olp_about(joint->point, gives->give, &yielded);
    if (joint->turns) {
        double point[3];
        for (i = 0; i < 3; i++) point[i] = joint->point[i] + joint->shift[i];
        olp_turn_about(joint->line, value * OLP_RAD + joint->zero + own, &line);
        olp_about(point, olp_still.shift, &line);
    } else {
        for (i = 0; i < 3; i++)
            line.shift[i] = joint->direction[i] * (value + joint->zero + own)
                + joint->across[i] * (value - joint->datum);
    }
    {
        /* tool side: E Y R and V E Y; workpiece side: R Y E and Y E V */
        const olp_pose *part[3] = {joint->turns ? &stated : &line, joint->turns ? &yielded : &stated,
                                   joint->turns ? &line : &yielded};
        olp_then(part[joint->on_workpiece ? 2 : 0], part[1], motion);
        olp_then(motion, part[joint->on_workpiece ? 0 : 2], motion);
    }
}

/* The weights on the joints from `from` on outward, in the frame: force, and torque about `point`. */
static void olp_weights(const double kg[], double centre[][3], int from, int last, int step,
                        const double point[3], double force[3], double torque[3])
{
    int k, i;
    for (i = 0; i < 3; i++) force[i] = torque[i] = 0.0;
    for (k = 0; k < OLP_MASSES + 1; k++) {
        int on = k < OLP_MASSES ? olp_mass_list[k].joint : OLP_AXES - 1;
        double arm[3], pull[3], turn[3];
        if (kg[k] == 0.0 || (on - from) * step < 0 || (last - on) * step < 0) continue;
        for (i = 0; i < 3; i++) {
            arm[i] = centre[k][i] - point[i];
            pull[i] = olp_gravity[i] * kg[k];
            force[i] += pull[i];
        }
        olp_cross(arm, pull, turn);
        for (i = 0; i < 3; i++) torque[i] += turn[i] / 1e3;
    }
}

/* What each joint gives way at the nominal posture: by sums of angles, and under stated weights. */
static void olp_yields(const double value[], const olp_pose motions[], const olp_state *state, olp_gives gives[])
{
    olp_pose body[OLP_AXES];
    double kg[OLP_MASSES + 1], centre[OLP_MASSES + 1][3];
    int side, k, i;
    memset(gives, 0, OLP_AXES * sizeof *gives);
    for (k = 0; k < OLP_SAGS; k++) {
        double turn = 0.0;
        for (i = 0; i < OLP_AXES; i++) turn += olp_sag_list[k].turn[i] * value[i];
        gives[olp_sag_list[k].joint].own += olp_sag_list[k].sine * sin(turn) + olp_sag_list[k].cosine * cos(turn);
    }
    if (!OLP_YIELDS) return;
    for (k = 0; k < OLP_MASSES; k++) kg[k] = olp_mass_list[k].kg;
    kg[OLP_MASSES] = OLP_FRAME < OLP_AXES ? state->payload_kg : 0.0;
    for (side = 0; side < 2; side++) {
        int step = side ? 1 : -1, first = side ? OLP_FRAME : OLP_FRAME - 1, last = side ? OLP_AXES - 1 : 0;
        olp_pose pose = olp_still;
        for (k = first; (last - k) * step >= 0; k += step) {
            olp_pose motion = motions[k];
            if (!side) olp_back(&motion, &motion);
            olp_then(&pose, &motion, &pose);
            body[k] = pose;
        }
    }
    for (k = 0; k < OLP_MASSES; k++) olp_point(body + olp_mass_list[k].joint, olp_mass_list[k].centre, centre[k]);
    if (kg[OLP_MASSES] != 0.0) {
        olp_pose held;
        olp_then(body + OLP_AXES - 1, &olp_gauge, &held);
        olp_point(&held, state->payload_centre_mm, centre[OLP_MASSES]);
    }
    for (side = 0; side < 2; side++) {
        int step = side ? 1 : -1, first = side ? OLP_FRAME : OLP_FRAME - 1, last = side ? OLP_AXES - 1 : 0;
        for (k = first; (last - k) * step >= 0; k += step) {
            const olp_joint *joint = olp_joint_list + k;
            const olp_pose *stator = k == first ? &olp_still : body + (k - step);
            double point[3], pull[3], force[3], turn[3], torque[3], along = 0.0;
            olp_point(joint->turns ? stator : body + k, joint->point, point);
            olp_weights(kg, centre, k, last, step, point, pull, turn);
            olp_turned_back(stator, pull, force);
            olp_turned_back(stator, turn, torque);
            for (i = 0; i < 3; i++) {
                force[i] *= step;
                torque[i] *= step;
                along += (joint->turns ? torque[i] : force[i]) * joint->direction[i];
                gives[k].tilt[i] = joint->tilt[i] * torque[i];
                gives[k].give[i] = joint->give[i] * force[i];
            }
            gives[k].own += joint->own * along;
        }
    }
}

/* The pose of the tool in workpiece coordinates at axis values in mm and deg, with all errors or nominal. */
void olp_tool(const double value[], const olp_state *state, int actual, olp_pose *tool)
{
    olp_pose motion[OLP_AXES], tip = olp_still;
    int j, i;
    for (j = 0; j < OLP_AXES; j++)
        olp_nominal_motion(olp_joint_list + j, value[olp_joint_list[j].axis], motion + j);
    if (actual) {
        olp_gives gives[OLP_AXES];
        olp_yields(value, motion, state, gives);
        for (j = 0; j < OLP_AXES; j++) {
            const olp_joint *joint = olp_joint_list + j;
            olp_actual_motion(joint, value[joint->axis], state->play[joint->axis], gives + j, motion + j);
        }
    }
    *tool = olp_still;
    for (j = 0; j < OLP_AXES; j++) olp_then(tool, motion + j, tool);
    if (actual) olp_then(tool, &olp_gauge_error, tool);
    olp_then(tool, &olp_gauge, tool);
    for (i = 0; i < 3; i++) tip.shift[i] = state->tool_mm[i];
    olp_then(tool, &tip, tool);
}

/* The rotation vector from `other` to `pose`, which are less than half a turn apart. */
static void olp_relative(const olp_pose *pose, const olp_pose *other, double vector[3])
{
    double turn[3][3], sine, factor;
    int i, k;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++)
            turn[i][k] = pose->turn[i][0] * other->turn[k][0] + pose->turn[i][1] * other->turn[k][1]
                + pose->turn[i][2] * other->turn[k][2];
    for (i = 0; i < 3; i++) vector[i] = 0.5 * (turn[(i + 2) % 3][(i + 1) % 3] - turn[(i + 1) % 3][(i + 2) % 3]);
    sine = sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
    factor = sine < 1e-5 ? 1.0 + sine * sine / 6.0
        : atan2(sine, 0.5 * (turn[0][0] + turn[1][1] + turn[2][2] - 1.0)) / sine;
    for (i = 0; i < 3; i++) vector[i] *= factor;
}

/* actual - nominal of the tool in workpiece coordinates: mm of the tip, and a rotation vector in rad. */
void olp_error(const double value[], const olp_state *state, double error[6])
{
    olp_pose nominal, actual;
    int i;
    olp_tool(value, state, 0, &nominal);
    olp_tool(value, state, 1, &actual);
    for (i = 0; i < 3; i++) error[i] = actual.shift[i] - nominal.shift[i];
    olp_relative(&actual, &nominal, error + 3);
}

int olp_outside(const double value[])
{
    int j;
    for (j = 0; j < OLP_AXES; j++)
        if (!(value[j] >= olp_box[j][0] && value[j] <= olp_box[j][1])) return 1;
    return 0;
}
