/* The ROV as tables (model.h) and numbers: thrust, derivatives, tangents. The numbers in brackets are
 * the paper's equations. Units are SI, signs those of Fossen and SNAME, z down. No state, no allocation.
 *
 * `at` holds all variables by place, `state` and `rate` the states in their order. */
#include "model.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

enum {
    IS_FREE = !IS_COUPLED && N_LAGGING == 0, /* every axis has a closed form */
    WIDTH = N_AXES == 1 ? 2 : 4,             /* lanes for the axes: even, as processors multiply pairs */
    U = SURGE == NONE ? N_AXES : SURGE,      /* an axis that is not there is a lane at rest */
    V = SWAY == NONE ? N_AXES : SWAY,
    R = YAW == NONE ? N_AXES : YAW
};

/* What a step needs of the coefficients. */
typedef struct {
    riccati axis[WIDTH];              /* A and B; C is the force of the moment */
    double gain[N_AXES];              /* beta/m, acceleration per load */
    double push[N_THRUSTERS][N_AXES]; /* acceleration per newton of a thruster, tuned by alpha */
    double torque[N_THRUSTERS];       /* about z per newton, (4), before the tuning */
    double rate[N_CURVES];            /* 1/T of the lag */
    double c_u, c_v, c_r;             /* coupling: M_v/M_u, M_u/M_v, (M_v - M_u)/M_r */
} rov_gains;

/* What drives the vehicle. */
typedef struct {
    double C[WIDTH];            /* acceleration by the thrust of now and the loads */
    double F[N_THRUSTERS];      /* that thrust */
    double steady[N_THRUSTERS]; /* what the commands lead to */
    double north, east;         /* current */
} rov_held;

/* A variable; 0 where the vehicle does not have it. */
static inline double rov_value(const double at[], int reference)
{
    return reference == NONE ? 0.0 : at[reference];
}

static inline double rov_saturated(double command)
{
    return command > 1.0 ? 1.0 : command < -1.0 ? -1.0 : command;
}

static inline double rov_inertia(const double at[], int a)
{
    return at[AXES[a].inertia] + rov_value(at, AXES[a].added);
}

/* Force along an axis, or torque, per newton of a thruster, (4). */
static inline double rov_effect(const double at[], int t, int a)
{
    const bool by_arm = a == YAW && THRUSTERS[t].by_arm;
    return THRUSTERS[t].effect[a] * (by_arm ? rov_value(at, MAYBE_R) * sin(rov_value(at, MAYBE_gamma)) : 1.0);
}

static void rov_prepare(const double at[], rov_gains *gains)
{
    memset(gains, 0, sizeof *gains);
    for (int a = 0; a < N_AXES; a++) {
        const double gain = at[AXES[a].beta] / rov_inertia(at, a);
        gains->gain[a] = gain;
        for (int back = 0; back < 2; back++) {
            gains->axis[a].A[back] = gain * at[AXES[a].a_d[back]];
            gains->axis[a].B[back] = gain * at[AXES[a].b_d[back]];
        }
        for (int t = 0; t < N_THRUSTERS; t++) {
            const double effect = rov_effect(at, t, a);
            gains->push[t][a] = gain * (at[AXES[a].alpha] * effect);
            if (a == YAW) {
                gains->torque[t] = effect;
            }
        }
    }
    for (int c = 0; c < N_CURVES; c++) {
        gains->rate[c] = CURVES[c].lag == NONE ? 0.0 : 1.0 / rov_value(at, CURVES[c].lag);
    }
    if (IS_COUPLED) {
        gains->c_u = gains->gain[U] / gains->gain[V];
        gains->c_v = gains->gain[V] / gains->gain[U];
        gains->c_r = gains->gain[R] / gains->gain[V] - gains->gain[R] / gains->gain[U];
    }
}

/* ---- Thrust ---- */

