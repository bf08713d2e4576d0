/* The step of vehicles in MuJoCo.
 *
 * Python knows the addresses of MuJoCo's functions and arrays, so that no header of MuJoCo is needed, and any version
 * fits. What a vehicle remembers from step to step is in MuJoCo's data (`enum` of KEPT below). The rest of a `vehicle`
 * follows from these and from what Python sets; its memory belongs to Python, which may copy it. Scenes can be stepped in
 * several threads. */
#include "real.h"

#include <float.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#if !defined _WIN32
#include <setjmp.h>
#endif

#include "equation.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

static const double FLIP[6] = {1.0, -1.0, -1.0, 1.0, -1.0, -1.0}; /* from MuJoCo's frames to those of the equation */
static const double HEAVY = 1e6; /* the mass along an axis that the vehicle lacks, relative to that of the rigid body */
static const double REST = 0.1;  /* s, in which the body comes to rest along such an axis */

/* ---- The equation ------------------------------------------------------------------------------------------------ */

/* What moves during a step: velocity over ground and rates, quaternion, and the change of the velocity so far. */
enum { VELOCITY, ATTITUDE = 6, CHANGE = 10, N_STATES = 16 };
enum { FIRST_STATE = N_GIVEN, N_VARIABLES = N_GIVEN + N_STATES };

typedef struct {
    double at[N_VARIABLES]; /* commands, those that act after the dead time, coefficients, other inputs, and states */
    double v[N_NUMBERS];    /* they, the directions of the motion, what lags, and the numbers that follow from these */
    bool is_held, is_lagged; /* true if the numbers are up to date that do not depend on what lags, and those that do */
    double outside[6];      /* the acceleration by other forces than those of the water */
} water;

/* Compute the numbers that are constant during a part of the step, if they have changed. */
static void hold(water *w, const double now[], const double y[])
{
    double direction[N_DIRECTIONS + 1];
    bool same = w->is_held && memcmp(now, w->v, N_GIVEN * sizeof now[0]) == 0;
    for (int i = 0; i < N_DIRECTIONS; i++) {
        direction[i] = y[DIRECTIONS[i]] < 0.0 ? -1.0 : 1.0;
        same = same && direction[i] == w->v[N_GIVEN + i];
    }
    if (!same) {
        memcpy(w->v, now, N_GIVEN * sizeof now[0]);
        memcpy(w->v + N_GIVEN, direction, N_DIRECTIONS * sizeof now[0]);
        equation_numbers(w->v);
    }
    if (!same || !w->is_lagged) {
        equation_lagged(w->v);
    }
    w->is_held = w->is_lagged = true;
}

/* Compute the rotation matrix of a quaternion, scalar first, which need not have length 1. */
static void rotation(const double quaternion[4], double R[9])
{
    const double e = quaternion[0], a = quaternion[1], b = quaternion[2], c = quaternion[3];
    const double s = 2.0 / (e * e + a * a + b * b + c * c);
    R[0] = 1.0 - s * (b * b + c * c), R[1] = s * (a * b - c * e), R[2] = s * (a * c + b * e);
    R[3] = s * (a * b + c * e), R[4] = 1.0 - s * (a * a + c * c), R[5] = s * (b * c - a * e);
    R[6] = s * (a * c - b * e), R[7] = s * (b * c + a * e), R[8] = 1.0 - s * (a * a + b * b);
}

/* Compute a quaternion after a turn of h seconds, to first order. */
static void turned(const double quaternion[4], const double rates[3], double h, double result[4])
{
    const double e = quaternion[0], a = quaternion[1], b = quaternion[2], c = quaternion[3];
    const double p = 0.5 * h * rates[0], q = 0.5 * h * rates[1], r = 0.5 * h * rates[2];
    result[0] = e - a * p - b * q - c * r, result[1] = a + e * p + b * r - c * q;
    result[2] = b + e * q + c * p - a * r, result[3] = c + e * r + a * q - b * p;
}

