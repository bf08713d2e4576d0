/* Eight threads that drive instances of their own, compared call by call with the same calls in one thread.
 *
 * A session is a pair of instances, one of each interface type, and a random sequence of every kind of call, legal or
 * not. It is driven in two halves by different threads, so instances and saved states end in another thread than they
 * began in. Prints how many calls were made, accepted and logged; the exit code is 1 where a session differs. */
#define _POSIX_C_SOURCE 200809L
#define FMI3_OVERRIDE_FUNCTION_PREFIX
#include "fmu.c"

#include "check.h"
#include "versions.h"

#include <pthread.h>

enum { N_SESSIONS = 8, N_HALVES = 2, N_KINDS = 2 };

typedef struct {
    uint64_t random, seen; /* state of the generator; hash of all that the calls gave back */
    uint64_t *trace;       /* the hash after each call */
    size_t calls, accepted, messages;
    struct {
        void *instance, *saved;
        double time, longest; /* of a step */
    } of[N_KINDS]; /* by interface_type */
} session;

static size_t calls_of_a_half;
static pthread_barrier_t together;

/* ---- What is seen and what is drawn ---- */

static void see(session *s, const void *data, size_t size)
{
    const unsigned char *const bytes = data;
    for (size_t i = 0; i < size; i += 8) {
        uint64_t word = 0;
        memcpy(&word, bytes + i, size - i < 8 ? size - i : 8);
        s->seen = (s->seen ^ word) * 1099511628211u;
        s->seen ^= s->seen >> 29;
    }
}

/* Below n: xorshift. */
static unsigned draw(session *s, unsigned n)
{
    s->random ^= s->random << 13;
    s->random ^= s->random >> 7;
    s->random ^= s->random << 17;
    return (unsigned)((s->random >> 11) % n);
}

static double draw_between(session *s, double low, double high)
{
    return low + (high - low) * draw(s, 1u << 20) / (1u << 20);
}

static void log_line(session *s, result status, const char *category, const char *text)
{
    see(s, &status, sizeof status);
    see(s, category, strlen(category));
    see(s, text, strlen(text));
    s->messages++;
}

/* ---- The calls ---- */

static result set_inputs(session *s, void *c)
{
    unsigned vr[FIRST_STATE];
    double values[FIRST_STATE];
    for (unsigned i = 0; i < FIRST_STATE; i++) {
        vr[i] = FIRST_REFERENCE + i;
        values[i] = draw_between(s, -1.1, 1.1);
    }
    return FMI(SetReal)(c, vr, FIRST_STATE, values AND(FIRST_STATE));
}

#if FMI_VERSION == 3
static void logger(fmi3InstanceEnvironment environment, result status, fmi3String category, fmi3String text)
{
    log_line(environment, status, category, text);
}

/* Sets inputs inside a step, and ends it early, now and then. */
static void update_step(fmi3InstanceEnvironment environment, double time, bool may_set, bool may_get, bool finished,
                   bool may_return, fmi3Boolean *early, double *end)
{
    session *const s = environment;
    see(s, &time, sizeof time);
    *early = may_return && draw(s, 20) == 0;
    *end = time;
    if (may_set && may_get && finished && draw(s, 4) == 0) {
        set_inputs(s, s->of[TYPE_CO_SIMULATION].instance);
    }
}

static void instantiate_of(session *s, int kind, const char *name)
{
    const bool tells = draw(s, 2) == 0, updates = draw(s, 2) == 0;
    s->of[kind].longest = kind == TYPE_CO_SIMULATION && updates ? 2e-3 : 2.0;
    s->of[kind].instance = kind == TYPE_MODEL_EXCHANGE
                               ? fmi3InstantiateModelExchange(name, MODEL_TOKEN, NULL, false, tells, s, logger)
                               : fmi3InstantiateCoSimulation(name, MODEL_TOKEN, NULL, false, tells, draw(s, 2) == 0, updates,
                                                             NULL, 0, s, logger, update_step);
}

static result begin_at(session *s, int kind, double time)
{
    void *const c = s->of[kind].instance;
    fmi3Boolean flags[5];
    double next;
    result worst = fmi3EnterInitializationMode(c, false, 0.0, time, false, 0.0);
    worst |= fmi3ExitInitializationMode(c);
    if (((fmu *)c)->now.mode == EVENT) {
        worst |= fmi3UpdateDiscreteStates(c, &flags[0], &flags[1], &flags[2], &flags[3], &flags[4], &next);
        worst |= (kind == TYPE_MODEL_EXCHANGE ? fmi3EnterContinuousTimeMode(c) : fmi3EnterStepMode(c));
    }
    return worst;
}

