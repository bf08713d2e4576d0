/* What the FMI functions ask of every model, for one that samples its inputs once per step and whose only state is the time since the start.
 * `model_numbers` and `delay_line` are declared before. */
#include <math.h>
#include <stdbool.h>

#ifndef MOST_PIECES
#define MOST_PIECES 2
#endif

static double value_at(const double at[], int place)
{
    return place >= 0 ? at[place] : 0.0;
}

static bool all_finite(const double x[], int n)
{
    for (int i = 0; i < n; i++) {
        if (!isfinite(x[i])) {
            return false;
        }
    }
    return true;
}

static bool model_is_definite(const model_numbers *n)
{
    (void)n;
    return true;
}

static void model_begin(double at[], double *heading)
{
    (void)at, (void)heading;
}

static void model_tangent(const double at[], double d[])
{
    (void)at;
    d[FIRST_CALCULATED] = 0.0;
}

static void model_begin_tangent(const double at[], double d[])
{
    (void)at, (void)d;
}

static bool model_has_direction(const double x[])
{
    (void)x;
    return true;
}

static double model_heading(const double at[], double heading)
{
    (void)at;
    return heading;
}

static void current_keep(double at[])
{
    (void)at;
}

static void delay_commit(double at[], delay_line *line, double t, double h)
{
    (void)at, (void)line, (void)t, (void)h;
}
