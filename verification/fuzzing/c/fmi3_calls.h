/* The functions that only FMI 3.0 has, or that differ from FMI 2.0. */
#pragma once

#include "common_calls.h"
#include "laws.h"

/* ---- Intermediate update ---- */

/* A step with intermediate updates: its start, its length, how far it has come, and where it ends. */
typedef struct updates {
    double t, h, gone, length;
    unsigned n, quiet; /* updates so far, and to come until something is called */
    bool sets;         /* inputs have changed */
    verdict *wanted;
} updates;

/* Make calls inside a step. New inputs may make the rest of the step fail. */
static void play_inside(slot *s, updates *u, fmi3Boolean *early, double *end)
{
    const unsigned what = take_byte();
    double inputs[FIRST_STATE];
    memcpy(inputs, s->f->now.values, sizeof inputs);
    if (what < 120) {
        call_fmi3SetFloat64(s);
    } else if (what < 160) {
        call_fmi3GetFloat64(s);
    } else if (what < 220) {
        any_call(s, take_byte());
    } else {
        *early = take_bool();
        *end = take_bool() ? s->at.time + 0.25 * u->h : take_real();
    }
    check_instance(s);
    u->sets = u->sets || memcmp(inputs, s->f->now.values, sizeof inputs) != 0;
    if (*u->wanted == ALLOWED && !(is_moderate(s->f) && is_calm(s->f, u->h))) {
        *u->wanted = EITHER;
        spent += MOST_PIECES;
    }
}

/* The callback: check the piece of the step that has just passed. */
static void update_step(fmi3InstanceEnvironment environment, double time, bool may_set, bool may_get, bool finished,
                        bool may_return, fmi3Boolean *early, double *end)
{
    slot *const s = environment;
    updates *const u = s->inside;
    PROPERTY(u != NULL && s->at.mode == STEP, "an update in %s", mode_name(s->at.mode));
    const double pieces = fmin(fmax(1.0, ceil(u->h / 1e-4 * (1.0 - 1e-9))), MOST_UPDATES), from = u->gone;
    if (u->n > 0) {
        u->gone = u->n < pieces ? fmin(u->length, u->h * (u->n / pieces)) : u->length;
        check_step_law(before(s), s->f, u->gone - from);
    }
    const bool is_inside = u->n++ > 0 && u->gone < u->length;
    spent++;
    PROPERTY(time == u->t + u->gone && s->f->now.time == time, "update %u at %a instead of %a", u->n, time, u->t + u->gone);
    PROPERTY(may_set && may_get && finished && may_return == (is_inside && s->of.returns_early), "what an update may");
    PROPERTY(!*early && *end == u->t + u->length, "an early return at %a before it is asked for", *end);
    s->at.mode = INTERMEDIATE;
    s->at.time = time;
    if (position < input_size && u->quiet-- == 0) {
        play_inside(s, u, early, end);
        u->quiet = take_byte() % 32;
    }
    if (*early && may_return && *end < u->t + u->length) {
        u->length = fmax(*end - u->t, u->gone);
    }
    s->at.mode = STEP;
    before_call(); /* what follows belongs to the step */
    before(s)->now.mode = STEP;
}

static int do_step(slot *s, double t, double h, verdict *wanted)
{
    updates u = {.t = t, .h = h, .length = h, .quiet = take_byte() % 32, .wanted = wanted}, *const outer = s->inside;
    const unsigned missing = take_byte();
    fmi3Boolean event = true, stop = true, early = true;
    double last = -1.0;
    _Alignas(fmu) unsigned char start[sizeof(fmu)];
    memcpy(start, before(s), sizeof start);
    if (missing >= 250) {
        *wanted = FORBIDDEN;
    }
    s->inside = &u;
    const fmi3Status status = fmi3DoStep(s->f, t, h, take_bool(), missing == 250 ? NULL : &event, missing == 251 ? NULL : &stop,
                                         missing == 252 ? NULL : &early, missing > 252 ? NULL : &last);
    s->inside = outer;
    if (status != fmi3OK) {
        return (int)status;
    }
    PROPERTY((u.n > 0) == s->of.updates, "%u updates", u.n);
    if (u.n == 0) {
        u.gone = h;
        check_whole_step(before(s), s->f, t, h);
    } else {
        PROPERTY(is_same(s, false), "a step does more after its last update");
        if (!u.sets) {
            check_parts((fmu *)(void *)start, s->f, u.gone, 1);
        }
    }
    PROPERTY(!event && !stop && last == t + u.gone && last == s->f->now.time && early == (last < t + h),
             "a step from %a over %a: to %a, early %d", t, h, last, early);
    return (int)status;
}

