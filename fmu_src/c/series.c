/* The motion as Taylor series. Between the reversals of its axes all terms of the motion are polynomials of the state: with v = sum of v_n t^n
 *
 *     v_(n+1) = (C_n - B v_n - A (v^2)_n) / (n + 1),      (v^2)_n = sum of v_j v_(n-j),      A of the direction's sign
 *
 * and likewise the force of a lag, C_n = D (-1/T)^n / n!, and the products of the coupling. The coefficients tell how far they
 * reach (Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods,
 * 2005). */

enum { ORDER = 19, ORDER_OF_FEW = 11 };
static const double TURN_OF_FEW = 0.14; /* up to which, and to which order, the rule of four is enough */
/* How much of that the rate may change by: an angle b t^2 asks for twice the order, the error of four is 1e-6 b^4. */
static const double BEND_OF_FEW = 0.002;
static const double INVERSE[ORDER + 2] = {
    0.0, 1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0, 1.0 / 7.0, 1.0 / 8.0, 1.0 / 9.0, 1.0 / 10.0,
    1.0 / 11.0, 1.0 / 12.0, 1.0 / 13.0, 1.0 / 14.0, 1.0 / 15.0, 1.0 / 16.0, 1.0 / 17.0, 1.0 / 18.0, 1.0 / 19.0, 1.0 / 20.0};
/* The last two terms of a series against the first ones: each falls by six at least where ORDER does, by 36 from rest where
 * every other one vanishes, so that what follows is half a rounding. */
static const double SMALL = 16.0 * DBL_EPSILON;

/* What moves, as acceleration: the force of now, what it is once the lags are over, and what each curve's has left. */
typedef struct {
    const rov_gains *gains;
    double C[WIDTH], then[WIDTH], late[N_CURVES][WIDTH];
} flow;

/* Polynomials of the velocities in time by tau, what their terms come from, and what they add up to. */
typedef struct {
    int order;
    bool decided;                                     /* whether the directions are known */
    double tau, c[ORDER + 1][WIDTH];
    double A[WIDTH], D[WIDTH];                        /* drag in the direction of the motion: D = B + 2 A v_0 */
    double fall[N_CURVES];                            /* of what the lags have left */
    double change[WIDTH], mean[WIDTH], others[WIDTH]; /* sums beyond v_1 at the end: v, its mean, sizes */
} series;

static inline void series_add(series *s, int n)
{
    for (int a = 0; a < WIDTH; a++) {
        s->change[a] += s->c[n][a];
        s->mean[a] += s->c[n][a] * INVERSE[n + 1];
        s->others[a] += fabs(s->c[n][a]);
    }
}

/* The first term up to n that is not 0; n + 1 where there is none. */
static inline int series_first(const series *s, int a, int n)
{
    int first = 0;
    while (first <= n && s->c[first][a] == 0.0) {
        first++;
    }
    return first;
}

/* Drag of an axis by its direction, that of the first of the terms up to n that is not 0; false where there is none. */
static inline bool series_drag(const flow *f, series *s, int a, int n)
{
    const int first = series_first(s, a, n), back = first <= n && s->c[first][a] < 0.0;
    s->A[a] = (back ? -s->tau : s->tau) * f->gains->axis[a].A[back];
    s->D[a] = s->tau * f->gains->axis[a].B[back] + 2.0 * s->A[a] * s->c[0][a];
    return first <= n;
}

/* The term after n. */
INLINE void series_term(const flow *f, series *s, int n)
{
    double square[WIDTH] = {0.0}, rest[WIDTH] = {0.0}; /* v^2 without v_0; all but the drag of the last term */
    for (int j = (n - 1) / 2; j > 0; j--) {
        for (int a = 0; a < WIDTH; a++) {
            square[a] += s->c[j][a] * s->c[n - j][a];
        }
    }
    for (int a = 0; a < WIDTH; a++) {
        const double middle = n % 2 == 0 ? s->c[n / 2][a] : 0.0;
        rest[a] = -s->A[a] * (2.0 * square[a] + middle * middle);
    }
    for (int c = 0; c < N_CURVES && N_LAGGING > 0; c++) {
        s->fall[c] *= -s->tau * f->gains->rate[c] * INVERSE[n];
        for (int a = 0; a < WIDTH; a++) {
            rest[a] += s->fall[c] * f->late[c][a];
        }
    }
    if (IS_COUPLED) {
        double vr = 0.0, ur = 0.0, uv = 0.0;
        for (int j = 0; j <= n; j++) {
            vr += s->c[j][V] * s->c[n - j][R];
            ur += s->c[j][U] * s->c[n - j][R];
            uv += s->c[j][U] * s->c[n - j][V];
        }
        rest[U] += s->tau * f->gains->c_u * vr;
        rest[V] -= s->tau * f->gains->c_v * ur;
        rest[R] -= s->tau * f->gains->c_r * uv;
    }
    if (!IS_FREE && !s->decided) {
        s->decided = true;
        for (int a = 0; a < N_AXES; a++) {
            s->decided &= series_drag(f, s, a, n);
        }
    }
    for (int a = 0; a < WIDTH; a++) {
        s->c[n + 1][a] = INVERSE[n + 1] * rest[a] - INVERSE[n + 1] * s->D[a] * s->c[n][a];
    }
    series_add(s, n + 1);
}

