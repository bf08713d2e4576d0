/* The parts of an instance that are specific to FMI 3.0: callbacks and terms. */

/* The functions are named <modelIdentifier>_fmi3..., so that several FMUs can be linked into one program. They have no prefix,
 * as in a shared library, when FMI3_OVERRIDE_FUNCTION_PREFIX is defined. */
#if !defined FMI3_FUNCTION_PREFIX && !defined FMI3_OVERRIDE_FUNCTION_PREFIX
#define FMI3_FUNCTION_PREFIX MODEL_PREFIX
#endif
#include "fmi3Functions.h"

#define FMI_STATUS fmi3Status
#define INSTANCE instance /* the name of this argument in all functions */
#define TOKEN_NAME "instantiation token"
#define REAL "Float64"
enum {
    HAS_TIME = 1,
    EVENTS_SET_STATES = 1, /* section 2.3.5 */
    LOG_IS_FORMAT = 0,
    LOGS_PROBLEMS_ALWAYS = 0 /* without loggingOn nothing is logged (section 2.3.1) */
};

typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update; /* NULL when the importer wants no intermediate updates */
    bool uses_events, may_return_early;    /* for Co-Simulation */
} host;

static bool has_event_mode(const host *callbacks)
{
    return callbacks->uses_events;
}

static void send_to_log(const host *callbacks, const char *name, int status, const char *category, const char *text)
{
    (void)name; /* FMI 3.0 identifies the instance by its environment */
    if (callbacks->log != NULL) {
        callbacks->log(callbacks->environment, (fmi3Status)status, category, text);
    }
}
