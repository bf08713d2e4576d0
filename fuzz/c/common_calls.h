/* The functions of section 2.1, with any arguments. */
#ifndef COMMON_CALLS_H
#define COMMON_CALLS_H

#include "world.h"

/* ---- Life ---- */

static void check_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                          fmi2String message, ...)
{
    const slot *const s = environment;
    char text[2048];
    va_list none;
    va_start(none, message);
    const int length = vsnprintf(text, sizeof text, message, none); /* as importers do: no percent sign is left in it */
    va_end(none);
    PROPERTY(length > 0 && length < 640, "a message of %d characters", length);
    PROPERTY(status != fmi2Pending && status != fmi2Fatal, "a message of status %d", (int)status);
    bool known = false;
    for (int i = 0; i < N_LOG_CATEGORIES; i++) {
        if (strcmp(category, LOG_CATEGORIES[i]) == 0) {
            known = true;
            PROPERTY(s->f == NULL || s->f->log_enabled[i], "a message of %s, which is switched off", category);
        }
    }
    PROPERTY(known, "a message of the category %s", category);
    PROPERTY(s->f == NULL || strcmp(name, s->f->name) == 0, "a message of the instance %s", name);
    messages++;
}

static const char *take_name(void)
{
    static const char *const names[] = {NULL, "", " \t\n", "rov", "rov 2", "%s%n%d", "\xc3\xa9\xff", "logEvents",
                                        "logStatusError", "logStatusWarning", "logStatusDiscard", MODEL_GUID};
    static char longest[1000];
    memset(longest, '%', sizeof longest - 1);
    const unsigned n = take_byte() % (sizeof names / sizeof names[0] + 1);
    return n < sizeof names / sizeof names[0] ? names[n] : longest;
}

static void free_instance(slot *s)
{
    fmi2FreeInstance(s->f);
    s->f = NULL;
}

/* A new instance in place of what is there; NULL where an argument is wrong. */
static void instantiate(slot *s, const char *name, int type, const char *guid, bool logs, bool functions, bool events)
{
    free_instance(s);
    const fmi2CallbackFunctions given = {logs ? check_message : NULL, NULL, NULL, NULL, s};
    fmi2CallbackFunctions *const callbacks = copy_of(&given, 1, sizeof given);
    before_call();
    s->f = fmi2Instantiate(name, (fmi2Type)type, guid, NULL, functions ? callbacks : NULL, fmi2False, events);
    free(callbacks);
    const bool good = name != NULL && name[strspn(name, " \t\n")] != '\0' && guid != NULL && strcmp(guid, MODEL_GUID) == 0
                      && type >= 0 && type <= 1 && functions && !memory_is_full;
    PROPERTY((s->f != NULL) == good, "fmi2Instantiate of type %d", type);
    if (good) {
        s->logs = logs;
        s->at = (expected){.type = (fmi2Type)type, .mode = INSTANTIATED};
    }
}

static void call_fmi2Instantiate(slot *s)
{
    const bool proper = take_byte() < 200;
    const char *const name = proper ? "rov" : take_name();
    const char *const guid = proper || take_bool() ? MODEL_GUID : take_name();
    const int type = proper ? take_bool() : (int)take_word(4);
    memory_is_full = take_byte() >= 250;
    instantiate(s, name, type, guid, take_byte() < 200, take_byte() < 240, take_bool());
    memory_is_full = false;
}

static void call_fmi2SetDebugLogging(slot *s)
{
    const size_t n = take_count();
    fmi2String *const categories = take_byte() < 250 ? exactly(n, sizeof *categories) : NULL;
    bool good = n == 0 || categories != NULL;
    for (size_t i = 0; i < n && categories != NULL; i++) {
        bool known = false;
        categories[i] = take_byte() < 200 ? LOG_CATEGORIES[take_byte() % N_LOG_CATEGORIES] : take_name();
        for (int j = 0; j < N_LOG_CATEGORIES && categories[i] != NULL; j++) {
            known = known || strcmp(categories[i], LOG_CATEGORIES[j]) == 0;
        }
        good = good && known;
    }
    before_call();
    const verdict wanted = legal(s, CALL_fmi2SetDebugLogging, good);
    after_call(s, CALL_fmi2SetDebugLogging, wanted, fmi2SetDebugLogging(s->f, take_bool(), n, categories), true);
    free(categories);
}

