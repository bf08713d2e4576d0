/* The step. It consists of pieces. Each piece is a Taylor series (series.c) that ends at the first reversal of a velocity.
 *
 * Names in all files of the motion: at are the variables of the vehicle, n the numbers that follow from the parameters, q the
 * numbers that are held during a piece, y the states of the table, m the motion, s the series. */

#ifndef MOST_PIECES
#define MOST_PIECES 1000000 /* of a step. A vehicle that swings without linear drag never settles, and each swing takes a few pieces. */
#endif

typedef struct {
    const model_numbers *n;
    model_held q;
    double y[N_SERIES];            /* the states at the start of a piece */
    double lost[N_SERIES];         /* the rounding error of each state, to be added to its next change */
    double displacement[N_SERIES]; /* the changes so far of the integrals, which are the states from N_USED on */
    double scale[N_SERIES];        /* for each group, the largest of its size and its earlier sizes, / 4 for each piece since */
    double largest[N_SERIES];      /* the largest size of each group so far */
    double covered[N_USED];        /* roughly, the integral of the size of each state over time */
    uint64_t settled;              /* one bit for each component; it is set once the component has settled */
    int reverse[N_MONITORED];      /* 1 for each velocity whose coefficients are those of the negative direction */
} motion;

/* Return true when all n numbers are finite. */
static inline bool all_finite(const double x[], int n)
{
    bool finite = true;
    for (int i = 0; i < n; i++) {
        finite &= isfinite(x[i]) != 0;
    }
    return finite;
}

/* Return the sum of the sizes of the states in a group. */
static inline double group_size(const double x[N_SERIES], int group)
{
    double size = 0.0;
    for (int i = 0; i < N_SERIES; i++) {
        size += GROUP[i] == group ? fabs(x[i]) : 0.0;
    }
    return size;
}

/* Return true when a velocity that is 0, and whose acceleration is 0, may still begin to move. This happens when all states in
 * one of its terms begin to move. */
static bool motion_may_begin(const motion *m, const series *s)
{
    double moves[N_SERIES], size[N_SERIES];
    bool found = false, again = true;
    for (int i = 0; i < N_SERIES; i++) {
        moves[i] = s->c[0][i] != 0.0 || s->c[1][i] != 0.0 ? 1.0 : 0.0;
    }
    while (again) {
        again = false;
        model_sizes(m->n, &m->q, moves, size);
        for (int i = 0; i < N_SERIES; i++) {
            if (moves[i] == 0.0 && size[i] != 0.0) {
                moves[i] = 1.0;
                again = true;
                found |= i < N_MONITORED;
            }
        }
    }
    return found;
}

