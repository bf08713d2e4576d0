/* The dead time: a change of the commands reaches the thrusters and fins T_d seconds later. The commands that act are
 * the variables from FIRST_DELAYED on. The changes that have not arrived yet are in a delay_line. It has the time that
 * each of them still takes, and not the time at which it arrives, which would have fewer digits late in a run. */

enum { MOST_WAITING = 1024 }; /* one in each millisecond of the longest dead time */

typedef struct {
    int waiting;
    double remaining[MOST_WAITING]; /* s, until each change arrives; these times never fall */
    double lost[MOST_WAITING];      /* the rounding error of each, which would add up over many small steps */
    double commands[MOST_WAITING][N_COMMANDS];
} delay_line;

/* Return the commands that were sent last. */
static const double *delay_sent(const delay_line *line, const double at[])
{
    return line->waiting > 0 ? line->commands[line->waiting - 1] : at + FIRST_DELAYED;
}

/* Return true when the present commands differ from those sent before. */
static bool delay_differs(const delay_line *line, const double at[])
{
    const double *const sent = delay_sent(line, at);
    bool differ = false;
    for (int i = 0; i < N_COMMANDS; i++) {
        differ |= at[i] != sent[i];
    }
    return differ;
}

/* Return how many of the waiting changes a new one leaves in place. The new one replaces those that would not arrive
 * before it. */
static int delay_kept(const delay_line *line, double dead_time)
{
    int n = line->waiting;
    while (n > 0 && line->remaining[n - 1] >= dead_time) {
        n--;
    }
    return n;
}

/* Send the present commands, if they differ from those sent before. Return false when too many changes are waiting. */
static bool delay_send(delay_line *line, const double at[])
{
    const int place = delay_kept(line, at[REF_T_d]);
    if (!delay_differs(line, at)) {
        return true;
    }
    if (place == MOST_WAITING) {
        return false;
    }
    line->remaining[place] = at[REF_T_d];
    line->lost[place] = 0.0;
    memcpy(line->commands[place], at, sizeof line->commands[0]);
    line->waiting = place + 1;
    return true;
}

/* Return true when a change with this remaining time acts at time t. What may be the rounding of t does not count, because
 * importers compute the lengths of steps from such times; nor does the rounding of the remaining time. */
static inline bool delay_acts(double remaining, double t)
{
    return remaining <= 4.0 * DBL_EPSILON * (1.0 + fabs(t));
}

/* Let time pass for all changes. */
static void delay_pass(delay_line *line, double passed)
{
    for (int n = 0; n < line->waiting; n++) {
        motion_add(&line->remaining[n], -passed, &line->lost[n]);
    }
}

/* Let the changes act that have arrived by time t. */
static void delay_receive(delay_line *line, double at[], double t)
{
    int n = 0;
    while (n < line->waiting && delay_acts(line->remaining[n], t)) {
        n++;
    }
    if (n > 0) {
        line->waiting -= n;
        memcpy(at + FIRST_DELAYED, line->commands[n - 1], sizeof line->commands[0]);
        for (int i = 0; i < line->waiting; i++) {
            line->remaining[i] = line->remaining[i + n];
            line->lost[i] = line->lost[i + n];
            memcpy(line->commands[i], line->commands[i + n], sizeof line->commands[0]);
        }
    }
}

/* Compute the states after h > 0 seconds from time t. Return the number of pieces, 0 when too many would be needed,
 * or -1 when too many changes are waiting. If the states are usable, delay_commit must follow. */
static int delayed_step(const double at[], const model_numbers *n, const delay_line *line, double t, double h,
                        double next[N_STATES], double *heading)
{
    const bool sends = delay_differs(line, at);
    const int kept = sends ? delay_kept(line, at[REF_T_d]) : line->waiting, all = kept + (sends ? 1 : 0);
    double now[N_VARIABLES], passed = 0.0;
    int pieces = 0, arrived = 0;
    if (all > MOST_WAITING) {
        return -1;
    }
    memcpy(now, at, sizeof now);
    while (passed < h) {
        double until = h;
        for (; arrived < all; arrived++) {
            const double remaining = arrived < kept ? line->remaining[arrived] : at[REF_T_d];
            if (!delay_acts(remaining - passed, t)) {
                until = fmin(h, remaining);
                break;
            }
            memcpy(now + FIRST_DELAYED, arrived < kept ? line->commands[arrived] : at, sizeof line->commands[0]);
        }
        const int more = motion_step(now, n, until - passed, next, heading);
        pieces += more;
        if (more == 0 || pieces > MOST_PIECES) {
            return 0;
        }
        passed = until;
        memcpy(now + FIRST_STATE, next, N_STATES * sizeof now[0]);
        current_keep(now);
    }
    return pieces;
}

/* Send the commands of a step that has been taken, and let those act that have arrived at its end. */
static void delay_commit(double at[], delay_line *line, double t, double h)
{
    current_keep(at);
    (void)delay_send(line, at); /* delayed_step has checked that there is room */
    delay_pass(line, h);
    delay_receive(line, at, t + h);
}
