#include "riccati.h"

#include <math.h>
#include <stddef.h>

/* A motion mirrored to v0 >= 0, and the first leg of it: until it turns, or longer than asked for. */
typedef struct {
    double sign, C, v0, turn;
} riccati_leg;

static double riccati_acceleration(const riccati *axis, double v)
{
    return axis->C - (axis->B + axis->A * fabs(v)) * v;
}

/* Time at which C < 0 stops v0 > 0. */
static double riccati_time_to_rest(double A, double B, double C, double v0)
{
    const double D2 = B * B + 4.0 * A * C;
    const double S = v0 / (B * v0 - 2.0 * C);
    const double D = sqrt(fabs(D2)), x = D * S;
    if (x == 0.0) { /* D2 = 0, or an underflow */
        return 2.0 * S;
    }
    if (D2 < 0.0) {
        return 2.0 * S * (atan(x) / x);
    }
    if (x > 0.5) { /* artanh would lose the distance of its argument from 1 */
        return log1p(D * v0 / (-2.0 * A * C / (B + D) * v0 - C)) / D;
    }
    return 2.0 * S * (atanh(x) / x);
}

static double riccati_turning_time(const riccati *axis, double v0)
{
    if ((v0 <= 0.0 || axis->C >= 0.0) && (v0 >= 0.0 || axis->C <= 0.0)) {
        return INFINITY;
    }
    return riccati_time_to_rest(axis->A, axis->B, -fabs(axis->C), fabs(v0));
}

static riccati_leg riccati_first_leg(const riccati *axis, double v0, double h)
{
    riccati_leg leg = {1.0, axis->C, v0, h};
    if (v0 < 0.0 || (v0 == 0.0 && axis->C < 0.0)) {
        leg.sign = -1.0;
        leg.C = -axis->C;
        leg.v0 = -v0;
    }
    /* Deceleration is strongest at the start, so the left side bounds the velocity that the step can take away. */
    if (leg.C < 0.0 && ((axis->B + axis->A * leg.v0) * leg.v0 - leg.C) * h >= leg.v0) {
        leg.turn = riccati_time_to_rest(axis->A, axis->B, leg.C, leg.v0);
    }
    return leg;
}

/* Divided differences over l1, l2 = -b +- sqrt(b^2 + k) of exp (Y) and of (exp(l) - 1)/l (W), for |l1|, |l2| <= 1.5:
 * Y = sum H_n/(n+1)!, W = sum H_n/(n+2)! with H_n the complete homogeneous polynomial of l1, l2. */
static inline void riccati_means(double b, double k, double *Y, double *W)
{
    static const double inverse_factorial[] = {
        1.0, 1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0, 1.0 / 40320.0, 1.0 / 362880.0,
        1.0 / 3628800.0, 1.0 / 39916800.0, 1.0 / 479001600.0, 1.0 / 6227020800.0, 1.0 / 87178291200.0,
        1.0 / 1307674368000.0, 1.0 / 20922789888000.0, 1.0 / 355687428096000.0, 1.0 / 6402373705728000.0,
        1.0 / 121645100408832000.0, 1.0 / 2432902008176640000.0, 1.0 / 51090942171709440000.0,
        1.0 / 1124000727777607680000.0, 1.0 / 25852016738884976640000.0, 1.0 / 620448401733239439360000.0,
        1.0 / 15511210043330985984000000.0};
    double previous = 0.0, current = 1.0, y = 0.0, w = 0.0;
    for (int n = 0; n < 24 && (fabs(current) + fabs(previous)) * inverse_factorial[n] > 1e-17; n++) {
        y += current * inverse_factorial[n];
        w += current * inverse_factorial[n + 1];
        const double next = k * previous - 2.0 * b * current;
        previous = current;
        current = next;
    }
    *Y = y;
    *W = w;
}

/* v = (v0 (1 - b f) + c f) / (1 + (b + a v0) f), f = N/M, keep = M - b N. Taken as the change from v0, unless that is
 * most of v0: rounding then never makes drag push, and what is steady stays. */
static inline double riccati_end_velocity(double a, double b, double c, double v0, double N, double M, double keep)
{
    const double growth = M + (b + a * v0) * N;
    const double change = (c - (2.0 * b + a * v0) * v0) * N;
    return change > -0.5 * v0 * growth ? v0 + change / growth : (v0 * keep + c * N) / growth;
}

/* One leg, v0 >= 0 and v keeps its sign: v(h) into *v and its integral into *s, where they are not NULL.
 *
 * v with f = tanh(r)/r, r^2 = q; s = ln(1 + A X)/A, X = h (v0 Y + C h W), both free of cancellation. */
static inline void riccati_leg_advance(double A, double B, double C, double v0, double h, double *v, double *s)
{
    const double a = A * h, b = 0.5 * B * h, c = C * h;
    const double q = b * b + a * c;
    double Y, W;
    if (fabs(q) < 0.2) {
        if (v != NULL) {
            /* f = N/M, its continued fraction in q: exact to the last digit here */
            const double N = 1.0 + q * (17325.0 / 135135.0 + q * (378.0 / 135135.0 + q * (1.0 / 135135.0)));
            const double M = 1.0 + q * (62370.0 / 135135.0 + q * (3150.0 / 135135.0 + q * (28.0 / 135135.0)));
            *v = riccati_end_velocity(a, b, c, v0, N, M, M - b * N);
        }
        if (s == NULL) {
            return;
        }
        riccati_means(b, a * c, &Y, &W);
    } else if (q < 0.0) {
        const double root = sqrt(-q), x = cos(root), y = sin(root) / root;
        if (v != NULL) {
            *v = riccati_end_velocity(a, b, c, v0, y, x, x - b * y);
        }
        const double fade = exp(-b);
        Y = fade * y;
        W = (fade * (x + b * y) - 1.0) / (a * c);
    } else {
        const double root = q < 1e300 ? sqrt(q) : hypot(b, sqrt(a) * sqrt(c));
        const double l1 = a * (c / (root + b)), l2 = -(root + b); /* root - b without cancellation, and -root - b */
        const double decay = exp(-2.0 * root), gain = 1.0 - decay;
        const double M = root * (1.0 + decay);
        if (v != NULL) {
            *v = riccati_end_velocity(a, b, c, v0, gain, M, l1 - decay * l2);
        }
        if (s == NULL) {
            return;
        }
        if (l1 > 1.0) { /* exp(l1) may overflow */
            *s = h * (l1 + log(0.5 * (M + (b + a * v0) * gain) / root)) / a;
            return;
        }
        Y = exp(l1) * gain / (2.0 * root);
        W = ((l1 != 0.0 ? expm1(l1) / l1 : 1.0) - expm1(l2) / l2) / (2.0 * root);
    }
    if (s != NULL) {
        const double X = v0 * Y + c * W, p = a * X;
        *s = h * X * (p > 0.0 ? log1p(p) / p : 1.0);
    }
}

static inline void riccati_advance(const riccati *axis, double v0, double h, double *v, double *s)
{
    const riccati_leg leg = riccati_first_leg(axis, v0, h);
    double forth = 0.0;
    if (leg.turn < h) {
        if (s != NULL) {
            riccati_leg_advance(axis->A, axis->B, leg.C, leg.v0, leg.turn, NULL, &forth);
        }
        riccati_leg_advance(axis->A, axis->B, -leg.C, 0.0, h - leg.turn, v, s);
    } else {
        riccati_leg_advance(axis->A, axis->B, leg.C, leg.v0, h, v, s);
    }
    const double sign = leg.turn < h ? -leg.sign : leg.sign;
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
