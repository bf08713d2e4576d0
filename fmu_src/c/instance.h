/* An instance of the FMU, its log, and the checks at the beginning of every FMI function, for all versions of FMI.
 *
 * A call that is refused changes nothing. It is refused when it is illegal in the mode, or when an argument or a value is
 * wrong. A step that cannot be computed puts the instance into error mode: its result overflows, or it takes too many
 * pieces. The instance then keeps the state from before the step, or from the last intermediate update. */
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8, /* Model Exchange */
    STEP = 16,      /* Co-Simulation, between steps */
    TERMINATED = 32,
    FAILED = 64,
    INTERMEDIATE = 128 /* Co-Simulation, inside a step: intermediate update of FMI 3.0 */
} lifecycle;

/* The place of a variable is its index in VARIABLES, from 0. In an FMU of FMI 2.0, value references are these places. In an
 * FMU of FMI 3.0, they begin at 1 (FIRST_REFERENCE), because OMSimulator confuses them with positions in ModelVariables. Only
 * this function converts them. In FMI 3.0, the value reference 0 becomes a place that no variable has. */
static unsigned place_of(unsigned reference)
{
    return reference - FIRST_REFERENCE;
}

enum { TIME = N_VARIABLES }; /* the place of the independent variable, which only FMI 3.0 declares: after all others */

/* The modes in which a kind of call is legal, after the tables of FMI 2.0, sections 3.2.3 and 4.2.4, and of FMI 3.0, sections
 * 2.3.1 and 4.2. */
enum {
    RUNNING = EVENT | CONTINUOUS | STEP,
    BETWEEN = INSTANTIATED | INITIALIZATION | RUNNING | TERMINATED | FAILED, /* all modes, except inside a step */
    MAY_LOG = BETWEEN | INTERMEDIATE,
    MAY_RESET = BETWEEN,
    MAY_SAVE = BETWEEN,           /* get, set, free and serialize states */
    MAY_SET_UP = INSTANTIATED,    /* set up the experiment, and enter Initialization Mode */
    MAY_BEGIN = INITIALIZATION,   /* exit Initialization Mode */
    MAY_END = INITIALIZATION | RUNNING, /* terminate */
    MAY_COUNT = INSTANTIATED | EVENT | CONTINUOUS, /* get the numbers of states and of event indicators */
    MAY_READ = BETWEEN | INTERMEDIATE,
    MAY_READ_LATER = MAY_READ & ~INSTANTIATED, /* get values of types that no variable has, states and rates */
    MAY_WRITE = INSTANTIATED | INITIALIZATION | RUNNING | INTERMEDIATE,
    MAY_WRITE_DISCRETE = MAY_WRITE & ~(CONTINUOUS | INTERMEDIATE),
    MAY_DIFFERENTIATE = BETWEEN & ~INSTANTIATED,
    MAY_MEET_EVENTS = RUNNING,
    MAY_UPDATE = EVENT,
    MAY_MOVE_TIME = EVENT | CONTINUOUS,
    MAY_INTEGRATE = CONTINUOUS,
    MAY_STEP = STEP,
    MAY_ASK_OUTPUTS = STEP | INTERMEDIATE | TERMINATED | FAILED, /* get the derivatives of outputs */
    MAY_ASK_STATUS = STEP | TERMINATED
};

/* The numbers are those of fmi2Type. The names are not MODEL_EXCHANGE and CO_SIMULATION, because the projects that
 * `fmpy create-cmake-project` makes define macros with these names. */
typedef enum { TYPE_MODEL_EXCHANGE, TYPE_CO_SIMULATION } interface_type;

/* The result of a call. The numbers are those of fmi2Status and fmi3Status. */
typedef enum { DONE, WARNED, DISCARDED, REFUSED } outcome;

/* Whether the current during the step before is part of the state, and so whether there was a step. */
#ifdef CURRENT_PASSES
enum { KEEPS_CURRENT = 1 };
#else
enum { KEEPS_CURRENT = 0 };
#endif

/* The data that an FMU state saves: everything that a run depends on. Calculated variables follow from it. */
typedef struct {
    interface_type type;
    lifecycle mode;
    bool experiment_defined, stop_defined, has_moved; /* the last one stays false unless KEEPS_CURRENT */
    double time, stop, heading; /* the heading counts turns; only a vehicle with an attitude uses it */
    double values[N_VARIABLES]; /* by place */
    delay_line line;            /* the changes of commands that wait for the dead time */
} fmu_state;

/* The warnings that an instance gives once. The first ones are about inputs that saturate, each at the place of the input. The
 * next ones are about harmless calls that the standard does not allow but importers make, about an attitude that is only a
 * guess, about a pulse of 0, about a vehicle above the surface, and about a voltage beyond the range of curves, one for each
 * range. */
enum {
    NOT_SET_UP = FIRST_STATE,
    READ_EARLY,
    GUESSED,
    SET_AGAIN,
    TUNED_BETWEEN_EVENTS,
    COMMANDED_BETWEEN_EVENTS,
    TIME_SET_IN_EVENT,
    EVENT_ENTERED_AGAIN,
    COUNTED_LATE,
    ENDED_EARLY,
    TIME_JUMPED,
    NO_SIGNAL,
    OUT_OF_WATER,
    VOLTAGE_BEYOND,
    N_WARNINGS = VOLTAGE_BEYOND + N_VOLTAGE_RANGES
};

