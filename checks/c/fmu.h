/* The FMU as an importer loads it, on every platform: its functions by name, and an instance for Co-Simulation. */
#pragma once

#include "check.h"
#include "interface.h"
#include "model.h"

#include "fmi2FunctionTypes.h"

#include <string.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#define NOGDI /* has a FIXED of its own */
#define NOUSER /* and an INPUT */
#include <windows.h>
typedef HMODULE library;
static inline library open_library(const char *path) { return LoadLibraryA(path); }
static inline FARPROC find_function(library l, const char *name) { return GetProcAddress(l, name); }
#else
#include <dlfcn.h>
typedef void *library;
static inline library open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static inline void *find_function(library l, const char *name) { return dlsym(l, name); }
#endif

#define FMI_FUNCTIONS(F)                                                                                              \
    F(Instantiate) F(FreeInstance) F(SetupExperiment) F(EnterInitializationMode) F(ExitInitializationMode)            \
    F(Terminate) F(Reset) F(SetReal) F(GetReal) F(DoStep) F(GetFMUstate) F(SetFMUstate) F(FreeFMUstate)               \
    F(SerializedFMUstateSize) F(SerializeFMUstate) F(DeSerializeFMUstate) F(GetDirectionalDerivative)

#define DECLARE(name) fmi2##name##TYPE *name;
static struct {
    library library;
    FMI_FUNCTIONS(DECLARE)
} fmi2;

static inline void load_fmu(const char *path)
{
    fmi2.library = open_library(path);
    PROPERTY(fmi2.library != NULL, "%s cannot be loaded", path);
#define FIND(name)                                                                                  \
    do {                                                                                            \
        const __typeof__(find_function(NULL, "")) found = find_function(fmi2.library, "fmi2" #name); \
        CHECK(found != NULL);                                                                       \
        memcpy(&fmi2.name, &found, sizeof found);                                                   \
    } while (0);
    FMI_FUNCTIONS(FIND)
#undef FIND
}

/* From Instantiated to Step Mode. */
static inline void initialize(fmi2Component c)
{
    CHECK(fmi2.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
    CHECK(fmi2.EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2.ExitInitializationMode(c) == fmi2OK);
}

static inline fmi2Component new_instance(const char *name, const fmi2CallbackFunctions *callbacks)
{
    const fmi2Component c = fmi2.Instantiate(name, fmi2CoSimulation, MODEL_GUID, NULL, callbacks, fmi2False, fmi2False);
    CHECK(c != NULL);
    initialize(c);
    return c;
}
