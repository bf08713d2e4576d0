/* The dead time: a change of the commands reaches the thrusters and fins T_d seconds later. The commands that act are
 * the variables from FIRST_DELAYED on. The changes that have not arrived yet are in a delay_line. */

enum { MOST_WAITING = 1024 }; /* one in each millisecond of the longest dead time */

typedef struct {
    int waiting;
    double time[MOST_WAITING]; /* at which each change arrives; the times rise */
    double commands[MOST_WAITING][N_COMMANDS];
} delay_line;

/* Return true when the present commands differ from those sent before. */
static bool delay_differs(const delay_line *line, const double at[])
{
    const double *const sent = line->waiting > 0 ? line->commands[line->waiting - 1] : at + FIRST_DELAYED;
    bool differ = false;
    for (int i = 0; i < N_COMMANDS; i++) {
        differ |= at[i] != sent[i];
    }
    return differ;
}

/* Return how many of the waiting changes a new one leaves in place. The new one, which arrives at `arrival`, replaces
 * the last one if that would not arrive before it. */
static int delay_kept(const delay_line *line, double arrival)
{
    const int n = line->waiting;
    return n > 0 && line->time[n - 1] >= arrival ? n - 1 : n;
}

/* Send the present commands at time t, if they differ from those sent before. Return false when too many changes are
 * waiting. */
static bool delay_send(delay_line *line, const double at[], double t)
{
    const double arrival = t + at[REF_T_d];
    const int place = delay_kept(line, arrival);
    if (!delay_differs(line, at)) {
        return true;
    }
    if (place == MOST_WAITING) {
        return false;
    }
    line->time[place] = arrival;
    memcpy(line->commands[place], at, sizeof line->commands[0]);
    line->waiting = place + 1;
    return true;
}

/* Return true when a change that arrives at `arrival` acts at time t. Rounding errors of t do not count. */
static inline bool delay_acts(double arrival, double t)
{
    return arrival <= t + 16.0 * DBL_EPSILON * fabs(t);
}

/* Let the changes act that have arrived by time t. */
static void delay_receive(delay_line *line, double at[], double t)
{
    int n = 0;
    while (n < line->waiting && delay_acts(line->time[n], t)) {
        n++;
    }
    if (n > 0) {
        line->waiting -= n;
        memcpy(at + FIRST_DELAYED, line->commands[n - 1], sizeof line->commands[0]);
        for (int i = 0; i < line->waiting; i++) {
            line->time[i] = line->time[i + n];
            memcpy(line->commands[i], line->commands[i + n], sizeof line->commands[0]);
        }
    }
}

/* Shift the times of all waiting changes, for an importer that sets the time to another value. */
static void delay_move(delay_line *line, double shift)
{
    for (int n = 0; n < line->waiting; n++) {
        line->time[n] += shift;
    }
}

/* Compute the states after h > 0 seconds from time t. Return the number of pieces, 0 when more than MOST_PIECES would
 * be needed, or -1 when too many changes are waiting. If the states are usable, delay_commit must follow. */
static int delayed_step(const double at[], const model_numbers *n, const delay_line *line, double t, double h,
                        double next[N_STATES], double *heading)
{
    const double arrival = t + at[REF_T_d];
    const bool sends = delay_differs(line, at);
    const int kept = sends ? delay_kept(line, arrival) : line->waiting, all = kept + (sends ? 1 : 0);
    double now[N_VARIABLES], passed = 0.0;
    int pieces = 0, arrived = 0;
    if (all > MOST_WAITING) {
        return -1;
    }
    memcpy(now, at, sizeof now);
    while (passed < h) {
        double until = h;
        for (; arrived < all; arrived++) {
            const double time = arrived < kept ? line->time[arrived] : arrival;
            if (!delay_acts(time, t + passed)) {
                until = fmin(h, time - t);
                break;
            }
            memcpy(now + FIRST_DELAYED, arrived < kept ? line->commands[arrived] : at, sizeof line->commands[0]);
        }
        const int more = motion_step(now, n, until - passed, next, heading);
        if (more == 0) {
            return 0;
        }
        pieces += more;
        passed = until;
        memcpy(now + FIRST_STATE, next, N_STATES * sizeof now[0]);
    }
    return pieces;
}

/* Send the commands of a step that has been taken, and let those act that have arrived at its end. */
static void delay_commit(double at[], delay_line *line, double t, double h)
{
    (void)delay_send(line, at, t); /* delayed_step has checked that there is room */
    delay_receive(line, at, t + h);
}