/* Compute the acceleration, in the frames of the velocity, some seconds after the start of a part of the step. */
static void accelerate(water *w, const double now[], double after, const double state[], double result[6])
{
    double y[N_BODY], through[3], rate[6];
    double *const R = y + BODY_ROTATION;
    rotation(state + ATTITUDE, R);
    for (int i = 0; i < 3; i++) {
        through[i] = state[VELOCITY + i] - (CURRENT[i] < 0 ? 0.0 : now[CURRENT[i]]);
    }
    for (int i = 0; i < 3; i++) {
        y[i] = R[i] * through[0] + R[3 + i] * through[1] + R[6 + i] * through[2];
        y[3 + i] = state[VELOCITY + 3 + i];
    }
    hold(w, now, y);
    equation_rates(w->v, after, y, rate);
    const double tilt[6] = {0.0, 0.0, 0.0, R[7], -R[6], 0.0};
    for (int i = 0; i < 6; i++) {
        rate[i] = LACKS[i] ? -2.0 * y[i] / REST - tilt[i] / (REST * REST) : rate[i];
    }
    /* the velocity of the origin changes in the earth frame by v' + omega x v */
    const double a = rate[0] + y[4] * y[2] - y[5] * y[1], b = rate[1] + y[5] * y[0] - y[3] * y[2];
    const double c = rate[2] + y[3] * y[1] - y[4] * y[0];
    for (int i = 0; i < 3; i++) {
        result[i] = R[3 * i] * a + R[3 * i + 1] * b + R[3 * i + 2] * c;
        result[3 + i] = rate[3 + i];
    }
}

/* delay.c moves a vehicle through a part of a step by motion_step, and hands it what it calls the numbers. */
typedef struct {
    water *of;
} model_numbers;

static int motion_step(const double now[], const model_numbers *n, double h, double next[N_STATES], double *heading)
{
    const double *const state = now + FIRST_STATE, *const outside = n->of->outside;
    double start[6], mean[6], middle[N_STATES];
    (void)heading;
    accelerate(n->of, now, 0.0, state, start);
    for (int i = 0; i < 6; i++) {
        middle[VELOCITY + i] = state[VELOCITY + i] + 0.5 * h * (start[i] + outside[i]);
    }
    turned(state + ATTITUDE, state + VELOCITY + 3, 0.5 * h, middle + ATTITUDE);
    accelerate(n->of, now, 0.5 * h, middle, mean);
    turned(state + ATTITUDE, middle + VELOCITY + 3, h, next + ATTITUDE);
    for (int i = 0; i < 6; i++) {
        next[CHANGE + i] = state[CHANGE + i] + h * mean[i];
        next[VELOCITY + i] = state[VELOCITY + i] + h * (mean[i] + outside[i]);
    }
    equation_lag(n->of->v, h);
    n->of->is_lagged = false;
    return 1;
}

#if HAS_DEAD_TIME
enum { REF_T_d = V_T_d, MOST_PIECES = 1 << 30 };

/* Add a change to a number, together with its earlier rounding error (compensated summation). */
static inline void motion_add(double *to, double change, double *lost)
{
    const double whole = change + *lost, sum = *to + whole;
    *lost = whole - (sum - *to);
    *to = sum;
}

/* MuJoCo keeps the velocity over ground where the current changes, so that nothing need be kept of the current. */
static inline void current_keep(double now[])
{
    (void)now;
}

#include "delay.c"
#endif

/* ---- A vehicle --------------------------------------------------------------------------------------------------- */

/* What Python tells, in this order: addresses of the model, its data, the data's arrays, functions, the function that
 * MuJoCo calls in place of ending the program, and callbacks. */
enum { A_MODEL, A_DATA, A_M, A_QPOS, A_QVEL, A_ACT, A_CTRL, A_PASSIVE, A_XMAT };
enum { A_STEP_1 = A_XMAT + 1, A_FACTOR, A_PROJECT, A_STEP_2, A_TURN, A_STATE, A_FAIL, A_ON_ERROR, A_CALLBACKS };
enum { N_CALLBACKS = 7, N_ADDRESSES = A_CALLBACKS + N_CALLBACKS };
/* And these numbers: the places of its body, pose and velocity; one bit for each integrator that treats gyroscopic
 * forces as implicit; the place of its memory in the activations, and how many changes of commands fit into it; and the
 * places of its entries in M and of its actuators. */
