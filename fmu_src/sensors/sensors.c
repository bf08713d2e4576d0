/* What the instruments of a vehicle tell, in the place of a vehicle's step.c, for the same functions of FMI. It samples what is true at the
 * start of a step. A sample is drawn by its number and the seed, and only by additions, multiplications, divisions and square roots of IEEE 754,
 * so that it has the same bits on every platform, in both versions of FMI, and with every step. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "model.h"

/* What is told, in the order of TRUE_AT and TOLD_AT (model.h), by instrument. */
enum {
    X, Y,                                         /* the position */
    Z, SINKING,                                   /* the depth, and the velocity downward */
    U, V, W, NORTHWARD, EASTWARD,                 /* the velocity through the water and over ground */
    PSI, ETA, EPSILON_1, EPSILON_2, EPSILON_3, TURN_P, TURN_Q, TURN_R, /* the attitude, and how it turns */
    CHANNELS
};
enum { POSITION, DEPTH_SENSOR, VELOCITY, ATTITUDE, INSTRUMENTS };
static const int FIRST_OF[INSTRUMENTS + 1] = {X, Z, U, PSI, CHANNELS};

/* Each channel has errors of a kind. The errors of the attitude are those of the heading and of two tilts, whose numbers are drawn for psi and the
 * first two parts of the vector of the quaternion. */
enum { OF_POSITION, OF_DEPTH, OF_SINKING, OF_VELOCITY, OF_HEADING, OF_TILT, OF_TURN, KINDS };
static const int KIND_OF[CHANNELS] = {OF_POSITION, OF_POSITION, OF_DEPTH,   OF_SINKING, OF_VELOCITY, OF_VELOCITY, OF_VELOCITY, OF_VELOCITY, OF_VELOCITY,
                                      OF_HEADING,  OF_TILT,     OF_TILT,    OF_TILT,    OF_TILT,     OF_TURN,     OF_TURN,     OF_TURN};

/* The parameters, in the order of the variables from FIRST_PARAMETER on. A rate of 0 is a sample in each step; a limit of 0 is none. */
typedef struct {
    double rate, delay, time, lost_from, lost_for;
} device;
typedef struct {
    double noise, wander, resolution;
} errors;
typedef struct {
    double ideal, seed, seabed;
    device of[INSTRUMENTS];
    errors kinds[KINDS];
    double place[ATTITUDE][3]; /* forward, starboard and down of the vehicle's origin, m */
    double outliers, outlier_size, lag, per_ampere, least, most;
} model_numbers;

enum { WAITING = 32, MOST_OF = 8 };
#define SKIPPED 10000.0

/* Samples of an instrument, the newest first, each with the time from which it is told. */
typedef struct {
    double due[WAITING], taken[WAITING], is_valid[WAITING], value[WAITING][MOST_OF];
    double next; /* the number of the next sample */
} queue;

typedef struct {
    queue of[INSTRUMENTS];
    double wander[CHANNELS], lagging[2];
} delay_line;
#define LINE_OF_DOUBLES

#include "sampled.c"

static void model_prepare(const double at[], model_numbers *n)
{
    memcpy(n, at + FIRST_PARAMETER, sizeof *n);
    if (n->ideal != 0.0) { /* every other number is a fault */
        memset(&n->of, 0, sizeof *n - offsetof(model_numbers, of));
    }
}

/* ---- Noise ---- */

/* Return bits that look random and follow from a number (the last step of SplitMix64; Steele, Lea and Flood, 2014). */
static uint64_t mixed(uint64_t x)
{
    x += UINT64_C(0x9e3779b97f4a7c15);
    x = (x ^ x >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ x >> 27) * UINT64_C(0x94d049bb133111eb);
    return x ^ x >> 31;
}

static uint64_t drawn(double seed, double number, int stream)
{
    return mixed(mixed(mixed((uint64_t)seed) ^ (uint64_t)fmin(number, 9e18)) + (uint64_t)stream);
}

/* Return a number of a normal distribution: the sum of 12 uniform ones, which a polynomial corrects (Teichroew; Abramowitz and Stegun, 26.8.6). */
static double normal(double seed, double number, int stream)
{
    double sum = 0.0;
    for (int i = 0; i < 4; i++) {
        const uint64_t bits = drawn(seed, number, 4 * stream + i);
        for (int j = 0; j < 3; j++) {
            sum += ((double)(bits >> 21 * j & 0x1fffff) + 0.5) / 2097152.0;
        }
    }
    const double x = 0.25 * (sum - 6.0), y = x * x;
    return ((((0.029899776 * y + 0.008355968) * y + 0.076542912) * y + 0.252408784) * y + 3.949846138) * x;
}

/* Return how an offset with a standard deviation of 1 wanders on in a part of its correlation time (Gauss and Markov, first order). The factor is
 * exp(-part) to second order. */
static double wandered(double offset, double part, double random)
{
    const double kept = (2.0 - fmin(part, 2.0)) / (2.0 + fmin(part, 2.0));
    return kept * offset + sqrt(1.0 - kept * kept) * random;
}

