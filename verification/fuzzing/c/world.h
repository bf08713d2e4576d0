/* The state of the fuzzer: the bytes that give values, the instances, the saved states, and what the standard expects. */
#pragma once

#include <float.h>
#include <stdbool.h>
#include <stdlib.h>

static bool memory_is_full;

static void *calloc_or_not(size_t count, size_t size)
{
    return memory_is_full ? NULL : calloc(count, size);
}

#define FMI3_OVERRIDE_FUNCTION_PREFIX
#define calloc calloc_or_not
#include "fmu.c"
#undef calloc
#include "check.h"
#include "legal.h"
#include "versions.h"

#ifndef HAS_LAG /* an autopilot, which has no motion */
#define IS_AUTOPILOT
#define HAS_LAG 0
enum { N_OTHER = 0, N_MEMORY = 0, N_ADDED = 0, FIRST_OTHER = FIRST_COMMAND, FIRST_COEFFICIENT = FIRST_COMMAND, FIRST_ADDED = N_VARIABLES };
#endif

#define WHICH(name) PASTE(CALL_, FMI(name))
#define PLAY(name) PASTE(call_, FMI(name))

enum { N_SLOTS = 4, N_SAVED = 3, N_BUFFERS = 3 };
enum { MAY_OVERFLOW = HAS_LAG || HAS_ATTITUDE }; /* outputs that are not derivatives follow from states */

/* The state of an instance that the standard demands after its calls so far. Its values are not used. */
typedef fmu_state expected;

/* How an instance was made: whether it has a logger and, for Co-Simulation of FMI 3.0, what its host uses. */
typedef struct {
    bool logs, is_told, events, updates, returns_early; /* is_told: loggingOn */
} manner;

typedef struct {
    fmu *f;
    manner of;
    expected at;
    struct updates *inside; /* the step that is in progress */
} slot;

typedef struct {
    void *state;
    expected at;
} saved_slot;

/* Serialized bytes, with a checksum that shows changes. */
typedef struct {
    unsigned char *bytes;
    size_t size;
    uint64_t sum;
    bool forged; /* its content is not known */
    expected at;
} buffer;

static slot slots[N_SLOTS];
static saved_slot saves[N_SAVED];
static buffer buffers[N_BUFFERS];
static unsigned spent; /* pieces that the steps of an input may have taken */

static void any_call(slot *s, unsigned which);

/* ---- Values from the fuzzer's bytes; zeros after their end ---- */

static const unsigned char *input;
static size_t input_size, position;

static unsigned take_byte(void)
{
    return position < input_size ? input[position++] : 0;
}

static bool take_bool(void)
{
    return (take_byte() & 1) != 0;
}

static uint64_t take_word(int bytes)
{
    uint64_t word = 0;
    for (int i = 0; i < bytes; i++) {
        word = word << 8 | take_byte();
    }
    return word;
}

static double take_real(void)
{
    static const double special[] = {
        0.0, -0.0, 1.0, -1.0, 1.0 + DBL_EPSILON, -1.0 - DBL_EPSILON, 0.3, 1e-3, 1e-9, 1e3, 1e9, -1e9, 1e-300, 1e150,
        -1e150, 1e300, DBL_MIN, -DBL_MIN, 4.9406564584124654e-324, -4.9406564584124654e-324, DBL_MAX, -DBL_MAX,
        INFINITY, -INFINITY, NAN};
    const unsigned form = take_byte();
    double value;
    uint64_t word;
    switch (form % 4) {
    case 0:
        return special[take_byte() % (sizeof special / sizeof special[0])];
    case 1: /* any bits */
        word = take_word(8);
        memcpy(&value, &word, sizeof value);
        return value;
    case 2: /* any magnitude, exactly */
        return ldexp((double)take_byte() - 127.0, (int)take_byte() - 127);
    default: /* as a user sets it */
        return ((double)take_byte() - 127.0) / 100.0;
    }
}

