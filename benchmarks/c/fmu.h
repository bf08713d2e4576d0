/* The FMU as an importer loads it: its functions by dlsym, its value references and GUID from the generated header. */
#ifndef FMU_H
#define FMU_H

#include "common.h"
#include "interface.h"
#include "model.h"

#include "fmi2FunctionTypes.h"

#include <stddef.h>

#define REFERENCE(member) (fmi2ValueReference)(offsetof(rov_variables, member) / sizeof(double))

#define FUNCTIONS(F)                                                                            \
    F(Instantiate) F(FreeInstance) F(Reset) F(SetupExperiment) F(EnterInitializationMode)       \
    F(ExitInitializationMode) F(SetReal) F(GetReal) F(DoStep)

#define DECLARE(name) fmi2##name##TYPE *name;
static struct {
    FUNCTIONS(DECLARE)
} fmi2;

static const fmi2ValueReference COMMANDS[] = {REFERENCE(inputs.u_l), REFERENCE(inputs.u_r), REFERENCE(inputs.u_t)};
static const fmi2ValueReference STATES[] = {REFERENCE(state.u), REFERENCE(state.w), REFERENCE(state.r),
                                            REFERENCE(state.x), REFERENCE(state.y), REFERENCE(state.z),
                                            REFERENCE(state.psi)};

static void load_fmu(const char *path)
{
    void *const library = load(path);
#define FIND(name) find(library, "fmi2" #name, &fmi2.name);
    FUNCTIONS(FIND)
#undef FIND
}

static fmi2Component new_instance(void)
{
    static const fmi2CallbackFunctions callbacks = {NULL, NULL, NULL, NULL, NULL};
    const fmi2Component c = fmi2.Instantiate("rov", fmi2CoSimulation, MODEL_GUID, NULL, &callbacks, fmi2False, fmi2False);
    check(c != NULL, "fmi2Instantiate failed");
    return c;
}

/* From the beginning, with n values set. */
static void start_instance(fmi2Component c, const fmi2ValueReference vr[], size_t n, const double values[])
{
    check(fmi2.Reset(c) == fmi2OK && fmi2.SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK
              && fmi2.SetReal(c, vr, n, values) == fmi2OK && fmi2.EnterInitializationMode(c) == fmi2OK
              && fmi2.ExitInitializationMode(c) == fmi2OK,
          "the FMU cannot be initialized");
}

#endif