enum { P_BODY, P_POSE, P_VELOCITY, P_IMPLICIT, P_MEMORY, P_WAITING, P_ENTRIES, P_ACTUATORS = P_ENTRIES + 21 };
enum { DONE, NO_BODY, TOO_MANY_WAIT, IN_ANOTHER_SCENE, HAS_CALLBACKS, MUJOCO_FAILS }; /* what a step returns */
/* The memory of a vehicle, which is in the activations of its first actuator (dyntype "user"), so that MuJoCo copies,
 * saves and resets it with its data: 1 after a step and 0 in new data; the acceleration by other forces; what lags. With a
 * dead time, these follow: the commands that act, how many changes wait, and each change: its remaining time, the rounding
 * error of that, and the commands. N_KEPT numbers in all, and N_CHANGE for each change. */
enum { KEPT_MOVED, KEPT_OUTSIDE, KEPT_LAGGING = KEPT_OUTSIDE + 6, KEPT_COMMANDS = KEPT_LAGGING + N_LAGGING };

typedef void of_mujoco(const void *model, void *data);

/* What the step of a scene needs of each vehicle in it. This is the same for all kinds of vehicles. FORMAT of native.py
 * changes with it. */
typedef struct member {
    uintptr_t addresses[N_ADDRESSES];
    int (*add_mass)(struct member *, double t);
    int (*add_forces)(struct member *, double t, double h, int integrator);
    void (*move)(struct member *, double t, double h);
} member;

typedef struct {
    member shared;
    int places[P_ACTUATORS + N_COMMANDS];
    double rigid[6][6];                 /* the mass matrix of the rigid body, in MuJoCo's frame */
    double mass[6][6];                  /* that of the vehicle, with added mass */
    double weighed[N_COEFFICIENTS + 1]; /* the coefficients that it was computed for */
    bool is_weighed;
    double time;                        /* at the start of the step */
    double pose[7], velocity[6];        /* at the start of the step */
    double accelerated[6];              /* the mean acceleration by the water during the step */
    water water;
#if HAS_DEAD_TIME
    delay_line line;
#endif
} vehicle;

static inline double *array(const member *m, int which)
{
    return (double *)m->addresses[which];
}

static inline void call(const member *m, int function)
{
    ((of_mujoco *)m->addresses[function])((const void *)m->addresses[A_MODEL], (void *)m->addresses[A_DATA]);
}

/* Return the time of the simulation. It is state 1 of MuJoCo (mjSTATE_TIME). */
static double time_of(const member *m)
{
    typedef void get_state(const void *model, const void *data, double *state, int which);
    double t;
    get_state *const get = (get_state *)m->addresses[A_STATE];
    get((const void *)m->addresses[A_MODEL], (const void *)m->addresses[A_DATA], &t, 1);
    return t;
}

/* Read what the vehicle remembers, its commands, and its motion from MuJoCo's data. */
static void recall(vehicle *o)
{
    const member *const m = &o->shared;
    const double *const kept = array(m, A_ACT) + o->places[P_MEMORY], *const ctrl = array(m, A_CTRL);
    double *const at = o->water.at, *const state = at + FIRST_STATE;
    memcpy(o->pose, array(m, A_QPOS) + o->places[P_POSE], sizeof o->pose);
    memcpy(o->velocity, array(m, A_QVEL) + o->places[P_VELOCITY], sizeof o->velocity);
    for (int i = 0; i < N_COMMANDS; i++) {
        at[i] = ctrl[o->places[P_ACTUATORS + i]];
    }
    for (int i = 0; i < 6; i++) {
        state[VELOCITY + i] = FLIP[i] * o->velocity[i];
    }
    state[ATTITUDE] = o->pose[3], state[ATTITUDE + 1] = o->pose[4];
    state[ATTITUDE + 2] = -o->pose[5], state[ATTITUDE + 3] = -o->pose[6];
    memcpy(o->water.outside, kept + KEPT_OUTSIDE, sizeof o->water.outside);
    memcpy(o->water.v + FIRST_LAGGING, kept + KEPT_LAGGING, N_LAGGING * sizeof kept[0]);
    o->water.is_lagged = false;
#if HAS_DEAD_TIME
    const bool has_moved = kept[KEPT_MOVED] != 0.0;
    const double waiting = kept[KEPT_COMMANDS + N_COMMANDS], *change = kept + N_KEPT;
    memcpy(at + FIRST_DELAYED, has_moved ? kept + KEPT_COMMANDS : STARTS, N_COMMANDS * sizeof at[0]);
    o->line.waiting = waiting >= 0.0 && waiting <= o->places[P_WAITING] ? (int)waiting : 0;
    for (int n = 0; n < o->line.waiting; n++, change += N_CHANGE) {
        o->line.remaining[n] = change[0], o->line.lost[n] = change[1];
        memcpy(o->line.commands[n], change + 2, sizeof o->line.commands[n]);
    }
#endif
}

