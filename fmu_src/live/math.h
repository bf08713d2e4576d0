/* The part of <math.h> that the model needs, without a library: instructions of WebAssembly, and the browser's Math. */
#ifndef MATH_H
#define MATH_H

#define IMPORTED(name) __attribute__((import_module("Math"), import_name(#name)))

IMPORTED(sin) double sin(double x);
IMPORTED(cos) double cos(double x);
IMPORTED(tan) double tan(double x);
IMPORTED(atan2) double atan2(double y, double x);
IMPORTED(expm1) double expm1(double x);
IMPORTED(atanh) double atanh(double x);
IMPORTED(hypot) double hypot(double x, double y);
IMPORTED(log) double log(double x);
IMPORTED(log1p) double log1p(double x);
IMPORTED(pow) double pow(double x, double y);

#define INFINITY __builtin_inf()
#define isfinite(x) __builtin_isfinite(x)
#define floor(x) __builtin_floor(x)
#define fabs(x) __builtin_fabs(x)
#define copysign(x, y) __builtin_copysign(x, y)
#define sqrt(x) __builtin_sqrt(x)

/* If one argument is NaN, ISO C returns the other one. The instructions of WebAssembly would return NaN. */
static inline double fmin(double x, double y)
{
    return x < y || y != y ? x : y;
}

static inline double fmax(double x, double y)
{
    return x > y || y != y ? x : y;
}

#endif
