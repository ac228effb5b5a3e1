/* The inverse at servo rate. A load follows its drive through the backlash: it rests while the drive crosses
   it. So the side of the backlash is that of the next motion of the load, and a drive that turns crosses its
   backlash within that tick. It does so only where the load would be off by more than the band. */
#define OLP_STEPS 12        /* of the iteration, at most; each makes the error a thousandth */
#define OLP_CLOSE 1e-9      /* mm; an iteration that moves less has ended */
#define OLP_SETTLED 4       /* steps behind which no axis changes its side: two that turn could do so for ever */
#define OLP_GENTLE 4.0      /* times the largest correction in the time of the ramp */
typedef struct {
    double most_mm;         /* the largest correction of an axis */
    double rate_mm_s;       /* by which it changes at most */
    double ramp_s;          /* in which it is switched on and off */
    double band_mm;         /* by which a load may be off before its drive turns */
    int on;
} olp_limits;
typedef struct {
    int known, limited, unsolved, steps;
    double command[3], play[3], backlash[3], correction[3], share;
} olp_follower;

static void olp_backlash_at(const double command[3], double backlash[3])
{
    int b;
    for (b = 0; b < OLP_BODIES; b++) {
        const olp_body *body = olp_body_list + b;
        int j = body->axis;
        backlash[j] = olp_backlash(body, olp_within(command[j], olp_box[j][0], olp_box[j][1]));
    }
}

/* The command that brings the tip to `wanted` from where the follower is; 0 where the steps do not suffice. */
static int olp_solve(const olp_follower *from, olp_state *state, const double wanted[3], double band,
                     double command[3], int *steps)
{
    double error[3], backlash[3];
    int j, rests[3] = {0, 0, 0};
    for (j = 0; j < 3; j++) {
        state->play[j] = from->known ? from->play[j] : 0.0;
        command[j] = wanted[j] + (from->known ? from->correction[j] : 0.0);
    }
    for (*steps = 1; *steps <= OLP_STEPS; ++*steps) {
        double largest = 0.0;
        olp_error(command, state, error);
        olp_backlash_at(command, backlash);
        for (j = 0; j < 3; j++) {
            double lost = 0.5 * backlash[j] * state->play[j], load = wanted[j] - (error[j] + lost), next, size;
            if (olp_directed[j] && from->known && *steps <= OLP_SETTLED) {
                double was = from->play[j], ahead = load - from->command[j] + 0.5 * from->backlash[j] * was;
                int plus = ahead > (was >= 1.0 ? 0.0 : band), minus = ahead < (was <= -1.0 ? 0.0 : -band);
                rests[j] = !plus && !minus;
                state->play[j] = plus ? 1.0 : minus ? -1.0 : was;
            }
            next = rests[j] ? from->command[j] : load + 0.5 * backlash[j] * state->play[j];
            size = fabs(next - command[j]);
            if (!(size <= largest)) largest = size;
            command[j] = next;
        }
        if (largest < OLP_CLOSE) return 1;
    }
    *steps = OLP_STEPS;
    return 0;
}

/* The play of each axis behind a motion of the drives to `command`. */
static void olp_moved(olp_follower *follower, const double command[3])
{
    double backlash[3];
    int j;
    olp_backlash_at(command, backlash);
    for (j = 0; j < 3; j++) {
        double motion = command[j] - follower->command[j], play = follower->play[j];
        if (follower->known && backlash[j] > 0.0) {
            if (follower->backlash[j] > 0.0) play *= follower->backlash[j] / backlash[j];
            play = olp_within(play + 2.0 * motion / backlash[j], -1.0, 1.0);
        } else if (follower->known && motion != 0.0) {
            play = motion > 0.0 ? 1.0 : -1.0;
        }
        follower->play[j] = follower->known ? play : 0.0;
        follower->command[j] = command[j];
        follower->backlash[j] = backlash[j];
    }
    follower->known = 1;
}

/* Switches by and by: once a tick. */
void olp_switch(olp_follower *follower, const olp_limits *limits, double tick_s)
{
    double step = limits->ramp_s > tick_s ? tick_s / limits->ramp_s : 1.0;
    double share = follower->share + (limits->on ? step : -step);
    follower->share = olp_within(share, 0.0, 1.0);
}

/* The bounded command for `wanted`; `tick_s` 0: as far as the correction goes, whatever its rate. Does not
   change the follower but for what it says of the bounds. */
static void olp_bounded(olp_follower *follower, const olp_limits *limits, const olp_state *now,
                        const double wanted[3], double tick_s, double command[3])
{
    olp_state state = *now;
    int j;
    follower->unsolved = !olp_solve(follower, &state, wanted, limits->band_mm, command, &follower->steps);
    follower->limited = 0;
    for (j = 0; j < 3; j++) {
        double whole = follower->share * (command[j] - wanted[j]);
        double held = olp_within(whole, -limits->most_mm, limits->most_mm);
        if (follower->known && tick_s > 0.0) {
            double step = limits->rate_mm_s * tick_s, before = follower->correction[j];
            double gentle = OLP_GENTLE * limits->most_mm * tick_s;
            /* while it is switched, a drive crosses its backlash by and by too */
            if (follower->share > 0.0 && follower->share < 1.0 && gentle < step * limits->ramp_s)
                step = gentle / limits->ramp_s;
            held = olp_within(held, before - step, before + step);
        }
        if (!(held == held)) held = 0.0;
        if (held != whole) follower->limited = 1;
        if (held != whole || follower->share < 1.0) command[j] = wanted[j] + held;
    }
}

/* One tick: the command for the next wanted axis position. */
void olp_follow(olp_follower *follower, const olp_limits *limits, const olp_state *now, const double wanted[3],
                double tick_s, double command[3])
{
    int j;
    olp_bounded(follower, limits, now, wanted, tick_s, command);
    olp_moved(follower, command);
    for (j = 0; j < 3; j++) follower->correction[j] = command[j] - wanted[j];
}

/* Where drives are that something else moves, and what axis position that is: the inverse of `olp_follow`. */
void olp_forward(const olp_follower *follower, const olp_state *now, const double command[3], double wanted[3])
{
    olp_state state = *now;
    double error[3];
    int j;
    for (j = 0; j < 3; j++) state.play[j] = follower->play[j];
    olp_error(command, &state, error);
    for (j = 0; j < 3; j++) wanted[j] = command[j] + follower->share * error[j];
}

void olp_led(olp_follower *follower, const olp_state *now, const double command[3])
{
    double wanted[3];
    int j;
    olp_moved(follower, command);
    olp_forward(follower, now, command, wanted);
    for (j = 0; j < 3; j++) follower->correction[j] = command[j] - wanted[j];
}
