/* The track of a turn, the integral of (u + i v) e^(i turn) over a piece, by Gauss-Legendre quadrature; and the closed form of
 * a whole step with it, for axes that nothing couples. No state, no allocation. */
#include <float.h>

enum {
    MOST_PIECES = 10000, /* of a step: 1,000 s at rates of 5/s that never settle, or 20,000 rad; beyond it is refused */
    FEW = 4,              /* places of a rule, and terms of sine and cosine that are enough */
    MANY = 8,
    TERMS_FEW = 5,
    TERMS_MANY = 10
};

/* The rules on 0 ... 1. Eight places are exact to rounding up to a time of 1 by the bending rate and a turn of 2 rad: the
 * error of n is f^(2n) (n!)^4 / ((2n + 1) (2n)!^3), and f has no pole within 2 by the rate. */
static const double LONGEST_TURN = 2.0, FULL_TURN = 6.283185307179586;
static const double PLACES[] = {
    0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629, /* four */
    0.01985507175123188, 0.10166676129318664, 0.23723379504183550, 0.40828267875217510, /* eight */
    0.59171732124782490, 0.76276620495816450, 0.89833323870681336, 0.98014492824876812};
static const double WEIGHTS[] = {
    0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693,
    0.05061426814518813, 0.11119051722668724, 0.15685332293894364, 0.18134189168918100,
    0.18134189168918100, 0.15685332293894364, 0.11119051722668724, 0.05061426814518813};

typedef struct {
    double ahead, aside;
} planar;

/* Velocities and turn at the places of a rule. */
typedef struct {
    double ahead[MANY], aside[MANY], turn[MANY];
} track_places;

static inline planar rotated(planar p, double cosine, double sine)
{
    const planar turned = {p.ahead * cosine - p.aside * sine, p.ahead * sine + p.aside * cosine};
    return turned;
}

/* Cosine and sine to rounding: five terms up to 0.07 rad, ten up to 1 rad, half of the longest turn. */
static inline planar small_turn(double angle, int terms)
{
    static const double share[2 * TERMS_MANY] = { /* 1/n! */
        1.0, 1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0, 1.0 / 40320.0, 1.0 / 362880.0,
        1.0 / 3628800.0, 1.0 / 39916800.0, 1.0 / 479001600.0, 1.0 / 6227020800.0, 1.0 / 87178291200.0,
        1.0 / 1307674368000.0, 1.0 / 20922789888000.0, 1.0 / 355687428096000.0, 1.0 / 6402373705728000.0,
        1.0 / 121645100408832000.0};
    const double square = angle * angle;
    planar p = {share[2 * terms - 2], share[2 * terms - 1]};
    for (int k = 2 * terms - 4; k >= 0; k -= 2) {
        p.ahead = share[k] - p.ahead * square;
        p.aside = share[k + 1] - p.aside * square;
    }
    p.aside *= angle;
    return p;
}

/* All but p and middle are constants where this is called. */
static inline planar track_sum(const track_places *p, double middle, int n, int terms)
{
    const double *const weights = n == FEW ? WEIGHTS : WEIGHTS + FEW;
    planar at[MANY], sum = {0.0, 0.0};
    for (int i = 0; i < n; i++) {
        const planar to = small_turn(p->turn[i] - middle, terms);
        at[i].ahead = weights[i] * (p->ahead[i] * to.ahead - p->aside[i] * to.aside);
        at[i].aside = weights[i] * (p->ahead[i] * to.aside + p->aside[i] * to.ahead);
    }
    for (int i = 0; i < n; i++) {
        sum.ahead += at[i].ahead;
        sum.aside += at[i].aside;
    }
    const planar half = small_turn(middle, terms);
    return rotated(sum, half.ahead, half.aside);
}

/* Adds a piece of h seconds that begins after `turned` and turns by `turn`. */
static inline void track_add(planar *sum, const track_places *p, bool is_short, double h, double turned, double turn)
{
    planar piece = is_short ? track_sum(p, 0.5 * turn, FEW, TERMS_FEW) : track_sum(p, 0.5 * turn, MANY, TERMS_MANY);
    if (turned != 0.0) {
        piece = rotated(piece, cos(turned), sin(turned));
    }
    sum->ahead += h * piece.ahead;
    sum->aside += h * piece.aside;
}

/* Adds an arc on which the velocities are steady: a way, bent to a chord. */
static void track_add_arc(planar *sum, planar way, double turned, double turn)
{
    const double chord = turn != 0.0 ? sin(0.5 * turn) / (0.5 * turn) : 1.0;
    const double angle = turned + 0.5 * turn;
    const planar piece = angle == 0.0 ? way : rotated(way, chord * cos(angle), chord * sin(angle));
    sum->ahead += piece.ahead;
    sum->aside += piece.aside;
}

/* ---- By the closed form ---- */

static const int PLANE[] = {U, V, R};

static double lane_velocity(const riccati axis[WIDTH], const double v[WIDTH], int lane, double t)
{
    return lane < N_AXES ? riccati_advance(&axis[lane], v[lane], t).v : 0.0;
}

static riccati_motion lane_motion(const riccati axis[WIDTH], const double v[WIDTH], int lane, double t)
{
    return riccati_advance(&axis[lane], v[lane], t);
}