/* Compute the coefficients one by one, and choose the direction of each velocity when it begins to move. */
static void motion_grow_slowly(motion *m, series *s)
{
    for (int n = 1; n < ORDER; n++) {
        bool turned = false;
        s->order = n - 1;
        for (int i = 0; i < N_MONITORED; i++) {
            const int reverse = s->c[series_first(s, i)][i] < 0.0; /* this is coefficient n when all before it are 0 */
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

/* Begin a series at the current states: compute its first two coefficients, the directions, and which components move. */
INLINE void motion_begin(motion *m, double unit, series *s)
{
    double rate[N_SERIES];
    bool turned = false;
    s->unit = unit;
    s->moving = s->blocks = 0;
    for (int i = 0; i < N_MONITORED; i++) {
        m->reverse[i] = m->y[i] < 0.0;
    }
    model_direct(m->n, m->reverse, &m->q);
    model_rates(m->n, &m->q, m->y, rate);
    for (int i = 0; i < N_SERIES; i++) {
        const uint64_t bit = UINT64_C(1) << COMPONENT_OF[i];
        s->c[0][i] = m->y[i];
        s->c[1][i] = m->settled & bit ? 0.0 : unit * rate[i];
        s->moving |= s->c[1][i] != 0.0 ? bit : 0U;
    }
    for (int k = 0; k < N_COMPONENTS; k++) {
        s->moving |= COMPONENT_INPUTS[k] & s->moving ? UINT64_C(1) << k : 0U;
    }
    if (N_DYNAMIC < N_COMPONENTS) { /* a component without an effect need not be computed */
        uint64_t still = 0U; /* one bit for each velocity that stays 0 */
        for (int i = 0; i < N_MONITORED; i++) {
            still |= m->y[i] == 0.0 && !(s->moving >> COMPONENT_OF[i] & 1U) ? UINT64_C(1) << i : 0U;
        }
        for (int k = N_DYNAMIC; k < N_COMPONENTS; k++) {
            s->moving &= NEEDED_WITH[k] & ~still ? ~UINT64_C(0) : ~(UINT64_C(1) << k);
        }
    }
    for (int i = 0; i < N_SERIES; i++) {
        const bool moves = s->moving >> COMPONENT_OF[i] & 1U;
        s->c[1][i] = moves ? s->c[1][i] : 0.0;
        s->pace[i] = moves ? unit : 0.0;
        s->blocks |= moves ? 1U << BLOCK_OF[i] : 0U;
        s->size[i] = m->scale[GROUP[i]] + group_size(s->c[1], GROUP[i]);
    }
    for (int i = 0; i < N_MONITORED; i++) {
        const bool back = m->y[i] == 0.0 && s->c[1][i] < 0.0;
        m->reverse[i] |= back;
        turned |= back;
    }
    if (turned) {
        model_direct(m->n, m->reverse, &m->q);
    }
}

/* Compute coefficients up to a low order. Return true when the series may be used up to t = 1. */
INLINE bool motion_grow_short(motion *m, series *s)
{
    bool waits = false;
    for (int i = 0; i < N_MONITORED; i++) {
        waits |= s->c[0][i] == 0.0 && s->c[1][i] == 0.0 && s->moving >> COMPONENT_OF[i] & 1U;
    }
    if (waits && motion_may_begin(m, s)) {
        motion_grow_slowly(m, s);
        return series_converges(s);
    }
    series_terms(m->n, &m->q, s, 1); /* the orders are constants so that the compiler unrolls the loops */
    series_terms(m->n, &m->q, s, 2);
    series_terms(m->n, &m->q, s, 3);
    series_terms(m->n, &m->q, s, 4);
    s->order = 5;
    if (series_converges(s)) {
        return true;
    }
    series_terms(m->n, &m->q, s, 5);
    series_terms(m->n, &m->q, s, 6);
    s->order = 7;
    if (series_converges(s)) {
        return true;
    }
    series_terms(m->n, &m->q, s, 7);
    series_terms(m->n, &m->q, s, 8);
    s->order = 9;
    return series_converges(s);
}

/* Compute coefficients until the series may be used up to t = 1, or up to ORDER. Return the largest usable t, at most 1; 0 when
 * the series overflows. */
static double motion_grow_long(const motion *m, series *s)
{
    while (s->order < ORDER) {
        series_terms(m->n, &m->q, s, s->order);
        series_terms(m->n, &m->q, s, s->order + 1);
        s->order += 2;
        if (series_converges(s)) {
            return 1.0;
        }
    }
    return series_reach(s, m->scale);
}

/* Add a change to a state, together with its earlier rounding error (compensated summation). */
static inline void motion_add(double *to, double change, double *lost)
{
    const double whole = change + *lost, sum = *to + whole;
    *lost = whole - (sum - *to);
    *to = sum;
}

/* Move the states to the end of a piece, t = length. */
INLINE void motion_move(motion *m, const series *s, double length, double change[N_SERIES])
{
    memset(change, 0, sizeof(double[N_SERIES]));
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

/* Put a component to rest when nothing drives it and its states are so small that, in the remaining `rest` seconds, they would
 * change neither each other nor their integrals. Return true when that was done. */
static bool motion_fades(motion *m, int component, double rest)
{
    double y[N_SERIES], lost[N_SERIES], rate[N_SERIES];
    for (int i = 0; i < N_SERIES; i++) {
        const bool own = COMPONENT_OF[i] == component;
        if (own && fmax(fabs(m->y[i]) / m->largest[GROUP[i]], fabs(m->y[i]) * rest / m->covered[i]) > 0.0625 * DBL_EPSILON) {
            return false;
        }
        y[i] = own ? 0.0 : m->y[i];
        lost[i] = own ? 0.0 : m->lost[i];
    }
    model_rates(m->n, &m->q, y, rate);
    for (int i = 0; i < N_SERIES; i++) {
        if (COMPONENT_OF[i] == component && rate[i] != 0.0) {
            return false;
        }
    }
    memcpy(m->y, y, sizeof y);
    memcpy(m->lost, lost, sizeof lost);
    return true;
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
    for (int k = 0; k < N_DYNAMIC; k++) {
        if ((COMPONENT_INPUTS[k] & ~m->settled) != 0) {
            continue;
        }
        bool still = true;
        for (int i = 0; i < N_SERIES; i++) {
            still &= COMPONENT_OF[i] != k || fabs(rate[i]) <= 8.0 * DBL_EPSILON * size[i] + DBL_MIN;
        }
        m->settled |= still || motion_fades(m, k, rest) ? UINT64_C(1) << k : 0U;
    }
}

/* Return true when a dynamic component that moves has changed so little in a piece that it may have settled. */
static bool motion_is_slow(const motion *m, const series *s, const double change[N_SERIES])
{
    bool moves[N_COMPONENTS] = {false};
    for (int i = 0; i < N_SERIES; i++) {
        moves[COMPONENT_OF[i]] |= fabs(change[i]) > 0.001 * m->largest[GROUP[i]];
    }
    for (int k = 0; k < N_DYNAMIC; k++) {
        if (s->moving >> k & 1U && !moves[k]) {
            return true;
        }
    }
    return false;
}

#include "coast.c"

/* Finish the step with straight or circular motion when all dynamic components have settled. Return true when that was done. */
static bool motion_coasts(motion *m, double rest, double state[N_STATES], double *heading)
{
    if (m->settled != (UINT64_C(1) << N_DYNAMIC) - 1U) {
        return false;
    }
    motion_coast(m, rest, state, heading);
    return true;
}

/* Compute the states after h > 0 seconds with the inputs held. They are finite unless a result overflows. Return the
 * number of pieces, or 0 when more than MOST_PIECES would be needed. */
static int motion_step(const double at[], const model_numbers *n, double h, double next[N_STATES], double *heading)
{
    double state[N_STATES]; /* those at the start, except for the quaternion, which is followed */
    double done = 0.0, lost = 0.0; /* the length of all pieces so far, and its rounding error */
    double rest = h;               /* the time that remains */
    double unit = h;               /* the longest unit of time for the next series */
    double change[N_SERIES];
    int pieces = 0;
    motion m;
    series s;
    memset(&m, 0, sizeof m);
    m.n = n;
    memcpy(state, at + FIRST_STATE, sizeof state);
    model_start(at, n, &m.q, m.y, m.scale);
    while (++pieces <= MOST_PIECES && unit > 0.0) {
        for (int i = 0; i < N_USED; i++) {
            if (GROUP[i] == i) {
                const double size = group_size(m.y, i);
                m.scale[i] = fmax(m.scale[i], size);
                m.largest[i] = fmax(m.largest[i], size);
            }
        }
        motion_begin(&m, fmin(rest, unit), &s);
        double reach = 1.0;
        if (!motion_grow_short(&m, &s)) {
            if (pieces == 1) { /* the step is long, and some states may have settled before it */
                motion_settle(&m, rest);
                if (motion_coasts(&m, rest, state, heading)) {
                    break;
                }
                if (m.settled != 0U) {
                    motion_begin(&m, s.unit, &s);
                    (void)motion_grow_short(&m, &s); /* in either case, motion_grow_long continues the series */
                }
            }
            reach = motion_grow_long(&m, &s);
        }
        if (reach == 0.0) {
            unit = 1e-3 * s.unit;
            continue;
        }
        double length = reach;
        int reversed = NONE;
        if (reach < 1.0 || !series_keeps_directions(&s)) {
            reversed = series_cut(&s, &length);
        }
#if HAS_ATTITUDE
        attitude_after_piece(&s, length, state, heading);
#endif
        if (length == 1.0) { /* with a constant, the compiler leaves out the multiplications */
            motion_move(&m, &s, 1.0, change);
        } else {
            motion_move(&m, &s, length, change);
        }
        if (reversed != NONE) { /* exactly at rest, so that the next piece has the other direction */
            m.y[reversed] = m.lost[reversed] = 0.0;
        }
        for (int i = 0; i < N_USED; i++) {
            m.scale[i] *= 0.25;
        }
#if HAS_LAG
        model_arrive(at, n, &m.q, m.y, m.scale);
#endif
        if (length * s.unit >= rest) {
            break;
        }
        motion_add(&done, length * s.unit, &lost);
        rest = h - done - lost;
        unit = 2.0 * s.unit * reach;
        if (motion_is_slow(&m, &s, change)) {
            motion_settle(&m, rest);
        }
        if (motion_coasts(&m, rest, state, heading)) {
            break;
        }
    }
    if (!(unit > 0.0)) { /* even the shortest piece overflows */
        for (int i = 0; i < N_STATES; i++) {
            next[i] = INFINITY;
        }
        return pieces;
    }
    model_finish(state, &m.q, m.y, m.displacement, next);
    return pieces <= MOST_PIECES ? pieces : 0;
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

static inline void delay_commit(const double at[], const delay_line *line, double t, double h)
{
    (void)at, (void)line, (void)t, (void)h;
}
#endif
