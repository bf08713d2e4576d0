/* The functions of section 2.1, with any arguments. */
#pragma once

#include "world.h"

/* ---- Life ---- */

/* Its index, or as many as there are. */
static int category_of(const char *name)
{
    int i = 0;
    while (i < N_LOG_CATEGORIES && strcmp(name, LOG_CATEGORIES[i]) != 0) {
        i++;
    }
    return i;
}

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
    for (const char *c = text; (c = strchr(c, '#')) != NULL; c += 2) { /* a single one would begin a value reference */
        PROPERTY(c[1] == '#', "a message with a single #: %s", text);
    }
    PROPERTY(status != fmi2Pending && status != fmi2Fatal, "a message of status %d", (int)status);
    const int known = category_of(category);
    PROPERTY(known < N_LOG_CATEGORIES, "a message of the category %s", category);
    PROPERTY(s->f == NULL || s->f->log_enabled[known], "a message of %s, which is switched off", category);
    PROPERTY(s->f == NULL || strcmp(name, s->f->name) == 0, "a message of the instance %s", name);
    messages++;
}

static const char *take_name(void)
{
    static const char *const names[] = {NULL, "", " \t\n", "rov", "rov 2", "#%s%n%d#", "\xc3\xa9\xff", "logEvents",
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
    LENT fmi2CallbackFunctions *const callbacks = copy_of(&given, 1, sizeof given);
    before_call();
    s->f = fmi2Instantiate(name, (fmi2Type)type, guid, NULL, functions ? callbacks : NULL, fmi2False, events);
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
    LENT fmi2String *const categories = take_byte() < 250 ? exactly(n, sizeof *categories) : NULL;
    bool good = n == 0 || categories != NULL;
    for (size_t i = 0; i < n && categories != NULL; i++) {
        categories[i] = take_byte() < 200 ? LOG_CATEGORIES[take_byte() % N_LOG_CATEGORIES] : take_name();
        good = good && categories[i] != NULL && category_of(categories[i]) < N_LOG_CATEGORIES;
    }
    CALL(s, good, true, fmi2SetDebugLogging, s->f, take_bool(), n, categories);
}

static void call_fmi2SetupExperiment(slot *s)
{
    const bool simple = take_bool(), stops = !simple && take_bool();
    const double start = simple ? 0.0 : take_real(), stop = stops ? take_real() : 0.0;
    const bool good = isfinite(start) && (!stops || stop >= start);
    if (CALL(s, good, true, fmi2SetupExperiment, s->f, take_bool(), take_real(), start, stops, stop)) {
        s->at = (expected){.type = s->at.type, .mode = s->at.mode, .experiment_defined = true, .time = start,
                           .stop_defined = stops, .stop = stop};
    }
}

/* Functions without arguments that lead to a mode. */
#define CALL_THAT_LEADS(function, good, to)            \
    static void call_##function(slot *s)               \
    {                                                  \
        if (CALL(s, good, true, function, s->f)) {     \
            s->at.mode = to;                           \
        }                                              \
    }

CALL_THAT_LEADS(fmi2EnterInitializationMode, s->at.experiment_defined, INITIALIZATION)
CALL_THAT_LEADS(fmi2ExitInitializationMode, true, s->at.type == fmi2ModelExchange ? EVENT : STEP)
CALL_THAT_LEADS(fmi2Terminate, true, TERMINATED)
CALL_THAT_LEADS(fmi2EnterEventMode, true, EVENT)
CALL_THAT_LEADS(fmi2EnterContinuousTimeMode, true, CONTINUOUS)

static void call_fmi2Reset(slot *s)
{
    CALL(s, true, true, fmi2Reset, s->f);
    s->at = (expected){.type = s->at.type, .mode = INSTANTIATED};
}

/* ---- Values ---- */

/* Room for n of them, or NULL. */
static void *take_room(size_t n, size_t size)
{
    return take_byte() < 253 ? exactly(n, size) : NULL;
}

/* A list of n of them, or NULL. */
#define TAKE_LIST(name, type, take)                              \
    static type *name(size_t n)                                  \
    {                                                            \
        type *const list = take_room(n, sizeof *list);           \
        for (size_t i = 0; i < n && list != NULL; i++) {         \
            list[i] = take();                                    \
        }                                                        \
        return list;                                             \
    }

TAKE_LIST(take_references, fmi2ValueReference, take_reference)
TAKE_LIST(take_reals, double, take_real)

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
    LENT fmi2ValueReference *const vr = take_references(n);
    LENT double *const values = take_room(n, sizeof *values);
    bool good = n == 0 || (vr != NULL && values != NULL), derived = false;
    for (size_t i = 0; i < n && vr != NULL; i++) {
        good = good && vr[i] < N_VARIABLES;
        derived = derived || (vr[i] >= FIRST_CALCULATED && vr[i] < (N_LAGGING > 0 ? FIRST_COEFFICIENT : FIRST_THRUST));
    }
    verdict wanted = legal(s, CALL_fmi2GetReal, good);
    if (wanted == ACCEPTED && derived && !is_moderate(s->f)) {
        wanted = EITHER; /* a derivative may overflow, and what follows from forces that are states */
    }
    check_results("fmi2GetReal", CALL_AS(s, wanted, false, fmi2GetReal, s->f, vr, n, values), values, n);
}

