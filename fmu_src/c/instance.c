/* The functions of an instance, which all versions of FMI share. They check value references and pointers to arrays. */

/* ---- Life ---- */

static outcome enter(fmu *f, lifecycle mode)
{
    f->now.mode = mode;
    REPORT(f, "Entered %s at t = %g s.", mode_name(mode), f->now.time);
    return DONE;
}

/* Warn once of a call that was done in a mode in which the standard does not allow it. */
static void warn_in(fmu *f, lifecycle mode, int what)
{
    if (f->now.mode == mode) {
        WARN_ONCE(f, what, "done, although the standard does not allow this call in %s; logged once.", mode_name(mode));
    }
}

/* Refuse the call unless `exist` is true. `names` are the arguments in the message. */
static outcome check_not_null(fmu *f, bool exist, const char *names)
{
    REQUIRE(exist, "%s is NULL.", names);
    return DONE;
}

static void start(fmu *f)
{
    const interface_type type = f->now.type;
    memset(&f->now, 0, sizeof f->now);
    f->now.type = type;
    f->now.mode = INSTANTIATED;
    for (size_t i = 0; i < N_VARIABLES; i++) {
        f->now.values[i] = VARIABLES[i].start;
    }
    memset(f->warned, 0, sizeof f->warned);
    for (int i = 0; i < N_LOG_CATEGORIES; i++) {
        f->log_enabled[i] = f->logging_on || (LOGS_PROBLEMS_ALWAYS && i != logEvents);
    }
    model_prepare(f->now.values, &f->numbers);
    model_begin(f->now.values, &f->now.heading);
}

/* Write a line that explains why there is no instance, and return NULL. */
#define REJECT(callbacks, name, function, logging_on, ...)                         \
    do {                                                                           \
        if (LOGS_PROBLEMS_ALWAYS || (logging_on)) {                                \
            emit(callbacks, name, function, REFUSED, logStatusError, __VA_ARGS__); \
        }                                                                          \
        return NULL;                                                               \
    } while (0)

/* Return a new instance, or NULL with a line in the log when it is refused. The token must be that of modelDescription.xml. */
static fmu *instantiate(const char *function, const host *callbacks, const char *name, const char *token,
                        interface_type type, bool logging_on)
{
    const char *const shown = name == NULL ? "" : name;
    if (shown[strspn(shown, " \t\r\n\f\v")] == '\0') {
        REJECT(callbacks, shown, function, logging_on, "the instance name is missing or blank.");
    }
    if (token == NULL || strcmp(token, MODEL_TOKEN) != 0) {
        REJECT(callbacks, shown, function, logging_on, "the " TOKEN_NAME " %s is not that of this binary, %s.",
               token == NULL ? "NULL" : token, MODEL_TOKEN);
    }
    if (!(type == TYPE_MODEL_EXCHANGE ? HAS_MODEL_EXCHANGE : HAS_CO_SIMULATION)) {
        REJECT(callbacks, shown, function, logging_on, "this FMU is for %s only.",
               HAS_CO_SIMULATION ? "Co-Simulation" : "Model Exchange");
    }
    fmu *const f = (fmu *)calloc(1, sizeof *f + strlen(shown) + 1);
    if (f == NULL) {
        REJECT(callbacks, shown, function, logging_on, "out of memory.");
    }
    strcpy(f->name, shown);
    memcpy(&f->host, callbacks, sizeof f->host); /* its members are const in the headers of FMI 2.0.0 */
    f->logging_on = logging_on;
    f->now.type = type;
    start(f);
    return f;
}

static outcome choose_logs(fmu *f, bool logging_on, size_t n, const char *const categories[])
{
    REQUIRE(n == 0 || categories != NULL, "categories is NULL.");
    bool chosen[N_LOG_CATEGORIES] = {false};
    for (size_t i = 0; i < n; i++) {
        bool known = false;
        for (int j = 0; j < N_LOG_CATEGORIES && categories[i] != NULL; j++) {
            if (strcmp(categories[i], LOG_CATEGORIES[j]) == 0) {
                chosen[j] = known = true;
            }
        }
        REQUIRE(known, "there is no log category %s.", categories[i] == NULL ? "NULL" : categories[i]);
    }
    for (int j = 0; j < N_LOG_CATEGORIES; j++) {
        if (n == 0 || chosen[j] || chosen[logAll]) {
            f->log_enabled[j] = logging_on;
        }
    }
    return DONE;
}

