/* An extended Kalman filter for the identification (rov_fmu/identify/likelihood/filter.py): it runs through the samples of one log.
 *
 * The model is a stochastic differential equation around the vehicle's equation of motion:
 *
 *     x' = f(x, exp(g) thrust, force)      the states of the vehicle
 *     a |v| v |v/V|^q                      the drag of an axis in place of a |v| v, with a typical velocity V;
 *                                          q may differ astern
 *     force_i, g, drift_i                  a slow force and a short one along each axis, a slow change of all thrust, and a slow velocity
 *                                          over ground: Ornstein-Uhlenbeck processes, each with a size and a time constant
 *     v = scale h(x, drift) + offset       what a sensor would measure at once; h knows its place
 *     s' = (v - s) / lag                   what it measures without noise; s = v for a sensor without lag
 *     s' = (v - s) / (t - t_0)             the same for a log of means: s is the mean of v since t_0
 *     y = s + n + e                        a sample: n is the sensor's coloured noise, also such a process, and e is white
 *
 * A change of the commands happens at an unknown time within a window. The mean uses the expected command, and the state `lateness`
 * has the deviation of the integral of the command from its mean. The mean takes fourth-order Runge-Kutta steps. The derivatives of
 * the rates change more slowly, and the covariance moves over a few of these steps at once. Names as in step.c: at, n, q.
 *
 * filter_lanes.c compiles it for several sets of parameters at once, one in each lane of a vector (real.h). They repeat the steps of
 * an earlier run. */
#include <stddef.h>

#include "model.h"

#include "series.c"

#include "step.c"

#if LANES > 1
EACH_LANE(asin, (real x), LANE(x, i))
#define asin lanes_asin
#endif

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum {
    N_AXES = N_VELOCITIES,
    N_DRIFTS = 3,
    MOST_SENSORS = 16,
    LAGGED = N_STATES, /* the places of the states after those of the vehicle: first what each sensor with a lag measures */
    FORCE = LAGGED + MOST_SENSORS,
    SHORT = FORCE + N_AXES,
    GAIN = SHORT + N_AXES,
    DRIFT = GAIN + 1,
    NOISE = DRIFT + N_DRIFTS,
    LATENESS = NOISE + MOST_SENSORS,
    N_X,
    N_SLOW = LATENESS - FORCE, /* the Ornstein-Uhlenbeck processes */
    TOGETHER = 4,              /* the most steps of the mean over which the covariance moves at once */
    BLOCK = 8,                 /* numbers that fit into the registers */
    ROW = (N_X + BLOCK) | 1,   /* the numbers in a row of a matrix: rows of a power of 2 would displace each other from the cache */
    N_HELD = sizeof(model_held) / sizeof(real)
};

static const double TURN = 6.283185307179586;
static const double MARGIN = 0.005;   /* s: how near to a step a change of a command matters */
static const double TINY = 1e-60;
static const double OUTLYING = 3.0; /* standard deviations: a larger innovation corrects the states as if it were no larger (Huber) */

/* How a sensor's value follows from the states. */
enum { STATE, OVER_GROUND, ANGLE };

/* Where the filter finds what it needs in the layout. A place is -1 where the vehicle has no such variable. */
typedef struct {
    int external[N_AXES];    /* the inputs of force or torque along each axis */
    int drag[2][N_AXES];     /* the coefficients of the quadratic drag along each axis, ahead and astern */
    int direction[N_AXES];   /* 0 for a velocity ahead, 1 to starboard, 2 down, -1 for a turn */
    int turn[N_AXES];        /* 0 for roll, 1 for pitch, 2 for yaw, -1 for a velocity along an axis */
    int current[N_DRIFTS];   /* the inputs of the current: north, east, down */
    int position[N_DRIFTS];  /* the states of the position: north, east, down */
    int quaternion, heading; /* the first state of the quaternion, or the state of the heading */
    int load;                /* the coefficient of the constant load along heave */
    int health, thrusters;   /* the coefficient of the health of the first thruster; those of the others follow */
} places;

/* A log. */
typedef struct {
    ptrdiff_t samples, rows, sensors;
    const double *time, *value;  /* of each sample, in the order of time */
    const int *sensor;           /* of each sample */
    const int *kind, *place;     /* of each sensor: STATE, OVER_GROUND or ANGLE, and the variable or the number of the axis */
    const double *since, *told;  /* of each row of inputs: the change happens after `since`, and is told at `told` */
    const int *anew;             /* of each row: 0 if it goes on with the change of the row before, which decides about its time */
    const double *start, *error; /* the states at the first sample, and their standard deviations; N_X numbers each */
    const int *active;           /* for each state, whether it has a covariance; N_X numbers */
    ptrdiff_t tilts;             /* the times at which the roll and pitch of a vehicle that has neither state are known, or 0 */
    ptrdiff_t wanders;           /* 1 if the horizontal drift is an error of the velocities, which the positions do not have */
    const double *tilt_time, *roll, *pitch;
    const double *beside; /* rows x N_AXES: the size of each short force after a row, relative to its size in `parameters`. If it is
                             not NULL, commands change along straight lines, and no change has a time of its own */
    double longest, changing;    /* the longest step, and the longest one in which a command changes, s */
    double share;                /* the longest step relative to the fastest time constant */
} record;

/* The numbers of the parameters. */
typedef struct {
    real at[N_VARIABLES];                   /* the coefficients, and the inputs besides the commands */
    real size[N_SLOW], time_constant[N_SLOW]; /* of the slow processes */
    real white[MOST_SENSORS];               /* the standard deviation of each sensor's white noise */
    real lag[MOST_SENSORS];                 /* the time constant of each sensor, s */
    real lever[MOST_SENSORS][N_DRIFTS];     /* the place of each sensor of velocity or position: ahead, to starboard, down, m */
    real turn;                              /* of the sensors of velocity over ground about the vehicle's vertical axis, rad */
    real scale[MOST_SENSORS], bias[MOST_SENSORS]; /* what a sensor multiplies by, and then adds */
    real mean_drift[N_DRIFTS];              /* of the velocities over ground, which the positions do not have, m/s */
    real unit[N_X];                         /* of each state: the unit of its gains in runs that repeat them */
    real power[2][N_AXES], typical[N_AXES]; /* of drag a |v| v |v / typical|^power, ahead and astern */
    real offset, width;                     /* the commands act so much later than they are told; the width of a window, relative to
                                                 the time between two rows */
} parameters;

/* One set of parameters: its numbers in the order of the struct above, and N_INPUTS numbers for each row, which are added to it. */
typedef struct {
    const double *numbers, *inputs;
} parameter_set;

/* What the run of a set writes for each sample; each may be NULL. `pieces` and `gain` are read in a run that repeats another one. */
typedef struct {
    double *innovation, *variance; /* samples */
    int *pieces;                   /* samples: the number of steps before the sample */
    double *gain;                  /* samples x N_X: the change of the states per innovation, in the units of the set */
    double *states, *deviations;   /* samples x N_X: the states after the sample, and their standard deviations */
} output;

