/* The step. It consists of pieces. Each piece is a Taylor series (series.c) that ends at the first reversal of a velocity.
 *
 * In all files of the motion, these letters have one meaning (real.h has the type real, a double or a vector of doubles):
 *
 *     letter  type              what it is                                               who writes it
 *     at      real[]            the variables of the vehicle, at REF_... of model.h      instance.c or engine.c; model_calculate
 *     n       model_numbers     what follows from the parameters alone                   model_prepare
 *     q       model_held        what is held during a piece: thrust, constant terms      model_start, model_direct, model_arrive
 *     y       real[N_SERIES]    the states of the table of terms at the start of a piece  model_start, motion_move
 *     m       motion            how far a step has come: y, q, and their rounding errors  motion_start, motion_pass
 *     s       series            the series of a piece: s->c[k] are the coefficients of t^k  motion_begin, series_terms
 *     h       real or double    the length of a step, s                                  the caller
 */

#ifndef MOST_PIECES
#define MOST_PIECES 100000 /* of a step. A vehicle that swings without linear drag never settles, and each swing takes a few pieces. */
#endif
/* Of these, a step may take so many at once, and the others as time passes: evenly over the step, or over a second. With absurd
 * loads and velocities, time hardly passes, and the step is refused soon. */
#define MOST_AT_ONCE 1000
#define MOST_USUAL 64 /* a step of more pieces looks for velocities whose reversals do not matter */

#if defined HAS_EARTH_LOADS && LANES == 1
#define STRUCTURE_OF(m) ((m)->loaded ? &STRUCTURE : &FREE_STRUCTURE)
#else
#define STRUCTURE_OF(m) (&STRUCTURE)
#endif

typedef struct {
    model_held q;
    real y[N_SERIES];              /* the states at the start of a piece */
    real lost[N_SERIES];           /* the rounding error of each state, to be added to its next change */
    real displacement[N_SERIES];   /* the changes so far of the integrals, which are the states from N_USED on */
    real scale[N_SERIES];          /* for each group, the largest of its size and its earlier sizes, / 4 for each piece since */
    real largest[N_SERIES];        /* the largest size of each group so far */
    real covered[N_USED];          /* roughly, the integral of the size of each state over time */
    real state[N_STATES], heading; /* those at the start of the step, except for the attitude, which is followed */
    real length;                   /* of the step, s */
    real done, done_lost;          /* the length of all pieces so far, and its rounding error */
    real rest;                     /* the time that remains */
    real unit;                     /* the longest unit of time for the next series */
    mask reverse[N_MONITORED];     /* 1 for each velocity whose coefficients are those of the negative direction */
    const model_numbers *n;
#if defined HAS_EARTH_LOADS && LANES == 1
    bool loaded;                   /* true when a load in the earth frame acts, so that all depends on the attitude */
#endif
    uint64_t settled;              /* one bit for each component; it is set once the component has settled */
} motion;

/* Take the sizes of the states at the start of a piece into account. */
INLINE void motion_measure(motion *m)
{
    real size[N_SERIES];
    model_group_sizes(m->y, size);
    for (int i = 0; i < N_USED; i++) {
        if (GROUP[i] == i) {
            m->scale[i] = fmax(m->scale[i], size[i]);
            m->largest[i] = fmax(m->largest[i], size[i]);
        }
    }
}

/* Return true when a velocity that is 0, and whose acceleration is 0, may still begin to move. This happens when all states in
 * one of its terms begin to move. */
static mask motion_may_begin(const motion *m, const series *s)
{
    real moves[N_SERIES], size[N_SERIES];
    mask found = NO, again = YES;
    for (int i = 0; i < N_SERIES; i++) {
        moves[i] = s->c[0][i] != 0.0 || s->c[1][i] != 0.0 ? 1.0 : 0.0;
    }
    while (ANY(again)) {
        again = NO;
        model_sizes(m->n, &m->q, moves, size);
        for (int i = 0; i < N_SERIES; i++) {
            const mask begins = moves[i] == 0.0 && size[i] != 0.0;
            moves[i] = begins ? 1.0 : moves[i];
            again |= begins;
            if (i < N_MONITORED) {
                found |= begins;
            }
        }
    }
    return found;
}

/* Return true when the directions have to be chosen while the series grows. */
INLINE mask motion_waits(const motion *m, const series *s)
{
    mask waits = NO;
    for (int i = 0; i < N_MONITORED; i++) {
        if (s->moving >> STRUCTURE_OF(m)->component_of[i] & 1U) {
            waits |= s->c[0][i] == 0.0 && s->c[1][i] == 0.0;
        }
    }
    return ANY(waits) ? waits && motion_may_begin(m, s) : waits;
}

