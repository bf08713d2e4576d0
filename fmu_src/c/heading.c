/* The heading of a vehicle with an attitude, which is followed through every piece of a step, so that it counts turns. */

#define TWO_PI 6.283185307179586

static double series_change(const series *s, int i, double t);

typedef double angle_at(const void *motion, double t);

/* Return the angle that differs from an angle by whole turns and is the nearest to another one. */
static double unwrapped(double angle, double near)
{
    return angle + TWO_PI * floor((near - angle) / TWO_PI + 0.5);
}

/* Follow an angle from t to `end`, and return its unwrapped end. In between, the vehicle must turn by at most 1 rad about any
 * axis. The heading itself turns faster where the nose points nearly upward or downward, so the time is halved until the
 * heading changes by at most 1 rad. */
static double followed(angle_at *at, const void *motion, double t, double end, double angle, int depth)
{
    const double after = unwrapped(at(motion, end), angle), middle = 0.5 * (t + end);
    if (!(fabs(after - angle) > 1.0) || depth == 0) { /* also when it overflows */
        return after;
    }
    angle = followed(at, motion, t, middle, angle, depth - 1);
    return followed(at, motion, middle, end, angle, depth - 1);
}

/* Follow an angle from 0 to `end`, while the vehicle turns by at most `turn`. */
static double followed_in_parts(angle_at *at, const void *motion, double end, double turn, double angle)
{
    const int parts = (int)fmin(fmax(ceil(turn), 1.0), 10000.0);
    for (int i = 0; i < parts; i++) {
        angle = followed(at, motion, end * i / parts, end * (i + 1) / parts, angle, 40);
    }
    return angle;
}

static double heading_in_piece(const void *motion, double t)
{
    const series *const s = (const series *)motion;
    return atan2(s->c[0][Y_R_21] + series_change(s, Y_R_21, t), s->c[0][Y_R_11] + series_change(s, Y_R_11, t));
}

/* Follow the heading through a piece of a step. */
static double heading_after_piece(const series *s, double length, double heading)
{
    double turn = 0.0; /* an upper bound of the sum of the integrals of the angular velocities */
    for (int i = FIRST_ROTATION; i < N_MONITORED; i++) {
        double power = length * s->unit;
        for (int n = 0; n <= s->order; n++, power *= length) {
            turn += fabs(s->c[n][i]) * power;
        }
    }
    return followed_in_parts(heading_in_piece, s, length, turn, heading);
}

/* A rotation with constant velocities. At the angle a, the first column of R is y + sin(a) along + (1 - cos(a)) across. */
typedef struct {
    double y[2], along[2], across[2]; /* of R_11 and R_21 */
} circle;

static double heading_on_circle(const void *motion, double angle)
{
    const circle *const c = (const circle *)motion;
    const double half = sin(0.5 * angle), s = sin(angle);
    double R[2];
    for (int i = 0; i < 2; i++) {
        R[i] = c->y[i] + s * c->along[i] + 2.0 * half * half * c->across[i];
    }
    return atan2(R[1], R[0]);
}

/* Follow the heading through a rotation with constant velocities. Every whole turn changes it by the same
 * angle. */
static double heading_after_circle(const circle *c, double angle, double heading)
{
    const double turns = floor(angle / TWO_PI);
    const double one = followed_in_parts(heading_on_circle, c, TWO_PI, TWO_PI, heading);
    heading += turns * (one - heading);
    return followed_in_parts(heading_on_circle, c, angle - turns * TWO_PI, TWO_PI, heading);
}