/* How a run treats the samples. */
typedef struct {
    int repeats;        /* 0: compute `pieces` and `gain`; 1: take `pieces`; 2: take both, and no covariance */
    double begin, span; /* the innovations are those of a prediction that starts anew at `begin` and then after each span; < 0: none */
} mode;

typedef struct {
    real x[N_X], P[N_X][ROW];
} belief;

/* The entries other than 0 of a matrix, row by row. A column is the place of a listed state. */
typedef struct {
    int count[FORCE], column[FORCE][N_X];
    real entry[FORCE][N_X];
} sparse;

/* The last results of functions that are often called with the same numbers in turn. */
typedef struct {
    real heading, cosine, sine;
    real speed[N_AXES], beside[N_AXES]; /* velocities, and the forces by which their drag differs from a quadratic one */
} recent;

/* Matrices, which are too large for the stack of some threads. */
typedef struct {
    sparse A, once, over;   /* the derivatives of the rates, and the transitions over one step and over a few */
    real whole[2][N_X][ROW]; /* a transition, and then a product of two */
    real moved[FORCE + BLOCK][ROW];
    recent last;
    real linear[NOISE - FORCE][N_STATES]; /* how forces and velocities of the water change the rates */
    bool knows[NOISE - FORCE];            /* which of these are known */
} matrices;

typedef struct {
    const places *where;
    const record *log;
    parameters *set;
    real *at; /* the variables, of which those that do not change are set */
    model_numbers n;
    model_held *thrust; /* of each row */
    int listed[N_X], count;
    belief now, ahead; /* after all samples so far, and the prediction */
    ptrdiff_t row, tilt;
    real reset;                /* the last row at which the lateness began anew */
    mask beside[MOST_SENSORS]; /* if the last sample of a sensor was far beside its prediction */
    real cf, sf, ct, st;       /* cosines and sines of the measured roll and pitch at the time of the step or sample */
    double theta_rate;
    matrices *m;
} filter;

/* Return a number, or 0 for a tiny one. What decays for long would become so small that processors compute with it a hundred times
 * more slowly. */
static inline real flushed(real value)
{
    return fabs(value) < TINY ? 0.0 : value;
}

/* Return an angle within half a turn. */
static inline real wrapped(real angle)
{
    return angle - TURN * floor(angle / TURN + 0.5);
}

/* ---- The attitude and the sensors --------------------------------------------------------------------------------- */

/* Compute the rotation matrix from the body to the earth. */
static void rotation(const filter *f, const real x[N_X], real R[3][3])
{
    if (f->where->quaternion >= 0) {
        const real *q = x + f->where->quaternion - FIRST_STATE;
        const real s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        R[0][0] = 1.0 - s * (q[2] * q[2] + q[3] * q[3]);
        R[0][1] = s * (q[1] * q[2] - q[0] * q[3]);
        R[0][2] = s * (q[1] * q[3] + q[0] * q[2]);
        R[1][0] = s * (q[1] * q[2] + q[0] * q[3]);
        R[1][1] = 1.0 - s * (q[1] * q[1] + q[3] * q[3]);
        R[1][2] = s * (q[2] * q[3] - q[0] * q[1]);
        R[2][0] = s * (q[1] * q[3] - q[0] * q[2]);
        R[2][1] = s * (q[2] * q[3] + q[0] * q[1]);
        R[2][2] = 1.0 - s * (q[1] * q[1] + q[2] * q[2]);
    } else {
        const real cf = f->cf, sf = f->sf, ct = f->ct, st = f->st;
        real cp = 1.0, sp = 0.0;
        if (f->where->heading >= 0) {
            recent *const last = &f->m->last;
            const real heading = x[f->where->heading - FIRST_STATE];
            if (ANY(heading != last->heading)) {
                last->heading = heading;
                last->cosine = cos(heading);
                last->sine = sin(heading);
            }
            cp = last->cosine;
            sp = last->sine;
        }
        R[0][0] = cp * ct;
        R[0][1] = cp * st * sf - sp * cf;
        R[0][2] = cp * st * cf + sp * sf;
        R[1][0] = sp * ct;
        R[1][1] = sp * st * sf + cp * cf;
        R[1][2] = sp * st * cf - cp * sf;
        R[2][0] = -st;
        R[2][1] = ct * sf;
        R[2][2] = ct * cf;
    }
}

/* Take the roll and the pitch at a time, which does not decrease by much from call to call. */
static void set_tilt(filter *f, double t)
{
    const record *log = f->log;
    double phi = 0.0, theta = 0.0;
    if (log->tilts >= 2) {
        while (f->tilt > 0 && log->tilt_time[f->tilt] > t) {
            f->tilt--;
        }
        while (f->tilt + 2 < log->tilts && log->tilt_time[f->tilt + 1] <= t) {
            f->tilt++;
        }
        const double *time = log->tilt_time + f->tilt, *roll = log->roll + f->tilt, *pitch = log->pitch + f->tilt;
        const double h = time[1] - time[0], since = (t - time[0]) / h, share = since < 0.0 ? 0.0 : since > 1.0 ? 1.0 : since;
        phi = roll[0] + share * (roll[1] - roll[0]);
        theta = pitch[0] + share * (pitch[1] - pitch[0]);
        f->theta_rate = (pitch[1] - pitch[0]) / h;
    }
    f->cf = cos(phi);
    f->sf = sin(phi);
    f->ct = cos(theta);
    f->st = sin(theta);
}

/* Return the velocity of the water along an axis of the earth. */
static real current(const filter *f, int axis)
{
    real found = 0.0;
    if (f->where->current[axis] >= 0) {
        found = f->set->at[f->where->current[axis]];
    }
    return found;
}

/* Return the direction of the velocity that a sensor measures: 0 ahead, 1 to starboard, 2 down; -1 for any other sensor. */
static int direction_of(const filter *f, ptrdiff_t sensor)
{
    const int place = f->log->place[sensor], axis = place - FIRST_STATE;
    if (f->log->kind[sensor] == OVER_GROUND) {
        return place;
    }
    return f->log->kind[sensor] == STATE && axis < N_AXES ? f->where->direction[axis] : -1;
}

/* Return the velocity along a direction at the place of a sensor, relative to the origin, for a turn of 1 rad/s. */
static real arm(const filter *f, ptrdiff_t sensor, int along, int axis)
{
    const int about = f->where->turn[axis], across = 3 - about - along;
    real found = 0.0;
    if (about >= 0 && along >= 0 && about != along) {
        found = across == (about + 1) % 3 ? f->set->lever[sensor][across] : -f->set->lever[sensor][across];
    }
    return found;
}

/* Return true for a sensor of the position along an axis of the earth. */
static bool locates(const filter *f, ptrdiff_t sensor, int axis)
{
    return f->log->kind[sensor] == STATE && f->log->place[sensor] == f->where->position[axis];
}

