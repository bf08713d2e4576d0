/* The ROV: thrust, surge, heave, yaw and pose, stepped exactly. The same formulas as rov_fmu/motion/rov.py.
 * Units, signs and the structs (generated into model.h) are those of that module. No state, no allocation. */
#include "model.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

/* What a step needs of the coefficients. */
typedef struct {
    riccati surge, heave, yaw;               /* A and B; C is the force of the moment */
    double surge_gain, heave_gain, yaw_gain; /* beta/m, acceleration per force */
    double arm;                              /* R sin(gamma), torque per difference of rear thrust */
} rov_gains;

enum {
    ORDER = 8,           /* terms of the expansion at the ends of a fast turn */
    MOST_PIECES = 100000 /* of a part of a turn: 12,900 seen on the way from 1e30 rad/s to 1e-28 rad/s */
};

static const double FULL_TURN = 6.283185307179586;

typedef struct {
    double ahead, aside;
} planar;

static double saturate(double command)
{
    return fmax(-1.0, fmin(1.0, command));
}

static double thruster_force(double a_t, double b_t, double command)
{
    const double c = saturate(command);
    return (a_t * fabs(c) + b_t) * c;
}

static void rov_prepare(const rov_coefficients *k, rov_gains *gains)
{
    const double surge = k->beta_u / k->m_rov, heave = k->beta_w / k->m_rov, yaw = k->beta_r / k->I_r;
    *gains = (rov_gains){
        .surge = {surge * k->a_d_u, surge * k->b_d_u, 0.0},
        .heave = {heave * k->a_d_w, heave * k->b_d_w, 0.0},
        .yaw = {yaw * k->a_d_r, yaw * k->b_d_r, 0.0},
        .surge_gain = surge,
        .heave_gain = heave,
        .yaw_gain = yaw,
        .arm = k->R * sin(k->gamma),
    };
}

/* Thrust of the commands, saturated to -1 ... 1. */
static void rov_thrust_of(const rov_coefficients *k, const rov_gains *gains, const rov_inputs *in, rov_thrust *F)
{
    F->F_l = 0.5 * thruster_force(k->a_t_rear, k->b_t_rear, in->u_l);
    F->F_r = 0.5 * thruster_force(k->a_t_rear, k->b_t_rear, in->u_r);
    F->F_t = thruster_force(k->a_t_top, k->b_t_top, in->u_t);
    F->tau_rear = gains->arm * (F->F_l - F->F_r);
}

/* The three axes with the forces of the moment, (18). */
static rov_gains rov_axes(const rov_coefficients *k, const rov_gains *gains, const rov_inputs *in)
{
    rov_gains now = *gains;
    rov_thrust F;
    rov_thrust_of(k, gains, in, &F);
    now.surge.C = gains->surge_gain * (k->alpha_u * (F.F_l + F.F_r) + in->X_ext);
    now.heave.C = gains->heave_gain * (k->alpha_w * F.F_t + in->Z_ext);
    now.yaw.C = gains->yaw_gain * (k->alpha_r * F.tau_rear + in->N_ext);
    return now;
}

/* Time derivatives of the state. */
static void rov_derivatives(const rov_coefficients *k, const rov_gains *gains, const rov_inputs *in,
                            const rov_state *s, rov_state *rate)
{
    const rov_gains now = rov_axes(k, gains, in);
    *rate = (rov_state){
        .u = riccati_acceleration(&now.surge, s->u),
        .w = riccati_acceleration(&now.heave, s->w),
        .r = riccati_acceleration(&now.yaw, s->r),
        .x = s->u * cos(s->psi) + in->V_N,
        .y = s->u * sin(s->psi) + in->V_E,
        .z = s->w,
        .psi = s->r,
    };
}

/* v is the steady velocity, up to rounding; that of a subnormal v is told at 2^1000 times its size, where it is fast. */
static bool settled(const riccati *axis, double v)
{
    const double rate = fabs(riccati_acceleration(axis, v));
    return rate <= 16.0 * DBL_EPSILON * fabs(axis->C)
           || 0x1p1000 * rate <= 0x1p-72 * (1.0 + axis->B + 2.0 * axis->A * fabs(v));
}

/* How fast the velocity bends (1/s): its solution is analytic within 2/rate. */
static double bending_rate(const riccati *axis, double v)
{
    return settled(axis, v) ? 0.0 : axis->B + 2.0 * axis->A * fabs(v) + 2.0 * sqrt(axis->A * fabs(axis->C));
}

