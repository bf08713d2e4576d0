/* The autopilot in the place of a vehicle's step.c, for the same functions of FMI. Sensors, memory, gains and commands lie among the
 * variables; the tables of the thrusters are constants (model.h). It samples at the start of a step, and its commands are there at the end. */
#include "autopilot.c"

enum { N_STATE = sizeof(loop_state) / sizeof(double), N_GAINS = sizeof(loop_gains) / sizeof(double) };

/* The inputs that say whether the place and the rate of an axis are measured: those of position, depth, velocity and attitude. */
static const int PLACE_BY[AXES] = {0, 0, 1, 3, 3, 3}, RATE_BY[AXES] = {2, 2, 1, 3, 3, 3};

typedef struct {
    loop_gains gains[AXES];
} model_numbers;

typedef struct {
    int waiting; /* no command waits: C has no empty struct */
} delay_line;

#include "sampled.c"

static void model_prepare(const double at[], model_numbers *n)
{
    for (int a = 0; a < AXES; a++) {
        double *const gains = (double *)&n->gains[a];
        for (int i = 0; i < N_GAINS; i++) {
            gains[i] = value_at(at, GAIN_AT[a][i]);
        }
    }
}

static void model_calculate(double at[], const model_numbers *n, double heading)
{
    (void)n, (void)heading;
    at[FIRST_CALCULATED] = 1.0; /* the rate of the time since the start */
}

/* Set the Euler angles to those of the quaternion, if the pose has one. */
static void angles_of(const double at[], double angle[3])
{
    if (QUATERNION_AT >= 0) {
        const double *const q = at + QUATERNION_AT, w = q[0], x = q[1], y = q[2], z = q[3];
        angle[0] = atan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z);
        angle[1] = asin(fmin(fmax(2.0 * (w * y - x * z), -1.0), 1.0));
        angle[2] = atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z);
    }
}

static int delayed_step(double at[], const model_numbers *n, delay_line *line, double t, double h, double next[], double *heading)
{
    double values[sizeof(sensor_values) / sizeof(double)], mode[AXES], aim[AXES], demand[AXES];
    double commands[MOST_THRUSTERS], outputs[MOST_THRUSTERS];
    double held[AXES];
    loop_state state[AXES];
    sensor_values now;
    (void)line, (void)t, (void)heading;
    for (int i = 0; i < (int)(sizeof values / sizeof values[0]); i++) {
        values[i] = value_at(at, SENSOR_AT[i]);
    }
    angles_of(at, values + ROLL_AXIS);
    memcpy(&now, values, sizeof now);
    for (int a = 0; a < AXES; a++) {
        const double asked = floor(value_at(at, AIM_AT[a][0]) + 0.5);
        const bool has_place = at[FIRST_VALID + PLACE_BY[a]] > 0.5, has_rate = at[FIRST_VALID + RATE_BY[a]] > 0.5;
        mode[a] = !has_rate ? STICK : asked == PLACE && !has_place ? STOP : asked;
        held[a] = mode[a] == asked ? 1.0 : 0.0;
        aim[a] = mode[a] == STOP ? 0.0 : value_at(at, AIM_AT[a][1 + (int)mode[a]]);
        memset(&state[a], 0, sizeof state[a]);
        if (STATE_AT[a] >= 0) {
            memcpy(&state[a], at + STATE_AT[a], sizeof state[a]);
        }
    }
    autopilot_step(n->gains, (const sharing *)(const void *)SHARING, state, &now, mode, aim, 1.0 - at[SAG_AT], h, commands, demand, outputs);
    if (!all_finite(commands, N_OUTPUTS) || !all_finite((const double *)state, AXES * N_STATE)) {
        return 0; /* sensors beyond all measure: nothing of this is kept */
    }
    memcpy(at + FIRST_COMMAND, commands, N_OUTPUTS * sizeof commands[0]);
    for (int a = 0; a < AXES; a++) {
        if (STATE_AT[a] >= 0) {
            memcpy(at + STATE_AT[a], &state[a], sizeof state[a]);
            at[HELD_AT[a]] = held[a];
        }
    }
    next[0] = at[FIRST_STATE] + h;
    return 1;
}
