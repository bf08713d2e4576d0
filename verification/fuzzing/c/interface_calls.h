/* The functions of Model Exchange and of Co-Simulation, with any arguments. */
#pragma once

#include "common_calls.h"
#include "laws.h"

#if FMI_VERSION == 3
#include "fmi3_calls.h"
#else
#include "fmi2_calls.h"
#endif

/* ---- Model Exchange ---- */

static void PLAY(CompletedIntegratorStep)(slot *s)
{
    const bool given = take_byte() < 240;
    boolean event = true, stop = true, *const asked = given ? &event : NULL;
    verdict wanted = legal(s, WHICH(CompletedIntegratorStep), given);
    wanted = wanted == ALLOWED && HAS_ATTITUDE && !is_moderate(s->f) ? EITHER : wanted;
    const bool changes = HAS_ATTITUDE || HAS_DEAD_TIME;
    const bool accepted = CALL_AS(s, wanted, changes, CompletedIntegratorStep, s->f, take_bool(), asked, &stop);
    PROPERTY((event == !accepted || HAS_DEAD_TIME) && stop == !accepted, "an event %d or an end %d", event, stop);
    if (accepted) {
        check_sent(s, true);
        check_heading(s->f, before(s)->now.heading);
    }
}

static void PLAY(SetTime)(slot *s)
{
    const double time = take_real();
    if (CALL(s, isfinite(time), true, SetTime, s->f, time)) {
        s->at.time = time;
    }
}

static size_t take_number_of_states(void)
{
    const unsigned n = take_byte();
    return n < 240 ? N_STATES : n % (2 * N_STATES);
}

static void PLAY(SetContinuousStates)(slot *s)
{
    const size_t n = take_number_of_states();
    LENT double *const x = take_reals(n);
    bool good = n == N_STATES && x != NULL;
    for (size_t i = 0; i < n && good; i++) {
        good = isfinite(x[i]);
    }
    good = good && model_has_direction(x);
    if (CALL(s, good, true, SetContinuousStates, s->f, x, n)) {
        PROPERTY(memcmp(&s->f->now.values[FIRST_STATE], x, n * sizeof *x) == 0, "not set");
    }
}

/* `overflows`: a result may overflow. */
#define CALL_OF_STATES(name, overflows)                                                                 \
    static void PLAY(name)(slot *s)                                                                     \
    {                                                                                                   \
        const size_t n = take_number_of_states();                                                       \
        LENT double *const x = take_room(n, sizeof *x);                                                 \
        verdict wanted = legal(s, WHICH(name), n == N_STATES && x != NULL);                             \
        wanted = wanted == ALLOWED && (overflows) && !is_moderate(s->f) ? EITHER : wanted;              \
        check_results(#name, CALL_AS(s, wanted, false, name, s->f, x, n), x, n);                        \
    }

CALL_OF_STATES(GetDerivatives, true)
CALL_OF_STATES(GetContinuousStates, false)
CALL_OF_STATES(GetNominalsOfContinuousStates, false)

static void PLAY(GetEventIndicators)(slot *s)
{
    const size_t n = take_byte() % 4;
    LENT double *const indicators = exactly(n, sizeof *indicators);
    CALL(s, n == 0, false, GetEventIndicators, s->f, indicators, n);
}

/* ---- Co-Simulation ---- */

static void PLAY(GetRealOutputDerivatives)(slot *s)
{
    const size_t n = take_count(), m = take_size(n);
    LENT unsigned *const vr = take_references(n);
    LENT int *const order = exactly(n, sizeof *order);
    LENT double *const values = exactly(m, sizeof *values);
    bool good = m == n && (n == 0 || vr != NULL);
    for (size_t i = 0; i < n; i++) {
        const unsigned any = take_byte();
        order[i] = any < 200 ? 1 : (int)any % 4 - 1;
        const unsigned place = vr == NULL ? 0 : place_of(vr[i]);
        good = good && order[i] == 1 && place < N_VARIABLES && VARIABLES[place].is_output;
    }
    verdict wanted = legal(s, WHICH(GetRealOutputDerivatives), good);
    wanted = wanted == ALLOWED && !is_moderate(s->f) ? EITHER : wanted;
    const bool accepted = CALL_AS(s, wanted, false, GetRealOutputDerivatives, s->f, vr, n, order, values AND(m));
    check_results("GetRealOutputDerivatives", accepted, values, m);
    for (size_t i = 0; i < n && accepted; i++) {
        if (place_of(vr[i]) < FIRST_CALCULATED) {
            check_first_derivative(s->f, place_of(vr[i]) - FIRST_STATE, values[i]);
        }
    }
}

static double take_step(const slot *s)
{
    static const double usual[] = {1e-3, 1e-2, 0.1, 1.0, 100.0, 1000.0}, fine[] = {1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 1e-2};
    const unsigned any = take_byte();
    const double real = any >= 160 ? take_real() : 0.0;
    if (s->of.updates && any < 240) { /* thousands of updates take their time */
        return fine[any % 6];
    }
    return any >= 160 ? real : usual[any % 6];
}

static void PLAY(DoStep)(slot *s)
{
    const double h = take_step(s), t = take_byte() < 250 ? s->at.time : take_real(), end = t + h;
    verdict good = h > 0.0 && isfinite(end) ? ALLOWED : FORBIDDEN;
    if (good == ALLOWED && s->at.stop_defined && !(end <= s->at.stop)) {
        good = end > s->at.stop + 0.5 * h ? FORBIDDEN : EITHER; /* rounding of the stop time */
    }
    verdict wanted = legal(s, WHICH(DoStep), good != FORBIDDEN);
    if (wanted == ALLOWED && !(good == ALLOWED && is_moderate(s->f) && is_calm(s->f, h))) {
        wanted = EITHER;
        spent += MOST_PIECES;
    }
    before_call();
    const int status = do_step(s, t, h, &wanted);
    if (wanted == EITHER && s->f->now.mode == FAILED) { /* it overflows, or takes too many pieces: nothing else may have changed */
        PROPERTY(status == REFUSED, "a failed step returns %d", status);
        s->at.mode = before(s)->now.mode = FAILED;
    }
    if (after_call(s, WHICH(DoStep), wanted, status, true)) {
        s->at.time = s->f->now.time;
    }
}
