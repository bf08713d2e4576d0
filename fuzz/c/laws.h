/* What holds whatever was called: finite outputs, motion that obeys its equation, derivatives that are the motion's. */
#pragma once

#include "world.h"

/* What the forces of the moment, and those that the lags leave, can accelerate each axis by. */
static void strongest(const fmu *f, double C[N_AXES])
{
    rov_held held;
    rov_hold(f->now.values, &f->gains, &held);
    for (int a = 0; a < N_AXES; a++) {
        C[a] = held.C[a];
        for (int t = 0; t < N_THRUSTERS && N_LAGGING > 0; t++) {
            const double late = rov_lags(t) ? f->now.values[THRUSTERS[t].force] - held.steady[t] : 0.0;
            C[a] = fabs(C[a]) + fabs(f->gains.push[t][a] * late);
        }
    }
}

/* The fastest that a motion can get along each axis within h. Drag only brakes, and the coupling does no work: the root n of
 * the sum of M v^2, twice the kinetic energy, grows by no more than that of the sum of F^2/M in a second. */
static void fastest(const fmu *f, double h, double v[N_AXES])
{
    double C[N_AXES], energy = 0.0, power = 0.0;
    strongest(f, C);
    for (int a = 0; a < N_AXES; a++) {
        energy = hypot(energy, f->now.values[FIRST_STATE + a] / sqrt(f->gains.gain[a]));
        power = hypot(power, C[a] / sqrt(f->gains.gain[a]));
    }
    for (int a = 0; a < N_AXES; a++) {
        const double alone = fabs(f->now.values[FIRST_STATE + a]) + fabs(C[a]) * h;
        v[a] = IS_COUPLED ? sqrt(f->gains.gain[a]) * (energy + power * h) : alone;
    }
}

/* The rates, together, at which drag and coupling change velocities up to v. */
static double rates_up_to(const fmu *f, const double v[N_AXES])
{
    const double coupling = fabs(f->gains.c_u) + fabs(f->gains.c_v) + fabs(f->gains.c_r);
    double rates = 0.0;
    for (int a = 0; a < N_AXES; a++) {
        for (int back = 0; back < 2; back++) {
            rates += f->gains.axis[a].B[back] + f->gains.axis[a].A[back] * v[a];
        }
        rates += coupling * v[a];
    }
    return rates;
}

/* Whether a step takes few enough pieces in any case: its rates come to no more than 1,000 over it. */
static bool is_calm(const fmu *f, double h)
{
    double v[N_AXES];
    fastest(f, h, v);
    return h <= 1e30 && (rov_value(v, YAW) + (IS_FREE ? 0.0 : rates_up_to(f, v))) * h <= 1e3;
}

/* How far anything changes within h, together. */
static double changes_of(const fmu *f, double h)
{
    double v[N_AXES], rates;
    fastest(f, h, v);
    rates = rov_value(v, YAW) + rates_up_to(f, v);
    for (int c = 0; c < N_CURVES && N_LAGGING > 0; c++) {
        rates += f->gains.rate[c];
    }
    return rates * h;
}

/* ---- Axes alone ---- */

/* Where drag balances the force. */
static double equilibrium(const riccati *axis, double C)
{
    const double A = axis->A[C < 0.0], B = axis->B[C < 0.0];
    const double root = hypot(B, 2.0 * sqrt(A) * sqrt(fabs(C)));
    return C == 0.0 ? 0.0 : 2.0 * C / (B + root);
}

/* A velocity has gone from where it was towards its equilibrium and not beyond; without force, to the last bit. */
static void check_velocity(const char *name, const riccati *axis, double C, double v0, double v)
{
    const double limit = equilibrium(axis, C);
    PROPERTY(isfinite(v), "%s is %g", name, v);
    if (C == 0.0) {
        const int back = v0 < 0.0;
        PROPERTY(fabs(v) <= fabs(v0) && v * v0 >= 0.0, "%s without force: from %a to %a", name, v0, v);
        PROPERTY(v == v0 || axis->A[back] > 0.0 || axis->B[back] > 0.0, "%s without drag: from %a to %a", name, v0, v);
    }
    if (isfinite(limit)) {
        const double rounding = 8.0 * DBL_EPSILON * fmax(fabs(v0), fabs(limit)) + DBL_MIN;
        PROPERTY(v >= fmin(v0, limit) - rounding && v <= fmax(v0, limit) + rounding,
                 "%s: from %a to %a, beyond its equilibrium %a", name, v0, v, limit);
    }
}

/* What rounding may add to a distance that v covers from one place to another. */
static double rounding_of_way(double v, double h, double from, double to)
{
    return 64.0 * DBL_EPSILON * (fabs(v) * h + fabs(from) + fabs(to)) + DBL_MIN * (1.0 + h);
}

/* Between two velocities that are the bounds all the way, no less is covered than at the lower and no more than at the
 * higher. */
