/* Numbers as the bits of a double in hexadecimal, which are exact everywhere. */
#ifndef BITS_H
#define BITS_H

#include <stdio.h>
#include <string.h>

static int read_double(double *value)
{
    unsigned long long bits;
    const int read = scanf("%llx", &bits);
    memcpy(value, &bits, sizeof *value);
    return read == 1;
}

static void write_double(double value, char end)
{
    unsigned long long bits;
    memcpy(&bits, &value, sizeof bits);
    printf("%016llx%c", bits, end);
}

#endif
