/* What holds whatever was called: finite outputs, and motion that obeys its equation. */
#pragma once

#include "world.h"

enum { N_AXES = 3 };

/* The axes with the forces of the moment, the state, and the step that is asked for. */
typedef struct {
    riccati axis[N_AXES];
    rov_state state;
    double h, end;
} start_of_step;

static start_of_step start_of(const fmu *f, double h, double end)
{
    const rov_variables *const v = &f->now.values.named;
    const rov_gains now = rov_axes(&v->coefficients, &f->gains, &v->inputs);
    return (start_of_step){{now.surge, now.heave, now.yaw}, v->state, h, end};
}

/* Where drag balances the force. */
static double equilibrium(const riccati *axis)
{
    const double root = hypot(axis->B, 2.0 * sqrt(axis->A) * sqrt(fabs(axis->C)));
    return axis->C == 0.0 ? 0.0 : 2.0 * axis->C / (axis->B + root);
}

/* Each velocity has gone from where it was towards its equilibrium and not beyond; without force, to the last bit. */
static void check_velocities(const start_of_step *start, const rov_state *after)
{
    const double from[N_AXES] = {start->state.u, start->state.w, start->state.r};
    const double to[N_AXES] = {after->u, after->w, after->r};
    for (int i = 0; i < N_AXES; i++) {
        const riccati *const axis = &start->axis[i];
        const double v0 = from[i], v = to[i], limit = equilibrium(axis);
        PROPERTY(isfinite(v), "axis %d moves at %g", i, v);
        if (axis->C == 0.0) {
            PROPERTY(fabs(v) <= fabs(v0) && v * v0 >= 0.0, "axis %d without force: from %a to %a", i, v0, v);
            PROPERTY(v == v0 || axis->A > 0.0 || axis->B > 0.0, "axis %d without drag: from %a to %a", i, v0, v);
        }
        if (isfinite(limit)) {
            const double rounding = 8.0 * DBL_EPSILON * fmax(fabs(v0), fabs(limit)) + DBL_MIN;
            PROPERTY(v >= fmin(v0, limit) - rounding && v <= fmax(v0, limit) + rounding,
                     "axis %d: from %a to %a, beyond its equilibrium %a", i, v0, v, limit);
        }
    }
}

/* What rounding may add to a distance that v covers from one place to another. */
static double rounding_of_way(double v, double h, double from, double to)
{
    return 64.0 * DBL_EPSILON * (fabs(v) * h + fabs(from) + fabs(to)) + DBL_MIN * (1.0 + h);
}

/* A velocity that only rises or only falls covers no less than the lower of its ends would, no more than the higher. */
static void check_way(const char *name, double v0, double v, double h, double from, double to)
{
    const double low = fmin(v0, v) * h, high = fmax(v0, v) * h;
    const double rounding = rounding_of_way(fmax(fabs(v0), fabs(v)), h, from, to);
    PROPERTY(!isfinite(rounding) || (to - from >= low - rounding && to - from <= high + rounding),
             "%s goes from %a to %a in %a, at %a to %a", name, from, to, h, v0, v);
}

/* A turn does not make the way longer. */
static void check_track(const start_of_step *start, const rov_inputs *in, const rov_state *to)
{
    const rov_state *const from = &start->state;
    const double h = start->h, fastest = fmax(fabs(from->u), fabs(to->u));
    const double north = in->V_N * h, east = in->V_E * h;
    const double way = hypot(to->x - from->x - north, to->y - from->y - east);
    const double rounding = rounding_of_way(fastest, h, hypot(from->x, from->y), hypot(to->x, to->y))
                            + rounding_of_way(hypot(in->V_N, in->V_E), h, 0.0, 0.0);
    PROPERTY(!isfinite(rounding) || way <= fastest * h + rounding, "%a at no more than %a for %a", way, fastest, h);
}

static void check_step(const fmu *f, const start_of_step *start)
{
    const rov_variables *const now = &f->now.values.named;
    const rov_state *const from = &start->state, *const to = &now->state;
    check_velocities(start, to);
    check_way("z", from->w, to->w, start->h, from->z, to->z);
    check_way("psi", from->r, to->r, start->h, from->psi, to->psi);
    check_track(start, &now->inputs, to);
    PROPERTY(f->now.time == start->end, "a step to t = %a ends at %a", start->end, f->now.time);
}

/* The gains and the mode are the expected ones; states and thrust can be read and are finite. */
static void check_instance(const slot *s)
{
    enum { N_THRUST = sizeof(rov_thrust) / sizeof(double) };
    fmi2ValueReference vr[N_STATES + N_THRUST];
    double values[N_STATES + N_THRUST];
    for (unsigned i = 0; i < N_STATES + N_THRUST; i++) {
        vr[i] = FIRST_STATE + i + (i < N_STATES ? 0 : N_STATES);
    }
    if (s->f == NULL) {
        return;
    }
    rov_gains gains;
    rov_prepare(&s->f->now.values.named.coefficients, &gains);
    PROPERTY(memcmp(&gains, &s->f->gains, sizeof gains) == 0, "the gains are those of other coefficients");
    PROPERTY(s->f->now.mode == s->at.mode && s->f->now.type == s->at.type, "in %s instead of %s",
             mode_name(s->f->now.mode), mode_name(s->at.mode));
    before_call();
    PROPERTY(fmi2GetReal(s->f, vr, N_STATES + N_THRUST, values) == fmi2OK, "the outputs cannot be read");
    PROPERTY(is_same(s, true), "to read changes the instance");
    for (int i = 0; i < N_STATES + N_THRUST; i++) {
        PROPERTY(isfinite(values[i]), "%s = %g", VARIABLES[vr[i]].name, values[i]);
    }
}
