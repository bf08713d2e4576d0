/* The filter for several sets of parameters at once, one in each lane of a vector. */
#include "vectors.h"

#include "real.h"

/* The functions of math.h that the filter calls most, in vectors: a call for each lane takes several times as long. Their errors are a
 * few units in the last place, and NaN stays NaN. */

/* Return the sine of an angle and some quarters of a turn. The reduction of the angle (Cody and Waite 1980) is exact to rounding up to
 * 1e6 rad, and the Taylor series end below rounding. */
static inline real lanes_turned(real x, double quarters)
{
    const real count = floor(x * 0.63661977236758134308 + 0.5), quarter = count + quarters - 4.0 * floor(0.25 * (count + quarters));
    const real r = ((x - count * 1.57079632673412561417) - count * 6.07710050630396597660e-11) - count * 2.02226624879595063154e-21;
    const real s = r * r;
    real odd = 1.0, even = 1.0;
    for (int n = 16; n > 0; n -= 2) {
        odd = 1.0 - odd * s * (1.0 / (n * (n + 1.0)));
        even = 1.0 - even * s * (1.0 / (n * (n - 1.0)));
    }
    const real size = quarter == 1.0 || quarter == 3.0 ? even : r * odd;
    return quarter >= 2.0 ? -size : size;
}

static real lanes_sine(real x)
{
    return lanes_turned(x, 0.0);
}

static real lanes_cosine(real x)
{
    return lanes_turned(x, 1.0);
}

/* Return exp(x): a power of 2, and a Taylor series that ends below rounding. What is below 1e-304 is 0, and what is above 1e304 is
 * infinite. */
static real lanes_exp(real x)
{
    typedef long long integers __attribute__((ext_vector_type(LANES)));
    const real count = floor(fmin(fmax(x, -700.0), 700.0) * 1.44269504088896338700 + 0.5);
    const real r = (x - count * 6.93147180369123816490e-01) - count * 1.90821492927058770002e-10;
    real sum = 1.0;
    for (int n = 13; n > 0; n--) {
        sum = 1.0 + sum * r * (1.0 / n);
    }
    const integers power = (__builtin_convertvector(count, integers) + 1023) << 52;
    sum *= __builtin_bit_cast(real, power);
    sum = x < -700.0 ? (real)0.0 : sum;
    return x > 700.0 ? (real)HUGE_VAL : sum;
}

/* Return ln(x) for a normal x > 0: that of a power of 2, and the series of the inverse hyperbolic tangent. */
static real logarithm(real x)
{
    typedef long long integers __attribute__((ext_vector_type(LANES)));
    const integers bits = __builtin_bit_cast(integers, x);
    const integers power = (bits - 0x3fe6a09e667f3bcdLL) >> 52; /* from the root of 1/2 on */
    const real m = __builtin_bit_cast(real, bits - (power << 52)), count = __builtin_convertvector(power, real);
    const real t = (m - 1.0) / (m + 1.0), s = t * t;
    real sum = 0.0;
    for (int n = 21; n > 0; n -= 2) {
        sum = 1.0 / n + s * sum;
    }
    return count * 6.93147180369123816490e-01 + (count * 1.90821492927058770002e-10 + 2.0 * t * sum);
}

/* Return the angle of a vector: the series of the arctangent is used up to a sixteenth of a turn. */
static real lanes_angle(real y, real x)
{
    const real larger = fmax(fmax(fabs(x), fabs(y)), 1e-300), ratio = fmin(fabs(x), fabs(y)) / larger + 0.0 * (x + y);
    const mask is_far = ratio > 0.41421356237309504880;
    const real t = is_far ? (ratio - 1.0) / (ratio + 1.0) : ratio, s = t * t;
    real sum = 0.0;
    for (int n = 41; n > 0; n -= 2) {
        sum = 1.0 / n - s * sum;
    }
    const real eighth = t * sum + (is_far ? (real)0.78539816339744830962 : (real)0.0);
    const real quarter = fabs(y) > fabs(x) ? 1.57079632679489661923 - eighth : eighth;
    const real half = x < 0.0 ? 3.14159265358979323846 - quarter : quarter;
    return y < 0.0 ? -half : half;
}

#undef sin
#undef cos
#undef atan2
#define atan2 lanes_angle
#define sin lanes_sine
#define cos lanes_cosine
#define exp lanes_exp

#include "filter.c"
