/* Creation, initialization, values and partial derivatives (FMI 2.0, section 2.1). */
#include "fmi2_instance.h"

/* ---- Version, creation, logging ---- */

FMI2_Export const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

FMI2_Export const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

static void start(fmu *f)
{
    const fmi2Type type = f->now.type;
    memset(&f->now, 0, sizeof f->now);
    f->now.type = type;
    f->now.mode = INSTANTIATED;
    for (size_t i = 0; i < N_VARIABLES; i++) {
        f->now.values[i] = VARIABLES[i].start;
    }
    memset(f->warned, 0, sizeof f->warned);
    for (int i = 0; i < N_LOG_CATEGORIES; i++) {
        f->log_enabled[i] = i != logEvents || f->logging_on;
    }
    rov_prepare(f->now.values, &f->gains);
}

#define REJECT(...)                                                                         \
    do {                                                                                    \
        emit(functions, name, fmi2Error, logStatusError, "fmi2Instantiate: " __VA_ARGS__);  \
        return NULL;                                                                        \
    } while (0)

FMI2_Export fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                                          fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                                          fmi2Boolean visible, fmi2Boolean loggingOn)
{
    (void)fmuResourceLocation; /* everything is in the binary, whatever the location says */
    (void)visible;
    if (functions == NULL) {
        return NULL;
    }
    const char *const name = instanceName == NULL ? "" : instanceName;
    if (name[strspn(name, " \t\r\n\f\v")] == '\0') {
        REJECT("the instance name is missing or blank.");
    }
    if (fmuType != fmi2ModelExchange && fmuType != fmi2CoSimulation) {
        REJECT("fmuType = %d is neither fmi2ModelExchange nor fmi2CoSimulation.", (int)fmuType);
    }
    if (fmuGUID == NULL || strcmp(fmuGUID, MODEL_GUID) != 0) {
        REJECT("the GUID %s is not that of this binary, %s.", fmuGUID == NULL ? "NULL" : fmuGUID, MODEL_GUID);
    }
    fmu *const f = (fmu *)calloc(1, sizeof *f + strlen(name) + 1);
    if (f == NULL) {
        REJECT("out of memory.");
    }
    strcpy(f->name, name);
    memcpy(&f->callbacks, functions, sizeof f->callbacks); /* its members are const in the headers of FMI 2.0.0 */
    f->logging_on = loggingOn != fmi2False;
    f->now.type = fmuType;
    start(f);
    return f;
}

FMI2_Export void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

FMI2_Export fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                                           const fmi2String categories[])
{
    OPEN("fmi2SetDebugLogging", EVERYWHERE);
    REQUIRE("fmi2SetDebugLogging", nCategories == 0 || categories != NULL, "categories is NULL.");
    bool chosen[N_LOG_CATEGORIES] = {false};
    for (size_t i = 0; i < nCategories; i++) {
        bool known = false;
        for (int j = 0; j < N_LOG_CATEGORIES && categories[i] != NULL; j++) {
            if (strcmp(categories[i], LOG_CATEGORIES[j]) == 0) {
                chosen[j] = known = true;
            }
        }
        REQUIRE("fmi2SetDebugLogging", known, "there is no log category %s.",
                categories[i] == NULL ? "NULL" : categories[i]);
    }
    for (int j = 0; j < N_LOG_CATEGORIES; j++) {
        if (nCategories == 0 || chosen[j]) {
            f->log_enabled[j] = loggingOn != fmi2False;
        }
    }
    return fmi2OK;
}

