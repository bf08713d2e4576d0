/* What all methods work on: the velocities alone, or all states. One call advances the state by `steps` steps of h seconds, as
 * an importer's communication step does, and is not inlined into the loop that measures it. */
#pragma once

#include "riccati.c"
#include "rov.c"
#include "track.c"
#include "series.c"
#include "rov_step.c"

typedef struct {
    double at[N_VARIABLES]; /* inputs and coefficients */
    rov_gains gains;
    rov_held held; /* the forces of the command: prepared once a communication step, ahead of it for velocities */
} motion;

typedef void advance(motion *m, double state[N_STATES], double h, long steps);

/* Time derivatives of n states. */
static inline void rates(const motion *m, int n, const double s[N_STATES], double rate[N_STATES])
{
    if (n == N_STATES) {
        rov_rates(&m->gains, &m->held, s, rate);
    }
    for (int a = 0; a < N_AXES && n == N_AXES; a++) {
        rate[a] = m->held.C[a] - riccati_drag(&m->gains.axis[a], s[a]);
    }
}
