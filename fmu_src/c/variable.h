/* What the FMI layer knows of a variable; interface.h has the table of them, by value reference. */
#ifndef VARIABLE_H
#define VARIABLE_H

typedef enum { INPUT, STATE, CALCULATED, FIXED, TUNABLE } variable_kind;

typedef struct {
    const char *name;
    variable_kind kind;
    double start, minimum, maximum, nominal;
} variable_info;

#endif
