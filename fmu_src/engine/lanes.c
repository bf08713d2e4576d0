/* Simulation for Python of many vehicles at once, one in each lane of a vector (real.h). A step that is one short piece is taken
 * for all lanes together. All other steps are taken alone by engine.c: where a velocity reverses, a long step has several
 * pieces, commands wait for the dead time, or a number is not finite. So a vehicle has no influence on its neighbours. When a
 * vehicle ends, the next one takes its lane. */
#if defined __AVX512F__
#define LANES 8
#elif defined __AVX__
#define LANES 4
#else
#define LANES 2
#endif

#include <stdlib.h>

#include "engine.h"

#include "series.c"

#include "step.c"

enum { LONGEST_PAUSE = 31 }; /* steps */

typedef struct {
    ptrdiff_t vehicle;  /* or -1 */
    ptrdiff_t n;        /* the index of the present time */
    lone *alone;        /* for steps that are taken alone; it has the coefficients and the commands that wait */
    int pause, longest; /* the steps that will be taken alone, because a step was not plain; twice as many after the next one */
} lane;

typedef struct {
    real at[N_VARIABLES], heading;
    model_numbers numbers;
    lane lanes[LANES];
} block;

/* Let a vehicle begin in a lane. */
static void begin_in_lane(block *b, int i, const table given[N_VARIABLES], ptrdiff_t vehicle)
{
    lane *const own = &b->lanes[i];
    own->vehicle = vehicle;
    own->n = 0;
    own->pause = own->longest = 0;
    lone_begin(own->alone, given, vehicle);
    for (int k = 0; k < N_VARIABLES; k++) {
        LANE(b->at[k], i) = own->alone->at[k];
    }
    LANE(b->heading, i) = own->alone->heading;
}

/* Step the vehicle of a lane alone. Return false when its motion cannot be computed. */
static bool step_alone(block *b, int i, double t, double h)
{
    lone *const alone = b->lanes[i].alone;
    for (int k = 0; k < FIRST_CALCULATED; k++) {
        alone->at[k] = LANE(b->at[k], i);
    }
    alone->heading = LANE(b->heading, i);
    if (!lone_step(alone, t, h)) {
        return false;
    }
    for (int k = FIRST_STATE; k < FIRST_COEFFICIENT; k++) {
        LANE(b->at[k], i) = alone->at[k];
    }
    LANE(b->heading, i) = alone->heading;
    return true;
}

/* Return true when the next step of a lane must be taken alone. */
static bool is_alone(block *b, int i)
{
    lane *const own = &b->lanes[i];
    for (int k = 0; HAS_DEAD_TIME && k < N_COMMANDS; k++) {
        own->alone->at[k] = LANE(b->at[k], i);
    }
    return own->pause > 0 || lone_waits(own->alone);
}

/* Take one step of length h in all lanes that have a vehicle and are not `alone`. Return true for those in which it was taken. */
static mask step_together(block *b, real h, mask alone)
{
    real next[N_STATES], heading = b->heading;
    if (ALL(alone)) {
        return NO;
    }
    const mask done = motion_plain(b->at, &b->numbers, h, alone, next, &heading);
    for (int k = 0; k < N_STATES; k++) {
        b->at[FIRST_STATE + k] = done ? next[k] : b->at[FIRST_STATE + k];
    }
    b->heading = done ? heading : b->heading;
    return done;
}

/* Return 0 when there is not enough memory. */
int simulate_in_lanes(SIMULATION)
{
    const bool calculates = is_calculated(recorded, records);
    ptrdiff_t waiting = first;
    int memory = 1, busy = 1;
    block b;
    memset(&b, 0, sizeof b);
    for (int i = 0; i < LANES; i++) {
        b.lanes[i].vehicle = -1;
        b.lanes[i].alone = lone_new();
        memory &= b.lanes[i].alone != NULL;
    }
    while (memory && busy > 0 && *stop == 0) {
        mask apart = YES;
        real h = 1.0;
        bool begins = false;
        busy = 0;
        for (int i = 0; i < LANES; i++) {
            lane *const own = &b.lanes[i];
            if (own->vehicle < 0 && waiting < last) {
                failed[waiting] = times;
                begin_in_lane(&b, i, given, waiting++);
                begins = true;
            }
            for (int k = 0; k < N_INPUTS && own->vehicle >= 0; k++) {
                if (given[k].per_time != 0) {
                    LANE(b.at[k], i) = number(&given[k], own->vehicle, own->n);
                }
            }
        }
        if (begins) {
            model_prepare(b.at, &b.numbers);
        }
        if (calculates) {
            model_calculate(b.at, &b.numbers, b.heading);
        }
        for (int i = 0; i < LANES; i++) {
            lane *const own = &b.lanes[i];
            if (own->vehicle < 0) {
                continue;
            }
            double *to = result + own->vehicle * times + own->n;
            for (ptrdiff_t k = 0; k < records; k++) {
                to[k * vehicles * times] = LANE(b.at[recorded[k]], i);
            }
            busy++;
            if (own->n + 1 == times) {
                own->vehicle = -1;
            } else {
                LANE(h, i) = time[own->n + 1] - time[own->n];
                apart[i] = is_alone(&b, i) ? YES : NO;
            }
        }
        const mask done = step_together(&b, h, apart);
        for (int i = 0; i < LANES; i++) {
            lane *const own = &b.lanes[i];
            if (own->vehicle < 0) {
                continue;
            }
            if (done[i]) {
                own->longest = 0;
            } else {
                own->longest = apart[i] ? own->longest : 2 * own->longest + 1 < LONGEST_PAUSE ? 2 * own->longest + 1 : LONGEST_PAUSE;
                own->pause = apart[i] ? own->pause - (own->pause > 0) : own->longest - 1;
                if (!step_alone(&b, i, time[own->n], LANE(h, i))) {
                    failed[own->vehicle] = own->n + 1;
                    own->vehicle = -1;
                }
            }
            own->n++;
        }
    }
    for (int i = 0; i < LANES; i++) {
        free(b.lanes[i].alone);
    }
    return memory;
}
