/* The exact step: by Taylor series (series.c), and over long steps by the closed form (track.c) where there is one. A
 * reversal is a root of a polynomial: the piece is cut there. */

/* Whether what is left of every acceleration is rounding of its terms. */
static bool is_settled(const flow *f, const double v[WIDTH])
{
    double couple[WIDTH] = {0.0};
    rov_couple(f->gains, v, couple);
    for (int a = 0; a < N_AXES; a++) {
        const double drag = riccati_drag(&f->gains->axis[a], v[a]);
        const double rate = f->C[a] - drag + couple[a], size = fabs(f->C[a]) + fabs(drag) + fabs(couple[a]);
        double change = fabs(rate);
        for (int c = 0; c < N_CURVES && N_LAGGING > 0; c++) {
            change = fmax(change, fabs(f->late[c][a]));
        }
        if (!(change <= 8.0 * DBL_EPSILON * size)) {
            return false;
        }
    }
    return true;
}

/* How much of a piece is taken: as far as its terms reach, of a turn that is not too long, and up to the first reversal,
 * of the axis *stops. */
static double series_cut(const series *s, double reach, int *stops)
{
    double length = reach * fmin(1.0, LONGEST_TURN / series_turn(s, reach));
    for (int a = 0; a < N_AXES; a++) {
        bool reverses;
        const double end = series_sign_kept(s, a, length, &reverses);
        *stops = reverses ? a : end < length ? NONE : *stops;
        length = end;
    }
    return length;
}

/* The force after t more seconds: from the end that is nearer, or next to nothing is left of two large numbers. */
static void flow_pass(flow *f, double t)
{
    double left[N_AXES] = {0.0};
    for (int c = 0; c < N_CURVES; c++) {
        const double lost = expm1(-f->gains->rate[c] * t);
        for (int a = 0; a < N_AXES; a++) {
            f->C[a] += f->late[c][a] * lost;
            f->late[c][a] *= 1.0 + lost;
            left[a] += f->late[c][a];
        }
    }
    for (int a = 0; a < N_AXES; a++) {
        f->C[a] = fabs(left[a]) < 0.5 * fabs(f->then[a]) ? f->then[a] + left[a] : f->C[a];
    }
}

/* A step of h seconds: v moves to its end, the distances along the axes and the track go to *way and *sum. How many pieces it
 * takes, or 0: too many; of a free motion also where the series does not reach the end at once. */
static inline int series_step(flow *f, double v[WIDTH], double h, double way[WIDTH], planar *sum)
{
    double tau = h, done = 0.0;
    series s;
    for (int pieces = 1; pieces <= MOST_PIECES; pieces++) {
        const double rest = h - done;
        double change[WIDTH], gone[WIDTH], length = 1.0, reach = 1.0;
        int stops = NONE;
        if (!series_grow(f, v, fmin(rest, tau), &s)) {
            if (IS_FREE) {
                return 0;
            }
            reach = series_reach(&s);
            if (reach == 0.0) { /* it overflows */
                tau = 1e-3 * s.tau;
                continue;
            }
        }
        tau = 2.0 * s.tau * reach;
        if (!series_end(&s, change, gone) || reach < 1.0) {
            length = series_cut(&s, reach, &stops);
            if (length < 1.0) {
                series_shorten(&s, length);
                series_end(&s, change, gone);
            }
        }
        series_track(&s, way[R], gone, sum);
        for (int a = 0; a < WIDTH; a++) {
            v[a] += change[a];
            way[a] += gone[a];
        }
        if (stops != NONE) { /* at rest to the last digit, or what follows would take the branch of before */
            v[stops] = 0.0;
        }
        if (length == 1.0 && s.tau >= rest) {
            return pieces;
        }
        done += s.tau;
        if (N_LAGGING > 0) {
            flow_pass(f, s.tau);
        }
        if (!IS_FREE && is_settled(f, v)) {
            const planar left = {v[U] * (h - done), v[V] * (h - done)};
            track_add_arc(sum, left, way[R], v[R] * (h - done));
            for (int a = 0; a < N_AXES; a++) {
                way[a] += v[a] * (h - done);
            }
            return pieces;
        }
    }
    return 0;
}

static const double SERIES_REACH = 0.3;

/* Whether a series of ORDER reaches the end of a step: its coefficients fall as (h rate / 2)^n, rate as in panel_length. */
static inline bool is_in_reach(const rov_gains *gains, const double C[WIDTH], const double v[WIDTH], double h)
{
    double longest = SERIES_REACH - 0.5 * SERIES_REACH * h * fabs(v[R]);
    for (int a = 0; a < N_AXES; a++) {
        const double A = gains->axis[a].A[v[a] < 0.0], B = gains->axis[a].B[v[a] < 0.0];
        const double bend = h * (B + 2.0 * A * fabs(v[a])), swing = 4.0 * A * fabs(C[a]) * h * h;
        longest = bend * bend + swing > SERIES_REACH * SERIES_REACH ? -1.0 : longest;
    }
    return longest >= 0.0;
}

/* What moves and drives the vehicle while the inputs are held. */
static inline void flow_begin(const double at[], const rov_gains *gains, rov_held *held, flow *f, double v[WIDTH])
{
    memset(f, 0, sizeof *f);
    memset(v, 0, sizeof(double[WIDTH]));
    f->gains = gains;
    rov_hold(at, gains, held);
    rov_push(at, gains, held->steady, f->then);
    for (int a = 0; a < N_AXES; a++) {
        v[a] = at[FIRST_STATE + a];
        f->C[a] = held->C[a];
        for (int t = 0; t < N_THRUSTERS; t++) {
            if (rov_lags(t)) {
                f->late[THRUSTERS[t].curve][a] += gains->push[t][a] * (at[THRUSTERS[t].force] - held->steady[t]);
            }
        }
    }
}

