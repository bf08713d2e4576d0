/* The model for a page, compiled to WebAssembly: the unchanged mathematics of the FMU, and functions for the page's scripts. */
#pragma STDC FP_CONTRACT OFF

#include "model.h"

#include "series.c"
#include "step.c"

#define EXPORT(name) __attribute__((export_name(name)))

static double at[N_VARIABLES];       /* the variables, by their places */
static double marks[N_MONITORED][2]; /* V_ss and Tau of each velocity */
static double heading;               /* counts turns */
static double elapsed;               /* seconds since the start */
static delay_line line;              /* the commands that wait for the dead time */
static model_numbers numbers;        /* these follow from the coefficients */

EXPORT("variables") double *variables_start(void);
EXPORT("marks") double *marks_start(void);
EXPORT("tune") int tune(void);
EXPORT("begin") void begin(void);
EXPORT("step") int step(double h);
EXPORT("observe") void observe(void);

double *variables_start(void)
{
    return at;
}

double *marks_start(void)
{
    return &marks[0][0];
}

/* Take over changed coefficients. Return 0, and take over nothing, when the mass matrix is not positive definite. */
int tune(void)
{
    model_numbers next;
    model_prepare(at, &next);
    if (!model_is_definite(&next)) {
        return 0;
    }
    numbers = next;
    return 1;
}

/* Begin at rest with the attitude of the parameters at the start, and with no command on its way. */
void begin(void)
{
    model_begin(at, &heading);
    elapsed = 0.0;
#if HAS_DEAD_TIME
    line.waiting = 0;
#endif
}

/* Step h > 0 seconds with the inputs held. Return 0, and change nothing, when the step is refused or its result overflows. */
int step(double h)
{
    double next[N_STATES];
    if (elapsed == 0.0) {
        current_keep(at); /* the current of the first step is the one before it */
    }
    const bool done = delayed_step(at, &numbers, &line, elapsed, h, next, &heading) > 0 && all_finite(next, N_STATES);
    if (done) {
        memcpy(at + FIRST_STATE, next, sizeof next);
        delay_commit(at, &line, elapsed, h);
        elapsed += h;
    }
    return done;
}

/* Compute thrust and derivatives, and V_ss and Tau of each axis alone under the current inputs, once the thrust is steady. */
void observe(void)
{
    model_calculate(at, &numbers, heading);
    model_alone(at, &numbers, marks);
}