/* ---- Life ---- */

static void check_line(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    check_message(environment, (int)status, category, message);
}

/* Replace the instance of a slot; by NULL when an argument is wrong. `vr`: the n variables for intermediate updates. */
static void replace_instance(slot *s, const char *name, int type, const char *token, manner of, const unsigned vr[], size_t n)
{
    const fmi3LogMessageCallback log = of.logs ? check_line : NULL;
    const fmi3IntermediateUpdateCallback update = of.updates ? update_step : NULL;
    bool good = is_name(name) && is_token(token) && type >= 0 && type <= 1;
    fmu *made;
    for (size_t i = 0; i < n && type == TYPE_CO_SIMULATION; i++) {
        good = good && vr != NULL && place_of(vr[i]) <= N_VARIABLES;
    }
    free_instance(s);
    before_call();
    if (type == TYPE_MODEL_EXCHANGE) {
        made = fmi3InstantiateModelExchange(name, token, NULL, false, of.is_told, s, log);
        of.events = of.updates = of.returns_early = false;
    } else if (type == TYPE_CO_SIMULATION) {
        made = fmi3InstantiateCoSimulation(name, token, NULL, false, of.is_told, of.events, of.returns_early, vr, n, s, log,
                                           update);
        of.updates = of.updates && (n > 0 || of.returns_early);
    } else {
        made = fmi3InstantiateScheduledExecution(name, token, NULL, false, of.is_told, s, log, NULL, NULL, NULL);
    }
    put_instance(s, made, good, type, of);
}

static manner take_manner(void)
{
    const unsigned any = take_byte();
    return (manner){.logs = true, .events = (any & 1) != 0, .updates = (any & 2) == 0, .returns_early = (any & 4) == 0};
}

static void call_fmi3Instantiate(slot *s)
{
    const bool proper = take_byte() < 200;
    const char *const name = proper ? "rov" : take_name();
    const char *const token = proper || take_bool() ? MODEL_TOKEN : take_name();
    const int type = proper ? take_bool() : (int)take_byte() % 3;
    const size_t n = take_count();
    LENT unsigned *const vr = proper ? exactly(n, sizeof *vr) : take_references(n);
    manner of = take_manner();
    memory_is_full = take_byte() >= 250;
    of.logs = take_byte() < 200;
    of.is_told = take_bool();
    for (size_t i = 0; i < n && proper; i++) {
        vr[i] = FIRST_REFERENCE + (unsigned)i % N_VARIABLES;
    }
    replace_instance(s, name, type, token, of, vr, n);
    memory_is_full = false;
}

static void make(slot *s, interface_type type, manner of)
{
    static const unsigned first[] = {FIRST_REFERENCE};
    replace_instance(s, "rov", (int)type, MODEL_TOKEN, of, first, 1);
}

static void enter_initialization(slot *s, double start, bool stops, double stop)
{
    const bool good = isfinite(start) && (!stops || stop >= start);
    if (CALL(s, good, true, EnterInitializationMode, s->f, false, 0.0, start, stops, stop)) {
        s->at = (expected){.type = s->at.type, .mode = INITIALIZATION, .time = start,
                           .stop_defined = stops, .stop = stop};
    }
}

static void call_fmi3EnterInitializationMode(slot *s)
{
    const bool simple = take_bool(), stops = !simple && take_bool();
    const double start = simple ? 0.0 : take_real();
    enter_initialization(s, start, stops, stops ? take_real() : 0.0);
}

/* Enter Initialization Mode. */
static void begin(slot *s)
{
    enter_initialization(s, 0.0, false, 0.0);
}

CALL_THAT_LEADS(EnterStepMode, true, STEP)

static void call_fmi3EvaluateDiscreteStates(slot *s)
{
    CALL(s, true, false, EvaluateDiscreteStates, s->f);
}

static void call_fmi3UpdateDiscreteStates(slot *s)
{
    const unsigned any = take_byte();
    fmi3Boolean flags[5] = {true, true, true, true, true}, *asked[5];
    double next = 1.0;
    for (unsigned i = 0; i < 5; i++) {
        asked[i] = any == 240 + i ? NULL : &flags[i];
    }
    const bool accepted = CALL(s, any < 240 || any > 245, has_own_events(s), UpdateDiscreteStates, s->f, asked[0], asked[1], asked[2],
                               asked[3], asked[4], any == 245 ? NULL : &next);
    for (unsigned i = 0; i < 4; i++) {
        PROPERTY(flags[i] == !accepted, "an event of the model's own");
    }
    if (accepted) {
        check_next_event(s, flags[4], next);
    }
}