/* ---- Initialization, termination, reset ---- */

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                           fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    OPEN("fmi2SetupExperiment", INSTANTIATED);
    (void)toleranceDefined; /* the step is exact */
    (void)tolerance;
    REQUIRE("fmi2SetupExperiment", isfinite(startTime), "startTime = %g is not a finite number.", startTime);
    REQUIRE("fmi2SetupExperiment", stopTimeDefined == fmi2False || stopTime >= startTime,
            "stopTime = %g s lies before startTime = %g s.", stopTime, startTime);
    f->now.experiment_defined = true;
    f->now.time = startTime;
    f->now.stop_defined = stopTimeDefined != fmi2False;
    f->now.stop = f->now.stop_defined ? stopTime : 0.0;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    OPEN("fmi2EnterInitializationMode", INSTANTIATED);
    REQUIRE("fmi2EnterInitializationMode", f->now.experiment_defined, "fmi2SetupExperiment comes first.");
    enter(f, INITIALIZATION);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    OPEN("fmi2ExitInitializationMode", INITIALIZATION);
    enter(f, f->now.type == fmi2ModelExchange ? EVENT : STEP);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2Terminate(fmi2Component c)
{
    OPEN("fmi2Terminate", INITIALIZATION | RUNNING);
    if (f->now.mode == INITIALIZATION) {
        WARN_ONCE(f, ENDED_EARLY, "fmi2Terminate: done, though the standard has no such call in Initialization Mode.");
    }
    enter(f, TERMINATED);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2Reset(fmi2Component c)
{
    OPEN("fmi2Reset", EVERYWHERE);
    start(f);
    LOG(f, fmi2OK, logEvents, "Reset.");
    return fmi2OK;
}

/* ---- Getting and setting values ---- */

FMI2_Export fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    OPEN("fmi2GetReal", EVERYWHERE);
    REQUIRE("fmi2GetReal", nvr == 0 || (vr != NULL && value != NULL), "vr or value is NULL.");
    bool calculated = false;
    for (size_t i = 0; i < nvr; i++) {
        REQUIRE("fmi2GetReal", vr[i] < N_VARIABLES, "there is no Real with value reference %u.", vr[i]);
        calculated = calculated || VARIABLES[vr[i]].kind == CALCULATED;
    }
    if (calculated) {
        calculate(f);
        for (size_t i = 0; i < nvr; i++) {
            if (!isfinite(f->now.values[vr[i]])) {
                const bool exchange = f->now.type == fmi2ModelExchange;
                REFUSE(f, exchange ? fmi2Discard : fmi2Error, exchange ? logStatusDiscard : logStatusError,
                       "fmi2GetReal: %s overflows.", VARIABLES[vr[i]].name);
            }
        }
    }
    for (size_t i = 0; i < nvr; i++) {
        value[i] = f->now.values[vr[i]];
    }
    if (f->now.mode == INSTANTIATED) {
        WARN_ONCE(f, READ_EARLY, "fmi2GetReal: done, though the standard has no such call before initialization; said once.");
    }
    return fmi2OK;
}

/* Sections 2.2.7, 3.2.3 and 4.2.4, and what importers do: inputs before initialization, and parameters between the
 * integrator's steps. */
static bool may_set(const fmu *f, variable_kind kind)
{
    switch (f->now.mode) {
    case INSTANTIATED:
    case INITIALIZATION: return kind != CALCULATED;
    case EVENT:
    case STEP: return kind == INPUT || kind == TUNABLE;
    case CONTINUOUS: return kind == INPUT || kind == STATE || kind == TUNABLE;
    case TERMINATED:
    case FAILED: break;
    }
    return false;
}

FMI2_Export fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    OPEN("fmi2SetReal", INSTANTIATED | INITIALIZATION | RUNNING);
    REQUIRE("fmi2SetReal", nvr == 0 || (vr != NULL && value != NULL), "vr or value is NULL.");
    bool coefficient = false;
    for (size_t i = 0; i < nvr; i++) { /* all are checked before any is set */
        REQUIRE("fmi2SetReal", vr[i] < N_VARIABLES, "there is no Real with value reference %u.", vr[i]);
        const variable_info *const info = &VARIABLES[vr[i]];
        const double old = f->now.values[vr[i]];
        REQUIRE("fmi2SetReal", may_set(f, info->kind), "%s must not be set in %s.", info->name,
                mode_name(f->now.mode));
        if (!isfinite(value[i])) {
            DISCARD(f, "fmi2SetReal: %s = %g is not a finite number; it stays %.15g.", info->name, value[i], old);
        }
        if (info->kind == FIXED || info->kind == TUNABLE) {
            coefficient = true;
            if (value[i] < info->minimum || value[i] > info->maximum) {
                DISCARD(f, "fmi2SetReal: %s = %.15g is not within %g ... %g; it stays %.15g.", info->name, value[i],
                        info->minimum, info->maximum, old);
            }
        }
    }
    for (size_t i = 0; i < nvr; i++) {
        const variable_info *const info = &VARIABLES[vr[i]];
        f->now.values[vr[i]] = value[i];
        if (info->kind == INPUT && (value[i] < info->minimum || value[i] > info->maximum)) {
            WARN_ONCE(f, vr[i], "fmi2SetReal: %s = %.15g saturates at %g; said once.", info->name, value[i],
                      value[i] < 0.0 ? info->minimum : info->maximum);
        } else if (info->kind == TUNABLE && f->now.mode == CONTINUOUS) {
            WARN_ONCE(f, TUNED_LATE, "fmi2SetReal: %s is set, though the standard wants Event Mode for it; said once.",
                      info->name);
        }
    }
    if (coefficient) {
        rov_prepare(f->now.values, &f->gains);
    }
    return fmi2OK;
}