/* ---- Geometry ---- */

/* Return the sine of an angle, a quarter of a turn later for each `quarters`: by its series, with the same bits everywhere. */
static double sine(double angle, double quarters)
{
    const double whole = floor(angle / 1.5707963267948966 + 0.5), x = angle - whole * 1.5707963267948966, y = x * x;
    const double quarter = whole + quarters - 4.0 * floor((whole + quarters) / 4.0);
    const bool is_cosine = quarter == 1.0 || quarter == 3.0;
    double sum = 1.0;
    for (int i = 18; i > 0; i -= 2) {
        sum = 1.0 - sum * y / (is_cosine ? i * (i - 1) : i * (i + 1));
    }
    return (quarter >= 2.0 ? -sum : sum) * (is_cosine ? 1.0 : x);
}

static void cross(const double a[3], const double b[3], double product[3])
{
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        product[i] = a[j] * b[k] - a[k] * b[j];
    }
}

/* Turn a vector of the body frame north, east and down. */
static void turned(const double q[4], const double v[3], double result[3])
{
    double once[3], twice[3];
    cross(q + 1, v, once);
    cross(q + 1, once, twice);
    for (int i = 0; i < 3; i++) {
        result[i] = v[i] + 2.0 * (q[0] * once[i] + twice[i]);
    }
}

/* ---- Samples ---- */

/* Add what the place of an instrument adds to the motion of the vehicle's origin. */
static void move_to(const double place[3], double now[CHANNELS])
{
    const double by_heading[4] = {sine(0.5 * now[PSI], 1.0), 0.0, 0.0, sine(0.5 * now[PSI], 0.0)};
    const double *const q = TRUE_AT[ETA] >= 0 ? now + ETA : by_heading;
    double apart[3], speed[3], over_ground[3];
    turned(q, place, apart);
    cross(now + TURN_P, place, speed);
    turned(q, speed, over_ground);
    now[X] += apart[0], now[Y] += apart[1], now[Z] += apart[2];
    now[U] += speed[0], now[V] += speed[1], now[W] += speed[2];
    now[NORTHWARD] += over_ground[0], now[EASTWARD] += over_ground[1], now[SINKING] += over_ground[2];
}

/* Turn the attitude by the errors of the tilts to the north and to the east, and of the heading. */
static void turn_attitude(double now[CHANNELS], const double error[CHANNELS])
{
    const double a = 0.5 * error[EPSILON_1], b = 0.5 * error[EPSILON_2], c = 0.5 * error[PSI], size = sqrt(1.0 + a * a + b * b + c * c);
    const double w = now[ETA], x = now[EPSILON_1], y = now[EPSILON_2], z = now[EPSILON_3];
    now[ETA] = (w - a * x - b * y - c * z) / size;
    now[EPSILON_1] = (x + a * w + b * z - c * y) / size;
    now[EPSILON_2] = (y + b * w + c * x - a * z) / size;
    now[EPSILON_3] = (z + c * w + a * y - b * x) / size;
    now[PSI] += error[PSI];
}

/* Let the offsets of an instrument wander up to its sample with a number, `count` samples after the last one. Where more than SKIPPED are skipped,
 * nothing is left of the last one. */
static void wander(const model_numbers *n, int instrument, double number, double count, double period, double offset[CHANNELS])
{
    const double time = n->of[instrument].time;
    const bool is_new = count > SKIPPED || time == 0.0;
    for (int c = FIRST_OF[instrument]; c < FIRST_OF[instrument + 1]; c++) {
        for (int k = is_new ? 0 : (int)count - 1; k >= 0 && n->kinds[KIND_OF[c]].wander > 0.0; k--) {
            offset[c] = wandered(offset[c], is_new ? 2.0 : period / time, normal(n->seed, number - k, CHANNELS + c));
        }
    }
}

