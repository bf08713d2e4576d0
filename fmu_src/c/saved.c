/* Saving, restoring and serializing the complete state (FMI 2.0, section 2.1.8; FMI 3.0, section 2.2.7.4). */

/* The serialized state consists of: magic, token, type, mode, flags, time, stop, the heading of a vehicle with an attitude,
 * values, the changes of commands that wait for the dead time or the memory of a model that samples, checksum. Each number has its least
 * significant byte first. */
#if HAS_DEAD_TIME
enum { N_DELAY_WORDS = 1 + MOST_WAITING * (2 + N_COMMANDS) };
#elif defined LINE_OF_DOUBLES
enum { N_DELAY_WORDS = sizeof(delay_line) / sizeof(double) };
#else
enum { N_DELAY_WORDS = 0 };
#endif
enum {
    MAGIC_SIZE = 8,
    TOKEN_SIZE = sizeof MODEL_TOKEN - 1,
    N_HEADER_WORDS = 5 + HAS_ATTITUDE,
    SERIALIZED_SIZE = MAGIC_SIZE + TOKEN_SIZE + 8 * (N_HEADER_WORDS + N_VARIABLES + N_DELAY_WORDS + 1)
};

static const char MAGIC[MAGIC_SIZE + 1] = "ROVSTATE";

static void put_word(unsigned char **to, uint64_t word)
{
    for (int i = 0; i < 8; i++) {
        *(*to)++ = (unsigned char)(word >> (8 * i) & 0xff);
    }
}

static uint64_t get_word(const unsigned char **from)
{
    uint64_t word = 0;
    for (int i = 0; i < 8; i++) {
        word |= (uint64_t) * (*from)++ << (8 * i);
    }
    return word;
}

static void put_double(unsigned char **to, double value)
{
    uint64_t word;
    memcpy(&word, &value, sizeof word);
    put_word(to, word);
}

static double get_double(const unsigned char **from)
{
    const uint64_t word = get_word(from);
    double value;
    memcpy(&value, &word, sizeof value);
    return value;
}

static uint64_t checksum(const unsigned char *bytes, size_t size) /* FNV-1a */
{
    uint64_t hash = 14695981039346656037u;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ bytes[i]) * 1099511628211u;
    }
    return hash;
}

/* Serialize the changes of commands that wait for the dead time, or the memory of a model that samples. */
static void put_line(unsigned char **to, const delay_line *line)
{
#if HAS_DEAD_TIME
    put_word(to, (uint64_t)line->waiting);
    for (int n = 0; n < MOST_WAITING; n++) {
        put_double(to, n < line->waiting ? line->remaining[n] : 0.0);
        put_double(to, n < line->waiting ? line->lost[n] : 0.0);
        for (int i = 0; i < N_COMMANDS; i++) {
            put_double(to, n < line->waiting ? line->commands[n][i] : 0.0);
        }
    }
#elif defined LINE_OF_DOUBLES
    for (int i = 0; i < N_DELAY_WORDS; i++) {
        put_double(to, ((const double *)line)[i]);
    }
#else
    (void)to, (void)line;
#endif
}

/* Deserialize what put_line serializes. Return false unless the number of changes is allowed, all numbers are finite, and the times do not fall. */
static bool get_line(const unsigned char **from, delay_line *line)
{
    bool valid = true;
#if HAS_DEAD_TIME
    const uint64_t waiting = get_word(from);
    line->waiting = waiting <= MOST_WAITING ? (int)waiting : 0;
    valid = waiting <= MOST_WAITING;
    for (int n = 0; n < MOST_WAITING; n++) {
        line->remaining[n] = get_double(from);
        line->lost[n] = get_double(from);
        valid = valid && isfinite(line->remaining[n]) && isfinite(line->lost[n])
                && (n == 0 || n >= line->waiting || line->remaining[n] >= line->remaining[n - 1]);
        for (int i = 0; i < N_COMMANDS; i++) {
            line->commands[n][i] = get_double(from);
            valid = valid && isfinite(line->commands[n][i]);
        }
    }
#elif defined LINE_OF_DOUBLES
    for (int i = 0; i < N_DELAY_WORDS; i++) {
        ((double *)line)[i] = get_double(from);
    }
    valid = all_finite((const double *)line, N_DELAY_WORDS);
#else
    (void)from, (void)line;
#endif
    return valid;
}

/* Refuse a state in a mode that this instance does not have. In Co-Simulation, Event Mode is optional. */
static outcome check_mode_of(fmu *f, const fmu_state *s)
{
    const int stepping = STEP | FAILED | (has_event_mode(&f->host) ? EVENT : 0), mode = (int)s->mode;
    const int modes = s->type == TYPE_MODEL_EXCHANGE ? EVENT | CONTINUOUS : stepping;
    REQUIRE((mode & (modes | INSTANTIATED | INITIALIZATION | TERMINATED)) != 0 && (mode & (mode - 1)) == 0,
            "the state is in %s, which this instance does not use.", mode_name(s->mode));
    return DONE;
}

/* Return true when all numbers of a state are finite, its time is set, and its parameters and inputs are within their bounds. */
static bool is_valid(const fmu_state *s)
{
    bool valid = isfinite(s->time) && !isnan(s->stop) && isfinite(s->heading)
                 && (s->experiment_defined || s->mode == INSTANTIATED);
    for (size_t i = 0; i < N_VARIABLES; i++) {
        const double value = s->values[i];
        const bool bounded = VARIABLES[i].kind == FIXED || VARIABLES[i].kind == TUNABLE;
        valid = valid && isfinite(value) && held((unsigned)i, value) == value
                && (!bounded || (value >= VARIABLES[i].minimum && value <= VARIABLES[i].maximum));
    }
    return valid;
}

