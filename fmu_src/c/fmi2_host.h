/* The parts of an instance that are specific to FMI 2.0: callbacks and terms. */

/* The functions are named <modelIdentifier>_fmi2..., so that several FMUs can be linked into one program. They have no prefix,
 * as in a shared library, when FMI2_OVERRIDE_FUNCTION_PREFIX is defined. The headers before FMI 2.0.4 do not know this macro:
 * with them, the functions have a prefix only if FMI2_FUNCTION_PREFIX is defined for the compiler. */
#if !defined FMI2_FUNCTION_PREFIX && !defined FMI2_OVERRIDE_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX MODEL_PREFIX
#include "fmi2Functions.h"
#ifndef FMI2_ACTUAL_FUNCTION_PREFIX /* not defined by headers before 2.0.4, which are included again without a prefix */
#undef FMI2_FUNCTION_PREFIX
#undef FMI2_Export
#undef fmi2FullName
#undef fmi2Functions_h
#endif
#endif
#include "fmi2Functions.h"

#define FMI_STATUS fmi2Status
#define INSTANCE c /* the name of this argument in all functions */
#define TOKEN_NAME "GUID"
#define REAL "Real"
enum {
    HAS_TIME = 0,
    EVENTS_SET_STATES = 0,
    LOG_IS_FORMAT = 1,
    LOGS_PROBLEMS_ALWAYS = 1 /* loggingOn concerns debug logging only (section 2.1.5) */
};

typedef fmi2CallbackFunctions host;

static bool has_event_mode(const host *callbacks)
{
    (void)callbacks; /* Co-Simulation of FMI 2.0 has none */
    return false;
}

static void send_to_log(const host *callbacks, const char *name, int status, const char *category, const char *text)
{
    if (callbacks->logger != NULL) {
        callbacks->logger(callbacks->componentEnvironment, name, (fmi2Status)status, category, text);
    }
}
