/* Simulation for Python, one vehicle after the other, with the bits of the FMU. */
#include "engine.h"

#include "series.c"

#include "step.c"

typedef struct {
    single own; /* the first member, so a pointer to it is one to the whole */
    model_numbers numbers;
    delay_line line;
} whole;

size_t single_size(void)
{
    return sizeof(whole);
}

/* Begin at the attitude that the parameters give, or at the given quaternion if it is not 0. Of the headings that
 * differ by whole turns, the one nearest to psi_0 is taken. The given delayed commands act, and nothing waits. Return
 * false when the mass matrix is not positive definite, which an FMU refuses, too. */
bool single_begin(single *v, const table given[N_VARIABLES], ptrdiff_t vehicle)
{
    whole *const all = (whole *)v;
    double state[N_STATES];
    memset(v, 0, sizeof *v);
    for (int i = 0; i < FIRST_CALCULATED; i++) {
        v->at[i] = number(&given[i], vehicle, 0);
    }
    for (int i = FIRST_COEFFICIENT; i < N_VARIABLES; i++) {
        v->at[i] = number(&given[i], vehicle, 0);
    }
    model_prepare(v->at, &all->numbers);
    memcpy(state, v->at + FIRST_STATE, sizeof state);
    model_begin(v->at, &v->heading);
#if HAS_DEAD_TIME
    all->line.waiting = 0;
#endif
    for (int i = FIRST_COEFFICIENT - N_MEMORY; i < FIRST_COEFFICIENT; i++) {
        v->at[i] = number(&given[i], vehicle, 0);
    }
    if (HAS_ATTITUDE && model_has_direction(state)) {
        memcpy(v->at + FIRST_STATE, state, sizeof state);
        v->heading = model_heading(v->at, v->heading);
    }
    return model_is_definite(&all->numbers);
}

/* Before the first step, the current before is the present one, unless it was given. */
void single_begin_current(single *v)
{
#ifdef CURRENT_PASSES
    if (isnan(v->at[FIRST_BEFORE])) {
        current_keep(v->at);
    }
#else
    (void)v;
#endif
}

/* Return true when changes of the commands wait for the dead time, so that the next step may have several parts. */
bool single_waits(const single *v)
{
#if HAS_DEAD_TIME
    const delay_line *const line = &((const whole *)v)->line;
    return line->waiting > 0 || delay_differs(line, v->at);
#else
    (void)v;
    return false;
#endif
}

/* Step over h seconds from time t. Return false when the motion cannot be computed. */
bool single_step(single *v, double t, double h)
{
    whole *const all = (whole *)v;
    double next[N_STATES];
    single_begin_current(v);
    const int pieces = delayed_step(v->at, &all->numbers, &all->line, t, h, next, &v->heading);
    if (pieces <= 0 || !all_finite(next, N_STATES)) {
        return false;
    }
    memcpy(v->at + FIRST_STATE, next, sizeof next);
    delay_commit(v->at, &all->line, t, h);
    return true;
}

/* Calculate the variables that follow from the inputs and states. */
void single_calculate(single *v)
{
    model_calculate(v->at, &((whole *)v)->numbers, v->heading);
}

/* Return the length, at most `reach`, of a piece of a vehicle in a lane, from the coefficients of its series. *reversed becomes the
 * velocity that reverses there, or NONE. */
double single_cut(const double c[], int order, double reach, int *reversed)
{
    series s;
    s.order = order;
    for (int i = 0; i < N_MONITORED; i++) {
        s.pace[i] = 1.0;
    }
    memcpy(s.c, c, (size_t)(order + 1) * sizeof s.c[0]);
    *reversed = series_cut(&s, (const bool[N_MONITORED]){false}, &reach);
    return reach;
}

/* Give a vehicle the inputs of the step that begins at a time. */
static void single_set_inputs(single *v, const table given[N_VARIABLES], ptrdiff_t vehicle, ptrdiff_t n)
{
    for (int i = 0; i < N_INPUTS; i++) {
        v->at[i] = number(&given[i], vehicle, n);
    }
}

void simulate(SIMULATION)
{
    const bool calculates = is_calculated(recorded, records);
    whole all;
    single *const v = &all.own;
    for (ptrdiff_t vehicle = first; vehicle < last; vehicle++) {
        const bool exists = single_begin(v, given, vehicle);
        failed[vehicle] = exists ? times : 0;
        for (ptrdiff_t n = 0; n < failed[vehicle] && *stop == 0; n++) {
            single_set_inputs(v, given, vehicle, ended && n > 0 ? n - 1 : n);
            single_begin_current(v);
            if (calculates) {
                single_calculate(v);
            }
            double *to = result + vehicle * times + n;
            for (ptrdiff_t k = 0; k < records; k++) {
                to[k * vehicles * times] = v->at[recorded[k]];
            }
            if (ended) {
                single_set_inputs(v, given, vehicle, n);
            }
            if (n + 1 < times && !single_step(v, time[n], length[n])) {
                failed[vehicle] = n + 1;
            }
        }
    }
}