static outcome set_up(fmu *f, double start_time, bool stop_defined, double stop)
{
    REQUIRE(isfinite(start_time), "startTime = %g is not a finite number.", start_time);
    REQUIRE(!stop_defined || stop >= start_time, "stopTime = %g s lies before startTime = %g s.", stop, start_time);
    f->now.experiment_defined = true;
    f->now.time = start_time;
    f->now.stop_defined = stop_defined;
    f->now.stop = stop_defined ? stop : 0.0;
    return DONE;
}

static outcome initialize(fmu *f)
{
    if (!f->now.experiment_defined) {
        WARN_ONCE(f, NOT_SET_UP, "done without fmi2SetupExperiment, which the standard requires; the simulation begins at t = 0 "
                  "and has no stopTime. Logged once.");
        f->now.experiment_defined = true;
    }
    return enter(f, INITIALIZATION);
}

static outcome run(fmu *f)
{
    REQUIRE(model_is_definite(&f->numbers), "the mass matrix of these parameters is not positive definite.");
    return enter(f, f->now.type == TYPE_MODEL_EXCHANGE || has_event_mode(&f->host) ? EVENT : STEP);
}

static outcome terminate(fmu *f)
{
    warn_in(f, INITIALIZATION, ENDED_EARLY);
    return enter(f, TERMINATED);
}

static outcome reset(fmu *f)
{
    start(f);
    REPORT(f, "Reset.");
    return DONE;
}

/* ---- Values ---- */

/* Compute the calculated variables. This is done only when they are read. */
static void calculate(fmu *f)
{
    model_calculate(f->now.values, &f->numbers, f->now.heading);
}

/* Return the address of the value at a place, or of the time if FMI 3.0 reads it as a variable. Return NULL when there
 * is no such variable. */
static const double *variable(const fmu *f, unsigned place)
{
    return place < N_VARIABLES ? &f->now.values[place] : HAS_TIME && place == TIME ? &f->now.time : NULL;
}

static outcome get_values(fmu *f, const unsigned vr[], size_t n, double value[])
{
    REQUIRE(n == 0 || (vr != NULL && value != NULL), "vr or value is NULL.");
    bool calculated = false;
    for (size_t i = 0; i < n; i++) {
        const unsigned place = place_of(vr[i]);
        REQUIRE(variable(f, place) != NULL, "there is no " REAL " with value reference %u.", vr[i]);
        calculated = calculated || (place < N_VARIABLES && VARIABLES[place].kind == CALCULATED);
    }
    if (calculated) {
        calculate(f);
        for (size_t i = 0; i < n; i++) {
            const unsigned place = place_of(vr[i]);
            if (!isfinite(*variable(f, place))) {
                const bool exchange = f->now.type == TYPE_MODEL_EXCHANGE;
                REFUSE(f, exchange ? DISCARDED : REFUSED, exchange ? logStatusDiscard : logStatusError, "%s overflows.",
                       VARIABLES[place].name);
            }
        }
    }
    for (size_t i = 0; i < n; i++) {
        value[i] = *variable(f, place_of(vr[i]));
    }
    warn_in(f, INSTANTIATED, READ_EARLY);
    return DONE;
}

/* Return true when a variable is a command that changes only in events, because it acts after a dead time. */
static bool is_discrete(unsigned place)
{
    return HAS_DEAD_TIME && place < N_COMMANDS;
}

/* Return true when a variable may be set now (FMI 2.0, sections 2.2.7, 3.2.3 and 4.2.4; FMI 3.0, sections 2.4.7.4 and
 * 4.2.1). More calls are allowed because importers make them: inputs before initialization, and between the steps of an
 * integrator parameters and commands that are discrete. */
