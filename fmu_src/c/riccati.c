/* Exact motion of one axis under a held force: v' = C - B v - A |v| v with A, B >= 0.
 * The same formulas as rov_fmu/motion/riccati.py, which derives them. No state, no allocation, no errno. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>

typedef struct {
    double A[2]; /* quadratic drag, 1/m (1/rad), for v > 0 and for v < 0 */
    double B[2]; /* linear drag, 1/s, likewise */
    double C;    /* force, m/s2 (rad/s2) */
} riccati;

/* The first leg of a motion: up to its reversal, or longer than asked for; mirrored to v0 >= 0 where `back` is 1. */
typedef struct {
    int back;
    double C, v0, end;
} riccati_leg;

/* B v + A |v| v. */
static inline double riccati_drag(const riccati *axis, double v)
{
    const int back = v < 0.0;
    return (axis->B[back] + axis->A[back] * fabs(v)) * v;
}

/* The root of |D^2|, D^2 = B^2 + 4 A C with C < 0, with the sign of D^2. */
static double riccati_signed_root(double A, double B, double C)
{
    const double D2 = B * B + 4.0 * A * C;
    if (fabs(D2) > 1e-290) {
        return copysign(sqrt(fabs(D2)), D2);
    }
    const double root = 2.0 * sqrt(A) * sqrt(-C); /* B^2 and A C may have underflowed */
    return copysign(sqrt(fabs(B - root)) * sqrt(B + root), B - root);
}

/* Time at which C < 0 stops v0 > 0. */
static double riccati_time_to_rest(double A, double B, double C, double v0)
{
    const double D = riccati_signed_root(A, B, C);
    const double S = v0 / (B * v0 - 2.0 * C), x = D * S;
    if (x == 0.0) { /* D = 0, or an underflow */
        return 2.0 * S;
    }
    if (x < 0.0) {
        return 2.0 * S * (atan(x) / x);
    }
    if (x > 0.5) { /* artanh would lose the distance of its argument from 1 */
        return log1p(D * v0 / (-C * (1.0 + 2.0 * A / (B + D) * v0))) / D;
    }
    return 2.0 * S * (atanh(x) / x);
}

/* When the force brings v0 to rest and reverses it; infinite where it does not. */
static double riccati_reversal_time(const riccati *axis, double v0)
{
    if ((v0 <= 0.0 || axis->C >= 0.0) && (v0 >= 0.0 || axis->C <= 0.0)) { /* a product would underflow */
        return INFINITY;
    }
    return riccati_time_to_rest(axis->A[v0 < 0.0], axis->B[v0 < 0.0], -fabs(axis->C), fabs(v0));
}

static riccati_leg riccati_first_leg(const riccati *axis, double v0, double h)
{
    riccati_leg leg = {0, axis->C, v0, h};
    if (v0 < 0.0 || (v0 == 0.0 && axis->C < 0.0)) {
        leg.back = 1;
        leg.C = -axis->C;
        leg.v0 = -v0;
    }
    /* Deceleration is strongest at the start, so the left side bounds the velocity that the step can take away. */
    const double A = axis->A[leg.back], B = axis->B[leg.back];
    if (leg.C < 0.0 && ((B + A * leg.v0) * leg.v0 - leg.C) * h >= leg.v0) {
        leg.end = riccati_time_to_rest(A, B, leg.C, leg.v0);
    }
    return leg;
}

/* tanh(sqrt(x))/sqrt(x) = n/m by the continued fraction of tanh: exact to the last digit for |x| < 0.9. */
typedef struct {
    double n, m;
} riccati_fraction;

static const riccati_fraction riccati_terms[] = {{1.0, 1.0},
                                                 {4729725.0 / 34459425.0, 16216200.0 / 34459425.0},
                                                 {135135.0 / 34459425.0, 945945.0 / 34459425.0},
                                                 {990.0 / 34459425.0, 13860.0 / 34459425.0},
                                                 {1.0 / 34459425.0, 45.0 / 34459425.0}};

static inline riccati_fraction riccati_tanh(double x)
{
    const riccati_fraction *const c = riccati_terms;
    const double x2 = x * x;
    return (riccati_fraction){(c[0].n + c[1].n * x) + x2 * ((c[2].n + c[3].n * x) + x2 * c[4].n),
                              (c[0].m + c[1].m * x) + x2 * ((c[2].m + c[3].m * x) + x2 * c[4].m)};
}

/* The divided differences of n and m over x and y. */
static inline riccati_fraction riccati_difference(double x, double y)
{
    const riccati_fraction *const c = riccati_terms;
    const double first = x + y, product = x * y, second = first * first - product, third = first * (second - product);
    return (riccati_fraction){(c[1].n + c[2].n * first) + (c[3].n * second + c[4].n * third),
                              (c[1].m + c[2].m * first) + (c[3].m * second + c[4].m * third)};
}

/* v = (v0 (1 - b f) + c f) / (1 + (b + a v0) f), f = N/M, keep = M - b N. Taken as the change from v0, unless that is
 * most of v0: rounding then never makes drag push, and what is steady stays. */
