/* The functions that save and restore states, with states and bytes of any origin. */
#pragma once

#include "world.h"

static void *foreign[8]; /* memory that is no state */

static saved_slot *take_saved(void)
{
    return &saves[take_byte() % N_SAVED];
}

static void PLAY(GetFMUstate)(slot *s)
{
    saved_slot *const to = take_saved();
    const unsigned n = take_byte();
    void *other = foreign;
    void **const at = n < 240 ? &to->state : n < 248 ? &other : NULL;
    memory_is_full = n >= 230 && n < 240;
    const bool good = n < 240 && !(memory_is_full && to->state == NULL);
    if (CALL(s, good, false, GetFMUstate, s->f, at)) {
        to->at = s->at;
    }
    memory_is_full = false;
    PROPERTY(other == foreign, "memory that is no state is taken");
}

/* Return the modes in which an instance of an interface, made like this one, can be saved. */
static int modes_of(const slot *s, interface_type type)
{
    return BETWEEN & ~(type == TYPE_MODEL_EXCHANGE ? STEP | FAILED : s->of.events ? CONTINUOUS : EVENT | CONTINUOUS);
}

static void PLAY(SetFMUstate)(slot *s)
{
    saved_slot *const from = take_saved();
    const bool own = take_byte() < 240;
    if (s->f != NULL && own && from->state != NULL) {
        restored[WHICH(SetFMUstate)][kind_of(s)][number(from->at.mode)] = 1;
    }
    const bool good = own && from->state != NULL && from->at.type == s->at.type
                      && ((int)from->at.mode & modes_of(s, s->at.type)) != 0;
    if (CALL(s, good, true, SetFMUstate, s->f, own ? from->state : foreign)) {
        s->at = from->at;
    }
}

static void PLAY(FreeFMUstate)(slot *s)
{
    saved_slot *const from = take_saved();
    const unsigned n = take_byte();
    void *other = foreign;
    void **const freed = n < 240 ? &from->state : n < 248 ? &other : NULL;
    const bool accepted = CALL(s, n < 240 || n >= 248, false, FreeFMUstate, s->f, freed);
    PROPERTY(!accepted || n >= 240 || from->state == NULL, "a freed state is still there");
}

static void PLAY(SerializedFMUstateSize)(slot *s)
{
    const saved_slot *const from = take_saved();
    const unsigned n = take_byte();
    size_t size = 12345;
    const bool good = from->state != NULL && n < 240;
    const bool accepted = CALL(s, good, false, SerializedFMUstateSize, s->f, from->state, n < 240 ? &size : NULL);
    PROPERTY(size == (accepted ? SERIALIZED_SIZE : 12345), "%zu bytes", size);
}

static void PLAY(SerializeFMUstate)(slot *s)
{
    const saved_slot *const from = take_saved();
    buffer *const to = &buffers[take_byte() % N_BUFFERS];
    const unsigned n = take_byte();
    const size_t size = n < 200 ? SERIALIZED_SIZE : n < 250 ? SERIALIZED_SIZE - 2 + n % 5 : take_word(1);
    unsigned char *const bytes = exactly(size, 1);
    const bool good = from->state != NULL && size >= SERIALIZED_SIZE;
    if (CALL(s, good, false, SerializeFMUstate, s->f, from->state, (octet *)bytes, size)) {
        free(to->bytes);
        *to = (buffer){bytes, size, checksum(bytes, size), false, from->at};
        return;
    }
    for (size_t i = 0; i < size; i++) {
        PROPERTY(bytes[i] == 0xa5, "a refused call writes bytes");
    }
    free(bytes);
}

/* Damage bytes, or write values into them that a run may or may not reach, with a correct checksum. */
static void damage(void)
{
    buffer *const b = &buffers[take_byte() % N_BUFFERS];
    if (b->bytes == NULL || b->size != SERIALIZED_SIZE) {
        return;
    }
    unsigned char *const bytes = b->bytes;
    const bool forge = take_bool();
    const size_t at = (size_t)take_word(2) % SERIALIZED_SIZE, word = at % (N_HEADER_WORDS + N_VARIABLES);
    if (forge) {
        const double value = take_real();
        unsigned char *to = bytes + MAGIC_SIZE + TOKEN_SIZE + 8 * word;
        if (word < 3) {
            put_word(&to, take_byte());
        } else {
            put_double(&to, value);
        }
        to = bytes + SERIALIZED_SIZE - 8;
        put_word(&to, checksum(bytes, SERIALIZED_SIZE - 8));
        b->sum = checksum(bytes, SERIALIZED_SIZE);
        b->forged = true;
    } else {
        bytes[at] ^= (unsigned char)take_byte();
    }
}

static void PLAY(DeSerializeFMUstate)(slot *s)
{
    const buffer *const from = &buffers[take_byte() % N_BUFFERS];
    saved_slot *const to = take_saved();
    const bool whole = from->bytes != NULL && from->size == SERIALIZED_SIZE
                       && checksum(from->bytes, from->size) == from->sum;
    memory_is_full = take_byte() >= 250;
    if (s->f != NULL && whole && !from->forged) {
        restored[WHICH(DeSerializeFMUstate)][kind_of(s)][number(from->at.mode)] = 1;
    }
    const bool fits = from->forged || ((int)from->at.mode & modes_of(s, from->at.type)) != 0;
    verdict wanted = legal(s, WHICH(DeSerializeFMUstate), whole && fits && !(memory_is_full && to->state == NULL));
    wanted = wanted == ALLOWED && from->forged ? EITHER : wanted;
    const bool accepted = CALL_AS(s, wanted, false, DeSerializeFMUstate, s->f, (octet *)from->bytes, from->size, &to->state);
    memory_is_full = false;
    if (!accepted) {
        return;
    }
    const fmu_state *const state = &((saved_state *)to->state)->state;
    to->at = from->forged ? *state : from->at;
    const int modes = modes_of(s, state->type), mode = (int)state->mode;
    PROPERTY((modes & mode) != 0 && (mode & (mode - 1)) == 0, "a state in mode %d", mode);
    for (int i = 0; i < N_VARIABLES; i++) {
        PROPERTY(isfinite(state->values[i]), "a state with %s = %g", VARIABLES[i].name, state->values[i]);
    }
}
