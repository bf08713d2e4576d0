/* The laws of an autopilot: its only state is the time, and its commands are finite and not beyond the full ones. */
#pragma once

#include "world.h"

static bool is_calm(const fmu *f, double h)
{
    (void)f, (void)h;
    return true;
}

static void check_heading(const fmu *f, double near)
{
    (void)f, (void)near;
}

static void check_step_law(const fmu *start, const fmu *end, double h)
{
    const double *const values = end->now.values;
    PROPERTY(values[FIRST_STATE] == start->now.values[FIRST_STATE] + h, "a step of %a s lasts %a s", h,
             values[FIRST_STATE] - start->now.values[FIRST_STATE]);
    for (int i = FIRST_COMMAND; i < FIRST_COMMAND + N_OUTPUTS; i++) {
        PROPERTY(fabs(values[i]) <= 1.0, "%s = %g", VARIABLES[i].name, values[i]);
    }
}

/* An autopilot samples once per step, so the parts of a step do something else. */
static void check_parts(const fmu *start, const fmu *end, double h, int parts)
{
    (void)start, (void)end, (void)h, (void)parts;
}

static void check_whole_step(const fmu *start, const fmu *end, double t, double h)
{
    check_step_law(start, end, h);
    check_parts(start, end, h, 1);
    PROPERTY(end->now.time == t + h, "a step to t = %a ends at %a", t + h, end->now.time);
}

static void check_first_derivative(fmu *f, unsigned state, double derivative)
{
    (void)f;
    PROPERTY(state == 0 && derivative == 1.0, "the time passes by %g", derivative);
}
