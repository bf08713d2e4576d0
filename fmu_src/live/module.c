/* The model for a page, compiled to WebAssembly: the unchanged mathematics of the FMU and of the autopilot, and functions for the page's
 * scripts. */
#pragma STDC FP_CONTRACT OFF

#include "model.h"

#include "series.c"
#include "step.c"
#include "autopilot.c"

enum { SENSORS = sizeof(sensor_values) / sizeof(double), MOST_NUMBERS = 1 << 14 };

#define EXPORT(name) __attribute__((export_name(name)))

static double at[N_VARIABLES];       /* the variables, by their places */
static double marks[N_MONITORED][2]; /* V_ss and Tau of each velocity */
static double heading;               /* counts turns */
static double elapsed;               /* seconds since the start */
static delay_line line;              /* the commands that wait for the dead time */
static model_numbers numbers;        /* these follow from the coefficients */
static loop_state loops[AXES];
static double law[MOST_NUMBERS]; /* of the autopilot: the gains of the axes, then how the thrusters share (`sharing`) */
static struct {
    double sensors[SENSORS]; /* their places among the variables, -1 for none */
    double mode[AXES], aim[AXES];
    double most;                   /* the largest output, a share of the full command */
    double added[MOST_THRUSTERS];  /* to each command, a share of the full one */
} asked;

EXPORT("variables") double *variables_start(void);
EXPORT("marks") double *marks_start(void);
EXPORT("tune") int tune(void);
EXPORT("begin") void begin(void);
EXPORT("step") int step(double h);
EXPORT("observe") void observe(void);
EXPORT("law") double *law_start(void);
EXPORT("room") int law_room(void);
EXPORT("asked") double *asked_start(void);
EXPORT("release") void release(void);
EXPORT("hold") int hold(double h, int samples);

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

double *law_start(void)
{
    return law;
}

int law_room(void)
{
    return MOST_NUMBERS;
}

double *asked_start(void)
{
    return asked.sensors;
}

/* Forget what the autopilot has held. */
void release(void)
{
    memset(loops, 0, sizeof loops);
}

/* Step h > 0 seconds, in which the autopilot samples so many times and holds its commands in between. Return 0 when a step fails. */
int hold(double h, int samples)
{
    const loop_gains *const gains = (const loop_gains *)(const void *)law;
    const sharing *const share = (const sharing *)(const void *)(gains + AXES);
    int done = 1;
    for (int n = 0; done && n < samples; n++) {
        double measured[SENSORS], demand[AXES], outputs[MOST_THRUSTERS];
        sensor_values now;
        model_calculate(at, &numbers, heading);
        for (int i = 0; i < SENSORS; i++) {
            measured[i] = asked.sensors[i] < 0.0 ? 0.0 : at[(int)asked.sensors[i]];
        }
        memcpy(&now, measured, sizeof now);
        autopilot_step(gains, share, loops, &now, asked.mode, asked.aim, asked.most, h / samples, at, demand, outputs);
        for (int c = 0; c < (int)share->commands; c++) {
            const double x = at[c] - share->neutral, sum = within(x / (x > 0.0 ? share->ahead : share->astern) + asked.added[c], 1.0);
            at[c] = asked.added[c] == 0.0 ? at[c] : share->neutral + (sum > 0.0 ? share->ahead : share->astern) * sum;
        }
        done = step(h / samples);
    }
    return done;
}
