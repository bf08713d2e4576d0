/* The functions that both interfaces have, with any arguments. */
#pragma once

#include "world.h"

/* ---- Life ---- */

/* Return the index of a category; N_LOG_CATEGORIES when it is unknown. */
static int category_of(const char *name)
{
    int i = 0;
    while (i < N_LOG_CATEGORIES && strcmp(name, LOG_CATEGORIES[i]) != 0) {
        i++;
    }
    return i;
}

/* Check what both versions of FMI demand of a message. */
static void check_message(const slot *s, int status, const char *category, const char *text)
{
    PROPERTY(text[0] != '\0' && strlen(text) < 640, "a message of %zu characters", strlen(text));
    for (const char *c = text; (c = strchr(c, '#')) != NULL; c += 2) { /* a single one would begin a value reference */
        PROPERTY(c[1] == '#', "a message with a single #: %s", text);
    }
    PROPERTY(status >= DONE && status <= REFUSED, "a message of status %d", status);
    const int known = category_of(category);
    PROPERTY(known < N_LOG_CATEGORIES, "a message of the category %s", category);
    PROPERTY(s->f == NULL || s->f->log_enabled[known], "a message of %s, which is switched off", category);
    messages++;
}

static const char *take_name(void)
{
    static const char *const names[] = {NULL, "", " \t\n", "rov", "rov 2", "#%s%n%d#", "\xc3\xa9\xff", "logEvents",
                                        "logStatusError", "logStatusWarning", "logStatusDiscard", MODEL_TOKEN};
    static char longest[1000];
    memset(longest, '%', sizeof longest - 1);
    const unsigned n = take_byte() % (sizeof names / sizeof names[0] + 1);
    return n < sizeof names / sizeof names[0] ? names[n] : longest;
}

static void free_instance(slot *s)
{
    FMI(FreeInstance)(s->f);
    s->f = NULL;
}

/* Put a new instance into a slot. `good`: the arguments that it was made with are valid. */
static void put_instance(slot *s, fmu *made, bool good, int type, manner of)
{
    s->f = made;
    PROPERTY((made != NULL) == (good && !memory_is_full), "an instance of type %d", type);
    s->of = of;
    s->at = (expected){.type = (interface_type)type, .mode = INSTANTIATED};
}

static bool is_name(const char *name)
{
    return name != NULL && name[strspn(name, " \t\n")] != '\0';
}

static bool is_token(const char *token)
{
    return token != NULL && strcmp(token, MODEL_TOKEN) == 0;
}

static void PLAY(SetDebugLogging)(slot *s)
{
    const size_t n = take_count();
    LENT const char **const categories = take_byte() < 250 ? exactly(n, sizeof *categories) : NULL;
    bool good = n == 0 || categories != NULL;
    for (size_t i = 0; i < n && categories != NULL; i++) {
        categories[i] = take_byte() < 200 ? LOG_CATEGORIES[take_byte() % N_LOG_CATEGORIES] : take_name();
        good = good && categories[i] != NULL && category_of(categories[i]) < N_LOG_CATEGORIES;
    }
    CALL(s, good, true, SetDebugLogging, s->f, take_bool(), n, categories);
}

/* Functions without arguments that change the mode. */
#define CALL_THAT_LEADS(name, good, to)                \
    static void PLAY(name)(slot *s)                    \
    {                                                  \
        if (CALL(s, good, true, name, s->f)) {         \
            s->at.mode = to;                           \
        }                                              \
    }

CALL_THAT_LEADS(ExitInitializationMode, true, s->at.type == TYPE_MODEL_EXCHANGE || s->of.events ? EVENT : STEP)
CALL_THAT_LEADS(Terminate, true, TERMINATED)

/* Check the commands that wait for the dead time. Those that were tried in Continuous-Time Mode are sent when the integrator's
 * step is complete, and not before. */
static void check_sent(const slot *s, bool complete)
{
#if HAS_DEAD_TIME
    const delay_line *const line = &s->f->now.line, *const old = &before(s)->now.line;
    PROPERTY(complete ? !delay_differs(line, s->f->now.values) : memcmp(line, old, sizeof *line) == 0,
             complete ? "a command is not sent" : "a command is sent before the step is complete");
#endif
    (void)s, (void)complete;
}

static void PLAY(EnterEventMode)(slot *s)
{
    const bool tried = s->at.mode == CONTINUOUS;
    if (CALL(s, true, true, EnterEventMode, s->f)) {
        s->at.mode = EVENT;
        check_sent(s, tried);
    }
}

static void PLAY(EnterContinuousTimeMode)(slot *s)
{
    if (CALL(s, true, true, EnterContinuousTimeMode, s->f)) {
        s->at.mode = CONTINUOUS;
        check_sent(s, true);
    }
}