static bool may_set(const fmu *f, unsigned place)
{
    const variable_kind kind = VARIABLES[place].kind;
    switch (f->now.mode) {
    case INSTANTIATED: return kind != CALCULATED && kind != MEMORY;
    case INITIALIZATION: return kind != CALCULATED && kind != CALCULATED_STATE && kind != MEMORY;
    case EVENT: return kind == INPUT || kind == TUNABLE || ((kind == STATE || kind == CALCULATED_STATE) && EVENTS_SET_STATES);
    case STEP: return kind == INPUT || kind == TUNABLE;
    case CONTINUOUS: return kind == INPUT || kind == STATE || kind == CALCULATED_STATE || kind == TUNABLE;
    case INTERMEDIATE: return kind == INPUT && !is_discrete(place);
    case TERMINATED:
    case FAILED: break;
    }
    return false;
}

/* Return true when a command is a pulse width of 0: there is no signal. A command that is a fraction may be 0. */
static bool is_no_signal(unsigned place, double value)
{
    return place < N_COMMANDS && value == 0.0 && VARIABLES[place].minimum > 0.0;
}

/* Return the value that a variable gets: that of an input is held to its range here, so that no model has to. */
static double held(unsigned place, double value)
{
    const variable_info *const info = &VARIABLES[place];
    if (info->kind != INPUT || is_no_signal(place, value)) {
        return value;
    }
    return value < info->minimum ? info->minimum : value > info->maximum ? info->maximum : value;
}

/* Return true when a value is the one that a variable has already. Importers set parameters and start values again. */
static bool is_repeated(const fmu *f, unsigned place, double value)
{
    const variable_kind kind = VARIABLES[place].kind;
    return kind != CALCULATED && kind != MEMORY && held(place, value) == f->now.values[place];
}

/* Return true when the standard asks for Event Mode before a parameter is changed. For Step Mode, FMI 3.0 contradicts
 * itself: section 2.4.7.4 asks for it, and section 4.2.1 does not. */
static bool is_for_event_mode(const fmu *f)
{
    return f->now.mode == CONTINUOUS || (f->now.mode == STEP && has_event_mode(&f->host));
}

/* Compute the attitude at the start. It replaces a quaternion that is among the values that were set. */
static void replace_guess(fmu *f, const unsigned vr[], size_t n, const double value[])
{
    model_begin(f->now.values, &f->now.heading);
    for (size_t i = 0; i < n; i++) {
        const unsigned place = place_of(vr[i]);
        if (VARIABLES[place].kind == CALCULATED_STATE && value[i] != f->now.values[place]) {
            WARN_ONCE(f, GUESSED, "%s = %.15g is replaced by %.15g, because phi_0, theta_0 and psi_0 determine the attitude at "
                      "the start. Logged once.", VARIABLES[place].name, value[i], f->now.values[place]);
        }
    }
}

/* Warn about a voltage for each curve whose tables do not reach it. */
static void check_voltage(fmu *f, double voltage)
{
#if N_VOLTAGE_RANGES
    for (int i = 0; i < N_VOLTAGE_RANGES; i++) {
        const double low = VOLTAGE_RANGES[i].minimum, high = VOLTAGE_RANGES[i].maximum;
        if (voltage < low || voltage > high) {
            WARN_ONCE(f, VOLTAGE_BEYOND + i, "voltage = %.15g saturates at %g for the thrust curve %s; logged once.", voltage,
                      voltage < low ? low : high, VOLTAGE_RANGES[i].curves);
        }
    }
#endif
    (void)f, (void)voltage;
}

/* Return true when an instance may have these values in a mode: during a run, the mass matrix is positive definite. Before the
 * run, parameters may be set one after the other, and the end of the initialization refuses the matrix. */
static bool has_mass(lifecycle mode, const double values[])
{
    model_numbers numbers;
    if (mode == INSTANTIATED || mode == INITIALIZATION) {
        return true;
    }
    model_prepare(values, &numbers);
    return model_is_definite(&numbers);
}

/* Refuse parameters with which the mass matrix is not positive definite during a run. */
static outcome check_mass(fmu *f, const unsigned vr[], size_t n, const double value[])
{
    double at[N_VARIABLES];
    memcpy(at, f->now.values, sizeof at);
    for (size_t i = 0; i < n; i++) {
        at[place_of(vr[i])] = value[i];
    }
    if (!has_mass(f->now.mode, at)) {
        DISCARD(f, "the mass matrix of these parameters is not positive definite; all of them stay as they are.");
    }
    return DONE;
}