static void call_fmi2SetupExperiment(slot *s)
{
    const bool simple = take_bool(), stops = !simple && take_bool();
    const double start = simple ? 0.0 : take_real(), stop = stops ? take_real() : 0.0;
    before_call();
    const verdict wanted = legal(s, CALL_fmi2SetupExperiment, isfinite(start) && (!stops || stop >= start));
    const fmi2Status status = fmi2SetupExperiment(s->f, take_bool(), take_real(), start, stops, stop);
    if (after_call(s, CALL_fmi2SetupExperiment, wanted, status, true)) {
        s->at.set_up = true;
        s->at.time = start;
        s->at.stop_defined = stops;
        s->at.stop = stop;
    }
}

/* Functions without arguments that lead to a mode. */
static void go(slot *s, call which, fmi2Status (*function)(fmi2Component), bool arguments, lifecycle to)
{
    before_call();
    const verdict wanted = legal(s, which, arguments);
    if (after_call(s, which, wanted, function(s->f), true)) {
        s->at.mode = to;
    }
}

static void call_fmi2EnterInitializationMode(slot *s)
{
    go(s, CALL_fmi2EnterInitializationMode, fmi2EnterInitializationMode, s->at.set_up, INITIALIZATION);
}

static void call_fmi2ExitInitializationMode(slot *s)
{
    go(s, CALL_fmi2ExitInitializationMode, fmi2ExitInitializationMode, true,
       s->at.type == fmi2ModelExchange ? EVENT : STEP);
}

static void call_fmi2Terminate(slot *s)
{
    go(s, CALL_fmi2Terminate, fmi2Terminate, true, TERMINATED);
}

static void call_fmi2Reset(slot *s)
{
    go(s, CALL_fmi2Reset, fmi2Reset, true, INSTANTIATED);
    s->at = (expected){.type = s->at.type, .mode = INSTANTIATED};
}

/* ---- Values ---- */

/* A list of n value references, or NULL. */
static fmi2ValueReference *take_references(size_t n)
{
    fmi2ValueReference *const vr = take_byte() < 253 ? exactly(n, sizeof *vr) : NULL;
    for (size_t i = 0; i < n && vr != NULL; i++) {
        vr[i] = take_reference();
    }
    return vr;
}

static double *take_reals(size_t n)
{
    double *const values = take_byte() < 253 ? exactly(n, sizeof *values) : NULL;
    for (size_t i = 0; i < n && values != NULL; i++) {
        values[i] = take_real();
    }
    return values;
}

/* Where a function gives back n doubles: they are all finite, or it was refused and left them alone. */
static void check_results(const char *function, bool accepted, const double *values, size_t n)
{
    static const unsigned char untouched[sizeof(double)] = {0xa5, 0xa5, 0xa5, 0xa5, 0xa5, 0xa5, 0xa5, 0xa5};
    for (size_t i = 0; i < n && values != NULL; i++) {
        PROPERTY(accepted ? isfinite(values[i]) : memcmp(&values[i], untouched, sizeof untouched) == 0,
                 "%s gives %g", function, values[i]);
    }
    if (accepted && n > 0) {
        note(values, n * sizeof *values);
    }
}

static void call_fmi2GetReal(slot *s)
{
    const size_t n = take_count();
    fmi2ValueReference *const vr = take_references(n);
    double *const values = take_byte() < 253 ? exactly(n, sizeof *values) : NULL;
    bool good = n == 0 || (vr != NULL && values != NULL), derived = false;
    for (size_t i = 0; i < n && vr != NULL; i++) {
        good = good && vr[i] < N_VARIABLES;
        derived = derived || (vr[i] >= FIRST_CALCULATED && vr[i] < FIRST_CALCULATED + N_STATES);
    }
    before_call();
    verdict wanted = legal(s, CALL_fmi2GetReal, good);
    if (wanted == ACCEPTED && derived && !is_moderate(s->f)) {
        wanted = EITHER; /* a derivative may overflow */
    }
    const bool accepted = after_call(s, CALL_fmi2GetReal, wanted, fmi2GetReal(s->f, vr, n, values), false);
    check_results("fmi2GetReal", accepted, values, n);
    free(vr);
    free(values);
}