/* Command of a thruster, -1 ... 1: each input saturates, and so does what is mixed of them. */
static inline double rov_command(const double at[], int t)
{
    double sum = 0.0;
    for (int d = 0; d < N_DRIVERS; d++) {
        sum += THRUSTERS[t].gain[d] * rov_saturated(at[THRUSTERS[t].command[d]]);
    }
    return rov_saturated(sum);
}

/* Steady thrust (2), (9), (10): a_t m^2 + b_t m, m beyond the dead band, of the direction's curve. */
static inline double rov_steady(const double at[], int t)
{
    const curve_info *const curve = &CURVES[THRUSTERS[t].curve];
    const double c = rov_command(at, t);
    const bool back = c < 0.0;
    const double m = fmax(0.0, fabs(c) - rov_value(at, back ? curve->c_0[1] : curve->c_0[0]));
    const double a_t = at[back ? curve->a_t[1] : curve->a_t[0]], b_t = at[back ? curve->b_t[1] : curve->b_t[0]];
    const double F = (a_t * m + b_t) * m * curve->share;
    return (back ? -F : F) + 0.0; /* no negative zero */
}

static inline bool rov_lags(int t)
{
    return N_LAGGING > 0 && CURVES[THRUSTERS[t].curve].lag != NONE;
}

/* What is calculated of the thrusters: their forces, unless they are states, and their torques. */
static void rov_thrust_of(double at[], const rov_gains *gains)
{
    for (int t = 0; t < N_THRUSTERS; t++) {
        if (!rov_lags(t)) {
            at[THRUSTERS[t].force] = rov_steady(at, t);
        }
    }
    for (int c = 0; c < N_CURVES; c++) {
        double sum = 0.0;
        for (int t = 0; t < N_THRUSTERS; t++) {
            sum += THRUSTERS[t].curve == c ? gains->torque[t] * at[THRUSTERS[t].force] : 0.0;
        }
        if (CURVES[c].torque != NONE) {
            at[CURVES[c].torque] = sum;
        }
    }
}

/* The axes under thrust, (18): C = (beta/m) (alpha F + F_ext + F_0). */
static inline void rov_push(const double at[], const rov_gains *gains, const double F[N_THRUSTERS], double C[WIDTH])
{
    for (int a = N_AXES; a < WIDTH; a++) {
        C[a] = 0.0;
    }
    for (int a = 0; a < N_AXES; a++) {
        double sum = 0.0;
        for (int t = 0; t < N_THRUSTERS; t++) {
            sum += gains->push[t][a] * F[t];
        }
        C[a] = sum + gains->gain[a] * (at[AXES[a].external] + rov_value(at, AXES[a].load));
    }
}

static inline void rov_hold(const double at[], const rov_gains *gains, rov_held *held)
{
    for (int t = 0; t < N_THRUSTERS; t++) {
        held->steady[t] = rov_steady(at, t);
        held->F[t] = rov_lags(t) ? at[THRUSTERS[t].force] : held->steady[t];
    }
    rov_push(at, gains, held->F, held->C);
    held->north = rov_value(at, MAYBE_V_N);
    held->east = rov_value(at, MAYBE_V_E);
}

/* ---- Derivatives ---- */

/* What the coupling adds to the accelerations: Coriolis and Munk terms of a diagonal mass matrix. */
static inline void rov_couple(const rov_gains *gains, const double v[N_AXES], double rate[N_AXES])
{
    if (IS_COUPLED) {
        rate[U] += gains->c_u * v[V] * v[R];
        rate[V] -= gains->c_v * v[U] * v[R];
        rate[R] -= gains->c_r * v[U] * v[V];
    }
}

/* How the pose moves by velocities, with a current; the same of ways, and of changes. */
static inline void rov_pose(double psi, const double v[WIDTH], double north, double east, double rate[N_STATES])
{
    if (POSE_x != NONE) {
        const double cosine = cos(psi), sine = sin(psi);
        rate[POSE_x] = v[U] * cosine - v[V] * sine + north;
        rate[POSE_y] = v[U] * sine + v[V] * cosine + east;
    }
    if (POSE_z != NONE) {
        rate[POSE_z] = v[HEAVE];
    }
    if (POSE_psi != NONE) {
        rate[POSE_psi] = v[YAW];
    }
}