/* Return what a sensor measures more than it would at the origin. */
static real beside_origin(const filter *f, const real x[N_X], ptrdiff_t sensor)
{
    real R[3][3], found = 0.0;
    for (int i = 0; i < N_AXES; i++) {
        found += arm(f, sensor, direction_of(f, sensor), i) * x[i];
    }
    for (int axis = 0; axis < N_DRIFTS; axis++) {
        if (locates(f, sensor, axis)) {
            rotation(f, x, R);
            for (int i = 0; i < N_DRIFTS; i++) {
                found += R[axis][i] * f->set->lever[sensor][i];
            }
        }
    }
    return found;
}

/* Return true for a sensor of an angle, which may differ by whole turns. */
static bool wraps(const filter *f, ptrdiff_t sensor)
{
    const int kind = f->log->kind[sensor];
    return kind == ANGLE || (kind == STATE && f->log->place[sensor] == f->where->heading);
}

/* Return true for a sensor that has a lag. */
static bool lags(const filter *f, ptrdiff_t sensor)
{
    return f->log->active[LAGGED + sensor] != 0;
}

/* Return the velocity over ground at the place of a sensor along a direction of the body: ahead, to starboard, down. */
static real velocity_along(const filter *f, const real x[N_X], real R[3][3], ptrdiff_t sensor, int along)
{
    real found = 0.0;
    for (int i = 0; i < N_AXES; i++) {
        found += arm(f, sensor, along, i) * x[i];
    }
    for (int i = 0; i < N_DRIFTS; i++) {
        found += R[i][along] * (x[DRIFT + i] + current(f, i) + f->set->mean_drift[i]);
    }
    for (int i = 0; i < N_AXES; i++) {
        if (f->where->direction[i] == along) {
            found += x[i];
        }
    }
    return found;
}

/* Return a component of a vector in the frame of the sensors of velocity over ground, by its two horizontal components in the
 * body: ahead and to starboard. */
static real in_frame_of_sensor(const filter *f, int along, const real horizontal[2])
{
    const real c = cos(f->set->turn), s = sin(f->set->turn);
    return along == 0 ? c * horizontal[0] + s * horizontal[1] : c * horizontal[1] - s * horizontal[0];
}

/* Return true for a sensor of the velocity over ground that measures along a turned direction. */
static bool is_turned(const filter *f, ptrdiff_t sensor)
{
    return f->log->kind[sensor] == OVER_GROUND && f->log->place[sensor] < 2 && ANY(f->set->turn != 0.0);
}

/* Return what a sensor without scale and offset would measure at once, without noise. */
static real unscaled(const filter *f, const real x[N_X], ptrdiff_t sensor)
{
    const int place = f->log->place[sensor];
    real R[3][3];
    if (f->log->kind[sensor] == STATE) {
        return x[place - FIRST_STATE] + beside_origin(f, x, sensor);
    }
    rotation(f, x, R);
    if (f->log->kind[sensor] == ANGLE) { /* the place is 0 for roll, 1 for pitch, 2 for the heading */
        if (place == 1) {
            return -asin(fmax(fmin(R[2][0], 1.0), -1.0));
        }
        return place == 0 ? atan2(R[2][1], R[2][2]) : atan2(R[1][0], R[0][0]);
    }
    if (is_turned(f, sensor)) { /* the place is the number of the direction */
        const real horizontal[2] = {velocity_along(f, x, R, sensor, 0), velocity_along(f, x, R, sensor, 1)};
        return in_frame_of_sensor(f, place, horizontal);
    }
    return velocity_along(f, x, R, sensor, place);
}

/* Return what a sensor would measure at once, without noise. */
static real at_once(const filter *f, const real x[N_X], ptrdiff_t sensor)
{
    return f->set->scale[sensor] * unscaled(f, x, sensor) + f->set->bias[sensor];
}

/* Return true for a state that the attitude depends on. */
static bool turns(const filter *f, int state)
{
    const int quaternion = f->where->quaternion - FIRST_STATE;
    return f->where->quaternion >= 0 ? state >= quaternion && state < quaternion + 4 : state + FIRST_STATE == f->where->heading;
}

/* Return the derivative of a velocity over ground along a direction of the body with respect to a state other than the attitude. */
static real slope_along(const filter *f, real R[3][3], ptrdiff_t sensor, int along, int state)
{
    if (state < N_AXES && f->where->turn[state] >= 0) {
        return arm(f, sensor, along, state);
    }
    if (state < N_AXES) {
        return f->where->direction[state] == along ? 1.0 : 0.0;
    }
    if (state >= DRIFT && state < NOISE) {
        return R[state - DRIFT][along];
    }
    return 0.0;
}

/* Compute the derivatives of what a sensor would measure at once with respect to the listed states. */
static void gradient(const filter *f, const real x[N_X], ptrdiff_t sensor, real H[N_X])
{
    const int kind = f->log->kind[sensor], place = f->log->place[sensor];
    const bool ignores_attitude = kind == STATE && !locates(f, sensor, 0) && !locates(f, sensor, 1) && !locates(f, sensor, 2);
    real y[N_X], R[3][3], base = 0.0;
    if (!ignores_attitude) {
        memcpy(y, x, sizeof y);
        rotation(f, x, R);
        base = unscaled(f, x, sensor);
    }
    for (int c = 0; c < f->count; c++) {
        const int j = f->listed[c];
        H[c] = 0.0;
        if (kind == STATE && j == place - FIRST_STATE) {
            H[c] = 1.0;
        } else if (turns(f, j) && !ignores_attitude) {
            y[j] = x[j] + 1e-6;
            H[c] = wrapped(unscaled(f, y, sensor) - base) / 1e-6;
            y[j] = x[j];
        } else if (is_turned(f, sensor)) {
            const real horizontal[2] = {slope_along(f, R, sensor, 0, j), slope_along(f, R, sensor, 1, j)};
            H[c] = in_frame_of_sensor(f, place, horizontal);
        } else if (kind == OVER_GROUND) {
            H[c] = slope_along(f, R, sensor, place, j);
        } else if (j < N_AXES && f->where->turn[j] >= 0) {
            H[c] = arm(f, sensor, direction_of(f, sensor), j);
        }
        H[c] *= f->set->scale[sensor];
    }
}

/* ---- The mean ----------------------------------------------------------------------------------------------------- */

/* Return the velocity of the vehicle over ground along an axis of the earth, with its row of the rotation matrix. */
static real over_ground(const filter *f, const real x[N_X], const real row[3], int axis)
{
    real found = current(f, axis);
    for (int i = 0; i < N_AXES; i++) {
        if (f->where->direction[i] >= 0) {
            found += row[f->where->direction[i]] * x[i];
        }
    }
    return found;
}

/* Multiply what a row commands by the slow change of all thrust. The command of a rotor that lags is a speed, which stays: its
 * thrust is multiplied in scale_health. */
static void scale_thrust(const real x[N_X], const real held[N_HELD], model_held *q)
{
#if HAS_ROTORS
    (void)x;
    memcpy(q, held, N_HELD * sizeof held[0]);
#else
    const real gain = exp(x[GAIN]); /* above 0: thrust never changes its direction */
    real scaled[N_HELD];
    for (int i = 0; i < N_HELD; i++) {
        scaled[i] = held[i] * gain;
    }
    memcpy(q, scaled, sizeof scaled);
#endif
}