#if LANES == 1
/* Find the components that move, and set the first coefficients of the others to 0. */
INLINE void motion_find_moving(const motion *m, series *s)
{
    const int *const component_of = STRUCTURE_OF(m)->component_of;
    const int components = STRUCTURE_OF(m)->components, dynamic = STRUCTURE_OF(m)->dynamic;
    s->moving = s->blocks = 0;
    for (int i = 0; i < N_SERIES; i++) {
        const uint64_t bit = UINT64_C(1) << component_of[i];
        s->c[1][i] = m->settled & bit ? 0.0 : s->c[1][i];
        s->moving |= s->c[1][i] != 0.0 ? bit : 0U;
    }
    for (int k = 0; k < components; k++) {
        s->moving |= STRUCTURE_OF(m)->inputs[k] & s->moving ? UINT64_C(1) << k : 0U;
    }
    if (dynamic < components) { /* a component without an effect need not be computed */
        uint64_t still = 0U; /* one bit for each velocity that stays 0 */
        for (int i = 0; i < N_MONITORED; i++) {
            still |= m->y[i] == 0.0 && !(s->moving >> component_of[i] & 1U) ? UINT64_C(1) << i : 0U;
        }
        for (int k = dynamic; k < components; k++) {
            s->moving &= STRUCTURE_OF(m)->needed_with[k] & ~still ? ~UINT64_C(0) : ~(UINT64_C(1) << k);
        }
    }
    for (int i = 0; i < N_SERIES; i++) {
        const bool moves = s->moving >> component_of[i] & 1U;
        s->c[1][i] = moves ? s->c[1][i] : 0.0;
        s->pace[i] = moves ? s->unit : 0.0;
        s->blocks |= moves ? 1U << BLOCK_OF[i] : 0U;
    }
}
#else
/* Let all components move: what is 0 stays 0. */
INLINE void motion_find_moving(const motion *m, series *s)
{
    (void)m;
    s->moving = ~UINT64_C(0);
    s->blocks = ~0U;
    for (int i = 0; i < N_SERIES; i++) {
        s->pace[i] = s->unit;
    }
}
#endif

/* Begin a series at the current states: compute its first two coefficients, the directions, and which components move. */
INLINE void motion_begin(motion *m, real unit, series *s)
{
    real rate[N_SERIES], size[N_SERIES];
    mask turned = NO;
    s->unit = unit;
    for (int i = 0; i < N_MONITORED; i++) {
        m->reverse[i] = m->y[i] < 0.0;
    }
    model_direct(m->n, m->reverse, &m->q);
    model_rates(m->n, &m->q, m->y, rate);
    for (int i = 0; i < N_SERIES; i++) {
        s->c[0][i] = m->y[i];
        s->c[1][i] = unit * rate[i];
    }
    motion_find_moving(m, s);
    model_group_sizes(s->c[1], size);
    for (int i = 0; i < N_SERIES; i++) {
        s->size[i] = m->scale[GROUP[i]] + size[GROUP[i]];
    }
    for (int i = 0; i < N_MONITORED; i++) {
        const mask back = m->y[i] == 0.0 && s->c[1][i] < 0.0;
        m->reverse[i] |= back;
        turned |= back;
    }
    if (ANY(turned)) {
        model_direct(m->n, m->reverse, &m->q);
    }
}

/* Let the last two coefficients be 0 where the series converged before. So a vehicle does not depend on those in other
 * lanes, which may need a higher order. A single vehicle ends its series there. */
INLINE void series_keep(series *s, mask converged)
{
    for (int n = s->order - 1; LANES > 1 && n <= s->order; n++) {
        for (int i = 0; i < N_SERIES; i++) {
            s->c[n][i] = converged ? 0.0 : s->c[n][i];
        }
    }
}

/* Compute coefficients up to a low order. Return true when the series may be used up to t = 1. It ends when this holds for
 * all vehicles that are not `left_out`. */
INLINE mask motion_grow_short(const motion *m, series *s, mask left_out)
{
    series_terms(m->n, &m->q, s, 1); /* the orders are constants so that the compiler unrolls the loops */
    series_terms(m->n, &m->q, s, 2);
    series_terms(m->n, &m->q, s, 3);
    series_terms(m->n, &m->q, s, 4);
    s->order = 5;
    mask done = series_converges(s);
    if (ALL(done | left_out)) {
        return done;
    }
    series_terms(m->n, &m->q, s, 5);
    series_terms(m->n, &m->q, s, 6);
    s->order = 7;
    series_keep(s, done);
    done = series_converges(s);
    if (ALL(done | left_out)) {
        return done;
    }
    series_terms(m->n, &m->q, s, 7);
    series_terms(m->n, &m->q, s, 8);
    s->order = 9;
    series_keep(s, done);
    return series_converges(s);
}

