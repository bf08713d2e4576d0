/* The laws that hold after any calls: outputs are finite, the motion obeys its equation, and derivatives match it. The
 * velocities are the first states, and the load along velocity a is input N_COMMANDS + a. */
#pragma once

#include "world.h"

#ifdef IS_AUTOPILOT
#include "laws_of_autopilot.h"
#else
static const double TURN = 6.283185307179586;

/* Velocities (m/s, rad/s) below this have fewer digits, because squares underflow where the step tests convergence. */
static const double TINY = 1e-150;

/* Return the place of a state or an input between two places by its name; NONE when the vehicle lacks it. */
static int named(const char *name, int first, int end)
{
    for (int i = first; i < end; i++) {
        if (strcmp(VARIABLES[i].name, name) == 0) {
            return i - first;
        }
    }
    return NONE;
}

static double state_of(const double values[], const char *name)
{
    const int place = named(name, FIRST_STATE, FIRST_CALCULATED);
    return place == NONE ? 0.0 : values[FIRST_STATE + place];
}

static double input_of(const double values[], const char *name)
{
    const int place = named(name, 0, N_INPUTS);
    return place == NONE ? 0.0 : values[place];
}

static double of_velocity(const double v[N_VELOCITIES], const char *name)
{
    const int place = named(name, FIRST_STATE, FIRST_STATE + N_VELOCITIES);
    return place == NONE ? 0.0 : v[place];
}

/* Return the sum of the angular velocities, which bounds how fast the vehicle turns. */
static double turning_of(const double v[N_VELOCITIES])
{
    return fabs(of_velocity(v, "p")) + fabs(of_velocity(v, "q")) + fabs(of_velocity(v, "r"));
}

static bool is_coupled(int a)
{
    for (int b = 0; b < N_VELOCITIES; b++) {
        if (b != a && STRUCTURE.component_of[a] == STRUCTURE.component_of[b]) {
            return true;
        }
    }
    return false;
}

/* Return true when only its own drag and a constant force act on a velocity, so that it has a closed form. */
static bool is_free(int a)
{
    return !HAS_LAG && !is_coupled(a);
}

/* Sum the absolute terms of each row at y, with the drag for forward (back = 0) or reverse (back = 1) motion. */
static void sizes_at(const fmu *f, const double y[N_SERIES], int back, double size[N_SERIES])
{
    model_held held;
    double start[N_SERIES], scale[N_SERIES];
    int reverse[N_MONITORED];
    for (int a = 0; a < N_MONITORED; a++) {
        reverse[a] = back;
    }
    model_start(f->now.values, &f->numbers, &held, start, scale);
    model_direct(&f->numbers, reverse, &held);
    model_sizes(&f->numbers, &held, y, size);
}

/* Bound the acceleration of each axis by the present forces and the remaining lags. */
static void strongest(const fmu *f, double C[N_VELOCITIES])
{
    double y[N_SERIES] = {0.0}, size[N_SERIES];
    for (int i = N_VELOCITIES; i < N_USED; i++) { /* the remaining part of a lag has at most the progress 1 */
        y[i] = STRUCTURE.component_of[i] < STRUCTURE.dynamic ? 1.0 : 0.0;
    }
    sizes_at(f, y, 0, size);
    memcpy(C, size, sizeof(double[N_VELOCITIES]));
}

/* Return the acceleration of an axis per load: beta/m. */
static double gain_of(const fmu *f, int a)
{
    double d[N_VARIABLES] = {0.0};
    d[N_COMMANDS + a] = 1.0;
    model_tangent(f->now.values, d);
    return d[FIRST_CALCULATED + a];
}

/* Bound the velocity of each axis within h. Drag only brakes and the coupling does no work, so sqrt(sum M v^2), the root of
 * twice the kinetic energy, grows by at most sqrt(sum F^2/M) per second. */
