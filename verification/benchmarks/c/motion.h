/* The vehicle that all methods simulate. One call advances the state by `steps` steps of h seconds, as an
 * importer's communication step does, and is not inlined into the loop that measures it. */
#pragma once

#include "model.h"

#include "series.c"
#include "step.c"

typedef struct {
    double at[N_VARIABLES];
    model_numbers numbers;
    model_held held; /* numbers that are constant while the commands are held */
} vehicle;

typedef void advance(vehicle *v, double state[N_STATES], double h, long steps);

/* Compute the numbers that are constant while the commands are held. With lag, the forces of the thrusters are states. */
static inline void hold_commands(vehicle *v)
{
    model_thrust(v->at, &v->held);
    if (!HAS_LAG) {
        model_hold(v->at, &v->numbers, &v->held);
    }
}

/* Compute the time derivatives of the states. */
static inline void rates(vehicle *v, const double state[N_STATES], double rate[N_STATES])
{
    memcpy(&v->at[FIRST_STATE], state, N_STATES * sizeof state[0]);
    model_derive(v->at, &v->numbers, &v->held);
    memcpy(rate, &v->at[FIRST_CALCULATED], N_STATES * sizeof rate[0]);
}