static outcome set_values(fmu *f, const unsigned vr[], size_t n, const double value[])
{
    REQUIRE(n == 0 || (vr != NULL && value != NULL), "vr or value is NULL.");
    bool coefficient = false;
    for (size_t i = 0; i < n; i++) { /* all values are checked before any is set */
        const unsigned place = place_of(vr[i]);
        REQUIRE(place < N_VARIABLES, "there is no " REAL " with value reference %u%s.", vr[i],
                HAS_TIME && place == TIME ? " to be set" : "");
        const variable_info *const info = &VARIABLES[place];
        const double old = f->now.values[place];
        REQUIRE(may_set(f, place) || is_repeated(f, place, value[i]), "%s must not be set in %s.", info->name,
                mode_name(f->now.mode));
        if (!isfinite(value[i])) {
            DISCARD(f, "%s = %g is not a finite number; it stays %.15g.", info->name, value[i], old);
        }
        if (info->kind == FIXED || info->kind == TUNABLE) {
            coefficient = true;
            if (value[i] < info->minimum || value[i] > info->maximum) {
                DISCARD(f, "%s = %.15g is not within %g ... %g; it stays %.15g.", info->name, value[i], info->minimum,
                        info->maximum, old);
            }
        }
    }
    if (coefficient) {
        TRY(check_mass(f, vr, n, value));
    }
    for (size_t i = 0; i < n; i++) {
        const unsigned place = place_of(vr[i]);
        const variable_info *const info = &VARIABLES[place];
        if (!may_set(f, place)) {
            WARN_ONCE(f, SET_AGAIN, "%s must not be set in %s, but it has this value already; logged once.", info->name,
                      mode_name(f->now.mode));
            continue;
        }
        f->now.values[place] = held(place, value[i]);
        if (is_discrete(place) && f->now.mode == CONTINUOUS) {
            WARN_ONCE(f, COMMANDED_BETWEEN_EVENTS, "%s is set, although the standard requires Event Mode for this; it is sent "
                      "when the integrator completes its step. Logged once.", info->name);
        }
        if (is_no_signal(place, value[i])) {
            WARN_ONCE(f, NO_SIGNAL, "%s = 0 means that there is no signal: it acts as neutral; logged once.", info->name);
        } else if (place == VOLTAGE) {
            check_voltage(f, value[i]);
        } else if (info->kind == INPUT && f->now.values[place] != value[i]) {
            WARN_ONCE(f, place, "%s = %.15g saturates at %g; logged once.", info->name, value[i], f->now.values[place]);
        } else if (info->kind == TUNABLE && is_for_event_mode(f)) {
            WARN_ONCE(f, TUNED_BETWEEN_EVENTS, "%s is set, although the standard requires Event Mode for this; logged once.",
                      info->name);
        }
    }
    if (coefficient) {
        model_prepare(f->now.values, &f->numbers);
    }
    if (!f->now.has_moved) {
        current_keep(f->now.values); /* the current of the first step is the one before it */
    }
    if (f->now.mode == INSTANTIATED || f->now.mode == INITIALIZATION) {
        replace_guess(f, vr, n, value);
    }
    return DONE;
}

/* Refuse variables of a type that the FMU does not have. A call for none of them is legal. */
static outcome check_none(fmu *f, size_t n, const char *type)
{
    REQUIRE(n == 0, "this FMU has no %s variables.", type);
    return DONE;
}

/* ---- States ---- */

static outcome set_states(fmu *f, const double x[], size_t n)
{
    REQUIRE(n == N_STATES && x != NULL, "%zu states are given, or the array is NULL; the FMU has %d states.", n, N_STATES);
    for (size_t i = 0; i < N_STATES; i++) {
        if (!isfinite(x[i])) {
            DISCARD(f, "%s = %g is not a finite number; it stays %.15g.", VARIABLES[FIRST_STATE + i].name, x[i],
                    f->now.values[FIRST_STATE + i]);
        }
    }
    if (!model_has_direction(x)) {
        DISCARD(f, "the quaternion is 0, which has no direction; the states are not changed.");
    }
    memcpy(&f->now.values[FIRST_STATE], x, N_STATES * sizeof x[0]);
    return DONE;
}