static result do_step(session *s, int kind, double h)
{
    fmi3Boolean event, stop, early;
    double last = s->of[kind].time;
    const result status = fmi3DoStep(s->of[kind].instance, last, h, true, &event, &stop, &early, &last);
    s->of[kind].time = last;
    return status;
}
#else
static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    see(environment, name, strlen(name));
    log_line(environment, status, category, message);
}

static void instantiate_of(session *s, int kind, const char *name)
{
    const fmi2CallbackFunctions callbacks = {logger, NULL, NULL, NULL, s};
    s->of[kind].longest = 2.0;
    s->of[kind].instance = fmi2Instantiate(name, kind, MODEL_TOKEN, NULL, &callbacks, fmi2False, draw(s, 2) == 0);
}

static result begin_at(session *s, int kind, double time)
{
    void *const c = s->of[kind].instance;
    fmi2EventInfo info;
    result worst = fmi2SetupExperiment(c, fmi2False, 0.0, time, fmi2False, 0.0);
    worst |= fmi2EnterInitializationMode(c);
    worst |= fmi2ExitInitializationMode(c);
    if (kind == TYPE_MODEL_EXCHANGE) {
        worst |= fmi2NewDiscreteStates(c, &info);
        worst |= fmi2EnterContinuousTimeMode(c);
    }
    return worst;
}

static result do_step(session *s, int kind, double h)
{
    const result status = fmi2DoStep(s->of[kind].instance, s->of[kind].time, h, fmi2True);
    s->of[kind].time += h;
    return status;
}
#endif

static void make(session *s, int kind)
{
    char name[64];
    memset(name, 'n', sizeof name);
    name[1 + draw(s, sizeof name - 1)] = '\0';
    instantiate_of(s, kind, name);
}

static result begin(session *s, int kind)
{
    s->of[kind].time = draw_between(s, 0.0, 10.0);
    return begin_at(s, kind, s->of[kind].time);
}

static result set_any(session *s, void *c)
{
    static const double strange[] = {0.0, -0.0, NAN, INFINITY, 1e308, 5e-324};
    const unsigned vr = FIRST_REFERENCE + draw(s, N_VARIABLES + 1);
    const bool plain = draw(s, 4) != 0;
    const double value = plain ? draw_between(s, -2.0, 2.0) : strange[draw(s, sizeof strange / sizeof strange[0])];
    return FMI(SetReal)(c, &vr, 1, &value AND(1));
}

static result take_step(session *s, int kind)
{
    void *const c = s->of[kind].instance;
    const double h = draw_between(s, 1e-3, s->of[kind].longest);
    if (kind == TYPE_CO_SIMULATION || draw(s, 20) == 0) {
        return do_step(s, kind, h);
    }
    double x[N_STATES], rate[N_STATES]; /* explicit Euler */
    result status = FMI(GetContinuousStates)(c, x, N_STATES);
    status |= FMI(GetDerivatives)(c, rate, N_STATES);
    for (int i = 0; i < N_STATES && status == FMI(OK); i++) {
        x[i] += 1e-3 * h * rate[i];
    }
    status |= status == FMI(OK) ? FMI(SetContinuousStates)(c, x, N_STATES) : FMI(OK);
    s->of[kind].time += h;
    return status | FMI(SetTime)(c, s->of[kind].time);
}

static result serialize_again(session *s, int kind)
{
    void *const c = s->of[kind].instance;
    octet bytes[2 * SERIALIZED_SIZE];
    size_t size = 0;
    result status = FMI(SerializedFMUstateSize)(c, s->of[kind].saved, &size);
    status |= FMI(SerializeFMUstate)(c, s->of[kind].saved, bytes, size);
    if (status == FMI(OK)) {
        see(s, bytes, size);
        bytes[draw(s, SERIALIZED_SIZE)] ^= draw(s, 4) == 0; /* damaged, now and then */
        status = FMI(DeSerializeFMUstate)(c, bytes, size, &s->of[kind].saved);
    }
    return status;
}

static result get_partial(session *s, void *c)
{
    const unsigned known = FIRST_REFERENCE + draw(s, FIRST_CALCULATED + 1);
    unsigned unknown[N_STATES];
    double seed = 1.0, change[N_STATES] = {0.0};
    for (unsigned i = 0; i < N_STATES; i++) {
        unknown[i] = FIRST_REFERENCE + FIRST_CALCULATED + i;
    }
    const result status = FMI(GetDirectionalDerivative)(c, unknown, N_STATES, &known, 1, &seed AND(1), change AND(N_STATES));
    see(s, change, sizeof change);
    return status;
}

static result start_again(session *s, int kind)
{
    void *const c = s->of[kind].instance;
    result status = draw(s, 2) == 0 ? FMI(Terminate)(c) : FMI(OK);
    status |= FMI(Reset)(c);
    for (unsigned i = draw(s, 4); i > 0; i--) {
        set_any(s, c);
    }
    return status | begin(s, kind);
}