/* Sections 2.2.7, 3.2.3 and 4.2.4. */
static bool settable(const slot *s, fmi2ValueReference vr)
{
    const variable_kind kind = VARIABLES[vr].kind;
    switch ((int)s->at.mode) {
    case INSTANTIATED:
    case INITIALIZATION: return kind != CALCULATED;
    case CONTINUOUS: return kind == INPUT || kind == STATE;
    default: return kind == INPUT || kind == TUNABLE;
    }
}

static void call_fmi2SetReal(slot *s)
{
    const size_t n = take_count();
    fmi2ValueReference *const vr = take_references(n);
    double *const values = take_reals(n);
    bool good = n == 0 || (vr != NULL && values != NULL);
    for (size_t i = 0; i < n && good; i++) {
        good = vr[i] < N_VARIABLES && settable(s, vr[i]) && isfinite(values[i])
               && (VARIABLES[vr[i]].kind == INPUT
                   || (values[i] >= VARIABLES[vr[i]].minimum && values[i] <= VARIABLES[vr[i]].maximum));
    }
    before_call();
    const verdict wanted = legal(s, CALL_fmi2SetReal, good);
    if (after_call(s, CALL_fmi2SetReal, wanted, fmi2SetReal(s->f, vr, n, values), true)) {
        for (size_t i = n; i-- > 0;) { /* the last one counts */
            bool later = false;
            for (size_t j = i + 1; j < n; j++) {
                later = later || vr[j] == vr[i];
            }
            PROPERTY(later || memcmp(&s->f->now.values.at[vr[i]], &values[i], sizeof(double)) == 0, "not set");
        }
    }
    free(vr);
    free(values);
}

/* No variables of another type: nothing to get or set. */
#define CALL_OF_OTHER_TYPE(function, type)                                                   \
    static void call_##function(slot *s)                                                     \
    {                                                                                        \
        const size_t n = take_count();                                                       \
        fmi2ValueReference *const vr = take_references(n);                                   \
        type *const values = exactly(n, sizeof(type));                                       \
        before_call();                                                                       \
        const verdict wanted = legal(s, CALL_##function, n == 0);                            \
        after_call(s, CALL_##function, wanted, function(s->f, vr, n, values), false);        \
        free(vr);                                                                            \
        free(values);                                                                        \
    }

CALL_OF_OTHER_TYPE(fmi2GetInteger, fmi2Integer)
CALL_OF_OTHER_TYPE(fmi2GetBoolean, fmi2Boolean)
CALL_OF_OTHER_TYPE(fmi2GetString, fmi2String)
CALL_OF_OTHER_TYPE(fmi2SetInteger, fmi2Integer)
CALL_OF_OTHER_TYPE(fmi2SetBoolean, fmi2Boolean)
CALL_OF_OTHER_TYPE(fmi2SetString, fmi2String)

static void call_fmi2GetDirectionalDerivative(slot *s)
{
    const size_t n_unknown = take_count(), n_known = take_count();
    fmi2ValueReference *const unknown = take_references(n_unknown), *const known = take_references(n_known);
    double *const change = take_reals(n_known);
    double *const result = exactly(n_unknown, sizeof *result);
    bool good = (n_unknown == 0 || unknown != NULL) && (n_known == 0 || (known != NULL && change != NULL));
    for (size_t i = 0; i < n_known && good; i++) {
        const variable_kind kind = known[i] < N_VARIABLES ? VARIABLES[known[i]].kind : CALCULATED;
        good = kind == INPUT || kind == STATE || (kind != CALCULATED && s->at.mode == INITIALIZATION);
    }
    for (size_t i = 0; i < n_unknown && good; i++) {
        good = unknown[i] < N_VARIABLES && (VARIABLES[unknown[i]].kind == STATE || VARIABLES[unknown[i]].kind == CALCULATED);
    }
    before_call();
    verdict wanted = legal(s, CALL_fmi2GetDirectionalDerivative, good);
    if (wanted == ACCEPTED) {
        for (size_t i = 0; i < n_known; i++) {
            wanted = fabs(change[i]) <= 1e30 && is_moderate(s->f) ? wanted : EITHER;
        }
    }
    const fmi2Status status = fmi2GetDirectionalDerivative(s->f, unknown, n_unknown, known, n_known, change, result);
    const bool accepted = after_call(s, CALL_fmi2GetDirectionalDerivative, wanted, status, false);
    check_results("fmi2GetDirectionalDerivative", accepted, result, n_unknown);
    free(unknown);
    free(known);
    free(change);
    free(result);
}

#endif
