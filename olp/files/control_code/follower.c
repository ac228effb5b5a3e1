/* The inverse at servo rate. A load follows its drive through the backlash: it rests while the drive crosses
   it. So the side of the backlash is that of the next motion of the load, and a drive that turns crosses its
   backlash within that tick. It does so only where the load would be off by more than the band. */
#define OLP_SETTLED 4       /* steps behind which no axis changes its side: two that turn could do so for ever */
#define OLP_GENTLE 4.0      /* times the largest correction in the time of the ramp */
typedef struct {
    double most_mm, most_deg;           /* the largest correction of a linear and of a rotary axis */
    double rate_mm_s, rate_deg_s;       /* by which it changes at most */
    double ramp_s;                      /* in which it is switched on and off */
    double band_mm;                     /* by which a load may be off before its drive turns */
    int on;
} olp_limits;
typedef struct {
    int known, limited, unsolved, steps;
    double command[OLP_AXES], play[OLP_AXES], backlash[OLP_AXES], correction[OLP_AXES], share;
} olp_follower;

static int olp_iterate(const olp_follower *from, olp_aim *aim, olp_state *state, double band_mm,
                       double command[], int *steps)
{
    double off[OLP_AXES], backlash[OLP_AXES];
    int j, rests[OLP_AXES] = {0};
    for (*steps = 1; *steps <= OLP_STEPS; ++*steps) {
        double largest = 0.0;
        olp_off(aim, command, state, off);
        olp_backlash_at(command, backlash);
        for (j = 0; j < OLP_AXES; j++) {
            double lost = 0.5 * backlash[j] * state->play[j], load = command[j] - off[j] - lost, next, size;
            if (olp_directed[j] && from->known && *steps <= OLP_SETTLED) {
                double was = from->play[j], band = band_mm / olp_unit_mm[j];
                double ahead = load - from->command[j] + 0.5 * from->backlash[j] * was;
                int plus = ahead > (was >= 1.0 ? 0.0 : band), minus = ahead < (was <= -1.0 ? 0.0 : -band);
                rests[j] = !plus && !minus;
                state->play[j] = plus ? 1.0 : minus ? -1.0 : was;
            }
            next = rests[j] ? from->command[j] : load + 0.5 * backlash[j] * state->play[j];
            size = fabs(next - command[j]) * olp_unit_mm[j];
            if (!(size <= largest)) largest = size;
            command[j] = next;
        }
        if (largest < OLP_CLOSE) return 1;
    }
    *steps = OLP_STEPS;
    return 0;
}

/* The command that brings the tool to `wanted` from where the follower is; 0 where the steps do not suffice. */
static int olp_solve(const olp_follower *from, olp_state *state, const double wanted[], double band_mm,
                     double command[], int *steps)
{
    static const double none[OLP_AXES] = {0.0};
    int j, well;
    for (well = 0; well <= OLP_WELL; well++) {
        olp_aim aim;
        for (j = 0; j < OLP_AXES; j++) state->play[j] = from->known ? from->play[j] : 0.0;
        olp_aim_at(&aim, wanted, from->known ? from->correction : none, state, well, command);
        if (olp_iterate(from, &aim, state, band_mm, command, steps)) return 1;
    }
    return 0;
}

/* The play of each axis behind a motion of the drives to `command`. */
static void olp_moved(olp_follower *follower, const double command[])
{
    double backlash[OLP_AXES];
    int j;
    olp_backlash_at(command, backlash);
    for (j = 0; j < OLP_AXES; j++) {
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
                        const double wanted[], double tick_s, double command[])
{
    olp_state state = *now;
    int j;
    follower->unsolved = !olp_solve(follower, &state, wanted, limits->band_mm, command, &follower->steps);
    follower->limited = 0;
    for (j = 0; j < OLP_AXES; j++) {
        double whole = follower->share * (command[j] - wanted[j]);
        double most = olp_turns[j] ? limits->most_deg : limits->most_mm;
        double rate = olp_turns[j] ? limits->rate_deg_s : limits->rate_mm_s;
        double held = olp_within(whole, -most, most);
        if (follower->known && tick_s > 0.0) {
            double step = rate * tick_s, before = follower->correction[j];
            double gentle = OLP_GENTLE * most * tick_s;
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
void olp_follow(olp_follower *follower, const olp_limits *limits, const olp_state *now, const double wanted[],
                double tick_s, double command[])
{
    int j;
    olp_bounded(follower, limits, now, wanted, tick_s, command);
    olp_moved(follower, command);
    for (j = 0; j < OLP_AXES; j++) follower->correction[j] = command[j] - wanted[j];
}

/* Where drives are that something else moves, and what axis position that is: the inverse of `olp_follow`. */
void olp_forward(const olp_follower *follower, const olp_state *now, const double command[], double wanted[])
{
    olp_state state = *now;
    int j;
    for (j = 0; j < OLP_AXES; j++) state.play[j] = follower->play[j];
    olp_stands_for(command, &state, wanted);
    for (j = 0; j < OLP_AXES; j++) wanted[j] = command[j] + follower->share * (wanted[j] - command[j]);
}

void olp_led(olp_follower *follower, const olp_state *now, const double command[])
{
    double wanted[OLP_AXES];
    int j;
    olp_moved(follower, command);
    olp_forward(follower, now, command, wanted);
    for (j = 0; j < OLP_AXES; j++) follower->correction[j] = command[j] - wanted[j];
}
