/* The complete state: get, set, serialize (FMI 2.0, section 2.1.8). */
#include "fmi2_instance.h"

/* Bytes, least significant first: magic, GUID, type, mode, flags, time, stop, settable values, checksum. */
enum {
    MAGIC_SIZE = 8,
    GUID_SIZE = sizeof MODEL_GUID - 1,
    N_HEADER_WORDS = 5,
    SERIALIZED_SIZE = MAGIC_SIZE + GUID_SIZE + 8 * (N_HEADER_WORDS + N_VARIABLES + 1)
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

/* Whether a state read from bytes could have been reached by calls. */
static bool is_valid(const fmu_state *s)
{
    const int modes = s->type == fmi2ModelExchange ? EVENT | CONTINUOUS : STEP | FAILED;
    const int mode = (int)s->mode;
    bool valid = (mode & (modes | INSTANTIATED | INITIALIZATION | TERMINATED)) != 0
                 && (mode & (mode - 1)) == 0 && isfinite(s->time) && !isnan(s->stop)
                 && (s->experiment_defined || mode == INSTANTIATED);
    for (size_t i = 0; i < N_VARIABLES; i++) {
        const double value = s->values[i];
        const bool bounded = VARIABLES[i].kind == FIXED || VARIABLES[i].kind == TUNABLE;
        valid = valid && isfinite(value)
                && (!bounded || (value >= VARIABLES[i].minimum && value <= VARIABLES[i].maximum));
    }
    return valid;
}

/* What a fmi2FMUstate points to. */
typedef struct {
    const void *owner; /* tells a state of this FMU from other memory */
    fmu_state state;
} saved_state;

static saved_state *as_saved(fmi2FMUstate FMUstate)
{
    saved_state *const saved = (saved_state *)FMUstate;
    return saved != NULL && saved->owner == VARIABLES ? saved : NULL;
}

/* Memory for a state: the one given, or new where none is. */
static saved_state *state_memory(fmi2FMUstate *FMUstate)
{
    if (*FMUstate == NULL) {
        saved_state *const saved = (saved_state *)calloc(1, sizeof *saved);
        if (saved != NULL) {
            saved->owner = VARIABLES;
            *FMUstate = saved;
        }
        return saved;
    }
    return as_saved(*FMUstate);
}

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    OPEN("fmi2GetFMUstate", EVERYWHERE);
    REQUIRE("fmi2GetFMUstate", FMUstate != NULL, "FMUstate is NULL.");
    saved_state *const saved = state_memory(FMUstate);
    REQUIRE("fmi2GetFMUstate", saved != NULL, "out of memory, or *FMUstate is no state of this FMU.");
    saved->state = f->now;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    OPEN("fmi2SetFMUstate", EVERYWHERE);
    const saved_state *const saved = as_saved(FMUstate);
    REQUIRE("fmi2SetFMUstate", saved != NULL, "FMUstate is NULL or no state of this FMU.");
    REQUIRE("fmi2SetFMUstate", saved->state.type == f->now.type, "the state is of the other interface type.");
    f->now = saved->state;
    rov_prepare(f->now.values, &f->gains);
    LOG(f, fmi2OK, logEvents, "Restored %s at t = %g s.", mode_name(f->now.mode), f->now.time);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    OPEN("fmi2FreeFMUstate", EVERYWHERE);
    if (FMUstate == NULL || *FMUstate == NULL) {
        return fmi2OK;
    }
    saved_state *const saved = as_saved(*FMUstate);
    REQUIRE("fmi2FreeFMUstate", saved != NULL, "*FMUstate is no state of this FMU.");
    saved->owner = NULL;
    free(saved);
    *FMUstate = NULL;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    OPEN("fmi2SerializedFMUstateSize", EVERYWHERE);
    REQUIRE("fmi2SerializedFMUstateSize", as_saved(FMUstate) != NULL && size != NULL,
            "FMUstate is NULL or no state of this FMU, or size is NULL.");
    *size = SERIALIZED_SIZE;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                             size_t size)
{
    OPEN("fmi2SerializeFMUstate", EVERYWHERE);
    const saved_state *const saved = as_saved(FMUstate);
    REQUIRE("fmi2SerializeFMUstate", saved != NULL && serializedState != NULL,
            "FMUstate is NULL or no state of this FMU, or serializedState is NULL.");
    REQUIRE("fmi2SerializeFMUstate", size >= SERIALIZED_SIZE, "%zu bytes are too few, it takes %d.", size,
            (int)SERIALIZED_SIZE);
    const fmu_state *const s = &saved->state;
    unsigned char *const bytes = (unsigned char *)serializedState;
    unsigned char *to = bytes + MAGIC_SIZE + GUID_SIZE;
    memcpy(bytes, MAGIC, MAGIC_SIZE);
    memcpy(bytes + MAGIC_SIZE, MODEL_GUID, GUID_SIZE);
    put_word(&to, (uint64_t)s->type);
    put_word(&to, (uint64_t)s->mode);
    put_word(&to, (s->experiment_defined ? 1u : 0u) | (s->stop_defined ? 2u : 0u));
    put_double(&to, s->time);
    put_double(&to, s->stop);
    for (size_t i = 0; i < N_VARIABLES; i++) {
        put_double(&to, VARIABLES[i].kind == CALCULATED ? 0.0 : s->values[i]);
    }
    put_word(&to, checksum(bytes, SERIALIZED_SIZE - 8));
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                               fmi2FMUstate *FMUstate)
{
    OPEN("fmi2DeSerializeFMUstate", EVERYWHERE);
    REQUIRE("fmi2DeSerializeFMUstate", serializedState != NULL && FMUstate != NULL,
            "serializedState or FMUstate is NULL.");
    REQUIRE("fmi2DeSerializeFMUstate", size == SERIALIZED_SIZE, "%zu bytes are no state of this FMU, it has %d.", size,
            (int)SERIALIZED_SIZE);
    const unsigned char *const bytes = (const unsigned char *)serializedState;
    const unsigned char *from = bytes + SERIALIZED_SIZE - 8;
    REQUIRE("fmi2DeSerializeFMUstate",
            memcmp(bytes, MAGIC, MAGIC_SIZE) == 0 && memcmp(bytes + MAGIC_SIZE, MODEL_GUID, GUID_SIZE) == 0,
            "the bytes are not a state of this FMU.");
    REQUIRE("fmi2DeSerializeFMUstate", get_word(&from) == checksum(bytes, SERIALIZED_SIZE - 8),
            "the bytes are damaged.");
    from = bytes + MAGIC_SIZE + GUID_SIZE;
    const uint64_t type = get_word(&from), mode = get_word(&from), flags = get_word(&from);
    REQUIRE("fmi2DeSerializeFMUstate", type <= 1 && mode <= FAILED && flags <= 3, "the bytes are damaged.");
    fmu_state s;
    memset(&s, 0, sizeof s);
    s.type = (fmi2Type)type;
    s.mode = (lifecycle)mode;
    s.experiment_defined = (flags & 1u) != 0;
    s.stop_defined = (flags & 2u) != 0;
    s.time = get_double(&from);
    s.stop = get_double(&from);
    for (size_t i = 0; i < N_VARIABLES; i++) {
        s.values[i] = get_double(&from);
    }
    REQUIRE("fmi2DeSerializeFMUstate", is_valid(&s), "the bytes hold values that no run can reach.");
    saved_state *const saved = state_memory(FMUstate);
    REQUIRE("fmi2DeSerializeFMUstate", saved != NULL, "out of memory, or *FMUstate is no state of this FMU.");
    saved->state = s;
    return fmi2OK;
}
