/* A step of the C without FMI, for Python: all variables by place. */
#include "riccati.c"
#include "rov.c"
#include "track.c"
#include "series.c"
#include "rov_step.c"

bool step(double at[N_VARIABLES], double h)
{
    rov_gains gains;
    double next[N_STATES];
    rov_prepare(at, &gains);
    const bool done = rov_step(at, &gains, h, next) > 0;
    memcpy(at + FIRST_STATE, next, sizeof next);
    return done;
}