#if HAS_ROTORS
/* Multiply the thrust that follows from the speeds of the rotors by its slow change. */
static void scale_health(const filter *f, const real x[N_X])
{
    const real gain = exp(x[GAIN]);
    for (int i = f->where->health; i < f->where->health + f->where->thrusters; i++) {
        f->at[i] = f->set->at[i] * gain;
    }
}
#endif

#if LANES == 1
static real logarithm(real x)
{
    return log(x);
}
#endif

/* Return the force along an axis by which its drag differs from a quadratic one. */
static real beside_quadratic(const filter *f, int i, real v)
{
    const real size = fabs(v), relative = fmax(size / f->set->typical[i], TINY);
    const real a = v < 0.0 ? f->set->at[f->where->drag[1][i]] : f->set->at[f->where->drag[0][i]];
    const real power = v < 0.0 ? f->set->power[1][i] : f->set->power[0][i];
    return a * size * v * (1.0 - exp(power * logarithm(relative)));
}

/* Compute the rates of the vehicle's states under the thrust in q, whose other numbers change. */
static void rates(const filter *f, const real x[N_X], model_held *q, real rate[N_STATES])
{
    real *const at = f->at, R[3][3];
    const bool tilts = f->log->tilts >= 2;
    memcpy(at + FIRST_STATE, x, N_STATES * sizeof x[0]);
#if HAS_ROTORS
    scale_health(f, x);
#endif
    for (int i = 0; i < N_AXES; i++) {
        at[f->where->external[i]] = f->set->at[f->where->external[i]] + x[FORCE + i] + x[SHORT + i];
        if (ANY(f->set->power[0][i] != 0.0) || ANY(f->set->power[1][i] != 0.0)) {
            if (ANY(x[i] != f->m->last.speed[i])) {
                f->m->last.speed[i] = x[i];
                f->m->last.beside[i] = beside_quadratic(f, i, x[i]);
            }
            at[f->where->external[i]] += f->m->last.beside[i];
        }
    }
    if (tilts) { /* the load along heave is a net weight, which stays vertical */
        rotation(f, x, R);
        for (int i = 0; i < N_AXES && f->where->load >= 0; i++) {
            const int along = f->where->direction[i];
            if (along >= 0) {
                at[f->where->external[i]] += at[f->where->load] * (R[2][along] - (along == 2 ? 1.0 : 0.0));
            }
        }
    }
#if !HAS_LAG
    model_hold(at, &f->n, q);
#endif
    model_derive(at, &f->n, q);
    memcpy(rate, at + FIRST_STATE + N_STATES, N_STATES * sizeof rate[0]);
    for (int i = 0; i < N_DRIFTS; i++) {
        if (f->where->position[i] >= 0) {
            real *position = &rate[f->where->position[i] - FIRST_STATE];
            if (tilts) {
                *position = over_ground(f, x, R[i], i);
            }
            *position += f->log->wanders && i < 2 ? (real)0.0 : x[DRIFT + i];
        }
    }
    if (tilts && f->where->heading >= 0) {
        real *heading = &rate[f->where->heading - FIRST_STATE];
        *heading = (*heading + f->theta_rate * f->sf) / (f->cf * f->ct);
    }
}

static real window(const filter *f, ptrdiff_t row)
{
    return f->set->width * (f->log->told[row] - f->log->since[row]);
}

/* Return when the window of a row begins or ends. */
static real begins(const filter *f, ptrdiff_t row)
{
    return f->log->told[row] + f->set->offset - 0.5 * window(f, row);
}

static real ends(const filter *f, ptrdiff_t row)
{
    return f->log->told[row] + f->set->offset + 0.5 * window(f, row);
}

/* Return the integral until t of the expected share of a row's change that has happened. */
static real happened(const filter *f, ptrdiff_t row, double t)
{
    const real width = window(f, row), since = t - begins(f, row);
    const real within = since < width ? 0.5 * since * since / width : since - 0.5 * width;
    return since <= 0.0 ? 0.0 : within;
}

/* Return the standard deviation of the time since a change, which is uniformly distributed over a window; 0 if there is a line. */
static real spread(const filter *f, ptrdiff_t row, double t)
{
    const real width = window(f, row), since = fmin(fmax(t - begins(f, row), 0.0), width);
    return width > 0.0 && !f->log->beside ? since * sqrt(fmax(since / width * (1.0 / 3.0 - 0.25 * since / width), 0.0)) : 0.0;
}

/* Return what a row commands. The struct has numbers alone. */
static const real *commanded(const filter *f, ptrdiff_t row)
{
    return (const real *)&f->thrust[row];
}

/* Compute the mean thrust over a step. Changes that end before it are behind `row`. */
static void mean_thrust(const filter *f, ptrdiff_t row, double from, double to, real held[N_HELD])
{
    memcpy(held, commanded(f, row), N_HELD * sizeof held[0]);
    for (ptrdiff_t j = row + 1; j < f->log->rows && ANY(begins(f, j) < to); j++) {
        const real share = (happened(f, j, to) - happened(f, j, from)) / (to - from);
        const real *before = commanded(f, j - 1), *after = commanded(f, j);
        for (int i = 0; i < N_HELD; i++) {
            held[i] += share * (after[i] - before[i]);
        }
    }
}

/* How what a sensor with a lag measures follows from what it would measure at once, which is linear in time over a span of h: it is
 * `remains` of what it was, and shares of the values at the beginning and at the end. A lag of 0 gives the value at the end. */
typedef struct {
    real remains, begin, end;
} lagging;

static lagging lagging_over(const filter *f, ptrdiff_t sensor, double h)
{
    const real lag = fmax(f->set->lag[sensor], TINY), remains = exp(-h / lag), share = (1.0 - remains) * lag / h;
    return (lagging){remains, share - remains, 1.0 - share};
}

/* Return what a sensor would measure at once: of the angles that differ by whole turns, the one next to a value. */
static real next_to(const filter *f, real value, const real x[N_X], ptrdiff_t sensor)
{
    const real found = at_once(f, x, sensor);
    return wraps(f, sensor) ? value + wrapped(found - value) : found;
}

/* Move what the sensors with a lag measure over a step, of which the states at its beginning, middle and end are known. */
static void step_lagged(const filter *f, const real before[N_X], const real middle[N_X], lagging halves[2][MOST_SENSORS],
                        real x[N_X])
{
    for (int sensor = 0; sensor < f->log->sensors; sensor++) {
        if (lags(f, sensor)) {
            const lagging first = halves[0][sensor], second = halves[1][sensor];
            real *const value = &x[LAGGED + sensor];
            const real begin = next_to(f, *value, before, sensor), half = next_to(f, begin, middle, sensor);
            *value = first.remains * *value + first.begin * begin + first.end * half;
            *value = flushed(second.remains * *value + second.begin * half + second.end * next_to(f, half, x, sensor));
        }
    }
}