/* The memory that an FMU state points to. */
typedef struct {
    const void *owner; /* the address of VARIABLES, by which a state of this FMU is recognized */
    fmu_state state;
} saved_state;

static saved_state *as_saved(void *state)
{
    saved_state *const saved = (saved_state *)state;
    return saved != NULL && saved->owner == VARIABLES ? saved : NULL;
}

/* Return the memory of the given state, or new memory when *state is NULL. */
static saved_state *state_memory(void **state)
{
    if (*state == NULL) {
        saved_state *const saved = (saved_state *)calloc(1, sizeof *saved);
        if (saved != NULL) {
            saved->owner = VARIABLES;
            *state = saved;
        }
        return saved;
    }
    return as_saved(*state);
}

static outcome save(fmu *f, void **state)
{
    REQUIRE(state != NULL, "the state is NULL.");
    saved_state *const saved = state_memory(state);
    REQUIRE(saved != NULL, "out of memory, or *state is not a state of this FMU.");
    saved->state = f->now;
    return DONE;
}

static outcome restore(fmu *f, void *state)
{
    const saved_state *const saved = as_saved(state);
    REQUIRE(saved != NULL, "the state is NULL or not a state of this FMU.");
    REQUIRE(saved->state.type == f->now.type, "the state is of the other interface type.");
    TRY(check_mode_of(f, &saved->state));
    f->now = saved->state;
    model_prepare(f->now.values, &f->numbers);
    REPORT(f, "Restored %s at t = %g s.", mode_name(f->now.mode), f->now.time);
    return DONE;
}

static outcome free_saved(fmu *f, void **state)
{
    if (state == NULL || *state == NULL) {
        return DONE;
    }
    saved_state *const saved = as_saved(*state);
    REQUIRE(saved != NULL, "*state is not a state of this FMU.");
    saved->owner = NULL;
    free(saved);
    *state = NULL;
    return DONE;
}

static outcome serialized_size(fmu *f, void *state, size_t *size)
{
    REQUIRE(as_saved(state) != NULL && size != NULL, "the state is NULL or not a state of this FMU, or size is NULL.");
    *size = SERIALIZED_SIZE;
    return DONE;
}

static outcome serialize(fmu *f, void *state, unsigned char bytes[], size_t size)
{
    const saved_state *const saved = as_saved(state);
    REQUIRE(saved != NULL && bytes != NULL, "the state is NULL or not a state of this FMU, or bytes is NULL.");
    REQUIRE(size >= SERIALIZED_SIZE, "%zu bytes are too few; a state has %d.", size, (int)SERIALIZED_SIZE);
    const fmu_state *const s = &saved->state;
    unsigned char *to = bytes + MAGIC_SIZE + TOKEN_SIZE;
    memcpy(bytes, MAGIC, MAGIC_SIZE);
    memcpy(bytes + MAGIC_SIZE, MODEL_TOKEN, TOKEN_SIZE);
    put_word(&to, (uint64_t)s->type);
    put_word(&to, (uint64_t)s->mode);
    put_word(&to, (s->experiment_defined ? 1u : 0u) | (s->stop_defined ? 2u : 0u) | (s->has_moved ? 4u : 0u));
    put_double(&to, s->time);
    put_double(&to, s->stop);
    if (HAS_ATTITUDE) {
        put_double(&to, s->heading);
    }
    for (size_t i = 0; i < N_VARIABLES; i++) {
        put_double(&to, VARIABLES[i].kind == CALCULATED ? 0.0 : s->values[i]);
    }
    put_line(&to, &s->line);
    put_word(&to, checksum(bytes, SERIALIZED_SIZE - 8));
    return DONE;
}

static outcome deserialize(fmu *f, const unsigned char bytes[], size_t size, void **state)
{
    REQUIRE(bytes != NULL && state != NULL, "bytes or the state is NULL.");
    REQUIRE(size == SERIALIZED_SIZE, "%zu bytes are not a state of this FMU, which has %d.", size, (int)SERIALIZED_SIZE);
    const unsigned char *from = bytes + SERIALIZED_SIZE - 8;
    REQUIRE(memcmp(bytes, MAGIC, MAGIC_SIZE) == 0 && memcmp(bytes + MAGIC_SIZE, MODEL_TOKEN, TOKEN_SIZE) == 0,
            "the bytes are not a state of this FMU.");
    REQUIRE(get_word(&from) == checksum(bytes, SERIALIZED_SIZE - 8), "the bytes are damaged.");
    from = bytes + MAGIC_SIZE + TOKEN_SIZE;
    const uint64_t type = get_word(&from), mode = get_word(&from), flags = get_word(&from);
    REQUIRE(type <= 1 && mode <= FAILED && flags <= (KEEPS_CURRENT ? 7 : 3), "the bytes are damaged.");
    fmu_state s;
    memset(&s, 0, sizeof s);
    s.type = (interface_type)type;
    s.mode = (lifecycle)mode;
    s.experiment_defined = (flags & 1u) != 0;
    s.stop_defined = (flags & 2u) != 0;
    s.has_moved = (flags & 4u) != 0;
    s.time = get_double(&from);
    s.stop = get_double(&from);
    s.heading = HAS_ATTITUDE ? get_double(&from) : 0.0;
    for (size_t i = 0; i < N_VARIABLES; i++) {
        s.values[i] = get_double(&from);
    }
    const bool valid_line = get_line(&from, &s.line);
    TRY(check_mode_of(f, &s));
    REQUIRE(is_valid(&s) && valid_line && has_mass(s.mode, s.values), "the bytes contain values that no run can reach.");
    saved_state *const saved = state_memory(state);
    REQUIRE(saved != NULL, "out of memory, or *state is not a state of this FMU.");
    saved->state = s;
    return DONE;
}
