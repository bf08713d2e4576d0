/* Load an FMU as an importer does, on every platform, and call an instance for Co-Simulation in the same way in FMI 2.0
 * and FMI 3.0. */
#pragma once

#include "check.h"
#include "interface.h"
#include "model.h"

#if FMI_VERSION == 3
#include "fmi3FunctionTypes.h"
#else
#include "fmi2FunctionTypes.h"
#endif

#include <string.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#define NOGDI /* its headers define FIXED */
#define NOUSER /* its headers define INPUT */
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

#if FMI_VERSION == 3
#define API fmi3
#define FMI_FUNCTIONS(F)                                                                                              \
    F(InstantiateCoSimulation) F(FreeInstance) F(EnterInitializationMode) F(ExitInitializationMode) F(Terminate)      \
    F(Reset) F(SetFloat64) F(GetFloat64) F(DoStep)
typedef fmi3Instance fmu_instance;
typedef fmi3LogMessageCallback fmu_host;
#else
#define API fmi2
#define FMI_FUNCTIONS(F)                                                                                              \
    F(Instantiate) F(FreeInstance) F(SetupExperiment) F(EnterInitializationMode) F(ExitInitializationMode)            \
    F(Terminate) F(Reset) F(SetReal) F(GetReal) F(DoStep) F(GetFMUstate) F(SetFMUstate) F(FreeFMUstate)               \
    F(SerializedFMUstateSize) F(SerializeFMUstate) F(DeSerializeFMUstate) F(GetDirectionalDerivative)
typedef fmi2Component fmu_instance;
typedef fmi2CallbackFunctions fmu_host;
#endif

#define JOIN(a, b) a##b
#define JOINED(a, b) JOIN(a, b)
#define QUOTE(a) #a
#define QUOTED(a) QUOTE(a)
#define DECLARE(name) JOINED(API, name##TYPE) *name;
static struct {
    library library;
    FMI_FUNCTIONS(DECLARE)
} API;

static inline void load_fmu(const char *path)
{
    API.library = open_library(path);
    PROPERTY(API.library != NULL, "%s cannot be loaded", path);
#define FIND(name)                                                                                         \
    do {                                                                                                   \
        const __typeof__(find_function(NULL, "")) found = find_function(API.library, QUOTED(API) #name); \
        CHECK(found != NULL);                                                                              \
        memcpy(&API.name, &found, sizeof found);                                                           \
    } while (0);
    FMI_FUNCTIONS(FIND)
#undef FIND
}

#if FMI_VERSION == 3
static inline fmu_instance instantiate(const char *name, const fmu_host *host)
{
    return fmi3.InstantiateCoSimulation(name, MODEL_TOKEN, NULL, false, false, false, false, NULL, 0, NULL, *host, NULL);
}

static inline bool set_up(fmu_instance c)
{
    return fmi3.EnterInitializationMode(c, false, 0.0, 0.0, false, 0.0) == fmi3OK;
}

static inline bool set_values(fmu_instance c, const unsigned vr[], size_t n, const double values[])
{
    return fmi3.SetFloat64(c, vr, n, values, n) == fmi3OK;
}

static inline bool get_values(fmu_instance c, const unsigned vr[], size_t n, double values[])
{
    return fmi3.GetFloat64(c, vr, n, values, n) == fmi3OK;
}

static inline bool do_step(fmu_instance c, double t, double h)
{
    bool events, ended, early;
    double reached;
    return fmi3.DoStep(c, t, h, true, &events, &ended, &early, &reached) == fmi3OK && !early;
}
#else
static inline fmu_instance instantiate(const char *name, const fmu_host *host)
{
    return fmi2.Instantiate(name, fmi2CoSimulation, MODEL_TOKEN, NULL, host, fmi2False, fmi2False);
}

static inline bool set_up(fmu_instance c)
{
    return fmi2.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK
           && fmi2.EnterInitializationMode(c) == fmi2OK;
}

static inline bool set_values(fmu_instance c, const unsigned vr[], size_t n, const double values[])
{
    return fmi2.SetReal(c, vr, n, values) == fmi2OK;
}

static inline bool get_values(fmu_instance c, const unsigned vr[], size_t n, double values[])
{
    return fmi2.GetReal(c, vr, n, values) == fmi2OK;
}

static inline bool do_step(fmu_instance c, double t, double h)
{
    return fmi2.DoStep(c, t, h, fmi2True) == fmi2OK;
}
#endif

/* Bring a new instance into Step Mode. */
static inline void initialize(fmu_instance c)
{
    CHECK(set_up(c) && API.ExitInitializationMode(c) == 0);
}

static inline fmu_instance new_instance(const char *name, const fmu_host *host)
{
    const fmu_instance c = instantiate(name, host);
    CHECK(c != NULL);
    initialize(c);
    return c;
}