static void check_way(const char *name, double low, double high, double h, double from, double to)
{
    const double rounding = rounding_of_way(fmax(fabs(low), fabs(high)), h, from, to);
    PROPERTY(!isfinite(rounding) || (to - from >= low * h - rounding && to - from <= high * h + rounding),
             "%s goes from %a to %a in %a, at %a to %a", name, from, to, h, low, high);
}

/* A turn does not make the way longer. */
static void check_track(const double before[], const double after[], double fastest_way, double h)
{
    const double *const from = before + FIRST_STATE, *const to = after + FIRST_STATE;
    const double current[] = {rov_value(before, MAYBE_V_N), rov_value(before, MAYBE_V_E)};
    const double x = rov_value(from, POSE_x), y = rov_value(from, POSE_y);
    const double north = rov_value(to, POSE_x), east = rov_value(to, POSE_y);
    const double way = hypot(north - x - current[0] * h, east - y - current[1] * h);
    const double rounding = rounding_of_way(fastest_way, h, hypot(x, y), hypot(north, east))
                            + rounding_of_way(hypot(current[0], current[1]), h, 0.0, 0.0);
    PROPERTY(!isfinite(rounding) || way <= fastest_way * h + rounding, "%a at no more than %a for %a", way, fastest_way, h);
}

static void check_step(const fmu *start, const fmu *end, double h)
{
    const double *const from = start->now.values + FIRST_STATE, *const to = end->now.values + FIRST_STATE;
    double C[N_AXES], most[N_AXES], low[N_AXES], high[N_AXES];
    rov_held held;
    rov_hold(start->now.values, &start->gains, &held);
    strongest(start, C);
    fastest(start, h, most);
    for (int a = 0; a < N_AXES; a++) {
        const char *const name = VARIABLES[FIRST_STATE + a].name;
        const double room = most[a] + 1e-9 * most[a]; /* of thousands of pieces, rounded */
        if (IS_FREE) {
            check_velocity(name, &start->gains.axis[a], held.C[a], from[a], to[a]);
        } else {
            PROPERTY(isfinite(to[a]) && !(fabs(to[a]) > room + DBL_MIN), "%s: from %a to %a, at most %a", name, from[a], to[a],
                     most[a]);
        }
        low[a] = IS_FREE ? fmin(from[a], to[a]) : -room;
        high[a] = IS_FREE ? fmax(from[a], to[a]) : room;
    }
    for (int t = 0; t < N_THRUSTERS; t++) {
        if (rov_lags(t)) {
            const int F = THRUSTERS[t].force - FIRST_STATE;
            const double rounding = 4.0 * DBL_EPSILON * (fabs(from[F]) + fabs(held.steady[t]));
            PROPERTY(to[F] >= fmin(from[F], held.steady[t]) - rounding && to[F] <= fmax(from[F], held.steady[t]) + rounding,
                     "F of thruster %d: from %a to %a, beyond %a", t, from[F], to[F], held.steady[t]);
        }
    }
    if (POSE_z != NONE) {
        check_way("z", rov_value(low, HEAVE), rov_value(high, HEAVE), h, rov_value(from, POSE_z), rov_value(to, POSE_z));
    }
    if (POSE_psi != NONE) {
        check_way("psi", rov_value(low, YAW), rov_value(high, YAW), h, rov_value(from, POSE_psi), rov_value(to, POSE_psi));
    }
    if (POSE_x != NONE) {
        const double ahead = fmax(fabs(rov_value(low, SURGE)), fabs(rov_value(high, SURGE)));
        const double aside = fmax(fabs(rov_value(low, SWAY)), fabs(rov_value(high, SWAY)));
        check_track(start->now.values, end->now.values, hypot(ahead, aside), h);
    }
}

/* ---- One motion, asked for in several ways ---- */

/* How large the terms are that make up each state within h. */
static void sizes_of(const fmu *f, double h, double size[N_STATES])
{
    const double *const state = f->now.values + FIRST_STATE;
    const double turned = POSE_psi == NONE ? 0.0 : fabs(rov_value(state, POSE_psi));
    double most[N_AXES], way = h * (fabs(rov_value(f->now.values, MAYBE_V_N)) + fabs(rov_value(f->now.values, MAYBE_V_E)));
    rov_held held;
    rov_hold(f->now.values, &f->gains, &held);
    fastest(f, h, most);
    for (int a = 0; a < N_AXES; a++) {
        size[a] = most[a];
        way += h * most[a];
    }
    for (int i = N_AXES; i < N_STATES; i++) {
        size[i] = fabs(state[i]) + way * (1.0 + turned); /* a large heading has fewer digits for its sine */
    }
    for (int t = 0; t < N_THRUSTERS; t++) {
        if (rov_lags(t)) {
            size[THRUSTERS[t].force - FIRST_STATE] = fabs(held.F[t]) + fabs(held.steady[t]);
        }
    }
}

