/* The attitude of a vehicle that rolls or pitches, followed through every piece of a step. Two things depend on the whole
 * motion: how often the heading has turned, and which of its two signs the quaternion has.
 *
 * Where the nose passes the vertical, the heading jumps by half a turn, to the one side or the other. Rounding must not
 * choose the side, so turns are counted for a direction that points 1e-6 rad beside the nose. */

#define TWO_PI 6.283185307179586

/* The direction in the body frame: ahead, to starboard, down. It lies in no plane in which a vehicle is likely to turn. */
static const double BESIDE_NOSE[3] = {1.0, 1e-6, 0.618e-6};

enum { MOST_PARTS = 4096 }; /* of a piece, between which the heading is computed */

static void model_attitude(const real y[N_SERIES], real state[N_STATES]);
static void model_rotation(const real at[], real y[N_SERIES]);
static real series_change(const series *s, int i, real t);

/* Compute the rotation matrix among the states of the table at time t of a motion. */
typedef void rotation_at(const void *motion, real t, real y[N_SERIES]);

/* Return the angle that differs from an angle by whole turns and is the nearest to another one. */
static real unwrapped(real angle, real near)
{
    return angle + TWO_PI * floor((near - angle) / TWO_PI + 0.5);
}

/* Compute the horizontal part, north and east, of the direction beside the nose. Each row has three entries of the rotation matrix. */
static void beside_nose(const real row_1[3], const real row_2[3], real horizontal[2])
{
    horizontal[0] = horizontal[1] = 0.0;
    for (int i = 2; i >= 0; i--) {
        horizontal[0] += BESIDE_NOSE[i] * row_1[i];
        horizontal[1] += BESIDE_NOSE[i] * row_2[i];
    }
}

/* Return the heading that counts turns, which differs from `near` by at most half a turn. It is that of a direction beside the
 * nose. */
static real model_heading(const real at[], real near)
{
    real y[N_SERIES], horizontal[2];
    model_rotation(at, y);
    beside_nose(&y[Y_R_11], &y[Y_R_21], horizontal);
    return unwrapped(atan2(horizontal[1], horizontal[0]), near);
}

/* Follow the attitude from time 0, where the states are `start`, to `end`. Per unit of time, the vehicle turns by at most `turn`, and the direction beside the
 * nose by at most `swing`. In each part of this time, the direction moves by less than its distance from the vertical, so that
 * its heading is that of the same turn; and the vehicle turns by less than half a turn, so that its quaternion has the sign
 * that is nearer to the one before. */
static void attitude_follow(rotation_at *at, const void *motion, const real start[N_SERIES], real end, real turn, real swing,
                            real state[N_STATES], real *heading)
{
    const real shortest = end / (double)MOST_PARTS;
    real y[N_SERIES], horizontal[2], t = 0.0;
    memcpy(y, start, sizeof y);
    for (int n = 1; ANY(t < end); n++) {
        beside_nose(&y[Y_R_11], &y[Y_R_21], horizontal);
        const real distance = sqrt(horizontal[0] * horizontal[0] + horizontal[1] * horizontal[1]);
        const real part = fmin(0.9 * distance / swing, 2.0 / turn);
        t = n < MOST_PARTS ? fmin(t + fmax(part, shortest), end) : end;
        at(motion, t, y);
        model_attitude(y, state);
        beside_nose(&y[Y_R_11], &y[Y_R_21], horizontal);
        *heading = unwrapped(atan2(horizontal[1], horizontal[0]), *heading);
    }
}

/* A piece of a step: its series, its length, and the changes of the states up to its end, which are those of the series there. */
typedef struct {
    const series *s;
    real length;
    const real *change;
} piece;

static void rotation_in_piece(const void *motion, real t, real y[N_SERIES])
{
    const piece *const p = (const piece *)motion;
    const bool is_end = ALL(t == p->length);
    for (int i = 0; i < N_ROTATION; i++) {
        const int k = ROTATION[i];
        y[k] = p->s->c[0][k] + (is_end ? p->change[k] : series_change(p->s, k, t));
    }
}

/* Follow the attitude through a piece of a step. */
static void attitude_after_piece(const series *s, real length, const real change[N_SERIES], real state[N_STATES], real *heading)
{
    const piece whole = {s, length, change};
    real turn = 0.0, swing = 0.0;
    for (int i = FIRST_ROTATION; i < N_VELOCITIES; i++) {
        real size = 0.0; /* an upper bound of the angular velocity */
        for (int n = s->order; n >= 0; n--) {
            size = size * length + fabs(s->c[n][i]);
        }
        turn += size * s->unit;
        swing += (i == ROLL ? 2.0 * BESIDE_NOSE[1] : 1.0) * size * s->unit;
    }
    attitude_follow(rotation_in_piece, &whole, s->c[0], length, turn, swing, state, heading);
}

#if LANES == 1
/* A rotation with constant velocities. At the angle a, the rotation matrix is start + sin(a) along + (1 - cos(a)) across. */
typedef struct {
    double start[N_SERIES], along[N_SERIES], across[N_SERIES];
} circle;

static void rotation_on_circle(const void *motion, double angle, double y[N_SERIES])
{
    const circle *const c = (const circle *)motion;
    const double half = sin(0.5 * angle), whole = sin(angle);
    for (int i = 0; i < N_SERIES; i++) {
        y[i] = c->start[i] + whole * c->along[i] + 2.0 * half * half * c->across[i];
    }
}

/* Follow the attitude through a rotation with constant velocities. Every whole turn changes the heading by the same angle, and
 * the sign of the quaternion. */
static void attitude_after_circle(const circle *c, double angle, double state[N_STATES], double *heading)
{
    const double turns = floor(angle / TWO_PI), before = *heading;
    double swing = 0.0, once[N_STATES];
    for (int row = 0; row < 3; row++) {
        double rate = 0.0;
        for (int i = 0; i < 3; i++) {
            rate += BESIDE_NOSE[i] * c->along[ROTATION[3 * row + i]];
        }
        swing += rate * rate;
    }
    swing = sqrt(swing);
    memcpy(once, state, sizeof once);
    attitude_follow(rotation_on_circle, c, c->start, TWO_PI, 1.0, swing, once, heading);
    *heading = before + turns * (*heading - before);
    if (turns != 2.0 * floor(0.5 * turns)) { /* an odd number */
        memcpy(state, once, sizeof once);
    }
    attitude_follow(rotation_on_circle, c, c->start, angle - turns * TWO_PI, 1.0, swing, state, heading);
}
#endif
