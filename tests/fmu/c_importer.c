/* An importer of FMI 2.0 that is no Python process: 1 s with u_l = u_r = 0.3, in steps of 0.1 s.
 *
 * Usage: c_importer LIBRARY GUID RESOURCES. Prints the surge velocity at the end. Where the library cannot be loaded, it
 * prints why on standard error, and the exit code is 1. */
#include "fmi2FunctionTypes.h"

#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { U_L = 0, U_R = 1, U = 8 }; /* value references of the VideoRay */

static void *library;

static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String message, ...)
{
    (void)environment;
    fprintf(stderr, "%s %d %s: %s\n", name, (int)status, category, message);
}

/* Finds a function of the FMU: *pointer is to point to it. */
static void find(const char *name, void *pointer)
{
    void *const found = dlsym(library, name);
    if (found == NULL) {
        fprintf(stderr, "there is no %s\n", name);
        exit(1);
    }
    memcpy(pointer, &found, sizeof found);
}

static void check(fmi2Status status)
{
    if (status != fmi2OK) {
        fprintf(stderr, "status %d\n", (int)status);
        exit(1);
    }
}

#define FIND(name)              \
    name##TYPE *name##_;        \
    find(#name, &name##_)

int main(int argc, char *argv[])
{
    static const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
    static const fmi2ValueReference commands[] = {U_L, U_R}, velocity[] = {U};
    static const fmi2Real held[] = {0.3, 0.3};
    fmi2Real u;
    library = argc == 4 ? dlopen(argv[1], RTLD_NOW | RTLD_LOCAL) : NULL;
    if (library == NULL) {
        fprintf(stderr, "%s\n", argc == 4 ? dlerror() : "usage: c_importer LIBRARY GUID RESOURCES");
        return 1;
    }
    FIND(fmi2Instantiate);
    FIND(fmi2SetupExperiment);
    FIND(fmi2EnterInitializationMode);
    FIND(fmi2ExitInitializationMode);
    FIND(fmi2SetReal);
    FIND(fmi2GetReal);
    FIND(fmi2DoStep);
    FIND(fmi2Terminate);
    FIND(fmi2FreeInstance);
    fmi2Component rov = fmi2Instantiate_("rov", fmi2CoSimulation, argv[2], argv[3], &callbacks, fmi2False, fmi2False);
    if (rov == NULL) {
        fprintf(stderr, "no instance\n");
        return 1;
    }
    check(fmi2SetupExperiment_(rov, fmi2False, 0.0, 0.0, fmi2False, 0.0));
    check(fmi2EnterInitializationMode_(rov));
    check(fmi2ExitInitializationMode_(rov));
    check(fmi2SetReal_(rov, commands, 2, held));
    for (int n = 0; n < 10; n++) {
        check(fmi2DoStep_(rov, 0.1 * n, 0.1, fmi2True));
    }
    check(fmi2GetReal_(rov, velocity, 1, &u));
    check(fmi2Terminate_(rov));
    fmi2FreeInstance_(rov);
    printf("%.17g\n", u);
    return 0;
}
