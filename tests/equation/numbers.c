/* Measure memory (glibc): with many instances at once, during many calls, and when the FMU's library is loaded many times.
 *
 * Usage: numbers LIBRARY INSTANCES CYCLES LOADS. Each line of output is a name and a number.
 *
 * Memory is measured as allocated bytes and as pages of address space, which include memory that does not come from malloc.
 * Growth is the difference between the memory after the last of several equal rounds and after the first. */
#define _GNU_SOURCE
#include "fmu.h"

#include <malloc.h>

enum {
    N_ROUNDS = 4,
    N_STEPS = 5 /* steps of each of many instances */
};

static const char *path;
static size_t messages;

static void unload(void)
{
    CHECK(dlclose(fmi2.library) == 0);
    CHECK(dlopen(path, RTLD_NOW | RTLD_NOLOAD) == NULL);
}

/* ---- Memory ---- */

typedef struct {
    long long allocated, pages;
} memory;

static memory memory_now(void)
{
    const struct mallinfo2 info = mallinfo2();
    char text[32] = "";
    FILE *const file = fopen("/proc/self/statm", "r");
    CHECK(file != NULL && fgets(text, sizeof text, file) != NULL);
    fclose(file);
    return (memory){(long long)(info.uordblks + info.hblkhd), strtoll(text, NULL, 10)};
}

static void report_growth(const char *name, memory first, memory last)
{
    printf("%s.allocated %lld\n", name, last.allocated - first.allocated);
    printf("%s.pages %lld\n", name, last.pages - first.pages);
}

/* ---- One instance ---- */

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category, (void)message;
    messages++;
}

static fmi2Component instance(int number)
{
    static const fmi2CallbackFunctions callbacks = {logger, NULL, NULL, NULL, NULL};
    char name[32];
    snprintf(name, sizeof name, "vehicle %d", number);
    return new_instance(name, &callbacks);
}

/* Step once. The inputs differ between instances and steps; a command beyond 1 saturates. */
static void step(fmi2Component c, int number, int n)
{
    fmi2ValueReference vr[N_INPUTS];
    double values[N_INPUTS];
    for (unsigned i = 0; i < N_INPUTS; i++) {
        vr[i] = i;
        values[i] = ((number * 31 + n * 7 + (int)i * 13) % 100 - 50) / 48.0;
    }
    CHECK(fmi2.SetReal(c, vr, N_INPUTS, values) == fmi2OK);
    CHECK(fmi2.DoStep(c, 0.1 * n, 0.1, fmi2True) == fmi2OK);
}

static void read_state(fmi2Component c, double values[N_STATES])
{
    fmi2ValueReference vr[N_STATES];
    for (unsigned i = 0; i < N_STATES; i++) {
        vr[i] = FIRST_STATE + i;
    }
    CHECK(fmi2.GetReal(c, vr, N_STATES, values) == fmi2OK);
}

/* ---- Many instances at once ---- */

static void crowd(int n)
{
    fmi2Component *const instances = calloc((size_t)n, sizeof *instances);
    CHECK(instances != NULL);
    long long bytes = 0;
    int different = 0;
    memory freed[N_ROUNDS];
    for (int round = 0; round < N_ROUNDS; round++) {
        const memory before = memory_now();
        for (int i = 0; i < n; i++) {
            instances[i] = instance(i);
        }
        for (int k = 0; k < N_STEPS; k++) {
            for (int i = 0; i < n; i++) {
                step(instances[i], i, k);
            }
        }
        bytes = memory_now().allocated - before.allocated;
        fmi2Component const alone = instance(n);
        for (int i = 0; i < n; i++) {
            CHECK(fmi2.Reset(alone) == fmi2OK);
            initialize(alone);
            for (int k = 0; k < N_STEPS; k++) {
                step(alone, i, k);
            }
            double a[N_STATES], b[N_STATES];
            read_state(instances[i], a);
            read_state(alone, b);
            different += memcmp(a, b, sizeof a) != 0;
            fmi2.FreeInstance(instances[i]);
        }
        fmi2.FreeInstance(alone);
        freed[round] = memory_now();
    }
    free(instances);
    printf("different %d\nbytes_of_an_instance %.1f\n", different, (double)bytes / n);
    report_growth("instances", freed[0], freed[N_ROUNDS - 1]);
}