/* How fast the direction changes (rad/s): by the turn rate, and by its growth from rest, turn ~ r' t^2/2. */
static double turning_rate(const riccati *yaw, double r)
{
    return fabs(r) + (settled(yaw, r) ? 0.0 : 2.0 * sqrt(fabs(riccati_acceleration(yaw, r))));
}

static planar rotated(planar p, double turn)
{
    const double c = cos(turn), d = sin(turn);
    return (planar){p.ahead * c - p.aside * d, p.ahead * d + p.aside * c};
}

/* The integral of u e^(i turn) over one panel by Gauss-Legendre quadrature. */
static planar panel_integral(const rov_gains *now, double u, double r, double h, bool is_short)
{
    /* positive nodes and weights on [-1, 1]: of four nodes, of eight nodes */
    static const double rule[][2] = {
        {0.33998104358485626, 0.6521451548625461}, {0.8611363115940526, 0.34785484513745385},
        {0.18343464249564980, 0.36268378337836198}, {0.52553240991632899, 0.31370664587788729},
        {0.79666647741362674, 0.22238103445337447}, {0.96028985649753623, 0.10122853629037626}};
    const double half = 0.5 * h;
    planar sum = {0.0, 0.0};
    for (int n = is_short ? 0 : 2, end = is_short ? 2 : 6; n < end; n++) {
        for (int side = -1; side <= 1; side += 2) {
            const double t = half + side * half * rule[n][0];
            const double distance = half * rule[n][1] * riccati_velocity(&now->surge, u, t);
            const double angle = riccati_distance(&now->yaw, r, t);
            sum.ahead += distance * cos(angle);
            sum.aside += distance * sin(angle);
        }
    }
    return sum;
}

/* Quadratic drag with the sign that it has in the direction of v, or of the start from rest. */
static double signed_drag(const riccati *axis, double v)
{
    return v > 0.0 || (v == 0.0 && axis->C >= 0.0) ? axis->A : -axis->A;
}

/* Taylor coefficients of v by rate t, from v' = C - B v - A v^2; a settled axis is constant. */
static void taylor(const riccati *axis, double A, double v, double rate, double c[ORDER + 1])
{
    const bool constant = settled(axis, v);
    const double a = A / rate, b = axis->B / rate;
    c[0] = v;
    for (int n = 0; n < ORDER; n++) {
        double change = (n == 0 ? axis->C / rate : 0.0) - b * c[n];
        for (int j = 0; j <= n; j++) {
            change -= a * c[j] * c[n - j];
        }
        c[n + 1] = constant ? 0.0 : change / (n + 1);
    }
}

/* The radius of the turn g = u/r and its derivatives by the heading, d/d(heading) = (1/r) d/dt; false where they do
 * not fall off. Two orders are looked at, for at rest every other one vanishes. Time is counted in radians at the turn
 * rate of the start, in which no coefficient overflows that matters. */
static bool radius_derivatives(const rov_gains *now, const double drag[2], double u, double r, double g[ORDER + 1])
{
    if (!(fabs(r) > fmax(bending_rate(&now->surge, u), bending_rate(&now->yaw, r)))) {
        return false;
    }
    double series[ORDER + 1], turning[ORDER + 1], largest = 0.0;
    taylor(&now->surge, drag[0], u, r, series);
    taylor(&now->yaw, drag[1], r, r, turning);
    for (int n = 0; n <= ORDER; n++) {
        turning[n] /= r;
    }
    for (int k = 0; k <= ORDER; k++) {
        for (int n = 0; n <= ORDER - k; n++) { /* series / turning, in place */
            for (int j = 0; j < n; j++) {
                series[n] -= series[j] * turning[n - j];
            }
        }
        g[k] = series[0] / r;
        largest = fmax(largest, fabs(g[k]));
        for (int n = 0; n < ORDER - k; n++) {
            series[n] = (n + 1) * series[n + 1];
        }
    }
    return isfinite(largest) && fabs(g[ORDER]) <= DBL_EPSILON * largest && fabs(g[ORDER - 1]) <= DBL_EPSILON * largest;
}

/* The antiderivative of u e^(i turn) by parts over the heading: e^(i turn) (-i g + g' + i g'' - g''' - ...). */
static planar by_parts(const double g[ORDER + 1], double turn)
{
    planar p = {0.0, 0.0};
    for (int n = 0; n < ORDER; n += 4) {
        p.aside += g[n + 2] - g[n];
        p.ahead += g[n + 1] - g[n + 3];
    }
    return rotated(p, turn);
}