#define CALL_OF_COUNT(name, number)                                                             \
    static void PLAY(name)(slot *s)                                                             \
    {                                                                                           \
        const bool given = take_byte() < 240;                                                   \
        size_t n = 12345;                                                                       \
        const bool accepted = CALL(s, given, false, name, s->f, given ? &n : NULL);             \
        PROPERTY(n == (accepted ? (number) : 12345), "%zu of " #name, n);                       \
    }

CALL_OF_COUNT(GetNumberOfContinuousStates, N_STATES)
CALL_OF_COUNT(GetNumberOfEventIndicators, 0)

/* ---- Values ---- */

#define CALLS_OF_TYPE(type)                 \
    CALL_OF_NONE(Get##type, room, n)        \
    CALL_OF_NONE(Set##type, room, n)

CALLS_OF_TYPE(Float32)
CALLS_OF_TYPE(Int8)
CALLS_OF_TYPE(UInt8)
CALLS_OF_TYPE(Int16)
CALLS_OF_TYPE(UInt16)
CALLS_OF_TYPE(Int32)
CALLS_OF_TYPE(UInt32)
CALLS_OF_TYPE(Int64)
CALLS_OF_TYPE(UInt64)
CALLS_OF_TYPE(Boolean)
CALLS_OF_TYPE(String)
CALL_OF_NONE(GetBinary, room, room, n)
CALL_OF_NONE(SetBinary, room, room, n)
CALL_OF_NONE(GetClock, room)
CALL_OF_NONE(SetClock, room)
CALL_OF_NONE(GetIntervalDecimal, room, room)
CALL_OF_NONE(GetIntervalFraction, room, room, room)
CALL_OF_NONE(GetShiftDecimal, room)
CALL_OF_NONE(GetShiftFraction, room, room)
CALL_OF_NONE(SetIntervalDecimal, room)
CALL_OF_NONE(SetIntervalFraction, room, room)
CALL_OF_NONE(SetShiftDecimal, room)
CALL_OF_NONE(SetShiftFraction, room, room)

/* Functions of features that this FMU does not have. */
#define CALL_OF_MISSING(name, ...)                                                              \
    static void PLAY(name)(slot *s)                                                             \
    {                                                                                           \
        CALL_AS(s, FORBIDDEN, false, name, __VA_ARGS__);                                        \
    }

CALL_OF_MISSING(EnterConfigurationMode, s->f)
CALL_OF_MISSING(ExitConfigurationMode, s->f)
CALL_OF_MISSING(ActivateModelPartition, s->f, take_reference(), take_real())
CALL_OF_MISSING(GetNumberOfVariableDependencies, s->f, take_reference(), NULL)
CALL_OF_MISSING(GetVariableDependencies, s->f, take_reference(), NULL, NULL, NULL, NULL, take_count())

/* ---- Partial derivatives ---- */

/* Check adjoint derivatives against the columns of the Jacobian times the seed. */
static void check_adjoint(slot *s, const partial *p)
{
    const double one = 1.0;
    LENT double *const column = exactly(p->n_unknown, sizeof *column);
    for (size_t k = 0; k < p->n_known; k++) {
        const fmi3Status status = fmi3GetDirectionalDerivative(s->f, p->unknown, p->n_unknown, &p->known[k], 1, &one, 1, column,
                                                               p->n_unknown);
        double sum = 0.0, size = 0.0;
        PROPERTY(status == fmi3OK, "an adjoint derivative without a directional one");
        for (size_t i = 0; i < p->n_unknown; i++) {
            sum += p->seed[i] * column[i];
            size += fabs(p->seed[i] * column[i]);
        }
        PROPERTY(!(fabs(sum - p->result[k]) > 1e-12 * size), "adjoint %a, directional %a", p->result[k], sum);
    }
}

static void call_fmi3GetAdjointDerivative(slot *s)
{
    const partial p = take_partial(true);
    const verdict wanted = may_differentiate(s, CALL_fmi3GetAdjointDerivative, &p, true);
    const bool accepted = CALL_AS(s, wanted, false, GetAdjointDerivative, s->f, p.unknown, p.n_unknown, p.known, p.n_known, p.seed,
                                  p.n_seed, p.result, p.n_result);
    check_results("GetAdjointDerivative", accepted, p.result, accepted ? p.n_known : p.n_result);
    if (accepted) {
        check_adjoint(s, &p);
    }
    free_partial(&p);
}