/* The states after h > 0 seconds with the inputs held; not finite only where a result overflows. How many pieces the step
 * takes, or 0: more than MOST_PIECES. */
static int rov_step(const double at[], const rov_gains *gains, double h, double next[N_STATES])
{
    const double *const state = at + FIRST_STATE;
    double v[WIDTH], way[WIDTH] = {0.0}, change[N_STATES] = {0.0};
    planar sum = {0.0, 0.0};
    rov_held held;
    flow f;
    flow_begin(at, gains, &held, &f, v);
    const double lengths = v[R] == 0.0 && held.C[R] == 0.0 ? 3.0 : 1.0; /* straight, the closed form costs less so soon */
    int pieces = IS_FREE && !is_in_reach(gains, held.C, v, lengths * h) ? 0 : series_step(&f, v, h, way, &sum);
    if (IS_FREE && pieces == 0) {
        riccati axis[WIDTH];
        memcpy(axis, gains->axis, sizeof axis);
        sum.ahead = sum.aside = 0.0;
        for (int a = 0; a < N_AXES; a++) {
            axis[a].C = held.C[a];
            v[a] = state[a];
            way[a] = 0.0;
        }
        pieces = closed_step(axis, v, h, way, &sum);
    }
    for (int a = 0; a < N_AXES; a++) {
        next[a] = v[a];
    }
    if (POSE_x != NONE) {
        way[U] = sum.ahead;
        way[V] = sum.aside;
    }
    rov_pose(rov_value(state, POSE_psi), way, held.north * h, held.east * h, change);
    for (int t = 0; t < N_THRUSTERS; t++) {
        if (rov_lags(t)) { /* F' = (F(c) - F)/T */
            change[THRUSTERS[t].force - FIRST_STATE] =
                (held.F[t] - held.steady[t]) * expm1(-gains->rate[THRUSTERS[t].curve] * h);
        }
    }
    for (int s = N_AXES; s < N_STATES; s++) {
        next[s] = state[s] + change[s];
    }
    return pieces;
}

/* Terms of the pose by those of the velocities and the heading: of x and y as products with its sine and cosine. */
static void rov_pose_terms(const series *s, double psi, int n, double north, double east, double term[N_STATES])
{
    double sine[ORDER + 1] = {sin(psi)}, cosine[ORDER + 1] = {cos(psi)}, ahead = 0.0, aside = 0.0;
    for (int k = 1; k < n; k++) { /* sin' = r cos, cos' = -r sin */
        for (int j = 0; j < k; j++) {
            sine[k] += s->c[j][R] * cosine[k - 1 - j] * INVERSE[k];
            cosine[k] -= s->c[j][R] * sine[k - 1 - j] * INVERSE[k];
        }
    }
    for (int j = 0; j < n; j++) {
        ahead += s->c[j][U] * cosine[n - 1 - j] - s->c[j][V] * sine[n - 1 - j];
        aside += s->c[j][U] * sine[n - 1 - j] + s->c[j][V] * cosine[n - 1 - j];
    }
    double v[WIDTH];
    memcpy(v, s->c[n - 1], sizeof v);
    v[U] = ahead;
    v[V] = aside;
    rov_pose(0.0, v, n == 1 ? north : 0.0, n == 1 ? east : 0.0, term);
    for (int p = N_AXES; p < N_STATES; p++) {
        term[p] *= INVERSE[n];
    }
}

/* Time derivatives of order 1 <= n <= ORDER of the states and of the thrust, while the inputs are held; d by value
 * reference, 0 elsewhere. */
static void rov_rates_of_order(const double at[], const rov_gains *gains, int n, double d[N_VARIABLES])
{
    double v[WIDTH], *const rate = d + FIRST_STATE, factorial = 1.0;
    rov_held held;
    flow f;
    series s;
    memset(d, 0, sizeof(double[N_VARIABLES]));
    flow_begin(at, gains, &held, &f, v);
    series_begin(&f, v, 1.0, &s);
    for (int k = 1; k < n; k++) {
        series_next(&f, &s, k);
        factorial *= k + 1;
    }
    rov_pose_terms(&s, rov_value(at, POSE_psi == NONE ? NONE : FIRST_STATE + POSE_psi), n, held.north, held.east, rate);
    memcpy(rate, s.c[n], sizeof(double[N_AXES]));
    for (int i = 0; i < N_STATES; i++) {
        rate[i] *= factorial;
    }
    for (int t = 0; t < N_THRUSTERS; t++) {
        if (rov_lags(t)) { /* F' = (F(c) - F)/T */
            const double lag = gains->rate[THRUSTERS[t].curve];
            d[THRUSTERS[t].force] = (held.steady[t] - held.F[t]) * lag * pow(-lag, n - 1);
        }
    }
    for (int c = 0; c < N_CURVES; c++) {
        for (int t = 0; t < N_THRUSTERS; t++) {
            if (THRUSTERS[t].curve == c && CURVES[c].torque != NONE) {
                d[CURVES[c].torque] += gains->torque[t] * d[THRUSTERS[t].force];
            }
        }
    }
}