/* Write what the vehicle remembers after a step into MuJoCo's data. */
static void remember(const vehicle *o)
{
    double *const kept = array(&o->shared, A_ACT) + o->places[P_MEMORY];
    kept[KEPT_MOVED] = 1.0;
    memcpy(kept + KEPT_OUTSIDE, o->water.outside, sizeof o->water.outside);
    memcpy(kept + KEPT_LAGGING, o->water.v + FIRST_LAGGING, N_LAGGING * sizeof kept[0]);
#if HAS_DEAD_TIME
    double *change = kept + N_KEPT;
    memcpy(kept + KEPT_COMMANDS, o->water.at + FIRST_DELAYED, N_COMMANDS * sizeof kept[0]);
    kept[KEPT_COMMANDS + N_COMMANDS] = o->line.waiting;
    for (int n = 0; n < o->line.waiting; n++, change += N_CHANGE) {
        change[0] = o->line.remaining[n], change[1] = o->line.lost[n];
        memcpy(change + 2, o->line.commands[n], sizeof o->line.commands[n]);
    }
#endif
}

/* Return true if a mass matrix is that of a body: positive definite along the axes that the vehicle has (Cholesky). */
static bool is_of_body(const double M[6][6])
{
    double L[6][6];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double rest = M[i][j];
            for (int k = 0; k < j; k++) {
                rest -= L[i][k] * L[j][k];
            }
            if (i == j && !(rest > 0.0 && rest <= DBL_MAX)) {
                return false;
            }
            L[i][j] = i == j ? sqrt(rest) : rest / L[j][j];
        }
    }
    return true;
}

/* Compute the mass matrix for the present coefficients. Return false if no body has it. */
static bool weigh(vehicle *o)
{
    double v[N_NUMBERS], M[36];
    memset(v, 0, sizeof v);
    memcpy(v, o->water.at, N_GIVEN * sizeof v[0]);
    equation_numbers(v);
    equation_mass(v, M);
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 6; j++) {
            const double lacking = i == j ? HEAVY * o->rigid[i][i] : 0.0;
            o->mass[i][j] = LACKS[i] || LACKS[j] ? lacking : FLIP[i] * FLIP[j] * M[6 * i + j];
        }
    }
    memcpy(o->weighed, o->water.at + FIRST_COEFFICIENT, N_COEFFICIENTS * sizeof v[0]);
    o->is_weighed = is_of_body((const double(*)[6])o->mass);
    return o->is_weighed;
}

/* Add to MuJoCo's inertia matrix what the mass matrix of the vehicle has beyond that of the rigid body. */
static int add_mass(member *m, double t)
{
    vehicle *const o = (vehicle *)m;
    o->time = t;
    const double *const given = o->water.at + FIRST_COEFFICIENT;
    if ((!o->is_weighed || memcmp(o->weighed, given, N_COEFFICIENTS * sizeof given[0]) != 0) && !weigh(o)) {
        return NO_BODY;
    }
    double half[6][6], *const M = array(m, A_M);
    const double *const T = array(m, A_XMAT) + 9 * o->places[P_BODY];
    for (int i = 0; i < 6; i++) {
        double added[6];
        for (int j = 0; j < 6; j++) {
            added[j] = o->mass[i][j] - o->rigid[i][j];
        }
        for (int j = 0; j < 3; j++) {
            half[i][j] = added[0] * T[3 * j] + added[1] * T[3 * j + 1] + added[2] * T[3 * j + 2];
            half[i][3 + j] = added[3 + j];
        }
    }
    for (int i = 0, n = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++, n++) {
            const double *const row = T + 3 * (i % 3);
            const double along = row[0] * half[0][j] + row[1] * half[1][j] + row[2] * half[2][j];
            M[o->places[P_ENTRIES + n]] += i < 3 ? along : half[i][j];
        }
    }
    return DONE;
}

