/* The functions that only FMI 2.0 has, or that differ from FMI 3.0. */
#pragma once

#include "common_calls.h"
#include "laws.h"

/* ---- Life ---- */

static void check_line(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                       fmi2String message, ...)
{
    const slot *const s = environment;
    char text[2048];
    va_list none;
    va_start(none, message);
    vsnprintf(text, sizeof text, message, none); /* as importers do: no percent sign is left in it */
    va_end(none);
    PROPERTY(s->f == NULL || strcmp(name, s->f->name) == 0, "a message of the instance %s", name);
    check_message(s, (int)status, category, text);
}

/* Replace the instance of a slot; by NULL when an argument is wrong. */
static void place(slot *s, const char *name, int type, const char *token, manner of, bool functions)
{
    free_instance(s);
    LENT fmi2CallbackFunctions *const callbacks = exactly(1, sizeof *callbacks);
    *callbacks = (fmi2CallbackFunctions){of.logs ? check_line : NULL, NULL, NULL, NULL, s};
    before_call();
    fmu *const made = fmi2Instantiate(name, (fmi2Type)type, token, NULL, functions ? callbacks : NULL, fmi2False, of.is_told);
    put_instance(s, made, is_name(name) && is_token(token) && type >= 0 && type <= 1 && functions, type, of);
}

static void call_fmi2Instantiate(slot *s)
{
    const bool proper = take_byte() < 200;
    const char *const name = proper ? "rov" : take_name();
    const char *const token = proper || take_bool() ? MODEL_TOKEN : take_name();
    const int type = proper ? take_bool() : (int)take_word(4);
    manner of = {.logs = false};
    memory_is_full = take_byte() >= 250;
    of.logs = take_byte() < 200;
    const bool functions = take_byte() < 240;
    of.is_told = take_bool();
    place(s, name, type, token, of, functions);
    memory_is_full = false;
}

static void make(slot *s, interface_type type, manner of)
{
    place(s, "rov", (int)type, MODEL_TOKEN, of, true);
}

static manner take_manner(void)
{
    return (manner){.logs = true};
}

static void call_fmi2SetupExperiment(slot *s)
{
    const bool simple = take_bool(), stops = !simple && take_bool();
    const double start = simple ? 0.0 : take_real(), stop = stops ? take_real() : 0.0;
    const bool good = isfinite(start) && (!stops || stop >= start);
    if (CALL(s, good, true, SetupExperiment, s->f, take_bool(), take_real(), start, stops, stop)) {
        s->at = (expected){.type = s->at.type, .mode = s->at.mode, .time = start,
                           .stop_defined = stops, .stop = stop};
    }
}

CALL_THAT_LEADS(EnterInitializationMode, true, INITIALIZATION)

/* Enter Initialization Mode. */
static void begin(slot *s)
{
    fmi2SetupExperiment(s->f, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    call_fmi2EnterInitializationMode(s);
}

static void call_fmi2NewDiscreteStates(slot *s)
{
    const bool given = take_byte() < 240;
    LENT fmi2EventInfo *const info = exactly(1, sizeof *info);
    if (CALL(s, given, has_own_events(s), NewDiscreteStates, s->f, given ? info : NULL)) {
        PROPERTY(info->newDiscreteStatesNeeded == fmi2False && info->terminateSimulation == fmi2False
                     && info->nominalsOfContinuousStatesChanged == fmi2False
                     && info->valuesOfContinuousStatesChanged == fmi2False, "an event of the model's own");
        check_next_event(s, info->nextEventTimeDefined, info->nextEventTime);
    }
}

/* ---- Values ---- */

CALL_OF_NONE(GetInteger, room)
CALL_OF_NONE(GetBoolean, room)
CALL_OF_NONE(GetString, room)
CALL_OF_NONE(SetInteger, room)
CALL_OF_NONE(SetBoolean, room)
CALL_OF_NONE(SetString, room)

/* ---- Co-Simulation ---- */

static void call_fmi2SetRealInputDerivatives(slot *s)
{
    const size_t n = take_count();
    LENT unsigned *const vr = take_references(n);
    LENT int *const order = exactly(n, sizeof *order);
    LENT double *const values = take_reals(n);
    CALL(s, n == 0, false, SetRealInputDerivatives, s->f, vr, n, order, values);
}

static int do_step(slot *s, double t, double h, verdict *wanted)
{
    (void)wanted;
    const fmi2Status status = fmi2DoStep(s->f, t, h, take_bool());
    if (status == fmi2OK) {
        check_whole_step(before(s), s->f, t, h);
    }
    return (int)status;
}

static void call_fmi2CancelStep(slot *s)
{
    CALL_AS(s, FORBIDDEN, false, CancelStep, s->f);
}

#define CALL_OF_STATUS(name, type, known)                                                                           \
    static void PLAY(name)(slot *s)                                                                                 \
    {                                                                                                               \
        const int kind = (int)(take_byte() % 6) - 1;                                                                \
        const bool given = take_byte() < 240;                                                                       \
        LENT type *const value = exactly(1, sizeof(type));                                                          \
        CALL(s, given && kind == (known), false, name, s->f, (fmi2StatusKind)kind, given ? value : NULL);           \
    }

enum { NOTHING = -100 };
CALL_OF_STATUS(GetStatus, fmi2Status, NOTHING)
CALL_OF_STATUS(GetRealStatus, fmi2Real, fmi2LastSuccessfulTime)
CALL_OF_STATUS(GetIntegerStatus, fmi2Integer, NOTHING)
CALL_OF_STATUS(GetBooleanStatus, fmi2Boolean, fmi2Terminated)
CALL_OF_STATUS(GetStringStatus, fmi2String, NOTHING)
