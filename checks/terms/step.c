/* The step: from piece to piece, each a Taylor series (series.c) up to the first reversal of a velocity. */

enum { MOST_PIECES = 10000 }; /* of a step */

typedef struct {
    const model_numbers *n;
    model_held q;
    double y[N_SERIES];     /* the states at the start of a piece */
    double gone[N_SERIES];  /* what the states that no term contains have changed by */
    double scale[N_SERIES]; /* the largest size of each group of states so far */
    unsigned settled;       /* components that have settled, a bit each */
    int reverse[N_MONITORED];
} motion;

static inline double group_size(const double x[N_SERIES], int group)
{
    double size = 0.0;
    for (int i = 0; i < N_SERIES; i++) {
        size += GROUP[i] == group ? fabs(x[i]) : 0.0;
    }
    return size;
}

/* Whether a velocity that is 0, and whose acceleration is 0, may begin to move: through a term that is not 0 once all states
 * in it move. */
static bool may_begin(const motion *m, const series *s)
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

/* Grow the series one coefficient at a time, and give each velocity that begins to move its direction. */
static void grow_slowly(motion *m, series *s)
{
    for (int n = 1; n < ORDER; n++) {
        bool turned = false;
        for (int i = 0; i < N_MONITORED; i++) {
                int first = 0;
            while (first < n && s->c[first][i] == 0.0) {
                first++;
            }
            const int reverse = s->c[first][i] < 0.0;
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

/* The first two coefficients, the directions, and which components move. */
INLINE void begin(motion *m, double tau, series *s)
{
    double rate[N_SERIES];
    bool turned = false;
    s->tau = tau;
    s->moving = s->blocks = 0;
    for (int i = 0; i < N_MONITORED; i++) {
        m->reverse[i] = m->y[i] < 0.0;
    }
    model_direct(m->n, m->reverse, &m->q);
    model_rates(m->n, &m->q, m->y, rate);
    for (int i = 0; i < N_SERIES; i++) {
        const unsigned bit = 1U << COMPONENT_OF[i];
        s->c[0][i] = m->y[i];
        s->c[1][i] = m->settled & bit ? 0.0 : tau * rate[i];
        s->moving |= s->c[1][i] != 0.0 ? bit : 0U;
    }
    for (int k = 0; k < N_COMPONENTS; k++) {
        s->moving |= COMPONENT_INPUTS[k] & s->moving ? 1U << k : 0U;
    }
    for (int i = 0; i < N_SERIES; i++) {
        const bool moves = s->moving >> COMPONENT_OF[i] & 1U;
        s->pace[i] = moves ? tau : 0.0;
        s->blocks |= moves ? 1U << BLOCK_OF[i] : 0U;
        s->size[i] = GROUP[i] == i ? m->scale[i] + group_size(s->c[1], i) : 0.0;
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

/* Grow the series until it reaches t = 1, but not beyond a low order. Returns whether it does. */
INLINE bool grow_short(motion *m, series *s)
{
    bool waits = false;
    for (int i = 0; i < N_MONITORED; i++) {
        waits |= s->c[0][i] == 0.0 && s->c[1][i] == 0.0 && s->moving >> COMPONENT_OF[i] & 1U;
    }
    if (waits && may_begin(m, s)) {
        grow_slowly(m, s);
        return series_converges(s);
    }
    series_terms(m->n, &m->q, s, 1); /* constant orders, so that their loops are unrolled */
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

/* Grow the series to t = 1, or to ORDER. Returns how far it may be used; 0 where it overflows. */
static double grow_long(const motion *m, series *s)
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

/* Whether the sizes of the coefficients show that no velocity reverses before t = 1. */
INLINE bool keeps_directions(const series *s)
{
    double others[N_MONITORED] = {0.0};
    bool keeps = true;
    for (int n = s->order; n > 1; n--) {
        for (int i = 0; i < N_MONITORED; i++) {
            others[i] += fabs(s->c[n][i]);
        }
    }
    for (int i = 0; i < N_MONITORED; i++) {
        const double c0 = s->c[0][i], c1 = s->c[1][i];
        const bool against = (c0 > 0.0 && c1 < 0.0) || (c0 < 0.0 && c1 > 0.0); /* a product would underflow */
        keeps &= (against ? fabs(c0) - fabs(c1) : fabs(c0) + fabs(c1)) >= others[i];
    }
    return keeps;
}

/* Shorten a piece to the first reversal. Returns the velocity that reverses, or NONE. */
static int cut(const series *s, double *length)
{
    int reversed = NONE;
    for (int k = 0; k < N_MONITORED; k++) {
        bool reverses;
        const double end = series_sign_kept(s, k, *length, &reverses);
        reversed = reverses ? k : end < *length ? NONE : reversed;
        *length = end;
    }
    return reversed;
}

/* Move to the end of a piece, t = length. */
INLINE void move(motion *m, const series *s, double length, double change[N_SERIES])
{
    memset(change, 0, sizeof(double[N_SERIES]));
    for (int n = s->order; n > 0; n--) {
        for (int i = 0; i < N_SERIES; i++) {
            change[i] = (change[i] + s->c[n][i]) * length;
        }
    }
    for (int i = 0; i < N_SERIES; i++) {
        if (IS_USED[i]) {
            m->y[i] += change[i];
        } else {
            m->gone[i] += change[i];
        }
    }
}

/* Whether all states of a component have faded to nothing, and nothing drives them: then they come to rest. */
static bool fades(motion *m, int component)
{
    double y[N_SERIES], rate[N_SERIES];
    for (int i = 0; i < N_SERIES; i++) {
        const bool own = COMPONENT_OF[i] == component;
        if (own && fabs(m->y[i]) > 0.0625 * DBL_EPSILON * m->scale[GROUP[i]]) {
            return false;
        }
        y[i] = own ? 0.0 : m->y[i];
    }
    model_rates(m->n, &m->q, y, rate);
    for (int i = 0; i < N_SERIES; i++) {
        if (COMPONENT_OF[i] == component && rate[i] != 0.0) {
            return false;
        }
    }
    memcpy(m->y, y, sizeof y);
    return true;
}

/* Which components have settled: what they depend on has, and every rate is below the rounding error of its terms. */
static void settle(motion *m)
{
    double rate[N_SERIES], size[N_SERIES];
    m->settled = 0;
    for (int i = 0; i < N_MONITORED; i++) { /* that of a velocity which is 0 does not matter, and stays */
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
            still &= COMPONENT_OF[i] != k || fabs(rate[i]) <= 8.0 * DBL_EPSILON * size[i];
        }
        m->settled |= still || fades(m, k) ? 1U << k : 0U;
    }
}

/* Whether a dynamic component moved so little in a piece that it may have settled. */
static bool is_slow(const series *s, const double change[N_SERIES])
{
    bool moves[N_COMPONENTS] = {false}, all = true;
    for (int i = 0; i < N_SERIES; i++) {
        moves[COMPONENT_OF[i]] |= fabs(change[i]) > 0.001 * s->size[GROUP[i]];
    }
    for (int k = 0; k < N_DYNAMIC; k++) {
        all &= moves[k] || !(s->moving >> k & 1U);
    }
    return !all;
}

/* The states after h > 0 seconds with the inputs held; not finite only where a result overflows. Returns the number of
 * pieces, or 0 where they would be more than MOST_PIECES. */
static int model_step(const double at[], const model_numbers *n, double h, double next[N_STATES])
{
    const double *const state = at + FIRST_STATE;
    double done = 0.0, tau = h, change[N_SERIES];
    int pieces = 0;
    motion m = {.n = n};
    series s;
    model_start(at, n, &m.q, m.y);
    while (++pieces <= MOST_PIECES && tau > 0.0) {
        const double rest = h - done;
        for (int i = 0; i < N_SERIES; i++) {
            if (GROUP[i] == i) {
                m.scale[i] = fmax(m.scale[i], group_size(IS_USED[i] ? m.y : m.gone, i));
            }
        }
        begin(&m, fmin(rest, tau), &s);
        double reach = 1.0;
        if (!grow_short(&m, &s)) {
            if (pieces == 1) { /* a long step, of which some states may have settled already */
                settle(&m);
                if (m.settled == (1U << N_DYNAMIC) - 1U) {
                    model_coast(n, &m.q, h, m.y, m.gone);
                    break;
                }
                if (m.settled != 0U) {
                    begin(&m, s.tau, &s);
                    grow_short(&m, &s);
                }
            }
            reach = grow_long(&m, &s);
        }
        if (reach == 0.0) {
            tau = 1e-3 * s.tau;
            continue;
        }
        double length = reach;
        int reversed = NONE;
        if (reach < 1.0 || !keeps_directions(&s)) {
            reversed = cut(&s, &length);
        }
        if (length == 1.0) {
            move(&m, &s, 1.0, change);
        } else {
            move(&m, &s, length, change);
        }
        if (reversed != NONE) { /* at rest to the last digit, so that the next piece has the other direction */
            m.y[reversed] = 0.0;
        }
        if (HAS_LAG) {
            model_arrive(at, n, &m.q, m.y);
        }
        done += length * s.tau;
        if (length * s.tau >= rest) {
            break;
        }
        tau = 2.0 * s.tau * reach;
        if (is_slow(&s, change)) {
            settle(&m);
        }
        if (m.settled == (1U << N_DYNAMIC) - 1U) {
            model_coast(n, &m.q, h - done, m.y, m.gone);
            break;
        }
    }
    if (!(tau > 0.0)) { /* it overflows however short the piece is */
        for (int i = 0; i < N_STATES; i++) {
            next[i] = NAN;
        }
        return pieces;
    }
    model_finish(state, &m.q, m.y, m.gone, next);
    return pieces <= MOST_PIECES ? pieces : 0;
}