/* There are no variables of the other types: reading or writing none of them is all that can be asked for. */
#define NO_VARIABLES(function, type, values, modes)                                                                     \
    FMI2_Export fmi2Status function(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, values value[])         \
    {                                                                                                                   \
        OPEN(#function, modes);                                                                                         \
        (void)vr;                                                                                                       \
        (void)value;                                                                                                    \
        REQUIRE(#function, nvr == 0, "this FMU has no " type " variables.");                                            \
        return fmi2OK;                                                                                                  \
    }

NO_VARIABLES(fmi2GetInteger, "Integer", fmi2Integer, INITIALIZED)
NO_VARIABLES(fmi2GetBoolean, "Boolean", fmi2Boolean, INITIALIZED)
NO_VARIABLES(fmi2GetString, "String", fmi2String, INITIALIZED)
NO_VARIABLES(fmi2SetInteger, "Integer", const fmi2Integer, INSTANTIATED | INITIALIZATION | EVENT | STEP)
NO_VARIABLES(fmi2SetBoolean, "Boolean", const fmi2Boolean, INSTANTIATED | INITIALIZATION | EVENT | STEP)
NO_VARIABLES(fmi2SetString, "String", const fmi2String, INSTANTIATED | INITIALIZATION | EVENT | STEP)

/* ---- Partial derivatives ---- */

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                                    size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                                    size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    OPEN("fmi2GetDirectionalDerivative", INITIALIZED);
    REQUIRE("fmi2GetDirectionalDerivative",
            (nUnknown == 0 || (vUnknown_ref != NULL && dvUnknown != NULL))
                && (nKnown == 0 || (vKnown_ref != NULL && dvKnown != NULL)),
            "an argument is NULL.");
    double d[N_VARIABLES] = {0.0};
    for (size_t i = 0; i < nKnown; i++) {
        const bool exists = vKnown_ref[i] < N_VARIABLES;
        const variable_kind kind = exists ? VARIABLES[vKnown_ref[i]].kind : CALCULATED;
        /* parameters are knowns of the initialization (2.1.9) */
        REQUIRE("fmi2GetDirectionalDerivative",
                kind == INPUT || kind == STATE || (kind != CALCULATED && f->now.mode == INITIALIZATION),
                "%s is no known variable in %s.", exists ? VARIABLES[vKnown_ref[i]].name : "an unknown value reference",
                mode_name(f->now.mode));
        d[vKnown_ref[i]] += dvKnown[i];
    }
    for (size_t i = 0; i < nUnknown; i++) {
        const bool exists = vUnknown_ref[i] < N_VARIABLES;
        const variable_kind kind = exists ? VARIABLES[vUnknown_ref[i]].kind : INPUT;
        REQUIRE("fmi2GetDirectionalDerivative", kind == STATE || kind == CALCULATED,
                "%s is neither an output nor a derivative.",
                exists ? VARIABLES[vUnknown_ref[i]].name : "an unknown value reference");
    }
    rov_tangent(f->now.values, d);
    for (size_t i = 0; i < nUnknown; i++) {
        REQUIRE("fmi2GetDirectionalDerivative", isfinite(d[vUnknown_ref[i]]),
                "that of %s is not a finite number.", VARIABLES[vUnknown_ref[i]].name);
    }
    for (size_t i = 0; i < nUnknown; i++) {
        dvUnknown[i] = d[vUnknown_ref[i]];
    }
    return fmi2OK;
}