/* Compute coefficients until the series may be used up to t = 1, or up to ORDER. Return true when it may. It may
 * already be used where it is `done`. */
INLINE mask motion_grow_long(const motion *m, series *s, mask done, mask left_out)
{
    while (s->order < ORDER) {
        series_terms(m->n, &m->q, s, s->order);
        series_terms(m->n, &m->q, s, s->order + 1);
        s->order += 2;
        series_keep(s, done);
        done = series_converges(s);
        if (ALL(done | left_out)) {
            break;
        }
    }
    return done;
}

/* Add a change to a state, together with its earlier rounding error (compensated summation). */
static inline void motion_add(real *to, real change, real *lost)
{
    const real whole = change + *lost, sum = *to + whole;
    *lost = whole - (sum - *to);
    *to = sum;
}

/* Move the states to the end of a piece, t = length. */
INLINE void motion_move(motion *m, const series *s, real length, real change[N_SERIES])
{
    memset(change, 0, sizeof(real[N_SERIES]));
    for (int n = s->order; n > 0; n--) {
        for (int i = 0; i < N_SERIES; i++) {
            change[i] = (change[i] + s->c[n][i]) * length;
        }
    }
    for (int i = 0; i < N_USED; i++) {
        m->covered[i] += fabs(m->y[i]) * length * s->unit;
        motion_add(&m->y[i], change[i], &m->lost[i]);
    }
    for (int i = N_USED; i < N_SERIES; i++) {
        motion_add(&m->displacement[i], change[i], &m->lost[i]);
    }
}

/* Return the longest unit of time for the next series. It ends with the step, and where a rotor reverses. */
INLINE real motion_unit(const motion *m)
{
#if HAS_ROTORS
    return fmin(fmin(m->rest, m->unit), model_until_reversal(m->n, &m->q));
#else
    return fmin(m->rest, m->unit);
#endif
}

/* Begin a step of h > 0 seconds, over which the inputs are held. */
INLINE void motion_start(motion *m, const real at[], const model_numbers *n, real h, real heading)
{
    memset(m, 0, sizeof *m);
    m->n = n;
    m->length = m->rest = m->unit = h;
    m->heading = heading;
#if defined HAS_EARTH_LOADS && LANES == 1
    m->loaded = model_is_loaded(at);
#endif
    memcpy(m->state, at + FIRST_STATE, sizeof m->state);
    model_start(at, n, &m->q, m->y, m->scale);
}

/* Move to the end of a piece, t = length. The series may be used up to t = reach. Return true at the end of the step. */
INLINE mask motion_pass(motion *m, const real at[], const series *s, real length, real reach, real change[N_SERIES])
{
    (void)at;
    if (ALL(length == 1.0)) { /* with a constant, the compiler leaves out the multiplications */
        motion_move(m, s, 1.0, change);
    } else {
        motion_move(m, s, length, change);
    }
#if HAS_ATTITUDE
    attitude_after_piece(s, length, change, m->state, &m->heading);
#endif
    for (int i = 0; i < N_USED; i++) {
        m->scale[i] *= 0.25;
    }
#if HAS_LAG
    model_arrive(at, m->n, &m->q, m->y, m->scale);
#endif
    const mask ends = length * s->unit >= m->rest;
    if (!ALL(ends)) {
        motion_add(&m->done, length * s->unit, &m->done_lost);
        m->rest = m->length - m->done - m->done_lost;
#if HAS_ROTORS /* a piece that a rotor made short says nothing about the next one */
        m->unit = reach == 1.0 ? fmax(m->unit, 2.0 * s->unit) : 2.0 * s->unit * reach;
#else
        m->unit = 2.0 * s->unit * reach;
#endif
    }
    return ends;
}

#if LANES == 1
/* Return true when all n numbers are finite. */
static inline bool all_finite(const double x[], int n)
{
    bool finite = true;
    for (int i = 0; i < n; i++) {
        finite &= isfinite(x[i]) != 0;
    }
    return finite;
}

