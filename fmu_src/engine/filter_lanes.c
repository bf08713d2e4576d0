/* The filter for several sets of parameters at once, one in each lane of a vector. */
#include "vectors.h"

#include "filter.c"
