/* Simulation for Python of many vehicles at once, one in each lane of a vector (real.h). All lanes take a piece of their steps at
 * the same time, each of its own length, and a lane whose step is at its end begins the next one. So a vehicle has no influence on
 * its neighbours. When a vehicle ends, the next one takes its lane. Steps that need more than that are taken singly by engine.c: while
 * commands wait for the dead time, where a velocity may begin to move with a higher power of time, where a number is not finite,
 * and where a step has many pieces, because engine.c ends a step early when all velocities are steady. */
#include "vectors.h"

#include <stdlib.h>

#include "engine.h"

#include "series.c"

#include "step.c"

enum { MOST_TOGETHER = 64 }; /* pieces of a step */

typedef struct {
    ptrdiff_t vehicle; /* or -1 */
    ptrdiff_t n;       /* the index of the time at which the present step begins */
    int pieces;        /* the pieces of this step so far, or 0 before it */
    single *single;     /* the same vehicle for steps that it takes singly, with the commands that wait; where it begins and ends */
} lane;

typedef struct {
    real at[N_VARIABLES], heading; /* at the start of the present step of each lane */
    model_numbers numbers;
    motion m;
    lane lanes[LANES];
} block;

/* Let a vehicle enter a lane where it begins, or where it was. Return false when it cannot begin. */
static bool enter_lane(block *b, int i, const table given[N_VARIABLES], ptrdiff_t vehicle, void *going)
{
    lane *const own = &b->lanes[i];
    if (going) {
        own->single = single_of(going, vehicle);
    } else if (!single_begin(own->single, given, vehicle)) {
        return false;
    }
    own->vehicle = vehicle;
    own->n = own->pieces = 0;
    single_begin_current(own->single);
    for (int k = 0; k < N_VARIABLES; k++) {
        LANE(b->at[k], i) = own->single->at[k];
    }
    LANE(b->heading, i) = own->single->heading;
    return true;
}

/* Give a lane that is about to begin a step the inputs of the step that begins at a time. */
static void set_inputs(block *b, int i, const table given[N_VARIABLES], ptrdiff_t n, void *going)
{
    for (int k = 0; k < N_INPUTS; k++) {
        if (!going && given[k].per_time != 0) {
            LANE(b->at[k], i) = number(&given[k], b->lanes[i].vehicle, n);
        }
    }
}

/* Let the vehicle of its single steps be where the lane is. */
static single *follow_lane(block *b, int i)
{
    single *const one = b->lanes[i].single;
    for (int k = 0; k < FIRST_CALCULATED; k++) {
        one->at[k] = LANE(b->at[k], i);
    }
    for (int k = FIRST_COEFFICIENT - N_MEMORY; k < FIRST_COEFFICIENT; k++) {
        one->at[k] = LANE(b->at[k], i);
    }
    one->heading = LANE(b->heading, i);
    return one;
}

/* Step the vehicle of a lane singly. Return false when its motion cannot be computed. */
static bool step_single(block *b, int i, double t, double h)
{
    single *const one = follow_lane(b, i);
    if (!single_step(one, t, h)) {
        return false;
    }
    for (int k = FIRST_STATE; k < FIRST_COEFFICIENT; k++) {
        LANE(b->at[k], i) = one->at[k];
    }
    LANE(b->heading, i) = one->heading;
    return true;
}

/* Return true when commands of a lane wait for the dead time. */
static bool waits_in_lane(block *b, int i)
{
    single *const one = b->lanes[i].single;
    for (int k = 0; HAS_DEAD_TIME && k < N_COMMANDS; k++) {
        one->at[k] = LANE(b->at[k], i);
    }
    return HAS_DEAD_TIME && single_waits(one);
}

/* Begin steps of length h in some of the lanes whose steps have `started`. */
static void begin_steps(block *b, real h, mask begins, mask started)
{
    if (!ANY(started & ~begins)) {
        motion_start(&b->m, b->at, &b->numbers, h, b->heading);
        return;
    }
    motion fresh;
    motion_start(&fresh, b->at, &b->numbers, h, b->heading);
    real *const to = (real *)&b->m; /* the first members of a motion are numbers of the lanes */
    const real *const from = (const real *)&fresh;
    for (size_t k = 0; k < offsetof(motion, reverse) / sizeof(real); k++) {
        to[k] = begins ? from[k] : to[k];
    }
}

/* Assign the states at the end of the steps that end. Return true where they are finite. */
static mask end_steps(block *b, mask ends)
{
    real next[N_STATES];
    model_finish(b->m.state, &b->m.q, b->m.y, b->m.displacement, next);
    for (int k = 0; k < N_STATES; k++) {
        ends &= fabs(next[k]) <= DBL_MAX;
    }
    for (int k = 0; k < N_STATES; k++) {
        b->at[FIRST_STATE + k] = ends ? next[k] : b->at[FIRST_STATE + k];
    }
#ifdef CURRENT_PASSES
    for (int k = 0; k < N_CURRENT; k++) {
        b->at[FIRST_BEFORE + k] = ends ? b->at[FIRST_CURRENT + k] : b->at[FIRST_BEFORE + k];
    }
#endif
    b->heading = ends ? b->m.heading : b->heading;
    return ends;
}

