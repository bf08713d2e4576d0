/* The numbers of the motion. The FMU computes with doubles. engine/lanes.c defines LANES: then a `real` has the numbers of
 * LANES vehicles, in a vector type of clang, and a condition (`mask`) is one for each of them. Operators, comparisons and
 * a ? b : c work on both. What needs control flow for each vehicle stands between #if LANES == 1 and #endif. */
#ifndef REAL_H
#define REAL_H

#include <math.h>
#include <stdint.h>
#include <string.h>

/* Such options drop the checks for NaN and infinity, and the rounding errors that the step keeps. */
#if defined __FAST_MATH__ || (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__) || defined __ASSOCIATIVE_MATH__ || \
    defined __RECIPROCAL_MATH__ || defined _M_FP_FAST
#error "compile without -ffast-math, -Ofast and /fp:fast: -O2, or with icx -fp-model=precise"
#endif

#ifndef LANES
#define LANES 1
typedef double real;
typedef int mask;
#define LANE(x, lane) (x) /* the number of one vehicle */
#define YES 1
#define NO 0
#define ALL(condition) (condition) /* for all vehicles */
#define ANY(condition) (condition) /* for at least one of them */
#define SECOND_IF(condition, pair) (pair)[condition] /* of two numbers */
#define PART(x, n) ((x) / (n)) /* x / n for a whole number n */

/* Return the exponent of the largest power of two that is not above x > 0. Subnormal numbers are treated as 0. */
static inline double exponent_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (int)(bits >> 52 & 0x7ff) - 1023;
}

static inline double power_of_two(double x)
{
    return pow(2.0, x);
}
#else
typedef double real __attribute__((ext_vector_type(LANES)));
typedef __typeof__((real)0.0 < (real)0.0) mask;
#define LANE(x, lane) ((__typeof__((x)[0]) *)&(x))[lane] /* in memory, where an index costs nothing */
#define YES (-1)
#define NO 0
#define ALL(condition) (__builtin_reduce_and(condition) != 0)
#define ANY(condition) (__builtin_reduce_or(condition) != 0)
#define SECOND_IF(condition, pair) ((condition) ? (pair)[1] : (pair)[0])
#define PART(x, n) ((x) * (1.0 / (n))) /* rounded, in a fraction of the time */
typedef long long integers __attribute__((ext_vector_type(LANES)));

static inline real exponent_of(real x)
{
    return __builtin_convertvector((__builtin_bit_cast(integers, x) >> 52 & 0x7ff) - 1023, real);
}

static inline real lanes_fmin(real a, real b)
{
    return __builtin_elementwise_min(a, b);
}

static inline real lanes_fmax(real a, real b)
{
    return __builtin_elementwise_max(a, b);
}

/* Call a function of math.h for each vehicle. */
#define EACH_LANE(name, arguments, ...)             \
    static real lanes_##name arguments              \
    {                                               \
        real result;                                \
        for (int i = 0; i < LANES; i++) {           \
            LANE(result, i) = name(__VA_ARGS__);    \
        }                                           \
        return result;                              \
    }
EACH_LANE(sin, (real x), LANE(x, i))
EACH_LANE(cos, (real x), LANE(x, i))
EACH_LANE(atan2, (real y, real x), LANE(y, i), LANE(x, i))
EACH_LANE(pow, (real x, real y), LANE(x, i), LANE(y, i))
EACH_LANE(log1p, (real x), LANE(x, i))

/* Return 2^x for -1000 < x < 1000, to 2e-6 of it. */
static inline real power_of_two(real x)
{
    const real whole = __builtin_elementwise_floor(x), part = (x - whole) * 0.69314718055994531;
    real power = 1.0;
    for (int n = 7; n > 0; n--) { /* the series of the exponential function */
        power = 1.0 + power * part * (1.0 / n);
    }
    return power * __builtin_bit_cast(real, (__builtin_convertvector(whole, integers) + 1023) << 52);
}

#define fabs __builtin_elementwise_abs
#define sqrt __builtin_elementwise_sqrt
#define floor __builtin_elementwise_floor
#define fmin lanes_fmin
#define fmax lanes_fmax
#define sin lanes_sin
#define cos lanes_cos
#define atan2 lanes_atan2
#define pow lanes_pow
#define log1p lanes_log1p
#endif

#endif
