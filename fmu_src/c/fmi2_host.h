/* What is FMI 2.0's own of an instance: its callbacks, and its words. */

/* The functions are named <modelIdentifier>_fmi2..., so that several FMUs can be linked into one program; plainly, as in
 * a shared library, where FMI2_OVERRIDE_FUNCTION_PREFIX is defined. The headers before FMI 2.0.4 do not know it: with
 * them names are plain unless FMI2_FUNCTION_PREFIX is defined for the compiler. */
#if !defined FMI2_FUNCTION_PREFIX && !defined FMI2_OVERRIDE_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX MODEL_PREFIX
#include "fmi2Functions.h"
#ifndef FMI2_ACTUAL_FUNCTION_PREFIX /* which those of 2.0.4 define; the older ones are included again without prefix */
#undef FMI2_FUNCTION_PREFIX
#undef FMI2_Export
#undef fmi2FullName
#undef fmi2Functions_h
#endif
#endif
#include "fmi2Functions.h"

#define FMI_STATUS fmi2Status
#define INSTANCE c /* as the functions call it */
#define TOKEN_NAME "GUID"
#define REAL "Real"
enum {
    HAS_TIME = 0,
    EVENTS_SET_STATES = 0,
    LOG_IS_FORMAT = 1,
    TROUBLE_IS_TOLD = 1 /* whatever loggingOn says: it is of debug logging (section 2.1.5) */
};

typedef fmi2CallbackFunctions host;

static bool has_event_mode(const host *of)
{
    (void)of; /* Co-Simulation has none */
    return false;
}

static void tell(const host *to, const char *name, int status, const char *category, const char *text)
{
    if (to->logger != NULL) {
        to->logger(to->componentEnvironment, name, (fmi2Status)status, category, text);
    }
}