/* Return the order at which the series of a lane ended, which is ORDER unless it may be used up to t = 1. */
static int order_in_lane(const series *s, int i, bool whole)
{
    int order = s->order;
    while (whole && order > 5) {
        for (int k = 0; k < N_SERIES; k++) {
            if (LANE(s->c[order][k], i) != 0.0 || LANE(s->c[order - 1][k], i) != 0.0) {
                return order;
            }
        }
        order -= 2;
    }
    return order;
}

/* Take a piece in all lanes whose steps have `started`. Return true for those whose steps end with it. *left becomes true for those
 * whose steps must be taken singly. */
static mask take_piece(block *b, mask started, mask *left)
{
    motion *const m = &b->m;
    real change[N_SERIES];
    double c[(ORDER + 1) * N_SERIES];
    int reversed[LANES];
    series s;
    motion_measure(m);
    motion_begin(m, motion_unit(m), &s);
    mask under_way = started & ~motion_waits(m, &s);
    mask whole = motion_grow_short(m, &s, ~under_way);
    real reach = 1.0;
    if (!ALL(whole | ~under_way)) {
        whole = motion_grow_long(m, &s, whole, ~under_way);
        reach = whole ? 1.0 : series_reach(&s, m->scale);
    }
    real length = reach;
    const mask keeps = series_keeps_directions(&s, (1.0 + 1e-14) * reach); /* the powers of a reach below 1 are rounded */
    for (int i = 0; i < LANES; i++) {
        reversed[i] = NONE;
        LANE(under_way, i) &= LANE(reach, i) > 0.0 && b->lanes[i].pieces < MOST_TOGETHER ? YES : NO;
        if (LANE(under_way, i) & ~LANE(keeps, i)) {
            for (int k = 0; k < (s.order + 1) * N_SERIES; k++) {
                c[k] = LANE(s.c[0][k], i);
            }
            LANE(length, i) = single_cut(c, order_in_lane(&s, i, LANE(whole, i)), LANE(reach, i), &reversed[i]);
        }
    }
    const mask ends = under_way & motion_pass(m, b->at, &s, under_way ? length : 0.0, reach, change);
    for (int i = 0; i < LANES; i++) {
        if (reversed[i] != NONE) { /* exactly at rest, so that the next piece has the other direction */
            LANE(m->y[reversed[i]], i) = LANE(m->lost[reversed[i]], i) = 0.0;
        }
    }
    const mask done = end_steps(b, ends);
    *left |= (started & ~under_way) | (ends & ~done);
    return done;
}

/* Return 0 when there is not enough memory. */
int simulate_in_lanes(SIMULATION, void *going)
{
    const bool calculates = is_calculated(recorded, records);
    ptrdiff_t waiting = first;
    int busy;
    block b;
    void *const memory = going ? NULL : calloc(LANES, single_size());
    if (!going && !memory) {
        return 0;
    }
    memset(&b, 0, sizeof b);
    for (int i = 0; i < LANES; i++) {
        b.lanes[i].vehicle = -1;
        b.lanes[i].single = going ? NULL : single_of(memory, i);
    }
    do {
        mask started = NO, begins = NO, left = NO, ends = NO;
        real h = 0.0;
        const ptrdiff_t before = waiting;
        busy = 0;
        for (int i = 0; i < LANES; i++) {
            lane *const own = &b.lanes[i];
            while (own->vehicle < 0 && waiting < last) {
                failed[waiting] = enter_lane(&b, i, given, waiting, going) ? times : 0;
                waiting++;
            }
            busy += own->vehicle >= 0;
            if (own->vehicle >= 0 && own->pieces == 0) {
                set_inputs(&b, i, given, ended && own->n > 0 ? own->n - 1 : own->n, going);
            }
        }
        if (waiting > before) {
            model_prepare(b.at, &b.numbers);
        }
        if (calculates) {
            model_calculate(b.at, &b.numbers, b.heading);
        }
        for (int i = 0; i < LANES; i++) { /* before a piece, which so does not wait for the memory of the results */
            lane *const own = &b.lanes[i];
            if (own->vehicle >= 0 && own->pieces == 0) {
                double *to = result + own->vehicle * times + own->n;
                for (ptrdiff_t k = 0; k < records; k++) {
                    to[k * vehicles * times] = LANE(b.at[recorded[k]], i);
                }
                if (own->n + 1 == times) {
                    (void)follow_lane(&b, i);
                    own->vehicle = -1;
                    continue;
                }
                if (ended) {
                    set_inputs(&b, i, given, own->n, going);
                }
                LANE(h, i) = length[own->n];
                LANE(left, i) = waits_in_lane(&b, i) ? YES : NO;
                LANE(begins, i) = ~LANE(left, i);
            }
            LANE(started, i) = own->vehicle >= 0 && own->pieces > 0 ? YES : LANE(begins, i);
        }
        if (ANY(begins)) {
            begin_steps(&b, h, begins, started);
        }
        if (ANY(started)) {
            ends = take_piece(&b, started, &left);
        }
        for (int i = 0; i < LANES; i++) {
            lane *const own = &b.lanes[i];
            if (own->vehicle < 0) {
                continue;
            }
            own->pieces++;
            if (LANE(left, i) && !step_single(&b, i, time[own->n], length[own->n])) {
                failed[own->vehicle] = own->n + 1;
                own->vehicle = -1;
            }
            if (LANE(left, i) | LANE(ends, i)) {
                own->n++;
                own->pieces = 0;
            }
        }
    } while (busy > 0 && *stop == 0);
    free(memory);
    return 1;
}