/* How large an axis is by the first three terms that are not 0: from rest, lag and coupling begin as a power of t; and the
 * last terms. Of such a power, only every third may be there. */
static double series_sizes(const series *s, int a, int n, double *last)
{
    const int first = series_first(s, a, n);
    double size = 0.0;
    *last = fmax(fabs(s->c[n][a]), fabs(s->c[n - 1][a]));
    if (first > 1) {
        *last = fmax(*last, fabs(s->c[n - 2][a]));
    }
    for (int k = first; k < first + 3 && k < n - 1; k++) {
        size = fmax(size, fabs(s->c[k][a]));
    }
    return size;
}

/* Whether an axis that has not moved in n terms may yet do so: where the other two of the coupling move. */
static inline bool series_waits(const series *s, int n)
{
    const int u = series_first(s, U, n) > n, v = series_first(s, V, n) > n, r = series_first(s, R, n) > n;
    return IS_COUPLED && u + v + r == 1;
}

/* Whether the last of n terms are small. */
static inline bool series_is_done(series *s, int n)
{
    bool done = IS_FREE || s->decided;
    s->order = n;
    for (int a = 0; a < WIDTH; a++) {
        const double size = fabs(s->c[0][a]) + fabs(s->c[1][a]);
        done &= fabs(s->c[n][a]) + fabs(s->c[n - 1][a]) <= SMALL * size + DBL_MIN;
    }
    for (int a = 0; a < N_AXES && !done; a++) {
        double last;
        const double size = series_sizes(s, a, n, &last);
        if (!(last <= 0.5 * SMALL * size + DBL_MIN)) {
            return false;
        }
    }
    return done || !series_waits(s, n);
}

/* The same, not inline: a tenth of the library less. */
static void series_next(const flow *f, series *s, int n)
{
    series_term(f, s, n);
}

/* The first two terms of polynomials from v on over tau seconds. */
static inline void series_begin(const flow *f, const double v[WIDTH], double tau, series *s)
{
    double couple[WIDTH] = {0.0};
    s->tau = tau;
    for (int c = 0; c < N_CURVES; c++) {
        s->fall[c] = tau;
    }
    rov_couple(f->gains, v, couple);
    for (int a = 0; a < WIDTH; a++) {
        s->c[0][a] = v[a];
        s->c[1][a] = tau * (f->C[a] + couple[a] - riccati_drag(&f->gains->axis[a], v[a]));
        s->change[a] = s->mean[a] = s->others[a] = 0.0;
        const double way = v[a] != 0.0 ? v[a] : s->c[1][a];
        const int back = way < 0.0;
        s->A[a] = copysign(tau * f->gains->axis[a].A[back], way);
        s->D[a] = tau * f->gains->axis[a].B[back] + 2.0 * s->A[a] * v[a];
    }
    s->decided = false;
}

/* Polynomials from v on over tau seconds, of so many terms that the next ones would be rounding; false where ORDER does not
 * do. */
static inline bool series_grow(const flow *f, const double v[WIDTH], double tau, series *s)
{
    series_begin(f, v, tau, s);
    series_term(f, s, 1); /* by hand, for what is not a loop takes a third less time */
    series_term(f, s, 2);
    series_term(f, s, 3);
    series_term(f, s, 4);
    series_term(f, s, 5);
    series_term(f, s, 6);
    if (series_is_done(s, 7)) {
        return true;
    }
    series_term(f, s, 7);
    series_term(f, s, 8);
    bool done = series_is_done(s, 9);
    for (int n = 9; !done && n < ORDER; n += 2) {
        series_next(f, s, n);
        series_next(f, s, n + 1);
        done = series_is_done(s, n + 2);
    }
    return done;
}

/* How far the last terms stay below rounding of the first ones, up to 1; 0 where they overflow. */
static double series_reach(const series *s)
{
    double reach = 1.0;
    for (int a = 0; a < N_AXES; a++) {
        double last;
        const double size = series_sizes(s, a, s->order, &last), share = 0.5 * SMALL * size / last;
        if (!isfinite(last)) {
            return 0.0;
        }
        if (share < 1.0) {
            reach = fmin(reach, pow(share, 1.0 / (s->order - 4)));
        }
    }
    return reach;
}

/* Make t tau the unit of time. */
static void series_shorten(series *s, double t)
{
    double power = 1.0;
    for (int n = 0; n <= s->order; n++, power *= t) {
        for (int a = 0; a < WIDTH; a++) {
            s->c[n][a] *= power;
            s->change[a] = n > 1 ? s->change[a] : 0.0;
            s->mean[a] = n > 1 ? s->mean[a] : 0.0;
            s->others[a] = n > 1 ? s->others[a] : 0.0;
        }
        if (n > 1) {
            series_add(s, n);
        }
    }
    s->tau *= t;
}