static void fastest(const fmu *f, double h, double v[N_VELOCITIES])
{
    double C[N_VELOCITIES], energy = 0.0, power = 0.0;
    strongest(f, C);
    for (int a = 0; a < N_VELOCITIES; a++) {
        energy = hypot(energy, f->now.values[FIRST_STATE + a] / sqrt(gain_of(f, a)));
        power = hypot(power, C[a] / sqrt(gain_of(f, a)));
    }
    for (int a = 0; a < N_VELOCITIES; a++) {
        const double alone = fabs(f->now.values[FIRST_STATE + a]) + fabs(C[a]) * h;
        v[a] = is_coupled(a) ? sqrt(gain_of(f, a)) * (energy + power * h) : alone;
    }
}

/* Return the sum of the relative rates at which drag and coupling change velocities up to v. */
static double rates_up_to(const fmu *f, const double v[N_VELOCITIES])
{
    double y[N_SERIES] = {0.0}, size[N_SERIES], still[N_SERIES], rates = 0.0;
    const double rest[N_SERIES] = {0.0};
    memcpy(y, v, sizeof(double[N_VELOCITIES]));
    for (int back = 0; back < 2; back++) {
        sizes_at(f, y, back, size);
        sizes_at(f, rest, back, still);
        for (int a = 0; a < N_VELOCITIES; a++) {
            rates += v[a] > 0.0 ? (size[a] - still[a]) / v[a] : 0.0;
        }
    }
    return rates;
}

/* Return the sum of all relative changes within h. */
static double changes_of(const fmu *f, double h)
{
    double v[N_VELOCITIES], y[N_SERIES] = {0.0}, size[N_SERIES], rates;
    fastest(f, h, v);
    rates = turning_of(v) + rates_up_to(f, v);
    sizes_at(f, y, 0, size);
    for (int i = N_VELOCITIES; i < N_USED; i++) {
        rates += STRUCTURE.component_of[i] < STRUCTURE.dynamic ? size[i] : 0.0; /* rates of the lags */
    }
    return rates * h;
}

/* Return true when a step surely needs few pieces: its relative changes sum to at most 1,000. */
static bool is_calm(const fmu *f, double h)
{
    return h <= 1e30 && changes_of(f, h) <= 1e3;
}

/* ---- Axes alone ---- */

/* Check that the velocity of an uncoupled axis moves towards its equilibrium and not beyond. Without force and drag it is
 * constant to the last bit. */
static void check_velocity(const fmu *start, int a, double v)
{
    const char *const name = VARIABLES[FIRST_STATE + a].name;
    const double v0 = start->now.values[FIRST_STATE + a];
    double marks[N_VELOCITIES][2], y[N_SERIES] = {0.0}, drag[N_SERIES];
    model_alone(start->now.values, &start->numbers, marks);
    const double limit = marks[a][0]; /* V_ss, which is 0 without force, and infinite without drag */
    PROPERTY(isfinite(v), "%s is %g", name, v);
    if (limit == 0.0) {
        y[a] = 1.0;
        sizes_at(start, y, v0 < 0.0, drag);
        PROPERTY(fabs(v) <= fabs(v0) && v * v0 >= 0.0, "%s without force: from %a to %a", name, v0, v);
        PROPERTY(v == v0 || drag[a] > 0.0, "%s without drag: from %a to %a", name, v0, v);
    }
    if (isfinite(limit)) {
        const double rounding = 16.0 * DBL_EPSILON * fmax(fabs(v0), fabs(limit)) + TINY;
        PROPERTY(v >= fmin(v0, limit) - rounding && v <= fmax(v0, limit) + rounding,
                 "%s: from %a to %a, beyond its equilibrium %a", name, v0, v, limit);
    }
}

/* Bound the rounding error of a distance that is covered with the velocity v. */
static double rounding_of_way(double v, double h, double from, double to)
{
    return 64.0 * DBL_EPSILON * (fabs(v) * h + fabs(from) + fabs(to)) + TINY * (1.0 + h);
}

/* Check that a distance lies between those of the lowest and the highest velocity. */
static void check_way(const char *name, double low, double high, double h, double from, double to)
{
    const double rounding = rounding_of_way(fmax(fabs(low), fabs(high)), h, from, to);
    PROPERTY(!isfinite(rounding) || (to - from >= low * h - rounding && to - from <= high * h + rounding),
             "%s goes from %a to %a in %a, at %a to %a", name, from, to, h, low, high);
}