static result replace(session *s, int kind)
{
    FMI(FreeInstance)(s->of[kind].instance);
    make(s, kind);
    return begin(s, kind);
}

static result any_call(session *s, int kind)
{
    void *const c = s->of[kind].instance;
    void **const saved = &s->of[kind].saved;
    const char *const category = LOG_CATEGORIES[draw(s, N_LOG_CATEGORIES)];
    switch (draw(s, 16)) {
    case 0: return set_any(s, c);
    case 1: return set_inputs(s, c);
    case 2: return FMI(GetFMUstate)(c, saved);
    case 3: return FMI(SetFMUstate)(c, *saved);
    case 4: return serialize_again(s, kind);
    case 5: return draw(s, 4) == 0 ? FMI(FreeFMUstate)(c, saved) : FMI(OK);
    case 6: return get_partial(s, c);
    case 7: return FMI(SetDebugLogging)(c, draw(s, 4) != 0, 1, &category);
    case 8: return start_again(s, kind);
    case 9: return draw(s, 4) == 0 ? replace(s, kind) : FMI(OK);
    default: return take_step(s, kind);
    }
}

/* ---- Sessions, halves, threads ---- */

static void drive(session *s)
{
    for (size_t i = 0; i < calls_of_a_half; i++) {
        const int kind = (int)draw(s, N_KINDS);
        const result status = any_call(s, kind);
        double values[N_VARIABLES] = {0.0};
        unsigned all[N_VARIABLES];
        for (unsigned j = 0; j < N_VARIABLES; j++) {
            all[j] = FIRST_REFERENCE + j;
        }
        FMI(GetReal)(s->of[kind].instance, all, N_VARIABLES, values AND(N_VARIABLES));
        see(s, &status, sizeof status);
        see(s, values, sizeof values);
        s->accepted += status == FMI(OK);
        s->trace[s->calls++] = s->seen;
    }
}

static void *first_half(void *argument)
{
    session *const s = argument;
    pthread_barrier_wait(&together);
    for (int kind = 0; kind < N_KINDS; kind++) {
        make(s, kind);
        begin(s, kind);
    }
    drive(s);
    return NULL;
}

static void *second_half(void *argument)
{
    session *const s = argument;
    pthread_barrier_wait(&together);
    drive(s);
    for (int kind = 0; kind < N_KINDS; kind++) {
        FMI(FreeFMUstate)(s->of[kind].instance, &s->of[kind].saved);
        FMI(FreeInstance)(s->of[kind].instance);
    }
    return NULL;
}

/* All sessions, as many at a time as there are threads. */
static void drive_all(session sessions[N_SESSIONS], unsigned threads)
{
    void *(*const halves[N_HALVES])(void *) = {first_half, second_half};
    pthread_t thread[N_SESSIONS];
    CHECK(pthread_barrier_init(&together, NULL, threads) == 0);
    for (int half = 0; half < N_HALVES; half++) {
        for (unsigned begun = 0; begun < N_SESSIONS; begun += threads) {
            for (unsigned i = begun; i < begun + threads; i++) {
                CHECK(pthread_create(&thread[i], NULL, halves[half], &sessions[i]) == 0);
            }
            for (unsigned i = begun; i < begun + threads; i++) {
                CHECK(pthread_join(thread[i], NULL) == 0);
            }
        }
    }
    pthread_barrier_destroy(&together);
}

int main(int argc, char *argv[])
{
    CHECK(argc == 2);
    calls_of_a_half = strtoul(argv[1], NULL, 10) / (N_SESSIONS * N_HALVES);
    const size_t size = N_HALVES * calls_of_a_half;
    static session alone[N_SESSIONS], at_once[N_SESSIONS];
    for (unsigned i = 0; i < N_SESSIONS; i++) {
        alone[i].random = at_once[i].random = 88172645463325252u + i;
        alone[i].trace = calloc(size, sizeof *alone[i].trace);
        at_once[i].trace = calloc(size, sizeof *at_once[i].trace);
        CHECK(alone[i].trace != NULL && at_once[i].trace != NULL);
    }
    drive_all(alone, 1);
    drive_all(at_once, N_SESSIONS);
    int differing = 0;
    size_t calls = 0, accepted = 0, messages = 0;
    for (unsigned i = 0; i < N_SESSIONS; i++) {
        size_t equal = 0;
        while (equal < size && alone[i].trace[equal] == at_once[i].trace[equal]) {
            equal++;
        }
        if (equal < size) {
            fprintf(stderr, "threads: session %u differs from call %zu on\n", i, equal);
            differing++;
        }
        calls += at_once[i].calls;
        accepted += at_once[i].accepted;
        messages += at_once[i].messages;
        free(alone[i].trace);
        free(at_once[i].trace);
    }
    printf("calls %zu\naccepted %zu\nmessages %zu\n", calls, accepted, messages);
    return differing == 0 ? 0 : 1;
}
