/* Eight threads that drive instances of their own, compared call by call with the same calls in one thread.
 *
 * A session is a pair of instances, one of each interface type, and a random sequence of every kind of call, legal or
 * not. It is driven in two halves by different threads, so instances and saved states end in another thread than they
 * began in. Prints how many calls were made, accepted and logged; the exit code is 1 where a session differs. */
#define _POSIX_C_SOURCE 200809L
#include "fmu.c"

#include "check.h"

#include <pthread.h>

enum { N_SESSIONS = 8, N_HALVES = 2, N_KINDS = 2 };

typedef struct {
    uint64_t random, seen; /* state of the generator; hash of all that the calls gave back */
    uint64_t *trace;       /* the hash after each call */
    size_t calls, accepted, messages;
    struct {
        fmi2Component instance;
        fmi2FMUstate saved;
        double time;
    } of[N_KINDS]; /* by fmi2Type */
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

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    session *const s = environment;
    see(s, name, strlen(name));
    see(s, &status, sizeof status);
    see(s, category, strlen(category));
    see(s, message, strlen(message));
    s->messages++;
}

/* ---- The calls ---- */

static void instantiate(session *s, fmi2Type kind)
{
    const fmi2CallbackFunctions callbacks = {logger, NULL, NULL, NULL, s};
    char name[64];
    memset(name, 'n', sizeof name);
    name[1 + draw(s, sizeof name - 1)] = '\0';
    s->of[kind].instance = fmi2Instantiate(name, kind, MODEL_GUID, NULL, &callbacks, fmi2False, draw(s, 2) == 0);
}

static fmi2Status begin(session *s, fmi2Type kind)
{
    fmi2Component const c = s->of[kind].instance;
    fmi2EventInfo info;
    s->of[kind].time = draw_between(s, 0.0, 10.0);
    fmi2Status worst = fmi2SetupExperiment(c, fmi2False, 0.0, s->of[kind].time, fmi2False, 0.0);
    worst |= fmi2EnterInitializationMode(c);
    worst |= fmi2ExitInitializationMode(c);
    if (kind == fmi2ModelExchange) {
        worst |= fmi2NewDiscreteStates(c, &info);
        worst |= fmi2EnterContinuousTimeMode(c);
    }
    return worst;
}

static fmi2Status set_any(session *s, fmi2Component c)
{
    static const double strange[] = {0.0, -0.0, NAN, INFINITY, 1e308, 5e-324};
    const fmi2ValueReference vr = draw(s, N_VARIABLES + 1);
    const bool plain = draw(s, 4) != 0;
    const double value = plain ? draw_between(s, -2.0, 2.0) : strange[draw(s, sizeof strange / sizeof strange[0])];
    return fmi2SetReal(c, &vr, 1, &value);
}

static fmi2Status set_inputs(session *s, fmi2Component c)
{
    fmi2ValueReference vr[FIRST_STATE];
    double values[FIRST_STATE];
    for (unsigned i = 0; i < FIRST_STATE; i++) {
        vr[i] = i;
        values[i] = draw_between(s, -1.1, 1.1);
    }
    return fmi2SetReal(c, vr, FIRST_STATE, values);
}

static fmi2Status step(session *s, fmi2Type kind)
{
    fmi2Component const c = s->of[kind].instance;
    const double h = draw_between(s, 1e-3, 2.0);
    fmi2Status status;
    if (kind == fmi2CoSimulation || draw(s, 20) == 0) {
        status = fmi2DoStep(c, s->of[kind].time, h, fmi2True);
    } else { /* explicit Euler */
        double x[N_STATES], rate[N_STATES];
        status = fmi2GetContinuousStates(c, x, N_STATES);
        status |= fmi2GetDerivatives(c, rate, N_STATES);
        for (int i = 0; i < N_STATES && status == fmi2OK; i++) {
            x[i] += 1e-3 * h * rate[i];
        }
        status |= status == fmi2OK ? fmi2SetContinuousStates(c, x, N_STATES) : fmi2OK;
        status |= fmi2SetTime(c, s->of[kind].time + h);
    }
    s->of[kind].time += h;
    return status;
}

