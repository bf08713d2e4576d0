/* PROPERTY and CHECK test a condition. When it is false, the program prints the condition and its place, and aborts. */
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
