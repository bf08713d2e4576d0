/* The ROV: thrust, surge, heave, yaw and pose, stepped exactly. The same formulas as rov_fmu/motion/rov.py.
 * Units, signs and the structs (generated into model.h) are those of that module. No state, no allocation. */
#ifndef ROV_H
#define ROV_H

#include "model.h"
#include "riccati.h"

/* What a step needs of the coefficients. */
typedef struct {
    riccati surge, heave, yaw;                  /* A and B; C is the force of the moment */
    double surge_gain, heave_gain, yaw_gain;    /* beta/m, acceleration per force */
    double arm;                                 /* R sin(gamma), torque per difference of rear thrust */
} rov_gains;

static void rov_prepare(const rov_coefficients *k, rov_gains *gains);

/* Thrust of the commands, saturated to -1 ... 1. */
static void rov_thrust_of(const rov_coefficients *k, const rov_gains *gains, const rov_inputs *in, rov_thrust *F);

/* Time derivatives of the state. */
static void rov_derivatives(const rov_coefficients *k, const rov_gains *gains, const rov_inputs *in,
                            const rov_state *s, rov_state *rate);

/* The state after h > 0 seconds with the inputs held. Not finite only where a result overflows. */
static void rov_step(const rov_coefficients *k, const rov_gains *gains, const rov_inputs *in,
                     const rov_state *s, double h, rov_state *next);

/* Directional derivative: for the changes d of inputs, state and coefficients, those of thrust and state derivatives
 * are written into d. At a command of exactly +-1 the derivative is that of the inside. */
static void rov_tangent(const rov_variables *at, rov_variables *d);

#endif
