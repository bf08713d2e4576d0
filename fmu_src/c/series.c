/* The Taylor series of the states of equation.h. At the time t * unit, the states are the sum of c[n] t^n. Every
 * product of two states is a Cauchy product, so each coefficient follows from those before it. The last coefficients
 * show how far the series may be used (Jorba and Zou, A software package for the numerical integration of ODEs by means
 * of high-order Taylor methods, 2005). */
#include <float.h>
#include <stdbool.h>

#include "real.h"

#if defined __GNUC__
#define INLINE static inline __attribute__((always_inline)) /* so that loops over constant orders are unrolled */
#else
#define INLINE static inline
#endif
#if defined __GNUC__
#define SELDOM static __attribute__((noinline))
#else
#define SELDOM static
#endif
#if HAS_ATTITUDE && defined __GNUC__ /* the unrolled loops of so many terms take minutes to compile and are not faster */
#define SERIES_UNROLLED static __attribute__((noinline))
#elif HAS_ATTITUDE
#define SERIES_UNROLLED static
#else
#define SERIES_UNROLLED INLINE
#endif

enum { ORDER = 19 }; /* a higher order costs more than its longer pieces save */

typedef struct {
    int order;                     /* the order of the highest coefficient that is known */
    uint64_t moving;               /* one bit for each component; it is set where the states are not constant */
    unsigned blocks;               /* one bit for each block of equation.h; it is set where the states are not constant */
    real size[N_SERIES];           /* for each state, the scale of its group plus the size of its first coefficients */
    real unit;                     /* the unit of time, s */
    real pace[N_SERIES];           /* the unit of time, or 0 for the states that are constant */
    real c[ORDER + 1][N_SERIES];   /* the coefficients */
} series;

static const double INVERSE[ORDER + 1] = {0.0,        1.0,        1.0 / 2.0,  1.0 / 3.0,  1.0 / 4.0,  1.0 / 5.0,  1.0 / 6.0,
                                          1.0 / 7.0,  1.0 / 8.0,  1.0 / 9.0,  1.0 / 10.0, 1.0 / 11.0, 1.0 / 12.0, 1.0 / 13.0,
                                          1.0 / 14.0, 1.0 / 15.0, 1.0 / 16.0, 1.0 / 17.0, 1.0 / 18.0, 1.0 / 19.0};

/* Two numbers that a processor adds and multiplies at once. Other compilers do it one after the other, to the same bits; so does
 * every compiler without an attitude, where the unrolled loops are then a tenth faster. */
#if LANES == 1 && HAS_ATTITUDE && defined __GNUC__
typedef double pair __attribute__((vector_size(16)));

INLINE pair pair_of(const double x[], int a, int b)
{
    pair both = {x[a], x[b]};
    if (b == a + 1) {
        memcpy(&both, x + a, sizeof both);
    }
    return both;
}
#define SUM_TWO(OP, k, a, b, a_2, b_2) two[k] OP pair_of(x, a, a_2) * pair_of(y, b, b_2);
#define TWICE_TWO(OP, k, a, b, a_2, b_2) two[k] OP two[k];
#else
typedef real pair[2];
#define SUM_TWO(OP, k, a, b, a_2, b_2) two[k][0] OP x[a] * y[b]; two[k][1] OP x[a_2] * y[b_2];
#define TWICE_TWO(OP, k, a, b, a_2, b_2) two[k][0] OP two[k][0]; two[k][1] OP two[k][1];
#endif
#define SUM_ONE(OP, k, a, b) one[k] OP x[a] * y[b];
#define TWICE_ONE(OP, k, a, b) one[k] OP one[k];

/* Compute coefficient m > 0 of the products of equation.h: the sums of the products of coefficient j of the first factors, x, with
 * coefficient m - j of the second ones, y. PRODUCTS adds one product to each sum. Coefficient m was computed last, so it is
 * needed last. `seconds` has the bits of the blocks of the second factors; while none of these moves, nothing else is left. */
#define SERIES_PRODUCTS(seconds)                     \
    {                                                \
        const real *x = c[m - 1], *y = c[1];         \
        if (blocks & (seconds)) {                    \
            PRODUCTS(SUM, =)                         \
            for (int j = m - 2; j >= 0; j--) {       \
                x = c[j], y = c[m - j];              \
                PRODUCTS(SUM, +=)                    \
            }                                        \
            x = c[m], y = c[0];                      \
            PRODUCTS(SUM, +=)                        \
        } else {                                     \
            x = c[m], y = c[0];                      \
            PRODUCTS(SUM, =)                         \
        }                                            \
    }

/* The same for squares, in which all products but the middle one occur twice. */
#define SERIES_SQUARES                               \
    {                                                \
        const real *x = c[(m - 1) / 2], *y = c[m - (m - 1) / 2]; \
        PRODUCTS(SUM, =)                             \
        for (int j = (m - 1) / 2 - 1; j >= 0; j--) { \
            x = c[j], y = c[m - j];                  \
            PRODUCTS(SUM, +=)                        \
        }                                            \
        PRODUCTS(TWICE, +=)                          \
        if (m % 2 == 0) {                            \
            x = y = c[m / 2];                        \
            PRODUCTS(SUM, +=)                        \
        }                                            \
    }

