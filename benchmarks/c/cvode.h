/* SUNDIALS CVODE, loaded from the libraries that FMPy ships (version 7): only the functions that are called here.
 *
 * A held command begins anew (CVodeReInit), for the right side has a jump there, and ends at a stop time. */
#ifndef CVODE_H
#define CVODE_H

#include "motion.h"

#include <stdint.h>

typedef void *handle;
typedef int right_side(double t, handle y, handle rate, void *user);

enum { ADAMS = 1, BDF = 2, NORMAL = 1 };

static struct {
    int (*SUNContext_Create)(int communicator, handle *context);
    double *(*N_VGetArrayPointer)(handle vector);
    handle (*N_VMake_Serial)(int64_t length, double *data, handle context);
    handle (*SUNDenseMatrix)(int64_t rows, int64_t columns, handle context);
    handle (*SUNLinSol_Dense)(handle y, handle matrix, handle context);
    handle (*SUNNonlinSol_FixedPoint)(handle y, int acceleration, handle context);
    handle (*CVodeCreate)(int method, handle context);
    int (*CVodeInit)(handle solver, right_side *f, double t, handle y);
    int (*CVodeReInit)(handle solver, double t, handle y);
    int (*CVodeSStolerances)(handle solver, double relative, double absolute);
    int (*CVodeSetLinearSolver)(handle solver, handle linear, handle matrix);
    int (*CVodeSetNonlinearSolver)(handle solver, handle nonlinear);
    int (*CVodeSetMaxNumSteps)(handle solver, long steps);
    int (*CVodeSetStopTime)(handle solver, double t);
    int (*CVodeSetUserData)(handle solver, void *user);
    int (*CVode)(handle solver, double t, handle y, double *reached, int task);
} sundials;

typedef struct {
    handle solver, y;
    motion *m;
    state now;
    double t;
} cvode;

static void load_sundials(const char *folder)
{
    /* in the order of their dependencies, which the loader then finds by name */
    static const char *const libraries[] = {"core", "nvecserial", "sunmatrixdense", "sunlinsoldense", "cvode"};
    void *library[sizeof libraries / sizeof libraries[0]];
    for (size_t i = 0; i < sizeof libraries / sizeof libraries[0]; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/sundials_%s.so", folder, libraries[i]);
        library[i] = load(path);
    }
#define FIND(place, name) find(library[place], #name, &sundials.name)
    FIND(0, SUNContext_Create);
    FIND(0, N_VGetArrayPointer);
    FIND(1, N_VMake_Serial);
    FIND(2, SUNDenseMatrix);
    FIND(3, SUNLinSol_Dense);
    FIND(4, SUNNonlinSol_FixedPoint);
    FIND(4, CVodeCreate);
    FIND(4, CVodeInit);
    FIND(4, CVodeReInit);
    FIND(4, CVodeSStolerances);
    FIND(4, CVodeSetLinearSolver);
    FIND(4, CVodeSetNonlinearSolver);
    FIND(4, CVodeSetMaxNumSteps);
    FIND(4, CVodeSetStopTime);
    FIND(4, CVodeSetUserData);
    FIND(4, CVode);
#undef FIND
}

static int velocity_rates(double t, handle y, handle rate, void *user)
{
    (void)t;
    rates(user, 3, sundials.N_VGetArrayPointer(y), sundials.N_VGetArrayPointer(rate));
    return 0;
}

static int state_rates(double t, handle y, handle rate, void *user)
{
    (void)t;
    rates(user, 7, sundials.N_VGetArrayPointer(y), sundials.N_VGetArrayPointer(rate));
    return 0;
}

/* n states, the same relative and absolute tolerance. BDF: Newton's method with a dense matrix, as FMPy sets it up. */
static void cvode_create(cvode *c, motion *m, int n, int method, bool fixed_point, double tolerance)
{
    handle context;
    int flags = sundials.SUNContext_Create(0, &context);
    c->m = m;
    c->y = sundials.N_VMake_Serial(n, c->now.at, context);
    c->solver = sundials.CVodeCreate(method, context);
    flags |= sundials.CVodeInit(c->solver, n == 3 ? velocity_rates : state_rates, 0.0, c->y);
    flags |= sundials.CVodeSStolerances(c->solver, tolerance, tolerance);
    flags |= sundials.CVodeSetUserData(c->solver, m);
    flags |= sundials.CVodeSetMaxNumSteps(c->solver, 1000000);
    if (fixed_point) {
        flags |= sundials.CVodeSetNonlinearSolver(c->solver, sundials.SUNNonlinSol_FixedPoint(c->y, 0, context));
    } else {
        const handle matrix = sundials.SUNDenseMatrix(n, n, context);
        flags |= sundials.CVodeSetLinearSolver(c->solver, sundials.SUNLinSol_Dense(c->y, matrix, context), matrix);
    }
    check(flags == 0, "CVODE cannot be set up");
}

static void cvode_begin(cvode *c, const state *s, double duration)
{
    c->now = *s;
    c->t = 0.0;
    check((sundials.CVodeReInit(c->solver, 0.0, c->y) | sundials.CVodeSetStopTime(c->solver, duration)) == 0,
          "CVodeReInit failed");
}

static __attribute__((noinline)) void cvode_advance(cvode *c, state *s, double h)
{
    double reached;
    c->t += h;
    check(sundials.CVode(c->solver, c->t, c->y, &reached, NORMAL) >= 0, "CVode failed");
    *s = c->now;
}

#endif
