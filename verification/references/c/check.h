/* What must hold in a C program: where it does not, the program says what and where, and aborts. */
#pragma once

#include <stdio.h>
#include <stdlib.h>

#define PROPERTY(holds, ...)                                             \
    do {                                                                 \
        if (!(holds)) {                                                  \
            fprintf(stderr, "broken property (%s): ", #holds);           \
            fprintf(stderr, __VA_ARGS__);                                \
            fprintf(stderr, "\n");                                       \
            abort();                                                     \
        }                                                                \
    } while (0)
#define CHECK(holds) PROPERTY(holds, "%s:%d", __FILE__, __LINE__)