/* A polynomial at t, as what is added to its start. */
static double series_value(const series *s, int a, double t)
{
    double change = 0.0;
    for (int n = s->order; n > 0; n--) {
        change = (change + s->c[n][a]) * t;
    }
    return s->c[0][a] + change;
}

/* The one root of a polynomial whose slope stays within a quarter of its first one, by Newton's method. */
static double series_root(const series *s, int a)
{
    double t = 0.0, next = -s->c[0][a] / s->c[1][a];
    for (int i = 0; i < 60 && fabs(next - t) > DBL_EPSILON * next; i++) {
        double slope = 0.0;
        t = next;
        for (int n = s->order; n > 0; n--) {
            slope = slope * t + n * s->c[n][a];
        }
        next = t - series_value(s, a, t) / slope;
    }
    return next;
}

/* How far a velocity goes before its sign changes, at most the length; whether it is zero there. */
static inline double series_sign_kept(const series *s, int a, double length, bool *reverses)
{
    const double shortest = 0x1p-20 * length; /* there a velocity that just touches zero has no drag worth a sign */
    int k = series_first(s, a, s->order);
    *reverses = false;
    for (; k <= s->order && length > shortest; length *= 0.5) {
        double others = 0.0, slopes = 0.0, power = length;
        for (int n = k + 1; n <= s->order; n++, power *= length) {
            others += fabs(s->c[n][a]) * power;
            slopes += n > 1 ? n * fabs(s->c[n][a]) * power : 0.0;
        }
        if (fabs(s->c[k][a]) > others) {
            break;
        }
        if (k == 0 && fabs(s->c[1][a]) * length > 4.0 * slopes) { /* it only rises or only falls */
            const double end = series_value(s, a, length);
            *reverses = end == 0.0 || (end > 0.0) != (s->c[0][a] > 0.0);
            return *reverses ? fmin(length, series_root(s, a)) : length;
        }
    }
    return length;
}

/* What the rule of eight must follow over a piece of t tau: the turn by its power t^n weighs as much as the order that it asks
 * for, up to 4: LONGEST_TURN at a steady rate, half a radian of a turn that begins at rest. */
static inline double series_turn(const series *s, double t)
{
    double rate = 0.0;
    for (int n = s->order; n > 1; n--) {
        rate = (rate + fabs(s->c[n][R])) * t;
    }
    return s->tau * t * (fabs(s->c[0][R]) + t * (2.0 * fabs(s->c[1][R]) + 4.0 * rate));
}

/* The track of a piece by a rule of n places. */
static inline void series_places(const series *s, int n, double turned, double turn, planar *sum)
{
    const double *const places = n == FEW ? PLACES : PLACES + FEW;
    track_places p;
    double power[MANY];
    for (int i = 0; i < n; i++) {
        p.ahead[i] = s->c[0][U];
        p.aside[i] = s->c[0][V];
        p.turn[i] = s->tau * s->c[0][R] * places[i];
        power[i] = places[i];
    }
    for (int k = 1; k <= s->order - 2; k++) { /* the last two are small */
        const double angle = s->tau * INVERSE[k + 1] * s->c[k][R];
        for (int i = 0; i < n; i++) {
            p.ahead[i] += s->c[k][U] * power[i];
            p.aside[i] += SWAY == NONE ? 0.0 : s->c[k][V] * power[i];
            power[i] *= places[i];
            p.turn[i] += angle * power[i];
        }
    }
    track_add(sum, &p, n == FEW, s->tau, turned, turn);
}

static inline void series_track(const series *s, double turned, const double way[WIDTH], planar *sum)
{
    if (POSE_x == NONE) {
        return;
    }
    if (YAW == NONE || (way[R] == 0.0 && s->c[0][R] == 0.0)) { /* r keeps its sign: it is 0 all along */
        const planar straight = {way[U], way[V]};
        track_add_arc(sum, straight, turned, 0.0);
    } else if (fabs(way[R]) < TURN_OF_FEW && s->order <= ORDER_OF_FEW
               && s->tau * (fabs(s->c[1][R]) + s->others[R]) <= BEND_OF_FEW) {
        series_places(s, FEW, turned, way[R], sum);
    } else {
        series_places(s, MANY, turned, way[R], sum);
    }
}

/* The end of a piece as the change of the velocities and the distances; whether it is plain by the sizes of the terms that no
 * velocity changes its sign on the way, and that it does not turn too much. */
static inline bool series_end(const series *s, double change[WIDTH], double way[WIDTH])
{
    bool plain = true;
    for (int a = 0; a < WIDTH; a++) {
        const double c0 = s->c[0][a], c1 = s->c[1][a];
        const bool against = (c0 > 0.0 && c1 < 0.0) || (c0 < 0.0 && c1 > 0.0); /* a product would underflow */
        const double kept = against ? fabs(c0) - fabs(c1) : fabs(c0) + fabs(c1); /* of the first two, at the end */
        plain &= kept >= s->others[a];
        change[a] = s->change[a] + c1;
        way[a] = s->tau * (c0 + (0.5 * c1 + s->mean[a]));
    }
    return plain && series_turn(s, 1.0) <= LONGEST_TURN;
}