/* Compute the coefficients one by one, and choose the direction of each velocity when it begins to move. */
static void motion_grow_slowly(motion *m, series *s)
{
    for (int n = 1; n < ORDER; n++) {
        bool turned = false;
        s->order = n - 1;
        for (int i = 0; i < N_MONITORED; i++) {
            const mask reverse = s->c[series_first(s, i)][i] < 0.0; /* this is coefficient n when all before it are 0 */
            turned |= reverse != m->reverse[i];
            m->reverse[i] = reverse;
        }
        if (turned) {
            model_direct(m->n, m->reverse, &m->q);
        }
        series_terms(m->n, &m->q, s, n);
    }
    s->order = ORDER;
}

/* Compute coefficients up to a low order, or all of them where the directions depend on them. Return true when the series may be
 * used up to t = 1. */
INLINE bool motion_grow(motion *m, series *s)
{
    if (motion_waits(m, s)) {
        motion_grow_slowly(m, s);
        return series_converges(s);
    }
    return motion_grow_short(m, s, NO);
}

/* Compute the coefficients that are left. Return the largest usable t, at most 1; 0 when the series overflows. */
static double motion_reach(const motion *m, series *s)
{
    return motion_grow_long(m, s, NO, NO) ? 1.0 : series_reach(s, m->scale);
}

/* Put a component to rest when nothing drives it and its states are so small that, in the remaining `rest` seconds, they would
 * change neither each other nor their integrals. Return true when that was done. */
static bool motion_fades(motion *m, int component, double rest)
{
    double y[N_SERIES], lost[N_SERIES], rate[N_SERIES];
    for (int i = 0; i < N_SERIES; i++) {
        const bool own = STRUCTURE_OF(m)->component_of[i] == component;
        if (own && fmax(fabs(m->y[i]) / m->largest[GROUP[i]], fabs(m->y[i]) * rest / m->covered[i]) > 0.0625 * DBL_EPSILON) {
            return false;
        }
        y[i] = own ? 0.0 : m->y[i];
        lost[i] = own ? 0.0 : m->lost[i];
    }
    model_rates(m->n, &m->q, y, rate);
    for (int i = 0; i < N_SERIES; i++) {
        if (STRUCTURE_OF(m)->component_of[i] == component && rate[i] != 0.0) {
            return false;
        }
    }
    memcpy(m->y, y, sizeof y);
    memcpy(m->lost, lost, sizeof lost);
    return true;
}

/* Find the velocities that are so small throughout a series that their directions do not matter: with the other one, no state
 * would change by more than a rounding error. Such velocities are themselves rounding errors of forces that balance each
 * other. Their signs change at random, and a step would never pass all these reversals. */
static void motion_find_faint(motion *m, const series *s, bool faint[N_MONITORED])
{
    double y[N_SERIES], rate[2][N_SERIES];
    for (int k = 0; k < N_MONITORED; k++) {
        const mask before = m->reverse[k];
        memcpy(y, m->y, sizeof y);
        y[k] = 0.0;
        for (int n = 0; n <= s->order; n++) {
            y[k] += fabs(s->c[n][k]);
        }
        for (int side = 0; side < 2; side++) {
            m->reverse[k] = side;
            model_direct(m->n, m->reverse, &m->q);
            model_rates(m->n, &m->q, y, rate[side]);
        }
        faint[k] = true;
        for (int i = 0; i < N_USED; i++) {
            faint[k] &= fabs(rate[1][i] - rate[0][i]) * s->unit <= 0.25 * DBL_EPSILON * s->size[i];
        }
        m->reverse[k] = before;
    }
    model_direct(m->n, m->reverse, &m->q);
}

/* Find the components that have settled. A component has settled when those that it depends on have settled, and when each of
 * its rates is a rounding error of the terms. */
static void motion_settle(motion *m, double rest)
{
    double rate[N_SERIES], size[N_SERIES];
    m->settled = 0;
    for (int i = 0; i < N_MONITORED; i++) { /* a velocity that is 0 keeps its direction, which does not matter */
        m->reverse[i] = m->y[i] != 0.0 ? m->y[i] < 0.0 : m->reverse[i];
    }
    model_direct(m->n, m->reverse, &m->q);
    model_rates(m->n, &m->q, m->y, rate);
    model_sizes(m->n, &m->q, m->y, size);
    for (int k = 0; k < STRUCTURE_OF(m)->dynamic; k++) {
        if ((STRUCTURE_OF(m)->inputs[k] & ~m->settled) != 0) {
            continue;
        }
        bool still = true;
        for (int i = 0; i < N_SERIES; i++) {
            still &= STRUCTURE_OF(m)->component_of[i] != k || fabs(rate[i]) <= 8.0 * DBL_EPSILON * size[i] + DBL_MIN;
        }
        m->settled |= still || motion_fades(m, k, rest) ? UINT64_C(1) << k : 0U;
    }
}

