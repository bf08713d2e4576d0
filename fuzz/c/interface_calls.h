/* The functions of Model Exchange (section 3.2) and of Co-Simulation (section 4.2), with any arguments. */
#pragma once

#include "common_calls.h"
#include "laws.h"

/* ---- Model Exchange ---- */

static void call_fmi2NewDiscreteStates(slot *s)
{
    const bool given = take_byte() < 240;
    LENT fmi2EventInfo *const info = exactly(1, sizeof *info);
    if (CALL(s, given, false, fmi2NewDiscreteStates, s->f, given ? info : NULL)) {
        PROPERTY(info->newDiscreteStatesNeeded == fmi2False && info->terminateSimulation == fmi2False
                     && info->nextEventTimeDefined == fmi2False, "an event of the model's own");
    }
}

static void call_fmi2CompletedIntegratorStep(slot *s)
{
    const bool given = take_byte() < 240;
    fmi2Boolean event = 7, stop = 7, *const asked = given ? &event : NULL;
    const bool accepted = CALL(s, given, false, fmi2CompletedIntegratorStep, s->f, take_bool(), asked, &stop);
    const fmi2Boolean told = accepted ? fmi2False : 7;
    PROPERTY(event == told && stop == told, "an event %d or an end %d", event, stop);
}

static void call_fmi2SetTime(slot *s)
{
    const double time = take_real();
    if (CALL(s, isfinite(time), true, fmi2SetTime, s->f, time)) {
        s->at.time = time;
    }
}

static size_t take_number_of_states(void)
{
    const unsigned n = take_byte();
    return n < 240 ? N_STATES : n % (2 * N_STATES);
}

static void call_fmi2SetContinuousStates(slot *s)
{
    const size_t n = take_number_of_states();
    LENT double *const x = take_reals(n);
    bool good = n == N_STATES && x != NULL;
    for (size_t i = 0; i < n && good; i++) {
        good = isfinite(x[i]);
    }
    if (CALL(s, good, true, fmi2SetContinuousStates, s->f, x, n)) {
        PROPERTY(memcmp(&s->f->now.values[FIRST_STATE], x, n * sizeof *x) == 0, "not set");
    }
}

/* `overflows`: a result may. */
#define CALL_OF_STATES(function, overflows)                                                             \
    static void call_##function(slot *s)                                                                \
    {                                                                                                   \
        const size_t n = take_number_of_states();                                                       \
        LENT double *const x = take_room(n, sizeof *x);                                                 \
        verdict wanted = legal(s, CALL_##function, n == N_STATES && x != NULL);                         \
        wanted = wanted == ACCEPTED && (overflows) && !is_moderate(s->f) ? EITHER : wanted;             \
        check_results(#function, CALL_AS(s, wanted, false, function, s->f, x, n), x, n);                \
    }

CALL_OF_STATES(fmi2GetDerivatives, true)
CALL_OF_STATES(fmi2GetContinuousStates, false)
CALL_OF_STATES(fmi2GetNominalsOfContinuousStates, false)

static void call_fmi2GetEventIndicators(slot *s)
{
    const size_t n = take_byte() % 4;
    LENT double *const indicators = exactly(n, sizeof *indicators);
    CALL(s, n == 0, false, fmi2GetEventIndicators, s->f, indicators, n);
}

/* ---- Co-Simulation ---- */

static void call_fmi2SetRealInputDerivatives(slot *s)
{
    const size_t n = take_count();
    LENT fmi2ValueReference *const vr = take_references(n);
    LENT fmi2Integer *const order = exactly(n, sizeof *order);
    LENT double *const values = take_reals(n);
    CALL(s, n == 0, false, fmi2SetRealInputDerivatives, s->f, vr, n, order, values);
}

static void call_fmi2GetRealOutputDerivatives(slot *s)
{
    const size_t n = take_count();
    LENT fmi2ValueReference *const vr = take_references(n);
    LENT fmi2Integer *const order = exactly(n, sizeof *order);
    LENT double *const values = exactly(n, sizeof *values);
    bool good = n == 0 || vr != NULL;
    for (size_t i = 0; i < n; i++) {
        const unsigned any = take_byte();
        order[i] = any < 240 ? 1 : (int)any - 248;
        good = good && order[i] == 1 && vr[i] >= FIRST_STATE && vr[i] < N_VARIABLES
               && (vr[i] < FIRST_CALCULATED || (vr[i] >= FIRST_CALCULATED + N_STATES && VARIABLES[vr[i]].kind == CALCULATED));
    }
    verdict wanted = legal(s, CALL_fmi2GetRealOutputDerivatives, good);
    wanted = wanted == ACCEPTED && !is_moderate(s->f) ? EITHER : wanted;
    if (CALL_AS(s, wanted, false, fmi2GetRealOutputDerivatives, s->f, vr, n, order, values)) {
        check_results("fmi2GetRealOutputDerivatives", true, values, n);
    }
}

static unsigned wild; /* steps of an input that may take many pieces */

static void call_fmi2DoStep(slot *s)
{
    static const double usual[] = {1e-3, 1e-2, 0.1, 1.0, 100.0, 1000.0};
    const unsigned any = take_byte();
    const double h = any < 160 ? usual[any % 6] : take_real(), t = any < 250 ? s->at.time : take_real(), end = t + h;
    verdict good = h > 0.0 && isfinite(end) ? ACCEPTED : REFUSED;
    if (good == ACCEPTED && s->at.stop_defined && !(end <= s->at.stop)) {
        good = end > s->at.stop + 0.5 * h ? REFUSED : EITHER; /* rounding of the stop time */
    }
    before_call();
    verdict wanted = legal(s, CALL_fmi2DoStep, good != REFUSED);
    if (wanted == ACCEPTED && !(good == ACCEPTED && is_moderate(s->f) && is_calm(s->f, h))) {
        wanted = EITHER;
        wild++;
    }
    const fmi2Status status = fmi2DoStep(s->f, t, h, take_bool());
    if (wanted == EITHER && s->f->now.mode == FAILED) { /* it overflows, or takes too many pieces: nothing else may have changed */
        PROPERTY(status == fmi2Error, "a failed step returns %d", (int)status);
        s->at.mode = before(s)->now.mode = FAILED;
    }
    if (after_call(s, CALL_fmi2DoStep, wanted, status, true)) {
        s->at.time = end;
        check_step(before(s), s->f, h);
        PROPERTY(s->f->now.time == end, "a step to t = %a ends at %a", end, s->f->now.time);
    }
}

static void call_fmi2CancelStep(slot *s)
{
    CALL_AS(s, REFUSED, false, fmi2CancelStep, s->f);
}

#define CALL_OF_STATUS(function, type, known)                                                                       \
    static void call_##function(slot *s)                                                                            \
    {                                                                                                               \
        const int kind = (int)(take_byte() % 6) - 1;                                                                \
        const bool given = take_byte() < 240;                                                                       \
        LENT type *const value = exactly(1, sizeof(type));                                                          \
        CALL(s, given && kind == (known), false, function, s->f, (fmi2StatusKind)kind, given ? value : NULL);       \
    }

enum { NOTHING = -100 };
CALL_OF_STATUS(fmi2GetStatus, fmi2Status, NOTHING)
CALL_OF_STATUS(fmi2GetRealStatus, fmi2Real, fmi2LastSuccessfulTime)
CALL_OF_STATUS(fmi2GetIntegerStatus, fmi2Integer, NOTHING)
CALL_OF_STATUS(fmi2GetBooleanStatus, fmi2Boolean, fmi2Terminated)
CALL_OF_STATUS(fmi2GetStringStatus, fmi2String, NOTHING)