/* Check that the distance through the water is at most that of the highest velocity. */
static void check_track(const double before[], const double after[], double fastest_way, double h)
{
    static const char *const names[] = {"x", "y", "z"}, *const currents[] = {"V_N", "V_E", "V_D"};
    double from = 0.0, to = 0.0, way = 0.0, drift = 0.0;
    for (int i = 0; i < (HAS_ATTITUDE ? 3 : 2); i++) {
        const double start = state_of(before, names[i]), end = state_of(after, names[i]), current = input_of(before, currents[i]);
        from = hypot(from, start);
        to = hypot(to, end);
        way = hypot(way, end - start - current * h);
        drift = hypot(drift, current);
    }
    const double rounding = rounding_of_way(fastest_way, h, from, to) + rounding_of_way(drift, h, 0.0, 0.0);
    PROPERTY(!isfinite(rounding) || way <= fastest_way * h + rounding, "%a at no more than %a for %a", way, fastest_way, h);
}

/* Check that a lagging force approaches its steady value and does not pass it. */
static void check_lag(const fmu *start, const fmu *end)
{
    double before[N_VARIABLES], after[N_VARIABLES];
    memcpy(before, start->now.values, sizeof before);
    memcpy(after, end->now.values, sizeof after);
    memcpy(after, before, N_INPUTS * sizeof after[0]);
    model_calculate(before, &start->numbers, 0.0);
    model_calculate(after, &start->numbers, 0.0);
    for (int i = N_VELOCITIES; i < N_STATES; i++) {
        const char *const name = VARIABLES[FIRST_STATE + i].name;
        if (name[0] == 'F') {
            double d[N_VARIABLES] = {0.0};
            d[FIRST_STATE + i] = 1.0;
            model_tangent(before, d);
            const double from = before[FIRST_STATE + i], to = after[FIRST_STATE + i], rate = -d[FIRST_CALCULATED + i];
            const double steady = from + before[FIRST_CALCULATED + i] / rate;
            const double rounding = 8.0 * DBL_EPSILON * (fabs(from) + fabs(steady));
            PROPERTY(to >= fmin(from, steady) - rounding && to <= fmax(from, steady) + rounding, "%s: from %a to %a, beyond %a",
                     name, from, to, steady);
        }
    }
}

/* Check that the heading that counts turns is that of the attitude, within the 1e-6 rad between its direction and the nose, and of
 * the same turn as the one before it, to within half a turn. */
static void check_heading(const fmu *f, double near)
{
#if HAS_ATTITUDE
    double values[N_VARIABLES];
    memcpy(values, f->now.values, sizeof values);
    model_calculate(values, &f->numbers, f->now.heading);
    const double heading = f->now.heading, beside = values[REF_psi] - heading, size = 1.0 + fabs(near);
    PROPERTY(fabs(sin(0.5 * beside)) * cos(values[REF_theta]) <= 2e-6 + 1e-15 * size, "psi is %a beside %a", values[REF_psi], heading);
    PROPERTY(fabs(beside) <= 0.5 * TURN + 1e-15 * size, "psi is %a beside %a", values[REF_psi], heading);
    PROPERTY(fabs(heading - near) <= 0.5 * TURN + 1e-15 * size, "the heading jumps from %a to %a", near, heading);
#endif
    (void)f, (void)near;
}

/* Check that the quaternion after a step has the length 1, and that the vehicle turned no faster than its angular velocity. */
static void check_attitude(const fmu *start, const fmu *end, double rate, double h)
{
    static const char *const names[] = {"eta", "epsilon_1", "epsilon_2", "epsilon_3"};
    double before = 0.0, after = 0.0, chord = 0.0;
    for (int i = 0; i < 4; i++) {
        before = hypot(before, state_of(start->now.values, names[i]));
        after = hypot(after, state_of(end->now.values, names[i]));
    }
    for (int i = 0; i < 4; i++) {
        chord = hypot(chord, state_of(end->now.values, names[i]) - state_of(start->now.values, names[i]) / before);
    }
    PROPERTY(fabs(after - 1.0) <= 1e-15, "a quaternion of the length %a", after);
    PROPERTY(chord <= 0.5 * rate * h + 1e-12, "a turn of %a, at %a for %a", 2.0 * chord, rate, h);
}

