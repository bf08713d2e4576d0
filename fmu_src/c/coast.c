/* The rest of a step in which all velocities are steady: straight or circular motion in closed form. */

#if HAS_ATTITUDE
/* Add the changes of the position and the attitude over h seconds. The rotation is y' = L y with L^3 = -w^2 L, and the position
 * rises by h times its rate at the mean of y. */
static void motion_coast(motion *m, double h, double state[N_STATES], double *heading)
{
    double first[N_SERIES], second[N_SERIES], mean[N_SERIES], slope = 0.0, bend = 0.0;
    memcpy(mean, m->y, sizeof mean);
    model_rates(m->n, &m->q, mean, first);
    for (int i = 0; i < N_TURNING; i++) {
        mean[TURNING[i]] = first[TURNING[i]];
        slope += first[TURNING[i]] * first[TURNING[i]];
    }
    model_rates(m->n, &m->q, mean, second);
    for (int i = 0; i < N_TURNING; i++) {
        bend += second[TURNING[i]] * second[TURNING[i]];
    }
    memcpy(mean, m->y, sizeof mean);
    const double w = slope > 0.0 ? sqrt(bend / slope) : 0.0, angle = w * h;
    if (angle != 0.0) {
        const double half = sin(0.5 * angle), whole = sin(angle);
        circle turn = {{0.0}, {0.0}, {0.0}};
        memcpy(turn.start, m->y, sizeof turn.start);
        for (int i = 0; i < N_TURNING; i++) {
            const double along = first[TURNING[i]] / w, across = second[TURNING[i]] / w / w;
            turn.along[TURNING[i]] = along;
            turn.across[TURNING[i]] = across;
            mean[TURNING[i]] += 2.0 * half * half / angle * along + (1.0 - whole / angle) * across;
            m->y[TURNING[i]] += whole * along + 2.0 * half * half * across;
        }
        attitude_after_circle(&turn, angle, state, heading);
    }
    model_rates(m->n, &m->q, mean, first);
    for (int i = N_USED; i < N_SERIES; i++) {
        m->displacement[i] += h * first[i];
    }
}
#else
/* Add the changes of the position and the heading over h seconds. */
static void motion_coast(motion *m, double h, double state[N_STATES], double *heading)
{
    double chord[2] = {0.0, 0.0};
    (void)state, (void)heading;
#if HAS_HEADING
    const double *const y = m->y;
    const double half = 0.5 * h * y[Y_r], length = half != 0.0 ? h * (sin(half) / half) : h;
    const double cosine = cos(half), sine = sin(half); /* the chord of the arc points along the heading in the middle */
    chord[0] = length * (y[Y_cos_psi] * cosine - y[Y_sin_psi] * sine);
    chord[1] = length * (y[Y_sin_psi] * cosine + y[Y_cos_psi] * sine);
#endif
    model_coast(m->n, &m->q, h, m->y, chord, m->displacement);
}
#endif