/* A time in which the turn rate keeps half of its size: what slows it down is strongest at the start. */
static double slowing_time(const riccati *yaw, double r)
{
    const double rate = riccati_acceleration(yaw, r);
    return settled(yaw, r) || (r > 0.0) == (rate > 0.0) ? INFINITY : 0.5 * fabs(r / rate);
}

/* The integral of u e^(i turn) over the start of the remaining time that one formula covers; its length in *length.
 * Two good ends vouch for what lies between them only if the turn does not slow down much. */
static planar longest_piece(const rov_gains *now, double u, double r, double rest, double *length)
{
    const double bending = fmax(bending_rate(&now->surge, u), bending_rate(&now->yaw, r));
    const double turning = turning_rate(&now->yaw, r);
    const double panel = fmin(1.0 / bending, 2.0 / turning);
    const double drag[2] = {signed_drag(&now->surge, u), signed_drag(&now->yaw, r)};
    double at_start[ORDER + 1], at_end[ORDER + 1];
    if (panel < rest && radius_derivatives(now, drag, u, r, at_start)) {
        for (double t = fmin(rest, slowing_time(&now->yaw, r)); t > panel; t *= 0.25) {
            const double u_end = riccati_velocity(&now->surge, u, t), r_end = riccati_velocity(&now->yaw, r, t);
            if (radius_derivatives(now, drag, u_end, r_end, at_end)) {
                const planar a = by_parts(at_start, 0.0), b = by_parts(at_end, riccati_distance(&now->yaw, r, t));
                *length = t;
                return (planar){b.ahead - a.ahead, b.aside - a.aside};
            }
        }
    }
    *length = fmin(rest, panel);
    return panel_integral(now, u, r, *length, *length * bending < 0.08 && *length * turning < 0.14);
}

/* A part of a step in which surge and yaw keep their signs: the distance covered ahead and to starboard of the heading at
 * the start is added to *sum; u, r and the turn so far are moved to the end. Straight runs are exact; where the vehicle
 * turns fast against the changes of velocity, the two ends are enough; the rest is cut into Gauss-Legendre panels. */
static void planar_leg(const rov_gains *now, double *u, double *r, double *turn, double rest, planar *sum)
{
    double u_at = *u, r_at = *r, turned = *turn, left, angle, gone;
    riccati_advance(&now->surge, u_at, rest, u, &left);
    riccati_advance(&now->yaw, r_at, rest, r, &angle);
    *turn += angle;
    for (int pieces = 0; isfinite(left) && isfinite(angle) && pieces < MOST_PIECES; pieces++) {
        double length = rest;
        planar piece = {left, 0.0};
        if (fabs(angle) >= DBL_EPSILON / 4.0 && fabs(left) > DBL_EPSILON / 16.0 * (fabs(sum->ahead) + fabs(sum->aside))) {
            piece = longest_piece(now, u_at, r_at, rest, &length);
        }
        piece = rotated(piece, turned);
        sum->ahead += piece.ahead;
        sum->aside += piece.aside;
        if (length == rest) {
            return;
        }
        rest -= length;
        u_at = riccati_velocity(&now->surge, u_at, length);
        riccati_advance(&now->yaw, r_at, length, &r_at, &gone);
        turned = remainder(turned + gone, FULL_TURN); /* rounded as a small angle */
        left = riccati_distance(&now->surge, u_at, rest);
        angle = riccati_distance(&now->yaw, r_at, rest);
    }
    sum->ahead = NAN; /* it overflows */
}

/* The state after h > 0 seconds with the inputs held. Not finite only where a result overflows. */
static void rov_step(const rov_coefficients *k, const rov_gains *gains, const rov_inputs *in,
                     const rov_state *s, double h, rov_state *next)
{
    const rov_gains now = rov_axes(k, gains, in);
    planar sum = {0.0, 0.0};
    double u, w, r = s->r, depth, turn = 0.0;
    if (r == 0.0 && now.yaw.C == 0.0) {
        riccati_advance(&now.surge, s->u, h, &u, &sum.ahead);
    } else {
        const double surge_turns = riccati_turning_time(&now.surge, s->u), yaw_turns = riccati_turning_time(&now.yaw, r);
        const double ends[] = {fmin(h, fmin(surge_turns, yaw_turns)), fmin(h, fmax(surge_turns, yaw_turns)), h};
        double start = 0.0;
        u = s->u;
        for (int i = 0; i < 3; start = ends[i++]) {
            if (ends[i] > start) {
                planar_leg(&now, &u, &r, &turn, ends[i] - start, &sum);
            }
            /* at rest to the last digit, or what follows would take the branch of before the turn */
            u = ends[i] == surge_turns ? 0.0 : u;
            r = ends[i] == yaw_turns ? 0.0 : r;
        }
    }
    riccati_advance(&now.heave, s->w, h, &w, &depth);
    sum = rotated(sum, s->psi);
    *next = (rov_state){
        .u = u,
        .w = w,
        .r = r,
        .x = s->x + sum.ahead + in->V_N * h,
        .y = s->y + sum.aside + in->V_E * h,
        .z = s->z + depth,
        .psi = s->psi + turn,
    };
}

