/* What all methods work on. Three states are the velocities u, w, r; seven are these and the pose.
 *
 * One call advances the state by `steps` steps of h seconds, as an importer's communication step does, and is not
 * inlined into the loop that measures it. */
#pragma once

#include <string.h>

#include "riccati.c"
#include "rov.c"

typedef union {
    double at[7];
    rov_state named;
} state;

typedef struct {
    rov_coefficients coefficients;
    rov_gains gains;
    rov_inputs inputs;
    riccati axis[3]; /* surge, heave, yaw under the forces of the command */
} motion;

typedef void advance(motion *m, state *s, double h, long steps);

/* The forces of the command: once a communication step for seven states, ahead of the measurement for three. */
static inline void prepare_axes(motion *m)
{
    const rov_gains now = rov_axes(&m->coefficients, &m->gains, &m->inputs);
    m->axis[0] = now.surge;
    m->axis[1] = now.heave;
    m->axis[2] = now.yaw;
}

/* Time derivatives of n states. */
static inline void rates(const motion *m, int n, const double s[], double rate[])
{
    for (int i = 0; i < 3; i++) {
        rate[i] = (m->axis[i].C - m->axis[i].B * s[i]) - m->axis[i].A * fabs(s[i]) * s[i];
    }
    if (n == 7) {
        rate[3] = s[0] * cos(s[6]) + m->inputs.V_N;
        rate[4] = s[0] * sin(s[6]) + m->inputs.V_E;
        rate[5] = s[1];
        rate[6] = s[2];
    }
}
