/* Tables of thrust and of electric current over the command: a cubic between each two commands. */

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

/* Return the value at a command, by the cubic that has the values and the slopes at the ends of its interval. */
static double value_in_table(const double commands[], const double values[], const double slopes[], int n, double command)
{
    const int i = interval_in_table(commands, n, command);
    const double h = commands[i + 1] - commands[i], t = (command - commands[i]) / h;
    const double f = values[i], g = values[i + 1], a = h * slopes[i], b = h * slopes[i + 1];
    return f + t * (a + t * (3.0 * (g - f) - 2.0 * a - b + t * (a + b - 2.0 * (g - f))));
}

/* Return the derivative of value_in_table. */
static double slope_in_table(const double commands[], const double values[], const double slopes[], int n, double command)
{
    const int i = interval_in_table(commands, n, command);
    const double h = commands[i + 1] - commands[i], t = (command - commands[i]) / h;
    const double f = values[i], g = values[i + 1], a = h * slopes[i], b = h * slopes[i + 1];
    return (a + t * (2.0 * (3.0 * (g - f) - 2.0 * a - b) + t * 3.0 * (a + b - 2.0 * (g - f)))) / h;
}