/* Change of a thruster's force for a change dc of its command and of its coefficients. */
static double thruster_tangent(double a_t, double b_t, double command, double da_t, double db_t, double dc)
{
    const double c = saturate(command);
    return (da_t * fabs(c) + db_t) * c + (fabs(command) <= 1.0 ? (2.0 * a_t * fabs(c) + b_t) * dc : 0.0);
}

/* Change of v' = (beta/m) (force - a_d |v| v - b_d v). */
static double axis_tangent(double m, double beta, double a_d, double b_d, double force, double v,
                           double dm, double dbeta, double da_d, double db_d, double dforce, double dv)
{
    const double balance = force - (a_d * fabs(v) + b_d) * v;
    const double dbalance = dforce - (da_d * fabs(v) + db_d) * v - (2.0 * a_d * fabs(v) + b_d) * dv;
    return ((dbeta - beta / m * dm) * balance + beta * dbalance) / m;
}

/* Directional derivative: for the changes d of inputs, state and coefficients, those of thrust and state derivatives
 * are written into d. At a command of exactly +-1 the derivative is that of the inside. */
static void rov_tangent(const rov_variables *at, rov_variables *d)
{
    const rov_coefficients *k = &at->coefficients, *dk = &d->coefficients;
    const rov_inputs *in = &at->inputs, *di = &d->inputs;
    const rov_state *s = &at->state, *ds = &d->state;
    rov_gains gains;
    rov_thrust F;
    rov_prepare(k, &gains);
    rov_thrust_of(k, &gains, in, &F);
    rov_thrust *dF = &d->thrust;
    dF->F_l = 0.5 * thruster_tangent(k->a_t_rear, k->b_t_rear, in->u_l, dk->a_t_rear, dk->b_t_rear, di->u_l);
    dF->F_r = 0.5 * thruster_tangent(k->a_t_rear, k->b_t_rear, in->u_r, dk->a_t_rear, dk->b_t_rear, di->u_r);
    dF->F_t = thruster_tangent(k->a_t_top, k->b_t_top, in->u_t, dk->a_t_top, dk->b_t_top, di->u_t);
    dF->tau_rear = gains.arm * (dF->F_l - dF->F_r)
                   + (dk->R * sin(k->gamma) + k->R * cos(k->gamma) * dk->gamma) * (F.F_l - F.F_r);
    d->derivative = (rov_state){
        .u = axis_tangent(k->m_rov, k->beta_u, k->a_d_u, k->b_d_u, k->alpha_u * (F.F_l + F.F_r) + in->X_ext, s->u,
                          dk->m_rov, dk->beta_u, dk->a_d_u, dk->b_d_u,
                          dk->alpha_u * (F.F_l + F.F_r) + k->alpha_u * (dF->F_l + dF->F_r) + di->X_ext, ds->u),
        .w = axis_tangent(k->m_rov, k->beta_w, k->a_d_w, k->b_d_w, k->alpha_w * F.F_t + in->Z_ext, s->w,
                          dk->m_rov, dk->beta_w, dk->a_d_w, dk->b_d_w,
                          dk->alpha_w * F.F_t + k->alpha_w * dF->F_t + di->Z_ext, ds->w),
        .r = axis_tangent(k->I_r, k->beta_r, k->a_d_r, k->b_d_r, k->alpha_r * F.tau_rear + in->N_ext, s->r,
                          dk->I_r, dk->beta_r, dk->a_d_r, dk->b_d_r,
                          dk->alpha_r * F.tau_rear + k->alpha_r * dF->tau_rear + di->N_ext, ds->r),
        .x = ds->u * cos(s->psi) - s->u * sin(s->psi) * ds->psi + di->V_N,
        .y = ds->u * sin(s->psi) + s->u * cos(s->psi) * ds->psi + di->V_E,
        .z = ds->w,
        .psi = ds->r,
    };
}