/* Take the sample of an instrument with a number, which is one of the time t. */
static void take(const double at[], const model_numbers *n, int instrument, double number, double period, double t, delay_line *line)
{
    const device *const own = &n->of[instrument];
    queue *const q = &line->of[instrument];
    const bool is_first = q->next == 0.0;
    const double count = is_first ? SKIPPED + 1.0 : number - q->next + 1.0;
    double now[CHANNELS], error[CHANNELS];
    for (int c = 0; c < CHANNELS; c++) {
        now[c] = value_at(at, TRUE_AT[c]);
    }
    if (instrument != ATTITUDE) {
        move_to(n->place[instrument], now);
    }
    wander(n, instrument, number, count, period, line->wander);
    for (int c = FIRST_OF[instrument]; c < FIRST_OF[instrument + 1]; c++) {
        const errors *const kind = &n->kinds[KIND_OF[c]];
        error[c] = kind->noise * normal(n->seed, number, c) + kind->wander * line->wander[c];
    }
    bool is_valid = !(own->lost_for > 0.0 && t >= own->lost_from && t < own->lost_from + own->lost_for);
    if (instrument == POSITION && (double)(drawn(n->seed, number, 4 * (2 * CHANNELS)) >> 11) < 9007199254740992.0 * n->outliers) {
        error[X] += n->outlier_size * normal(n->seed, number, 2 * CHANNELS + 1);
        error[Y] += n->outlier_size * normal(n->seed, number, 2 * CHANNELS + 2);
    }
    if (instrument == VELOCITY && n->seabed > 0.0) {
        const double altitude = n->seabed - now[Z];
        is_valid = is_valid && altitude >= n->least && (n->most == 0.0 || altitude <= n->most);
    }
    if (instrument == ATTITUDE) {
        error[PSI] += n->per_ampere * at[ELECTRIC_CURRENT_AT];
        turn_attitude(now, error);
    }
    if (instrument == DEPTH_SENSOR) {
        for (int i = 0; i < 2; i++) {
            const double passes = is_first || n->lag == 0.0 ? 1.0 : count * period / (count * period + n->lag);
            line->lagging[i] += passes * (now[Z + i] - line->lagging[i]);
            now[Z + i] = passes == 1.0 ? now[Z + i] : line->lagging[i];
        }
    }
    memmove(q->due + 1, q->due, sizeof q->due - sizeof q->due[0]);
    memmove(q->taken + 1, q->taken, sizeof q->taken - sizeof q->taken[0]);
    memmove(q->is_valid + 1, q->is_valid, sizeof q->is_valid - sizeof q->is_valid[0]);
    memmove(q->value + 1, q->value, sizeof q->value - sizeof q->value[0]);
    for (int c = FIRST_OF[instrument]; c < FIRST_OF[instrument + 1] && (is_valid || is_first); c++) {
        const double resolution = n->kinds[KIND_OF[c]].resolution;
        const double told = now[c] + (instrument == ATTITUDE && c < TURN_P ? 0.0 : error[c]);
        q->value[0][c - FIRST_OF[instrument]] = resolution > 0.0 ? floor(told / resolution + 0.5) * resolution : told;
    }
    q->is_valid[0] = is_valid ? 1.0 : 0.0;
    q->taken[0] = t;
    q->due[0] = q->taken[0] + fmin(own->delay, (WAITING - 1) * period);
    q->next = number + 1.0;
    for (int k = 1; is_first && k < WAITING; k++) { /* nothing was there before the start but what there is now */
        memcpy(q->value[k], q->value[0], sizeof q->value[0]);
        q->is_valid[k] = q->is_valid[0];
        q->due[k] = -1.0;
    }
}

/* Take the samples that are due at t, and put what is told at t + h among the variables. Return false if it is not finite. */
static bool sense(double at[], const model_numbers *n, delay_line *line, double t, double h)
{
    double told[CHANNELS], taken[INSTRUMENTS], is_valid[INSTRUMENTS];
    for (int i = 0; i < INSTRUMENTS; i++) {
        queue *const q = &line->of[i];
        const bool in_each_step = n->of[i].rate == 0.0;
        const double period = in_each_step ? h : 1.0 / n->of[i].rate, last = in_each_step ? q->next : floor(t / period + 1e-6);
        if (last >= q->next) {
            take(at, n, i, last, period, in_each_step || t > (last + 1e-6) * period ? t : last * period, line);
        }
        int k = 0;
        while (k < WAITING - 1 && q->due[k] > t + h + 1e-6 * period) {
            k++;
        }
        memcpy(told + FIRST_OF[i], q->value[k], (size_t)(FIRST_OF[i + 1] - FIRST_OF[i]) * sizeof told[0]);
        taken[i] = q->taken[k];
        is_valid[i] = q->is_valid[k];
    }
    if (!all_finite((const double *)line, (int)(sizeof *line / sizeof(double)))) {
        return false;
    }
    for (int c = 0; c < CHANNELS; c++) {
        if (TOLD_AT[c] >= 0) {
            at[TOLD_AT[c]] = told[c];
        }
    }
    memcpy(at + FIRST_TIME, taken, sizeof taken);
    memcpy(at + FIRST_VALID, is_valid, sizeof is_valid);
    return true;
}

/* Before the first step, the instruments tell what the inputs now are. */
static void model_calculate(double at[], const model_numbers *n, double heading)
{
    (void)heading;
    at[FIRST_CALCULATED] = 1.0;
    if (at[FIRST_STATE] == 0.0) {
        delay_line first;
        memset(&first, 0, sizeof first);
        sense(at, n, &first, 0.0, 0.0);
    }
}

static int delayed_step(double at[], const model_numbers *n, delay_line *line, double t, double h, double next[], double *heading)
{
    delay_line tried = *line;
    (void)t, (void)heading;
    if (!sense(at, n, &tried, at[FIRST_STATE], h)) {
        return 0; /* inputs beyond all measure: nothing of this is kept */
    }
    *line = tried;
    next[0] = at[FIRST_STATE] + h;
    return 1;
}
