/* Tables of thrust over the command: a cubic between each two commands. */

/* Return the number of intervals of a table that lie below a command, at most n - 2. The commands of the table rise. */
static int interval_in_table(const double commands[], int n, double command)
{
    int low = 0, high = n - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (command >= commands[middle]) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

/* Return the force at a command, by the cubic that has the forces and the slopes at the ends of its interval. */
static double force_in_table(const double commands[], const double forces[], const double slopes[], int n, double command)
{
    const int i = interval_in_table(commands, n, command);
    const double h = commands[i + 1] - commands[i], t = (command - commands[i]) / h;
    const double f = forces[i], g = forces[i + 1], a = h * slopes[i], b = h * slopes[i + 1];
    return f + t * (a + t * (3.0 * (g - f) - 2.0 * a - b + t * (a + b - 2.0 * (g - f))));
}

/* Return the derivative of force_in_table. */
static double slope_in_table(const double commands[], const double forces[], const double slopes[], int n, double command)
{
    const int i = interval_in_table(commands, n, command);
    const double h = commands[i + 1] - commands[i], t = (command - commands[i]) / h;
    const double f = forces[i], g = forces[i + 1], a = h * slopes[i], b = h * slopes[i + 1];
    return (a + t * (2.0 * (3.0 * (g - f) - 2.0 * a - b) + t * 3.0 * (a + b - 2.0 * (g - f)))) / h;
}
