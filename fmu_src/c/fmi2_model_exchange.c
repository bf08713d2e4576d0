/* Model Exchange (FMI 2.0, section 3.2). */
#include "fmi2_instance.h"

FMI2_Export fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    OPEN("fmi2EnterEventMode", EVENT | CONTINUOUS);
    enter(f, EVENT);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *fmi2eventInfo)
{
    OPEN("fmi2NewDiscreteStates", EVENT);
    REQUIRE("fmi2NewDiscreteStates", fmi2eventInfo != NULL, "eventInfo is NULL.");
    memset(fmi2eventInfo, 0, sizeof *fmi2eventInfo); /* the model has no events of its own */
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    OPEN("fmi2EnterContinuousTimeMode", EVENT);
    enter(f, CONTINUOUS);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                                   fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    OPEN("fmi2CompletedIntegratorStep", CONTINUOUS);
    (void)noSetFMUStatePriorToCurrentPoint;
    REQUIRE("fmi2CompletedIntegratorStep", enterEventMode != NULL && terminateSimulation != NULL,
            "enterEventMode or terminateSimulation is NULL.");
    *enterEventMode = fmi2False;
    *terminateSimulation = fmi2False;
    return fmi2OK;
}

/* A time beyond stopTime is taken: solvers look past the end before they interpolate back to it, CasADi tells stopTime 1
 * whatever it integrates over, and the model, which does not depend on time, is as valid there. */
FMI2_Export fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    OPEN("fmi2SetTime", EVENT | CONTINUOUS);
    REQUIRE("fmi2SetTime", isfinite(time), "time = %g is not a finite number.", time);
    f->now.time = time;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    OPEN("fmi2SetContinuousStates", CONTINUOUS);
    REQUIRE("fmi2SetContinuousStates", nx == N_STATES && x != NULL, "%zu states given, or NULL; it takes %d.", nx,
            N_STATES);
    for (size_t i = 0; i < N_STATES; i++) {
        if (!isfinite(x[i])) {
            DISCARD(f, "fmi2SetContinuousStates: %s = %g is not a finite number; it stays %.15g.",
                    VARIABLES[FIRST_STATE + i].name, x[i], f->now.values[FIRST_STATE + i]);
        }
    }
    memcpy(&f->now.values[FIRST_STATE], x, N_STATES * sizeof x[0]);
    return fmi2OK;
}

/* Opens a function that fills one double for each of the n states. */
#define OPEN_STATES(function, modes, vector, n)                                                           \
    OPEN(function, modes);                                                                                \
    ONLY_ME(function);                                                                                    \
    REQUIRE(function, (n) == N_STATES && (vector) != NULL, "%zu states asked for, or NULL; it has %d.", n, N_STATES)

FMI2_Export fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx)
{
    OPEN_STATES("fmi2GetDerivatives", INITIALIZED, derivatives, nx);
    calculate(f);
    for (size_t i = 0; i < N_STATES; i++) {
        if (!isfinite(f->now.values[FIRST_CALCULATED + i])) {
            DISCARD(f, "fmi2GetDerivatives: %s overflows.", VARIABLES[FIRST_CALCULATED + i].name);
        }
    }
    memcpy(derivatives, &f->now.values[FIRST_CALCULATED], N_STATES * sizeof derivatives[0]);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni)
{
    OPEN("fmi2GetEventIndicators", INITIALIZED);
    ONLY_ME("fmi2GetEventIndicators");
    (void)eventIndicators;
    REQUIRE("fmi2GetEventIndicators", ni == 0, "%zu event indicators asked for; it has none.", ni);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx)
{
    OPEN_STATES("fmi2GetContinuousStates", INITIALIZED, x, nx);
    memcpy(x, &f->now.values[FIRST_STATE], N_STATES * sizeof x[0]);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx)
{
    OPEN_STATES("fmi2GetNominalsOfContinuousStates", EVERYWHERE, x_nominal, nx);
    for (size_t i = 0; i < N_STATES; i++) {
        x_nominal[i] = VARIABLES[FIRST_STATE + i].nominal;
    }
    return fmi2OK;
}
