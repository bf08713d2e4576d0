/* Times fmi2DoStep of a linked FMU in a plain loop: nanoseconds a step, the median of repetitions, and allocations.
 *
 * Usage: do_step GUID. Prints one line per case: name, step size (s), nanoseconds, allocations during the steps. */
#define _GNU_SOURCE
#include "fmi2Functions.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { REPETITIONS = 15 };

static size_t allocations;

void *malloc(size_t size)
{
    static void *(*real)(size_t);
    if (real == NULL) {
        *(void **)&real = dlsym(RTLD_NEXT, "malloc");
    }
    allocations++;
    return real(size);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void measure(fmi2Component c, const char *name, double left, double right, double top, double h, int steps)
{
    const fmi2ValueReference commands[] = {0, 1, 2}; /* u_l, u_r, u_t */
    const double values[] = {left, right, top};
    double times[REPETITIONS];
    size_t before = 0;
    for (int i = 0; i < REPETITIONS; i++) {
        double t = 0.0;
        fmi2Reset(c);
        fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
        fmi2EnterInitializationMode(c);
        fmi2SetReal(c, commands, 3, values);
        fmi2ExitInitializationMode(c);
        before = allocations;
        const double start = now();
        for (int n = 0; n < steps; n++, t += h) {
            if (fmi2DoStep(c, t, h, fmi2True) != fmi2OK) {
                fprintf(stderr, "%s: fmi2DoStep failed at t = %g\n", name, t);
                exit(1);
            }
        }
        times[i] = (now() - start) / steps;
    }
    qsort(times, REPETITIONS, sizeof times[0], ascending);
    printf("%s %g %.1f %zu\n", name, h, times[REPETITIONS / 2], allocations - before);
}

int main(int argc, char *argv[])
{
    const fmi2CallbackFunctions callbacks = {NULL, NULL, NULL, NULL, NULL};
    fmi2Component c = argc == 2 ? fmi2Instantiate("rov", fmi2CoSimulation, argv[1], NULL, &callbacks, fmi2False, fmi2False)
                                : NULL;
    if (c == NULL) {
        fprintf(stderr, "usage: do_step GUID\n");
        return 2;
    }
    static const double steps[] = {0.001, 0.01, 0.1, 1.0, 100.0};
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        const int n = steps[i] < 1.0 ? 100000 : 10000;
        measure(c, "straight", 0.5, 0.5, 0.0, steps[i], n);
        measure(c, "straight-and-dive", 0.5, 0.5, 0.5, steps[i], n);
        measure(c, "turning", 0.5, 0.3, 0.0, steps[i], n);
        measure(c, "turning-and-dive", 0.5, 0.3, 0.5, steps[i], n);
    }
    fmi2FreeInstance(c);
    return 0;
}