/* The functions of equation.h: SERIES_BLOCK computes coefficient m + 1 of one block of states, SERIES_TERMS of all states. GROW
 * calls a block, or sets its coefficients to 0 where the block does not move. */
#define SERIES_BLOCK(name) INLINE SERIES_PART(name)
#define SERIES_ABOVE(name) SELDOM SERIES_PART(name) /* the same above the surface, where few vehicles are */
#define SERIES_PART(name)                                                                                \
    void name(const model_numbers *n, const model_held *q, unsigned blocks, const real pace[N_SERIES], \
              real c[ORDER + 1][N_SERIES], int m)
#define SERIES_TERMS SERIES_UNROLLED void series_terms(const model_numbers *n, const model_held *q, series *s, int m)
#define GROW(bit, block, first, size)                    \
    if (s->blocks >> (bit) & 1U) {                       \
        block(n, q, s->blocks, s->pace, s->c, m);        \
    } else {                                             \
        for (int i = first; i < (first) + (size); i++) { \
            s->c[m + 1][i] = 0.0;                        \
        }                                                \
    }

#ifdef HAS_SURFACE /* the last monitored states are no velocities */
enum { N_VELOCITIES = N_MONITORED - 2 };
#define IS_DEPTH(i) ((i) >= N_VELOCITIES && (i) < N_MONITORED)
#else
enum { N_VELOCITIES = N_MONITORED };
#define IS_DEPTH(i) false
#endif

#if HAS_ATTITUDE
#include "heading.c"
#else
/* Without roll and pitch, the heading is a state that counts turns itself. */
static real model_heading(const real at[], real near)
{
    (void)at;
    return near;
}
#endif
#include "equation.h"

/* The largest last two coefficients of a series of order n that may be used, relative to the size of the state. They are the
 * powers n - 1 and n of the ratio whose power n + 1 is DBL_EPSILON / 4. If the coefficients decrease at this ratio, or are
 * rounding errors themselves, the terms that are left out are negligible. The first entry is for n = 4. */
static const double SMALL_BEFORE[] = {1.8e-10, 1.5e-11, 2.4e-12, 6.4e-13, 2.3e-13, 9.9e-14, 5.0e-14, 2.8e-14,
                                      1.8e-14, 1.2e-14, 8.2e-15, 6.0e-15, 4.5e-15, 3.6e-15, 2.9e-15, 2.3e-15};
static const double SMALL_LAST[] = {9.9e-14, 2.8e-14, 1.2e-14, 6.0e-15, 3.6e-15, 2.3e-15, 1.7e-15, 1.3e-15,
                                      9.9e-16, 8.0e-16, 6.7e-16, 5.8e-16, 5.0e-16, 4.4e-16, 4.0e-16, 3.6e-16};

/* Return true when the series may be used up to t = 1. The depth and the states from N_USED on are integrals of the others and
 * converge with them. */
INLINE mask series_converges(const series *s)
{
    const double before = SMALL_BEFORE[s->order - 4];
    mask done = YES;
    for (int i = 0; i < N_USED; i++) {
        if (IS_DEPTH(i)) {
            continue;
        }
        const real size = s->size[i], a = fabs(s->c[s->order - 1][i]), b = fabs(s->c[s->order][i]);
        done &= a + 0.01 * b <= before * size + DBL_MIN; /* b may be infinite */
        /* b * b / a estimates the next coefficient; 8 b keeps a small `a` from making it large */
        done &= b * b <= 0.25 * DBL_EPSILON * size * (a + 8.0 * b);
        if (s->order == ORDER) { /* in a motion that begins as a power of time, two coefficients out of three may be 0 */
            done &= fabs(s->c[ORDER - 2][i]) <= 6.0 * before * size + DBL_MIN;
        }
    }
    return done;
}

/* Return the change of a state from 0 to t. */
static real series_change(const series *s, int i, real t)
{
    real change = 0.0;
    for (int n = s->order; n > 0; n--) {
        change = (change + s->c[n][i]) * t;
    }
    return change;
}

/* Return true when the sizes of the coefficients prove that no velocity reverses before t = length. */
INLINE mask series_keeps_directions(const series *s, real length)
{
    real others[N_MONITORED];
    mask keeps = YES;
    memset(others, 0, sizeof others);
    for (int n = s->order; n > 1; n--) {
        for (int i = 0; i < N_MONITORED; i++) {
            others[i] = others[i] * length + fabs(s->c[n][i]);
        }
    }
    for (int i = 0; i < N_MONITORED; i++) {
        const real c0 = s->c[0][i], c1 = s->c[1][i];
        const mask against = (c0 > 0.0 && c1 < 0.0) || (c0 < 0.0 && c1 > 0.0); /* a product would underflow */
        const real least = against ? fabs(c0) - length * fabs(c1) : fabs(c0) + length * fabs(c1);
        keeps &= least >= others[i] * length * length;
    }
    return keeps;
}