/* Compute the mean acceleration by the water during a step, with the commands held. */
static int mean_acceleration(vehicle *o, double t, double h, double result[6])
{
    water *const w = &o->water;
    const model_numbers n = {w};
    double next[N_STATES];
    memset(w->at + FIRST_STATE + CHANGE, 0, 6 * sizeof next[0]);
#if HAS_DEAD_TIME
    double heading = 0.0;
    if (delayed_step(w->at, &n, &o->line, t, h, next, &heading) < 0) {
        return TOO_MANY_WAIT;
    }
    delay_commit(w->at, &o->line, t, h);
    if (o->line.waiting > o->places[P_WAITING]) {
        return TOO_MANY_WAIT;
    }
#else
    (void)t;
    motion_step(w->at, &n, h, next, NULL);
#endif
    for (int i = 0; i < 6; i++) {
        result[i] = next[CHANGE + i] / h;
    }
    return DONE;
}

static void add_cross(double to[3], const double a[3], const double b[3])
{
    to[0] += a[1] * b[2] - a[2] * b[1], to[1] += a[2] * b[0] - a[0] * b[2], to[2] += a[0] * b[1] - a[1] * b[0];
}

/* Add the forces that give the body the accelerations of the equation, unless other forces act. */
static int add_forces(member *m, double t, double h, int integrator)
{
    vehicle *const o = (vehicle *)m;
    double *const passive = array(m, A_PASSIVE) + o->places[P_VELOCITY];
    const double *const T = array(m, A_XMAT) + 9 * o->places[P_BODY];
    recall(o);
    double mean[6], local[6], force[6], turning[6], change[3], *const rates = o->velocity + 3;
    const int result = mean_acceleration(o, t, h, mean);
    if (result != DONE) {
        return result;
    }
    for (int i = 0; i < 6; i++) {
        o->accelerated[i] = FLIP[i] * mean[i];
    }
    for (int i = 0; i < 3; i++) {
        local[i] = T[i] * o->accelerated[0] + T[3 + i] * o->accelerated[1] + T[6 + i] * o->accelerated[2];
        local[3 + i] = o->accelerated[3 + i];
        change[i] = h * (o->accelerated[3 + i] + FLIP[3 + i] * o->water.outside[3 + i]);
    }
    for (int i = 0; i < 6; i++) {
        force[i] = 0.0;
        for (int j = 0; j < 6; j++) {
            force[i] += o->mass[i][j] * local[j];
        }
        turning[i] = o->rigid[i][3] * rates[0] + o->rigid[i][4] * rates[1] + o->rigid[i][5] * rates[2];
    }
    /* what MuJoCo subtracts for the rigid body: m omega x (omega x r_G) and omega x I omega. Some integrators subtract
     * its value at the end of the step, linearised about the start. */
    add_cross(force, rates, turning);
    add_cross(force + 3, rates, turning + 3);
    if ((o->places[P_IMPLICIT] >> integrator) & 1) {
        double after[6];
        for (int i = 0; i < 6; i++) {
            after[i] = o->rigid[i][3] * change[0] + o->rigid[i][4] * change[1] + o->rigid[i][5] * change[2];
        }
        add_cross(force, change, turning);
        add_cross(force + 3, change, turning + 3);
        add_cross(force, rates, after);
        add_cross(force + 3, rates, after + 3);
    }
    for (int i = 0; i < 3; i++) {
        passive[i] += T[3 * i] * force[0] + T[3 * i + 1] * force[1] + T[3 * i + 2] * force[2];
        passive[3 + i] += force[3 + i];
    }
    return DONE;
}

/* Move the body with its mean velocity during the step, where MuJoCo took the last one. */
static void move(member *m, double t, double h)
{
    vehicle *const o = (vehicle *)m;
    if (t <= o->time) { /* MuJoCo has reset a simulation that became unstable, and with it what the vehicle remembers */
        return;
    }
    typedef void integrate(double quaternion[4], const double rates[3], double h);
    const double *const velocity = array(m, A_QVEL) + o->places[P_VELOCITY];
    double mean[6];
    for (int i = 0; i < 6; i++) {
        mean[i] = 0.5 * (o->velocity[i] + velocity[i]);
        o->water.outside[i] = FLIP[i] * ((velocity[i] - o->velocity[i]) / h - o->accelerated[i]);
    }
    for (int i = 0; i < 3; i++) {
        o->pose[i] += h * mean[i];
    }
    ((integrate *)m->addresses[A_TURN])(o->pose + 3, mean + 3, h);
    memcpy(array(m, A_QPOS) + o->places[P_POSE], o->pose, sizeof o->pose);
    remember(o);
}

