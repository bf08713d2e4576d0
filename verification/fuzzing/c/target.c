/* The target of libFuzzer: it turns bytes into calls of any FMI function on several instances, and checks the promises of
 * the FMU after each call. It writes the number of calls of each function to the file that FUZZ_COUNTS names. */
#include "interface_calls.h"
#include "state_calls.h"

#define OPERATION(function) call_##function,
static void (*const OPERATIONS[N_CALLS])(slot *) = {EACH_CALL(OPERATION)};

static void any_call(slot *s, unsigned which)
{
    OPERATIONS[which % N_CALLS](s);
}

/* Leave Event Mode for Step Mode or Continuous-Time Mode. */
static void leave_event_mode(slot *s)
{
    if (s->at.type == TYPE_MODEL_EXCHANGE) {
        PLAY(EnterContinuousTimeMode)(s);
    }
#if FMI_VERSION == 3
    if (s->of.events) {
        call_fmi3EnterStepMode(s);
    }
#endif
}

/* Start two instances of each interface, so that few bytes of input reach much of the code. */
static void set_out(void)
{
    manner of = take_manner();
    for (int i = 0; i < N_SLOTS; i++) {
        slot *const s = &slots[i];
        of.is_told = i < 2;
        make(s, (interface_type)(i % 2), of);
        begin(s);
        PLAY(ExitInitializationMode)(s);
        leave_event_mode(s);
    }
}

/* Make any calls in Event Mode. */
static void meet_events(slot *s)
{
    PLAY(EnterEventMode)(s);
    for (unsigned n = take_byte() % 4; n > 0; n--) {
        any_call(s, take_byte());
    }
    leave_event_mode(s);
}

/* Start a new run, with any start values and any end. */
static void start_again(slot *s)
{
    PLAY(Reset)(s);
#if FMI_VERSION == 2
    call_fmi2SetupExperiment(s);
#endif
    PLAY(SetReal)(s);
    PLAY(EnterInitializationMode)(s);
    PLAY(SetReal)(s);
    PLAY(ExitInitializationMode)(s);
    leave_event_mode(s);
}

/* Set inputs and take steps, as in a normal run. */
static void fly(slot *s, unsigned length)
{
    for (unsigned i = 0; i < length; i++) {
        PLAY(SetReal)(s);
        PLAY(DoStep)(s);
        PLAY(SetContinuousStates)(s);
        PLAY(GetDerivatives)(s);
        PLAY(GetReal)(s);
    }
}

/* Step without thrust, load and current, so that drag brakes the vehicle. */
static void coast(slot *s)
{
    static const double nothing[FIRST_STATE];
    unsigned vr[FIRST_STATE];
    for (unsigned i = 0; i < FIRST_STATE; i++) {
        vr[i] = FIRST_REFERENCE + i;
    }
    CALL(s, settable(s, 0), true, SetReal, s->f, vr, FIRST_STATE, nothing AND(FIRST_STATE));
    PLAY(DoStep)(s);
}

static bool is_alike(const manner *a, const manner *b)
{
    return a->events == b->events && a->updates == b->updates && a->returns_early == b->returns_early;
}

/* Check that the same calls after a restored state give the same results, in the instance that was saved and, after
 * serialization, in another one. */
