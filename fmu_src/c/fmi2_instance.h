/* An instance of the FMU, and what every FMI function begins with.
 *
 * A call that is refused (illegal in the mode, bad argument, value out of bounds) changes nothing. Only a step whose
 * result overflows puts the instance into error mode, with the state from before the step. */
#ifndef FMI2_INSTANCE_H
#define FMI2_INSTANCE_H

#include "interface.h"

#include "fmi2Functions.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,      /* Model Exchange */
    CONTINUOUS = 8, /* Model Exchange */
    STEP = 16,      /* Co-Simulation, between steps */
    TERMINATED = 32,
    FAILED = 64
} lifecycle;

/* Where calls are legal: the tables of sections 3.2.3 and 4.2.4. */
enum {
    EVERYWHERE = INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP | TERMINATED | FAILED,
    INITIALIZED = EVERYWHERE & ~INSTANTIATED,
    RUNNING = EVENT | CONTINUOUS | STEP
};

/* What fmi2GetFMUstate saves: all that a run depends on. Calculated variables are not kept, they follow. */
typedef struct {
    fmi2Type type;
    lifecycle mode;
    bool experiment_defined, stop_defined;
    double time, stop;
    double values[N_VARIABLES]; /* by value reference */
} fmu_state;

/* What is warned of once: a command that saturates, by value reference, and what importers do against the standard. */
enum { READ_EARLY = FIRST_STATE, TUNED_LATE, ENDED_EARLY, TIME_JUMPED, N_WARNINGS };

typedef struct {
    fmi2CallbackFunctions callbacks;
    bool logging_on; /* as given to fmi2Instantiate */
    bool log_enabled[N_LOG_CATEGORIES];
    bool warned[N_WARNINGS];
    rov_gains gains; /* follows the coefficients */
    fmu_state now;
    char name[]; /* as given to fmi2Instantiate */
} fmu;

/* ---- Logging ---- */

#if defined __GNUC__
__attribute__((format(printf, 5, 6)))
#endif
static void emit(const fmi2CallbackFunctions *callbacks, const char *name, fmi2Status status, log_category category,
                 const char *format, ...)
{
    if (callbacks->logger == NULL) {
        return;
    }
    char text[320], message[2 * sizeof text];
    va_list arguments;
    va_start(arguments, format);
    size_t length = (size_t)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (length >= sizeof text) { /* cut before a character of UTF-8, not inside it */
        for (length = sizeof text - 1; length > 0 && (text[length - 1] & 0x80) != 0; length--) {
        }
        text[length] = '\0';
    }
    length = 0; /* the logger formats again, and # begins a value reference: both signs are doubled */
    for (const char *c = text; *c != '\0'; c++) {
        message[length++] = *c;
        if (*c == '%' || *c == '#') {
            message[length++] = *c;
        }
    }
    message[length] = '\0';
    callbacks->logger(callbacks->componentEnvironment, name, status, LOG_CATEGORIES[category], message);
}

/* One line in a category, if enabled, and the status that goes with it. */
#define LOG(f, status, category, ...)                                                    \
    do {                                                                                 \
        if ((f)->log_enabled[category]) {                                                \
            emit(&(f)->callbacks, (f)->name, status, category, __VA_ARGS__);             \
        }                                                                                \
    } while (0)
#define WARN_ONCE(f, what, ...)                                                          \
    do {                                                                                 \
        if (!(f)->warned[what]) {                                                        \
            (f)->warned[what] = (f)->log_enabled[logStatusWarning];                      \
            LOG(f, fmi2Warning, logStatusWarning, __VA_ARGS__);                          \
        }                                                                                \
    } while (0)
#define REFUSE(f, status, category, ...)                                                 \
    do {                                                                                 \
        LOG(f, status, category, __VA_ARGS__);                                           \
        return status;                                                                   \
    } while (0)
#define FAIL(f, ...) REFUSE(f, fmi2Error, logStatusError, __VA_ARGS__)
#define DISCARD(f, ...) REFUSE(f, fmi2Discard, logStatusDiscard, __VA_ARGS__)

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
    }
    return "an unknown mode";
}

/* Opens a function: the instance f, or an error where there is none or the call is illegal in its mode or interface. */
#define OPEN(function, modes)                                                                              \
    fmu *const f = (fmu *)c;                                                                               \
    if (f == NULL) {                                                                                       \
        return fmi2Error;                                                                                  \
    }                                                                                                      \
    do {                                                                                                   \
        if (((int)f->now.mode & (modes)) == 0) {                                                           \
            FAIL(f, "%s: not allowed in %s.", function, mode_name(f->now.mode));                           \
        }                                                                                                  \
    } while (0)
#define ONLY(function, wanted, interface)                                               \
    do {                                                                                \
        if (f->now.type != (wanted)) {                                                  \
            FAIL(f, "%s: only an instance for %s has this function.", function, interface); \
        }                                                                               \
    } while (0)
#define ONLY_ME(function) ONLY(function, fmi2ModelExchange, "Model Exchange")
#define ONLY_CS(function) ONLY(function, fmi2CoSimulation, "Co-Simulation")
#define REQUIRE(function, condition, ...)                        \
    do {                                                         \
        if (!(condition)) {                                      \
            FAIL(f, function ": " __VA_ARGS__);                  \
        }                                                        \
    } while (0)

static void enter(fmu *f, lifecycle mode)
{
    f->now.mode = mode;
    LOG(f, fmi2OK, logEvents, "Entered %s at t = %g s.", mode_name(mode), f->now.time);
}

/* Thrust and derivatives follow from the rest; only GetXXX needs them. */
static void calculate(fmu *f)
{
    rov_thrust_of(f->now.values, &f->gains);
    rov_derivatives(f->now.values, &f->gains);
}

#endif