/* Free the memory of a pointer at the end of its block (LENT). */
static void release(const void *pointer)
{
    free(*(void *const *)pointer);
}

#define LENT __attribute__((cleanup(release)))

/* Return memory of exactly this size, so that the sanitizer sees an access beyond it. */
static void *exactly(size_t count, size_t size)
{
    void *const memory = malloc(count * size);
    PROPERTY(memory != NULL, "out of memory");
    memset(memory, 0xa5, count * size);
    return memory;
}

static size_t take_count(void)
{
    const unsigned n = take_byte();
    return n < 240 ? n % 4 : n % (N_VARIABLES + 3);
}

static unsigned take_reference(void)
{
    const unsigned n = take_byte();
    if (n < 100) {
        return FIRST_REFERENCE + n % FIRST_STATE; /* an input */
    }
    if (n < 150) {
        return FIRST_REFERENCE + FIRST_ADDED - 1 - n % 8; /* a tuning parameter */
    }
    if (n < 245) {
        return FIRST_REFERENCE + n % N_VARIABLES;
    }
    return n < 253 ? FIRST_REFERENCE + N_VARIABLES + n % 4 : (unsigned)take_word(4);
}

/* ---- One call: whether it was right to accept or refuse it, and whether it changed only what it may change ---- */

typedef enum { FORBIDDEN, ALLOWED, EITHER } verdict;

static unsigned long long counts[N_CALLS][2]; /* refused, accepted */
static uint64_t trace;                        /* a checksum of all results; two runs of the same bytes give the same one */
static unsigned messages;                     /* logged during the call */

/* Besides new places in the code, libFuzzer counts each function in each mode, and each state that was saved in each mode,
 * by kind of instance, as new. Without these counters, most illegal calls would look alike. */
enum { WITH_EVENTS = 2, N_KINDS, N_MODES = 8 }; /* beyond the interface types */
#define LEADS __attribute__((section("__libfuzzer_extra_counters")))
static unsigned char called[N_CALLS][N_KINDS][N_MODES][2] LEADS;
static unsigned char restored[N_CALLS][N_KINDS][N_MODES] LEADS;

static _Alignas(fmu) unsigned char instances_before[N_SLOTS][sizeof(fmu)];
static saved_state saves_before[N_SAVED];

static void note(const void *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        trace = (trace ^ ((const unsigned char *)bytes)[i]) * 1099511628211u;
    }
}

/* Copy an instance without its calculated variables, which follow from the rest, and without the last function. */
static void copy_instance(unsigned char *to, const fmu *from)
{
    memcpy(to, from, sizeof *from);
    ((fmu *)(void *)to)->function = NULL;
    memset(&((fmu *)(void *)to)->now.values[FIRST_CALCULATED], 0,
           (N_STATES + N_OTHER - N_MEMORY) * sizeof(double));
    memset(((fmu *)(void *)to)->now.values + FIRST_ADDED, 0, N_ADDED * sizeof(double));
}

static fmu *before(const slot *s)
{
    return (fmu *)(void *)instances_before[s - slots];
}

/* Return true when an instance has not changed. `speaks`: it may have given a warning that is given only once. */
static bool is_same(const slot *s, bool speaks)
{
    if (s->f == NULL) {
        return true;
    }
    _Alignas(fmu) unsigned char now[sizeof(fmu)];
    copy_instance(now, s->f);
    if (speaks) {
        memcpy(before(s)->warned, s->f->warned, sizeof s->f->warned);
    }
    return memcmp(now, before(s), sizeof now) == 0;
}

static void before_call(void)
{
    messages = 0;
    for (int i = 0; i < N_SLOTS; i++) {
        if (slots[i].f != NULL) {
            copy_instance(instances_before[i], slots[i].f);
        }
    }
    for (int i = 0; i < N_SAVED; i++) {
        if (saves[i].state != NULL) {
            memcpy(&saves_before[i], saves[i].state, sizeof saves_before[i]);
        }
    }
}

