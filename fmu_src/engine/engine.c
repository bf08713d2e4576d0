/* Simulation for Python (rov_fmu/c/): many vehicles of the same layout, all at the same times. */
#include <stddef.h>

#include "model.h"

#include "series.c"

#include "step.c"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* A table of numbers by vehicle and time, with its strides. A stride is 0 when the numbers do not depend on that index. */
typedef struct {
    const double *at;
    ptrdiff_t per_vehicle, per_time;
} table;

EXPORT void simulate(const table given[N_VARIABLES], const double *time, const int *recorded, double *result, ptrdiff_t *failed,
                     ptrdiff_t times, ptrdiff_t vehicles, ptrdiff_t first, ptrdiff_t last, ptrdiff_t records,
                     const volatile int *stop);

static inline double number(const table *t, ptrdiff_t vehicle, ptrdiff_t time)
{
    return t->at[vehicle * t->per_vehicle + time * t->per_time];
}

/* Begin at the attitude that the parameters give, or at the given quaternion if it is not 0. Of the headings that
 * differ by whole turns, the one nearest to psi_0 is taken. */
static void begin(double at[], double *heading)
{
    double state[N_STATES];
    const bool is_given = HAS_ATTITUDE && model_has_direction(at + FIRST_STATE);
    memcpy(state, at + FIRST_STATE, sizeof state);
    model_begin(at, heading);
    if (is_given) {
        memcpy(at + FIRST_STATE, state, sizeof state);
        *heading = model_heading(at, *heading);
    }
}

/* Simulate the vehicles from `first` to `last` - 1. The simulation ends early when *stop becomes nonzero.
 *
 * `given` has one table for each variable, at its place. Inputs are held from each time to the next. Of states and
 * parameters, only the number at the first time counts. `recorded` has the places of the variables to record. They are
 * written to result[record][vehicle][time]. failed[vehicle] becomes the index of the first time that cannot be
 * computed, or `times`. From that time on, nothing is recorded. */
void simulate(const table given[N_VARIABLES], const double *time, const int *recorded, double *result, ptrdiff_t *failed,
              ptrdiff_t times, ptrdiff_t vehicles, ptrdiff_t first, ptrdiff_t last, ptrdiff_t records,
              const volatile int *stop)
{
    bool calculates = false;
    for (ptrdiff_t k = 0; k < records; k++) {
        calculates |= recorded[k] >= FIRST_CALCULATED && recorded[k] < FIRST_COEFFICIENT;
    }
    for (ptrdiff_t vehicle = first; vehicle < last; vehicle++) {
        double at[N_VARIABLES] = {0.0}, next[N_STATES], heading = 0.0;
        delay_line line;
        model_numbers numbers;
        memset(&line, 0, sizeof line);
        for (int i = 0; i < FIRST_CALCULATED; i++) {
            at[i] = number(&given[i], vehicle, 0);
        }
        for (int i = FIRST_COEFFICIENT; i < N_VARIABLES; i++) {
            at[i] = number(&given[i], vehicle, 0);
        }
        model_prepare(at, &numbers);
        begin(at, &heading);
        failed[vehicle] = times;
        for (ptrdiff_t n = 0; n < times && *stop == 0; n++) {
            for (int i = 0; i < N_INPUTS; i++) {
                at[i] = number(&given[i], vehicle, n);
            }
            if (calculates) {
                model_calculate(at, &numbers, heading);
            }
            double *to = result + vehicle * times + n;
            for (ptrdiff_t k = 0; k < records; k++) {
                to[k * vehicles * times] = at[recorded[k]];
            }
            if (n + 1 == times) {
                break;
            }
            const int pieces = delayed_step(at, &numbers, &line, time[n], time[n + 1] - time[n], next, &heading);
            if (pieces <= 0 || !all_finite(next, N_STATES)) {
                failed[vehicle] = n + 1;
                break;
            }
            memcpy(at + FIRST_STATE, next, sizeof next);
            delay_commit(at, &line, time[n], time[n + 1] - time[n]);
        }
    }
}