/* Send the present commands, if they differ from those sent before. *sends becomes true if they do. */
static outcome send_commands(fmu *f, bool *sends)
{
    *sends = false;
#if HAS_DEAD_TIME
    *sends = delay_differs(&f->now.line, f->now.values);
    REQUIRE(delay_send(&f->now.line, f->now.values),
            "too many changes of commands wait for the dead time at t = %g.", f->now.time);
#endif
    (void)f;
    return DONE;
}

/* Count the turns of the heading at the end of an integrator's step, and send the commands that were set since the last one.
 * *event becomes true when an event has to follow: commands were sent, and the importer does not know yet when they arrive, or
 * it has passed the time at which others arrive. */
static outcome complete_step(fmu *f, bool *event)
{
    double heading = f->now.heading;
    if (HAS_ATTITUDE) {
        heading = model_heading(f->now.values, heading);
        if (!isfinite(heading)) {
            DISCARD(f, "psi is not a finite number; the heading stays %.15g.", f->now.heading);
        }
    }
    TRY(send_commands(f, event));
#if HAS_DEAD_TIME
    *event = *event || (f->now.line.waiting > 0 && delay_acts(f->now.line.remaining[0], f->now.time));
#endif
    f->now.heading = heading;
    return DONE;
}

/* Enter Event Mode. The commands that a solver has tried since the last completed step leave no trace. */
static outcome enter_events(fmu *f)
{
#if HAS_DEAD_TIME
    if (f->now.mode == CONTINUOUS) {
        memcpy(f->now.values, delay_sent(&f->now.line, f->now.values), N_COMMANDS * sizeof f->now.values[0]);
    }
#endif
    return enter(f, EVENT);
}

/* Leave Event Mode for Continuous-Time Mode. The commands that were set in the last event count as sent in it. */
static outcome leave_events(fmu *f)
{
    bool sends;
    TRY(send_commands(f, &sends));
    return enter(f, CONTINUOUS);
}

static outcome check_state_array(fmu *f, const double to[], size_t n)
{
    REQUIRE(n == N_STATES && to != NULL, "%zu states are requested, or the array is NULL; the FMU has %d states.", n, N_STATES);
    return DONE;
}

static outcome get_states(fmu *f, double x[], size_t n)
{
    TRY(check_state_array(f, x, n));
    memcpy(x, &f->now.values[FIRST_STATE], N_STATES * sizeof x[0]);
    return DONE;
}

static outcome get_rates(fmu *f, double rates[], size_t n)
{
    TRY(check_state_array(f, rates, n));
    calculate(f);
    for (size_t i = 0; i < N_STATES; i++) {
        if (!isfinite(f->now.values[FIRST_CALCULATED + i])) {
            DISCARD(f, "%s overflows.", VARIABLES[FIRST_CALCULATED + i].name);
        }
    }
    memcpy(rates, &f->now.values[FIRST_CALCULATED], N_STATES * sizeof rates[0]);
    return DONE;
}

static outcome get_nominals(fmu *f, double nominals[], size_t n)
{
    TRY(check_state_array(f, nominals, n));
    for (size_t i = 0; i < N_STATES; i++) {
        nominals[i] = VARIABLES[FIRST_STATE + i].nominal;
    }
    return DONE;
}

static outcome get_indicators(fmu *f, size_t n)
{
    REQUIRE(n == 0, "%zu event indicators are requested; the FMU has none.", n);
    return DONE;
}

/* In Model Exchange, let the commands act that have arrived after the dead time. *has_next becomes true when another change
 * waits, and *next then becomes the time at which it arrives. In Co-Simulation nothing changes. */
static outcome update_discrete(fmu *f, bool *has_next, double *next)
{
    *has_next = false;
    *next = 0.0;
#if HAS_DEAD_TIME
    if (f->now.type == TYPE_MODEL_EXCHANGE) {
        delay_line *const line = &f->now.line;
        bool sends;
        TRY(send_commands(f, &sends));
        delay_receive(line, f->now.values, f->now.time);
        *has_next = line->waiting > 0;
        *next = *has_next ? fmin(f->now.time + line->remaining[0], DBL_MAX) : 0.0;
    }
#endif
    (void)f;
    return DONE;
}

/* A time beyond stopTime is allowed. Solvers step beyond the end and interpolate back, and CasADi always sets stopTime
 * to 1. The model does not depend on time, so it is valid there too. */
