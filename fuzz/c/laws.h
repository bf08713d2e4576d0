/* What holds whatever was called: finite outputs, and motion that obeys its equation. */
#ifndef LAWS_H
#define LAWS_H

#include "world.h"

enum { N_AXES = 3 };

/* The axes with the forces of the moment, and their velocities. */
typedef struct {
    riccati axis[N_AXES];
    double v[N_AXES];
} axes_before;

static axes_before axes_of(const fmu *f)
{
    const rov_variables *const v = &f->now.values.named;
    const rov_gains now = rov_axes(&v->coefficients, &f->gains, &v->inputs);
    return (axes_before){{now.surge, now.heave, now.yaw}, {v->state.u, v->state.w, v->state.r}};
}

/* Where drag balances the force. */
static double equilibrium(const riccati *axis)
{
    const double root = hypot(axis->B, 2.0 * sqrt(axis->A) * sqrt(fabs(axis->C)));
    return axis->C == 0.0 ? 0.0 : 2.0 * axis->C / (axis->B + root);
}

/* Each velocity has gone from where it was towards its equilibrium and not beyond; without force, to the last bit. */
static void check_step(const fmu *f, const axes_before *before, double end)
{
    const rov_state *const state = &f->now.values.named.state;
    const double after[N_AXES] = {state->u, state->w, state->r};
    for (int i = 0; i < N_AXES; i++) {
        const riccati *const axis = &before->axis[i];
        const double v0 = before->v[i], v = after[i], limit = equilibrium(axis);
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
    PROPERTY(f->now.time == end, "a step to t = %a ends at %a", end, f->now.time);
}

/* What a step uses belongs to the coefficients of now. */
static void check_gains(const fmu *f)
{
    rov_gains gains;
    rov_prepare(&f->now.values.named.coefficients, &gains);
    PROPERTY(memcmp(&gains, &f->gains, sizeof gains) == 0, "the gains are those of other coefficients");
}

/* The mode is the expected one; states and thrust can be read, wherever values can be, and are finite. */
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
    check_gains(s->f);
    PROPERTY(s->f->now.mode == s->at.mode && s->f->now.type == s->at.type, "in %s instead of %s",
             mode_name(s->f->now.mode), mode_name(s->at.mode));
    if (s->at.mode == INSTANTIATED) {
        return;
    }
    PROPERTY(fmi2GetReal(s->f, vr, N_STATES + N_THRUST, values) == fmi2OK, "the outputs cannot be read");
    for (int i = 0; i < N_STATES + N_THRUST; i++) {
        PROPERTY(isfinite(values[i]), "%s = %g", VARIABLES[vr[i]].name, values[i]);
    }
}

#endif