/* Take one Runge-Kutta step, and compute the states in its middle. */
static void step_mean(const filter *f, real x[N_X], const real held[N_HELD], double h, const real remains[N_SLOW],
                      lagging halves[2][MOST_SENSORS], real middle[N_X])
{
    real k[4][N_STATES], y[N_X], before[N_X];
    model_held q;
    memcpy(before, x, sizeof before);
    scale_thrust(x, held, &q);
    memcpy(y, x, sizeof y);
    for (int stage = 0; stage < 4; stage++) {
        const double part = stage == 2 ? h : 0.5 * h;
        rates(f, y, &q, k[stage]);
        for (int i = 0; i < N_STATES; i++) {
            y[i] = x[i] + part * k[stage][i];
        }
        if (stage == 1) {
            memcpy(middle, y, sizeof y);
        }
    }
    for (int i = 0; i < N_STATES; i++) {
        x[i] = flushed(x[i] + h / 6.0 * (k[0][i] + 2.0 * (k[1][i] + k[2][i]) + k[3][i]));
    }
    for (int i = 0; i < N_SLOW; i++) {
        x[FORCE + i] = flushed(x[FORCE + i] * remains[i]);
    }
    step_lagged(f, before, middle, halves, x);
    x[LATENESS] = 0.0;
}

/* ---- The covariance ----------------------------------------------------------------------------------------------- */

/* Return true for a position on which no rate depends. */
static bool changes_nothing(const filter *f, int state)
{
#ifdef HAS_SURFACE
    (void)f;
    (void)state;
    return false;
#else
    const int *const position = f->where->position, variable = state + FIRST_STATE;
    return state < LAGGED && (variable == position[0] || variable == position[1] || variable == position[2]);
#endif
}

/* Compute the derivatives of the rates of the vehicle's states with respect to the listed states. */
static void slopes(const filter *f, const real x[N_X], const real held[N_HELD], sparse *A)
{
    real base[N_STATES], moved[N_STATES], y[N_X];
    model_held q;
    memset(A->count, 0, sizeof A->count);
    memcpy(y, x, sizeof y);
    scale_thrust(x, held, &q);
    rates(f, x, &q, base);
    for (int c = 0; c < f->count && f->listed[c] < NOISE; c++) {
        const int j = f->listed[c];
        if ((j >= LAGGED && j < FORCE) || changes_nothing(f, j)) {
            continue; /* no rate depends on what is measured */
        }
        const bool is_linear = j >= FORCE && j != GAIN; /* a force or a velocity of the water: the same in all of a run */
        real *const by = is_linear ? f->m->linear[j - FORCE] : moved;
        if (!is_linear || !f->m->knows[j - FORCE]) {
            real change = is_linear ? 1.0 : 1e-3;
            if (j < LAGGED) {
                change = 1e-6 * (1.0 + fabs(x[j]));
            }
            y[j] = x[j] + change;
            if (j == GAIN) {
                scale_thrust(y, held, &q);
            }
            rates(f, y, &q, moved);
            y[j] = x[j];
            if (j == GAIN) {
                scale_thrust(y, held, &q);
            }
            for (int i = 0; i < N_STATES; i++) {
                by[i] = (moved[i] - base[i]) / change;
            }
            if (is_linear) {
                f->m->knows[j - FORCE] = true;
            }
        }
        for (int i = 0; i < N_STATES; i++) {
            if (ANY(by[i] != 0.0)) {
                A->column[i][A->count[i]] = c;
                A->entry[i][A->count[i]++] = by[i];
            }
        }
    }
}

/* Return how many of the listed states stand before a place. Those of the vehicle stand first, and then those of the sensors. */
static int count_before(const filter *f, int place)
{
    int found = 0;
    while (found < f->count && f->listed[found] < place) {
        found++;
    }
    return found;
}

/* Write a row of a matrix without its zeros. */
static void set_row(const filter *f, const real row[], int a, sparse *phi)
{
    phi->count[a] = 0;
    for (int b = 0; b < f->count; b++) {
        if (ANY(row[b] != 0.0)) {
            phi->column[a][phi->count[a]] = b;
            phi->entry[a][phi->count[a]++] = row[b];
        }
    }
}

/* Compute the listed rows of 1 + h A + h^2 A^2 / 2 for the vehicle. */
static void transition(const filter *f, const sparse *A, double h, sparse *phi)
{
    const int vehicle = count_before(f, LAGGED);
    for (int a = 0; a < vehicle; a++) {
        const int i = f->listed[a];
        real row[N_X];
        memset(row, 0, (size_t)f->count * sizeof row[0]);
        for (int k = 0; k < A->count[i]; k++) {
            const int b = A->column[i][k];
            const real entry = h * A->entry[i][k];
            row[b] += entry;
            if (b < vehicle) {
                const int j = f->listed[b];
                for (int l = 0; l < A->count[j]; l++) {
                    row[A->column[j][l]] += 0.5 * h * entry * A->entry[j][l];
                }
            }
        }
        row[a] += 1.0;
        set_row(f, row, a, phi);
    }
}

/* Compute the rows of the sensors with a lag, which follow from the rows of the vehicle. */
static void transition_lagged(const filter *f, const real middle[N_X], const lagging part[MOST_SENSORS],
                              const real remains[N_SLOW], sparse *phi, real slope[MOST_SENSORS][N_X])
{
    const int vehicle = count_before(f, LAGGED), moving = count_before(f, FORCE);
    for (int a = vehicle; a < moving; a++) {
        const int sensor = f->listed[a] - LAGGED;
        real *const H = slope[sensor], row[N_X];
        gradient(f, middle, sensor, H);
        memset(row, 0, (size_t)f->count * sizeof row[0]);
        row[a] = part[sensor].remains;
        for (int c = 0; c < f->count; c++) {
            if (ALL(H[c] == 0.0)) {
                continue;
            }
            row[c] += part[sensor].begin * H[c];
            for (int l = 0; c < vehicle && l < phi->count[c]; l++) {
                row[phi->column[c][l]] += part[sensor].end * H[c] * phi->entry[c][l];
            }
            if (c >= vehicle) { /* a slow velocity over ground */
                row[c] += part[sensor].end * H[c] * remains[f->listed[c] - FORCE];
            }
        }
        set_row(f, row, a, phi);
    }
}

/* Multiply some rows of a sparse matrix by the first columns of another matrix. */
static void multiply(const sparse *left, int rows, const real right[N_X][ROW], int columns, real product[][ROW])
{
    for (int first = 0; first < columns; first += BLOCK) {
        for (int a = 0; a < rows; a++) {
            real sum[BLOCK];
            memset(sum, 0, sizeof sum);
            for (int c = 0; c < left->count[a]; c++) {
                const real *const row = right[left->column[a][c]] + first;
                for (int i = 0; i < BLOCK; i++) {
                    sum[i] += left->entry[a][c] * row[i];
                }
            }
            memcpy(product[a] + first, sum, sizeof sum);
        }
    }
}

