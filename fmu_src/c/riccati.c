/* Exact motion of one axis under a held force: v' = C - B v - A |v| v with A, B >= 0.
 * No state, no allocation, no errno. */
#include <math.h>
#include <stdbool.h>

#if defined __GNUC__
#define INLINE static inline __attribute__((always_inline)) /* what is not asked for is not computed; terms without loops */
#else
#define INLINE static inline
#endif

typedef struct {
    double A[2]; /* quadratic drag, 1/m (1/rad), for v > 0 and for v < 0 */
    double B[2]; /* linear drag, 1/s, likewise */
    double C;    /* force, m/s2 (rad/s2) */
} riccati;

typedef struct {
    double v, s; /* velocity, and its integral */
} riccati_motion;

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
    if (fabs(D2) > 1e-290 && fabs(D2) < 1e300) {
        return copysign(sqrt(fabs(D2)), D2);
    }
    const double root = 2.0 * sqrt(A) * sqrt(-C); /* B^2 or A C may have underflowed, or overflown */
    return copysign(sqrt(fabs(B - root)) * sqrt(B + root), B - root);
}

/* Time at which C < 0 stops v0 > 0: T = (2/D) artanh(D S), S = v0/(B v0 - 2 C) (R1), an arcus tangent where D^2 < 0 (R2). */
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

/* (R3) with f = N/M, keep = M - b N. Taken as the change from v0, unless that is
 * most of v0: rounding then never makes drag push, and what is steady stays. */
static inline double riccati_end_velocity(double a, double b, double c, double v0, double N, double M, double keep)
{
    const double drag = b + a * v0, growth = M + drag * N;
    const double change = (c - (b + drag) * v0) * N / growth;
    return change > -0.5 * v0 ? v0 + change : (v0 * keep + c * N) / growth;
}

/* X/h = v0 Y + C h W (R4) where |q| is moderate, x = q/4, from g = tanh(r/2)/(r/2) = n/m, which is g_b at r = b: with
 * t = r g/2 and t_b = b g_b/2
 *
 *     exp(-b) = (1 - t_b)/(1 + t_b),    cosh(r) = (1 + t^2)/(1 - t^2),    sinh(r)/r = g/(1 - t^2)
 *     Y = (1 - t_b) g / ((1 + t_b) (1 - t^2))                                                                          (R5)
 *     W = (g^2 + b (2 + b g) dg) / (2 (1 + t_b) (1 - t^2)),   dg = (g - g_b)/(q - b^2)                                 (R6)
 *
 * and dg is that of n and m, where no difference is left. */
static inline double riccati_mean(double b, double c, double x, double v0, double n, double m)
{
    const double y = 0.25 * b * b, half = 0.5 * b;
    const riccati_fraction at_b = riccati_tanh(y), d = riccati_difference(x, y);
    const double coasting = (at_b.m - half * at_b.n) * (n * m);
    const double pushed = 0.5 * (at_b.m * n * n + half * (m + half * n) * (d.n * at_b.m - at_b.n * d.m));
    return (v0 * coasting + c * pushed) / ((at_b.m + half * at_b.n) * (m * m - x * n * n));
}

/* The motion after h while v >= 0 keeps its sign. With b = B h/2, q = b^2 + A C h^2, r = sqrt(q) and l1, l2 = -b +- r, the
 * linear equation y'' + B y' = A C y, y(0) = 1, y'(0) = A v0, gives v = y'/(A y) and the distance s = ln(y)/A:
 *
 *     v = (v0 (1 - b f) + C h f) / (1 + (b + A h v0) f),      f = tanh(r)/r                                            (R3)
 *     s = ln(1 + A X)/A,      X = h (v0 Y + C h W)                                                                      (R4)
 *
 * where Y and W are the divided differences of exp and of (exp(l) - 1)/l over l1 and l2. */
INLINE riccati_motion riccati_leg(double A, double B, double C, double v0, double h)
{
    const double a = A * h, b = 0.5 * B * h, c = C * h, q = b * b + a * c;
    riccati_motion end;
    double mean; /* X/h */
    if (q > -0.8 && q < 3.2) {
        const double x = 0.25 * q;
        const riccati_fraction g = riccati_tanh(x);
        const double N = g.n * g.m, M = g.m * g.m + x * g.n * g.n; /* f = g/(1 + x g^2) */
        end.v = riccati_end_velocity(a, b, c, v0, N, M, M - b * N);
        mean = riccati_mean(b, c, x, v0, g.n, g.m);
    } else if (q < 0.0) {
        const double root = sqrt(-q), x = cos(root), y = sin(root) / root, fade = exp(-b);
        end.v = riccati_end_velocity(a, b, c, v0, y, x, x - b * y);
        mean = v0 * fade * y + (fade * (x + b * y) - 1.0) / a;
    } else {
        const double root = q < 1e300 ? sqrt(q) : hypot(b, sqrt(a) * sqrt(c));
        const double l1 = a * (c / (root + b)), l2 = -(root + b); /* root - b without cancellation, and -root - b */
        const bool is_settled = root > 20.0 && root - b > 2.0;    /* nothing is left of the start */
        const double decay = is_settled ? 0.0 : exp(-2.0 * root), gain = 1.0 - decay, M = root * (1.0 + decay);
        end.v = riccati_end_velocity(a, b, c, v0, gain, M, l1 - decay * l2);
        if (l1 > 1.0) { /* exp(l1) may overflow */
            end.s = h * ((l1 + log(0.5 * (M + (b + a * v0) * gain) / root)) / a);
            return end;
        }
        const double rise = expm1(l1), fall = decay * (1.0 + rise) - 1.0; /* exp - 1 at l1 and l2 */
        mean = (v0 * (rise - fall) + c * ((l1 != 0.0 ? rise / l1 : 1.0) - fall / l2)) / (2.0 * root);
    }
    const double p = a * mean;
    end.s = h * mean * (p > 0.0 ? log1p(p) / p : 1.0);
    return end;
}

/* The motion after h > 0 seconds from v0, from leg to leg at its reversal. */
INLINE riccati_motion riccati_advance(const riccati *axis, double v0, double h)
{
    int back = v0 < 0.0 || (v0 == 0.0 && axis->C < 0.0);
    double A = axis->A[back], B = axis->B[back], C = back ? -axis->C : axis->C, v = fabs(v0), gone = 0.0;
    /* Deceleration is strongest at the start, so the left side bounds the velocity that the step can take away. */
    if (C < 0.0 && ((B + A * v) * v - C) * h >= v) {
        const double end = riccati_time_to_rest(A, B, C, v);
        if (end < h) {
            gone = riccati_leg(A, B, C, v, end).s;
            back = !back;
            A = axis->A[back], B = axis->B[back], C = -C, v = 0.0, h -= end;
        }
    }
    const riccati_motion end = riccati_leg(A, B, C, v, h);
    return (riccati_motion){back ? -end.v : end.v, back ? gone - end.s : end.s - gone};
}