/* Time derivatives of a state: (18), the coupling, the kinematics with the current, the lags. */
static inline void rov_rates(const rov_gains *gains, const rov_held *held, const double state[N_STATES],
                             double rate[N_STATES])
{
    double v[WIDTH] = {0.0};
    for (int a = 0; a < N_AXES; a++) {
        v[a] = state[a];
        rate[a] = held->C[a] - riccati_drag(&gains->axis[a], state[a]);
        for (int t = 0; t < N_THRUSTERS && N_LAGGING > 0; t++) {
            rate[a] += rov_lags(t) ? gains->push[t][a] * (state[THRUSTERS[t].force - FIRST_STATE] - held->F[t]) : 0.0;
        }
    }
    rov_couple(gains, state, rate);
    rov_pose(rov_value(state, POSE_psi), v, held->north, held->east, rate);
    for (int t = 0; t < N_THRUSTERS; t++) {
        if (rov_lags(t)) {
            const int F = THRUSTERS[t].force - FIRST_STATE;
            rate[F] = (held->steady[t] - state[F]) * gains->rate[THRUSTERS[t].curve];
        }
    }
}

static void rov_derivatives(double at[], const rov_gains *gains)
{
    rov_held held;
    rov_hold(at, gains, &held);
    rov_rates(gains, &held, at + FIRST_STATE, at + FIRST_CALCULATED);
}

/* ---- Tangents ---- */

/* Change of the steady thrust of a thruster. At a kink the derivative is that of the inside: of commands within +-1, and of
 * the dead band. */
static double rov_steady_tangent(const double at[], const double d[], int t)
{
    const curve_info *const curve = &CURVES[THRUSTERS[t].curve];
    double sum = 0.0, change = 0.0;
    for (int i = 0; i < N_DRIVERS; i++) {
        const int command = THRUSTERS[t].command[i];
        sum += THRUSTERS[t].gain[i] * rov_saturated(at[command]);
        change += fabs(at[command]) <= 1.0 ? THRUSTERS[t].gain[i] * d[command] : 0.0;
    }
    const double c = rov_saturated(sum), dc = fabs(sum) <= 1.0 ? change : 0.0, sign = c < 0.0 ? -1.0 : 1.0;
    const int back = c < 0.0;
    const double dead = rov_value(at, curve->c_0[back]), m = fabs(c) - dead;
    if (m < 0.0 || (m == 0.0 && dead > 0.0)) {
        return 0.0;
    }
    const double by_curve = (d[curve->a_t[back]] * m + d[curve->b_t[back]]) * m;
    const double slope = 2.0 * at[curve->a_t[back]] * m + at[curve->b_t[back]];
    return curve->share * (sign * by_curve + slope * (dc - sign * rov_value(d, curve->c_0[back])));
}

/* Change of the effect of a thruster on an axis: of R sin(gamma). */
static double rov_effect_tangent(const double at[], const double d[], int t, int a)
{
    const double radius = rov_value(at, MAYBE_R), gamma = rov_value(at, MAYBE_gamma);
    const double change = rov_value(d, MAYBE_R) * sin(gamma) + radius * cos(gamma) * rov_value(d, MAYBE_gamma);
    return a == YAW && THRUSTERS[t].by_arm ? THRUSTERS[t].effect[a] * change : 0.0;
}

/* Change of the ratio gain[over]/gain[under] of two axes for changes of both. */
static inline double rov_ratio_tangent(const double gain[N_AXES], const double d[N_AXES], int over, int under)
{
    return (d[over] - gain[over] / gain[under] * d[under]) / gain[under];
}

/* Directional derivative: for the changes d of inputs, states and coefficients, those of what is calculated are written
 * into d. */