/* ---- Many calls to one instance ---- */

static void steps(fmi2Component c, int n)
{
    step(c, n % 100, n);
}

static void resets(fmi2Component c, int n)
{
    CHECK(fmi2.Reset(c) == fmi2OK);
    initialize(c);
    step(c, n % 100, n);
}

/* Save and serialize a state, read it into a second state, restore that, and free both. */
static void saves(fmi2Component c, int n)
{
    fmi2FMUstate saved = NULL, read = NULL;
    size_t size;
    fmi2Byte bytes[1024];
    step(c, n % 100, n);
    CHECK(fmi2.GetFMUstate(c, &saved) == fmi2OK);
    CHECK(fmi2.SerializedFMUstateSize(c, saved, &size) == fmi2OK && size <= sizeof bytes);
    CHECK(fmi2.SerializeFMUstate(c, saved, bytes, size) == fmi2OK);
    CHECK(fmi2.DeSerializeFMUstate(c, bytes, size, &read) == fmi2OK);
    CHECK(fmi2.SetFMUstate(c, read) == fmi2OK);
    bytes[size / 2] ^= 1;
    CHECK(fmi2.DeSerializeFMUstate(c, bytes, size, &read) == fmi2Error);
    CHECK(fmi2.FreeFMUstate(c, &saved) == fmi2OK && fmi2.FreeFMUstate(c, &read) == fmi2OK);
}

/* Make calls that are refused. Each of them writes to the log. The first coefficient, the mass, may change; the second is
   fixed. */
static void refusals(fmi2Component c, int n)
{
    const fmi2ValueReference coefficient = FIRST_COEFFICIENT + 1, derivative = FIRST_CALCULATED, input = 0;
    const double infinite = 1e308 * 10.0, one = 1.0;
    double change;
    const size_t before = messages;
    CHECK(fmi2.SetReal(c, &coefficient, 1, &one) == fmi2Error);
    CHECK(fmi2.SetReal(c, &input, 1, &infinite) == fmi2Discard);
    CHECK(fmi2.DoStep(c, 0.0, -1.0, fmi2True) == fmi2Error);
    CHECK(fmi2.EnterInitializationMode(c) == fmi2Error);
    CHECK(fmi2.SetFMUstate(c, NULL) == fmi2Error);
    CHECK(fmi2.GetDirectionalDerivative(c, &derivative, 1, &derivative, 1, &one, &change) == fmi2Error);
    CHECK(messages == before + 6);
    (void)n;
}

static void lives(fmi2Component c, int n)
{
    (void)c;
    fmi2Component const other = instance(n);
    step(other, n % 100, 0);
    fmi2.FreeInstance(other);
}

static void endure(const char *name, void (*cycle)(fmi2Component, int), int cycles)
{
    fmi2Component const c = instance(0);
    memory after[N_ROUNDS];
    for (int round = 0; round < N_ROUNDS; round++) {
        for (int n = 0; n < cycles / N_ROUNDS; n++) {
            cycle(c, n);
        }
        after[round] = memory_now();
    }
    fmi2.FreeInstance(c);
    report_growth(name, after[0], after[N_ROUNDS - 1]);
}

/* ---- Many loads of the library ---- */

static void reload(int loads)
{
    memory after[N_ROUNDS];
    for (int round = 0; round < N_ROUNDS; round++) {
        for (int n = 0; n < loads / N_ROUNDS; n++) {
            load_fmu(path);
            lives(NULL, n);
            unload();
        }
        after[round] = memory_now();
    }
    report_growth("loads", after[0], after[N_ROUNDS - 1]);
}

int main(int argc, char *argv[])
{
    CHECK(argc == 5);
    path = argv[1];
    const int instances = atoi(argv[2]), cycles = atoi(argv[3]), loads = atoi(argv[4]);
    CHECK(instances > 0 && cycles >= 10 * N_ROUNDS && loads >= N_ROUNDS);
    memory_now(); /* its own allocations must not be counted later */
    reload(loads);
    load_fmu(path);
    crowd(instances);
    endure("steps", steps, cycles);
    endure("lives", lives, cycles / 10);
    endure("resets", resets, cycles / 10);
    endure("saves", saves, cycles / 10);
    endure("refusals", refusals, cycles / 10);
    unload();
    return 0;
}