/* Return the transition over a few steps, and replace `remains` by how much of each slow process remains after them. */
static const sparse *transition_over(const filter *f, int steps, real remains[N_SLOW])
{
    const int moving = count_before(f, FORCE), columns = count_before(f, NOISE);
    matrices *const m = f->m;
    real(*from)[ROW] = m->whole[0], (*to)[ROW] = m->whole[1], once[N_SLOW];
    memcpy(once, remains, sizeof once);
    for (int a = 0; a < moving && steps > 1; a++) { /* the rows below have a diagonal alone */
        memset(from[a], 0, (size_t)f->count * sizeof from[a][0]);
        for (int k = 0; k < m->once.count[a]; k++) {
            from[a][m->once.column[a][k]] = m->once.entry[a][k];
        }
    }
    for (int done = 1, by; done < steps; done += by) {
        by = 2 * done <= steps ? done : 1;
        for (int a = moving; a < columns; a++) {
            from[a][a] = remains[f->listed[a] - FORCE];
        }
        multiply(by == 1 ? &m->once : &m->over, moving, from, columns, to);
        for (int a = 0; a < moving; a++) {
            set_row(f, to[a], a, &m->over);
        }
        for (int i = 0; i < N_SLOW; i++) {
            remains[i] *= by == 1 ? once[i] : remains[i];
        }
        real(*const other)[ROW] = from;
        from = to;
        to = other;
    }
    return steps > 1 ? &m->over : &m->once;
}

/* How the lateness changes the states over a few steps: first the lateness before them, and then one that began anew in each step. */
typedef struct {
    real late[1 + TOGETHER][FORCE]; /* the change of each listed state */
    real newest;                    /* the index of the present lateness */
    int count;
} delays;

/* Move the changes of the states over one step, and add what the present lateness changes during it. */
static void step_delays(const filter *f, const sparse *phi, const real late[FORCE], delays *d)
{
    const int moving = count_before(f, FORCE);
    for (int k = 0; k < d->count; k++) {
        real before[FORCE];
        memcpy(before, d->late[k], (size_t)moving * sizeof before[0]);
        for (int a = 0; a < moving; a++) {
            real sum = d->newest == (double)k ? late[f->listed[a]] : 0.0;
            for (int c = 0; c < phi->count[a] && phi->column[a][c] < moving; c++) {
                sum += phi->entry[a][c] * before[phi->column[a][c]];
            }
            d->late[k][a] = sum;
        }
    }
}

/* Return the size of a slow process, which after some rows is larger than after others if it is a short force. */
static real size_of(const filter *f, int slow, ptrdiff_t row)
{
    const int axis = slow - (SHORT - FORCE);
    return f->set->size[slow] * (axis >= 0 && axis < N_AXES && f->log->beside ? f->log->beside[row * N_AXES + axis] : 1.0);
}

/* Return the variance that a slow process gains after a row. */
static real gained(const filter *f, int slow, const real remains[N_SLOW], ptrdiff_t row)
{
    const real size = size_of(f, slow, row);
    return (1.0 - remains[slow] * remains[slow]) * size * size;
}

/* Move the covariance over a few steps, with the changes by the lateness. */
static void step_covariance(const filter *f, real P[N_X][ROW], int steps, const delays *d, real remains[N_SLOW], ptrdiff_t row)
{
    const sparse *const phi = transition_over(f, steps, remains);
    const double early = 0.5 * (steps - 1) / steps; /* what a slow process gains in a step acts in those after it: the mean share */
    const int n = f->count, last = n - 1, moving = count_before(f, FORCE);
    real(*const moved)[ROW] = f->m->moved;
    for (int a = moving; a < last; a++) {
        P[a][a] += early * gained(f, f->listed[a] - FORCE, remains, row);
    }
    multiply(phi, moving, P, n, moved);
    for (int a = 0; a < moving; a++) {
        for (int b = 0; b < n; b++) {
            moved[a][b] += d->late[0][a] * P[last][b];
        }
    }
    for (int b = 0; b < moving; b++) {
        for (int first = b; first < moving; first += BLOCK) {
            real sum[BLOCK];
            for (int i = 0; i < BLOCK; i++) {
                sum[i] = moved[first + i][last] * d->late[0][b];
            }
            for (int c = 0; c < phi->count[b]; c++) {
                for (int i = 0; i < BLOCK; i++) {
                    sum[i] += moved[first + i][phi->column[b][c]] * phi->entry[b][c];
                }
            }
            for (int i = 0; i < BLOCK && first + i < moving; i++) {
                for (int k = 1; k < d->count; k++) {
                    sum[i] += d->late[k][first + i] * d->late[k][b];
                }
                P[first + i][b] = P[b][first + i] = flushed(sum[i]);
            }
        }
        P[b][last] = P[last][b] = flushed(moved[b][last]);
    }
    for (int a = moving; a < last; a++) {
        const int slow = f->listed[a] - FORCE;
        for (int b = 0; b < moving; b++) {
            P[a][b] = P[b][a] = flushed(remains[slow] * moved[b][a]);
        }
        for (int b = moving; b < a; b++) {
            P[a][b] = P[b][a] = flushed(remains[slow] * remains[f->listed[b] - FORCE] * P[a][b]);
        }
        P[a][last] = P[last][a] = flushed(remains[slow] * P[a][last]);
        const real gain = gained(f, slow, remains, row);
        P[a][a] = remains[slow] * remains[slow] * (P[a][a] - early * gain) + gain;
    }
    for (int k = 1; k < d->count; k++) { /* what began anew is not correlated with anything that it did not change */
        for (int b = 0; b <= last; b++) {
            const real own = b < moving ? d->late[k][b] : (real)(b == last ? 1.0 : 0.0);
            P[b][last] = P[last][b] = d->newest == (double)k ? own : P[last][b];
        }
    }
}

/* ---- Steps and samples -------------------------------------------------------------------------------------------- */

/* Add to `late` the change of each listed state by the growth of the lateness over a step. */
static void add_growth(const filter *f, const real middle[N_X], ptrdiff_t row, real growth, real late[FORCE])
{
    real r0[N_STATES], r1[N_STATES];
    model_held q;
    scale_thrust(middle, commanded(f, row - 1), &q);
    rates(f, middle, &q, r0);
    scale_thrust(middle, commanded(f, row), &q);
    rates(f, middle, &q, r1);
    for (int i = 0; i < N_STATES; i++) {
        late[i] += fmax(growth, 0.0) * (r1[i] - r0[i]);
    }
}