static void replay(slot *s)
{
    slot *const other = &slots[take_byte() % N_SLOTS];
    const unsigned length = take_byte() % 4;
    const size_t start = position;
    if (s->f == NULL || other->f == NULL || s->at.type != other->at.type || !is_alike(&s->of, &other->of)) {
        return;
    }
    const expected at = s->at;
    void *state = NULL, *copy = NULL;
    unsigned char bytes[SERIALIZED_SIZE];
    PROPERTY(FMI(GetFMUstate)(s->f, &state) == DONE, "not saved");
    PROPERTY(FMI(SerializeFMUstate)(s->f, state, (octet *)bytes, sizeof bytes) == DONE, "not serialized");
    PROPERTY(FMI(DeSerializeFMUstate)(other->f, (octet *)bytes, sizeof bytes, &copy) == DONE, "not deserialized");
    uint64_t traces[3];
    for (int i = 0; i < 3; i++) {
        slot *const runner = i < 2 ? s : other;
        PROPERTY(i == 0 || FMI(SetFMUstate)(runner->f, i == 1 ? state : copy) == DONE, "not restored");
        runner->at = at;
        position = start;
        trace = 0;
        fly(runner, length);
        note(runner->f->now.values, FIRST_CALCULATED * sizeof(double));
        note(&runner->f->now.time, sizeof(double));
        traces[i] = trace;
    }
    PROPERTY(traces[0] == traces[1], "a restored state goes another way");
    PROPERTY(traces[0] == traces[2], "a state restored from bytes goes another way in another instance");
    PROPERTY(FMI(FreeFMUstate)(s->f, &state) == DONE && FMI(FreeFMUstate)(s->f, &copy) == DONE, "not freed");
}

/* Serialize a state, perhaps damage the bytes, and restore the state in any instance. */
static void carry(slot *s)
{
    const size_t start = position;
    PLAY(GetFMUstate)(s);
    position = start; /* take the same saved slot again */
    PLAY(SerializeFMUstate)(s);
    if (take_bool()) {
        damage();
    }
    PLAY(DeSerializeFMUstate)(s);
    PLAY(SetFMUstate)(&slots[take_byte() % N_SLOTS]);
}

static void clear_world(void)
{
    if (slots[0].f == NULL) { /* freeing a state needs an instance */
        make(&slots[0], TYPE_CO_SIMULATION, (manner){.logs = false});
    }
    for (int i = 0; i < N_SAVED; i++) {
        PROPERTY(FMI(FreeFMUstate)(slots[0].f, &saves[i].state) == DONE, "not freed");
    }
    for (int i = 0; i < N_SLOTS; i++) {
        free_instance(&slots[i]);
    }
    for (int i = 0; i < N_BUFFERS; i++) {
        free(buffers[i].bytes);
    }
    memset(saves, 0, sizeof saves);
    memset(buffers, 0, sizeof buffers);
}

/* Write a line for each function at the end: its name, the refused calls, the accepted calls. */
__attribute__((destructor)) static void write_counts(void)
{
    const char *const path = getenv("FUZZ_COUNTS");
    FILE *const file = path != NULL ? fopen(path, "w") : NULL;
    for (int i = 0; i < N_CALLS && file != NULL; i++) {
        fprintf(file, "%s %llu %llu\n", CALL_NAMES[i], counts[i][0], counts[i][1]);
    }
    if (file != NULL) {
        fclose(file);
    }
}

/* 10,000 pieces take a tenth of a second under the sanitizers, or a second with six axes. */
enum { MOST_SPENT = (HAS_ATTITUDE ? 1 : 50) * MOST_PIECES };

int LLVMFuzzerTestOneInput(const unsigned char *data, size_t size)
{
    input = data;
    input_size = size;
    position = 0;
    spent = 0;
    set_out();
    while (position < input_size && spent < MOST_SPENT) {
        const unsigned what = take_byte();
        slot *const s = &slots[take_byte() % N_SLOTS];
        if (what < 200) {
            any_call(s, what);
        } else if (what < 208) {
            start_again(s);
        } else if (what < 216) {
            fly(s, take_byte() % 8);
        } else if (what < 225) {
            coast(s);
        } else if (what < 235) {
            replay(s);
        } else if (what < 245) {
            carry(s);
        } else if (what < 248) {
            damage();
        } else if (what < 250) {
            meet_events(s);
        } else if (what < 254) {
            PLAY(Instantiate)(s);
        } else {
            free_instance(s);
        }
        check_instance(s);
    }
    clear_world();
    return 0;
}