/* Return true when a dynamic component that moves has changed so little in a piece that it may have settled. */
static bool motion_is_slow(const motion *m, const series *s, const double change[N_SERIES])
{
    bool moves[N_SERIES] = {false}; /* by component */
    for (int i = 0; i < N_SERIES; i++) {
        moves[STRUCTURE_OF(m)->component_of[i]] |= fabs(change[i]) > 0.001 * m->largest[GROUP[i]];
    }
    for (int k = 0; k < STRUCTURE_OF(m)->dynamic; k++) {
        if (s->moving >> k & 1U && !moves[k]) {
            return true;
        }
    }
    return false;
}

#include "coast.c"

/* Finish the step with straight or circular motion when all dynamic components have settled. Return true when that was done. */
static bool motion_coasts(motion *m)
{
    if (m->settled != (UINT64_C(1) << STRUCTURE_OF(m)->dynamic) - 1U) {
        return false;
    }
    motion_coast(m, m->rest, m->state, &m->heading);
    return true;
}

/* Compute the states after h > 0 seconds with the inputs held. They are finite unless a result overflows. Return the
 * number of pieces, or 0 when too many would be needed. */
static int motion_step(const double at[], const model_numbers *n, double h, double next[N_STATES], double *heading)
{
    double change[N_SERIES];
    int pieces = 0;
    motion m;
    series s;
    motion_start(&m, at, n, h, *heading);
    const double per_second = MOST_PIECES / fmax(h, 1.0);
    while (m.unit > 0.0) {
        if (++pieces > MOST_AT_ONCE + per_second * m.done) {
            return 0;
        }
        motion_measure(&m);
        motion_begin(&m, motion_unit(&m), &s);
        double reach = 1.0;
        if (!motion_grow(&m, &s)) {
            if (pieces == 1) { /* the step is long, and some states may have settled before it */
                motion_settle(&m, m.rest);
                if (motion_coasts(&m)) {
                    break;
                }
                if (m.settled != 0U) {
                    motion_begin(&m, s.unit, &s);
                    (void)motion_grow(&m, &s); /* in either case, motion_grow_long continues the series */
                }
            }
            reach = motion_reach(&m, &s);
        }
        if (reach == 0.0) {
            m.unit = 1e-3 * s.unit;
            continue;
        }
        double length = reach;
        int reversed = NONE;
        if (reach < 1.0 || !series_keeps_directions(&s, 1.0)) {
            bool faint[N_MONITORED] = {false};
            if (pieces > MOST_USUAL) {
                motion_find_faint(&m, &s, faint);
            }
            reversed = series_cut(&s, faint, &length);
        }
        const bool ends = motion_pass(&m, at, &s, length, reach, change);
        if (reversed != NONE) { /* exactly at rest, so that the next piece has the other direction */
            m.y[reversed] = m.lost[reversed] = 0.0;
        }
        if (ends) {
            break;
        }
        if (motion_is_slow(&m, &s, change)) {
            motion_settle(&m, m.rest);
        }
        if (motion_coasts(&m)) {
            break;
        }
    }
    *heading = m.heading;
    if (!(m.unit > 0.0)) { /* even the shortest piece overflows */
        for (int i = 0; i < N_STATES; i++) {
            next[i] = INFINITY;
        }
        return pieces;
    }
    model_finish(m.state, &m.q, m.y, m.displacement, next);
    return pieces;
}

/* Keep the current of a step for the next one, if a change of the current passes the vehicle (model_start). */
static inline void current_keep(double at[])
{
#ifdef CURRENT_PASSES
    memcpy(at + FIRST_BEFORE, at + FIRST_CURRENT, N_CURRENT * sizeof at[0]);
#else
    (void)at;
#endif
}

#if HAS_DEAD_TIME
#include "delay.c"
#else
/* Without a dead time, commands act at once, and nothing waits. */
typedef struct {
    char nothing;
} delay_line;

static inline int delayed_step(const double at[], const model_numbers *n, const delay_line *line, double t, double h,
                               double next[N_STATES], double *heading)
{
    (void)line, (void)t;
    return motion_step(at, n, h, next, heading);
}

static inline void delay_commit(double at[], const delay_line *line, double t, double h)
{
    current_keep(at);
    (void)line, (void)t, (void)h;
}
#endif
#endif
