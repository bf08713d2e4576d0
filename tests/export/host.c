/* Loads the FMU's shared library and drives it from standard input; the same program on every platform.
 *
 * Usage: host LIBRARY GUID. Each line of input is a step: its length, then the values of the inputs by value reference.
 * Each line of output holds the outputs after it. Numbers are the bits of a double in hexadecimal: exact everywhere. */
#include "fmi2FunctionTypes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
static void *load(const char *path) { return (void *)LoadLibraryA(path); }
static FARPROC find(void *library, const char *name) { return GetProcAddress((HMODULE)library, name); }
#else
#include <dlfcn.h>
static void *load(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *find(void *library, const char *name) { return dlsym(library, name); }
#endif

enum { N_INPUTS = 8, N_STATES = 7, N_DERIVATIVES = 7, N_THRUST = 4, N_OUTPUTS = N_STATES + N_THRUST };

static void check(int ok, const char *what)
{
    if (!ok) {
        fprintf(stderr, "host: %s failed\n", what);
        exit(1);
    }
}

static int read_double(double *value)
{
    unsigned long long bits;
    const int read = scanf("%llx", &bits);
    memcpy(value, &bits, sizeof *value);
    return read == 1;
}

static void write_double(double value, char end)
{
    unsigned long long bits;
    memcpy(&bits, &value, sizeof bits);
    printf("%016llx%c", bits, end);
}

/* Declares a function pointer of the FMI type and loads it. */
#define FUNCTION(name)                                                              \
    name##TYPE *name;                                                               \
    do {                                                                            \
        void *const symbol = (void *)find(library, #name);                          \
        check(symbol != NULL, #name);                                               \
        memcpy(&name, &symbol, sizeof symbol);                                      \
    } while (0)

int main(int argc, char *argv[])
{
    check(argc == 3, "usage: host LIBRARY GUID;");
    void *const library = load(argv[1]);
    check(library != NULL, "loading the library");
    FUNCTION(fmi2Instantiate);
    FUNCTION(fmi2SetupExperiment);
    FUNCTION(fmi2EnterInitializationMode);
    FUNCTION(fmi2ExitInitializationMode);
    FUNCTION(fmi2SetReal);
    FUNCTION(fmi2GetReal);
    FUNCTION(fmi2DoStep);
    FUNCTION(fmi2Terminate);
    FUNCTION(fmi2FreeInstance);

    static const fmi2CallbackFunctions callbacks;
    fmi2Component c = fmi2Instantiate("rov", fmi2CoSimulation, argv[2], NULL, &callbacks, fmi2False, fmi2False);
    check(c != NULL, "fmi2Instantiate");
    check(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK, "fmi2SetupExperiment");
    check(fmi2EnterInitializationMode(c) == fmi2OK, "fmi2EnterInitializationMode");
    check(fmi2ExitInitializationMode(c) == fmi2OK, "fmi2ExitInitializationMode");

    fmi2ValueReference inputs[N_INPUTS], outputs[N_OUTPUTS];
    for (unsigned i = 0; i < N_INPUTS; i++) {
        inputs[i] = i;
    }
    for (unsigned i = 0; i < N_OUTPUTS; i++) {
        outputs[i] = N_INPUTS + i + (i < N_STATES ? 0 : N_DERIVATIVES);
    }
    double t = 0.0, h, values[N_INPUTS > N_OUTPUTS ? N_INPUTS : N_OUTPUTS];
    while (read_double(&h)) {
        for (int i = 0; i < N_INPUTS; i++) {
            check(read_double(&values[i]), "reading the inputs");
        }
        check(fmi2SetReal(c, inputs, N_INPUTS, values) == fmi2OK, "fmi2SetReal");
        check(fmi2DoStep(c, t, h, fmi2True) == fmi2OK, "fmi2DoStep");
        check(fmi2GetReal(c, outputs, N_OUTPUTS, values) == fmi2OK, "fmi2GetReal");
        for (int i = 0; i < N_OUTPUTS; i++) {
            write_double(values[i], i + 1 < N_OUTPUTS ? ' ' : '\n');
        }
        t += h;
    }
    check(fmi2Terminate(c) == fmi2OK, "fmi2Terminate");
    fmi2FreeInstance(c);
    return 0;
}