/* Return the row of LEGAL. */
static int kind_of(const slot *s)
{
    return s->of.events ? WITH_EVENTS : (int)s->at.type;
}

static int number(lifecycle mode)
{
    return __builtin_ctz((unsigned)mode);
}

static verdict legal(const slot *s, call which, bool arguments)
{
    return s->f != NULL && arguments && (LEGAL[kind_of(s)][which] & (int)s->at.mode) != 0 ? ALLOWED : FORBIDDEN;
}

/* Check a call and return whether it was accepted. `changes`: an accepted call may change its instance. */
static bool after_call(const slot *s, call which, verdict wanted, int status, bool changes)
{
    const char *const name = CALL_NAMES[which];
    const bool accepted = status == DONE;
    PROPERTY(accepted || status == REFUSED || status == DISCARDED, "%s returns %d", name, status);
    PROPERTY(wanted == EITHER || accepted == (wanted == ALLOWED), "%s: %s in %s returns %d", name,
             wanted == ALLOWED ? "legal" : "illegal", s->f == NULL ? "no instance" : mode_name(s->at.mode), status);
    for (int i = 0; i < N_SLOTS; i++) {
        const bool own = s == &slots[i] && accepted;
        PROPERTY((own && changes) || is_same(&slots[i], own), "%s changes instance %d", name, i);
    }
    for (int i = 0; i < N_SAVED; i++) {
        PROPERTY(accepted || saves[i].state == NULL
                     || memcmp(&saves_before[i], saves[i].state, sizeof saves_before[i]) == 0,
                 "%s is refused and changes a saved state", name);
    }
    if (!accepted && s->f != NULL && s->of.logs) {
        const bool enabled = s->f->log_enabled[status == DISCARDED ? logStatusDiscard : logStatusError];
        PROPERTY(messages == (enabled ? 1u : 0u), "%s is refused with %u messages", name, messages);
    }
    note(&status, sizeof status);
    counts[which][accepted]++;
    if (s->f != NULL) {
        called[which][kind_of(s)][number(s->at.mode)][accepted] = 1;
    }
    return accepted;
}

/* Call a function of the FMU, and after_call with its status. `good`: its arguments are valid. */
#define CALL_AS(s, wanted, changes, name, ...) \
    (before_call(), after_call(s, WHICH(name), wanted, (int)FMI(name)(__VA_ARGS__), changes))
#define CALL(s, good, changes, name, ...) CALL_AS(s, legal(s, WHICH(name), good), changes, name, __VA_ARGS__)

/* True when new discrete states may change an instance: in Model Exchange, commands begin and end their dead time there. */
static bool has_own_events(const slot *s)
{
    return HAS_DEAD_TIME && s->f != NULL && s->at.type == TYPE_MODEL_EXCHANGE;
}

/* Check the time at which the next command will act, as the FMU tells it. */
static void check_next_event(const slot *s, bool defined, double next)
{
    PROPERTY(!defined || (has_own_events(s) && next > s->at.time), "a command acts at %g, after t = %g", next, s->at.time);
}

/* Return true when no result can overflow. */
static bool is_moderate(const fmu *f)
{
    double numbers[sizeof f->numbers / sizeof(double)];
    bool moderate = true;
    memcpy(numbers, &f->numbers, sizeof numbers);
    for (int i = 0; i < FIRST_CALCULATED; i++) {
        moderate = moderate && fabs(f->now.values[i]) <= 1e30;
    }
#if HAS_ATTITUDE
    const double *const q = &f->now.values[REF_eta];
    moderate = moderate && hypot(hypot(q[0], q[1]), hypot(q[2], q[3])) >= 1e-30;
#endif
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        moderate = moderate && fabs(numbers[i]) <= 1e30; /* false for a NaN */
    }
    return moderate;
}