static inline double riccati_end_velocity(double a, double b, double c, double v0, double N, double M, double keep)
{
    const double drag = b + a * v0, growth = M + drag * N;
    const double change = (c - (b + drag) * v0) * N / growth;
    return change > -0.5 * v0 ? v0 + change : (v0 * keep + c * N) / growth;
}

/* X/h where |q| is moderate: rov_fmu/motion/riccati.py derives it. g = tanh(r/2)/(r/2), also at r = b; n, m are those of g. */
static inline double riccati_mean(double b, double c, double x, double v0, double n, double m)
{
    const double y = 0.25 * b * b, half = 0.5 * b;
    const riccati_fraction at_b = riccati_tanh(y), d = riccati_difference(x, y);
    const double coasting = (at_b.m - half * at_b.n) * (n * m);
    const double pushed = 0.5 * (at_b.m * n * n + half * (m + half * n) * (d.n * at_b.m - at_b.n * d.m));
    return (v0 * coasting + c * pushed) / ((at_b.m + half * at_b.n) * (m * m - x * n * n));
}

/* One leg, v0 >= 0 and v keeps its sign: v(h) into *v and its integral into *s, where they are not NULL.
 *
 * v with f = tanh(r)/r, r^2 = q; s = ln(1 + A X)/A, X linear in v0 and C, both free of cancellation. */
static inline void riccati_leg_advance(double A, double B, double C, double v0, double h, double *v, double *s)
{
    const double a = A * h, b = 0.5 * B * h, c = C * h;
    const double q = b * b + a * c;
    double mean; /* X/h */
    if (q > -0.8 && q < 0.8 && v != NULL) {
        const riccati_fraction f = riccati_tanh(q);
        *v = riccati_end_velocity(a, b, c, v0, f.n, f.m, f.m - b * f.n);
        v = NULL;
        if (s == NULL) {
            return;
        }
    }
    if (q > -0.8 && q < 3.2) {
        const double x = 0.25 * q;
        const riccati_fraction g = riccati_tanh(x);
        if (v != NULL) { /* f = g/(1 + x g^2) */
            const double N = g.n * g.m, M = g.m * g.m + x * g.n * g.n;
            *v = riccati_end_velocity(a, b, c, v0, N, M, M - b * N);
        }
        if (s == NULL) {
            return;
        }
        mean = riccati_mean(b, c, x, v0, g.n, g.m);
    } else if (q < 0.0) {
        const double root = sqrt(-q), x = cos(root), y = sin(root) / root;
        if (v != NULL) {
            *v = riccati_end_velocity(a, b, c, v0, y, x, x - b * y);
        }
        const double fade = exp(-b);
        mean = v0 * fade * y + (fade * (x + b * y) - 1.0) / a;
    } else {
        const double root = q < 1e300 ? sqrt(q) : hypot(b, sqrt(a) * sqrt(c));
        const double l1 = a * (c / (root + b)), l2 = -(root + b); /* root - b without cancellation, and -root - b */
        const bool is_settled = root > 20.0 && root - b > 2.0;    /* nothing is left of the start */
        const double decay = is_settled ? 0.0 : exp(-2.0 * root), gain = 1.0 - decay;
        const double M = root * (1.0 + decay);
        if (v != NULL) {
            *v = riccati_end_velocity(a, b, c, v0, gain, M, l1 - decay * l2);
        }
        if (s == NULL) {
            return;
        }
        if (l1 > 1.0) { /* exp(l1) may overflow */
            *s = h * ((l1 + log(0.5 * (M + (b + a * v0) * gain) / root)) / a);
            return;
        }
        const double rise = expm1(l1), fall = decay * (1.0 + rise) - 1.0; /* exp - 1 at l1 and l2 */
        mean = (v0 * (rise - fall) + c * ((l1 != 0.0 ? rise / l1 : 1.0) - fall / l2)) / (2.0 * root);
    }
    if (s != NULL) {
        const double p = a * mean;
        *s = h * mean * (p > 0.0 ? log1p(p) / p : 1.0);
    }
}

/* v(h) from v0 into *v and the integral of v from 0 to h into *s, h > 0; either may be NULL. */
static inline void riccati_advance(const riccati *axis, double v0, double h, double *v, double *s)
{
    const riccati_leg leg = riccati_first_leg(axis, v0, h);
    int back = leg.back;
    double forth = 0.0;
    if (leg.end < h) {
        if (s != NULL) {
            riccati_leg_advance(axis->A[back], axis->B[back], leg.C, leg.v0, leg.end, NULL, &forth);
        }
        back = 1 - back;
        riccati_leg_advance(axis->A[back], axis->B[back], -leg.C, 0.0, h - leg.end, v, s);
    } else {
        riccati_leg_advance(axis->A[back], axis->B[back], leg.C, leg.v0, h, v, s);
    }
    const double sign = back ? -1.0 : 1.0;
    if (v != NULL) {
        *v *= sign;
    }
    if (s != NULL) {
        *s = sign * (*s - forth);
    }
}

static double riccati_velocity(const riccati *axis, double v0, double h)
{
    double v;
    riccati_advance(axis, v0, h, &v, NULL);
    return v;
}

static double riccati_distance(const riccati *axis, double v0, double h)
{
    double s;
    riccati_advance(axis, v0, h, NULL, &s);
    return s;
}