/* ---- Errors of MuJoCo -------------------------------------------------------------------------------------------- */

/* Where MuJoCo gives up, as when its memory is full, it calls a function that must not return, and else ends the program.
 * This one jumps back to where the step of its thread began. */
#if defined _WIN32 /* the libraries are built without the C run time's setjmp and variables of threads */
typedef struct {
    double registers[30]; /* where the call returns, the stack, and what a function of Windows keeps: 8, and 10 of 16 bytes */
} mark;

int save_registers(mark *where) __attribute__((returns_twice));
void restore_registers(const mark *where) __attribute__((noreturn));
#define KEPT_REGISTERS(move)                                                                                          \
    move("%rbx", 16) move("%rbp", 24) move("%rsi", 32) move("%rdi", 40) move("%r12", 48) move("%r13", 56)              \
        move("%r14", 64) move("%r15", 72)
#define KEPT_VECTORS(move)                                                                                            \
    move("%xmm6", 80) move("%xmm7", 96) move("%xmm8", 112) move("%xmm9", 128) move("%xmm10", 144) move("%xmm11", 160)  \
        move("%xmm12", 176) move("%xmm13", 192) move("%xmm14", 208) move("%xmm15", 224)
#define SAVE(name, place) "movq " name ", " #place "(%rcx)\n"
#define RESTORE(name, place) "movq " #place "(%rcx), " name "\n"
#define SAVE_VECTOR(name, place) "movups " name ", " #place "(%rcx)\n"
#define RESTORE_VECTOR(name, place) "movups " #place "(%rcx), " name "\n"
__asm__("save_registers:\n"
        "movq (%rsp), %rax\n" SAVE("%rax", 0) "leaq 8(%rsp), %rax\n" SAVE("%rax", 8)
        KEPT_REGISTERS(SAVE) KEPT_VECTORS(SAVE_VECTOR) "xorl %eax, %eax\n ret\n"
        "restore_registers:\n"
        KEPT_REGISTERS(RESTORE) KEPT_VECTORS(RESTORE_VECTOR) RESTORE("%rsp", 8) "movl $1, %eax\n jmpq *(%rcx)\n");
#define MARK(where) save_registers(&(where))
#define JUMP_TO(where) restore_registers(&(where))
static inline const void *this_thread(void)
{
    const void *block;
    __asm__("movq %%gs:0x30, %0" : "=r"(block));
    return block;
}
#else
typedef jmp_buf mark;
#define MARK setjmp
#define JUMP_TO(where) longjmp(where, 1)
static inline const void *this_thread(void)
{
    static __thread char here;
    return &here;
}
#endif

typedef struct guard {
    const void *thread;
    struct guard *next;
    char *text; /* what MuJoCo says */
    size_t size;
    mark start;
} guard;
typedef void on_error(const char *message);
typedef void fail(const char *format, ...);

static guard *guards; /* of the steps that are being taken */
static char guards_are_locked;
static on_error *before, **called_by_mujoco;
static fail *end_program;

static void lock_guards(void)
{
    while (__atomic_test_and_set(&guards_are_locked, __ATOMIC_ACQUIRE)) {
    }
}

static void unlock_guards(void)
{
    __atomic_clear(&guards_are_locked, __ATOMIC_RELEASE);
}

static void raise_error(const char *message)
{
    const void *const thread = this_thread();
    lock_guards();
    guard *own = guards;
    while (own != NULL && own->thread != thread) {
        own = own->next;
    }
    unlock_guards();
    if (own != NULL) {
        size_t length = 0;
        for (; length + 1 < own->size && message[length] != '\0'; length++) {
            own->text[length] = message[length];
        }
        own->text[length] = '\0';
        JUMP_TO(own->start);
    } else if (before != NULL) { /* such as that of another vehicle's library */
        before(message);
    } else {
        *called_by_mujoco = NULL;
        end_program("%s", message);
    }
}

static void begin_guard(guard *own, const member *m)
{
    lock_guards();
    own->thread = this_thread();
    own->next = guards;
    guards = own;
    if (called_by_mujoco == NULL) {
        called_by_mujoco = (on_error **)m->addresses[A_ON_ERROR];
        end_program = (fail *)m->addresses[A_FAIL];
        before = *called_by_mujoco;
        *called_by_mujoco = raise_error;
    }
    unlock_guards();
}