/* Sections 2.2.7, 3.2.3 and 4.2.4. */
static bool settable(const slot *s, fmi2ValueReference vr)
{
    const variable_kind kind = VARIABLES[vr].kind;
    switch ((int)s->at.mode) {
    case INSTANTIATED:
    case INITIALIZATION: return kind != CALCULATED;
    case CONTINUOUS: return kind == INPUT || kind == STATE || kind == TUNABLE;
    default: return kind == INPUT || kind == TUNABLE;
    }
}

static void call_fmi2SetReal(slot *s)
{
    const size_t n = take_count();
    LENT fmi2ValueReference *const vr = take_references(n);
    LENT double *const values = take_reals(n);
    bool good = n == 0 || (vr != NULL && values != NULL);
    for (size_t i = 0; i < n && good; i++) {
        good = vr[i] < N_VARIABLES && settable(s, vr[i]) && isfinite(values[i])
               && (VARIABLES[vr[i]].kind == INPUT
                   || (values[i] >= VARIABLES[vr[i]].minimum && values[i] <= VARIABLES[vr[i]].maximum));
    }
    if (CALL(s, good, true, fmi2SetReal, s->f, vr, n, values)) {
        for (size_t i = n; i-- > 0;) { /* the last one counts */
            bool later = false;
            for (size_t j = i + 1; j < n; j++) {
                later = later || vr[j] == vr[i];
            }
            PROPERTY(later || memcmp(&s->f->now.values[vr[i]], &values[i], sizeof(double)) == 0, "not set");
        }
    }
}

/* No variables of another type: nothing to get or set. */
#define CALL_OF_OTHER_TYPE(function, type)                          \
    static void call_##function(slot *s)                            \
    {                                                               \
        const size_t n = take_count();                              \
        LENT fmi2ValueReference *const vr = take_references(n);     \
        LENT type *const values = exactly(n, sizeof(type));         \
        CALL(s, n == 0, false, function, s->f, vr, n, values);      \
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
    LENT fmi2ValueReference *const unknown = take_references(n_unknown);
    LENT fmi2ValueReference *const known = take_references(n_known);
    LENT double *const change = take_reals(n_known);
    LENT double *const result = exactly(n_unknown, sizeof *result);
    bool good = (n_unknown == 0 || unknown != NULL) && (n_known == 0 || (known != NULL && change != NULL));
    for (size_t i = 0; i < n_known && good; i++) {
        const variable_kind kind = known[i] < N_VARIABLES ? VARIABLES[known[i]].kind : CALCULATED;
        good = kind == INPUT || kind == STATE || (kind != CALCULATED && s->at.mode == INITIALIZATION);
    }
    for (size_t i = 0; i < n_unknown && good; i++) {
        good = unknown[i] < N_VARIABLES && (VARIABLES[unknown[i]].kind == STATE || VARIABLES[unknown[i]].kind == CALCULATED);
    }
    verdict wanted = legal(s, CALL_fmi2GetDirectionalDerivative, good);
    for (size_t i = 0; i < n_known && wanted == ACCEPTED; i++) {
        wanted = fabs(change[i]) <= 1e30 && is_moderate(s->f) ? wanted : EITHER;
    }
    check_results("fmi2GetDirectionalDerivative", CALL_AS(s, wanted, false, fmi2GetDirectionalDerivative, s->f, unknown,
                  n_unknown, known, n_known, change, result), result, n_unknown);
}