static void rov_tangent(const double at[], double d[])
{
    rov_gains gains;
    double F[N_THRUSTERS], dF[N_THRUSTERS], dgain[N_AXES];
    const double *const v = at + FIRST_STATE, *const dv = d + FIRST_STATE;
    double *const rate = d + FIRST_CALCULATED;
    rov_prepare(at, &gains);
    for (int t = 0; t < N_THRUSTERS; t++) {
        const int force = THRUSTERS[t].force;
        const double steady = rov_steady(at, t), change = rov_steady_tangent(at, d, t);
        F[t] = rov_lags(t) ? at[force] : steady;
        dF[t] = rov_lags(t) ? d[force] : change;
        d[force] = dF[t];
        if (rov_lags(t)) { /* T F' = F(c) - F */
            const double lag = gains.rate[THRUSTERS[t].curve], dT = rov_value(d, CURVES[THRUSTERS[t].curve].lag);
            d[force + N_STATES] = lag * (change - dF[t] - lag * dT * (steady - F[t]));
        }
    }
    for (int c = 0; c < N_CURVES; c++) {
        double sum = 0.0;
        for (int t = 0; t < N_THRUSTERS && YAW != NONE; t++) {
            const double change = gains.torque[t] * dF[t] + rov_effect_tangent(at, d, t, YAW) * F[t];
            sum += THRUSTERS[t].curve == c ? change : 0.0;
        }
        if (CURVES[c].torque != NONE) {
            d[CURVES[c].torque] = sum;
        }
    }
    for (int a = 0; a < N_AXES; a++) { /* m v' = beta (alpha F + F_ext + F_0 - a_d |v| v - b_d v), (18) */
        const axis_info *const axis = &AXES[a];
        const int back = v[a] < 0.0;
        const double alpha = at[axis->alpha], a_d = at[axis->a_d[back]], b_d = at[axis->b_d[back]];
        double thrust = 0.0, change = 0.0;
        for (int t = 0; t < N_THRUSTERS; t++) {
            const double effect = rov_effect(at, t, a);
            thrust += effect * F[t];
            change += effect * dF[t] + rov_effect_tangent(at, d, t, a) * F[t];
        }
        const double load = at[axis->external] + rov_value(at, axis->load);
        const double balance = alpha * thrust + load - (a_d * fabs(v[a]) + b_d) * v[a];
        const double dbalance = d[axis->alpha] * thrust + alpha * change + d[axis->external] + rov_value(d, axis->load)
                                - (d[axis->a_d[back]] * fabs(v[a]) + d[axis->b_d[back]]) * v[a]
                                - (2.0 * a_d * fabs(v[a]) + b_d) * dv[a];
        const double m = rov_inertia(at, a), dm = d[axis->inertia] + rov_value(d, axis->added);
        dgain[a] = (d[axis->beta] - gains.gain[a] * dm) / m;
        rate[a] = dgain[a] * balance + gains.gain[a] * dbalance;
    }
    if (IS_COUPLED) {
        const double u = v[U], w = v[V], r = v[R], du = dv[U], dw = dv[V], dr = dv[R], *const gain = gains.gain;
        const double dc_r = rov_ratio_tangent(gain, dgain, R, V) - rov_ratio_tangent(gain, dgain, R, U);
        rate[U] += gains.c_u * (dw * r + w * dr) + rov_ratio_tangent(gain, dgain, U, V) * w * r;
        rate[V] -= gains.c_v * (du * r + u * dr) + rov_ratio_tangent(gain, dgain, V, U) * u * r;
        rate[R] -= gains.c_r * (du * w + u * dw) + dc_r * u * w;
    }
    double change[WIDTH] = {0.0};
    memcpy(change, dv, sizeof(double[N_AXES]));
    if (POSE_psi != NONE) { /* the heading turns what goes ahead to the side */
        change[U] -= rov_value(v, SWAY) * dv[POSE_psi];
        change[V] += rov_value(v, SURGE) * dv[POSE_psi];
    }
    rov_pose(rov_value(v, POSE_psi), change, rov_value(d, MAYBE_V_N), rov_value(d, MAYBE_V_E), rate);
}