static fmi2Status serialize(session *s, fmi2Type kind)
{
    fmi2Component const c = s->of[kind].instance;
    fmi2Byte bytes[2 * SERIALIZED_SIZE];
    size_t size = 0;
    fmi2Status status = fmi2SerializedFMUstateSize(c, s->of[kind].saved, &size);
    status |= fmi2SerializeFMUstate(c, s->of[kind].saved, bytes, size);
    if (status == fmi2OK) {
        see(s, bytes, size);
        bytes[draw(s, SERIALIZED_SIZE)] ^= draw(s, 4) == 0; /* damaged, now and then */
        status = fmi2DeSerializeFMUstate(c, bytes, size, &s->of[kind].saved);
    }
    return status;
}

static fmi2Status differentiate(session *s, fmi2Component c)
{
    const fmi2ValueReference known = draw(s, FIRST_CALCULATED + 1);
    fmi2ValueReference unknown[N_STATES];
    double seed = 1.0, change[N_STATES] = {0.0};
    for (unsigned i = 0; i < N_STATES; i++) {
        unknown[i] = FIRST_CALCULATED + i;
    }
    const fmi2Status status = fmi2GetDirectionalDerivative(c, unknown, N_STATES, &known, 1, &seed, change);
    see(s, change, sizeof change);
    return status;
}

static fmi2Status reset(session *s, fmi2Type kind)
{
    fmi2Component const c = s->of[kind].instance;
    fmi2Status status = draw(s, 2) == 0 ? fmi2Terminate(c) : fmi2OK;
    status |= fmi2Reset(c);
    for (unsigned i = draw(s, 4); i > 0; i--) {
        set_any(s, c);
    }
    return status | begin(s, kind);
}

static fmi2Status replace(session *s, fmi2Type kind)
{
    fmi2FreeInstance(s->of[kind].instance);
    instantiate(s, kind);
    return begin(s, kind);
}

static fmi2Status any_call(session *s, fmi2Type kind)
{
    fmi2Component const c = s->of[kind].instance;
    fmi2FMUstate *const saved = &s->of[kind].saved;
    const fmi2String category = LOG_CATEGORIES[draw(s, N_LOG_CATEGORIES)];
    switch (draw(s, 16)) {
    case 0: return set_any(s, c);
    case 1: return set_inputs(s, c);
    case 2: return fmi2GetFMUstate(c, saved);
    case 3: return fmi2SetFMUstate(c, *saved);
    case 4: return serialize(s, kind);
    case 5: return draw(s, 4) == 0 ? fmi2FreeFMUstate(c, saved) : fmi2OK;
    case 6: return differentiate(s, c);
    case 7: return fmi2SetDebugLogging(c, draw(s, 4) != 0, 1, &category);
    case 8: return reset(s, kind);
    case 9: return draw(s, 4) == 0 ? replace(s, kind) : fmi2OK;
    default: return step(s, kind);
    }
}

/* ---- Sessions, halves, threads ---- */

static void drive(session *s)
{
    for (size_t i = 0; i < calls_of_a_half; i++) {
        const fmi2Type kind = draw(s, N_KINDS);
        const fmi2Status status = any_call(s, kind);
        double values[N_VARIABLES] = {0.0};
        fmi2ValueReference all[N_VARIABLES];
        for (unsigned j = 0; j < N_VARIABLES; j++) {
            all[j] = j;
        }
        fmi2GetReal(s->of[kind].instance, all, N_VARIABLES, values);
        see(s, &status, sizeof status);
        see(s, values, sizeof values);
        s->accepted += status == fmi2OK;
        s->trace[s->calls++] = s->seen;
    }
}

static void *first_half(void *argument)
{
    session *const s = argument;
    pthread_barrier_wait(&together);
    for (int kind = 0; kind < N_KINDS; kind++) {
        instantiate(s, (fmi2Type)kind);
        begin(s, (fmi2Type)kind);
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
        fmi2FreeFMUstate(s->of[kind].instance, &s->of[kind].saved);
        fmi2FreeInstance(s->of[kind].instance);
    }
    return NULL;
}

/* All sessions, as many at a time as there are threads. */
static void run(session sessions[N_SESSIONS], unsigned threads)
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
    run(alone, 1);
    run(at_once, N_SESSIONS);
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