static void PLAY(Reset)(slot *s)
{
    if (CALL(s, true, true, Reset, s->f)) {
        s->at = (expected){.type = s->at.type, .mode = INSTANTIATED};
    }
}

/* ---- Values ---- */

/* Return room for n elements, or NULL. */
static void *take_room(size_t n, size_t size)
{
    return take_byte() < 253 ? exactly(n, size) : NULL;
}

/* Return a list of n elements, or NULL. */
#define TAKE_LIST(name, type, take)                              \
    static type *name(size_t n)                                  \
    {                                                            \
        type *const list = take_room(n, sizeof *list);           \
        for (size_t i = 0; i < n && list != NULL; i++) {         \
            list[i] = take();                                    \
        }                                                        \
        return list;                                             \
    }

TAKE_LIST(take_references, unsigned, take_reference)
TAKE_LIST(take_reals, double, take_real)

/* Check n returned doubles: they are finite or, after a refused call, unchanged. */
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

/* Return the number of values for n references. FMI 3.0 passes this number, and it may be wrong. */
static size_t take_size(size_t n)
{
    const unsigned any = FMI_VERSION == 3 ? take_byte() : 0;
    return any < 245 ? n : any < 250 ? n + 1 : n / 2;
}

static void PLAY(GetReal)(slot *s)
{
    const size_t n = take_count(), m = take_size(n);
    LENT unsigned *const vr = take_references(n);
    LENT double *const values = take_room(m, sizeof *values);
    bool good = m == n && (n == 0 || (vr != NULL && values != NULL)), derived = false;
    for (size_t i = 0; i < n && vr != NULL; i++) {
        const unsigned place = place_of(vr[i]);
        good = good && place < N_VARIABLES + (FMI_VERSION == 3); /* the time */
        derived = derived || (place >= FIRST_CALCULATED && place < (MAY_OVERFLOW ? FIRST_COEFFICIENT : FIRST_OTHER))
                  || (place >= FIRST_ADDED && place < N_VARIABLES);
    }
    verdict wanted = legal(s, WHICH(GetReal), good);
    if (wanted == ALLOWED && derived && !is_moderate(s->f)) {
        wanted = EITHER; /* a derivative may overflow, and so may outputs that follow from states */
    }
    check_results("GetReal", CALL_AS(s, wanted, false, GetReal, s->f, vr, n, values AND(m)), values, m);
}

static bool is_state(variable_kind kind)
{
    return kind == STATE || kind == CALCULATED_STATE;
}

/* Return true when a variable may be set (FMI 2.0, sections 2.2.7, 3.2.3 and 4.2.4; FMI 3.0, sections 2.4.7.4 and 4.2). */
static bool settable(const slot *s, unsigned place)
{
    const variable_kind kind = VARIABLES[place].kind;
    switch ((int)s->at.mode) {
    case INSTANTIATED: return kind != CALCULATED && kind != MEMORY;
    case INITIALIZATION: return kind != CALCULATED && kind != CALCULATED_STATE && kind != MEMORY;
    case CONTINUOUS: return kind == INPUT || is_state(kind) || kind == TUNABLE;
    case EVENT: return kind == INPUT || kind == TUNABLE || (FMI_VERSION == 3 && is_state(kind));
    case INTERMEDIATE: return kind == INPUT && !(HAS_DEAD_TIME && place < N_COMMANDS); /* these commands are discrete */
    default: return kind == INPUT || kind == TUNABLE;
    }
}

/* Return true when a value is the one that a variable has already, so that it is harmless to set it again. */
static bool is_repetition(const slot *s, unsigned place, double value)
{
    const variable_kind kind = VARIABLES[place].kind;
    return s->f != NULL && kind != CALCULATED && kind != MEMORY && held(place, value) == s->f->now.values[place];
}

static void PLAY(SetReal)(slot *s)
{
    const size_t n = take_count(), m = take_size(n);
    LENT unsigned *const vr = take_references(n);
    LENT double *const values = take_reals(m);
    bool good = m == n && (n == 0 || (vr != NULL && values != NULL));
    for (size_t i = 0; i < n && good; i++) {
        const unsigned place = place_of(vr[i]);
        good = place < N_VARIABLES && (settable(s, place) || is_repetition(s, place, values[i])) && isfinite(values[i])
               && (VARIABLES[place].kind == INPUT
                   || (values[i] >= VARIABLES[place].minimum && values[i] <= VARIABLES[place].maximum));
    }
    if (CALL(s, good, true, SetReal, s->f, vr, n, values AND(m))) {
        check_sent(s, false);
        for (size_t i = n; i-- > 0;) { /* the last one counts */
            const unsigned place = place_of(vr[i]);
            bool other = !settable(s, place) || (s->at.mode == INSTANTIATED && VARIABLES[place].kind == CALCULATED_STATE);
            for (size_t j = i + 1; j < n; j++) {
                other = other || vr[j] == vr[i];
            }
            const double value = held(place, values[i]); /* check_instance knows the ranges */
            PROPERTY(other || memcmp(&s->f->now.values[place], &value, sizeof value) == 0, "not set");
        }
    }
}

