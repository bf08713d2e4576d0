/* SUNDIALS CVODE (version 7), of which FMPy ships the libraries and no headers: what is called of it here.
 *
 * A held command begins anew (CVodeReInit), for the right side has a jump there, and ends at a stop time. */
#ifndef CVODE_H
#define CVODE_H

#include "check.h"
#include "motion.h"

#include <stdint.h>

typedef void *handle;
typedef int right_side(double t, handle y, handle rate, void *user);

enum { NORMAL = 1 }; /* task */

int SUNContext_Create(int communicator, handle *context);
double *N_VGetArrayPointer(handle vector);
handle N_VMake_Serial(int64_t length, double *data, handle context);
handle SUNDenseMatrix(int64_t rows, int64_t columns, handle context);
handle SUNLinSol_Dense(handle y, handle matrix, handle context);
handle SUNNonlinSol_FixedPoint(handle y, int acceleration, handle context);
handle CVodeCreate(int method, handle context);
int CVodeInit(handle solver, right_side *f, double t, handle y);
int CVodeReInit(handle solver, double t, handle y);
int CVodeSStolerances(handle solver, double relative, double absolute);
int CVodeSetLinearSolver(handle solver, handle linear, handle matrix);
int CVodeSetNonlinearSolver(handle solver, handle nonlinear);
int CVodeSetMaxNumSteps(handle solver, long steps);
int CVodeSetStopTime(handle solver, double t);
int CVodeSetUserData(handle solver, void *user);
int CVode(handle solver, double t, handle y, double *reached, int task);

typedef struct {
    handle solver, y;
    const motion *m;
    int states;
    state now;
} cvode;

static int rates_of_cvode(double t, handle y, handle rate, void *user)
{
    const cvode *const c = user;
    (void)t;
    rates(c->m, c->states, N_VGetArrayPointer(y), N_VGetArrayPointer(rate));
    return 0;
}

/* By the method 1 (Adams) or 2 (BDF), the same relative and absolute tolerance. BDF: Newton's method with a dense matrix, as FMPy sets it up. */
cvode *new_solver(int states, int method, int fixed_point, double tolerance)
{
    cvode *const c = calloc(1, sizeof *c);
    handle context;
    CHECK(c != NULL && SUNContext_Create(0, &context) == 0);
    *c = (cvode){.states = states, .solver = CVodeCreate(method, context)};
    c->y = N_VMake_Serial(states, c->now.at, context);
    CHECK((CVodeInit(c->solver, rates_of_cvode, 0.0, c->y) | CVodeSStolerances(c->solver, tolerance, tolerance)
           | CVodeSetUserData(c->solver, c) | CVodeSetMaxNumSteps(c->solver, 1000000)) == 0);
    if (fixed_point) {
        CHECK(CVodeSetNonlinearSolver(c->solver, SUNNonlinSol_FixedPoint(c->y, 0, context)) == 0);
    } else {
        const handle matrix = SUNDenseMatrix(states, states, context);
        CHECK(CVodeSetLinearSolver(c->solver, SUNLinSol_Dense(c->y, matrix, context), matrix) == 0);
    }
    return c;
}

/* So many steps of h from s on. */
static __attribute__((noinline)) void cvode_hold(cvode *c, const motion *m, state *s, double h, long steps)
{
    double reached, t = 0.0;
    c->m = m;
    c->now = *s;
    CHECK((CVodeReInit(c->solver, 0.0, c->y) | CVodeSetStopTime(c->solver, h * (double)steps)) == 0);
    for (long i = 0; i < steps; i++) {
        t += h;
        CHECK(CVode(c->solver, t, c->y, &reached, NORMAL) >= 0);
        *s = c->now;
    }
}

#endif
