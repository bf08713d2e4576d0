/* Simulation for Python (rov_fmu/c/): many vehicles of the same layout, all at the same times. engine.c steps one vehicle after
 * the other, and lanes.c many at once. */
#ifndef ENGINE_H
#define ENGINE_H

#include <stddef.h>

#include "model.h"

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

static inline double number(const table *t, ptrdiff_t vehicle, ptrdiff_t time)
{
    return t->at[vehicle * t->per_vehicle + time * t->per_time];
}

/* Return true when one of the recorded variables has to be calculated from the states. */
static inline bool is_calculated(const int *recorded, ptrdiff_t records)
{
    bool calculates = false;
    for (ptrdiff_t k = 0; k < records; k++) {
        calculates |= recorded[k] >= FIRST_CALCULATED && (recorded[k] < FIRST_COEFFICIENT || recorded[k] >= FIRST_ADDED);
    }
    return calculates;
}

/* The arguments of both ways to simulate the vehicles from `first` to `last` - 1. The simulation ends early when *stop becomes
 * nonzero.
 *
 * `given` has one table for each variable, at its place. Inputs are held from each time to the next. Of states, delayed
 * commands and parameters, only the number at the first time counts. length[n] is the time from time[n] to the next one, which
 * the difference of two late times would tell less exactly. `recorded` has the places of the variables to record. They are
 * written to result[record][vehicle][time]. They follow from the inputs that begin at that time, or, if `ended` is 1,
 * from those of the step that ends there, which is what an importer of an FMU reads. failed[vehicle] becomes the index of
 * the first time that cannot be computed, or `times`. From that time on, nothing is recorded. */
#define SIMULATION                                                                                                         \
    const table given[N_VARIABLES], const double *time, const double *length, const int *recorded, double *result,        \
        ptrdiff_t *failed, ptrdiff_t times, ptrdiff_t vehicles, ptrdiff_t first, ptrdiff_t last, ptrdiff_t records,        \
        int ended, const volatile int *stop

/* A single vehicle, stepped by itself, which goes on from where it was. Its memory, of single_size() bytes, belongs to the caller, who may
 * change inputs and states there between steps, and may copy it. engine.c knows more of it than these numbers, which would be
 * vectors in lanes.c: what follows from the coefficients, and the commands that wait for the dead time. */
typedef struct {
    double at[N_VARIABLES], heading;
} single;

EXPORT size_t single_size(void);
EXPORT bool single_begin(single *v, const table given[N_VARIABLES], ptrdiff_t vehicle);
EXPORT bool single_step(single *v, double t, double h);
EXPORT void single_calculate(single *v);
bool single_waits(const single *v);
void single_begin_current(single *v);
double single_cut(const double c[], int order, double reach, int *reversed);

/* Return one of several vehicles whose memory lies side by side. */
static inline single *single_of(void *vehicles, ptrdiff_t n)
{
    return (single *)(void *)((char *)vehicles + n * (ptrdiff_t)single_size());
}

EXPORT void simulate(SIMULATION);
/* `going` has the memory of the vehicles, which go on from where they were with the inputs that stand there, or is NULL. */
EXPORT int simulate_in_lanes(SIMULATION, void *going);

#endif