/* Functions for types of which the FMU has no variables, and for clocks. */
#define CALL_OF_NONE(name, ...)                                           \
    static void PLAY(name)(slot *s)                                       \
    {                                                                     \
        const size_t n = take_count();                                    \
        LENT unsigned *const vr = take_references(n);                     \
        LENT void *const room = exactly(n, 16);                           \
        CALL(s, n == 0, false, name, s->f, vr, n, __VA_ARGS__);           \
    }

/* ---- Partial derivatives ---- */

/* The arguments of a directional (J seed) or an adjoint (seed J) derivative. */
typedef struct {
    size_t n_unknown, n_known, n_seed, n_result;
    unsigned *unknown, *known;
    double *seed, *result;
} partial;

static unsigned take_known(void)
{
    const unsigned n = take_byte();
    return n < 230 ? FIRST_REFERENCE + n % FIRST_CALCULATED : take_reference();
}

static unsigned take_unknown(void)
{
    const unsigned n = take_byte(), place = FIRST_STATE + n % (FIRST_COEFFICIENT - FIRST_STATE + N_ADDED);
    return n >= 230 ? take_reference() : FIRST_REFERENCE + (place < FIRST_COEFFICIENT ? place : place - FIRST_COEFFICIENT + FIRST_ADDED);
}

TAKE_LIST(take_knowns, unsigned, take_known)
TAKE_LIST(take_unknowns, unsigned, take_unknown)

static partial take_partial(bool adjoint)
{
    partial p;
    p.n_unknown = take_count();
    p.n_known = take_count();
    const size_t from = adjoint ? p.n_unknown : p.n_known, to = adjoint ? p.n_known : p.n_unknown;
    p.n_seed = take_size(from);
    p.n_result = take_size(to);
    p.unknown = take_unknowns(p.n_unknown);
    p.known = take_knowns(p.n_known);
    p.seed = take_reals(p.n_seed);
    p.result = exactly(p.n_result, sizeof *p.result);
    return p;
}

static void free_partial(const partial *p)
{
    free(p->unknown);
    free(p->known);
    free(p->seed);
    free(p->result);
}

static verdict may_differentiate(const slot *s, call which, const partial *p, bool adjoint)
{
    const size_t from = adjoint ? p->n_unknown : p->n_known, to = adjoint ? p->n_known : p->n_unknown;
    bool good = (p->n_unknown == 0 || p->unknown != NULL) && (p->n_known == 0 || p->known != NULL)
                && (from == 0 || p->seed != NULL) && p->n_seed >= from && p->n_result >= to;
    for (size_t i = 0; i < p->n_known && good; i++) {
        const unsigned place = place_of(p->known[i]);
        const variable_kind kind = place < N_VARIABLES ? VARIABLES[place].kind : CALCULATED;
        good = kind == INPUT || is_state(kind) || (kind != CALCULATED && kind != MEMORY && s->at.mode == INITIALIZATION);
    }
    for (size_t i = 0; i < p->n_unknown && good; i++) {
        const unsigned place = place_of(p->unknown[i]);
        const variable_kind kind = place < N_VARIABLES ? VARIABLES[place].kind : INPUT;
        good = is_state(kind) || kind == CALCULATED;
    }
    verdict wanted = legal(s, which, good);
    for (size_t i = 0; i < from && wanted == ALLOWED; i++) {
        wanted = fabs(p->seed[i]) <= 1e30 ? wanted : EITHER;
    }
    return wanted == ALLOWED && !is_moderate(s->f) ? EITHER : wanted; /* an entry may overflow, even times a seed of 0 */
}

static void PLAY(GetDirectionalDerivative)(slot *s)
{
    const partial p = take_partial(false);
    const verdict wanted = may_differentiate(s, WHICH(GetDirectionalDerivative), &p, false);
    const bool accepted = CALL_AS(s, wanted, false, GetDirectionalDerivative, s->f, p.unknown, p.n_unknown, p.known, p.n_known,
                                  p.seed AND(p.n_seed), p.result AND(p.n_result));
    check_results("GetDirectionalDerivative", accepted, p.result, accepted ? p.n_unknown : p.n_result);
    free_partial(&p);
}