static void end_guard(guard *own)
{
    lock_guards();
    guard **to = &guards;
    while (*to != own) {
        to = &(*to)->next;
    }
    *to = own->next;
    unlock_guards();
}

/* ---- For Python -------------------------------------------------------------------------------------------------- */

/* Write the size of a vehicle, and the place in it of the coefficients and the other inputs, both in doubles; and the
 * numbers of commands, coefficients, and other inputs; and N_KEPT and N_CHANGE. */
EXPORT void water_sizes(int sizes[7])
{
    sizes[0] = (int)(sizeof(vehicle) / sizeof(double));
    sizes[1] = (int)((offsetof(vehicle, water) + offsetof(water, at)) / sizeof(double)) + FIRST_COEFFICIENT;
    sizes[2] = N_COMMANDS;
    sizes[3] = N_COEFFICIENTS;
    sizes[4] = N_GIVEN - FIRST_COEFFICIENT - N_COEFFICIENTS;
    sizes[5] = N_KEPT;
    sizes[6] = N_CHANGE;
}

/* Connect a vehicle with a simulation. */
EXPORT void water_connect(vehicle *o, const uintptr_t addresses[], const int places[], const double rigid[])
{
    memcpy(o->shared.addresses, addresses, sizeof o->shared.addresses);
    memcpy(o->places, places, sizeof o->places);
#if HAS_DEAD_TIME
    o->places[P_WAITING] = places[P_WAITING] < MOST_WAITING ? places[P_WAITING] : MOST_WAITING;
#endif
    memcpy(o->rigid, rigid, sizeof o->rigid);
    o->shared.add_mass = add_mass;
    o->shared.add_forces = add_forces;
    o->shared.move = move;
}

/* Write the forces of the thrusters under the present commands. */
EXPORT void water_forces(vehicle *o, double forces[])
{
    double mean[6];
    recall(o);
    accelerate(&o->water, o->water.at, 0.0, o->water.at + FIRST_STATE, mean);
    for (int i = 0; i < N_FORCES; i++) {
        forces[i] = o->water.v[FORCES[i]];
    }
}

/* The parts of a step, for a scene in which other code takes some of them. */
EXPORT int water_add_mass(member *m, double t)
{
    return m->add_mass(m, t);
}

EXPORT int water_add_forces(member *m, double t, double h, int integrator)
{
    return m->add_forces(m, t, h, integrator);
}

EXPORT void water_move(member *m, double t, double h)
{
    m->move(m, t, h);
}

static int take_steps(member *const members[], int n, double h, int integrator, int steps)
{
    const member *const first = members[0];
    int result = DONE;
    for (; steps > 0; steps--) {
        call(first, A_STEP_1);
        const double t = time_of(first);
        for (int i = 0; i < n; i++) {
            if ((result = members[i]->add_mass(members[i], t)) != DONE) {
                return result;
            }
        }
        call(first, A_FACTOR);
        call(first, A_PROJECT);
        for (int i = 0; i < n; i++) {
            if ((result = members[i]->add_forces(members[i], t, h, integrator)) != DONE) {
                return result;
            }
        }
        call(first, A_STEP_2);
        const double end = time_of(first);
        for (int i = 0; i < n; i++) {
            members[i]->move(members[i], end, h);
        }
    }
    return DONE;
}

/* Take some steps of a scene with n vehicles, whose libraries may be others. Write what MuJoCo says if it fails. */
EXPORT int water_step(member *const members[], int n, double h, int integrator, int steps, char text[], int size)
{
    const member *const first = members[0];
    for (int i = 0; i < n; i++) {
        if (members[i]->addresses[A_DATA] != first->addresses[A_DATA]) {
            return IN_ANOTHER_SCENE;
        }
    }
    for (int i = 0; i < N_CALLBACKS; i++) {
        if (*(const volatile uintptr_t *)first->addresses[A_CALLBACKS + i] != 0) {
            return HAS_CALLBACKS;
        }
    }
    guard own;
    own.text = text;
    own.size = (size_t)size;
    volatile int result = MUJOCO_FAILS;
    begin_guard(&own, first);
    if (MARK(own.start) == 0) {
        result = take_steps(members, n, h, integrator, steps);
    }
    end_guard(&own);
    return result;
}