#if LANES == 1
/* Return the order of the first coefficient of state i that is not 0, or s->order + 1 when all are 0. */
static int series_first(const series *s, int i)
{
    int first = 0;
    while (first <= s->order && s->c[first][i] == 0.0) {
        first++;
    }
    return first;
}
#endif

/* Return the logarithm to base 2 of the largest t at which the last three terms are still within their limits, relative to
 * `size` t^first. */
INLINE real series_bound(const series *s, int i, int first, real size)
{
    const real a = fabs(s->c[ORDER - 1][i]), b = fabs(s->c[ORDER][i]);
    const real before = exponent_of(SMALL_BEFORE[ORDER - 4] * size / a), last = exponent_of(SMALL_LAST[ORDER - 4] * size / b);
    const real third = exponent_of(6.0 * SMALL_BEFORE[ORDER - 4] * size / fabs(s->c[ORDER - 2][i]));
    const real decrease = exponent_of(DBL_EPSILON * size / b * (a / b)), rounding = exponent_of(2.0 * DBL_EPSILON * size / b);
    const real least = fmin(PART(before, ORDER - 1 - first), PART(last, ORDER - first));
    return fmin(fmin(least, PART(third, ORDER - 2 - first)),
                fmax(PART(decrease, ORDER + 1 - first), PART(rounding, ORDER - first)));
}

/* Return the largest t, at most 1, up to which a series of order ORDER may be used. Return 0 when its unit of time is so long
 * that coefficients overflow or quotients of them underflow. */
INLINE real series_reach(const series *s, const real scale[N_SERIES])
{
    real reach = 0.0; /* its logarithm to base 2 */
    mask fails = NO;
    for (int i = 0; i < N_USED; i++) {
        const real sum = fabs(s->c[ORDER][i]) + fabs(s->c[ORDER - 1][i]) + fabs(s->c[ORDER - 2][i]);
        fails |= !(sum <= DBL_MAX);
        if (!ANY(sum != 0.0)) {
            continue;
        }
        /* relative to the size of the state, or to its first coefficient, whichever allows the larger t */
        real own = series_bound(s, i, 0, scale[GROUP[i]]);
#if LANES == 1
        const int first = s->c[0][i] != 0.0 ? 1 : series_first(s, i);
#else
        const int first = 1;
#endif
        const mask nearer = own < reach;
        if (ANY(nearer) && first < ORDER - 2) {
            own = fmax(own, series_bound(s, i, first, fabs(s->c[first][i])));
        }
        reach = sum == 0.0 ? reach : fmin(reach, own);
    }
    fails |= reach < -50.0; /* 2^-53 to the power ORDER is near the smallest double, so a quotient may have underflowed */
    return fails ? 0.0 : power_of_two(fmax(reach, -50.0));
}

#if LANES == 1 /* one vehicle at a time: reversals */
/* Return the time at which a state is 0, by Newton's method. Its slope must stay within a quarter of the first slope, so there
 * is only one such time. */
static double series_root(const series *s, int i)
{
    double t = 0.0, next = -s->c[0][i] / s->c[1][i];
    for (int k = 0; k < 60 && fabs(next - t) > DBL_EPSILON * next; k++) {
        double slope = 0.0;
        t = next;
        for (int n = s->order; n > 0; n--) {
            slope = slope * t + n * s->c[n][i];
        }
        next = t - (s->c[0][i] + series_change(s, i, t)) / slope;
    }
    return next;
}

/* Return a time, at most `length`, up to which a velocity certainly keeps its sign. *reverses becomes true when the
 * velocity is 0 at that time. */
static double series_sign_kept(const series *s, int i, double length, bool *reverses)
{
    const double shortest = 0x1p-20 * length; /* within this time, the drag of a velocity that just touches 0 is negligible */
    const int k = series_first(s, i);
    *reverses = false;
    for (; k <= s->order && length > shortest; length *= 0.5) {
        double others = 0.0, slopes = 0.0, power = length;
        for (int n = k + 1; n <= s->order; n++, power *= length) {
            others += fabs(s->c[n][i]) * power;
            slopes += n > 1 ? n * fabs(s->c[n][i]) * power : 0.0;
        }
        if (fabs(s->c[k][i]) > others) {
            break;
        }
        if (k == 0 && fabs(s->c[1][i]) * length > 4.0 * slopes) { /* it only rises or only falls */
            const double end = s->c[0][i] + series_change(s, i, length);
            *reverses = end == 0.0 || (end > 0.0) != (s->c[0][i] > 0.0);
            return *reverses ? fmin(length, series_root(s, i)) : length;
        }
    }
    return length;
}

/* Shorten a piece to the first reversal. Return the velocity that reverses, or NONE. The directions of those that are
 * `faint` do not matter. */
static int series_cut(const series *s, const bool faint[N_MONITORED], double *length)
{
    int reversed = NONE;
    for (int k = 0; k < N_MONITORED; k++) {
        bool reverses;
        if (s->pace[k] == 0.0 || faint[k]) {
            continue;
        }
        const double end = series_sign_kept(s, k, *length, &reverses);
        if (reverses) {
            reversed = k;
        } else if (end < *length) {
            reversed = NONE;
        }
        *length = end;
    }
    return reversed;
}
#endif
