/* Many instances and many runs: fleet LIBRARY REPETITIONS VALUES REFERENCES, all of it through the FMI functions.
 *
 * For 1, 100 and 10,000 instances, stepped in turn: "instances N NANOSECONDS BYTES", a step and of memory each. Then the
 * runs of the file VALUES (doubles): the ten commands (u_l, u_r, u_t) of 10 s each of every run, then the values of each
 * run's parameters, whose value references are REFERENCES (1,2,...): "runs N SECONDS" of a share of them in each
 * repetition, and "end STATE..." of each of the first ten. */
#include "fmu.h"

#include <malloc.h>

enum { STEPS = 200000, HELD = 10, MOST_PARAMETERS = 32, SHOWN = 10 };

/* Bytes in use on the heap. */
static double heap(void)
{
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations" /* mallinfo2 came after the GLIBC that is linked here */
    return mallinfo().uordblks;
#pragma GCC diagnostic pop
}

static void time_instances(size_t n)
{
    static const double commands[] = {0.5, 0.5, 0.5}, h = 0.01;
    fmi2Component *const rov = malloc(n * sizeof *rov);
    check(rov != NULL, "out of memory");
    const double before = heap();
    for (size_t i = 0; i < n; i++) {
        rov[i] = new_instance();
    }
    const double bytes = heap() - before;
    for (size_t i = 0; i < n; i++) {
        start_instance(rov[i], COMMANDS, 3, commands);
    }
    const size_t rounds = STEPS / n;
    double t = 0.0;
    const double start = nanoseconds();
    for (size_t round = 0; round < rounds; round++, t += h) {
        for (size_t i = 0; i < n; i++) {
            check(fmi2.DoStep(rov[i], t, h, fmi2True) == fmi2OK, "fmi2DoStep failed");
        }
    }
    const double each = (nanoseconds() - start) / (double)(rounds * n);
    printf("instances %zu %.17g %.17g\n", n, each, bytes / (double)n);
    for (size_t i = 0; i < n; i++) {
        fmi2.FreeInstance(rov[i]);
    }
    free(rov);
}

static void time_runs(fmi2Component c, const double *commands, const double *values, size_t first, size_t end_of_runs,
                      const fmi2ValueReference vr[], size_t n)
{
    const double start = nanoseconds();
    for (size_t i = first; i < end_of_runs; i++) {
        double end[7];
        start_instance(c, vr, n, values + i * n);
        for (int k = 0; k < HELD; k++) {
            check(fmi2.SetReal(c, COMMANDS, 3, commands + 3 * k) == fmi2OK
                      && fmi2.DoStep(c, 10.0 * k, 10.0, fmi2True) == fmi2OK, "a run failed");
        }
        check(fmi2.GetReal(c, STATES, 7, end) == fmi2OK, "fmi2GetReal failed");
        if (i < SHOWN) {
            printf("end");
            for (int k = 0; k < 7; k++) {
                printf(" %a", end[k]);
            }
            printf("\n");
        }
    }
    printf("runs %zu %.17g\n", end_of_runs - first, (nanoseconds() - start) * 1e-9);
}

int main(int argc, char *argv[])
{
    check(argc == 5, "usage: fleet LIBRARY REPETITIONS VALUES REFERENCES");
    load_fmu(argv[1]);
    fmi2ValueReference vr[MOST_PARAMETERS];
    size_t n = 0;
    for (char *name = strtok(argv[4], ","); name != NULL && n < MOST_PARAMETERS; name = strtok(NULL, ",")) {
        vr[n++] = (fmi2ValueReference)strtoul(name, NULL, 10);
    }
    FILE *const file = fopen(argv[3], "rb");
    check(file != NULL && fseek(file, 0, SEEK_END) == 0, "VALUES cannot be read");
    const size_t count = (size_t)ftell(file) / sizeof(double);
    double *const values = malloc(count * sizeof *values);
    rewind(file);
    check(n > 0 && count > 3 * HELD && values != NULL && fread(values, sizeof *values, count, file) == count,
          "VALUES cannot be read");
    fclose(file);
    const fmi2Component c = new_instance();
    const size_t runs = (count - 3 * HELD) / n, repetitions = strtoul(argv[2], NULL, 10);
    for (size_t i = 0; i < repetitions; i++) {
        time_instances(1);
        time_instances(100);
        time_instances(10000);
        time_runs(c, values, values + 3 * HELD, i * runs / repetitions, (i + 1) * runs / repetitions, vr, n);
    }
    return 0;
}
