/* What is FMI 3.0's own of an instance: its callbacks, and its words. */

/* The functions are named <modelIdentifier>_fmi3..., so that several FMUs can be linked into one program; plainly, as in
 * a shared library, where FMI3_OVERRIDE_FUNCTION_PREFIX is defined. */
#if !defined FMI3_FUNCTION_PREFIX && !defined FMI3_OVERRIDE_FUNCTION_PREFIX
#define FMI3_FUNCTION_PREFIX MODEL_PREFIX
#endif
#include "fmi3Functions.h"

#define FMI_STATUS fmi3Status
#define INSTANCE instance /* as the functions call it */
#define TOKEN_NAME "instantiation token"
#define REAL "Float64"
enum {
    HAS_TIME = 1,
    EVENTS_SET_STATES = 1, /* (section 2.3.5) */
    LOG_IS_FORMAT = 0,
    TROUBLE_IS_TOLD = 0 /* without loggingOn nothing is (section 2.3.1) */
};

typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update; /* NULL where it has nothing to say inside a step */
    bool uses_events, may_return_early;    /* in Co-Simulation */
} host;

static bool has_event_mode(const host *of)
{
    return of->uses_events;
}

static void tell(const host *to, const char *name, int status, const char *category, const char *text)
{
    (void)name; /* the environment knows whose line it is */
    if (to->log != NULL) {
        to->log(to->environment, (fmi3Status)status, category, text);
    }
}
