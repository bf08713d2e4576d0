/* Thrust that lags behind its command: the force F itself, or the speed of the rotor in its place. */

/* Return true when a force has arrived at the steady thrust of its command. The force is then set to exactly that thrust. */
static inline mask has_arrived(real *F, real start, real steady, real outstanding)
{
    const mask is_far = fabs(steady - *F) > 0.5 * DBL_EPSILON * (fabs(steady) + fabs(start)) && outstanding > 0.25 * DBL_EPSILON;
    *F = is_far ? *F : steady;
    return !is_far;
}

/* Return the larger of `outstanding` and the relative change of a force from `start` to `steady`. */
static inline real larger_change(real outstanding, real start, real steady)
{
    const real change = fabs(steady - start);
    return change > 0.0 ? fmax(outstanding, change / (fabs(steady) + fabs(start))) : outstanding;
}
