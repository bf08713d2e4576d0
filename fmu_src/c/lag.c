/* Thrust that lags behind its command. */

/* Return true when a force has arrived at the steady thrust of its command. The force is then set to exactly that thrust. */
static inline bool has_arrived(double *F, double start, double steady, double outstanding)
{
    if (fabs(steady - *F) > 0.5 * DBL_EPSILON * (fabs(steady) + fabs(start)) && outstanding > 0.25 * DBL_EPSILON) {
        return false;
    }
    *F = steady;
    return true;
}

/* Return the larger of `outstanding` and the relative change of a force from `start` to `steady`. */
static inline double larger_change(double outstanding, double start, double steady)
{
    const double change = fabs(steady - start);
    return change > 0.0 ? fmax(outstanding, change / (fabs(steady) + fabs(start))) : outstanding;
}
