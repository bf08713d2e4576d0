/* What holds whatever was called: finite outputs, and motion that obeys its equation. */
#pragma once

#include "world.h"

/* Where drag balances the force. */
static double equilibrium(const riccati *axis)
{
    const double root = hypot(axis->B, 2.0 * sqrt(axis->A) * sqrt(fabs(axis->C)));
    return axis->C == 0.0 ? 0.0 : 2.0 * axis->C / (axis->B + root);
}

/* A velocity has gone from where it was towards its equilibrium and not beyond; without force, to the last bit. */
static void check_velocity(const char *name, const riccati *axis, double v0, double v)
{
    const double limit = equilibrium(axis);
    PROPERTY(isfinite(v), "%s is %g", name, v);
    if (axis->C == 0.0) {
        PROPERTY(fabs(v) <= fabs(v0) && v * v0 >= 0.0, "%s without force: from %a to %a", name, v0, v);
        PROPERTY(v == v0 || axis->A > 0.0 || axis->B > 0.0, "%s without drag: from %a to %a", name, v0, v);
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

/* A velocity that only rises or only falls covers no less than the lower of its ends would, no more than the higher. */
static void check_way(const char *name, double v0, double v, double h, double from, double to)
{
    const double low = fmin(v0, v) * h, high = fmax(v0, v) * h;
    const double rounding = rounding_of_way(fmax(fabs(v0), fabs(v)), h, from, to);
    PROPERTY(!isfinite(rounding) || (to - from >= low - rounding && to - from <= high + rounding),
             "%s goes from %a to %a in %a, at %a to %a", name, from, to, h, v0, v);
}

/* A turn does not make the way longer. */
static void check_track(const rov_inputs *in, const rov_state *from, const rov_state *to, double h)
{
    const double fastest = fmax(fabs(from->u), fabs(to->u));
    const double north = in->V_N * h, east = in->V_E * h;
    const double way = hypot(to->x - from->x - north, to->y - from->y - east);
    const double rounding = rounding_of_way(fastest, h, hypot(from->x, from->y), hypot(to->x, to->y))
                            + rounding_of_way(hypot(in->V_N, in->V_E), h, 0.0, 0.0);
    PROPERTY(!isfinite(rounding) || way <= fastest * h + rounding, "%a at no more than %a for %a", way, fastest, h);
}

static void check_step(const fmu *start, const fmu *end, double h)
{
    const rov_variables *const v = &start->now.values.named;
    const rov_gains forced = rov_axes(&v->coefficients, &start->gains, &v->inputs);
    const rov_state *const from = &v->state, *const to = &end->now.values.named.state;
    check_velocity("u", &forced.surge, from->u, to->u);
    check_velocity("w", &forced.heave, from->w, to->w);
    check_velocity("r", &forced.yaw, from->r, to->r);
    check_way("z", from->w, to->w, h, from->z, to->z);
    check_way("psi", from->r, to->r, h, from->psi, to->psi);
    check_track(&v->inputs, from, to, h);
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