static void check_step_law(const fmu *start, const fmu *end, double h)
{
    if (HAS_DEAD_TIME) { /* the laws know neither commands that act later nor fins */
        return;
    }
    const double *const from = start->now.values, *const to = end->now.values;
    double most[N_VELOCITIES], low[N_VELOCITIES], high[N_VELOCITIES];
    fastest(start, h, most);
    for (int a = 0; a < N_VELOCITIES; a++) {
        const double v0 = from[FIRST_STATE + a], v = to[FIRST_STATE + a];
        const double room = most[a] + 1e-9 * most[a]; /* for the rounding of thousands of pieces */
        if (is_free(a)) {
            check_velocity(start, a, v);
        } else {
            PROPERTY(isfinite(v) && !(fabs(v) > room + DBL_MIN), "%s: from %a to %a, at most %a",
                     VARIABLES[FIRST_STATE + a].name, v0, v, most[a]);
        }
        low[a] = is_free(a) ? fmin(v0, v) : -room;
        high[a] = is_free(a) ? fmax(v0, v) : room;
    }
    if (HAS_LAG) {
        check_lag(start, end);
    }
    if (HAS_ATTITUDE) {
        check_attitude(start, end, turning_of(high), h);
    } else if (named("z", FIRST_STATE, FIRST_CALCULATED) != NONE) {
        check_way("z", of_velocity(low, "w"), of_velocity(high, "w"), h, state_of(from, "z"), state_of(to, "z"));
    }
    if (named("psi", FIRST_STATE, FIRST_CALCULATED) != NONE) {
        check_way("psi", of_velocity(low, "r"), of_velocity(high, "r"), h, state_of(from, "psi"), state_of(to, "psi"));
    }
    if (named("x", FIRST_STATE, FIRST_CALCULATED) != NONE) {
        const double ahead = fmax(fabs(of_velocity(low, "u")), fabs(of_velocity(high, "u")));
        const double aside = fmax(fabs(of_velocity(low, "v")), fabs(of_velocity(high, "v")));
        const double down = HAS_ATTITUDE ? fmax(fabs(of_velocity(low, "w")), fabs(of_velocity(high, "w"))) : 0.0;
        check_track(from, to, hypot(hypot(ahead, aside), down), h);
    }
}

/* ---- One motion, calculated in several ways ---- */

