/* libFuzzer target: bytes become calls of any FMI function on several instances, and after each call it is looked
 * whether it kept its promises. How often each was called goes to the file that FUZZ_COUNTS names. */
#include "interface_calls.h"
#include "state_calls.h"

#define OPERATION(function) call_##function,
static void (*const OPERATIONS[N_CALLS])(slot *) = {EACH_CALL(OPERATION)};

/* An instance of each interface in two slots each, running: few bytes lead far. */
static void set_out(void)
{
    for (int i = 0; i < N_SLOTS; i++) {
        slot *const s = &slots[i];
        instantiate(s, "rov", i % 2, MODEL_GUID, true, true, i < 2);
        fmi2SetupExperiment(s->f, fmi2False, 0.0, 0.0, fmi2False, 0.0);
        s->at.experiment_defined = true;
        call_fmi2EnterInitializationMode(s);
        call_fmi2ExitInitializationMode(s);
        if (s->at.type == fmi2ModelExchange) {
            call_fmi2EnterContinuousTimeMode(s);
        }
    }
}

/* A run from its start, with any start values and end. */
static void start_again(slot *s)
{
    call_fmi2Reset(s);
    call_fmi2SetupExperiment(s);
    call_fmi2SetReal(s);
    call_fmi2EnterInitializationMode(s);
    call_fmi2SetReal(s);
    call_fmi2ExitInitializationMode(s);
    if (s->at.type == fmi2ModelExchange) {
        call_fmi2EnterContinuousTimeMode(s);
    }
}

/* Sets and steps, as a run has them. */
static void run(slot *s, unsigned length)
{
    for (unsigned i = 0; i < length; i++) {
        call_fmi2SetReal(s);
        call_fmi2DoStep(s);
        call_fmi2SetContinuousStates(s);
        call_fmi2GetDerivatives(s);
        call_fmi2GetReal(s);
    }
}

/* No thrust, no load, no current: what moves is braked. */
static void coast(slot *s)
{
    static const double nothing[FIRST_STATE];
    fmi2ValueReference vr[FIRST_STATE];
    for (unsigned i = 0; i < FIRST_STATE; i++) {
        vr[i] = i;
    }
    CALL(s, true, true, fmi2SetReal, s->f, vr, FIRST_STATE, nothing);
    call_fmi2DoStep(s);
}

/* The same bytes from the same state give the same calls and the same results: in the instance that was saved, and in
 * another one by way of bytes. */
static void replay(slot *s)
{
    slot *const other = &slots[take_byte() % N_SLOTS];
    const unsigned length = take_byte() % 4;
    const size_t start = position;
    if (s->f == NULL || other->f == NULL || s->at.type != other->at.type) {
        return;
    }
    const expected at = s->at;
    fmi2FMUstate state = NULL, copy = NULL;
    unsigned char bytes[SERIALIZED_SIZE];
    PROPERTY(fmi2GetFMUstate(s->f, &state) == fmi2OK, "not saved");
    PROPERTY(fmi2SerializeFMUstate(s->f, state, (fmi2Byte *)bytes, sizeof bytes) == fmi2OK, "not serialized");
    PROPERTY(fmi2DeSerializeFMUstate(other->f, (fmi2Byte *)bytes, sizeof bytes, &copy) == fmi2OK, "not deserialized");
    uint64_t traces[3];
    for (int i = 0; i < 3; i++) {
        slot *const runner = i < 2 ? s : other;
        PROPERTY(i == 0 || fmi2SetFMUstate(runner->f, i == 1 ? state : copy) == fmi2OK, "not restored");
        runner->at = at;
        position = start;
        trace = 0;
        run(runner, length);
        note(runner->f->now.values, FIRST_CALCULATED * sizeof(double));
        note(&runner->f->now.time, sizeof(double));
        traces[i] = trace;
    }
    PROPERTY(traces[0] == traces[1], "a restored state goes another way");
    PROPERTY(traces[0] == traces[2], "a state restored from bytes goes another way in another instance");
    PROPERTY(fmi2FreeFMUstate(s->f, &state) == fmi2OK && fmi2FreeFMUstate(s->f, &copy) == fmi2OK, "not freed");
}

/* A state by way of bytes that may be damaged on the way, into any instance. */
static void carry(slot *s)
{
    const size_t start = position;
    call_fmi2GetFMUstate(s);
    position = start; /* the same place again */
    call_fmi2SerializeFMUstate(s);
    if (take_bool()) {
        damage();
    }
    call_fmi2DeSerializeFMUstate(s);
    call_fmi2SetFMUstate(&slots[take_byte() % N_SLOTS]);
}

static void clear_world(void)
{
    if (slots[0].f == NULL) { /* states are freed by an instance */
        instantiate(&slots[0], "rov", fmi2CoSimulation, MODEL_GUID, false, true, false);
    }
    for (int i = 0; i < N_SAVED; i++) {
        PROPERTY(fmi2FreeFMUstate(slots[0].f, &saves[i].state) == fmi2OK, "not freed");
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

/* At the end. Lines of: function, calls refused, calls accepted. */
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

enum { MOST_WILD = 50 }; /* of 10,000 pieces each, which take a tenth of a second under the sanitizers */

int LLVMFuzzerTestOneInput(const unsigned char *data, size_t size)
{
    input = data;
    input_size = size;
    position = 0;
    wild = 0;
    set_out();
    while (position < input_size && wild < MOST_WILD) {
        const unsigned what = take_byte();
        slot *const s = &slots[take_byte() % N_SLOTS];
        if (what < 200) {
            OPERATIONS[what % N_CALLS](s);
        } else if (what < 208) {
            start_again(s);
        } else if (what < 216) {
            run(s, take_byte() % 8);
        } else if (what < 225) {
            coast(s);
        } else if (what < 235) {
            replay(s);
        } else if (what < 245) {
            carry(s);
        } else if (what < 248) {
            damage();
        } else if (what < 254) {
            call_fmi2Instantiate(s);
        } else {
            free_instance(s);
        }
        check_instance(s);
    }
    clear_world();
    return 0;
}