static outcome set_time(fmu *f, double time)
{
    REQUIRE(isfinite(time), "time = %g is not a finite number.", time);
#if HAS_DEAD_TIME
    delay_pass(&f->now.line, fmin(fmax(time - f->now.time, -1e300), 1e300)); /* the difference may overflow */
#endif
    f->now.time = time;
    warn_in(f, EVENT, TIME_SET_IN_EVENT);
    return DONE;
}

/* ---- Partial derivatives ---- */

static const char *name_of(unsigned reference)
{
    const unsigned place = place_of(reference);
    return place < N_VARIABLES ? VARIABLES[place].name : "an unknown value reference";
}

/* Return true when derivatives may be taken with respect to this variable: inputs and states always, parameters only during
 * initialization (FMI 2.0, section 2.1.9; FMI 3.0, section 2.2.12). */
static bool is_known(const fmu *f, unsigned reference)
{
    const unsigned place = place_of(reference);
    const variable_kind kind = place < N_VARIABLES ? VARIABLES[place].kind : CALCULATED;
    return kind == INPUT || kind == STATE || kind == CALCULATED_STATE
           || (kind != CALCULATED && kind != MEMORY && f->now.mode == INITIALIZATION);
}

static bool is_unknown(unsigned reference)
{
    const unsigned place = place_of(reference);
    const variable_kind kind = place < N_VARIABLES ? VARIABLES[place].kind : INPUT;
    return kind == STATE || kind == CALCULATED_STATE || kind == CALCULATED;
}

static outcome check_partial(fmu *f, const unsigned unknowns[], size_t n_unknowns, const unsigned knowns[], size_t n_knowns,
                           const double seed[], size_t n_seed, double sensitivity[], size_t n_sensitivity, bool adjoint)
{
    const size_t from = adjoint ? n_unknowns : n_knowns, to = adjoint ? n_knowns : n_unknowns;
    REQUIRE((n_unknowns == 0 || unknowns != NULL) && (n_knowns == 0 || knowns != NULL) && (from == 0 || seed != NULL)
                && (to == 0 || sensitivity != NULL),
            "an argument is NULL.");
    REQUIRE(n_seed >= from && n_sensitivity >= to, "%zu seeds and %zu sensitivities are given; it takes %zu and %zu.", n_seed,
            n_sensitivity, from, to);
    for (size_t i = 0; i < n_knowns; i++) {
        REQUIRE(is_known(f, knowns[i]), "%s is not a known variable in %s.", name_of(knowns[i]), mode_name(f->now.mode));
    }
    for (size_t i = 0; i < n_unknowns; i++) {
        REQUIRE(is_unknown(unknowns[i]), "%s is neither an output nor a derivative.", name_of(unknowns[i]));
    }
    return DONE;
}

/* Compute the changes of the calculated variables from those of the others in d. */
static void add_changes(const fmu *f, double d[N_VARIABLES])
{
    if (f->now.mode == INITIALIZATION) {
        model_begin_tangent(f->now.values, d);
    }
    model_tangent(f->now.values, d);
}

/* Compute sensitivity = J seed. */
static outcome differentiate(fmu *f, const unsigned unknowns[], size_t n_unknowns, const unsigned knowns[],
                             size_t n_knowns, const double seed[], size_t n_seed, double sensitivity[],
                             size_t n_sensitivity)
{
    TRY(check_partial(f, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity, false));
    double d[N_VARIABLES] = {0.0};
    for (size_t i = 0; i < n_knowns; i++) {
        d[place_of(knowns[i])] += seed[i];
    }
    add_changes(f, d);
    for (size_t i = 0; i < n_unknowns; i++) {
        REQUIRE(isfinite(d[place_of(unknowns[i])]), "the derivative of %s is not a finite number.", name_of(unknowns[i]));
    }
    for (size_t i = 0; i < n_unknowns; i++) {
        sensitivity[i] = d[place_of(unknowns[i])];
    }
    return DONE;
}

static bool is_output(unsigned reference)
{
    const unsigned place = place_of(reference);
    return place < N_VARIABLES && VARIABLES[place].is_output;
}