typedef struct {
    host host;            /* the callbacks of the importer */
    const char *function; /* the FMI function that is running */
    bool logging_on;      /* as given at instantiation */
    bool log_enabled[N_LOG_CATEGORIES];
    bool warned[N_WARNINGS];
    model_numbers numbers; /* follow from the coefficients */
    fmu_state now;
    char name[]; /* as given at instantiation */
} fmu;

/* ---- Logging ---- */

/* Write one line to the log. It begins with the function, unless that is NULL. */
#if defined __GNUC__
__attribute__((format(printf, 6, 7)))
#endif
static void emit(const host *callbacks, const char *name, const char *function, outcome status, log_category category,
                 const char *format, ...)
{
    char text[320], message[2 * sizeof text];
    size_t doubled = 0;
    va_list arguments;
    size_t begin = function == NULL ? 0 : (size_t)snprintf(text, sizeof text, "%s: ", function);
    va_start(arguments, format);
    size_t length = begin + (size_t)vsnprintf(text + begin, sizeof text - begin, format, arguments);
    va_end(arguments);
    if (length >= sizeof text) { /* cut before a character of UTF-8, not inside it */
        for (length = sizeof text - 1; length > 0 && (text[length - 1] & 0x80) != 0; length--) {
        }
        text[length] = '\0';
    }
    for (const char *c = text; *c != '\0'; c++) { /* # begins a value reference, % a format */
        message[doubled++] = *c;
        if (*c == '#' || (LOG_IS_FORMAT && *c == '%')) {
            message[doubled++] = *c;
        }
    }
    message[doubled] = '\0';
    send_to_log(callbacks, name, (int)status, LOG_CATEGORIES[category], message);
}

/* SAY writes a line if its category is enabled. The other macros write a line about an event (REPORT), warn (WARN_ONCE), or end
 * the function with a status and a line that explains it. */
#define SAY(f, function, status, category, ...)                                          \
    do {                                                                                 \
        if ((f)->log_enabled[category]) {                                                \
            emit(&(f)->host, (f)->name, function, status, category, __VA_ARGS__);        \
        }                                                                                \
    } while (0)
#define REPORT(f, ...) SAY(f, NULL, DONE, logEvents, __VA_ARGS__)
#define WARN_ONCE(f, what, ...)                                                          \
    do {                                                                                 \
        if (!(f)->warned[what]) {                                                        \
            (f)->warned[what] = (f)->log_enabled[logStatusWarning];                      \
            SAY(f, (f)->function, WARNED, logStatusWarning, __VA_ARGS__);                \
        }                                                                                \
    } while (0)
#define REFUSE(f, status, category, ...)                                                 \
    do {                                                                                 \
        SAY(f, (f)->function, status, category, __VA_ARGS__);                            \
        return status;                                                                   \
    } while (0)
#define FAIL(f, ...) REFUSE(f, REFUSED, logStatusError, __VA_ARGS__)
#define DISCARD(f, ...) REFUSE(f, DISCARDED, logStatusDiscard, __VA_ARGS__)
/* Fail unless the condition is true. The function that uses REQUIRE has the instance f. */
#define REQUIRE(condition, ...)                                                          \
    do {                                                                                 \
        if (!(condition)) {                                                              \
            FAIL(f, __VA_ARGS__);                                                        \
        }                                                                                \
    } while (0)
/* Return from the function if a part of its work was not done. */
#define TRY(work)                                                                        \
    do {                                                                                 \
        const outcome tried = (work);                                                    \
        if (tried != DONE) {                                                             \
            return tried;                                                                \
        }                                                                                \
    } while (0)

static const char *mode_name(lifecycle mode)
{
    switch (mode) {
    case INSTANTIATED: return "Instantiated";
    case INITIALIZATION: return "Initialization Mode";
    case EVENT: return "Event Mode";
    case CONTINUOUS: return "Continuous-Time Mode";
    case STEP: return "Step Mode";
    case TERMINATED: return "Terminated";
    case FAILED: return "Error";
    case INTERMEDIATE: return "Intermediate Update Mode";
    }
    return "an unknown mode";
}

/* ---- The beginning of every function ---- */

enum { ANY_INTERFACE = -1 };

/* Check that a function is legal in the mode of the instance, and for its interface type unless `wanted` is ANY_INTERFACE. */
static outcome open_instance(fmu *f, const char *function, int modes, int wanted)
{
    f->function = function;
    REQUIRE(((int)f->now.mode & modes) != 0, "not allowed in %s.", mode_name(f->now.mode));
    REQUIRE(wanted == ANY_INTERFACE || (int)f->now.type == wanted, "only an instance for %s has this function.",
            wanted == TYPE_MODEL_EXCHANGE ? "Model Exchange" : "Co-Simulation");
    return DONE;
}

/* Begin a function: define the instance f, or return an error when there is none or the call is illegal. */
#define OPEN_FOR(interface, function, modes)                                                    \
    fmu *const f = (fmu *)INSTANCE;                                                             \
    if (f == NULL || open_instance(f, #function, modes, interface) != DONE) {                   \
        return (FMI_STATUS)REFUSED;                                                             \
    }
#define OPEN(function, modes) OPEN_FOR(ANY_INTERFACE, function, modes)
/* Return an error unless the arguments that a function writes to are there. */
#define GIVEN(exist, names)                        \
    if (check_not_null(f, exist, names) != DONE) { \
        return (FMI_STATUS)REFUSED;                \
    }