/* Move a belief from one time to another in a number of steps. */
static void advance(filter *f, belief *b, double from, double to, int pieces, bool has_covariance)
{
    const double h = (to - from) / pieces;
    const int vehicle = count_before(f, LAGGED), moving = count_before(f, FORCE);
    ptrdiff_t row = f->row;
    real reset = f->reset, once[N_SLOW];
    lagging part[MOST_SENSORS], halves[2][MOST_SENSORS];
    real slope[MOST_SENSORS][N_X];
    matrices *const m = f->m;
    delays d;
    memset(once, 0, sizeof once);
    for (int a = moving; a < f->count - 1; a++) {
        once[f->listed[a] - FORCE] = exp(-h / f->set->time_constant[f->listed[a] - FORCE]);
    }
    for (int piece = 0; piece < pieces; piece++) {
        const double begin = from + piece * h, end = begin + h;
        real held[N_HELD], middle[N_X], late[FORCE], remains[N_SLOW];
        while (row + 1 < f->log->rows && ALL(ends(f, row + 1) <= begin)) {
            row++;
        }
        for (int a = vehicle; a < moving && piece == 0; a++) {
            const int sensor = f->listed[a] - LAGGED;
            part[sensor] = lagging_over(f, sensor, h);
            halves[0][sensor] = lagging_over(f, sensor, 0.5 * h);
            halves[1][sensor] = lagging_over(f, sensor, 0.5 * h);
        }
        set_tilt(f, 0.5 * (begin + end));
        mean_thrust(f, row, begin, end, held);
        step_mean(f, b->x, held, h, once, halves, middle);
        if (!has_covariance) {
            continue;
        }
        if (piece % TOGETHER == 0) {
            slopes(f, middle, held, &m->A);
            transition(f, &m->A, h, &m->once);
            transition_lagged(f, middle, part, once, &m->once, slope);
            memset(d.late[0], 0, sizeof d.late[0]);
            d.newest = 0.0;
            d.count = 1;
        }
        memset(late, 0, sizeof late);
        for (ptrdiff_t j = row + 1; j < f->log->rows && ANY(begins(f, j) < end); j++) {
            const real growth = spread(f, j, end) - spread(f, j, begin);
            const mask begins_anew = begins(f, j) < end && reset < (double)j;
            if (f->log->anew[j] != 0 && ANY(begins_anew)) {
                reset = begins_anew ? (double)j : reset;
                d.newest = begins_anew ? (double)(1 + piece % TOGETHER) : d.newest;
                while (d.count < 2 + piece % TOGETHER) {
                    memset(d.late[d.count++], 0, sizeof d.late[0]);
                }
            }
            if (ANY(growth > 0.0)) {
                add_growth(f, middle, j, growth, late);
            }
        }
        for (int a = vehicle; a < moving; a++) {
            const int sensor = f->listed[a] - LAGGED;
            for (int c = 0; c < vehicle; c++) {
                late[f->listed[a]] += part[sensor].end * slope[sensor][c] * late[f->listed[c]];
            }
        }
        step_delays(f, &m->once, late, &d);
        if (piece % TOGETHER == TOGETHER - 1 || piece == pieces - 1) {
            memcpy(remains, once, sizeof remains);
            step_covariance(f, b->P, 1 + piece % TOGETHER, &d, remains, row);
        }
    }
}

/* Move the rows on that are over before a time. */
static void pass_rows(filter *f, double time)
{
    const record *log = f->log;
    while (f->row + 1 < log->rows && ALL(ends(f, f->row + 1) <= time)) {
        f->row++;
    }
    for (ptrdiff_t j = f->row > 0 ? f->row : 1; j < log->rows && ANY(begins(f, j) < time); j++) {
        f->reset = begins(f, j) < time && f->log->anew[j] != 0 ? fmax(f->reset, (double)j) : f->reset;
    }
}

/* Return the innovation of a sample. Angles are compared within half a turn. */
static real innovation(const filter *f, const belief *b, ptrdiff_t k)
{
    const int sensor = f->log->sensor[k];
    const real value = lags(f, sensor) ? b->x[LAGGED + sensor] : at_once(f, b->x, sensor);
    const real off = f->log->value[k] - value - b->x[NOISE + sensor];
    return wraps(f, sensor) ? wrapped(off) : off;
}

/* Compute P H and return the variance H P H + white noise. */
static real project(const filter *f, const belief *b, ptrdiff_t sensor, real PH[N_X])
{
    const real white = f->set->white[sensor];
    real H[N_X], variance = white * white;
    if (lags(f, sensor)) {
        memset(H, 0, (size_t)f->count * sizeof H[0]);
    } else {
        gradient(f, b->x, sensor, H);
    }
    for (int c = 0; c < f->count; c++) {
        if (f->listed[c] == LAGGED + sensor || f->listed[c] == NOISE + sensor) {
            H[c] = 1.0;
        }
    }
    memset(PH, 0, (size_t)f->count * sizeof PH[0]);
    for (int c = 0; c < f->count; c++) {
        if (ANY(H[c] != 0.0)) {
            for (int a = 0; a < f->count; a++) {
                PH[a] += H[c] * b->P[c][a];
            }
        }
    }
    for (int c = 0; c < f->count; c++) {
        variance += H[c] * PH[c];
    }
    return variance;
}

/* Correct the states by an innovation. The quaternion keeps the length 1. */
static void correct(const filter *f, belief *b, const real gain[N_X], real off)
{
    for (int a = 0; a < f->count; a++) {
        const int i = f->listed[a];
        b->x[i] += f->set->unit[i] * gain[i] * off;
    }
    if (f->where->quaternion >= 0) {
        real *q = b->x + f->where->quaternion - FIRST_STATE;
        const real length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int i = 0; i < 4; i++) {
            q[i] /= length;
        }
    }
}

/* Take one sample into the belief, and write its innovation, its variance and its gain. A sample far beside its prediction counts less.
 * If the sensor's sample before was, too, it has its full weight: then the state is lost, and not the sample. */
static void take(filter *f, belief *b, ptrdiff_t k, int repeats, real *off, real *variance, real gain[N_X])
{
    const int sensor = f->log->sensor[k];
    *off = innovation(f, b, k);
    if (repeats == 2) {
        correct(f, b, gain, *off);
        return;
    }
    real PH[N_X];
    *variance = project(f, b, sensor, PH);
    const real size = fabs(*off) / sqrt(*variance);
    const mask is_beside = size > OUTLYING;
    const real weight = is_beside & ~f->beside[sensor] ? OUTLYING / size : 1.0;
    f->beside[sensor] = is_beside;
    for (int a = 0; a < f->count; a++) {
        const real share = weight * PH[a] / *variance;
        gain[f->listed[a]] = share / f->set->unit[f->listed[a]];
        for (int c = 0; c < f->count; c++) {
            b->P[a][c] -= share * PH[c];
        }
    }
    correct(f, b, gain, *off);
}

#if LANES == 1
/* Return how many steps the time before a sample needs: none is longer than `longest`, or than a share of the fastest time constant.
 * Steps in which a command changes are shorter, because they take the mean of the thrust. The mean of a sample hardly shows it. */
