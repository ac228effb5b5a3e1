#ifndef OLP_SELF_TEST
/* The kinematics of the control. LinuxCNC asks for the inverse also where it looks ahead (limits of a block):
   only what motion-controller asks for, between `begin` and `end`, moves the axes and takes up backlash. */
#include "kinematics.h"

static olp_state olp_now;
static olp_limits olp_bounds;
static olp_follower olp_at;
static double olp_tick_s, olp_offset[3];
@KEPT@
static int olp_ready, olp_in_tick, olp_calls, olp_ever_unsolved;

FUNCTION(begin)
{
    olp_offset[0] = tool_offset_x;
    olp_offset[1] = tool_offset_y;
    olp_offset[2] = tool_offset_z;
    olp_now.tool_mm[0] = tool_more_x - olp_offset[0];
    olp_now.tool_mm[1] = tool_more_y - olp_offset[1];
    olp_now.tool_mm[2] = tool_more_z - olp_offset[2];
    olp_now.payload_kg = payload;
@STATE@
    olp_bounds.most_mm = most_correction;
    olp_bounds.rate_mm_s = most_rate;
@BOUNDS@
    olp_bounds.ramp_s = ramp_time;
    olp_bounds.band_mm = dead_band;
    olp_bounds.on = enable;
    olp_tick_s = period * 1e-9;
    olp_switch(&olp_at, &olp_bounds, olp_tick_s);
    olp_in_tick = 1;
    olp_calls = 0;
}

FUNCTION(end)
{
    double joints[OLP_AXES] = {@JOINTS@};
    /* axes that are moved one by one, or home */
    if (!olp_calls) {
        olp_led(&olp_at, &olp_now, joints);
@LED@
    }
    olp_in_tick = 0;
    olp_ready = 1;
@SHOWN@
    switched_on = olp_at.share;
    active = olp_at.share >= 1.0;
    outside_box = olp_outside(olp_at.command);
    bounded = olp_calls && olp_at.limited;
    if (olp_calls && olp_at.unsolved) olp_ever_unsolved = 1;
    not_solved = olp_ever_unsolved;
    iterations = olp_at.steps;
    (void)period;
}

int kinematicsForward(const double *joint, EmcPose *world, const KINEMATICS_FORWARD_FLAGS *fflags,
                      KINEMATICS_INVERSE_FLAGS *iflags)
{
    double wanted[OLP_AXES];
    int j;
    for (j = 0; j < OLP_AXES; j++) wanted[j] = joint[j];
    if (olp_ready) olp_forward(&olp_at, &olp_now, joint, wanted);
@TO_WORLD@
    (void)fflags;
    (void)iflags;
    return 0;
}

int kinematicsInverse(const EmcPose *world, double *joint, const KINEMATICS_INVERSE_FLAGS *iflags,
                      KINEMATICS_FORWARD_FLAGS *fflags)
{
    double wanted[OLP_AXES], command[OLP_AXES];
    int j;
@OF_WORLD@
    for (j = 0; j < OLP_AXES; j++) command[j] = wanted[j];
    if (olp_ready && olp_in_tick) {
        olp_follow(&olp_at, &olp_bounds, &olp_now, wanted, olp_tick_s, command);
        olp_calls++;
@MOVED@
    } else if (olp_ready) {
        olp_follower ahead = olp_at;
        olp_bounded(&ahead, &olp_bounds, &olp_now, wanted, 0.0, command);
    }
    for (j = 0; j < OLP_AXES; j++) joint[j] = command[j];
    (void)iflags;
    (void)fflags;
    return 0;
}

KINEMATICS_TYPE kinematicsType(void)
{
    return KINEMATICS_BOTH;
}

KINS_NOT_SWITCHABLE
EXPORT_SYMBOL(kinematicsType);
EXPORT_SYMBOL(kinematicsForward);
EXPORT_SYMBOL(kinematicsInverse);
#endif