static inline double lane_distance(const riccati axis[WIDTH], const double v[WIDTH], int lane, double t)
{
    return lane < N_AXES ? lane_motion(axis, v, lane, t).s : 0.0;
}

/* How long one panel of eight may be. An axis bends at the rate D = B + 2 A |v| + 2 sqrt(A |C|), but as it settles less of
 * it is left to be integrated: a share s of the motion allows s^(-1/16) times the length, by the order of the error. Growth
 * of a turn from rest counts too, turn ~ r' t^2/2. Infinite where all have settled. */
static double panel_length(const riccati axis[WIDTH], const double v[WIDTH], bool *is_settled)
{
    double length = INFINITY, turning = fabs(v[R]);
    *is_settled = true;
    for (int i = 0; i < 3; i++) {
        const int a = PLANE[i];
        const riccati *const x = &axis[a];
        const double A = x->A[v[a] < 0.0], B = x->B[v[a] < 0.0], drag = (B + A * fabs(v[a])) * fabs(v[a]);
        const double rate = fabs(x->C - riccati_drag(x, v[a])), D = B + 2.0 * (A * fabs(v[a]) + sqrt(A * fabs(x->C)));
        if (rate > 16.0 * DBL_EPSILON * (fabs(x->C) + drag)) { /* not rounding of its terms */
            const double share = fmin(1.0, rate / (D * (a == R ? D : fabs(v[a]))));
            *is_settled = false;
            length = fmin(length, 1.0 / (D * sqrt(sqrt(sqrt(sqrt(share))))));
            turning += a == R ? 2.0 * sqrt(rate) : 0.0;
        }
    }
    return fmin(length, LONGEST_TURN / turning);
}

/* A part of a step in which u, v and r keep their signs; false where it takes too many pieces. */
static bool closed_leg(const riccati axis[WIDTH], double v[WIDTH], double rest, double turned, planar *sum, int *pieces)
{
    while (++*pieces < MOST_PIECES) {
        bool is_settled;
        const double length = fmin(rest, panel_length(axis, v, &is_settled));
        if (length < rest) {
            const planar left = {lane_distance(axis, v, U, rest), lane_distance(axis, v, V, rest)};
            const double turn = lane_distance(axis, v, R, rest), size = fabs(left.ahead) + fabs(left.aside);
            const double gone = fabs(sum->ahead) + fabs(sum->aside);
            if (is_settled || fabs(turn) < DBL_EPSILON / 4.0 || size <= DBL_EPSILON / 16.0 * gone + DBL_MIN) {
                track_add_arc(sum, left, turned, turn);
                return true;
            }
        }
        const double turn = lane_distance(axis, v, R, length);
        track_places p;
        for (int i = 0; i < MANY; i++) {
            const double t = length * PLACES[FEW + i];
            p.ahead[i] = lane_velocity(axis, v, U, t);
            p.aside[i] = lane_velocity(axis, v, V, t);
            p.turn[i] = lane_distance(axis, v, R, t);
        }
        track_add(sum, &p, false, length, turned, turn);
        if (length == rest || !isfinite(sum->ahead + turn)) {
            return true;
        }
        rest -= length;
        turned = remainder(turned + turn, FULL_TURN); /* rounded as a small angle */
        for (int i = 0; i < 3; i++) {
            v[PLANE[i]] = lane_velocity(axis, v, PLANE[i], length);
        }
    }
    return false;
}

/* A step of h seconds: v moves to its end, the distances along the axes and the track go to *way and *sum. How many pieces it
 * takes, or 0: too many. */
static int closed_step(const riccati axis[WIDTH], double v[WIDTH], double h, double way[WIDTH], planar *sum)
{
    double start = 0.0, from[WIDTH] = {0.0}, reversal[3];
    int pieces = 0;
    for (int a = 0; a < N_AXES; a++) {
        from[a] = v[a];
        way[a] = 0.0;
        if (v[a] != 0.0 || axis[a].C != 0.0) {
            const riccati_motion end = lane_motion(axis, from, a, h);
            v[a] = end.v;
            way[a] = end.s;
        }
    }
    if (YAW == NONE || (from[R] == 0.0 && axis[R].C == 0.0)) {
        sum->ahead = way[U];
        sum->aside = way[V];
        return 1;
    }
    for (int i = 0; i < 3; i++) {
        reversal[i] = riccati_reversal_time(&axis[PLANE[i]], from[PLANE[i]]);
    }
    while (start < h) { /* part by part, from one reversal to the next */
        double end = h, at[WIDTH] = {0.0};
        for (int i = 0; i < 3; i++) {
            end = reversal[i] > start ? fmin(end, reversal[i]) : end;
            /* at rest to the last digit, or what follows would take the branch of before the reversal */
            at[PLANE[i]] = start == 0.0 ? from[PLANE[i]] : reversal[i] == start ? 0.0
                           : lane_velocity(axis, from, PLANE[i], start);
        }
        const double turned = start == 0.0 ? 0.0 : lane_distance(axis, from, R, start);
        if (!closed_leg(axis, at, end - start, turned, sum, &pieces)) {
            return 0;
        }
        start = end;
    }
    return pieces;
}