/* Return the first time derivatives of outputs while the inputs are held. */
static outcome get_output_rates(fmu *f, const unsigned vr[], size_t n, const int order[], double value[])
{
    REQUIRE(n == 0 || (vr != NULL && order != NULL && value != NULL), "vr, order or value is NULL.");
    for (size_t i = 0; i < n; i++) {
        REQUIRE(is_output(vr[i]), "value reference %u is not an output.", vr[i]);
        REQUIRE(order[i] == 1, "order %d of %s is not available, only 1.", order[i], name_of(vr[i]));
    }
    double rates[N_VARIABLES] = {0.0};
    calculate(f);
    memcpy(rates + FIRST_STATE, f->now.values + FIRST_CALCULATED, N_STATES * sizeof rates[0]);
    model_tangent(f->now.values, rates); /* the rates of the other outputs, which follow from those of the states */
    for (size_t i = 0; i < n; i++) {
        REQUIRE(isfinite(rates[place_of(vr[i])]), "the derivative of %s overflows.", name_of(vr[i]));
    }
    for (size_t i = 0; i < n; i++) {
        value[i] = rates[place_of(vr[i])];
    }
    return DONE;
}

/* ---- Steps ---- */

/* Return how far rounding may move a communication point: relative to its size, and at most half a step. */
static double time_tolerance(double t, double h)
{
    return fmin(1e-9 * (fabs(t) + h), 0.5 * h);
}

/* Refuse a step from t over h seconds that is not a step forward or passes stopTime. */
static outcome check_step(fmu *f, double t, double h)
{
    REQUIRE(h > 0.0 && isfinite(t + h), "communicationStepSize = %g at t = %g is not a step forward.", h, t);
    REQUIRE(!f->now.stop_defined || t + h <= f->now.stop + time_tolerance(f->now.stop, h),
            "a step of %g s from t = %.15g passes stopTime = %.15g.", h, t, f->now.stop);
    return DONE;
}

/* Warn when a step from t does not begin at `time`, the time of the FMU. */
static void follow_jump(fmu *f, double time, double t, double h)
{
    if (fabs(t - time) > time_tolerance(time, h)) {
        WARN_ONCE(f, TIME_JUMPED, "the step from t = %.15g does not begin at t = %.15g, the time of the FMU; "
                  "it begins at the state of the FMU. Logged once.", t, time);
    }
}

/* Warn when a vehicle is above the surface, which its model does not have. */
static void check_depth(fmu *f)
{
    if ((int)DEPTH < N_VARIABLES && f->now.values[DEPTH] < -AFLOAT) {
        WARN_ONCE(f, OUT_OF_WATER, LEFT_WATER "; logged once.", f->now.time);
    }
}

/* Advance the states by h seconds from t with the inputs held. Add to *cuts the number of pieces beyond the first one. */
static outcome advance(fmu *f, double t, double h, int *cuts)
{
    double next[N_STATES], heading = f->now.heading;
    const int pieces = delayed_step(f->now.values, &f->numbers, &f->now.line, f->now.time, h, next, &heading);
    REQUIRE(pieces >= 0, "too many changes of commands wait for the dead time at t = %g; change them less often.", t);
    *cuts += pieces - 1;
    if (pieces == 0 || *cuts >= MOST_PIECES) {
        f->now.mode = FAILED;
        FAIL(f, "the motion over %g s from t = %g takes too many pieces: it is too fast, or the step is too long. The state "
             "from before is kept.", h, t);
    }
    if (!all_finite(next, N_STATES)) {
        f->now.mode = FAILED;
        FAIL(f, "the motion over %g s from t = %g overflows; the state from before is kept.", h, t);
    }
    memcpy(&f->now.values[FIRST_STATE], next, sizeof next);
    delay_commit(f->now.values, &f->now.line, f->now.time, h);
    f->now.has_moved = KEEPS_CURRENT;
    f->now.heading = heading;
    f->now.time = t + h; /* the model is autonomous: whatever t says, h seconds have passed */
    check_depth(f);
    return DONE;
}

static outcome step(fmu *f, double t, double h)
{
    const double time = f->now.time;
    int cuts = 0;
    TRY(check_step(f, t, h));
    TRY(advance(f, t, h, &cuts));
    follow_jump(f, time, t, h);
    return DONE;
}