/* Bound the terms that each state consists of within h. */
static void sizes_of(const fmu *f, double h, double size[N_STATES])
{
    const double *const state = f->now.values + FIRST_STATE;
    const double turned = fabs(state_of(f->now.values, "psi"));
    double most[N_VELOCITIES], way = h * (fabs(input_of(f->now.values, "V_N")) + fabs(input_of(f->now.values, "V_E")));
    double calculated[N_VARIABLES];
    memcpy(calculated, f->now.values, sizeof calculated);
    model_calculate(calculated, &f->numbers, 0.0);
    fastest(f, h, most);
    for (int a = 0; a < N_VELOCITIES; a++) {
        size[a] = most[a];
        way += h * most[a];
    }
    for (int i = N_VELOCITIES; i < N_STATES; i++) {
        if (VARIABLES[FIRST_STATE + i].name[0] == 'F') {
            double d[N_VARIABLES] = {0.0};
            d[FIRST_STATE + i] = 1.0;
            model_tangent(f->now.values, d);
            size[i] = 2.0 * fabs(state[i]) + fabs(calculated[FIRST_CALCULATED + i] / d[FIRST_CALCULATED + i]);
        } else {
            size[i] = fabs(state[i]) + way * (1.0 + turned); /* a large heading has fewer digits for its sine */
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

/* True when other commands act at the end of a step than at its start, for which the sizes below do not allow. */
static bool commands_arrived(const fmu *start, const fmu *end)
{
    bool arrived = false;
#if HAS_DEAD_TIME
    for (int i = FIRST_DELAYED; i < FIRST_DELAYED + N_COMMANDS; i++) {
        arrived |= start->now.values[i] != end->now.values[i];
    }
#endif
    (void)start, (void)end;
    return arrived;
}

/* Check that a step ends where its parts end. */
static void check_parts(const fmu *start, const fmu *end, double h, int parts)
{
    double values[N_VARIABLES], heading = start->now.heading;
    delay_line line = start->now.line;
    memcpy(values, start->now.values, sizeof values);
    if (commands_arrived(start, end) || !(changes_of(start, h) <= 1.0) || h / parts < DBL_MIN) { /* rounding may grow; a subnormal length cannot be divided */
        return;
    }
    for (int i = 0; i < parts; i++) {
        double next[N_STATES];
        const double from = start->now.time + i * (h / parts);
        PROPERTY(delayed_step(values, &start->numbers, &line, from, h / parts, next, &heading) > 0,
                 "a part of a step takes too many pieces");
        memcpy(values + FIRST_STATE, next, sizeof next);
        delay_commit(values, &line, from, h / parts);
    }
    check_same("a step and its parts", start, h, end->now.values + FIRST_STATE, values + FIRST_STATE, 1e-9);
}

/* Check a step from t with the inputs held. */
static void check_whole_step(const fmu *start, const fmu *end, double t, double h)
{
    check_step_law(start, end, h);
    check_parts(start, end, h, 3);
    PROPERTY(end->now.time == t + h, "a step to t = %a ends at %a", t + h, end->now.time);
}

/* Check that the first time derivative of a state is that of the model. */
static void check_first_derivative(fmu *f, unsigned state, double derivative)
{
    const unsigned vr = FIRST_REFERENCE + FIRST_CALCULATED + state;
    double rate, size[N_STATES];
    PROPERTY(FMI(GetReal)(f, &vr, 1, &rate AND(1)) == 0, "a derivative cannot be read");
    sizes_of(f, 1.0, size);
    PROPERTY(!(fabs(derivative - rate) > 1e-12 * (1.0 + changes_of(f, 1.0)) * size[state]), "der(%s) = %a and %a",
             VARIABLES[FIRST_STATE + state].name, derivative, rate);
}

#endif

/* Check the numbers and the mode of an instance, that its inputs are within their ranges, and that its states and thrusts can be
 * read and are finite. */
static void check_instance(const slot *s)
{
    enum { ADDED = N_STATES + N_OTHER, ALL = ADDED + N_ADDED };
    unsigned vr[ALL];
    double values[ALL];
    for (unsigned i = 0; i < ALL; i++) {
        vr[i] = FIRST_REFERENCE + i + (i < N_STATES ? FIRST_STATE : i < ADDED ? FIRST_CALCULATED : FIRST_ADDED - ADDED);
    }
    if (s->f == NULL) {
        return;
    }
    model_numbers numbers;
    model_prepare(s->f->now.values, &numbers);
    PROPERTY(memcmp(&numbers, &s->f->numbers, sizeof numbers) == 0, "the numbers are those of other coefficients");
    PROPERTY(s->f->now.mode == s->at.mode && s->f->now.type == s->at.type, "in %s instead of %s",
             mode_name(s->f->now.mode), mode_name(s->at.mode));
    for (unsigned i = 0; i < N_INPUTS; i++) {
        const double value = s->f->now.values[i];
        const bool is_silent = i < N_COMMANDS && value == 0.0; /* a pulse of 0 means that there is no signal */
        PROPERTY(is_silent || (value >= VARIABLES[i].minimum && value <= VARIABLES[i].maximum), "%s = %g", VARIABLES[i].name, value);
    }
    const unsigned n = is_moderate(s->f) ? ALL : MAY_OVERFLOW ? N_STATES : ADDED; /* others may overflow */
    before_call();
    PROPERTY(FMI(GetReal)(s->f, vr, n, values AND(n)) == 0, "the outputs cannot be read");
    PROPERTY(is_same(s, true), "to read changes the instance");
    for (unsigned i = 0; i < n; i++) {
        PROPERTY(isfinite(values[i]), "%s = %g", VARIABLES[place_of(vr[i])].name, values[i]);
    }
}
