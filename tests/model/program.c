/* The motion of a vehicle for Python, without FMI. The arrays have all variables by their places. */
#include "model.h"

#include "series.c"

#include "step.c"

int step(double at[N_VARIABLES], double h);
void calculate(double at[N_VARIABLES]);
void tangent(const double at[N_VARIABLES], double d[N_VARIABLES]);

/* Step h seconds. Return the number of pieces, or 0 when there would be too many. */
int step(double at[N_VARIABLES], double h)
{
    model_numbers n;
    double next[N_STATES];
    model_prepare(at, &n);
    const int pieces = model_step(at, &n, h, next);
    memcpy(at + FIRST_STATE, next, sizeof next);
    return pieces;
}

void calculate(double at[N_VARIABLES])
{
    model_numbers n;
    model_prepare(at, &n);
    model_calculate(at, &n);
}

void tangent(const double at[N_VARIABLES], double d[N_VARIABLES])
{
    model_tangent(at, d);
}