static int pieces_over(const filter *f, double from, double to)
{
    double fastest = 1.0 / f->log->longest;
    const sparse *const A = &f->m->A;
    slopes(f, f->now.x, commanded(f, f->row), &f->m->A);
    for (int i = 0; i < N_STATES; i++) {
        for (int k = 0; k < A->count[i]; k++) {
            fastest = fmax(fastest, f->listed[A->column[i][k]] == i ? fabs(A->entry[i][k]) / f->log->share : 0.0);
        }
    }
    for (ptrdiff_t j = f->row + 1; j < f->log->rows && begins(f, j) < to + MARGIN; j++) {
        if (ends(f, j) > from - MARGIN && f->log->anew[j] != 0) {
            fastest = fmax(fastest, 1.0 / f->log->changing);
        }
    }
    return (int)fmin(fmax(ceil((to - from) * fastest - 1e-6), 1.0), 1e5);
}
#endif

/* Let each sensor with a lag begin with what it would measure at once. The error of this is the lag times a rate of change, whose
 * standard deviation is the `error` of its state. */
static void begin_lagged(filter *f)
{
    const int vehicle = count_before(f, LAGGED), moving = count_before(f, FORCE);
    belief *const b = &f->now;
    for (int a = vehicle; a < moving; a++) {
        const int sensor = f->listed[a] - LAGGED;
        const real off = f->set->lag[sensor] * f->log->error[LAGGED + sensor];
        real H[N_X], variance = off * off;
        b->x[LAGGED + sensor] = at_once(f, b->x, sensor);
        gradient(f, b->x, sensor, H);
        b->P[a][a] = 0.0;
        for (int d = 0; d < f->count; d++) {
            real sum = 0.0;
            for (int c = 0; c < f->count; c++) {
                sum += H[c] * b->P[c][d];
            }
            if (d != a) {
                b->P[a][d] = b->P[d][a] = sum;
                variance += H[d] * sum;
            }
        }
        b->P[a][a] = variance;
    }
}

/* Begin a run: take the sets of parameters of all lanes, and compute the thrust of each row. */
static void begin_run(filter *f, const parameter_set sets[LANES])
{
    const record *const log = f->log;
    real *const numbers = (real *)f->set;
    for (int i = 0; i < LANES; i++) {
        for (size_t k = 0; k < sizeof(parameters) / sizeof(real); k++) {
            LANE(numbers[k], i) = sets[i].numbers[k];
        }
    }
    memcpy(f->at, f->set->at, sizeof f->set->at);
    model_prepare(f->at, &f->n);
    for (ptrdiff_t j = 0; j < log->rows; j++) {
        for (int k = 0; k < N_INPUTS; k++) {
            for (int i = 0; i < LANES; i++) {
                LANE(f->at[k], i) = LANE(f->set->at[k], i) + sets[i].inputs[j * N_INPUTS + k];
            }
        }
        memset(&f->thrust[j], 0, sizeof f->thrust[j]);
        model_thrust(f->at, &f->thrust[j]);
    }
    memcpy(f->at, f->set->at, sizeof f->set->at);
    for (int i = 0; i < N_X; i++) {
        f->now.x[i] = log->start[i];
        if (log->active[i]) {
            real *const variance = &f->now.P[f->count][f->count];
            *variance = i >= FORCE && i < LATENESS ? size_of(f, i - FORCE, 0) : log->error[i];
            *variance *= *variance;
            f->listed[f->count++] = i;
        }
    }
    pass_rows(f, log->time[0]);
    set_tilt(f, log->time[0]);
    begin_lagged(f);
    f->ahead = f->now;
}

/* Run through a log with the parameters of each lane. failed[lane] becomes 1 when a number is not finite, and the run ends when this
 * is so for all. `memory` has room for a filter, its matrices, and then one model_held per row. */
EXPORT void run_filter(const places *where, const record *log, const parameter_set sets[LANES], const mode *how,
                       const output results[LANES], int failed[LANES], filter *memory)
{
    real at[N_VARIABLES];
    parameters numbers;
    filter *const f = memory;
    memset(f, 0, sizeof *f);
    f->where = where;
    f->log = log;
    f->set = &numbers;
    f->at = at;
    f->m = (matrices *)(memory + 1);
    f->thrust = (model_held *)(f->m + 1);
    memset(&f->m->last, 0, sizeof f->m->last);
    memset(f->m->knows, 0, sizeof f->m->knows);
    f->m->last.cosine = 1.0;
    begin_run(f, sets);
    const bool has_covariance = how->repeats != 2, predicts = how->begin >= 0.0;
    double restart = log->time[0] + how->begin, last = log->time[0];
    int *const pieces = results[0].pieces, running = LANES;
    memset(failed, 0, LANES * sizeof failed[0]);
    for (ptrdiff_t k = 0; k < log->samples && running > 0; k++) {
        const double h = log->time[k] - last;
        real off, variance = 0.0, gain[N_X];
        if (h > 0.0) {
#if LANES == 1
            pieces[k] = how->repeats == 0 ? pieces_over(f, last, log->time[k]) : pieces[k];
#endif
            advance(f, &f->now, last, log->time[k], pieces[k], has_covariance);
            if (predicts) {
                advance(f, &f->ahead, last, log->time[k], pieces[k], has_covariance);
            }
            last = log->time[k];
            pass_rows(f, last);
            set_tilt(f, last);
        }
        if (predicts && log->time[k] >= restart) {
            f->ahead = f->now;
            restart += how->span * (floor((log->time[k] - restart) / how->span) + 1.0);
        }
        for (int i = 0; i < LANES && how->repeats == 2; i++) {
            for (int a = 0; a < f->count; a++) {
                LANE(gain[f->listed[a]], i) = results[i].gain[k * N_X + f->listed[a]];
            }
        }
        take(f, &f->now, k, how->repeats, &off, &variance, gain);
        if (predicts) {
            real PH[N_X];
            off = innovation(f, &f->ahead, k);
            if (has_covariance) {
                variance = project(f, &f->ahead, log->sensor[k], PH);
            }
        }
        for (int i = 0; i < LANES; i++) {
            const output *const to = &results[i];
            if (failed[i] != 0 || !isfinite(LANE(off, i))) {
                running -= failed[i] == 0;
                failed[i] = 1;
                continue;
            }
            to->innovation[k] = LANE(off, i);
            if (has_covariance) {
                to->variance[k] = LANE(variance, i);
            }
            for (int a = 0; a < f->count && has_covariance && to->gain; a++) {
                to->gain[k * N_X + f->listed[a]] = LANE(gain[f->listed[a]], i);
            }
            for (int a = 0; a < f->count && to->states; a++) {
                to->states[k * N_X + f->listed[a]] = LANE(f->now.x[f->listed[a]], i);
                to->deviations[k * N_X + f->listed[a]] = sqrt(LANE(f->now.P[a][a], i));
            }
        }
    }
}

/* Return the sizes that Python needs to lay out its arrays. */
EXPORT void filter_sizes(int sizes[8])
{
    const int held = (int)sizeof(model_held), whole = (int)(sizeof(filter) + sizeof(matrices));
    const int found[8] = {N_X, N_AXES, MOST_SENSORS, N_VARIABLES, N_INPUTS, held, whole, LANES};
    memcpy(sizes, found, sizeof found);
}