static void check_same(const char *what, const fmu *start, double h, const double one[], const double other[], double rounding)
{
    double size[N_STATES];
    sizes_of(start, h, size);
    for (int i = 0; i < N_STATES; i++) {
        PROPERTY(!(fabs(one[i] - other[i]) > rounding * size[i] + DBL_MIN * (1.0 + h)), "%s of %a s: %s = %a and %a", what, h,
                 VARIABLES[FIRST_STATE + i].name, one[i], other[i]);
    }
}

/* A step leads where so many parts of it lead. */
static void check_parts(const fmu *start, const fmu *end, double h, int parts)
{
    double values[N_VARIABLES];
    memcpy(values, start->now.values, sizeof values);
    if (!(changes_of(start, h) <= 1.0) || h / parts < DBL_MIN) { /* rounding may grow; a subnormal has no third */
        return;
    }
    for (int i = 0; i < parts; i++) {
        double next[N_STATES];
        PROPERTY(rov_step(values, &start->gains, h / parts, next) > 0, "a part of a step takes too many pieces");
        memcpy(values + FIRST_STATE, next, sizeof next);
    }
    check_same("a step and its parts", start, h, end->now.values + FIRST_STATE, values + FIRST_STATE, 1e-9);
}

/* A step with the inputs held, from t. */
static void check_whole_step(const fmu *start, const fmu *end, double t, double h)
{
    check_step(start, end, h);
    check_parts(start, end, h, 3);
    PROPERTY(end->now.time == t + h, "a step to t = %a ends at %a", t + h, end->now.time);
}

/* The derivatives of all orders are those of the motion: their series leads where a short step leads. */
static void check_taylor(const fmu *f)
{
    const double *const from = f->now.values + FIRST_STATE, h = 0.005 / (1.0 + changes_of(f, 1.0));
    double d[N_VARIABLES], sum[N_STATES], next[N_STATES], factor = 1.0;
    bool plain = changes_of(f, h) <= 0.01 && rov_step(f->now.values, &f->gains, h, next) > 0;
    memcpy(sum, from, sizeof sum);
    for (int n = 1; n <= ORDER && plain; n++) {
        rov_rates_of_order(f->now.values, &f->gains, n, d);
        factor *= h / n;
        for (int i = 0; i < N_STATES; i++) {
            sum[i] += factor * d[FIRST_STATE + i];
            plain = plain && isfinite(sum[i]);
        }
    }
    for (int a = 0; a < N_AXES; a++) { /* beyond a reversal there is another series */
        plain = plain && (from[a] == 0.0 || next[a] / from[a] > 0.5);
    }
    if (plain) {
        check_same("a series of derivatives", f, h, next, sum, 1e-11);
    }
}

/* The first time derivative of a state is what the model says that it is. */
static void check_first_derivative(fmu *f, unsigned state, double derivative)
{
    const unsigned vr = FIRST_REFERENCE + FIRST_CALCULATED + state;
    double rate, size[N_STATES];
    PROPERTY(FMI(GetReal)(f, &vr, 1, &rate AND(1)) == 0, "a derivative cannot be read");
    sizes_of(f, 1.0, size);
    PROPERTY(!(fabs(derivative - rate) > 1e-12 * (1.0 + changes_of(f, 1.0)) * size[state]), "der(%s) = %a and %a",
             VARIABLES[FIRST_STATE + state].name, derivative, rate);
}

/* The gains and the mode are the expected ones; states and thrust can be read and are finite. */
static void check_instance(const slot *s)
{
    unsigned vr[N_STATES + N_THRUST];
    double values[N_STATES + N_THRUST];
    for (unsigned i = 0; i < N_STATES + N_THRUST; i++) {
        vr[i] = FIRST_REFERENCE + FIRST_STATE + i + (i < N_STATES ? 0 : N_STATES);
    }
    if (s->f == NULL) {
        return;
    }
    rov_gains gains;
    rov_prepare(s->f->now.values, &gains);
    PROPERTY(memcmp(&gains, &s->f->gains, sizeof gains) == 0, "the gains are those of other coefficients");
    PROPERTY(s->f->now.mode == s->at.mode && s->f->now.type == s->at.type, "in %s instead of %s",
             mode_name(s->f->now.mode), mode_name(s->at.mode));
    const unsigned n = N_LAGGING > 0 && !is_moderate(s->f) ? N_STATES : N_STATES + N_THRUST; /* a torque may overflow */
    before_call();
    PROPERTY(FMI(GetReal)(s->f, vr, n, values AND(n)) == 0, "the outputs cannot be read");
    PROPERTY(is_same(s, true), "to read changes the instance");
    for (unsigned i = 0; i < n; i++) {
        PROPERTY(isfinite(values[i]), "%s = %g", VARIABLES[place_of(vr[i])].name, values[i]);
    }
}
