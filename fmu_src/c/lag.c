/* Thrust that lags behind its command. */

/* Return true when a force has arrived at the steady thrust of its command. The force is then set to exactly that thrust. */
static inline bool has_arrived(double *F, double start, double steady, double remains)
{
    if (fabs(steady - *F) > 0.5 * DBL_EPSILON * (fabs(steady) + fabs(start)) && remains > 0.25 * DBL_EPSILON) {
        return false;
    }
    *F = steady;
    return true;
}

/* Return the larger of `share` and the relative change of a force from `start` to `steady`. */
static inline double larger_share(double share, double start, double steady)
{
    const double change = fabs(steady - start);
    return change > 0.0 ? fmax(share, change / (fabs(steady) + fabs(start))) : share;
}
